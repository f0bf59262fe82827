"""Where the page listens, and which addresses are those of this machine alone."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass
from urllib.parse import quote

from softstart.errors import InputError

DEFAULT_PORT = 8765
SHORTEST_TOKEN = 16
LOOPBACK = ("localhost", "127.0.0.1", "::1")


def ip_address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """A literal address; None for a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


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
        known = ip_address(self.host)
        return self.host == "localhost" or (known is not None and known.is_loopback)

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
            wrong.append("--token: use letters and digits only; the token is part of an address.")
        elif self.token is not None and len(self.token) < SHORTEST_TOKEN:
            short = f"{len(self.token)} characters can be guessed" if self.token else "the token is empty"
            wrong.append(f"--token: {short}; use at least {SHORTEST_TOKEN}, or leave out --token.")
        if not self.host.strip():
            wrong.append("--host: the address is empty; give one of this machine, 0.0.0.0 for all it has.")
        elif not self.is_loopback and not (self.expose and self.token is not None):
            options = {"--expose": self.expose, "--token TOKEN": self.token is not None}
            missing = " and ".join(option for option, present in options.items() if not present)
            wrong.append(
                f"--host {self.host}: other machines could reach this address; if that is intended, add "
                f"{missing}, or leave out --host to serve this machine only."
            )
        if wrong:
            raise InputError(wrong)

    def url(self, port: int) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        if self.host in ("0.0.0.0", "::"):
            host = socket.gethostname()
        return f"http://{host}:{port}/" + (f"?token={quote(self.token, safe='')}" if self.token else "")
