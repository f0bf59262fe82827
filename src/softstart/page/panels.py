"""The tabs whose answer is computed in the background: Optimum, Pareto, Checks, Tuning, Log."""

from __future__ import annotations

import re

from nicegui import ui

from softstart.controller.finding import controller_class
from softstart.controller.parameters import declared_parameters
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes
from softstart.optimal.problem import StartTime
from softstart.page import tasks
from softstart.page.job_panel import JobPanel, Task, starts_seconds
from softstart.page.panel_parts import TERMINALS, choice, follow, text_field, upload
from softstart.plugins import controller_names
from softstart.quantities import values_in
from softstart.tuning.problem import gaps_of, inertias_of
from softstart.views.numbers import unit, units_of

SEARCHES = {"1": "one search, quick", "3": "three searches", "6": "six searches, thorough"}
MOST_CELLS = 60
LARGEST = 1000 * 1024  # bytes of a log; a request may have little more


class OptimumPanel(JobPanel):
    """The optimal start within a time; it joins the strategies."""

    name = "optimum"
    spread = (0.2, 4.5)
    about = (
        "The torque over time with the lowest K_dyn, and a bound that no start can go below. Where "
        "the start position is unknown it is the best fixed profile for all, and feedback can be lower."
    )
    adds = True

    def form(self) -> None:
        """Start time and what holds at its end."""
        example = "0.3 (s), 300 ms, or 1.2x: that of direct times 1.2"
        self.time = text_field("Start time", "1.2x", "optimum-time", example).classes("panel-narrow")
        self.time.on("keydown.enter", self.start)
        self.end = choice("At its end", TERMINALS, "reached", "optimum-terminal")

    def task(self) -> Task:
        """The gentlest start."""
        text = str(self.time.value).strip()
        StartTime.of(text, "Start time")
        return tasks.optimum_task, self.session.inputs.machine_in_units, text, self.end.value

    def estimate(self) -> float:
        """More for an unknown position, and for a chain."""
        return optimum_seconds(self.session.inputs.machine)


class ParetoPanel(JobPanel):
    """The least K_dyn over the start time, the strategies beside it."""

    name = "curve"
    spread = (0.3, 4.0)
    about = (
        "K_dyn of the best torque profile for each start time; the shaded part is proved out of reach. "
        "Where the start position is unknown one profile serves all of them, and feedback can be lower."
    )

    def form(self) -> None:
        """What holds at the end of each start."""
        self.end = choice("Start ends with", TERMINALS, "reached", "curve-terminal")

    def task(self) -> Task:
        """The curve."""
        inputs = self.session.inputs
        return tasks.curve, inputs.machine_in_units, list(inputs.controllers.values()), self.end.value

    def estimate(self) -> float:
        """Optima for many start times, each of which begins with the answers at others."""
        return 10.0 * optimum_seconds(self.session.inputs.machine)


class ChecksPanel(JobPanel):
    """Start positions, limits and life of all strategies, and the quickest start within limits."""

    name = "checks"
    spread = (0.4, 2.0)
    about = (
        "K_dyn of each strategy from both flanks and the middle of the gaps, margins to the limits, life "
        "beside that under direct, and the quickest start that keeps the limits. Strategies that keep them "
        "when they are set for them can be added."
    )

    def task(self) -> Task:
        """All checks."""
        inputs = self.session.inputs
        return tasks.checked, inputs.machine_in_units, dict(inputs.controllers)

    def estimate(self) -> float:
        """With limits the quickest start that keeps them takes longest."""
        machine = self.session.inputs.machine
        return starts_seconds(machine) + (2.5 * optimum_seconds(machine) if machine.limits else 0.0)


class TuningPanel(JobPanel):
    """Gains for each gap and load inertia, and one set for all of them."""

    name = "tuning"
    spread = (0.4, 3.0)  # from ramp to pulse-coast-hold
    about = (
        "Gains with the least K_dyn that start no slower than the defaults: for each gap and load "
        "inertia, and one set for all of them."
    )
    verb = "Tune"

    def form(self) -> None:
        """The controller, the grid, and how long to search."""
        names, self._offered = tunable_controllers(), ""
        self.controller = choice("Strategy", names, names[0], "tuning-controller")
        follow(self.session, self._offer)
        example = "0.5 (in the page's unit), 30 deg, or 2x the drive's"
        self.gaps = text_field("Gaps", "0.5x, 1x, 2x, 4x", "tuning-gaps", example)
        example = "0.1 (kg m2), 2x of the drive's own, or 5J1 of the motor's"
        self.inertias = text_field("Load inertias", "0.4x, 1x, 2x", "tuning-inertias", example)
        self.searches = choice("Search", SEARCHES, "3", "tuning-searches")
        self.certified = ui.checkbox("optimum of each cell", value=False).classes("panel-check")
        self.certified.props('dense data-testid="tuning-certified"')

    def _offer(self) -> None:
        """The selected strategy, until another one is chosen here."""
        selected = self.session.inputs.selected
        if selected != self._offered and selected in self.controller.options:
            self._offered = selected
            self.controller.set_value(selected)

    def task(self) -> Task:
        """The tuning."""
        drive, name = self.session.inputs.machine_in_units, str(self.controller.value)
        grid = grid_of(drive, str(self.gaps.value), str(self.inertias.value))
        more = bool(self.certified.value), int(self.searches.value)
        return tasks.tuning, self.session.inputs.machine_in_units, name, *grid, *more

    def estimate(self) -> float:
        """In proportion to cells, searches and start positions."""
        machine = self.session.inputs.machine
        gaps, inertias = grid_of(machine, str(self.gaps.value), str(self.inertias.value))
        cell = 1.1 * float(self.searches.value) * len(machine.positions)
        cell += optimum_seconds(machine) if self.certified.value else 0.0
        return len(gaps) * len(inertias) * cell


def optimum_seconds(machine: Machine) -> float:
    """The median of one optimum: 2.2 s of two masses, 9.4 s from three positions, 47 s of a chain of four."""
    shafts = len(machine.shaft_names)
    alone = 2.2 if shafts == 1 else 9.0 * shafts**1.5
    return alone * len(machine.positions) ** 1.3


def tunable_controllers() -> list[str]:
    """Names of the installed controllers that say where tuning may look.

    >>> "shaped" in tunable_controllers(), "direct" in tunable_controllers()
    (True, False)
    """
    names = []
    for name in controller_names():
        try:
            declared = declared_parameters(controller_class(name)).values()
        except InputError:  # somebody's broken plug-in
            continue
        if any(parameter.multiples or parameter.between for parameter in declared):
            names.append(name)
    return names


def grid_of(drive: Machine, gaps: str, inertias: str) -> tuple[list[float], list[float]]:
    """Gaps in rad and load inertias in kg m2 from lists as typed; all mistakes in one InputError.

    Bare numbers of gaps are in the unit of the drive.

    >>> from softstart.drive import Drive
    >>> grid_of(Drive.load("crane-4amtkf"), "0.5x, 1", "5J1; 0,35")
    ([0.25, 1.0], [0.175, 0.35])
    """
    mistakes, units = Mistakes(), units_of(drive)
    values: list[list[float]] = []
    for text, name, read, si in (
        (gaps, "Gaps", gaps_of, "rad"),
        (inertias, "Load inertias", inertias_of, "kg*m^2"),
    ):
        with mistakes.collect():
            typed = [units.typed(value, si) for value in values_in(text, name)]
            values.append(list(read(drive, typed, name)))
    if mistakes.sentences:
        own = unit(units.of("rad"))
        texts = [re.sub(r": (gap|load_inertia) = ", " = ", one) for one in mistakes.sentences]
        raise InputError(
            [one.replace("as a bare number in rad.", f"as a bare number in {own}.") for one in texts]
        )
    cells = len(values[0]) * len(values[1])
    if cells > MOST_CELLS:
        raise InputError(
            f"Gaps and load inertias make {cells} cells; the page tunes at most {MOST_CELLS}, give fewer."
        )
    return values[0], values[1]


class LogPanel(JobPanel):
    """The drive from the log of an inverter; the drive of the page is the guess."""

    name = "log"
    about = (
        "A CSV file of a start from standstill: time, torque, and angle or speed of the motor, with names "
        "and units above the numbers, or as you write them below (counts: angle=1/4096*pos[turn]; a torque "
        "in %: torque=M[% of 35 N*m]). The drive on this page is the first guess and may be off by a factor "
        "of 3. A chain with one dominant gap is identified as two masses. The drive of the page changes "
        "only when you press Use this drive."
    )
    verb = ""

    def form(self) -> None:
        """What the columns are, and the file."""
        kinds = {"demand": "a demand", "measured": "measured"}
        self.torque_is = choice("The torque is", kinds, "demand", "log-torque-is")
        self.columns = text_field("Column names, optional", "", "log-columns", "torque=M, speed=n[rpm]")
        remedy = "cut the log to the start"
        self.go = upload("Load a log ...", "log", ".csv,text/csv", LARGEST, remedy, self.take, self.reject)

    def take(self, content: bytes, name: str) -> None:
        """A file was chosen."""
        self.file = content, name
        self.start()

    def reject(self, name: str, error: InputError) -> None:
        """A file could not be taken."""
        self.refuse(error)

    def task(self) -> Task:
        """The identification."""
        content, name = self.file
        columns = tasks.columns_of(str(self.columns.value or ""))
        guess, kind = self.session.inputs.machine_in_units, str(self.torque_is.value)
        return tasks.identified, content, name, guess, kind, columns

    def estimate(self) -> float:
        """Hardly longer for a long log."""
        return 2.0
