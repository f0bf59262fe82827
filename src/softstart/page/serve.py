"""The server behind `softstart serve`: one address, one guard, nothing left behind when it ends.

The guard is pure ASGI and stands before everything, requests and sockets alike. A page on loopback can be
reached by every web site that the user's browser shows: by a foreign name that is made to point at 127.0.0.1
(DNS rebinding) and by a socket opened from a foreign page. So the Host header must name this machine, and an
Origin, where there is one, must be this page. With a token, whoever connects must have shown it once; a
cookie of this process, which scripts cannot read, stands for it then. For requests without an Origin, as for
an image, browsers name the site that they come from: only a link may come from elsewhere.
"""

from __future__ import annotations

import asyncio
import errno
import hmac
import ipaddress
import logging
import os
import re
import secrets
import socket
from collections.abc import Awaitable, Callable, Collection, Iterable, MutableMapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, quote, urlsplit

from softstart.errors import InputError
from softstart.page import USER

if TYPE_CHECKING:
    from softstart.page.machines import Loaded

DEFAULT_PORT = 8765
SHORTEST_TOKEN = 16
LOOPBACK = ("localhost", "127.0.0.1", "::1")
REMEDY = "install it with: pip install 'softstart[ui]'"

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

log = logging.getLogger("softstart.page")

_USER = re.compile(r"[\w-]{32}")

NOISY = ("nicegui", "uvicorn", "uvicorn.error", "engineio.server", "socketio.server", "python_multipart")
POLICY_VIOLATION = 1008
MOST_BODY = 1 << 20  # bytes of a request: a drive file, or some messages of a browser without sockets
POLICY = (  # nothing the page does leaves the machine, whatever is put into it
    "default-src 'self'",
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",  # NiceGUI compiles its templates in the browser
    "style-src 'self' 'unsafe-inline'",
    "img-src 'self' data: blob:",
    "font-src 'self' data:",
    "frame-src 'self' blob:",
    "frame-ancestors 'none'",
    "base-uri 'self'",
    "form-action 'self'",
)
HEADERS = (
    (b"content-security-policy", "; ".join(POLICY).encode("ascii")),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)


@dataclass(frozen=True)
class Address:
    """Where to listen, and who may come: the token is None where none is asked for."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    token: str | None = None
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
        if self.token is not None and not (self.token.isascii() and self.token.isprintable()):
            wrong.append("--token: not all of it is plain letters and digits; it must stand in an address.")
        elif self.token is not None and len(self.token) < SHORTEST_TOKEN:
            size = len(self.token)
            short = f"a token of {size} characters can be guessed" if size else "the token is empty"
            wrong.append(
                f"--token: {short}; use at least {SHORTEST_TOKEN} letters and digits, or leave --token out."
            )
        if not self.host.strip():
            wrong.append("--host: the address is empty; give one of this machine, 0.0.0.0 for all it has.")
        elif not self.is_loopback and not (self.expose and self.token is not None):
            lacking = " and ".join(
                name
                for name, given in (("--expose", self.expose), ("--token TOKEN", self.token is not None))
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
    return Guard(app, names, address.token or "", exposed=not address.is_loopback, cookie=f"softstart-{port}")


def application(drive: Loaded) -> App:
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
    drive: Loaded, address: Address, listener: socket.socket, ready: Callable[[str], None]
) -> None:
    """Serve until interrupted; `ready(url)` is called when the page can be opened."""
    import uvicorn

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


# the guard ------------------------------------------------------------------------------------------


class Guard:
    """Lets through to `app` what comes from this page; `names` are the hosts it answers to.

    With `exposed` every literal address counts as a name of this machine: only names can be rebound.
    `cookie` is the name of the cookie (a browser shares cookies between the ports of a host).
    """

    def __init__(
        self,
        app: App,
        names: Collection[str],
        token: str = "",
        exposed: bool = False,
        cookie: str = "softstart",
    ) -> None:
        self.app = app
        self._names = frozenset(name.lower() for name in names)
        self._token = token
        self._exposed = exposed
        self._cookie = cookie
        self._pass = secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer the request, or refuse it in a sentence."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = _Headers(scope.get("headers", ()))
        refusal = self._refusal(headers)
        if refusal:
            await _refuse(scope, receive, send, 403, refusal)
        elif not self._token or self._has_pass(headers):
            if any(_too_long(text) for text in headers.all("content-length")):
                await _refuse(scope, receive, send, 413, "This is more than the page takes.")
            else:
                scope[USER], cookie = self._user(headers)
                news = cookie if scope.get("path") == "/" else []
                await self.app(scope, _limited(receive), _with_headers(send, news))
        elif scope["type"] == "http" and scope.get("method") == "GET" and self._shows_token(scope):
            await self._admit(scope, send)
        else:
            refusal = "This page needs its token: open the address that softstart serve has printed."
            await _refuse(scope, receive, send, 401, refusal)

    def _user(self, headers: _Headers) -> tuple[str, list[tuple[bytes, bytes]]]:
        """Whose browser this is, and the header with the cookie for one that has none yet."""
        name = f"{self._cookie}-user"
        known = [value for key, value in _cookies(headers) if key == name and _USER.fullmatch(value)]
        if known:
            return known[0], []
        user = secrets.token_urlsafe(24)
        return user, [(b"set-cookie", f"{name}={user}; Path=/; HttpOnly; SameSite=Strict".encode("ascii"))]

    def _refusal(self, headers: _Headers) -> str:
        """Why a request is refused before any token is looked at; empty if it is not."""
        hosts = headers.all("host")
        if len(hosts) != 1 or not self._is_this_machine(host := hosts[0]):
            return "This name is not one of this machine; open the address that softstart serve has printed."
        origins = headers.all("origin")
        elsewhere = {"cross-site", "same-site"}.intersection(headers.all("sec-fetch-site"))
        followed = headers.all("sec-fetch-dest") == ["document"]
        if any(not _same_place(origin, host) for origin in origins) or (elsewhere and not followed):
            return "This request comes from another page."
        return ""

    def _is_this_machine(self, host: str) -> bool:
        name = _name_of(host)
        return name in self._names or (self._exposed and _is_address(name))

    def _has_pass(self, headers: _Headers) -> bool:
        return any(_equal(value, self._pass) for name, value in _cookies(headers) if name == self._cookie)

    def _shows_token(self, scope: Scope) -> bool:
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        return any(_equal(shown, self._token) for shown in query.get("token", []))

    async def _admit(self, scope: Scope, send: Send) -> None:
        """Hand out the cookie and go on without the token in the address."""
        # a page that leads on, not a redirect: a cookie that is SameSite=Strict would not travel with one
        # when the address was opened from a mail
        body = b'<!doctype html><meta http-equiv="refresh" content="0;url=./"><title>softstart</title>'
        cookie = f"{self._cookie}={self._pass}; Path=/; HttpOnly; SameSite=Strict"
        await _answer(send, 200, "text/html", body, [(b"set-cookie", cookie.encode("ascii"))])


class _Headers:
    """The headers of a scope."""

    def __init__(self, pairs: Iterable[tuple[bytes, bytes]]) -> None:
        self._pairs = [(key.decode("latin-1").lower(), value.decode("latin-1")) for key, value in pairs]

    def all(self, name: str) -> list[str]:
        return [value for key, value in self._pairs if key == name]


def _cookies(headers: _Headers) -> list[tuple[str, str]]:
    # read by hand: other programs on this host have cookies too, and one that is odd must hide no other
    pairs = [pair.strip().partition("=") for text in headers.all("cookie") for pair in text.split(";")]
    return [(name, value) for name, _, value in pairs]


def _equal(shown: str, wanted: str) -> bool:
    return hmac.compare_digest(shown.encode(), wanted.encode())


def _name_of(host: str) -> str:
    """The host without its port; empty if it is no host.

    >>> _name_of("localhost:8765"), _name_of("[::1]:8765"), _name_of("evil.example")
    ('localhost', '::1', 'evil.example')
    """
    try:
        return (urlsplit(f"//{host}").hostname or "").lower() if "@" not in host and "/" not in host else ""
    except ValueError:
        return ""


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _same_place(origin: str, host: str) -> bool:
    """True if a page at `origin` was served under `host`.

    >>> _same_place("http://localhost:8765", "localhost:8765"), _same_place("null", "localhost:8765")
    (True, False)
    """
    scheme, separator, place = origin.partition("://")
    return separator != "" and scheme in ("http", "https") and place.lower() == host.lower()


def _too_long(length: str) -> bool:
    """True if a body of this length, or of none that could be read, is not taken.

    >>> _too_long("65536"), _too_long("9999999"), _too_long("9" * 9999), _too_long("-1")
    (False, True, True, True)
    """
    return not length.isdecimal() or len(length) > 9 or int(length) > MOST_BODY


def _limited(receive: Receive) -> Receive:
    """Take no more than `MOST_BODY` of a body of unknown length: the rest is as if the line were lost."""
    left = MOST_BODY

    async def receiving() -> MutableMapping[str, Any]:
        nonlocal left
        message = await receive()
        if message["type"] == "http.request":
            left -= len(message.get("body", b""))
        return message if left >= 0 else {"type": "http.disconnect"}

    return receiving


def _with_headers(send: Send, more: Iterable[tuple[bytes, bytes]] = ()) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS, *more]
        await send(message)

    return sending


async def _refuse(scope: Scope, receive: Receive, send: Send, code: int, sentence: str) -> None:
    if scope["type"] == "websocket":
        await receive()  # the wish to connect
        await send({"type": "websocket.close", "code": POLICY_VIOLATION, "reason": sentence})
        return
    await _answer(send, code, "text/plain", sentence.encode())


async def _answer(
    send: Send, code: int, kind: str, body: bytes, more: Iterable[tuple[bytes, bytes]] = ()
) -> None:
    headers = [
        (b"content-type", f"{kind}; charset=utf-8".encode("ascii")),
        (b"content-length", str(len(body)).encode("ascii")),
        (b"cache-control", b"no-store"),
        *HEADERS,
        *more,
    ]
    await send({"type": "http.response.start", "status": code, "headers": headers})
    await send({"type": "http.response.body", "body": body})
