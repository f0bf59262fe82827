"""Controllers that stand for tuned gains: one robust set, or a schedule over gap and load inertia."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.controller.base import Controller, PlainController, Sensor
from softstart.controller.finding import make_controller
from softstart.controller.gain_files import RobustFile, Scale, ScheduleFile, read_gain_file
from softstart.drive import Drive
from softstart.errors import InputError


@dataclass(frozen=True, eq=False)
class Tuned(Controller):
    """What stands for another controller with tuned gains; `label` tells it from that one in tables."""

    label: str
    controller: Controller

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", named(self.controller, self.label))

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the controller it stands for."""
        return self.controller.sensors

    def _called(self, controller: Controller) -> Controller:
        """The controller, under the name of these gains."""
        ready = replace(controller)
        object.__setattr__(ready, "name", self.name)
        return ready


@dataclass(frozen=True, eq=False)
class RobustGains(Tuned):
    """One set of gains for all: the controller as it was set up for the nominal drive, whatever drive starts.

    >>> from softstart import simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> gains = RobustGains("robust", make_controller("ramp", {"time": 0.12}), crane)
    >>> worn = crane.replace(gap=2)
    >>> run = simulate(worn, gains)
    >>> run.controller.name, run.k_dyn == simulate(worn, gains.controller, fitted_to=crane).k_dyn
    ('ramp (robust)', True)
    """

    nominal: Drive

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller set up for the nominal drive, and that drive."""
        ready, own = self.controller.set_up(self.nominal)
        return self._called(ready), own

    @property
    def parameters(self) -> dict[str, Any]:
        """Those of the controller as it is set up."""
        return self.controller.set_up(self.nominal)[0].parameters


@dataclass(frozen=True, eq=False)
class GainSchedule(Tuned):
    """Gains over a grid of gaps and load inertias, taken for the gap and load inertia that a drive declares.

    Between the nodes the gains are bilinear in gap and load inertia, in their logarithm where their scale is
    logarithmic; at a node they are those of the node to the bit. Outside the grid the nearest value on its
    edge is taken: nothing is extrapolated. All other parameters follow the drive, as they do without tuning.

    `gains` holds name, scale and values (a row a gap, a column a load inertia).

    >>> gains = (("time", "linear", np.array([[0.1], [0.2]])),)
    >>> schedule = GainSchedule("schedule", make_controller("ramp"), (0.5, 1.0), (0.175,), gains)
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(schedule.set_up(crane.replace(gap=gap))[0].time, 9) for gap in (0.1, 0.5, 0.75, 9)]
    [0.1, 0.1, 0.15, 0.2]
    """

    gaps: tuple[float, ...]
    load_inertias: tuple[float, ...]
    gains: tuple[tuple[str, Scale, Vector], ...]

    def gains_at(self, gap: Any, load_inertia: Any) -> dict[str, Any]:
        """The gains for a gap in rad and a load inertia in kg m2, numbers or arrays."""
        row, across = _place(self.gaps, gap)
        column, along = _place(self.load_inertias, load_inertia)
        below, right = (
            np.minimum(row + 1, len(self.gaps) - 1),
            np.minimum(column + 1, len(self.load_inertias) - 1),
        )
        found = {}
        for name, scale, values in self.gains:
            near = _mixed(values[row, column], values[row, right], along, scale)
            far = _mixed(values[below, column], values[below, right], along, scale)
            value = _mixed(near, far, across, scale)
            found[name] = value if np.ndim(value) else float(value)
        return found

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller with the gains for the drive's gap and load inertia, set up for the drive."""
        if isinstance(self.controller, PlainController) and drive.shape != ():
            return self, drive  # a plain controller is set up start by start
        gains = self.gains_at(drive.gap, drive.load_inertia)
        ready, own = replace(self.controller, **gains).set_up(drive)
        return self._called(ready), own

    @property
    def parameters(self) -> dict[str, Any]:
        """Grid and gains."""
        grid = {"gaps": list(self.gaps), "load_inertias": list(self.load_inertias)}
        return grid | {name: values.tolist() for name, _, values in self.gains}


def _place(nodes: tuple[float, ...], value: Any) -> tuple[Any, Any]:
    """Index of the node below, and the way to the next one as a share of the step; clamped to the grid."""
    axis = np.array(nodes)
    inside = np.clip(np.asarray(value, dtype=np.float64), axis[0], axis[-1])
    if len(nodes) == 1:
        return np.zeros(inside.shape, dtype=np.int64), np.zeros(inside.shape)
    below = np.clip(np.searchsorted(axis, inside, side="right") - 1, 0, len(nodes) - 2)
    return below, (inside - axis[below]) / (axis[below + 1] - axis[below])


def _mixed(first: Any, second: Any, share: Any, scale: Scale) -> Any:
    """Between two values; at share 0 and 1 the values themselves, to the bit."""
    if scale == "logarithmic":
        between = np.exp((1.0 - share) * np.log(first) + share * np.log(second))
    else:
        between = (1.0 - share) * first + share * second
    return np.where((share == 0.0) | (first == second), first, np.where(share == 1.0, second, between))


def named(controller: Controller, label: str) -> str:
    """The name under which tuned gains stand in tables."""
    return f"{controller.name or type(controller).__name__} ({label})"


def load_gains(name: str, parameters: Mapping[str, object] | None = None) -> Tuned:
    """The controller that a file of tuned gains stands for. Raises InputError."""
    path = Path(name)
    saved = read_gain_file(path)
    if parameters:
        raise InputError(
            f'parameters {sorted(parameters)} were given beside the tuned gains of "{path}"; '
            "change them in the file, or give them to the controller itself."
        )
    try:
        if isinstance(saved, RobustFile):
            return RobustGains(path.stem, make_controller(saved.controller, saved.parameters), saved.drive)
        return scheduled(saved, path.stem)
    except InputError as error:
        raise InputError([f'controller = "{path}": {sentence}' for sentence in error.sentences]) from None


def scheduled(saved: ScheduleFile, label: str, controller: Controller | None = None) -> GainSchedule:
    """The controller that plays a schedule; made from its name if it is not given."""
    controller = make_controller(saved.controller, saved.fixed) if controller is None else controller
    known = [f.name for f in fields(controller)]
    unknown = [name for name in saved.gains if name not in known]
    if unknown:
        raise InputError(
            f"gains {', '.join(unknown)}: the controller {controller.name} has no such parameter; "
            f"it has {', '.join(known) or 'none'}."
        )
    gains = tuple((name, gain.scale, gain.values) for name, gain in saved.gains.items())
    made = GainSchedule(label, controller, saved.gaps, saved.load_inertias, gains)
    for gap in saved.gaps:  # the gains of each node are ones that the controller takes
        for inertia in saved.load_inertias:
            replace(controller, **made.gains_at(gap, inertia))
    return made
