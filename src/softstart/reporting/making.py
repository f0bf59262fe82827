"""`report`: compare, bound, map, choose, round; everything that the report says is computed here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from numbers import Real

from softstart.controller import Controller, make_controller
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.reporting.choice import SLOWER, choose
from softstart.reporting.limit import limit
from softstart.reporting.provenance import provenance
from softstart.reporting.resolution import Resolution
from softstart.reporting.result import Report
from softstart.reporting.robustness import robustness
from softstart.reporting.sheet import make_sheet
from softstart.reporting.strategies import label_of
from softstart.start.comparison import REFERENCE, Comparison, Row, compared, make_controllers
from softstart.start.simulation import simulate

BUDGET = 20.0  # s for optima that take a search

Progress = Callable[[float, str], object]


def report(
    drive: Drive | str,
    *,
    controllers: Sequence[str | Controller] | None = None,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    resolution: Resolution | Mapping[str, object] | str | None = None,
    slower: float = SLOWER,
    budget: float = BUDGET,
    progress: Progress | None = None,
    command: str = "",
) -> Report:
    """Everything that a customer asks about the start of a drive, computed.

    Parameters
    ----------
    drive : a Drive, or the name or file of one.
    controllers : names, files of tuned gains or Controller objects; by default all installed ones that run as
        they are. `direct` is added, if it is not among them, to compare with.
    parameters : a controller's name -> its parameters.
    resolution : the steps in which the inverter can be set, as "torque=0.5%,time=10ms" or a Resolution.
    slower : by what share the start of the recommended strategy may be longer than that of direct.
    budget : s, at most, to look for optima where there is no formula; 0 looks for none.
    progress : told the share that is done and what is being done.
    command : the command that repeats it, for the provenance.

    Raises InputError for bad input and SimulationError where not even direct can be started.

    >>> found = report("crane-4amtkf", controllers=["ramp", "shaped"], budget=0.0)
    >>> found
    <Report: shaped, K_dyn 1.004 recommended for Crane travel drive 4AMTKF(H)112L6>
    >>> found.choice.ordinary.name
    'ramp'
    """
    drive = Drive.load(drive) if isinstance(drive, str) else drive
    steps = _checked(drive, resolution, slower, budget)
    made = _made(controllers, parameters or {})

    def tell(share: float, what: str) -> None:
        if progress is not None:
            progress(share, what)

    rows: list[Row] = []
    failed: list[tuple[str, str]] = []
    maps = []
    reference = simulate(drive, REFERENCE).start_time
    for number, one in enumerate(made):
        tell(0.4 * number / len(made), f"starting the drive under {label_of(one)}")
        try:
            row = compared(drive, one, reference)
            maps.append(robustness(drive, one))
            rows.append(row)
        except SimulationError as error:
            if label_of(one) == REFERENCE:
                raise
            failed.append((label_of(one), " ".join(str(error).split())))
    used = [one for one in made if label_of(one) not in dict(failed)]
    choice = choose(rows, maps, slower)
    sheets = []
    chosen = [one for one in (choice.recommended, choice.ordinary) if one is not None]
    for index, candidate in enumerate(dict.fromkeys(chosen)):
        tell(0.4 + 0.05 * index, f"rounding the values of {candidate.name}")
        controller = used[rows.index(candidate.row)]
        sheets.append(make_sheet(drive, controller, candidate.row.run, steps))
    times = [one.row.run.start_time for one in chosen]
    direct = next(row.run.start_time for row in rows if label_of(row.run.controller) == REFERENCE)
    reached = [row.run.start_time for row in rows if row.run.start_time == row.run.start_time]
    tell(0.5, "looking for the limit")
    found = limit(
        drive, [*times, *reached], direct, budget, lambda share, what: tell(0.5 + 0.5 * share, what)
    )
    tell(1.0, "done")
    return Report(
        drive, Comparison(drive, tuple(rows)), tuple(failed), found, choice, tuple(sheets), steps,
        provenance(drive, command),
    )  # fmt: skip


def _checked(
    drive: object, resolution: Resolution | Mapping[str, object] | str | None, slower: object, budget: object
) -> Resolution:
    """The resolution; all mistakes of the input at once."""
    wrong: list[str] = []
    if not isinstance(drive, Drive):
        wrong.append(f"drive = {drive!r}: give a Drive, the path of its file, or the name of a shipped one.")
    elif drive.shape != ():
        wrong.append("drive: a report is about one drive; give one value for each parameter.")
    for name, value in (("slower", slower), ("budget", budget)):
        if not isinstance(value, Real) or isinstance(value, bool) or not 0.0 <= float(value) < float("inf"):
            meant = "a share, as 0.15" if name == "slower" else "a time in s, as 20"
            wrong.append(f"{name} = {value!r}: give {meant}, 0 or more.")
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


def _made(
    controllers: Sequence[str | Controller] | None, parameters: Mapping[str, Mapping[str, object]]
) -> list[Controller]:
    made = make_controllers(controllers, parameters)
    labels = [label_of(one) for one in made]
    mistakes = [
        f"controllers: two of them are called {label}; give one of the two another name (that of its file)."
        for label in dict.fromkeys(labels)
        if labels.count(label) > 1
    ]
    if mistakes:
        raise InputError(mistakes)
    if not any(label_of(one) == REFERENCE for one in made):
        made.append(make_controller(REFERENCE))
    return made
