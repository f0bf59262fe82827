"""The clutches that come with softstart: TOML files beside this one, each with its source."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources

__all__ = ["names", "text"]


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """The names of the shipped clutches, in order.

    >>> names()
    ('paper-c', 'tractor-pto')
    """
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def text(name: str) -> str:
    """The TOML text of a shipped clutch, whose name must be one of `names()`.

    >>> print(text("paper-c").splitlines()[0])
    # The worked example of [C], in its own units.
    """
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
