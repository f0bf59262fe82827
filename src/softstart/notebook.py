"""Results as a notebook shows them, and as one line where they are printed."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from typing import Any, ClassVar

LONGEST = 60  # characters of a text


class OneLine:
    """A result whose repr is one line: its numbers and texts, and how much there is of what is large.

    Dataclasses that derive from it are declared with `repr=False`.
    """

    def __repr__(self) -> str:
        said = [_said(one.name, getattr(self, one.name)) for one in fields(self)]  # type: ignore[arg-type]
        return f"<{type(self).__name__}: {', '.join(filter(None, said))}>"


def _said(name: str, value: Any) -> str:
    words = name.replace("_", " ").replace("k dyn", "K_dyn")
    if isinstance(value, str):
        text = " ".join(value.split())
        if not text:
            return ""
        return f"{words} {text}" if len(text) <= LONGEST else f"{words} {text[:LONGEST]}..."
    if isinstance(value, int | float):
        return f"{words} {value:.6g}" if isinstance(value, float) else f"{words} {value}"
    if hasattr(value, "WHAT"):  # a drive or a chain
        return str(value.name)
    if isinstance(value, OneLine | Shown):
        return repr(value)
    return f"{words} [{len(value)}]" if hasattr(value, "__len__") else ""


class Shown:
    """A result that a notebook shows as the sheet that the command prints: `sheet`, of `softstart.views`.

    Printed it is the title of that sheet and its first conclusion.
    """

    _sheet: ClassVar[tuple[str, str]]

    def __init_subclass__(cls, sheet: str) -> None:
        module, name = sheet.split(".")
        cls._sheet = f"softstart.views.{module}", name

    @property
    def _shown(self) -> Any:
        module, name = self._sheet
        return getattr(import_module(module), name)(self)

    def __repr__(self) -> str:
        sheet = self._shown
        return f"<{type(self).__name__}: {'. '.join([sheet.title, *sheet.found[:1]])}>"

    def _repr_html_(self) -> str:
        from softstart.views.sheet import as_html

        return as_html(self._shown)
