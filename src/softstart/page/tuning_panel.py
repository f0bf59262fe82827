"""Tuning in the background: gains for each gap and load inertia, and one set for all of them."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import fields
from pathlib import Path
from typing import Any

from nicegui import ui

from softstart.chain.machines import Machine
from softstart.controller.finding import controller_class, controller_names, make_controller
from softstart.controller.tuned import RobustFile, RobustGains, Tuned, read_gains, scheduled
from softstart.errors import InputError, Mistakes
from softstart.page import tasks
from softstart.page.downloads import file_name
from softstart.page.jobs import Jobs
from softstart.page.panel_parts import (
    POLL,
    JobView,
    StaleNote,
    action,
    box,
    choice,
    duration,
    facts,
    field,
    guarded,
    hint,
    jobs_of,
    notify,
    number,
    save,
    table,
)
from softstart.page.session import Session
from softstart.quantities import Units, values_in
from softstart.tuning.question import gaps_of, inertias_of
from softstart.views.numbers import fixed, unit, units_of

FIRST = "shaped"  # the controller offered first, if it is there
SEARCHES = {"1": "one search, quick", "3": "three searches", "6": "six searches, thorough"}
MOST_CELLS = 60


class TuningPanel:
    """Form, progress and result; built in the current slot."""

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self._session = session
        self._found: tasks.Tuned | None = None
        names = tunable()
        with box().classes("panel-form"):
            first = FIRST if FIRST in names else names[0]
            self._name = choice("Strategy", names, first, "tuning-controller")
            self._gaps = field(
                "Gaps",
                "0.5x, 1x, 2x, 4x",
                "tuning-gaps",
                "0.5 (in the page's unit), 30 deg, or 2x the drive's",
            )
            self._inertias = field(
                "Load inertias",
                "0.4x, 1x, 2x",
                "tuning-inertias",
                "0.1 (kg m2), 2x of the drive's own, or 5J1 of the motor's",
            )
            self._searches = choice("Search", SEARCHES, "3", "tuning-searches")
            self._certified = ui.checkbox("optimum of each cell", value=False).classes("panel-check")
            self._certified.props('dense data-testid="tuning-certified"')
            self._go = action("Tune", self._begin, "tuning-go", main=True)
        self._hint = hint(
            "Gains with the least K_dyn that start no slower than the defaults: for each gap and load "
            "inertia, and one set for all of them."
        )
        self._view = JobView(jobs or jobs_of(user), user, "tuning", on_done=self._done, on_state=self._state)
        with box().classes("panel-result") as self._result:
            self._stale = StaleNote(session, "tuning")
            self._figures = ui.html("", sanitize=False)
            self._gains = ui.html("", sanitize=False)
            with box().classes("panel-actions"):
                ui.label("One set for all").classes("panel-caption")
                action("Use", guarded(lambda: self._add("robust.toml")), "tuning-use-robust")
                action("TOML", guarded(lambda: self._save("robust.toml")), "tuning-robust-toml")
            self._cells = ui.html("", sanitize=False).classes("panel-scroll")
            with box().classes("panel-actions"):
                ui.label("By gap and inertia").classes("panel-caption")
                action("Use", guarded(lambda: self._add("schedule.toml")), "tuning-use-schedule")
                action("TOML", guarded(lambda: self._save("schedule.toml")), "tuning-schedule-toml")
                action("CSV", guarded(lambda: self._save("schedule.csv")), "tuning-schedule-csv")
        self._result.set_visibility(False)
        ui.timer(POLL, self._stale.refresh)

    def _begin(self) -> None:
        if self._view.busy:
            return
        try:
            drive = self._session.machine
            gaps, inertias = grid_of(drive, str(self._gaps.value), str(self._inertias.value))
        except InputError as error:
            self._view.refuse(error)
            return
        name = str(self._name.value)
        self._view.begin(
            f"tuning of {name}", tasks.tuning, drive, name, gaps, inertias,
            bool(self._certified.value), int(self._searches.value), subject=drive,
        )  # fmt: skip

    def _state(self) -> None:
        self._view.settle(self._go, self._result)

    def _done(self, found: tasks.Tuned) -> None:
        self._found = found
        self._figures.set_content(facts(figures(found), "tuning-figures"))
        self._gains.set_content(gain_table(found, units_of(self._view.subject)))
        self._cells.set_content(cell_table(found, units_of(self._view.subject)))
        self._hint.set_visibility(False)
        self._result.set_visibility(True)
        self._stale.show_for(self._view.subject)

    def _add(self, file: str) -> None:
        assert self._found is not None
        self._stale.check()
        controller = controller_of(self._found.files[file], file)
        label = self._session.add(controller.name or file, controller)
        notify(f"{label} is among the strategies.")

    def _save(self, file: str) -> None:
        assert self._found is not None
        stem, _, suffix = file.rpartition(".")
        save(self._found.files[file], file_name(self._found.controller, stem, suffix=f".{suffix}"))


def tunable() -> list[str]:
    """Names of the installed controllers that say where tuning may look.

    >>> "shaped" in tunable(), "direct" in tunable()
    (True, False)
    """
    found = []
    for name in controller_names():
        try:
            metadata = [field.metadata for field in fields(controller_class(name))]
        except InputError:  # somebody's broken plug-in
            continue
        if any(one.get("multiples") or one.get("between") for one in metadata):
            found.append(name)
    return found


def grid_of(drive: Machine, gaps: str, inertias: str) -> tuple[list[float], list[float]]:
    """Gaps in rad and load inertias in kg m2 from lists as typed; all mistakes in one InputError.

    Bare numbers of gaps are in the unit of the drive.

    >>> from softstart.drive import Drive
    >>> grid_of(Drive.load("crane-4amtkf"), "0.5x, 1", "5J1; 0,35")
    ([0.25, 1.0], [0.175, 0.35])
    """
    wrong = Mistakes()
    found: list[list[float]] = []
    units = units_of(drive)
    for text, name, read, si in (
        (gaps, "Gaps", gaps_of, "rad"),
        (inertias, "Load inertias", inertias_of, "kg*m^2"),
    ):
        with wrong.noted():
            found.append(list(read(drive, [units.typed(one, si) for one in values_in(text, name)], name)))
    wrong.settle()
    if len(found[0]) * len(found[1]) > MOST_CELLS:
        raise InputError(
            f"Gaps and load inertias make {len(found[0]) * len(found[1])} cells, and the page tunes at most "
            f"{MOST_CELLS}; take fewer."
        )
    return found[0], found[1]


def controller_of(text: str, file: str) -> Tuned:
    """The controller that the text of a file of tuned gains stands for."""
    path = Path(file)
    saved = read_gains(text, path)
    if isinstance(saved, RobustFile):
        return RobustGains(path.stem, make_controller(saved.controller, saved.parameters), saved.drive)
    return scheduled(saved, path.stem)


def figures(found: tasks.Tuned) -> list[tuple[str, str]]:
    """What one set for all gains over the defaults."""
    one = found.summary["robust"]
    return [
        ("worst K_dyn, one set", number(one["worst"])),
        ("with the defaults", number(one["worst_default"])),
        ("in time", "yes" if one["feasible"] else f"no, {100 * one['excess']:.2g} % late"),
        ("searches that agree", f"{one['agreement']} of {one['restarts']}"),
        ("starts", f"{found.starts:,} in {duration(found.seconds)}"),
    ]


def gain_table(found: tasks.Tuned, seen: Units) -> str:
    """The gains of the set for all, beside the defaults."""
    one = found.summary["robust"]
    meta = {name: one["defaults"].get(name) for name in one["gains"]}
    si = {one.name: str(one.metadata.get("unit", "")) for one in fields(controller_class(found.controller))}
    rows = [
        [name, unit(seen.of(si[name])), *(number(value and seen.shown(value, si[name]), 5) for value in
                                          (default, one["gains"][name]))]
        for name, default in meta.items()
    ]  # fmt: skip
    return table(["gain", "unit", "default", "one set for all"], rows, 2, "tuning-gains")


def cell_table(found: tasks.Tuned, units: Units) -> str:
    """One row a cell: gap, inertia, K_dyn before and after, the optimum where it was asked for, the gains."""
    schedule: dict[str, Any] = found.summary["schedule"]
    price: dict[str, Any] = found.summary["price"] or {}
    best = price.get("schedule_optimum")
    one = found.summary["robust"]["cells"]["k_dyn"]
    gains = list(found.summary["robust"]["gains"])
    rows = []
    for i, gap in enumerate(found.summary["gaps"]):
        for j, inertia in enumerate(found.summary["load_inertias"]):
            k = (schedule["k_dyn_default"][i][j], one[i][j], schedule["k_dyn"][i][j])
            row = [number(units.shown(gap, "rad")), number(inertia), *(fixed(value, 3) for value in k)]
            if best is not None:
                row.append(fixed(best[i][j], 3))
            rows.append([*row, *(number(schedule[name][i][j]) for name in gains)])
    head = [f"gap {units.angle}", "J2 kg m\N{SUPERSCRIPT TWO}", "K_dyn default", "one set", "by cell"]
    return table([*head, *(["optimum"] if best is not None else []), *gains], rows, 0, "tuning-cells")
