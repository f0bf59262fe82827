"""What all results share: plain data, tables and figures by their view, a repr of one line.

A result knows its view by name only (`class Run(Result, view="starts.run_sheet")`); `softstart.views` is
imported when something is shown.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from softstart.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from pandas import DataFrame

    from softstart.views.numbers import TextTable

T_co = TypeVar("T_co", covariant=True)

LONGEST_TEXT = 60  # characters of a text in a repr


class OneLine:
    """A result whose repr is one line: its numbers and texts, and the size of what is large.

    Dataclasses that derive from it are declared with `repr=False`.
    """

    def __repr__(self) -> str:
        parts = [_part(field.name, getattr(self, field.name)) for field in fields(self)]  # type: ignore[arg-type]
        return f"<{type(self).__name__}: {', '.join(filter(None, parts))}>"


def _part(name: str, value: object) -> str:
    words = name.replace("_", " ").replace("k dyn", "K_dyn")
    if isinstance(value, str):
        text = " ".join(value.split())
        if not text:
            return ""
        return f"{words} {text}" if len(text) <= LONGEST_TEXT else f"{words} {text[:LONGEST_TEXT]}..."
    if isinstance(value, int | float):
        return f"{words} {value:.6g}" if isinstance(value, float) else f"{words} {value}"
    if hasattr(value, "WHAT") and hasattr(value, "name"):  # a drive or a chain
        return str(value.name)
    if isinstance(value, OneLine):
        return repr(value)
    return f"{words} [{len(value)}]" if hasattr(value, "__len__") else ""


class _OfView(Generic[T_co]):
    """An attribute that a result has from its view, unless it has a field of this name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, result: Result | None, owner: type) -> T_co:
        if result is None:  # so that a dataclass takes it for no default
            raise AttributeError(self.name)
        value: T_co = getattr(result.sheet, self.name)
        return value


class Result(OneLine, ABC):
    """A result, shown in the same way on a terminal, in a folder, a report, a notebook and on the page.

    `conclusions`, `tables`, `notes` and `figures` (functions that draw, by name) are those of its view.
    """

    _view: ClassVar[tuple[str, str]]
    conclusions: _OfView[Sequence[str]] = _OfView()
    tables: _OfView[Sequence[TextTable]] = _OfView()
    notes: _OfView[Sequence[str]] = _OfView()
    figures: _OfView[Mapping[str, Callable[..., Figure]]] = _OfView()

    def __init_subclass__(cls, view: str = "", **options: object) -> None:
        super().__init_subclass__(**options)
        if view:
            module, _, name = view.partition(".")
            cls._view = f"softstart.views.{module}", name

    @property
    def sheet(self) -> Any:
        """All that is shown of it: a `softstart.views.sheet.Sheet`."""
        module, name = self._view
        return getattr(import_module(module), name)(self)

    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """Everything as plain data, in SI, as `--json` prints it."""

    def to_dataframe(self) -> DataFrame:
        """Its rows as a pandas.DataFrame; InputError for a result that is no table."""
        import pandas  # comes with xarray

        if not (records := self.sheet.records):
            raise InputError(f"to_dataframe: {self!r} has no rows; see summary().")
        return pandas.DataFrame(list(records))

    def plot(self, *, ax: Axes | None = None) -> Figure | SubFigure:
        """Its first figure; with `ax` the main panel of it, drawn there."""
        sheet = self.sheet
        if not sheet.figures:
            raise InputError(sheet.no_figure or f"plot: {self!r} has no figure.")
        if ax is None:
            return next(iter(sheet.figures.values()))()
        if sheet.panel is None:
            raise InputError(f"ax: the figure of {type(self).__name__} has several axes; leave ax out.")
        sheet.panel(ax)
        return ax.figure

    def __repr__(self) -> str:
        sheet = self.sheet
        return f"<{type(self).__name__}: {'. '.join([sheet.title, *sheet.conclusions[:1]])}>"

    def _repr_html_(self) -> str:
        html: str = import_module("softstart.views.sheet").as_html(self.sheet)
        return html
