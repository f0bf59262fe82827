"""Who is let in: names, origins, the token; and what the command refuses in a sentence."""

from __future__ import annotations

import asyncio
import importlib
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from softstart import InputError
from softstart.page.address import Address
from softstart.page.serve import listening

pytest.importorskip("nicegui", reason="NiceGUI is missing: pip install 'softstart[ui]'")
guards = importlib.import_module("softstart.page.guard")

TOKEN = "a-token-of-some-length"


def ask(guard, kind: str = "http", more=(), query: str = "", method: str = "GET", **headers: str):
    """What the guard answers: (status or close code, headers, whether the app was reached)."""
    reached: list[str] = []
    sent: list[dict] = []

    async def app(scope, receive, send):
        reached.append(scope["type"])
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b""})

    async def receive():
        return {"type": f"{kind}.connect"}

    async def send(message):
        sent.append(message)

    guard.app.app = app
    pairs = [(key.encode(), value.encode()) for key, value in headers.items()] + [*more]
    scope = {"type": kind, "method": method, "path": "/", "query_string": query.encode(), "headers": pairs}
    asyncio.run(guard(scope, receive, send))
    first = sent[0] if sent else {}
    return first.get("status", first.get("code")), dict(first.get("headers", [])), bool(reached)


def local(**options):
    return guards.guarded(None, Address(**options), 8765)


LOCAL = "localhost:8765"
FOREIGN = [
    *({"host": one} for one in ("evil.example:8765", "localhost.evil.example", "127.0.0.1@evil.example",
                                "127.0.0.1/evil", "192.168.1.7:8765", "", "[::1")),
    {},
    *({"host": LOCAL, "origin": one} for one in ("http://evil.example", "http://localhost:9999",
                                                 "http://localhost:8765.evil.example", "null",
                                                 "file://localhost:8765")),
]  # fmt: skip


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_names_of_this_machine_are_let_in_and_foreign_names_and_origins_are_not(kind):
    for host in (LOCAL, "127.0.0.1:8765", "[::1]:8765", "LOCALHOST", "127.0.0.1:9000"):
        assert ask(local(), kind, host=host, origin=f"http://{host}")[2]
    for headers in FOREIGN:
        code, _, reached = ask(local(), kind, **headers)
        assert (code, reached) == (403 if kind == "http" else 1008, False), headers
    two = ask(local(), kind, [(b"host", b"evil.example")], host="localhost")
    assert (two[0], two[2]) == (403 if kind == "http" else 1008, False)


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_with_a_token_nobody_comes_in_without_it(kind):
    guard = local(token=TOKEN)
    for cookie in ("", "softstart-8765=x", f"softstart-8765={TOKEN}", "softstart-8765=\xe9"):
        code, _, reached = ask(guard, kind, host="localhost", cookie=cookie)
        assert not reached
        assert code == (401 if kind == "http" else 1008)
    assert not ask(guard, kind, query=f"token={TOKEN}x", host="localhost")[2]
    assert not ask(guard, "websocket", query=f"token={TOKEN}", host="localhost")[2]
    assert not ask(guard, "http", query=f"token={TOKEN}", method="POST", host="localhost")[2]


def test_the_token_opens_once_and_the_cookie_stands_for_it_then():
    guard = local(token=TOKEN)
    code, headers, reached = ask(guard, query=f"token={TOKEN}", host="localhost")
    assert (code, reached) == (200, False)
    cookie = headers[b"set-cookie"].decode()
    assert "httponly; samesite=strict" in cookie
    assert TOKEN not in cookie
    shown = cookie.partition(";")[0]
    assert ask(guard, "http", host="localhost", cookie=f"a=b; {shown}")[2]
    assert ask(guard, "websocket", host="localhost", cookie=shown)[2]
    assert not ask(local(token=TOKEN), "http", host="localhost", cookie=shown)[2]  # of another process
    assert not ask(guard, "http", host="evil.example", cookie=shown)[2]


def test_an_odd_cookie_of_another_program_does_not_hide_the_pass():
    """Cookies are shared between the ports of a host; some programs write JSON into theirs."""
    guard = local(token=TOKEN)
    _, headers, _ = ask(guard, query=f"token={TOKEN}", host="localhost")
    shown = headers[b"set-cookie"].decode().partition(";")[0]
    for other in ('state={"a": 1, "b": [2]}', "x", "=;;", "caf\xe9=\xe9"):
        assert ask(guard, host="localhost", cookie=f"{other}; {shown}")[2], other
        assert not ask(guard, host="localhost", cookie=f"{other}; {shown}x")[2], other


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_foreign_page_can_link_here_and_embed_nothing(site):
    """An image of a foreign page has no Origin, and each would build a page and start all strategies."""
    for dest, reached in (("document", True), ("image", False), ("iframe", False), (None, False)):
        headers = {"host": LOCAL, "sec-fetch-site": site} | ({"sec-fetch-dest": dest} if dest else {})
        assert ask(local(), **headers)[2] == reached
    assert ask(local(), host=LOCAL, **{"sec-fetch-site": "same-origin", "sec-fetch-dest": "image"})[2]


def test_bodies_have_an_end():
    own = {"host": "localhost", "origin": "http://localhost"}
    assert ask(local(), method="POST", **own, **{"content-length": "65536"})[2]
    for length in (str(guards.MOST_BODY + 1), "9" * 5000, "many"):
        code, _, reached = ask(local(), method="POST", **own, **{"content-length": length})
        assert (code, reached) == (413, False)

    taken = []

    async def app(scope, receive, send):
        while (message := await receive())["type"] == "http.request":
            taken.append(len(message["body"]))

    async def receive():
        return {"type": "http.request", "body": bytes(1 << 16), "more_body": True}

    scope = {"type": "http", "method": "POST", "headers": [(b"host", b"localhost")]}
    asyncio.run(guards.guarded(app, Address(), 8765)(scope, receive, None))
    assert sum(taken) == guards.MOST_BODY


def test_answers_forbid_foreign_names_and_the_browser_to_ask_anyone_else():
    guard = local(host="0.0.0.0", token=TOKEN, expose=True)
    assert ask(guard, host="192.168.1.7:8765")[0] == 401  # asked for its token
    assert ask(guard, host="evil.example:8765")[0] == 403
    policy = ask(local(), host="localhost")[1][b"content-security-policy"]
    assert b"default-src 'self'" in policy
    assert b"frame-ancestors 'none'" in policy


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"host": "0.0.0.0"}, "--expose and --token"),
        ({"host": "192.168.1.7", "expose": True}, "add --token TOKEN,"),
        ({"host": "192.168.1.7", "token": TOKEN}, "add --expose,"),
        ({"host": "evil.example"}, "--expose"),
        ({"token": "short"}, "guessed"),
        ({"token": ""}, "the token is empty; use at least 16"),  # not as if none were asked for
        ({"host": "0.0.0.0", "expose": True, "token": ""}, "the token is empty"),
        ({"token": "a" * 20 + "\n"}, "letters and digits only"),
        ({"token": "\N{CYRILLIC SMALL LETTER SHA}" * 20}, "letters and digits only"),
        ({"host": "", "expose": True, "token": TOKEN}, "is empty; give one"),  # it would be all of them
        ({"port": 99999}, "0 to 65535"),
    ],
)
def test_dangerous_addresses_are_refused_with_the_remedy(options, said):
    with pytest.raises(InputError, match=said):
        Address(**options).check()


def test_addresses_that_are_fine_and_a_port_in_use():
    for options in (
        {},
        {"host": "::1"},
        {"host": "127.0.0.9"},
        {"host": "0.0.0.0", "expose": True, "token": TOKEN},
    ):
        Address(**options).check()
    assert Address(host="::1").url(80) == "http://[::1]:80/"
    assert Address(token="a&b" * 9).url(1).endswith("?token=" + "a%26b" * 9)
    told = pytest.raises(InputError, match="the port is in use")
    with listening(Address(port=0)) as taken, told:
        listening(Address(port=taken.getsockname()[1]))


MAIN = "from softstart.cli import main; sys.argv.insert(1, 'serve'); sys.exit(main())"
HIDDEN = (
    "import importlib.util as u; find = u.find_spec;"
    "u.find_spec = lambda name, *a: None if name == 'nicegui' else find(name, *a);"
)


@pytest.mark.parametrize(
    ("before", "arguments", "said"),
    [
        ("", "--host 0.0.0.0 --port -4 --token abc", ["--host 0.0.0.0", "--port -4", "guessed"]),
        (HIDDEN, "--no-browser", ["pip install 'softstart[ui]'"]),
    ],
)  # fmt: skip
def test_the_command_tells_all_mistakes_at_once(before, arguments, said):
    words = [sys.executable, "-c", f"import sys; {before}{MAIN}", *arguments.split()]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert [words for words in said if words not in done.stderr] == []


@pytest.mark.slow
def test_the_web_framework_reads_and_stores_nothing_that_others_could_plant():
    """A pipe under a known name in the folder for temporary files made the server wait indefinitely."""
    code = (
        "from softstart import Drive; from softstart.page import serve;"
        "serve.application(Drive.load('crane-4amtkf')); from nicegui import app; print(app.storage.path)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    folder = Path(done.stdout.strip())
    with pytest.raises(OSError, match=r"Not a directory|File exists"):
        folder.mkdir(parents=True)


def test_it_serves_until_it_is_interrupted_and_leaves_nothing(tmp_path):
    server = subprocess.Popen(
        [sys.executable, "-c", f"import sys; {MAIN}", "--port", "0", "--no-browser"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        line = server.stdout.readline()
        assert line.startswith("softstart is at http://127.0.0.1:")
        url = line.split()[3]
        with urllib.request.urlopen(url, timeout=120) as got:
            text = got.read().decode()
            (cookie,) = got.headers.get_all("set-cookie")
            assert re.fullmatch(r"softstart-\d+=[\w.=-]+; path=/; httponly; samesite=strict", cookie)
        assert "softstart: Crane travel drive" in text
        port = int(url.rstrip("/").rpartition(":")[2])
        upgrade = (
            b"GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n"
            b"Host: localhost:%d\r\nOrigin: %s\r\n"
            b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Key: c29mdHN0YXJ0IHNlcnZlIQ==\r\n\r\n"
        )
        own = b"http://localhost:%d" % port
        for request, answer in (
            (b"GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n", b" 403 "),
            (upgrade % (port, b"http://evil.example"), b" 403 "),
            (upgrade % (port, own), b" 101 "),
        ):
            with socket.create_connection(("127.0.0.1", port), timeout=120) as raw:
                raw.sendall(request)
                assert answer in raw.recv(200)
        server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=120) == 130
        errors = server.stderr.read()
        assert "interrupted" in errors.splitlines()[0]
        assert len(errors.splitlines()) == 1
        assert list(tmp_path.iterdir()) == []
    finally:
        server.kill()
        server.wait()
        server.stdout.close()
        server.stderr.close()
