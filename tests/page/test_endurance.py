"""Ten tabs that are dragged all the time: memory stays flat."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

TABS = 10
MOVES = 60  # of each tab
ROOM = 24.0  # MB by which memory may still grow: some lists have not reached their lengths yet


def memory(pid: int) -> float:
    """Resident memory of a process, MB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    found = re.search(r"VmRSS:\s*(\d+) kB", status)
    assert found
    return int(found[1]) / 1024.0


def heap(page: Any) -> float:
    """What the scripts of a tab hold after a collection, MB."""
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    used = float(session.send("Runtime.getHeapUsage")["usedSize"])
    session.detach()
    return used / 2**20


@pytest.mark.slow
def test_ten_tabs_that_are_dragged(visit: Any, start_server: Callable[..., Any]) -> None:
    server = start_server()
    pid = server.process.pid
    pages = [visit(url=server.url) for _ in range(TABS)]
    boxes = []
    for page in pages:
        page.bring_to_front()
        page.wait_for_selector("#k-dyn[data-value]", timeout=60_000)
        boxes.append(page.locator('[data-path="shaft.gap"] input[type=range]').bounding_box())
        page.mouse.move(boxes[-1]["x"] + 20, boxes[-1]["y"] + 8)
        page.mouse.down()
    server_memory, script_memory = [], []
    for move in range(MOVES):
        for k, (page, box) in enumerate(zip(pages, boxes, strict=True)):
            share = abs((move / 10.0 + 0.1 * k) % 2.0 - 1.0)
            page.mouse.move(box["x"] + 10 + share * (box["width"] - 20), box["y"] + 8)
        server_memory.append(memory(pid))
        if move % 12 == 0:
            script_memory.append(heap(pages[0]))
    for page in pages:
        page.mouse.up()
    for measured in (server_memory, script_memory):
        fifth = max(len(measured) // 5, 1)
        assert max(measured[-fifth:]) < max(measured[:fifth]) + ROOM
    for page in pages:
        page.context.close()
    server.end()
