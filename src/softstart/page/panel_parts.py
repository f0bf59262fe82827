"""What the panels share: fields, tables, figures, buttons to save a file, the mark of an earlier drive."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from nicegui import ui

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.page.bench import Bench
from softstart.page.drift import drift
from softstart.page.trouble import sentence_of

MEDIA = {".csv": "text/csv", ".toml": "application/toml", ".c": "text/x-csrc", ".html": "text/html"}
NOTHING = "\N{EN DASH}"


def box() -> Any:
    """A plain box; its class says how it lays out what is in it."""
    return ui.element("div")


def field(label: str, value: str, name: str, example: str = "") -> Any:
    """A text field below its label."""
    with _labelled(label):
        made = ui.input(value=value).props(f'dense outlined aria-label="{label}" data-testid="{name}"')
        if example:
            made.tooltip(example)
    return made


def choice(label: str, options: dict[str, str] | list[str], value: str, name: str) -> Any:
    """A choice of one of several, below its label."""
    with _labelled(label):
        made = ui.select(options, value=value)
        made.props(f'dense outlined options-dense aria-label="{label}" data-testid="{name}"')
    return made


def _labelled(label: str) -> Any:
    with box().classes("panel-field") as made:
        ui.label(label)
    return made


def action(text: str, act: Callable[[], Any], name: str, main: bool = False) -> Any:
    """A button; the main one of a panel stands out."""
    made = ui.button(text, on_click=act, color=None).props(
        f'dense no-caps {"unelevated" if main else "flat"} data-testid="{name}"'
    )
    return made.classes("panel-main" if main else "panel-action")


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits.

    >>> number(0.90924724), number(None), number(float("nan")), number(48.0628, 3)
    ('0.9092', '\N{EN DASH}', '\N{EN DASH}', '48.1')
    """
    return NOTHING if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def fixed(value: float | None, places: int) -> str:
    """A number with so many decimal places, for columns.

    >>> fixed(0.981, 4), fixed(None, 4)
    ('0.9810', '\N{EN DASH}')
    """
    return NOTHING if value is None or not math.isfinite(value) else f"{value:.{places}f}"


def percent(value: float | None) -> str:
    """A small share in per cent, already multiplied by 100.

    >>> percent(9.78e-8), percent(0.095), percent(12.0)
    ('< 0.001 %', '0.095 %', '12 %')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    return "< 0.001 %" if abs(value) < 1e-3 else f"{value:.2g} %"


def symbols(text: str) -> str:
    """A text as HTML, symbols as they are printed.

    >>> symbols("K_dyn < 1")
    'K<sub>dyn</sub> &lt; 1'
    """
    return html.escape(text).replace("K_dyn", "K<sub>dyn</sub>")


def hint(text: str) -> Any:
    """A quiet sentence that says what a panel is for."""
    return ui.html(symbols(text), sanitize=False).classes("panel-hint")


def save(text: str, name: str) -> None:
    """Let the browser save a text as a file."""
    suffix = name[name.rindex(".") :]
    ui.download.content(text, name, f"{MEDIA.get(suffix, 'text/plain')}; charset=utf-8")


def tell(sentence: str) -> None:
    """A short note at the edge of the page."""
    ui.notify(sentence, position="bottom-left", timeout=2500, classes="note")


def guarded(act: Callable[[], Any]) -> Callable[[], Any]:
    """The action; what goes wrong in it is told in sentences, and nothing else happens."""

    def acting() -> None:
        try:
            act()
        except Exception as error:  # nobody who looks at the page sees a traceback
            sentences = error.sentences if isinstance(error, InputError) else (sentence_of(error),)
            for sentence in sentences:
                ui.notify(sentence, type="negative", position="bottom-left", multi_line=True, timeout=8000)

    return acting


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 1, name: str = "") -> str:
    """A table as HTML; the first `texts` columns are text, the others numbers.

    >>> table(["strategy", "K_dyn"], [["direct", "3.118"]])
    '<table class="panel-table"><thead><tr><th>strategy</th><th class="num">K<sub>dyn</sub></th></tr>...
    """
    mark = f' data-testid="{name}"' if name else ""

    def cells(values: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}>{symbols(v)}</{tag}>" if k < texts else f'<{tag} class="num">{symbols(v)}</{tag}>'
            for k, v in enumerate(values)
        )

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    head = f"<thead><tr>{cells(columns, 'th')}</tr></thead>"
    return f'<table class="panel-table"{mark}>{head}<tbody>{body}</tbody></table>'


def facts(pairs: Sequence[tuple[str, str]], name: str = "") -> str:
    """Figures with what they are, as HTML.

    >>> facts([("K_dyn", "0.9092")])
    '<dl class="facts"><div><dt>K<sub>dyn</sub></dt><dd>0.9092</dd></div></dl>'
    """
    mark = f' data-testid="{name}"' if name else ""
    inside = "".join(f"<div><dt>{symbols(k)}</dt><dd>{html.escape(v)}</dd></div>" for k, v in pairs)
    return f'<dl class="facts"{mark}>{inside}</dl>'


class Mark:
    """Says for which drive a result is, once the bench has another one; built in the current slot."""

    def __init__(self, bench: Bench, name: str) -> None:
        self._bench = bench
        self._drive: Drive | None = None
        self._seen = -1
        self.stale = False
        self._label = ui.label().classes("stale").props(f'role=status data-testid="{name}-stale"')
        self._label.set_visibility(False)

    def of(self, drive: Drive) -> None:
        """The result shown is of this drive."""
        self._drive, self._seen = drive, -1
        self.look()

    def look(self) -> bool:
        """Compare again where the bench has changed; True if it has."""
        if self._drive is None or self._bench.version == self._seen:
            return False
        self._seen = self._bench.version
        sentence = drift(self._drive, self._bench.drive)
        self.stale = bool(sentence)
        self._label.set_text(sentence)
        self._label.set_visibility(self.stale)
        return True
