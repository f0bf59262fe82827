"""K_dyn against start time: the limit computed in the background, the strategies of the session beside it."""

from __future__ import annotations

import csv
import html
import io
import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, cast

from nicegui import ui

from softstart.page import tasks
from softstart.page.downloads import file_name
from softstart.page.jobs import Jobs
from softstart.page.panel_parts import (
    POLL,
    TERMINALS,
    JobView,
    StaleNote,
    action,
    box,
    choice,
    guarded,
    hint,
    jobs_of,
    save,
    table,
)
from softstart.page.session import Session
from softstart.views.numbers import fixed

if TYPE_CHECKING:
    from softstart.optimal.front import FrontPoint
    from softstart.optimal.problem import Terminal

COLUMNS = ("strategy", "K_dyn", "start, s", "profile", "ratio")
COLOURS = 12
SAME = 1e-9  # relative distance of start times that are the same
WIDTH, HEIGHT = 340.0, 250.0
LEFT, RIGHT, TOP, BOTTOM = 36.0, 8.0, 6.0, 32.0  # margins
TALL = 2.5  # largest over smallest K_dyn from which on the axis is logarithmic
LETTER = 5.0  # width of a letter of a name
LINE = 11.5  # height of a name
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
LOG_TICKS = (
    0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0,
)  # fmt: skip


class CurvePanel:
    """Form, progress, picture and table; built in the current slot."""

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self._session = session
        self._points: list[FrontPoint] = []
        self._drawn: tuple[object, ...] = ()
        with box().classes("panel-form"):
            self._end = choice("Start ends with", TERMINALS, "reached", "curve-terminal")
            self._go = action("Compute", self._begin, "curve-go", main=True)
        self._hint = hint(
            "K_dyn of the best torque profile for each start time; the shaded part is proved out of reach. "
            "Where the start position is unknown one profile serves all of them, and feedback can be lower."
        )
        self._view = JobView(
            jobs or jobs_of(user), user, "curve", on_begin=self._begun, on_part=self._part,
            on_done=self._done, on_state=self._state,
        )  # fmt: skip
        self._stale = StaleNote(session, "curve")
        self._picture = ui.html("", sanitize=False).classes("curve-box").props('data-testid="curve-picture"')
        with box().classes("panel-result") as self._result:
            self._table = ui.html("", sanitize=False).classes("w-full")
            with box().classes("panel-actions"):
                ui.label("Curve").classes("panel-caption")
                action("CSV", guarded(self._save), "curve-csv")
        self._result.set_visibility(False)
        ui.timer(POLL, self._refresh)

    def _begin(self) -> None:
        if self._view.busy:
            return
        drive = self._session.machine
        own = {found.start_time for found in self._session.strategies}
        times = sorted(one for one in own if math.isfinite(one))
        terminal = cast("Terminal", self._end.value)
        self._view.begin("best profile over start time", tasks.curve, drive, times, terminal, subject=drive)

    def _begun(self) -> None:
        self._points, self._drawn = [], ()
        self._picture.set_content("")
        self._stale.show_for(self._view.subject)

    def _state(self) -> None:
        self._go.set_enabled(not self._view.busy)
        self._result.set_visibility(bool(self._points) and not self._view.busy)
        self._hint.set_visibility(not self._points and not self._view.busy)

    def _part(self, point: FrontPoint) -> None:
        self._points.append(point)
        self._draw()

    def _done(self, points: list[FrontPoint]) -> None:
        self._points, self._drawn = points, ()
        self._draw()

    def _refresh(self) -> None:
        self._stale.refresh()
        self._draw()

    def _draw(self) -> None:
        """The picture as it is now; nothing is sent where nothing has changed."""
        if not self._points:
            return
        places = []
        for index, label in enumerate(self._session.controllers):
            found = self._session.ready(label)
            if found is not None and math.isfinite(found.start_time) and math.isfinite(found.k_dyn):
                places.append(StrategyPoint(label, found.start_time, found.k_dyn, colour(index)))
        seen = (len(self._points), self._stale.stale, places)
        if seen == self._drawn:
            return
        self._drawn = seen
        self._picture.set_content(curve_svg(self._points, places, self._stale.stale))
        rows = [] if self._stale.stale else against(self._points, places)
        self._table.set_content(table(COLUMNS, rows, 1, "curve-table") if rows else "")

    def _save(self) -> None:
        save(csv_of(self._points), file_name(self._view.subject.name, "best profiles", suffix=".csv"))


def colour(index: int) -> str:
    """That of a strategy by its place in the table, as `web/modules/theme.js` gives it."""
    return f"var(--strategy-{index % COLOURS})"


def against(points: list[FrontPoint], places: list[StrategyPoint]) -> list[list[str]]:
    """The strategies whose own start time is on the curve, the one nearest to the limit first."""
    judged = []
    for place in places:
        least = next(
            (
                p.k_dyn
                for p in points
                if abs(p.start_time_bound - place.start_time) <= SAME * place.start_time
            ),
            None,
        )
        if least is not None and least > 0.0:
            judged.append((place.k_dyn / least, place, least))
    return [
        [place.name, fixed(place.k_dyn, 3), fixed(place.start_time, 4), fixed(least, 3), fixed(ratio, 3)]
        for ratio, place, least in sorted(judged, key=lambda one: one[0])
    ]


def csv_of(points: list[FrontPoint]) -> str:
    """The curve as CSV with all digits."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["start_time [s]", "k_dyn", "k_dyn_lower_bound", "bound", "method", "terminal"])
    for p in points:
        bound = "" if p.k_dyn_lower_bound is None else repr(p.k_dyn_lower_bound)
        writer.writerow([repr(p.start_time_bound), repr(p.k_dyn), bound, p.bound_kind, p.method, p.terminal])
    return stream.getvalue()


class StrategyPoint(NamedTuple):
    """A strategy in the picture: its name, start time in s, K_dyn and colour."""

    name: str
    start_time: float
    k_dyn: float
    colour: str = "currentColor"


def curve_svg(points: Sequence[FrontPoint], marks: Sequence[StrategyPoint], faded: bool = False) -> str:
    """The curve through the points found, its lower bound shaded below, and the strategies.

    `faded`: the curve belongs to an earlier drive than the marks.
    """
    found = [point for point in points if point.k_dyn is not None]
    seen = [mark for mark in marks if math.isfinite(mark.start_time) and math.isfinite(mark.k_dyn)]
    if not found and not seen:
        return ""
    frame = _Frame.about(
        [point.start_time_bound for point in found] + [mark.start_time for mark in seen],
        [point.k_dyn or 1.0 for point in found] + [mark.k_dyn for mark in seen],
    )
    parts = [
        f'<svg class="curve" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" '
        f'aria-label="{html.escape(_description(found, seen))}">',
        *_grid(frame),
        f'<g class="{"curve-faded" if faded else "curve-now"}">',
        *_limit(frame, found),
        "</g>",
        *_names(frame, seen, found),
        "</svg>",
    ]
    return "".join(parts)


@dataclass(frozen=True)
class _Frame:
    """Where a start time and a K_dyn lie in the picture."""

    times: tuple[float, float]
    values: tuple[float, float]
    logarithmic: bool

    @classmethod
    def about(cls, times: Sequence[float], values: Sequence[float]) -> _Frame:
        first, last = min(times), max(times)
        room = 0.05 * (last - first) or 0.1 * last
        low, high = min(values), max(values)
        logarithmic = high > TALL * low
        if logarithmic:
            return cls((first - room, last + room), (low / 1.15, high * 1.15), True)
        space = 0.12 * (high - low) or 0.2 * high
        return cls((first - room, last + room), (max(0.0, low - space), high + space), False)

    def x(self, time: float) -> float:
        first, last = self.times
        return LEFT + (WIDTH - LEFT - RIGHT) * (time - first) / (last - first)

    def y(self, value: float) -> float:
        low, high = self.values
        share = (
            math.log(value / low) / math.log(high / low) if self.logarithmic else (value - low) / (high - low)
        )
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * share


def ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Round values between two ends, at most so many.

    >>> ticks(0.37, 0.61), ticks(0.0, 1.0, 6)
    ([0.4, 0.45, 0.5, 0.55, 0.6], [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    """
    decade = 10.0 ** math.floor(math.log10((high - low) / most))
    step = next(decade * one for one in STEPS if (high - low) / (decade * one) <= most)
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 12) for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _grid(frame: _Frame) -> list[str]:
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    low, high = frame.values
    rows = [v for v in LOG_TICKS if low <= v <= high] if frame.logarithmic else ticks(low, high)
    parts = []
    last = math.inf
    for value in rows:
        y = frame.y(value)
        if last - y < LINE:
            continue
        last = y
        parts.append(
            f'<line class="curve-grid" x1="{LEFT:g}" x2="{right:g}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text class="curve-tick" x="{LEFT - 6:g}" y="{y + 3.5:.1f}" text-anchor="end">{value:g}</text>'
        )
    for time in ticks(*frame.times, most=8):
        x = frame.x(time)
        parts.append(
            f'<line class="curve-grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP:g}" y2="{bottom:g}"/>'
            f'<text class="curve-tick" x="{x:.1f}" y="{bottom + 14:g}" text-anchor="middle">{time:g}</text>'
        )
    middle = (LEFT + right) / 2
    parts.append(
        f'<text class="curve-title" x="{middle:g}" y="{HEIGHT - 6:g}" text-anchor="middle">'
        f"start time, s</text>"
        f'<text class="curve-title" x="9" y="{(TOP + bottom) / 2:g}" text-anchor="middle" '
        f'transform="rotate(-90 9 {(TOP + bottom) / 2:g})">K<tspan dy="3" font-size="8">dyn</tspan></text>'
    )
    return parts


def _limit(frame: _Frame, found: Sequence[FrontPoint]) -> list[str]:
    """The curve, its points, and what is proved to be out of reach below it."""
    order = sorted(found, key=lambda point: point.start_time_bound)
    line = [(frame.x(p.start_time_bound), frame.y(p.k_dyn or 1.0)) for p in order]
    bound = [
        (frame.x(p.start_time_bound), frame.y(max(p.k_dyn_lower_bound, frame.values[0] or 1e-12)))
        for p in order
        if p.k_dyn_lower_bound is not None
    ]
    parts = []
    if len(bound) > 1:
        bottom = HEIGHT - BOTTOM
        area = [(bound[0][0], bottom), *bound, (bound[-1][0], bottom)]
        parts.append(f'<polygon class="curve-bound" points="{_path(area)}"/>')
        parts.append(f'<polyline class="curve-bound-line" points="{_path(bound)}"/>')
    if len(line) > 1:
        parts.append(f'<polyline class="curve-line" points="{_path(line)}"/>')
    for (x, y), point in zip(line, order, strict=True):
        least = "" if point.k_dyn_lower_bound is None else f", lower bound {point.k_dyn_lower_bound:.5g}"
        parts.append(
            f'<circle class="curve-point" cx="{x:.1f}" cy="{y:.1f}" r="2.6"><title>K_dyn {point.k_dyn:.5g} '
            f"in {point.start_time_bound:.5g} s{least}; {html.escape(point.method)}</title></circle>"
        )
    return parts


def _names(frame: _Frame, marks: Sequence[StrategyPoint], found: Sequence[FrontPoint]) -> list[str]:
    """The strategies, each with its name where no other one stands; in a crowd some go without."""
    line = sorted((frame.x(p.start_time_bound), frame.y(p.k_dyn or 1.0)) for p in found)
    taken = [(x - 2, y - 2, x + 2, y + 2) for x, y in _along(line)]
    places = [(frame.x(mark.start_time), frame.y(mark.k_dyn)) for mark in marks]
    taken += [(x - 4, y - 4, x + 4, y + 4) for x, y in places]
    dots, names = [], []
    for mark, (x, y) in sorted(zip(marks, places, strict=True), key=lambda one: one[1][1]):
        name = mark.name if len(mark.name) <= 26 else mark.name[:25] + "\N{HORIZONTAL ELLIPSIS}"
        colour = html.escape(mark.colour)
        tooltip = f"{html.escape(mark.name)}: K_dyn {mark.k_dyn:.4g} in {mark.start_time:.4g} s"
        dots.append(
            f'<rect class="curve-mark" x="{x - 3.5:.1f}" y="{y - 3.5:.1f}" width="7" height="7" rx="1" '
            f'style="fill:{colour}"><title>{tooltip}</title></rect>'
        )
        place = _free(x, y, LETTER * len(name), taken)
        if place is None:
            continue  # the name is at hand under the pointer, and in the table
        left, top = place
        taken.append((left, top, left + LETTER * len(name), top + LINE))
        if abs(top + LINE / 2 - y) > LINE or not x - 9.0 - LETTER * len(name) < left < x + 14.0:
            end = left - 2.0 if left > x else left + LETTER * len(name) + 2.0
            names.append(
                f'<line class="curve-leader" x1="{x:.1f}" y1="{y:.1f}" x2="{end:.1f}" '
                f'y2="{top + LINE / 2:.1f}"/>'
            )
        names.append(
            f'<text class="curve-name" x="{left:.1f}" y="{top + LINE - 2.5:.1f}">{html.escape(name)}</text>'
        )
    return names + dots


def _along(line: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points on a line through corners, a few units apart."""
    found = list(line)
    for (x, y), (x2, y2) in pairwise(line):
        count = int(math.hypot(x2 - x, y2 - y) / 5.0)
        found += [(x + (x2 - x) * k / count, y + (y2 - y) * k / count) for k in range(1, count)]
    return found


def _free(x: float, y: float, width: float, taken: Sequence[tuple[float, ...]]) -> tuple[float, float] | None:
    """The corner of a free place for a name near a point: beside it, else higher, lower, further, or none."""
    for left in (x + 8.0, x - 8.0 - width, x + 22.0, x - 22.0 - width, x + 44.0, x + 70.0):
        for step in range(20):
            shift = ((step + 1) // 2) * (LINE * 0.55) * (1 if step % 2 else -1)
            top = y - LINE / 2 + shift
            if not (left >= LEFT and left + width <= WIDTH and TOP <= top <= HEIGHT - BOTTOM - LINE):
                continue
            if not any(
                left < b[2] and left + width > b[0] and top < b[3] and top + LINE > b[1] for b in taken
            ):
                return left, top
    return None


def _path(corners: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)


def _description(found: Sequence[FrontPoint], marks: Sequence[StrategyPoint]) -> str:
    """The picture for those who do not see it."""
    sentences = []
    if found:
        first = min(found, key=lambda point: point.start_time_bound)
        last = max(found, key=lambda point: point.start_time_bound)
        sentences.append(
            f"Best profile: K_dyn {first.k_dyn:.3g} in {first.start_time_bound:.3g} s to {last.k_dyn:.3g} in "
            f"{last.start_time_bound:.3g} s."
        )
    sentences += [f"{mark.name}: {mark.k_dyn:.3g} in {mark.start_time:.3g} s." for mark in marks]
    return " ".join(sentences)
