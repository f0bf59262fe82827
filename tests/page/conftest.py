"""A server in an empty folder and a real browser; nothing may go wrong unseen in either.

Run with `make page`, or `pytest tests/page --page`. Chromium is the one on the path or that of
SOFTSTART_CHROMIUM.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from tests.patience import patient

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
PATIENCE = 60.0  # s for the server to be there, on a machine that does much else
MARK = "SOFTSTART_PAGE_TEST"
SOFTSTART = str(Path(sys.executable).with_name("softstart"))

Visit = Callable[..., Any]


class Server:
    """A `softstart serve` of its own, started in an empty folder."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        self.mark = uuid.uuid4().hex
        self.log = folder.with_suffix(".log")
        environment = os.environ | {
            MARK: self.mark, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1",
            "SOFTSTART_BUDGET": "2",
        }  # fmt: skip
        with self.log.open("w", encoding="utf-8") as stream:
            self.process = subprocess.Popen(
                [SOFTSTART, "serve", "--port", "0", "--no-browser", *arguments],
                cwd=folder, env=environment, stdout=stream, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        self.url = self._address()

    def _address(self) -> str:
        latest = time.monotonic() + PATIENCE
        while time.monotonic() < latest:
            found = re.search(r"softstart is at (http://\S+)", self.said())
            if found:
                return found[1]
            if self.process.poll() is not None:
                break
            time.sleep(0.05)
        self.process.kill()
        raise AssertionError(f"the server did not start:\n{self.said()}")

    def said(self) -> str:
        """Everything that the server has printed."""
        return self.log.read_text(encoding="utf-8")

    def processes(self) -> dict[int, str]:
        """Numbers and command lines of all processes that descend from this server, itself left out."""
        return {pid: line for pid, line in marked(self.mark).items() if pid != self.process.pid}

    def jobs(self) -> list[int]:
        """The processes in which something may be computed: not the one that watches shared memory."""
        return [pid for pid, line in self.processes().items() if "resource_tracker" not in line]

    def end(self) -> None:
        """Ctrl-C; then nothing may be left: no process, no file, no traceback."""
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        latest = time.monotonic() + 3.0
        while (left := self.processes()) and time.monotonic() < latest:
            time.sleep(0.05)
        assert not left, f"processes outlived the server: {left}"
        assert code in (0, 130), f"the server ended with {code}:\n{self.said()}"
        assert list(self.folder.iterdir()) == [], "the server has written into the folder it was started in"
        assert "Traceback" not in self.said(), self.said()


def settled(page: Any, expression: str) -> Any:
    """The value of an expression that has not changed for a second: a busy machine is behind the hand."""
    value = None
    while value != (value := page.evaluate(expression)):
        page.wait_for_timeout(1000)
    return value


def comes_to(read: Callable[[], Any], wanted: Any) -> None:
    """Wait until this is read: figures, tables and notes are there a while after what was done."""
    latest = time.monotonic() + patient(PATIENCE)
    while (found := read()) != wanted and time.monotonic() < latest:
        time.sleep(0.05)
    assert found == wanted


def wait_for_rows(page: Any) -> None:
    """Wait until each strategy has its figures, and the table its order."""
    page.wait_for_function("""() => {
      const cells = [...document.querySelectorAll(".strategies tbody td[data-key=k_dyn]")];
      return cells.length > 5 && cells.every((cell) => cell.textContent);
    }""")


def opened(page: Any) -> Any:
    """The page with its first figures."""
    page.wait_for_selector("#k-dyn[data-value]")
    page.wait_for_function("document.querySelectorAll('.strategies tbody tr').length > 5")
    return page


INSTRUMENT = 'window.getElement(document.querySelector(".instrument")).instrument'


def at_rest(page: Any) -> None:
    """Wait until the server has sent all that it computes at rest, the map included, and it is drawn."""
    page.wait_for_function(f"""() => {{
      const {{ map, advice, waiting }} = {INSTRUMENT};
      const told = advice.textContent && !advice.classList.contains("old");
      return (map.whole.hidden || map.ready) && !waiting && told;
    }}""")


def answered(page: Any) -> None:
    """Wait until the server has answered everything that was sent to it before."""
    page.evaluate(f"""async () => {{
      const instrument = {INSTRUMENT};
      const stamp = instrument.say({{ what: "leave", path: "shaft.gap" }});
      while (instrument.state.stamp < stamp) await new Promise(requestAnimationFrame);
    }}""")


def drawn(page: Any) -> None:
    """Wait for the second picture from now on: what was to be drawn is."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def choose(page: Any, strategy: str) -> None:
    """Select a strategy, and wait until its start is drawn: its figure is shown before its start has come."""
    page.locator(f'tr[data-name="{strategy}"] input[type=radio]').check()
    page.wait_for_function(
        f"""(name) => {{
          const {{ state, plots }} = {INSTRUMENT};
          return state.selected === name && plots.main?.u && plots.main === state.traces.get(name);
        }}""",
        arg=strategy,
    )
    drawn(page)


def marked(mark: str) -> dict[int, str]:
    """Living processes with the mark in their environment."""
    found = {}
    for place in Path("/proc").iterdir():
        if not place.name.isdigit():
            continue
        try:
            if f"{MARK}={mark}".encode() in (place / "environ").read_bytes().split(b"\0"):
                found[int(place.name)] = (place / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:  # gone meanwhile, or a zombie
            continue
    return found


@pytest.fixture(scope="session")
def start_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Server]]:
    """Starts servers with other arguments; each is ended, and looked at, at the end."""
    servers: list[Server] = []

    def start(*arguments: str) -> Server:
        servers.append(Server(tmp_path_factory.mktemp("served"), *arguments))
        return servers[-1]

    yield start
    for server in servers:
        if server.process.poll() is None:
            server.end()


@pytest.fixture(scope="session")
def server(start_server: Callable[..., Server]) -> Server:
    """The server that most tests share."""
    pytest.importorskip("nicegui", reason="NiceGUI is missing: make page")
    return start_server()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is missing: make page")
    path = (
        os.environ.get("SOFTSTART_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    )
    if path is None:
        pytest.skip("there is no chromium on the path; install it, or name one with SOFTSTART_CHROMIUM")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Any, server: Server) -> Iterator[Visit]:
    """Opens pages, each for a user of its own; fails where one has an error or asks a foreign address."""
    contexts: list[Any] = []
    wrong: list[str] = []

    def visiting(
        width: int = 1280, height: int = 800, dark: bool = False, url: str = "", select: str = "direct",
        **options: Any,
    ) -> Any:  # fmt: skip
        context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light",
            accept_downloads=True, **options,
        )  # fmt: skip
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(1000.0 * PATIENCE)
        own = urlsplit(url or server.url).netloc

        def said(message: Any) -> None:
            if message.type in ("error", "warning"):
                wrong.append(f"console {message.type}: {message.text}")

        def asked(request: Any) -> None:
            parts = urlsplit(request.url)
            if parts.scheme in ("http", "https", "ws", "wss") and parts.netloc != own:
                wrong.append(f"request to {request.url}")

        page.on("console", said)
        page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
        page.on("request", asked)
        page.goto(url or server.url)
        opened(page)
        if select:  # else the gentlest is
            choose(page, select)
        return page

    visiting.wrong = wrong  # type: ignore[attr-defined]
    yield visiting
    for context in contexts:
        context.close()
    assert wrong == []


@pytest.fixture
def page(visit: Visit) -> Any:
    """The page for one user, light, 1280 x 800."""
    return visit()
