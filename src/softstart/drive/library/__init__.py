"""The drives that come with softstart: TOML files beside this one, each with its source."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources

__all__ = ["names", "text"]


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """The names of the shipped drives, in order.

    >>> "crane-4amtkf" in names()
    True
    """
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def text(name: str) -> str:
    """The TOML text of a shipped drive, whose name must be one of `names()`.

    >>> print(text("crane-4amtkf").splitlines()[0])
    # The crane drive of [G] with J2 = 5 J1 and a gap of 0.5 rad.
    """
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
