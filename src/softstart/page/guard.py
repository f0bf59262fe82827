"""Who may talk to the page: a pure ASGI guard before everything, requests and sockets alike.

A page on loopback can be reached by every web site that the user's browser shows: by a foreign name that is
made to point at 127.0.0.1 (DNS rebinding) and by a socket opened from a foreign page. So the Host header must
name this machine, and an Origin, where there is one, must be this page. With a token, whoever asks must
have shown it once; a cookie of this process, which scripts cannot read, stands for it then.
Of requests without an Origin, for an image say, browsers tell the site they come from: only a link may come
from elsewhere.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Awaitable, Callable, Collection, Iterable, MutableMapping
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

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
                await self.app(scope, _limited(receive), _with_headers(send))
        elif scope["type"] == "http" and scope.get("method") == "GET" and self._shows_token(scope):
            await self._admit(scope, send)
        else:
            refusal = "This page needs its token: open the address that softstart serve has printed."
            await _refuse(scope, receive, send, 401, refusal)

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
        # read by hand: other programs on this host have cookies too, and one that is odd must hide no other
        pairs = [pair.strip().partition("=") for text in headers.all("cookie") for pair in text.split(";")]
        return any(_equal(value, self._pass) for name, _, value in pairs if name == self._cookie)

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


def _with_headers(send: Send) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS]
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
