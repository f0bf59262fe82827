"""The linear view of a controller that runs: `linear_view`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.chain.machines import Machine
from softstart.chain.model import load_machine
from softstart.controller.base import Controller, label_of
from softstart.controller.finding import make_controller
from softstart.drive.records import is_machine
from softstart.errors import InputError
from softstart.kernel import motor as exchange
from softstart.linear.limit_cycles import Cycle, Outside, Verdict, check_cycle, cycles
from softstart.linear.loop import Loop, Margins
from softstart.linear.operating_point import (
    GOOD,
    OperatingPoint,
    SampledRun,
    operating_points,
    run_until_steady,
)
from softstart.linear.sampled_plant import single, sizes_of
from softstart.linear.sampled_start import SampledStart
from softstart.linear.systems import Mode

if TYPE_CHECKING:
    import control

INERTIAS = (0.4, 1.0, 2.5)
STIFFNESSES = (0.9, 1.1)
POOR = 0.02  # mismatch above which a note says that the view is doubtful
NAMES = {
    exchange.M_MOTOR_ANGLE: "motor_angle",
    exchange.M_MOTOR_SPEED: "motor_speed",
    exchange.M_MOTOR_TORQUE: "motor_torque",
    exchange.M_SHAFT_TORQUE: "shaft_torque",
    exchange.M_LOAD_SPEED: "load_speed",
}


@dataclass(frozen=True)
class Variation:
    """The loop of the same controller on a drive that it was not set up for, or with all gaps open."""

    name: str
    drive: Machine = field(repr=False)
    stable: bool
    margins: Margins
    least_damping: float


@dataclass(frozen=True)
class PredictedCycle:
    """A limit cycle by the describing function, and the result of the check on the exact plant."""

    cycle: Cycle
    verdict: Verdict
    beyond_limits: bool  # its torque demand exceeds what the motor can deliver


@dataclass(frozen=True, eq=False, repr=False)
class LinearView:
    """The result of `linear_view`. Without a loop (`kind` is not "loop") margins do not apply and are None.

    Parameters
    ----------
    drive : Drive or Chain
        The drive or chain.
    controller : Controller
        The controller, set up.
    kind : str
        "loop", "open loop" (nothing measured changes the demand in contact) or "events" (the controller does
        not run at samples there).
    notes : tuple of str
        Sentences that belong to the numbers.
    point : OperatingPoint, optional
        The instant at which the controller is linearised, and its linear law.
    own_loop : Loop, optional
        The loop on this drive.
    outside : Outside, optional
        Everything but the shaft, for limit cycles; None of a chain.
    margins : Margins, optional
        Margins and crossings of the loop: rad, s, rad/s.
    modes : tuple of Mode
        Modes of the closed loop, by frequency.
    stable : bool, optional
        Whether the closed loop in contact is stable.
    variations : tuple of Variation
        The same controller on other drives.
    cycles : tuple of PredictedCycle
        Limit cycles through the gap, predicted and checked; none of a chain, which has several gaps.

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback", limit_cycles=False)
    >>> view
    <LinearView: current-limit-feedback on ...: gain margin ..., phase margin ..., delay margin ...>

    References
    ----------
    docs/linear-view.md.
    M. Nordin and P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002)
    1633-1649, doi:10.1016/S0005-1098(02)00047-X.
    """

    drive: Machine
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
    cycles: tuple[PredictedCycle, ...] = ()

    def __repr__(self) -> str:
        """One line with the conclusion."""
        return f"<LinearView: {self.name} on {self.drive.name}: {self.conclusion}>"

    @property
    def name(self) -> str:
        """The controller's name."""
        return label_of(self.controller)

    @property
    def period(self) -> float:
        """Sample period in s; NaN without a loop."""
        return math.nan if self.point is None else self.point.plant.period

    @property
    def loop(self) -> control.StateSpace:
        """L(z), minimal: the negative of the demand in response to a demand fed in; -1 is critical."""
        return self._loop().control_system("demand", "minus_answer")

    @property
    def controller_system(self) -> control.StateSpace:
        """The controller's law, minimal: from the measured quantities to the demand in N m."""
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
        Omega = sizes_of(self.drive).Omega
        return min(swinging, key=lambda mode: abs(math.log(mode.frequency / Omega)), default=None)

    @property
    def gain_margin(self) -> float | None:
        """Least factor above 1 on the demand that makes the loop unstable."""
        return None if self.margins is None else self.margins.gain_margin

    @property
    def phase_margin(self) -> float | None:
        """The least of all gain crossovers, rad."""
        return None if self.margins is None else self.margins.phase_margin

    @property
    def delay_margin(self) -> float | None:
        """Least further dead time that makes the loop unstable, s."""
        return None if self.margins is None else self.margins.delay_margin

    @property
    def modulus_margin(self) -> float | None:
        """Least distance of L from -1."""
        return None if self.margins is None else self.margins.modulus_margin

    @property
    def conclusion(self) -> str:
        """One sentence."""
        from softstart.views import linear as views

        sentence: str = views.conclusion(self)
        return sentence

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        found: dict[str, Any] = {
            "drive": self.drive.name,
            "controller": self.name,
            "parameters": self.controller.parameters,
            "kind": self.kind,
            "conclusion": self.conclusion,
            "notes": list(self.notes),
        }
        if self.margins is None or self.point is None or self.own_loop is None:
            return found
        point = self.point
        elastic = self.elastic_mode
        return found | {
            "stable": self.stable,
            "period": self.period,
            "operating_point": {
                "time": point.sample.time,
                "steady": point.steady,
                "demand": point.sample.demand,
                "states": list(point.states),
                "mismatch": point.mismatch,
            },
            "order_of_loop": self.own_loop.broken.A.shape[0],
            "order_of_controller": self.own_loop.minimal_law.A.shape[0],
            **_margin_figures(self.margins),
            "elastic_frequency": elastic.frequency if elastic else None,
            "elastic_damping_ratio": elastic.damping_ratio if elastic else None,
            "modes": [
                {
                    "frequency": mode.frequency,
                    "damping_ratio": mode.damping_ratio,
                    "real": mode.value.real,
                    "imag": mode.value.imag,
                }
                for mode in self.modes
            ],
            "variations": [
                {
                    "name": one.name,
                    "stable": one.stable,
                    "least_damping": one.least_damping,
                    **_margin_figures(one.margins),
                }
                for one in self.variations
            ],
            "limit_cycles": [
                {
                    **asdict(one.cycle),
                    "beyond_limits": one.beyond_limits,
                    "measured_frequency": one.verdict.frequency,
                    "measured_amplitude": one.verdict.amplitude,
                    "confirmed": one.verdict.confirmed,
                    "verdict": one.verdict.sentence,
                }
                for one in self.cycles
            ],
        }

    def _repr_html_(self) -> Any:
        """What a notebook shows."""
        from softstart.views import linear as views
        from softstart.views import sheet

        return sheet.as_html(views.linear_sheet(self))

    def plot(self) -> Any:
        """Bode diagram with the margins marked, and Nyquist diagram with the describing function's locus."""
        from softstart.views import linear as views

        self._loop()
        return views.linear_figure(self)

    def _loop(self) -> Loop:
        if self.own_loop is None:
            raise InputError(f'controller = "{self.name}": {self.notes[0]}')
        return self.own_loop

    def _point(self) -> OperatingPoint:
        self._loop()
        assert self.point is not None
        return self.point


def linear_view(
    drive: Machine | str,
    controller: str | Controller,
    parameters: Mapping[str, object] | None = None,
    *,
    fitted_to: Machine | None = None,
    inertias: Sequence[float] = INERTIAS,
    stiffnesses: Sequence[float] = STIFFNESSES,
    limit_cycles: bool = True,
) -> LinearView:
    """Linearise a controller as it runs, in contact, and analyse its loop: margins, modes, limit cycles.

    Of a chain it is the loop from motor torque to motor speed through all its masses, with all gaps closed;
    among the variations stands the same controller with all gaps open.

    Parameters
    ----------
    drive : Drive, Chain or str
        A drive or chain, or the name or file of one.
    controller : str or Controller
        A name, `path/to/file.py:ClassName`, or a Controller object, built in or not.
    parameters : mapping, optional
        Parameters of a controller given by name; numbers in SI, or text with units.
    fitted_to : Drive or Chain, optional
        The drive for which the controller is set up, if not `drive`.
    inertias, stiffnesses : sequence of float, optional
        Factors on J2 and c with which the margins of the same controller are computed too; of a chain on the
        inertia of its load mass and on all stiffnesses.
    limit_cycles : bool, optional
        Whether limit cycles through the gap of a single shaft are predicted and tried on the exact plant.

    Returns
    -------
    LinearView
        Angles in rad, delays in s, frequencies in rad/s, torques in N m.

    Raises
    ------
    InputError
        If the input is wrong (an unknown controller).
    SimulationError
        If the start cannot be simulated.

    References
    ----------
    M. Nordin and P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002)
    1633-1649, doi:10.1016/S0005-1098(02)00047-X.

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback", limit_cycles=False)
    >>> view.kind, view.stable, round(view.elastic_mode.damping_ratio, 1)
    ('loop', True, 0.7)
    >>> linear_view("crane-4amtkf", "ramp").kind
    'open loop'
    """
    if isinstance(drive, str):
        drive = load_machine(drive)
    made = make_controller(controller, parameters)
    _check(drive, fitted_to, {"inertias": inertias, "stiffnesses": stiffnesses})
    start = SampledStart.of(single(drive), made, fitted_to or drive)
    run = run_until_steady(start)
    name = label_of(start.controller)
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
            "the instant of its next sample; margins do not apply."
        )
        return LinearView(drive, start.controller, "events", (sentence,), point)
    own = Loop(drive, point, start.differencing)
    modes = own.modes()
    own_values = [float(found.value) for key in ("load_inertia", "stiffness") if (found := drive.knob(key))]
    varied = [(f"J2 x {k:g}", {"load_inertia": k * own_values[0]}) for k in inertias]
    varied += [(f"c x {k:g}", {"stiffness": k * own_values[1]}) for k in stiffnesses]
    variations = [_varied(name, Loop(start.drive.with_values(change), point, start.differencing))
                  for name, change in varied]  # fmt: skip
    outside: Outside | None = None
    cycled: tuple[PredictedCycle, ...] = ()
    if len(drive.shaft_names) > 1:
        variations.append(_varied("all gaps open", Loop(start.drive, point, start.differencing, open=True)))
    else:
        outside = Outside(
            drive.design_drive, point.law, point.derivative.inputs, point.plant, start.differencing
        )
        cycled = _cycles(start, run, point, outside) if limit_cycles else ()
    return LinearView(
        drive, start.controller, "loop", _notes(name, run, point, own), point, own, outside, own.margins(),
        modes, own.stable, tuple(variations), cycled,
    )  # fmt: skip


def _margin_figures(m: Margins) -> dict[str, Any]:
    """The margins: angles in rad, delays in s, frequencies in rad/s."""
    return {**asdict(m), "sensitivity_peak": m.sensitivity_peak}


def _feeds_back(point: OperatingPoint) -> bool:
    return bool(point.states) or bool(np.any(point.law.D))


def _chosen(points: Sequence[OperatingPoint]) -> OperatingPoint:
    """The steady one if its law is good and feeds back; else the best that feeds back; else the best."""
    good = [one for one in points if one.mismatch < GOOD]
    feeding = [one for one in good if _feeds_back(one)]
    steady = [one for one in feeding if one.steady]
    return (steady or feeding or good or [one for one in points if _feeds_back(one)] or list(points))[0]


def _timed_by(point: OperatingPoint) -> bool:
    return bool(np.any(point.derivative.rates[:, point.derivative.A.shape[0] :]))


def _check(drive: Any, fitted_to: Any, factors: Mapping[str, Sequence[float]]) -> None:
    wrong = []
    for name, one in (("drive", drive), ("fitted_to", fitted_to)):
        if one is None:
            continue
        if not is_machine(one):
            wrong.append(f"{name} = {one!r}: give a Drive; Drive.load reads one from a file or by name.")
        elif one.motor is None or one.target_speed is None:
            wrong.append(f"{name}: {one.name} has no motor or no target speed; add them to the chain.")
    for name, values in factors.items():
        wrong += [
            f"{name}: {value!r} is no factor; give numbers above 0."
            for value in values
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf
        ]
    if wrong:
        raise InputError(wrong)


def _no_samples(name: str, run: SampledRun) -> tuple[str, tuple[str, ...]]:
    if any(one.pressing for one in run.samples) and any(math.isfinite(one.ask_again) for one in run.samples):
        return "events", (
            f"{name} does not keep one sample period throughout a contact of its start: it has no sampled "
            "loop there, and margins do not apply.",
        )
    return "events", (
        f"{name} acts at events, not at samples: in contact its torque demand is fixed beforehand, and "
        "margins do not apply.",
    )


def _notes(name: str, run: SampledRun, point: OperatingPoint, own: Loop) -> tuple[str, ...]:
    notes = []
    if not point.steady:
        why = "the start does not become steady in contact"
        if run.steady:
            why = "where the start is steady, a linear law is less accurate (a limit or a switch)"
        notes.append(f"Linearised at t = {point.sample.time:.4g} s, during the start: {why}.")
    if point.mismatch > POOR:
        notes.append(
            f"{name} is poorly approximated by one linear law: after small displacements the exact plant "
            f"and the linear loop differ by up to {100.0 * point.mismatch:.2g} %; take the margins with "
            "caution."
        )
    notes += [
        f"State {index} of the controller is {kind.value} at this instant." for index, kind in point.rough
    ]
    if not own.stable:
        notes.append("The closed loop is unstable in contact: the margins are crossings, not reserves.")
    return tuple(notes)


def _varied(name: str, loop: Loop) -> Variation:
    least = min((mode.damping_ratio for mode in loop.modes()), default=math.nan)
    return Variation(name, loop.drive, loop.stable, loop.margins(), least)


def _cycles(
    start: SampledStart, run: SampledRun, point: OperatingPoint, outside: Outside
) -> tuple[PredictedCycle, ...]:
    drive = outside.drive
    holds = outside.holds_speed()
    rest = run.samples[run.last if not holds else -1]
    back = max(1, round(float(drive.elastic_period) / run.period))
    recent = run.samples[max(run.first, run.last - back) : run.last + 1]
    w1, w2 = rest.plant["w"]
    against = float(drive.Mc + drive.load_viscous_friction * w2)
    mean = against if holds else float(np.mean([start.shaft_torque(one) for one in recent]))
    takes = float(drive.motor_friction + drive.motor_viscous_friction * w1)
    demand = mean + takes if holds else float(np.mean([one.demand for one in recent]))
    room = min(float(drive.maximum_torque) - demand, demand - float(drive.minimum_torque))
    return tuple(
        PredictedCycle(cycle, check_cycle(start, point, rest, outside, cycle), cycle.demand_amplitude > room)
        for cycle in cycles(outside, mean)
    )


def _word(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name) or "controller"
