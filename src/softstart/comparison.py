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
from softstart.start.run import Run
from softstart.start.simulation import simulate

DEFAULT_DRIVE = "crane-4amtkf"
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
    """Strategies side by side on one drive, in the order asked for.

    `fitted_to` is the drive for which they are set up, None where that is `drive` itself.

    >>> from softstart import Drive, compare
    >>> table = compare(Drive.load("crane-4amtkf"), ["direct", "reduced-first-stage"])
    >>> [row.run.controller.name for row in table.rows]
    ['direct', 'reduced-first-stage']
    >>> table.gentlest.run.controller.name
    'reduced-first-stage'
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
    """Start the drive under each controller and compare.

    By default these are all installed ones that run as they are, and those that are given parameters.
    `parameters` maps a controller's name to its parameters. `fitted_to` is the drive for which the
    controllers are set up, if not `drive`: how they fare on one that is not what they believe. Raises
    InputError for bad input.

    >>> from softstart import compare
    >>> row = compare("crane-4amtkf", ["direct"]).rows[0]
    >>> round(row.run.k_dyn, 3), round(row.k_dyn_worn_gap, 3)
    (3.118, 4.865)
    >>> believed = row.run.drive.replace(stiffness=0.5 * row.run.drive.stiffness)
    >>> table = compare("crane-4amtkf", ["shaped", "pulse-coast-hold"], fitted_to=believed)
    >>> [round(row.run.k_dyn, 3) for row in table.rows]
    [1.678, 1.274]
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
    if isinstance(controllers, str | Controller):
        controllers = [controllers]
    asked = list(controllers) if controllers is not None else list(ready_controller_names(parameters or {}))
    if not asked:
        raise InputError("controllers: name at least one; `softstart controllers` lists them.")
    unused = set(parameters or {}) - {name for name in asked if isinstance(name, str)}
    if unused:
        raise InputError(
            f"parameters for {', '.join(sorted(unused))}: that controller is not among those compared."
        )
    mistakes: list[str] = []
    made: list[Controller] = []
    for one in asked:
        try:
            made.append(make_controller(one, (parameters or {}).get(one) if isinstance(one, str) else None))
        except InputError as error:
            mistakes.extend(error.sentences)
    if mistakes:
        raise InputError(mistakes)
    reference = simulate(drive, "direct", until).start_time
    worn = drive.replace(gap=WORN_GAP * drive.gap)
    light = drive.replace(load_inertia=LIGHT_INERTIA * drive.load_inertia)
    rows = []
    for controller in made:
        run = simulate(drive, controller, until, fitted_to=fitted_to)
        rows.append(
            Row(
                run,
                run.start_time - reference,
                _k_dyn_elsewhere(worn, controller, fitted_to or drive, drive, until),
                _k_dyn_elsewhere(light, controller, fitted_to or drive, drive, until),
            )
        )
    return Comparison(drive, tuple(rows), fitted_to)


def _k_dyn_elsewhere(
    other: Drive, controller: Controller, fitted_to: Drive, base: Drive, until: float | None
) -> float:
    try:
        return simulate(other, controller, until, fitted_to=fitted_to, base=base).k_dyn
    except SimulationError:
        return math.nan
