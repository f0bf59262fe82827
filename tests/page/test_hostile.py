"""What a hostile program on this machine can send to the page: it is dropped or answered in a sentence.

Nothing may be printed, no process left, and after all of it another tab gets its figures. Each part is drawn
from a seed; SOFTSTART_ATTACKS=20 sends twenty times as much, SOFTSTART_SEED draws other ones.
"""

from __future__ import annotations

import http.client
import json
import os
import random
import re
import string
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import islice
from types import TracebackType
from typing import Any
from urllib.parse import urlencode, urlsplit

import pytest

from softstart import Drive, simulate
from softstart.drive import PARAMETERS

sync_client = pytest.importorskip("websockets.sync.client", reason="comes with NiceGUI: make page")
ConnectionClosed = pytest.importorskip("websockets.exceptions").ConnectionClosed

TIMES = int(os.environ.get("SOFTSTART_ATTACKS", "1"))
SEED = int(os.environ.get("SOFTSTART_SEED", "1"))
OWN_FAULT = "mistake in softstart"
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
        self.held = ExitStack()
        self.line = self.held.enter_context(
            sync_client.connect(
                f"ws://{self.place}/_nicegui_ws/socket.io/?{urlencode(query)}",
                origin=f"http://{self.place}",
                max_size=None,
                close_timeout=2,
            )
        )
        self.send("40")
        self.faults: list[str] = []  # what the page has called a mistake of its own

    def __enter__(self) -> Tab:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.held.close()

    def send(self, frame: str | bytes) -> None:
        """Any frame."""
        self.line.send(frame)

    def emit(self, *event: Any) -> None:
        """A socket.io event."""
        self.send("42" + json.dumps(event))

    def happen(self, element: str, kind: str, *args: Any) -> None:
        """What a script sends when something happens to an element."""
        listener = next(e for e in self.elements[element]["events"] if e["type"] == kind)["listener_id"]
        self.emit(
            "event",
            {"client_id": self.client, "id": int(element), "listener_id": listener,
             "args": [json.dumps(arg) for arg in args]},
        )  # fmt: skip

    def act(self, **message: Any) -> float:
        """A message of the live part; returns its stamp."""
        self.stamp += 1.0
        self.happen("4", "act", {"stamp": self.stamp, **message})
        return self.stamp

    def named(self, name: str) -> str:
        """The element of a name."""
        return next(k for k, e in self.elements.items() if e.get("props", {}).get("data-testid") == name)

    def frames(self, seconds: float = 20.0) -> Iterator[dict[str, Any]]:
        """Frames as they come; each is answered, so that the next ones are sent."""
        latest = time.monotonic() + seconds
        while (left := latest - time.monotonic()) > 0.0:
            try:
                text = self.line.recv(timeout=left)
            except TimeoutError:
                return
            if text == "2":
                self.send("3")
            if not isinstance(text, str) or not text.startswith("42"):
                continue
            if OWN_FAULT in text:
                self.faults.append(text)
            content = json.loads(text[2:])[1]
            called = re.search(r'"frame", \[(.*)\]\)', content.get("code", "").replace("\n", ""))
            if called:
                number, frame = json.loads(f"[{called[1]}]")
                if number:
                    self.act(what="drawn", number=number)
                yield frame

    def answer(self, stamp: float) -> dict[str, Any]:
        """The first full frame that knows of a message."""
        for frame in self.frames():
            if "fields" in frame and frame["stamp"] >= stamp:
                return frame
        raise AssertionError("the page does not answer")


@pytest.fixture(scope="module")
def attacked(start_server: Callable[..., Any]) -> Any:
    """A server that only these tests see."""
    server = start_server()
    server.seen = 0
    return server


@pytest.fixture
def own(attacked: Any) -> Any:
    """The server; after each test it has printed nothing, and another tab is served."""
    yield attacked
    assert attacked.process.poll() is None
    with Tab(attacked.url) as tab:
        frame = tab.answer(tab.act(what="select", name="direct"))
        assert frame["figure"]["k_dyn"] == simulate(Drive.load("crane-4amtkf"), "direct").k_dyn
    said = attacked.said().splitlines()[attacked.seen :]
    attacked.seen += len(said)
    assert [line for line in said if line and not line.startswith("softstart is at")] == []


def junk(chance: random.Random, depth: int = 0) -> Any:
    """Any value that JSON can carry, and some that it should not."""
    kinds: list[Callable[[], Any]] = [
        lambda: None,
        lambda: chance.choice([True, False]),
        lambda: chance.choice([0, -1, 1, 7, 2**31, 2**63, -(2**63), 10**400, 4, 106, 137]),
        lambda: chance.choice([0.5, -0.0, 1e308, -1e308, 5e-324, float("nan"), float("inf")]),
        lambda: chance.choice(["", "0", "direct", "shaft.gap", "\x00", "\ud800", "a" * 5000, "<b>", "../.."]),
        lambda: "".join(chance.choices(string.printable, k=chance.randrange(30))),
    ]  # fmt: skip
    if depth < 3:
        kinds += [
            lambda: [junk(chance, depth + 1) for _ in range(chance.randrange(4))],
            lambda: {str(junk(chance, 3))[:20]: junk(chance, depth + 1) for _ in range(chance.randrange(4))},
        ]
    return chance.choice(kinds)()


def frames_of_junk(chance: random.Random, tab: Tab) -> Iterator[str | bytes]:
    """Frames that no engine.io client sends."""
    names = ["event", "handshake", "ack", "log", "javascript_response", "connect", "disconnect", "x", ""]
    yield from (
        "", "4", "42", "42[", "42[]", "42{}", "42null", "42[1]", '42[["event"]]', '42[{"event":1}]', "420[",
        "40", "40/other,", '40{"a":1}', "41", "41/other,", "43[]", "439[1]", '44{"a":1}', "45", "451-[]",
        '451-["event",{"_placeholder":true,"num":0}]', '459-["event"]', "46[]", "47", "49", "5", "6", "0",
        "2probe", "1x", "9", "x", "\x00", b"", b"\xff" * 50, b"4" * 9, "42" + "[" * 50_000,
        '42["event",' + '{"a":' * 20_000,
        '42["event",NaN]', "42[1e999]", '42["event",{"client_id":"\\ud800"}]', "42999999999999999999[]",
        '42["event"' + ",1" * 2000 + "]", "4" + "2" * 5000,
    )  # fmt: skip
    while True:
        kind = chance.randrange(4)
        if kind == 0:
            yield "".join(chance.choices('0123456789[]{}",:-abc', k=chance.randrange(40)))
        elif kind == 1:
            yield chance.randbytes(chance.randrange(60))
        elif kind == 2:
            yield f"4{chance.randrange(8)}" + json.dumps([junk(chance) for _ in range(chance.randrange(4))])
        else:
            known = {
                "client_id": tab.client, "id": 4, "listener_id": "x", "args": [], "tab_id": "x",
                "document_id": "x", "next_message_id": 0, "level": "error", "message": "x", "request_id": "x",
            }  # fmt: skip
            broken = {k: junk(chance) if chance.random() < 0.3 else v for k, v in known.items()}
            if chance.random() < 0.5:
                broken.pop(chance.choice(list(broken)))
            yield "42" + json.dumps([chance.choice(names), broken])


def test_frames_of_junk(own: Any) -> None:
    """Malformed JSON, wrong names of events, arguments of other types: the line may be cut, no more."""
    chance = random.Random(SEED)
    tab = Tab(own.url)
    for frame in islice(frames_of_junk(chance, tab), 400 * TIMES):
        try:
            tab.send(frame)
        except ConnectionClosed:
            tab.held.close()
            tab = Tab(own.url)
    tab.held.close()


def test_messages_beyond_the_size(own: Any) -> None:
    for size in (900_000, 1_100_000, 3_000_000, 20_000_000):
        tab = Tab(own.url)
        try:
            tab.emit("event", {"client_id": tab.client, "id": 4, "listener_id": "x", "args": ["1" * size]})
            for _ in tab.frames(0.5):
                pass
        except ConnectionClosed:
            pass
        tab.held.close()


def test_events_of_elements_with_junk(own: Any) -> None:
    """Everything that listens, with arguments of any type; elements that never were; listeners of others."""
    chance = random.Random(SEED)
    with Tab(own.url) as tab:
        listeners = [(k, e["listener_id"]) for k, v in tab.elements.items() for e in v.get("events", [])]
        for _ in range(500 * TIMES):
            element, listener = chance.choice(listeners)
            if chance.random() < 0.1:
                element = chance.choice([element, "999999", "3", "x", ""])
            args: Any = [json.dumps(junk(chance)) for _ in range(chance.randrange(3))]
            if chance.random() < 0.2:
                args = junk(chance)
            tab.emit("event", {"client_id": tab.client, "id": int(element) if element.isdigit() else element,
                               "listener_id": listener, "args": args})  # fmt: skip
            for _ in tab.frames(0.002):
                pass


def test_messages_of_the_live_part_with_junk(own: Any) -> None:
    """What the browser's script cannot have sent changes nothing, and is called nobody's mistake."""
    chance = random.Random(SEED)
    whats = ["slide", "edit", "reset", "jump", "select", "show", "remove", "keep", "leave", "undo", "redo",
             "hello", "drawn", "window"]  # fmt: skip
    known = {
        "path": "shaft.gap", "position": 300, "text": "1", "name": "ramp", "visible": True, "kept": True,
        "gap": 0.5, "inertia": 0.1, "number": 1, "link": "x", "begin": 0.1, "end": 0.2,
    }  # fmt: skip
    with Tab(own.url) as tab:
        for _ in range(400 * TIMES):
            message = {k: junk(chance) if chance.random() < 0.4 else v for k, v in known.items()}
            if chance.random() < 0.3:
                message.pop(chance.choice(list(known)))
            stamp = {} if chance.random() < 0.8 else {"stamp": junk(chance)}
            tab.act(what=chance.choice([*whats, junk(chance)]), **message, **stamp)
            for _ in tab.frames(0.002):
                pass
        tab.answer(tab.act(what="select", name="direct"))
        assert tab.faults == []


VALUES = (
    "", " ", "0", "-1", "1e-308", "5e-324", "1e400", "1e308", "-1e308", "1e9 rpm", "9" * 400,
    "-0", "nan", "inf", "-inf",
    "0x10", "1,5", "1.000,5", "0,0,5", "1;2", "1 2", "[1, 2]", "{}", "true", "none", "'", '"', "1 N*m",
    "1 m", "1 rad", "1 s", "880 rpm", "5 %", "1__0", "\u0661", "9" * 5000,
    "1 " + "m*" * 500 + "m", "(" * 400, "1" + "^9" * 60, "2**9**9**9", "<img src=x onerror=alert(1)>",
    "\x00", "a\nb", "\u202e5", "active", "reactive", "no-pull", "modelica", "x" * 100_000,
)  # fmt: skip


def test_every_field_with_every_value(own: Any) -> None:
    """Each is taken, or refused in a sentence beside its field; the field then shows what was there."""
    chance = random.Random(SEED)
    paths = [p.path for p in PARAMETERS.values()]
    pairs = [(path, value) for path in paths for value in VALUES]
    chance.shuffle(pairs)
    with Tab(own.url) as tab:
        fields = tab.answer(tab.act(what="select", name="direct"))["fields"]
        crane = Drive.load("crane-4amtkf").to_toml().encode()
        for path, value in pairs[: 60 * TIMES]:
            asked = time.monotonic()
            frame = tab.answer(tab.act(what="edit", path=path, text=value))
            assert tab.faults == [], (path, value[:40])
            if frame["fields"].get(path) == fields.get(path):
                assert len(str(frame["mistakes"])) < 4000, (path, value[:40])
            else:
                assert not frame["mistakes"], (path, value[:40])
            assert upload(tab, crane) < 400
            assert time.monotonic() - asked < 10.0, (path, value[:40])


def files(chance: random.Random) -> Iterator[bytes]:
    """Files that are no drive."""
    text = Drive.load("crane-4amtkf").to_toml().encode()
    yield from (
        b"", b"\x00" * 100, b"\xff\xfe" * 100, b"[" * 60_000, b"a = [\n" + b"[\n" * 20_000,
        b"a = " + b"{b=" * 600, b"a." * 900 + b"a = 1",
        b"\n".join(b"[" + b"a." * 900 + b"a%d]" % k for k in range(30)), b"t,u\n0,0\n1,5\n",
        b"0,0,10,5\n0,1,62\n", b"\n" * 60_000, b"a = 1\n" * 9000, b'a = "' + b"x" * 60_000,
        b"a = 1" * 60_000, b"name = '''" + b"\n" * 60_000 + b"'''",
        b"[motor]\ninertia = " + b"9" * 1900, b"x = 1979-05-27T07:32:00Z", b"[shaft]\ngap = [0.1, 0.2]",
        b"a" * 3_000_000, b"[load]\ninertia = {}\n",
        text.replace(b"crane", b"<script>alert(1)</script>"), text.replace(b"=", b"= ="), text + text,
    )  # fmt: skip
    while True:
        broken = bytearray(text)
        for _ in range(chance.randrange(1, 6)):
            broken[chance.randrange(len(broken))] = chance.randrange(256)
        yield bytes(broken)


def test_files_that_are_no_drive(own: Any) -> None:
    chance = random.Random(SEED)
    with Tab(own.url) as tab:
        for content in islice(files(chance), 30 * TIMES):
            name = chance.choice(["a.toml", "../../a.toml", "a\r\nb", '"', "x" * 3000, "\u202egpj.toml"])
            asked = time.monotonic()
            assert upload(tab, content, name) < 500
            tab.answer(tab.act(what="select", name="ramp"))
            assert time.monotonic() - asked < 10.0
        for body in (b"", b"--B", b"--B\r\n\r\n", b"--B\r\nContent-Disposition: x\r\n\r\n1\r\n--B--"):
            for kind in ("multipart/form-data; boundary=B", "multipart/form-data", "text/plain", ""):
                post(tab, tab.elements[tab.named("drive-upload")]["props"]["url"], body, kind)
        tab.answer(tab.act(what="select", name="direct"))
        assert tab.faults == []


def upload(tab: Tab, content: bytes, name: str = "a.toml") -> int:
    """Load a file as a browser does; the status that comes back."""
    head = f'--B\r\nContent-Disposition: form-data; name="f"; filename="{name}"\r\n\r\n'.encode()
    url = tab.elements[tab.named("drive-upload")]["props"]["url"]
    return post(tab, url, head + content + b"\r\n--B--\r\n", "multipart/form-data; boundary=B")


def post(tab: Tab, path: str, body: bytes, kind: str) -> int:
    """The status that comes back; 0 where the line was cut."""
    line = http.client.HTTPConnection(tab.place, timeout=20)
    try:
        line.request("POST", path, body, {"Content-Type": kind} if kind else {})
        return line.getresponse().status
    except (ConnectionError, http.client.HTTPException):
        return 0
    finally:
        line.close()


def test_requests_of_junk(own: Any) -> None:
    """Other paths, other methods, polling without a session, broken payloads."""
    chance = random.Random(SEED)
    place = urlsplit(own.url).netloc
    with Tab(own.url) as tab:
        paths = [
            "/", "/x", "/_nicegui_ws/socket.io/", "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
            "/_nicegui_ws/socket.io/?EIO=3&transport=polling",
            "/_nicegui_ws/socket.io/?EIO=4&transport=x",
            "/_nicegui_ws/socket.io/?EIO=4&transport=polling&sid=x",
            "/_nicegui_ws/socket.io/?EIO=x&sid=",
            f"/_nicegui_ws/socket.io/?EIO=4&transport=polling&implicit_handshake=true&client_id={tab.client}",
            f"/_nicegui_ws/socket.io/?EIO=4&transport=websocket&implicit_handshake=x&client_id={tab.client}",
            f"/_nicegui/client/{tab.client}/upload/4", f"/_nicegui/client/{tab.client}/upload/x",
            "/%ff", "/%00", "/_nicegui/x/static/../../../etc/passwd",
            "/_nicegui/3/esm/softstart-page/../../serve.py", "//", "/?" + "a" * 60_000,
        ]  # fmt: skip
        for _ in range(150 * TIMES):
            line = http.client.HTTPConnection(place, timeout=20)
            method = chance.choice(["GET", "POST", "HEAD", "PUT", "DELETE", "OPTIONS", "X"])
            body = chance.choice([b"", b"40", b"42[\x1e42[", b"\xff" * 100, b"4" * 70_000, b"6\x1e5\x1e4"])
            try:
                line.request(method, chance.choice(paths), body if method == "POST" else None)
                got = line.getresponse()
                assert b"root:" not in got.read()
                assert got.status != 500, (method, got.status)
            except (ConnectionError, http.client.HTTPException):
                pass
            finally:
                line.close()


@pytest.mark.slow
def test_tabs_that_close_in_the_middle_of_a_job(own: Any) -> None:
    """Several at once, some without a word; what they asked for ends with them."""
    chance = random.Random(SEED)
    for _ in range(TIMES):
        tabs = [Tab(own.url) for _ in range(4)]
        for tab in tabs:
            for name in ("optimum-go", "curve-go", "tuning-go", "export-report"):
                tab.happen(tab.named(name), "click", {})
        latest = time.monotonic() + 30.0
        while len(own.jobs()) < 2:
            assert time.monotonic() < latest
            time.sleep(0.05)
        time.sleep(chance.random())
        for tab in tabs:
            if chance.random() < 0.5:
                tab.line.socket.close()
            tab.held.close()
    latest = time.monotonic() + 60.0  # a tab may come back for ten seconds
    quiet = time.monotonic()
    while time.monotonic() - quiet < 3.0:
        assert time.monotonic() < latest, own.processes()
        time.sleep(0.1)
        if len(own.jobs()) > 1:  # one process waits for the next job
            quiet = time.monotonic()
