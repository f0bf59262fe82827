"""`report`: compare, bound, map, choose, round; a `Report` holds the data behind everything that is said."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from importlib.metadata import PackageNotFoundError, requires, version
from numbers import Real
from pathlib import Path
from typing import Any

from softstart import __version__
from softstart.chain.model import Chain, load_machine
from softstart.controller import Controller, make_controller
from softstart.controller.base import label_of
from softstart.drive import Drive
from softstart.drive.records import is_machine
from softstart.errors import InputError, SimulationError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.reporting.choice import Choice, choose
from softstart.reporting.limit import Limit, bound_at, limit
from softstart.reporting.markup import Html
from softstart.reporting.project import Project
from softstart.reporting.resolution import Resolution
from softstart.reporting.robustness import RobustnessMap, robustness
from softstart.reporting.sheet import Sheet, make_sheet
from softstart.start.comparison import REFERENCE, Comparison, Uncertain, compared, make_controllers
from softstart.start.fatigue import DEFAULT_SLOPE, Fatigue, fatigue, undamped
from softstart.start.recommendation import Row
from softstart.start.simulation import simulate

document = late("softstart.reporting.document")  # renders a Report, so it stands above this module

BUDGET, SHAFTS_BUDGET = 20.0, 60.0  # s for optima that take a search, on one shaft and on several
Progress = Callable[[float, str], object]


@dataclass(frozen=True)
class Provenance:
    """Versions, date (UTC), the drive's file and the command."""

    made: str
    softstart: str
    python: str
    libraries: tuple[tuple[str, str], ...]
    drive_toml: str
    command: str

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "date": self.made,
            "softstart": self.softstart,
            "python": self.python,
            "libraries": dict(self.libraries),
            "drive": self.drive_toml,
            "command": self.command,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """All data behind a report: strategies compared, limit, maps, recommendation and parameter sheets.

    Attributes
    ----------
    drive : Drive or Chain
        The machine that is started.
    comparison : Comparison
        The strategies that could be started, one row each.
    failed : tuple of (str, str)
        Name of each strategy whose start could not be finished, and the reason.
    limit : Limit
        A bound that no start can go below, and the optima found.
    choice : Choice
        The recommendation, the best strategy of an ordinary inverter, and the verdict on each.
    sheets : tuple of Sheet
        Parameter sheets: of the recommended strategy (without limits: the gentlest that is not beaten), then
        of the best one of an ordinary inverter, if these are two.
    resolution : Resolution
        The steps in which the inverter can be set.
    provenance : Provenance
        Versions, date, drive file and command.
    project : Project
        Customer, author, revisions, sources of the data; see `Project`.
    pictures : mapping of str to str
        Figures that were drawn while the limit was looked for.

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
    docs/howto/read-a-report.md; K_dyn: [G] (16); the limit: docs/theory/optimum.md.
    """

    drive: Any
    comparison: Comparison
    failed: tuple[tuple[str, str], ...]
    limit: Limit
    choice: Choice
    sheets: tuple[Sheet, ...]
    resolution: Resolution
    provenance: Provenance
    project: Project = field(default_factory=Project)
    pictures: Mapping[str, Html] = field(default_factory=dict)

    def __repr__(self) -> str:
        """One line that says which strategy came out."""
        best = self.choice.chosen
        best_text = f"{best.name}, K_dyn {best.row.run.k_dyn:.3f}, {self.choice.role}" if best else "nothing"
        return f"<Report: {best_text}, for {self.drive.name}>"

    def row(self, name: str) -> Row | None:
        """The row of a strategy."""
        return next((row for row in self.comparison.rows if label_of(row.run.controller) == name), None)

    def lower_bound(self, row: Row) -> float | None:
        """The K_dyn that no start as quick as this one can go below."""
        return bound_at(self.drive, row.run.start_time)

    @cached_property
    def lives(self) -> Fatigue | str | None:
        """Lives of the shaft line, or the reason why there are none; None without `[limits.fatigue]`."""
        if self.drive.limits.fatigue is None:
            return None
        try:
            return fatigue([row.run for row in self.comparison.rows])
        except (InputError, SimulationError) as error:
            return str(error)

    @cached_property
    def life_gain(self) -> float | None:
        """Life of the shaft line under the chosen strategy over that of `direct`; None where none is known.

        Without `[limits.fatigue]` the slope of the S-N curve is that of `softstart fatigue`.
        """
        best, direct = self.choice.chosen, self.row(REFERENCE)
        if best is None or direct is None or undamped(self.drive):
            return None
        if isinstance(self.lives, Fatigue):
            lives = {
                rows[0].run.controller_name: min(one.relative for one in rows) for rows in self.lives.by_run
            }
            return lives.get(best.row.run.controller_name)
        try:
            return min(one.relative for one in fatigue(best.row.run).rows)
        except (InputError, SimulationError):
            return None

    @property
    def life_slope(self) -> float:
        """Slope of the S-N curve behind `life_gain`; NaN where it is a curve of several points."""
        curve = self.drive.limits.fatigue
        return DEFAULT_SLOPE if curve is None else math.nan if curve.slope is None else curve.slope

    def lowest_known(self, row: Row) -> float | None:
        """Lowest K_dyn of all starts that this report knows and that take no longer than this one."""
        return self.limit.lowest_known(row.run.start_time, self.comparison.rows)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON, under the names used everywhere."""
        best, plain = self.choice.chosen, self.choice.ordinary
        named = self.choice.recommendation.recommended
        direct = self.row(REFERENCE)
        return {
            "drive": self.drive.name,
            "recommendation": self.choice.recommendation.text,
            "recommended": named.name if named else None,
            "chosen": best.name if best else None,
            "k_dyn": best.row.run.k_dyn if best else None,
            "start_time": best.row.run.start_time if best else None,
            "peak_torque": best.row.run.peak_torque if best else None,
            "k_dyn_lower_bound": self.lower_bound(best.row) if best else None,
            "k_dyn_gentlest_known": self.lowest_known(best.row) if best else None,
            "k_dyn_direct": direct.run.k_dyn if direct else None,
            "start_time_direct": direct.run.start_time if direct else None,
            "ordinary": plain.name if plain else None,
            "k_dyn_ordinary": plain.row.run.k_dyn if plain else None,
            "strategies": [
                {**row.summary(), "k_dyn_lower_bound": self.lower_bound(row)} for row in self.comparison.rows
            ],
            "failed": dict(self.failed),
            "choice": self.choice.summary(),
            "maps": {one.name: one.map.summary() for one in self.choice.candidates if one.map is not None},
            "limit": self.limit.summary(),
            "life": self.lives.summary() if isinstance(self.lives, Fatigue) else self.lives,
            "life_gain": self.life_gain,
            "sheets": [sheet.summary() for sheet in self.sheets],
            "provenance": self.provenance.summary(),
        }

    def to_html(self) -> str:
        """The report as one HTML file that needs nothing else."""
        text: str = document.document(self)
        return text

    def write(self, path: str | Path) -> None:
        """Write the HTML file, whole or not at all."""
        text = self.to_html()
        write_whole(Path(path), lambda stream: stream.write(text))


def report(
    drive: Drive | Chain | Uncertain | str,
    *,
    controllers: Sequence[str | Controller] | None = None,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    resolution: Resolution | Mapping[str, object] | str | None = None,
    budget: float | None = None,
    progress: Progress | None = None,
    command: str = "",
    project: Project | str | Path | None = None,
    draw: bool = False,
) -> Report:
    """Compute everything that a customer asks about the start of a drive or a chain.

    Parameters
    ----------
    drive : Drive, Chain, Identification or str
        A drive or chain, or the name or file of one, or an identification, whose figures have intervals. With
        several gaps there are no maps, and each shaft has its figures.
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
        Customer, author, revisions, sources of the data, paper size and decimal sign, or their TOML file.
    draw : bool, optional
        Draw most figures while the limit is looked for, so that `to_html` is quick.

    Returns
    -------
    Report
        The data; `write` makes one HTML file of it.

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
    <Report: shaped, K_dyn 1.004, gentlest unbeaten, for Crane travel drive 4AMTKF(H)112L6>
    >>> found.choice.ordinary.name
    'ramp'

    References
    ----------
    docs/howto/read-a-report.md; K_dyn: [G] (16); the limit: docs/theory/optimum.md.
    """
    about = project if isinstance(project, Project) else Project.load(project) if project else Project()
    drawn = None
    if isinstance(drive, Uncertain):
        drawn = drive.draws()
        drive = drive.drive
    machine: Any = load_machine(drive) if isinstance(drive, str | Path) else drive
    if not is_machine(machine):
        raise InputError(
            f"drive = {drive!r}: give a Drive or a Chain, the path of its file, or a shipped name."
        )
    several = len(machine.shaft_names) > 1
    budget = (SHAFTS_BUDGET if several else BUDGET) if budget is None else budget
    steps = checked_steps(resolution, budget)
    known = machine.by_path()
    if wrong := [one.parameter for one in about.sources if one.parameter not in known]:
        raise InputError(
            f'project: [[source]] "{wrong[0]}" is a parameter of a drive, and "{machine.name}" has none of '
            "this name; leave these tables out, and name assumed values in its file."
        )
    made = controllers_of(controllers, parameters or {})

    def show(share: float, what: str) -> None:
        if progress is not None:
            progress(share, what)

    rows: list[Row] = []
    failed: list[tuple[str, str]] = []
    maps: list[RobustnessMap | None] = []
    reference = simulate(machine, REFERENCE)
    mapped = "load.inertia" in known  # what a map varies is a parameter of the file
    for number, one in enumerate(made):
        show(
            0.4 * number / len(made), f"starting the {machine.WHAT.removeprefix('a ')} under {label_of(one)}"
        )
        try:
            row = compared(machine, one, reference, drawn=drawn)
            maps.append(robustness(machine, one) if mapped else None)
            rows.append(row)
        except SimulationError as error:
            if label_of(one) == REFERENCE:
                raise
            failed.append((label_of(one), " ".join(str(error).split())))
    used = [one for one in made if label_of(one) not in dict(failed)]
    comparison = Comparison(machine, tuple(rows), worst_case=rows[0].worst_case)
    choice = choose(maps, rows, comparison.recommendation)
    sheets = []
    chosen = [one for one in (choice.chosen, choice.ordinary) if one is not None]
    for index, candidate in enumerate(dict.fromkeys(chosen)):
        show(0.4 + 0.05 * index, f"rounding the values of {candidate.name}")
        controller = used[rows.index(candidate.row)]
        row = candidate.row
        sheets.append(make_sheet(machine, controller, row.run, steps, row, drawn))
    times = [one.row.run.start_time for one in chosen]
    direct = next(row.run.start_time for row in rows if label_of(row.run.controller) == REFERENCE)
    reached = [row.run.start_time for row in rows if row.run.start_time == row.run.start_time]
    show(0.5, "looking for the limit")
    pictures: dict[str, Html] = {}

    def meanwhile() -> None:
        if draw:
            pictures.update(document.pictures(choice, comparison))

    found = limit(
        machine,
        times,
        reached,
        direct,
        budget,
        lambda share, what: show(0.5 + 0.5 * share, what),
        meanwhile,
    )
    show(1.0, "done")
    return Report(
        machine, comparison, tuple(failed), found, choice, tuple(sheets), steps,
        provenance(machine, command), about, pictures,
    )  # fmt: skip


def checked_steps(resolution: Resolution | Mapping[str, object] | str | None, budget: object) -> Resolution:
    """The resolution; all mistakes of the input at once."""
    wrong: list[str] = []
    if not isinstance(budget, Real) or isinstance(budget, bool) or not 0.0 <= float(budget) < float("inf"):
        wrong.append(f"budget = {budget!r}: give a time in s, as 20, 0 or more.")
    steps = Resolution()
    try:
        if isinstance(resolution, Resolution):
            steps = resolution
        elif resolution is not None:
            steps = Resolution.read(resolution)
    except InputError as error:
        wrong.extend(error.sentences)
    if wrong:
        raise InputError(wrong)
    return steps


def controllers_of(
    controllers: Sequence[str | Controller] | None, parameters: Mapping[str, Mapping[str, object]]
) -> list[Controller]:
    """The controllers to examine, `direct` among them; two of one name are refused."""
    made = make_controllers(controllers, parameters)
    labels = [label_of(one) for one in made]
    wrong = [
        f"controllers: two of them are called {label}; give one of the two another name (that of its file)."
        for label in dict.fromkeys(labels)
        if labels.count(label) > 1
    ]
    if wrong:
        raise InputError(wrong)
    if not any(label_of(one) == REFERENCE for one in made):
        made.append(make_controller(REFERENCE))
    return made


def provenance(drive: Any, command: str) -> Provenance:
    """That of a report made now.

    >>> made = provenance(Drive.load("crane-4amtkf"), "softstart report")
    >>> made.command, "numpy" in dict(made.libraries)
    ('softstart report', True)
    """
    return Provenance(
        datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"), __version__, platform.python_version(),
        tuple((name, version(name)) for name in _libraries()), drive.to_toml(), command,
    )  # fmt: skip


def _libraries() -> list[str]:
    """The installed ones that softstart requires to run."""
    try:
        needed = [one for one in requires("softstart") or [] if "extra ==" not in one]
    except PackageNotFoundError:
        needed = []
    found = []
    for one in needed or ["numpy", "scipy", "numba", "matplotlib"]:
        name = re.split(r"[^A-Za-z0-9._-]", one, maxsplit=1)[0]
        try:
            version(name)
        except PackageNotFoundError:
            continue
        found.append(name)
    return sorted(found)
