"""`report`: compare, map, choose, round, bound; a `Report` holds the data behind everything that is said."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from importlib.metadata import PackageNotFoundError, requires, version
from numbers import Real
from pathlib import Path
from typing import Any, cast

from softstart import __version__
from softstart.chain.machines import MachineLike, as_machine
from softstart.controller import Controller, make_controller
from softstart.controller.base import label_of
from softstart.drive import Machine
from softstart.drive.data_sheet import DataSheet
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError, Mistakes, SimulationError, fact_of
from softstart.input.files import write_whole
from softstart.project import Project
from softstart.reporting.choice import Choice, RobustnessMap, robustness
from softstart.reporting.limit import OptimumCurve, bound_at, limit
from softstart.reporting.sheet import ParameterSheet, make_sheet
from softstart.results import Result
from softstart.start.beside import SideBySide, side_by_side
from softstart.start.comparison import (
    AT_TIME,
    REFERENCE,
    Comparison,
    Uncertain,
    as_far_as_known,
    compare,
    compared,
    make_controllers,
    set_for_limits,
)
from softstart.start.demand import ControllerLike
from softstart.start.duty_comparison import DutyComparison, compare_duty
from softstart.start.fatigue import Fatigue, fatigue, undamped
from softstart.start.recommendation import Row
from softstart.start.resolution import Resolution
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.views.numbers import DASH, percent, printed, short, units_of
from softstart.views.sheet import Sheet
from softstart.views.starts import both_ends, machine_lines

BUDGET, SHAFTS_BUDGET = 20.0, 60.0  # s for optima that take a search, on one shaft and on several


def provenance(drive: Machine, command: str) -> dict[str, Any]:
    """Date (UTC), versions, file of the drive and command of a report made now.

    >>> from softstart import Drive
    >>> made = provenance(Drive.load("crane-4amtkf"), "softstart report")
    >>> made["command"], "numpy" in made["libraries"]
    ('softstart report', True)
    """
    libraries = {}
    with suppress(PackageNotFoundError):
        for one in sorted(requires("softstart") or []):
            name = re.split(r"[^A-Za-z0-9._-]", one, maxsplit=1)[0]
            if "extra ==" not in one:
                libraries[name] = version(name)
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "softstart": __version__,
        "python": platform.python_version(),
        "libraries": libraries,
        "drive": drive.to_toml(),
        "command": command,
    }


@dataclass(frozen=True, eq=False, repr=False)
class Report(Result):
    """All data behind a report: strategies compared, limit, maps, recommendation and parameter sheets.

    Attributes
    ----------
    drive : Drive or Chain
        The machine that is started.
    failed : tuple of (str, str)
        Name of each strategy whose start could not be finished, and the reason.
    limit : Limit
        A bound that no start can go below, and the optima found.
    choice : Choice
        The strategies that could be started, the recommendation, and the best one of an ordinary inverter.
    sheets : tuple of ParameterSheet
        Of the recommended strategy (without limits: that with the lowest K_dyn), of the best ones of an
        ordinary inverter and of one with speed control, and of all others that keep the limits.
    resolution : Resolution
        The steps in which the inverter can be set.
    provenance : dict
        Date, versions, file of the drive and command.
    project : Project
        Customer, author, revisions, sources of the data; see `Project`.
    equal_time : Comparison or None
        The strategies at equal time, 1.3 times that of direct, each with its time parameter set for it.
    beside : SideBySide or None
        The strategies on this machine and on another one.

    Examples
    --------
    >>> from softstart import report
    >>> made = report("crane-4amtkf", controllers=["ramp"], budget=0.0)
    >>> made.to_html()[:15]
    '<!DOCTYPE html>'
    >>> round(made.summary()["k_dyn"], 3)
    2.106

    References
    ----------
    K_dyn: [G] (16).
    """

    drive: Machine
    failed: tuple[tuple[str, str], ...]
    limit: OptimumCurve
    choice: Choice
    sheets: tuple[ParameterSheet, ...]
    resolution: Resolution
    provenance: dict[str, Any]
    project: Project = field(default_factory=Project)
    equal_time: Comparison | None = None
    beside: SideBySide | None = None

    def __repr__(self) -> str:
        """One line that says which strategy came out."""
        best = self.choice.chosen
        best_text = f"{best.name}, K_dyn {best.run.k_dyn:.3f}, {self.choice.role}" if best else "nothing"
        return f"<Report: {best_text}, for {self.drive.name}>"

    @property
    def sheet(self) -> Sheet:
        """What is printed of it: its answer, and what rounding does to each strategy."""
        notes = []
        for one in self.sheets:
            if one.rounded is None:
                notes.append(f"{one.name}: cannot be started with rounded values ({one.failure})")
                continue
            off = f", {one.worst_k_dyn:.4f} at most half a step off." if one.variants else "."
            exact, rounded = one.exact.k_dyn, one.rounded.k_dyn
            notes.append(f"{one.name}: K_dyn {exact:.4f} exact, {rounded:.4f} after rounding{off}")
        notes += [f"{name} was left out: {reason}" for name, reason in self.failed]
        conclusions = [self.answer, *both_ends(self.comparison)]
        return Sheet("Report", machine_lines(self.drive), conclusions=conclusions, notes=notes)

    @property
    def comparison(self) -> Comparison:
        """The strategies that could be started, one row each."""
        return self.choice.comparison

    @cached_property
    def ordered(self) -> list[Row]:
        """The strategies by K_dyn; those that do not reach the target speed last."""

        def place(row: Row) -> tuple[bool, float]:
            return math.isnan(row.run.limited_time), float(f"{row.run.k_dyn:.9g}")

        return sorted(self.comparison.rows, key=place)

    def row(self, name: str) -> Row | None:
        """The row of a strategy."""
        return next((row for row in self.comparison.rows if label_of(row.controller) == name), None)

    def lower_bound(self, row: Row) -> float | None:
        """The K_dyn that no start as quick as this one can go below."""
        return bound_at(self.drive, row.run.start_time)

    def lowest_known(self, row: Row) -> float | None:
        """Lowest K_dyn of all starts that this report knows and that take no longer than this one."""
        return self.limit.lowest_known(row.run.start_time, self.comparison.rows)

    @cached_property
    def lives(self) -> Fatigue | str:
        """Lives of the shaft line under all strategies, or the reason why there are none."""
        try:
            return fatigue([row.run for row in self.comparison.rows])
        except (InputError, SimulationError) as error:
            return " ".join(map(fact_of, getattr(error, "sentences", [str(error)])))

    @cached_property
    def duties(self) -> DutyComparison | str:
        """The duty of the machine under `direct` and the foremost strategies, or why there is none.

        Empty for a machine without a duty.
        """
        if self.drive.duty is None:
            return ""
        rows = dict.fromkeys([self.choice.direct, *self.choice.foremost])
        try:
            return compare_duty(self.drive, [row.controller for row in rows])
        except (InputError, SimulationError) as error:
            return " ".join(getattr(error, "sentences", [str(error)]))

    @cached_property
    def life_gain(self) -> float | None:
        """Life of the shaft line under the chosen strategy over that of `direct`, if it is known."""
        best = self.choice.chosen
        if best is None or undamped(self.drive):
            return None
        with suppress(InputError, SimulationError):
            return min(one.relative for one in fatigue(best.run).rows)
        return None

    def share_saved(self, row: Row) -> str:
        """What a strategy saves of the peak of direct; a dash for direct itself."""
        direct = self.choice.direct
        if row is direct:
            return DASH
        saved = 1.0 - row.run.peak_torque / direct.run.peak_torque
        return percent(saved, 0 if abs(saved) >= 0.1 else 1)

    @property
    def torques(self) -> str:
        """The torques of the motor within the bound, as the machine is seen: "0 to 62 N m"."""
        motor, units = cast("Any", self.drive.motor), units_of(self.drive)
        ends = motor.minimum_torque, min(motor.starting_torque, motor.maximum_torque)
        low, high = (printed(short(float(units.shown(float(end), "N*m")))) for end in ends)
        return f"{low} to {high} {units.label('N*m')}"

    @property
    def answer(self) -> str:
        """The recommendation, what the steps of the inverter do to it, and what no start can go below.

        >>> from softstart import report
        >>> report("crane-4amtkf", controllers=["shaped"], budget=0.0).answer[-46:]
        ' below 0.977; the lowest K_dyn known is 0.978.'
        """
        from softstart.reporting.document import text_answer  # which renders a Report

        return text_answer(self)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON, under the names used everywhere."""
        best, plain, direct = self.choice.chosen, self.choice.ordinary, self.choice.direct.run
        recommendation = self.choice.recommendation
        life = None if self.drive.limits.fatigue is None else self.lives
        return {
            "drive": self.drive.name,
            "recommendation": recommendation.text,
            "recommended": recommendation.recommended.name if recommendation.recommended else None,
            "chosen": best.name if best else None,
            "k_dyn": best.run.k_dyn if best else None,
            "start_time": best.run.start_time if best else None,
            "settled_time": best.run.settled_time if best else None,
            "peak_torque": best.run.peak_torque if best else None,
            "k_dyn_lower_bound": self.lower_bound(best) if best else None,
            "k_dyn_lowest_known": self.lowest_known(best) if best else None,
            "k_dyn_direct": direct.k_dyn,
            "start_time_direct": direct.start_time,
            "settled_time_direct": direct.settled_time,
            "ordinary": plain.name if plain else None,
            "k_dyn_ordinary": plain.run.k_dyn if plain else None,
            "strategies": [
                {**row.summary(), "k_dyn_lower_bound": self.lower_bound(row)} for row in self.comparison.rows
            ],
            "failed": dict(self.failed),
            "choice": self.choice.summary(),
            "maps": {name: one.summary() for name, one in self.choice.maps.items()},
            "limit": self.limit.summary(),
            "life": life.summary() if isinstance(life, Fatigue) else life,
            "life_gain": self.life_gain,
            "duty": duties.summary() if isinstance(duties := self.duties, DutyComparison) else duties or None,
            "sheets": [sheet.summary() for sheet in self.sheets],
            **({} if self.beside is None else {"beside": self.beside.second.summary()}),
            "equal_time": None if self.equal_time is None else self.equal_time.summary(),
            "provenance": self.provenance,
        }

    def to_html(self) -> str:
        """The report as one HTML file that needs nothing else."""
        from softstart.reporting.document import document

        return document(self)

    def save(self, path: str | Path) -> None:
        """Write the HTML file, whole or not at all."""
        text = self.to_html()
        write_whole(Path(path), lambda stream: stream.write(text))


def report(
    drive: MachineLike | Uncertain | DataSheet,
    *,
    controllers: Sequence[ControllerLike] | None = None,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    resolution: Resolution | Mapping[str, object] | str | None = None,
    budget: float | None = None,
    progress: Callable[[float, str], object] | None = None,
    command: str = "",
    project: Project | str | Path | None = None,
    beside: Any = None,
) -> Report:
    """Compute everything that a customer asks about the start of a drive or a chain.

    Parameters
    ----------
    drive : Drive, Chain, Identification, DataSheet, str or path
        A drive or chain, or the name or file of one, or an identification, whose figures have intervals. Of
        a data sheet without any stiffness both ends of what is usual are compared (`compare`). With several
        gaps there are no maps, and each shaft has its figures.
    controllers : sequence of str or Controller, optional
        Names, files of tuned gains, or Controller objects. By default all installed controllers that need
        no parameter. `direct` is added as the reference if it is not among them.
    parameters : mapping, optional
        A controller's name -> its parameters.
    resolution : Resolution, mapping or str, optional
        The steps in which the inverter can be set, as "torque=0.5%,time=10ms".
    budget : float, optional
        Time to search for optima where there is no formula, s; 0 for no search. By default 20 s, 60 s for
        several shafts.
    progress : callable, optional
        Called with the share that is done (0 to 1) and what is being computed.
    command : str, optional
        The command that makes the same report, for the provenance.
    project : Project, str or Path, optional
        A project, or its TOML file: customer, author, revisions, sources of the data, paper size and
        decimal sign.
    beside : Drive, Chain, DataSheet, str or path, optional
        Another machine of the same kind, which a section compares with this one.

    Returns
    -------
    Report
        The data; `save` writes it as one HTML file.

    Raises
    ------
    InputError
        Bad input; all its mistakes at once.
    SimulationError
        Not even the start under `direct` can be finished.

    Examples
    --------
    >>> found = report("crane-4amtkf", controllers=["ramp", "shaped"], budget=0.0)
    >>> found
    <Report: shaped, K_dyn 1.003, lowest K_dyn, for Crane travel drive 4AMTKF(H)112L6>
    >>> found.choice.ordinary.name
    'ramp'

    References
    ----------
    K_dyn: [G] (16).
    """
    about = project if isinstance(project, Project) else Project.open(project) if project else Project()
    known, drawn, soft = as_far_as_known(drive)
    machine = as_machine(known)
    if budget is None:
        budget = SHAFTS_BUDGET if len(machine.shaft_names) > 1 else BUDGET
    steps = _checked_options(machine, budget, resolution, about)
    made = _named_controllers(controllers, parameters or {})
    show = progress or (lambda share, what: None)
    both = None if beside is None else side_by_side(drive, beside, made)
    mapped = "load.inertia" in machine.parameters_by_path()  # what a map varies is a parameter of the file
    started: list[tuple[Controller, Row]] = []
    at_soft_end: list[Row] = []
    maps: dict[str, RobustnessMap] = {}
    failed: list[tuple[str, str]] = []
    reference = simulate(machine, REFERENCE)
    soft_reference = None if soft is None else simulate(soft, REFERENCE)
    for number, one in enumerate(made):
        name = label_of(one)
        show(0.5 * number / len(made), f"starting the {machine.KIND} under {name}")
        try:
            row = compared(machine, one, reference, drawn=drawn, soft=soft)
            if soft is not None:
                at_soft_end.append(compared(soft, one, soft_reference))
            if mapped:
                maps[row.name] = robustness(machine.design_drive, one)
            started.append((one, row))
        except SimulationError as error:
            if name == REFERENCE:
                raise
            failed.append((name, " ".join(str(error).split())))
    compared_soft = None
    if soft is not None:
        ends = [(one, row) for (one, _), row in zip(started, at_soft_end, strict=True)]
        compared_soft, _ = _set_for_limits(soft, ends, soft_reference)
    as_they_are = [one for one, _ in started]
    comparison, started = _set_for_limits(machine, started, reference, drawn, soft, compared_soft)
    changed = [(one, row) for one, row in started if row.setting and mapped]
    maps |= {row.name: robustness(machine.design_drive, one) for one, row in changed}
    choice = Choice(comparison, maps)
    sheets: list[ParameterSheet] = []

    def round_off() -> None:
        import softstart.reporting.document  # noqa: F401  takes half a second, for which nobody waits here

        for row in choice.of_sheets:
            show(0.5, f"rounding the values of {row.name}")
            controller = next(one for one, other in started if other is row)
            sheets.append(make_sheet(machine, controller, row.run, steps, row, drawn, soft))

    curve = limit(
        machine, _start_times(choice.foremost), _start_times(comparison.rows), choice.direct.run.start_time,
        budget, lambda share, text: show(0.5 + 0.5 * share, text), meanwhile=round_off,
    )  # fmt: skip
    show(1.0, "done")
    return Report(
        machine, tuple(failed), curve, choice, tuple(sheets), steps, provenance(machine, command), about,
        _at_equal_time(machine, as_they_are), both,
    )  # fmt: skip


def _start_times(rows: Sequence[Row]) -> list[float]:
    """Those of the rows that have one, s."""
    return [row.run.start_time for row in rows if not math.isnan(row.run.start_time)]


def _at_equal_time(machine: Machine, controllers: Sequence[Controller]) -> Comparison | None:
    """The strategies at equal time; None where that has no table to show."""
    try:
        found = compare(machine, controllers, at_time=AT_TIME)
    except (InputError, SimulationError):  # direct does not settle, or a setting cannot be started
        return None
    return found if any(row.setting for row in found.rows) else None


def _set_for_limits(
    machine: Machine,
    started: Sequence[tuple[Controller, Row]],
    direct: Run | None,
    drawn: MachineTable | None = None,
    soft: Any = None,
    soft_end: Comparison | None = None,
) -> tuple[Comparison, list[tuple[Controller, Row]]]:
    """The comparison of these rows, as `compare` makes it, and its rows with their strategies."""
    start = partial(compared, machine, direct=direct, drawn=drawn, soft=soft)
    controllers, rows = zip(*started, strict=True)
    found, tried = set_for_limits(machine, rows, controllers, direct, start, None, soft)
    made = [replace(one, **row.setting) for one, row in zip(controllers, found, strict=True)]
    comparison = Comparison(machine, found, worst_case=found[0].worst_case, soft_end=soft_end, tried=tried)
    return comparison, list(zip(made, found, strict=True))


def _checked_options(
    machine: Machine,
    budget: float,
    resolution: Resolution | Mapping[str, object] | str | None,
    about: Project,
) -> Resolution:
    """The steps of the inverter; InputError with all that is wrong with the options."""
    mistakes, steps = Mistakes(), Resolution()
    if not isinstance(budget, Real) or isinstance(budget, bool) or not 0.0 <= float(budget) < math.inf:
        mistakes.sentences.append(f"budget = {budget!r}: give a time in s, as 20, 0 or more.")
    with mistakes.collect():
        if resolution is not None:
            steps = resolution if isinstance(resolution, Resolution) else Resolution.read(resolution)
    for source in about.sources:
        if source.parameter not in machine.parameters_by_path():
            mistakes.sentences.append(
                f'project: [[source]] "{source.parameter}" is a parameter of a drive, and '
                f'"{machine.name}" has none of this name; leave these tables out, and name assumed values '
                "in its file."
            )
    mistakes.raise_if_any()
    return steps


def _named_controllers(
    controllers: Sequence[ControllerLike] | None, parameters: Mapping[str, Mapping[str, object]]
) -> list[Controller]:
    """The controllers, each with a name of its own, `direct` among them."""
    made = make_controllers(controllers, parameters)
    labels = [label_of(one) for one in made]
    if wrong := [one for one in dict.fromkeys(labels) if labels.count(one) > 1]:
        raise InputError(
            f"controllers: two of them are called {wrong[0]}; give one of the two another name (that of its "
            "file)."
        )
    return made if REFERENCE in labels else [*made, make_controller(REFERENCE)]
