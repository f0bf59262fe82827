"""Strategies side by side on one drive, and what they do when it has changed: `compare`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

from softstart.controller.base import Controller
from softstart.controller.finding import make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.start import metrics
from softstart.start.recommendation import CASES, Case, Recommendation, Row, recommend
from softstart.start.run import BaseRun
from softstart.start.simulation import Startable, models, simulate

notebook = late("softstart.views.notebook")

DEFAULT_DRIVE = "crane-4amtkf"
REFERENCE = metrics.REFERENCE
WORN_GAP = 4.0
LIGHT_INERTIA = 0.4


@dataclass(frozen=True, eq=False)
class Comparison:
    """Strategies side by side on one drive.

    Attributes
    ----------
    drive : Drive or Chain
        The drive, or the chain, that is started.
    rows : tuple of Row
        One for each strategy, in the order given: its `run`, `time_lost` (s), `k_dyn_worn_gap`,
        `k_dyn_light_load`, `flags`, and the `margins` to limits.
    fitted_to : Drive or None
        The drive for which the strategies are set up, None where that is `drive` itself.
    worst_case : tuple of str
        The changes of the drive under which its limits must be kept as well.

    Examples
    --------
    >>> from softstart import Drive, compare
    >>> table = compare(Drive.load("crane-4amtkf"), ["direct", "reduced-first-stage"])
    >>> [row.run.controller.name for row in table.rows]
    ['direct', 'reduced-first-stage']
    >>> [row.name for row in table.recommendation.best]
    ['direct']

    References
    ----------
    K_dyn: [G] (16), docs/theory/stages.md; the strategies: docs/controllers.md.
    """

    drive: Any
    rows: tuple[Row, ...]
    fitted_to: Drive | None = None
    worst_case: tuple[str, ...] = CASES

    @cached_property
    def recommendation(self) -> Recommendation:
        """What is recommended, and why."""
        return recommend(self.drive, self.rows)

    def _repr_html_(self) -> Any:
        """What a notebook shows."""
        return notebook.of_comparison(self)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "drive": self.drive.name,
            "fitted_to": None if self.fitted_to is None else self.fitted_to.name,
            "recommendation": self.recommendation.summary(),
            "strategies": [row.summary() for row in self.rows],
        }


def compare(
    drive: Drive | Startable | str = DEFAULT_DRIVE,
    controllers: Sequence[str | Controller] | str | Controller | None = None,
    *,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    until: float | None = None,
    fitted_to: Drive | None = None,
    worst_case: Sequence[str] | None = None,
) -> Comparison:
    """Start the drive or chain under each controller and compare K_dyn, start time and robustness.

    Parameters
    ----------
    drive : Drive, Chain or str
        One drive, a chain, or the name or file of one of them. Controllers are set up for a chain as they are
        in `simulate_chain`.
    controllers : sequence of str or Controller, optional
        Names, `path/to/file.py:ClassName`, files of tuned gains, or Controller objects. By default all
        installed controllers that need no parameter, and those that are given parameters.
    parameters : mapping, optional
        A controller's name -> its parameters (SI numbers or strings with a unit).
    until : float, optional
        End of each start, s. By default one elastic period after the start time.
    fitted_to : Drive, optional
        The drive for which the controllers are set up, if not `drive`: how they fare on a drive that is not
        the one they assume.
    worst_case : sequence of str, optional
        Which of "gap x4" and "J2 x0.4" must keep the limits of the drive as well; by default both.

    Returns
    -------
    Comparison
        One row for each controller, in the order given.

    Raises
    ------
    InputError
        Bad input; all its mistakes at once.
    SimulationError
        A start on `drive` that cannot be finished.

    Examples
    --------
    >>> from softstart import compare
    >>> row = compare("crane-4amtkf", ["direct"]).rows[0]
    >>> round(row.run.k_dyn, 3), round(row.k_dyn_worn_gap, 3)
    (3.118, 4.865)
    >>> assumed = row.run.drive.replace(stiffness=0.5 * row.run.drive.stiffness)
    >>> table = compare("crane-4amtkf", ["shaped", "pulse-coast-hold"], fitted_to=assumed)
    >>> [round(row.run.k_dyn, 3) for row in table.rows]
    [1.678, 1.274]

    References
    ----------
    K_dyn: [G] (16), docs/theory/stages.md; the strategies: docs/controllers.md.
    """
    if isinstance(drive, str):
        drive = cast("Drive | Startable", models.load_machine(drive))
    if not isinstance(drive, Drive | Startable):
        raise InputError(
            f"drive = {drive!r}: give a Drive or a Chain, the path of its file, or the name of a shipped one."
        )
    if isinstance(drive, Drive) and drive.shape != ():
        raise InputError("drive: compare takes one drive; for a batch, simulate each controller.")
    if fitted_to is not None and not (isinstance(fitted_to, Drive) and fitted_to.shape == ()):
        raise InputError("fitted_to: give the one Drive for which the controllers are set up.")
    counted = (
        (worst_case,) if isinstance(worst_case, str) else CASES if worst_case is None else tuple(worst_case)
    )
    if not set(counted) <= set(CASES):
        named = " and ".join(f'"{case}"' for case in CASES)
        raise InputError(f"worst_case = {worst_case!r}: there are {named}; () is the drive as it is alone.")
    made = make_controllers(controllers, parameters or {})
    direct = simulate(drive, REFERENCE, until)
    rows = tuple(compared(drive, one, direct, until, fitted_to, counted) for one in made)
    return Comparison(drive, rows, fitted_to, counted)


def make_controllers(
    controllers: Sequence[str | Controller] | str | Controller | None,
    parameters: Mapping[str, Mapping[str, object]],
) -> list[Controller]:
    """The controllers to compare, by default all that are ready; InputError holds all mistakes at once."""
    if isinstance(controllers, str | Controller):
        controllers = [controllers]
    asked = list(controllers) if controllers is not None else list(ready_controller_names(parameters))
    if not asked:
        raise InputError("controllers: name at least one; `softstart controllers` lists them.")
    wrong: list[str] = []
    unused = set(parameters) - {one for one in asked if isinstance(one, str)}
    if unused:
        wrong.append(
            f"parameters for {', '.join(sorted(unused))}: that controller is not among those compared."
        )
    made: list[Controller] = []
    for one in asked:
        try:
            made.append(make_controller(one, parameters.get(one) if isinstance(one, str) else None))
        except InputError as error:
            wrong.extend(error.sentences)
    if wrong:
        raise InputError(wrong)
    return made


def compared(
    drive: Drive | Startable,
    controller: Controller,
    direct: BaseRun | None,
    until: float | None = None,
    fitted_to: Drive | None = None,
    worst_case: tuple[str, ...] = CASES,
) -> Row:
    """The row of one controller; `direct` is the start that its times are compared with."""
    run = simulate(drive, controller, until, fitted_to=fitted_to)
    _ = run.settled_time  # now, while what a controller prints is still caught
    cases = {case: changed_case(drive, controller, case, until, fitted_to) for case in CASES}
    return Row(run, direct, cases, worst_case)


def changed_case(
    drive: Drive | Startable,
    controller: Controller,
    case: str,
    until: float | None = None,
    fitted_to: Drive | None = None,
) -> Case:
    """A controller set up for `drive` with 4 times its gap, or 0.4 of its load inertia."""
    changed: Any
    if not isinstance(drive, Drive):
        changed = (
            drive.changed(gaps=WORN_GAP) if case == "gap x4" else drive.changed(load_inertia=LIGHT_INERTIA)
        )
    elif case == "gap x4":
        changed = drive.with_gap(WORN_GAP * drive.gap)
    else:
        changed = drive.replace(load_inertia=LIGHT_INERTIA * drive.load_inertia)
    try:
        return Case.of(simulate(changed, controller, until, fitted_to=fitted_to or drive, base=drive))
    except SimulationError:
        return Case.of(None)
