"""What a hostile program on this machine can send to the page: it is dropped or answered in a sentence.

Nothing may be printed, no process left, and after all of it another tab gets its figures.
"""

from __future__ import annotations

import json
import random
import re
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from typing import Any
from urllib.parse import urlencode, urlsplit

import pytest

from softstart import Drive, simulate

sync_client = pytest.importorskip("websockets.sync.client", reason="comes with NiceGUI: make page")
ConnectionClosed = pytest.importorskip("websockets.exceptions").ConnectionClosed

INTERNAL = "Internal error in softstart"
ESCAPED = (("&#36;", "$"), ("&#96;", "`"), ("&gt;", ">"), ("&lt;", "<"), ("&amp;", "&"))


class Tab:
    """A page without a browser: what NiceGUI's script does, and what it never would."""

    def __init__(self, url: str) -> None:
        self.place = urlsplit(url).netloc
        with urllib.request.urlopen(url, timeout=30) as got:
            text = got.read().decode()
        found = re.search(r"'client_id': '([^']+)'", text)
        inside = re.search(r"parseElements\(String\.raw`(.*?)`\)", text, re.DOTALL)
        assert found
        assert inside
        elements = inside[1]
        for escaped, plain in ESCAPED:
            elements = elements.replace(escaped, plain)
        self.client = found[1]
        self.elements: dict[str, dict[str, Any]] = json.loads(elements)
        self.stamp = 1.0
        query = {
            "EIO": 4, "transport": "websocket", "client_id": self.client, "next_message_id": 0,
            "implicit_handshake": "true", "document_id": random.random(), "tab_id": random.random(),
        }  # fmt: skip
        address = f"ws://{self.place}/_nicegui_ws/socket.io/?{urlencode(query)}"
        own = f"http://{self.place}"
        self.held = ExitStack()
        line = sync_client.connect(address, origin=own, max_size=None, close_timeout=2)
        self.line = self.held.enter_context(line)
        self.line.send("40")

    def close(self) -> None:
        self.held.close()

    def happen(self, element: str, kind: str, *args: Any) -> None:
        """What a script sends when something happens to an element."""
        listener = next(e for e in self.elements[element]["events"] if e["type"] == kind)["listener_id"]
        told = {"client_id": self.client, "id": int(element), "listener_id": listener}
        self.line.send("42" + json.dumps(["event", told | {"args": [json.dumps(arg) for arg in args]}]))

    def act(self, **message: Any) -> float:
        """A message of the live part; returns its stamp."""
        self.stamp += 1.0
        self.happen("4", "act", {"stamp": self.stamp, **message})
        return self.stamp

    def answer(self, stamp: float) -> dict[str, Any]:
        """The first full frame that knows of a message; each is answered, so that the next ones are sent."""
        latest = time.monotonic() + 60.0
        while (left := latest - time.monotonic()) > 0.0:
            text = self.line.recv(timeout=left)
            if text == "2":
                self.line.send("3")
            if not isinstance(text, str) or not text.startswith("42"):
                continue
            assert INTERNAL not in text
            code = json.loads(text[2:])[1].get("code", "").replace("\n", "")
            if called := re.search(r'"frame", \[(.*)\]\)', code):
                number, frame = json.loads(f"[{called[1]}]")
                if number:
                    self.act(what="drawn", number=number)
                if "fields" in frame and frame["stamp"] >= stamp:
                    return frame
        raise AssertionError("the page does not answer")


@pytest.fixture(scope="module")
def attacked(start_server: Callable[..., Any]) -> Any:
    """A server that only this test sees."""
    server = start_server()
    server.seen = 0
    return server


@pytest.fixture
def own(attacked: Any) -> Any:
    """The server; after each test it has printed nothing, and another tab is served."""
    yield attacked
    assert attacked.process.poll() is None
    with closing(Tab(attacked.url)) as tab:
        frame = tab.answer(tab.act(what="select", name="direct"))
        assert frame["figure"]["k_dyn"] == simulate(Drive.load("crane-4amtkf"), "direct").k_dyn
    said = attacked.said().splitlines()[attacked.seen :]
    attacked.seen += len(said)
    assert [line for line in said if line and not line.startswith("softstart is at")] == []


def junk(chance: random.Random, depth: int = 0) -> Any:
    """Any value that JSON can carry, and some that it should not."""
    plain = chance.choice([
        None, True, 0, -1, 2**63, 10**400, 0.5, -1e308, 5e-324, float("nan"), float("inf"), "", "direct",
        "shaft.gap", "\x00", "\ud800", "a" * 5000, "<b>",
    ])  # fmt: skip
    if depth == 3 or chance.random() < 0.7:
        return plain
    inner = [junk(chance, depth + 1) for _ in range(chance.randrange(4))]
    return inner if chance.random() < 0.5 else {f"{k}{plain}"[:20]: one for k, one in enumerate(inner)}


def frames_of_junk(chance: random.Random, tab: Tab) -> Iterator[str | bytes]:
    """Frames that no engine.io client sends."""
    yield from (
        "", "4", "42", "42[", "42[]", "42null", "42[1]", '42[["event"]]', '42[{"event":1}]', "40/other,",
        "41", "439[1]", '451-["event",{"_placeholder":true,"num":0}]', '459-["event"]', "47", "5", "6", "0",
        "2probe", "x", "\x00", b"", b"\xff" * 50, "42" + "[" * 50_000, '42["event",' + '{"a":' * 20_000,
        '42["event",NaN]', "42[1e999]", '42["event",{"client_id":"\\ud800"}]', "42999999999999999999[]",
        '42["event","' + "1" * 3_000_000 + '"]',
    )  # fmt: skip
    names = ["event", "handshake", "ack", "log", "javascript_response", "connect", "disconnect", "x", ""]
    listeners = [(k, e["listener_id"]) for k, v in tab.elements.items() for e in v.get("events", [])]
    for _ in range(150):
        element, listener = chance.choice(listeners)
        known = {
            "client_id": tab.client, "id": int(element), "listener_id": listener, "args": [junk(chance)],
            "document_id": "x", "next_message_id": 0, "level": "error", "message": "x", "request_id": "x",
        }  # fmt: skip
        broken = {k: junk(chance) if chance.random() < 0.2 else v for k, v in known.items()}
        yield "42" + json.dumps([chance.choice(["event", *names]), broken])
        yield f"4{chance.randrange(8)}" + json.dumps([junk(chance), junk(chance)])


def test_frames_of_junk(own: Any) -> None:
    """Malformed JSON, wrong names of events, arguments of other types: the line may be cut, no more."""
    tab = Tab(own.url)
    for frame in frames_of_junk(random.Random(1), tab):
        try:
            tab.line.send(frame)
        except ConnectionClosed:
            tab.close()
            tab = Tab(own.url)
    tab.close()
    # what has come through has changed nothing for a tab that is opened now, and no more than one job
    with closing(Tab(own.url)) as later:
        frame = later.answer(later.act(what="select", name="ramp"))
    crane = Drive.load("crane-4amtkf")
    assert (frame["drive"], frame["steps"], frame["mistakes"]) == (crane.name, [1, 0], {})
    assert frame["figure"]["k_dyn"] == simulate(crane, "ramp").k_dyn
