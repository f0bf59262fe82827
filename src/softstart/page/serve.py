"""The server behind `softstart serve`: one address, one guard, nothing left behind when it ends."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import os
import socket
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from softstart.errors import InputError
from softstart.late import late
from softstart.page.guard import App, Guard

if TYPE_CHECKING:
    import fastapi
    import uvicorn
    from nicegui import ui

    from softstart.drive import Drive
    from softstart.page import layout
else:  # of the extra "ui", and only for a server
    fastapi, uvicorn, ui = late("fastapi"), late("uvicorn"), late("nicegui.ui")
    layout = late("softstart.page.layout")

DEFAULT_PORT = 8765
SHORTEST_TOKEN = 16
LOOPBACK = ("localhost", "127.0.0.1", "::1")
REMEDY = "install it with: pip install 'softstart[ui]'"


@dataclass(frozen=True)
class Address:
    """Where to listen, and who may come: the token is empty where none is asked for."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    token: str = ""
    expose: bool = False

    @property
    def is_loopback(self) -> bool:
        """True if only this machine reaches the address."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def check(self) -> None:
        """Raise InputError for everything that is wrong or dangerous with it.

        >>> Address(host="0.0.0.0").check()
        Traceback (most recent call last):
        softstart.errors.InputError: --host 0.0.0.0: other machines could reach this address; ...
        """
        wrong = []
        if not 0 <= self.port <= 65535:
            wrong.append(f"--port {self.port}: a port is a number from 0 to 65535; 0 takes a free one.")
        if not self.token.isascii():
            wrong.append("--token: not all of it is plain letters and digits; it must stand in an address.")
        elif self.token and len(self.token) < SHORTEST_TOKEN:
            wrong.append(
                f"--token: a token of {len(self.token)} characters can be guessed; use at least "
                f"{SHORTEST_TOKEN} letters and digits."
            )
        if not self.host.strip():
            wrong.append("--host: the address is empty; give one of this machine, 0.0.0.0 for all it has.")
        elif not self.is_loopback and not (self.expose and self.token):
            lacking = " and ".join(
                name
                for name, given in (("--expose", self.expose), ("--token TOKEN", self.token))
                if not given
            )
            wrong.append(
                f"--host {self.host}: other machines could reach this address; if that is meant, add "
                f"{lacking}, or leave --host out to serve this machine alone."
            )
        if wrong:
            raise InputError(wrong)

    def url(self, port: int) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        if self.host in ("0.0.0.0", "::"):
            host = socket.gethostname()
        return f"http://{host}:{port}/" + (f"?token={quote(self.token, safe='')}" if self.token else "")


def check_installed() -> None:
    """Raise InputError if NiceGUI is not there."""
    if find_spec("nicegui") is None:
        raise InputError(f"the interactive page needs NiceGUI, which is not installed; {REMEDY}")


def listening(address: Address) -> socket.socket:
    """A socket that listens at the address; raises InputError in a sentence if that cannot be."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        if os.name == "posix":
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((address.host, address.port))
        listener.listen(64)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f"--port {address.port}: another program listens there already; "
                "choose another one, or --port 0 for any that is free."
            ) from None
        if error.errno == errno.EACCES:
            raise InputError(
                f"--port {address.port}: this port needs the rights of the administrator; "
                "choose one above 1023."
            ) from None
        raise InputError(
            f"--host {address.host}: this machine cannot listen there ({error.strerror or error})."
        ) from None
    return listener


def guarded(app: App, address: Address, port: int) -> Guard:
    """The app behind its guard."""
    names = {address.host, *LOOPBACK}
    if not address.is_loopback:
        names |= {socket.gethostname(), socket.getfqdn()}
    return Guard(app, names, address.token, exposed=not address.is_loopback, cookie=f"softstart-{port}")


def application(drive: Drive) -> App:
    """The ASGI application: NiceGUI with the page at `/`. One a process, since NiceGUI is one a process."""
    # NiceGUI stores things in the folder it is started in; the page stores nothing, and this makes sure
    os.environ["NICEGUI_STORAGE_PATH"] = str(Path(tempfile.gettempdir()) / "softstart-stores-nothing")
    for noisy in ("nicegui", "uvicorn", "uvicorn.error", "engineio", "socketio"):
        logging.getLogger(noisy).setLevel(logging.CRITICAL)
    app = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @ui.page("/", title=f"softstart: {drive.name}")
    def page() -> None:
        layout.page(drive)

    ui.run_with(
        app,
        dark=None,
        language="en-US",
        favicon=_FAVICON,
        reconnect_timeout=10.0,
        cache_control_directives="no-cache",  # a newer softstart must not meet an old script
        message_history_length=200,
        binding_refresh_interval=0.2,
        tailwind=False,
        gzip_middleware_factory=None,
        show_welcome_message=False,
    )
    return app


def run(drive: Drive, address: Address, listener: socket.socket, ready: Callable[[str], None]) -> None:
    """Serve until interrupted; `ready(url)` is called when the page can be opened."""
    port = int(listener.getsockname()[1])
    app = guarded(application(drive), address, port)
    config = uvicorn.Config(
        app,
        log_config=None,
        log_level=logging.CRITICAL,
        access_log=False,
        ws_per_message_deflate=False,  # squeezing costs more than loopback gains
        timeout_graceful_shutdown=1,
        server_header=False,
        lifespan="on",
    )

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets=sockets)
            if not self.should_exit:
                ready(address.url(port))

    asyncio.run(Server(config).serve(sockets=[listener]))


_FAVICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
    '<rect width="32" height="32" rx="5" fill="#14181d"/>'
    '<path d="M4 25h6l4-15 4 9 3-4 3 2h4" fill="none" stroke="#56b4e9" stroke-width="2.6"/></svg>'
)
