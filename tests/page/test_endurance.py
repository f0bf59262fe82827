"""Ten tabs that are dragged all the time: memory stays flat, and nothing is left when they have gone.

Some seconds here; SOFTSTART_MINUTES=5 drags for five minutes and says what was measured.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.page.conftest import at_rest

TABS = 10
MINUTES = float(os.environ.get("SOFTSTART_MINUTES", "0.1"))
ROOM = 24.0  # MB by which memory may still grow: some lists have not reached their lengths yet
GONE = 15.0  # s; a tab may come back for ten


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


def sockets(pid: int) -> int:
    """Open sockets of a process."""
    links = Path(f"/proc/{pid}/fd").iterdir()
    return sum(os.readlink(link).startswith("socket:") for link in links)


@pytest.mark.slow
def test_ten_tabs_that_are_dragged(visit: Any, start_server: Callable[..., Any]) -> None:
    server = start_server()
    pid = server.process.pid
    alone = visit(url=server.url)
    at_rest(alone)
    before = sockets(pid)
    pages = [visit(url=server.url) for _ in range(TABS)]
    boxes = []
    for page in pages:
        page.bring_to_front()
        page.wait_for_selector("#k-dyn[data-value]", timeout=60_000)
        boxes.append(page.locator('[data-path="shaft.gap"] input[type=range]').bounding_box())
        page.mouse.move(boxes[-1]["x"] + 20, boxes[-1]["y"] + 8)
        page.mouse.down()
    measured = []
    begun = time.monotonic()
    while (now := time.monotonic() - begun) < 60.0 * MINUTES:
        for k, (page, box) in enumerate(zip(pages, boxes, strict=True)):
            share = abs((now / 3.0 + 0.1 * k) % 2.0 - 1.0)
            page.mouse.move(box["x"] + 10 + share * (box["width"] - 20), box["y"] + 8)
        measured.append((now, memory(pid), heap(pages[0]) if len(measured) % 50 == 0 else measured[-1][2]))
    for page in pages:
        page.mouse.up()
    fifth = next(k for k, one in enumerate(measured) if one[0] > 12.0 * MINUTES)
    for what, place in (("server", 1), ("script", 2)):
        early = max(one[place] for one in measured[: fifth + 1])
        late = max(one[place] for one in measured[-(len(measured) // 5) - 1 :])
        print(f"{what}: {measured[0][place]:.1f} MB, {early:.1f} in its first fifth, {late:.1f} at last")
        assert late < early + ROOM
    for page in pages:
        page.context.close()
    latest = time.monotonic() + GONE
    while (left := sockets(pid)) > before and time.monotonic() < latest:
        time.sleep(0.1)
    print(f"{len(measured)} moves of each tab; sockets {before} before, {left} after; jobs {server.jobs()}")
    assert left <= before
    assert len(server.jobs()) <= 1  # it waits for the next job
    server.end()
