"""The linear view of a controller that runs: `linear_view`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.linear.assembly import Loop
from softstart.linear.cycle_check import Verdict, checked
from softstart.linear.harmonic_balance import Cycle, Outside, cycles
from softstart.linear.margins import Margins
from softstart.linear.modes import Mode
from softstart.linear.operating_point import GOOD, Course, OperatingPoint, course, operating_points, torque
from softstart.linear.sampled_start import SampledStart
from softstart.plant import start as kernel

if TYPE_CHECKING:
    import control

INERTIAS = (0.4, 1.0, 2.5)
STIFFNESSES = (0.9, 1.1)
POOR = 0.02  # mismatch above which the view is said to be doubtful
NAMES = {
    kernel.M_MOTOR_ANGLE: "motor_angle",
    kernel.M_MOTOR_SPEED: "motor_speed",
    kernel.M_MOTOR_TORQUE: "motor_torque",
    kernel.M_SHAFT_TORQUE: "shaft_torque",
    kernel.M_LOAD_SPEED: "load_speed",
}


@dataclass(frozen=True)
class Variation:
    """The loop of the same controller on a drive that is not the one it was set up for."""

    name: str
    drive: Drive = field(repr=False)
    stable: bool
    margins: Margins
    least_damping: float


@dataclass(frozen=True)
class Foretold:
    """A limit cycle by the describing function, and what the exact plant says about it."""

    cycle: Cycle
    verdict: Verdict
    beyond_limits: bool  # the torque demand it asks for is beyond what the motor can give


@dataclass(frozen=True, eq=False, repr=False)
class LinearView:
    """What `linear_view` found. Without a loop (`kind` is not "loop") margins do not apply and are None.

    `kind` is "loop", "open loop" (nothing measured changes the demand in contact) or "events" (the
    controller is not asked at samples there); `notes` are the sentences that belong to the numbers.
    """

    drive: Drive
    controller: Controller
    kind: str
    notes: tuple[str, ...]
    point: OperatingPoint | None = None
    own_loop: Loop | None = None
    outside: Outside | None = None
    margins: Margins | None = None
    modes: tuple[Mode, ...] = ()
    stable: bool | None = None
    variations: tuple[Variation, ...] = ()
    cycles: tuple[Foretold, ...] = ()

    def __repr__(self) -> str:
        """One line that says what came out."""
        return f"<LinearView: {self.name} on {self.drive.name}: {self.conclusion}>"

    @property
    def name(self) -> str:
        """The controller's name."""
        return self.controller.name or type(self.controller).__name__

    @property
    def period(self) -> float:
        """Sample period in s; NaN without a loop."""
        return math.nan if self.point is None else self.point.plant.period

    @property
    def loop(self) -> control.StateSpace:
        """L(z), minimal: the negative of the demand answered to a demand put in; -1 is critical."""
        return self._loop().control_system("demand", "minus_answer")

    @property
    def controller_system(self) -> control.StateSpace:
        """The controller's law, minimal: from what is measured to the demand in N m."""
        import control

        point = self._point()
        law = self._loop().minimal_law
        return control.StateSpace(
            *law, self.period, inputs=[NAMES[i] for i in point.derivative.inputs], outputs=["demand"],
            name=_word(self.name),
        )  # fmt: skip

    @property
    def elastic_mode(self) -> Mode | None:
        """The oscillatory mode whose frequency is nearest to the elastic frequency Omega, on a log scale."""
        swinging = [mode for mode in self.modes if mode.damping_ratio < 1.0 and mode.value.imag > 0.0]
        Omega = float(self.drive.Omega)
        return min(swinging, key=lambda mode: abs(math.log(mode.frequency / Omega)), default=None)

    @property
    def gain_margin(self) -> float | None:
        """Least factor above 1 on the demand that the loop does not stand."""
        return None if self.margins is None else self.margins.gain_margin

    @property
    def phase_margin(self) -> float | None:
        """The least of all gain crossovers, rad."""
        return None if self.margins is None else self.margins.phase_margin

    @property
    def delay_margin(self) -> float | None:
        """Least further dead time that the loop does not stand, s."""
        return None if self.margins is None else self.margins.delay_margin

    @property
    def modulus_margin(self) -> float | None:
        """Least distance of L from -1."""
        return None if self.margins is None else self.margins.modulus_margin

    @property
    def conclusion(self) -> str:
        """One sentence."""
        from softstart.linear.telling import conclusion

        return conclusion(self)

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        from softstart.linear.telling import summary

        return summary(self)

    def plot(self) -> Any:
        """Bode diagram with the margins marked, and Nyquist diagram with the describing function's locus."""
        from softstart.linear.pictures import linear_figure

        self._loop()
        return linear_figure(self)

    def _loop(self) -> Loop:
        if self.own_loop is None:
            raise InputError(f'controller = "{self.name}": {self.notes[0]}')
        return self.own_loop

    def _point(self) -> OperatingPoint:
        self._loop()
        assert self.point is not None
        return self.point


def linear_view(
    drive: Drive | str,
    controller: str | Controller,
    parameters: Mapping[str, object] | None = None,
    *,
    fitted_to: Drive | None = None,
    inertias: Sequence[float] = INERTIAS,
    stiffnesses: Sequence[float] = STIFFNESSES,
    limit_cycles: bool = True,
) -> LinearView:
    """Linearise a controller as it runs, in contact, and read its loop: margins, modes, limit cycles.

    Parameters
    ----------
    drive : a Drive, or the name or file of one.
    controller : a name, `path/to/file.py:ClassName`, or a Controller object, built in or not.
    parameters : parameters of a controller given by name.
    fitted_to : the drive for which the controller is set up, if not `drive`.
    inertias, stiffnesses : factors on J2 and c at which the margins of the same controller are shown too.
    limit_cycles : whether limit cycles through the gap are looked for and tried on the exact plant.

    Raises InputError for bad input (a batch of drives, an unknown controller), SimulationError where the
    start cannot be run.

    >>> view = linear_view("crane-4amtkf", "current-limit-feedback", limit_cycles=False)
    >>> view.kind, view.stable, round(view.elastic_mode.damping_ratio, 1)
    ('loop', True, 0.7)
    >>> linear_view("crane-4amtkf", "ramp").kind
    'open loop'
    """
    if isinstance(drive, str):
        drive = Drive.load(drive)
    made = make_controller(controller, parameters)
    _check(drive, fitted_to, {"inertias": inertias, "stiffnesses": stiffnesses})
    start = SampledStart.of(drive, made, fitted_to)
    run = course(start)
    name = start.controller.name or type(start.controller).__name__
    points = operating_points(start, run)
    if not points:
        return LinearView(drive, start.controller, *_no_samples(name, run))
    point = _chosen(points)
    if not _feeds_back(point):
        sentence = (
            f"{name} acts open loop: in contact nothing it measures changes its torque demand; "
            "margins do not apply."
        )
        return LinearView(drive, start.controller, "open loop", (sentence,), point)
    if np.any(point.derivative.rates[:, list(point.states)]) or _timed_by(point):
        sentence = (
            f"{name} has no linear loop of this kind: what it measures changes the slope of its demand or "
            "the instant at which it wants to be asked again; margins do not apply."
        )
        return LinearView(drive, start.controller, "events", (sentence,), point)
    own = Loop(drive, point, start.differencing)
    modes = own.modes()
    varied = [(f"J2 x {k:g}", {"load_inertia": k * drive.J2}) for k in inertias]
    varied += [(f"c x {k:g}", {"stiffness": k * drive.c}) for k in stiffnesses]
    outside = Outside(drive, point.law, point.derivative.inputs, point.plant, start.differencing)
    found = _cycles(start, run, point, outside) if limit_cycles else ()
    return LinearView(
        drive, start.controller, "loop", _notes(name, run, point, own), point, own, outside, own.margins(),
        modes, own.stable, tuple(_varied(start, point, *one) for one in varied), found,
    )  # fmt: skip


def _feeds_back(point: OperatingPoint) -> bool:
    return bool(point.states) or bool(np.any(point.law.D))


def _chosen(points: Sequence[OperatingPoint]) -> OperatingPoint:
    """The steady one if it is told well and feeds back; else the best told that feeds back; else the best."""
    well = [one for one in points if one.mismatch < GOOD]
    feeding = [one for one in well if _feeds_back(one)]
    steady = [one for one in feeding if one.steady]
    return (steady or feeding or well or [one for one in points if _feeds_back(one)] or list(points))[0]


def _timed_by(point: OperatingPoint) -> bool:
    return bool(np.any(point.derivative.rates[:, point.derivative.A.shape[0] :]))


def _check(drive: object, fitted_to: object, factors: Mapping[str, Sequence[float]]) -> None:
    wrong = []
    for name, one in (("drive", drive), ("fitted_to", fitted_to)):
        if one is None:
            continue
        if not isinstance(one, Drive):
            wrong.append(f"{name} = {one!r}: give a Drive; Drive.load reads one from a file or by name.")
        elif one.shape != ():
            wrong.append(
                f"{name}: {one.name} is a batch of shape {one.shape}, and a linear view is that of one "
                "drive; take one of its elements()."
            )
    for name, values in factors.items():
        wrong += [
            f"{name}: {value!r} is no factor; give numbers above 0."
            for value in values
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf
        ]
    if wrong:
        raise InputError(wrong)


def _no_samples(name: str, run: Course) -> tuple[str, tuple[str, ...]]:
    if any(one.pressing for one in run.samples) and any(math.isfinite(one.ask_again) for one in run.samples):
        return "events", (
            f"{name} is not asked at one sample period throughout a contact of its start: it has no sampled "
            "loop there, and margins do not apply.",
        )
    return "events", (
        f"{name} acts at events, not at samples: in contact its torque demand is fixed beforehand, and "
        "margins do not apply.",
    )


def _notes(name: str, run: Course, point: OperatingPoint, own: Loop) -> tuple[str, ...]:
    notes = []
    if not point.steady:
        why = "the start does not become steady in contact"
        if run.steady:
            why = "where the start is steady a linear law holds less well (a limit or a switch is there)"
        notes.append(f"Linearised at t = {point.sample.time:.4g} s, on the way: {why}.")
    if point.mismatch > POOR:
        notes.append(
            f"{name} is not well told by one linear law: the exact plant answers a small displacement up to "
            f"{100.0 * point.mismatch:.2g} % otherwise than the linear loop; take the margins with caution."
        )
    notes += [
        f"State {index} of the controller is {kind.value} at this instant." for index, kind in point.rough
    ]
    if not own.stable:
        notes.append("The closed loop is unstable in contact: the margins tell crossings, not reserves.")
    return tuple(notes)


def _varied(start: SampledStart, point: OperatingPoint, name: str, change: Mapping[str, Any]) -> Variation:
    drive = start.drive.replace(**change)
    loop = Loop(drive, point, start.differencing)
    least = min((mode.damping_ratio for mode in loop.modes()), default=math.nan)
    return Variation(name, drive, loop.stable, loop.margins(), least)


def _cycles(
    start: SampledStart, run: Course, point: OperatingPoint, outside: Outside
) -> tuple[Foretold, ...]:
    drive = start.drive
    holds = outside.holds_speed()
    rest = run.samples[run.last if not holds else -1]
    back = max(1, round(float(drive.elastic_period) / run.period))
    recent = run.samples[max(run.first, run.last - back) : run.last + 1]
    mean = float(drive.Mc) if holds else float(np.mean([torque(start, one) for one in recent]))
    demand = mean if holds else float(np.mean([one.demand for one in recent]))
    room = min(float(drive.maximum_torque) - demand, demand - float(drive.minimum_torque))
    return tuple(
        Foretold(cycle, checked(start, point, rest, outside, cycle), cycle.demand_amplitude > room)
        for cycle in cycles(outside, mean)
    )


def _word(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name) or "controller"
