"""The server behind `softstart serve`: one address, one guard, nothing left behind when it ends."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import socket
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.errors import InputError
from softstart.page.address import Address

if TYPE_CHECKING:
    from starlette.types import ASGIApp

    from softstart.drive.machine import Machine
    from softstart.project import Project

REMEDY = "install it with: pip install 'softstart[ui]'"

log = logging.getLogger("softstart.page")

NOISY = ("nicegui", "uvicorn", "uvicorn.error", "engineio.server", "socketio.server", "python_multipart")


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
        port = f"--port {address.port}"
        reasons = {
            errno.EADDRINUSE: f"{port}: the port is in use; choose another one, or --port 0 for a free one.",
            errno.EACCES: f"{port}: ports below 1024 need administrator rights; choose another one.",
        }
        other = f"--host {address.host}: this machine cannot listen there ({error.strerror or error})."
        raise InputError(reasons.get(error.errno or 0, other)) from None
    return listener


def application(drive: Machine | Project) -> ASGIApp:
    """The ASGI application: NiceGUI with the page at `/`. One a process, since NiceGUI is one a process."""
    # NiceGUI, when it is imported, reads and stores things in the folder it is started in; the page stores
    # nothing, and nobody can put anything for it to read where no file can be
    os.environ["NICEGUI_STORAGE_PATH"] = str(Path(os.devnull) / "nothing")
    import fastapi
    import nicegui
    from nicegui import ui

    from softstart.page import layout

    for noisy in NOISY:
        logging.getLogger(noisy).setLevel(logging.CRITICAL)
    layout.warm(drive)
    app = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @ui.page("/", title=f"softstart: {drive.name}")
    def page() -> None:
        layout.page(drive)

    # the bar of Quasar for requests of a page has no name for screen readers, and here nothing waits for one
    nicegui.app.config.quasar_config["loadingBar"]["skipHijack"] = True
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


def run_server(
    drive: Machine | Project, address: Address, listener: socket.socket, ready: Callable[[str], None]
) -> None:
    """Serve until interrupted; `ready(url)` is called when the page can be opened."""
    import uvicorn

    from softstart.page.guard import MOST_BODY, guarded

    port = int(listener.getsockname()[1])
    app = guarded(application(drive), address, port)
    config = uvicorn.Config(
        app,
        log_config=None,
        log_level=logging.CRITICAL,
        access_log=False,
        ws_per_message_deflate=False,  # squeezing costs more than loopback gains
        ws_max_size=MOST_BODY,
        timeout_graceful_shutdown=1,
        server_header=False,
        lifespan="on",
    )

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            asyncio.get_running_loop().set_exception_handler(unheard)
            await super().startup(sockets=sockets)
            if not self.should_exit:
                ready(address.url(port))

    logging.captureWarnings(True)  # numbers at the edge of what floats hold are no news for the terminal
    asyncio.run(Server(config).serve(sockets=[listener]))


def unheard(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What nobody waits for has failed: NiceGUI was sent a message that its own script does not send."""
    log.debug("dropped: %s", context.get("message"), exc_info=context.get("exception"))


_FAVICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
    '<rect width="32" height="32" rx="5" fill="#14181d"/>'
    '<path d="M4 25h6l4-15 4 9 3-4 3 2h4" fill="none" stroke="#56b4e9" stroke-width="2.6"/></svg>'
)
