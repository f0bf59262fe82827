"""Who reaches the page: a guard before everything, requests and sockets alike.

A page on loopback can be reached by every web site that the user's browser shows: by a foreign name that is
made to point at 127.0.0.1 (DNS rebinding) and by a socket opened from a foreign page. Sessions are those of
Starlette, in a signed cookie; for the rest its middleware is not enough, as stated beside each check.
"""

from __future__ import annotations

import hmac
import secrets
import socket
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.middleware.sessions import SessionMiddleware
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from softstart.page import USER
from softstart.page.address import LOOPBACK, Address, ip_address

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
HEADERS = {
    "content-security-policy": "; ".join(POLICY),
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}
# a page that leads on, not a redirect: a cookie that is SameSite=Strict would not travel with one when the
# address was opened from a mail
ADMITTED = '<!doctype html><meta http-equiv="refresh" content="0;url=./"><title>softstart</title>'


def guarded(app: ASGIApp, address: Address, port: int) -> SessionMiddleware:
    """The app behind its guard. The key of the sessions is that of this process: others' are unknown here."""
    names = {address.host, *LOOPBACK}
    if not address.is_loopback:
        names |= {socket.gethostname(), socket.getfqdn()}
    guard = Guard(app, names, address.token or "", exposed=not address.is_loopback)
    # a browser shares cookies between the ports of a host
    cookie = f"softstart-{port}"
    return SessionMiddleware(guard, secrets.token_urlsafe(32), cookie, max_age=None, same_site="strict")


class Guard:
    """Lets through to `app` what comes from this page; `names` are the hosts it answers to.

    With `exposed` every literal address counts as a name of this machine: only names can be rebound. With a
    token, whoever connects must have shown it once; then the session knows its user.
    """

    def __init__(self, app: ASGIApp, names: Collection[str], token: str = "", exposed: bool = False) -> None:
        self.app = app
        self._names = frozenset(name.lower() for name in names)
        self._token = token
        self._exposed = exposed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer the request, or refuse it in a sentence."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        answers = _with_headers(send)
        code, sentence = self._refusal(request)
        if code == 401 and scope.get("method") == "GET" and self._shows_token(request):
            request.session[USER] = secrets.token_urlsafe(24)
            await HTMLResponse(ADMITTED, headers={"cache-control": "no-store"})(scope, receive, answers)
        elif code and scope["type"] == "websocket":
            await WebSocketClose(POLICY_VIOLATION, sentence)(scope, receive, send)
        elif code:
            refusal = PlainTextResponse(sentence, code, {"cache-control": "no-store"})
            await refusal(scope, receive, answers)
        else:
            if scope.get("path") == "/" and USER not in request.session:
                request.session[USER] = secrets.token_urlsafe(24)
            await self.app(scope, _limited(receive), answers)

    def _refusal(self, request: HTTPConnection) -> tuple[int, str]:
        """Status and sentence of a refusal; 0 if there is none."""
        # TrustedHostMiddleware knows no literal address of an exposed page, and the first of two Host headers
        hosts = request.headers.getlist("host")
        if len(hosts) != 1 or not self._is_this_machine(hosts[0]):
            return 403, "This host is not served here; open the address that softstart serve has printed."
        # CORSMiddleware forbids a foreign page to read the answer, not to ask, and ignores sockets. Requests
        # without Origin, as for an image, name their site in browsers: only a link may come from elsewhere
        own = {f"{scheme}://{hosts[0].lower()}" for scheme in ("http", "https")}
        foreign = any(origin.lower() not in own for origin in request.headers.getlist("origin"))
        elsewhere = {"cross-site", "same-site"}.intersection(request.headers.getlist("sec-fetch-site"))
        followed = request.headers.getlist("sec-fetch-dest") == ["document"]
        if foreign or (elsewhere and not followed):
            return 403, "This request comes from another page."
        if self._token and USER not in request.session:
            return 401, "This page needs its token: open the address that softstart serve has printed."
        if any(_too_long(length) for length in request.headers.getlist("content-length")):
            return 413, "This is more than the page takes."
        return 0, ""

    def _is_this_machine(self, host: str) -> bool:
        name = _name_of(host)
        return name in self._names or (self._exposed and ip_address(name) is not None)

    def _shows_token(self, request: HTTPConnection) -> bool:
        shown = request.query_params.getlist("token")
        return any(hmac.compare_digest(one.encode(), self._token.encode()) for one in shown)


def _name_of(host: str) -> str:
    """The host without its port; empty if it is no host.

    >>> _name_of("localhost:8765"), _name_of("[::1]:8765"), _name_of("evil.example")
    ('localhost', '::1', 'evil.example')
    """
    try:
        return (urlsplit(f"//{host}").hostname or "").lower() if "@" not in host and "/" not in host else ""
    except ValueError:
        return ""


def _too_long(length: str) -> bool:
    """True if a body of this length, or of none that could be read, is not taken.

    >>> _too_long("65536"), _too_long("9999999"), _too_long("9" * 9999), _too_long("-1")
    (False, True, True, True)
    """
    return not length.isdecimal() or len(length) > 9 or int(length) > MOST_BODY


def _limited(receive: Receive) -> Receive:
    """Take no more than `MOST_BODY` of a body of unknown length: the rest is as if the line were lost."""
    left = MOST_BODY

    async def receiving() -> Message:
        nonlocal left
        message = await receive()
        if message["type"] == "http.request":
            left -= len(message.get("body", b""))
        return message if left >= 0 else {"type": "http.disconnect"}

    return receiving


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sending
