"""K_dyn against start time: the limit computed in the background, the strategies of the bench beside it."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Hashable
from typing import TYPE_CHECKING, cast

from nicegui import ui

from softstart.drive import Drive
from softstart.page import works
from softstart.page.bench import Bench
from softstart.page.curve_chart import Mark as Place
from softstart.page.curve_chart import curve_svg
from softstart.page.downloads import file_name
from softstart.page.job_view import LOOK, JobView
from softstart.page.jobs import Jobs
from softstart.page.optimum_panel import TERMINALS
from softstart.page.panel_parts import Mark, action, box, choice, fixed, guarded, hint, save, table

if TYPE_CHECKING:
    from softstart.optimal.front import FrontPoint
    from softstart.optimal.problem import Terminal

COLUMNS = ("strategy", "K_dyn", "start, s", "least", "ratio")
COLOURS = 12
SAME = 1e-9  # relative distance of start times that are the same


class CurvePanel:
    """Form, progress, picture and table; built in the current slot."""

    def __init__(self, bench: Bench, user: Hashable, jobs: Jobs) -> None:
        self._bench = bench
        self._drive: Drive | None = None
        self._points: list[FrontPoint] = []
        self._drawn: tuple[object, ...] = ()
        with box().classes("panel-form"):
            self._end = choice("Start ends with", TERMINALS, "reached", "curve-terminal").classes(
                "panel-wide"
            )
            self._go = action("Compute", self._begin, "curve-go", main=True)
        self._hint = hint(
            "The least K_dyn for each start time; the shaded part is proved to be out of reach. "
            "Points appear as they are computed."
        )
        self._view = JobView(
            jobs, user, "curve", on_part=self._part, on_done=self._done, on_state=self._state
        )  # fmt: skip
        self._mark = Mark(bench, "curve")
        self._picture = ui.html("", sanitize=False).classes("curve-box").props('data-testid="curve-picture"')
        with box().classes("panel-result") as self._result:
            self._table = ui.html("", sanitize=False).classes("w-full")
            with box().classes("panel-actions"):
                ui.label("Curve").classes("panel-caption")
                action("CSV", guarded(self._save), "curve-csv")
        self._result.set_visibility(False)
        ui.timer(LOOK, self._look)

    def _begin(self) -> None:
        if self._view.busy:
            return
        self._drive, self._points, self._drawn = self._bench.drive, [], ()
        own = {found.start_time for found in self._bench.strategies}
        times = sorted(one for one in own if math.isfinite(one))
        self._picture.set_content("")
        self._mark.of(self._drive)
        self._view.begin(
            "least K_dyn over start time", works.curve, self._drive, times, cast("Terminal", self._end.value)
        )

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

    def _look(self) -> None:
        self._mark.look()
        self._draw()

    def _draw(self) -> None:
        """The picture as it is now; nothing is sent where nothing has changed."""
        if not self._points:
            return
        places = []
        for index, label in enumerate(self._bench.controllers):
            found = self._bench.ready(label)
            if found is not None and math.isfinite(found.start_time) and math.isfinite(found.k_dyn):
                places.append(Place(label, found.start_time, found.k_dyn, colour(index)))
        seen = (len(self._points), self._mark.stale, places)
        if seen == self._drawn:
            return
        self._drawn = seen
        self._picture.set_content(curve_svg(self._points, places, self._mark.stale))
        rows = [] if self._mark.stale else against(self._points, places)
        self._table.set_content(table(COLUMNS, rows, 1, "curve-table") if rows else "")

    def _save(self) -> None:
        assert self._drive is not None
        save(csv_of(self._points), file_name(self._drive.name, "least k_dyn", suffix=".csv"))


def colour(index: int) -> str:
    """That of a strategy by its place in the table, as `web/modules/theme.js` gives it."""
    return f"var(--strategy-{index % COLOURS})"


def against(points: list[FrontPoint], places: list[Place]) -> list[list[str]]:
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
