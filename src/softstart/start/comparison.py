"""Which strategy loads the shaft least, and what it costs in time: `compare`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from softstart.controller.base import Controller
from softstart.controller.finding import make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.start import metrics
from softstart.start.run import Run
from softstart.start.simulation import simulate

DEFAULT_DRIVE = "crane-4amtkf"
REFERENCE = metrics.REFERENCE
WORN_GAP = 4.0
LIGHT_INERTIA = 0.4


@dataclass(frozen=True, eq=False)
class Row:
    """One strategy: its start, and how it fares when the drive is not the one it was set up for.

    The robustness figures keep the controller as it was set up for the nominal drive, while the gap is
    4 times as wide (`k_dyn_worn_gap`) or the load inertia 0.4 times as large (`k_dyn_light_load`); they
    refer to the nominal drive's mean torque, so the three K_dyn compare torques. NaN where that start fails.
    """

    run: Run
    time_lost: float  # s, start time over that of `direct`
    k_dyn_worn_gap: float
    k_dyn_light_load: float

    def summary(self) -> dict[str, Any]:
        """The figures of the run and of this row under the names used everywhere."""
        return {
            **self.run.summary(),
            "time_lost": self.time_lost,
            "k_dyn_worn_gap": self.k_dyn_worn_gap,
            "k_dyn_light_load": self.k_dyn_light_load,
        }


@dataclass(frozen=True, eq=False)
class Comparison:
    """Strategies side by side on one drive.

    Attributes
    ----------
    drive : Drive
        The drive that is started.
    rows : tuple of Row
        One for each strategy, in the order given: its `run`, `time_lost` (s), `k_dyn_worn_gap` and
        `k_dyn_light_load`.
    fitted_to : Drive or None
        The drive for which the strategies are set up, None where that is `drive` itself.

    Examples
    --------
    >>> from softstart import Drive, compare
    >>> table = compare(Drive.load("crane-4amtkf"), ["direct", "reduced-first-stage"])
    >>> [row.run.controller.name for row in table.rows]
    ['direct', 'reduced-first-stage']
    >>> table.gentlest.run.controller.name
    'reduced-first-stage'

    References
    ----------
    K_dyn: [G] (16), docs/theory/stages.md; the strategies: docs/controllers.md.
    """

    drive: Drive
    rows: tuple[Row, ...]
    fitted_to: Drive | None = None

    @property
    def gentlest(self) -> Row:
        """The strategy with the smallest K_dyn among those that reach the target speed."""
        reaching = [row for row in self.rows if not math.isnan(row.run.start_time)]
        # equal to nine digits is equal: then the quicker one
        return min(reaching or self.rows, key=lambda row: (float(f"{row.run.k_dyn:.9g}"), row.time_lost))

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "drive": self.drive.name,
            "fitted_to": None if self.fitted_to is None else self.fitted_to.name,
            "strategies": [row.summary() for row in self.rows],
        }


def compare(
    drive: Drive | str = DEFAULT_DRIVE,
    controllers: Sequence[str | Controller] | str | Controller | None = None,
    *,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    until: float | None = None,
    fitted_to: Drive | None = None,
) -> Comparison:
    """Start the drive under each controller and compare K_dyn, start time and robustness.

    Parameters
    ----------
    drive : Drive or str
        One drive, or the name or file of one.
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
        drive = Drive.load(drive)
    if not isinstance(drive, Drive):
        raise InputError(
            f"drive = {drive!r}: give a Drive, the path of its file, or the name of a shipped one."
        )
    if drive.shape != ():
        raise InputError("drive: compare takes one drive; for a batch, simulate each controller.")
    if fitted_to is not None and not (isinstance(fitted_to, Drive) and fitted_to.shape == ()):
        raise InputError("fitted_to: give the one Drive for which the controllers are set up.")
    made = make_controllers(controllers, parameters or {})
    reference = simulate(drive, REFERENCE, until).start_time
    rows = tuple(compared(drive, one, reference, until, fitted_to) for one in made)
    return Comparison(drive, rows, fitted_to)


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
    drive: Drive,
    controller: Controller,
    reference: float,
    until: float | None = None,
    fitted_to: Drive | None = None,
) -> Row:
    """The row of one controller; `reference` is the start time of `direct`, s."""
    run = simulate(drive, controller, until, fitted_to=fitted_to)
    return Row(
        run,
        run.start_time - reference,
        k_dyn_worn_gap(drive, controller, until, fitted_to),
        k_dyn_light_load(drive, controller, until, fitted_to),
    )


def k_dyn_worn_gap(
    drive: Drive, controller: Controller, until: float | None = None, fitted_to: Drive | None = None
) -> float:
    """K_dyn of a controller set up for `drive` at 4 times its gap; NaN where that start fails."""
    return _k_dyn_changed(drive, drive.with_gap(WORN_GAP * drive.gap), controller, until, fitted_to)


def k_dyn_light_load(
    drive: Drive, controller: Controller, until: float | None = None, fitted_to: Drive | None = None
) -> float:
    """K_dyn of a controller set up for `drive` with 0.4 of its load inertia; NaN where that start fails."""
    light = drive.replace(load_inertia=LIGHT_INERTIA * drive.load_inertia)
    return _k_dyn_changed(drive, light, controller, until, fitted_to)


def _k_dyn_changed(
    drive: Drive, changed: Drive, controller: Controller, until: float | None, fitted_to: Drive | None
) -> float:
    """K_dyn of the changed drive, over the mean torque of `drive`."""
    try:
        return simulate(changed, controller, until, fitted_to=fitted_to or drive, base=drive).k_dyn
    except SimulationError:
        return math.nan
