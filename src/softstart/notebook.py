"""Results that a notebook shows."""

from __future__ import annotations

from importlib import import_module
from typing import ClassVar


class Shown:
    """A result that a notebook shows as the sheet that the command prints: `sheet`, of `softstart.views`."""

    _sheet: ClassVar[tuple[str, str]]

    def __init_subclass__(cls, sheet: str) -> None:
        module, name = sheet.split(".")
        cls._sheet = f"softstart.views.{module}", name

    def _repr_html_(self) -> str:
        from softstart.views.sheet import as_html

        module, name = self._sheet
        return as_html(getattr(import_module(module), name)(self))
