"""The linear view of a controller that runs: `linear_view`.

The loop in contact with its margins, for example at which delay it becomes unstable (`delay_margin`, computed
in `loop`); its modes; and the limit cycles that backlash causes (`limit_cycles`). The room:

    law            the start on the exact plant, sample by sample; the derivative of the controller's step
    plant          the machine in contact at the sample instants
    loop           law and plant joined: margins, delay margin, modes
    limit_cycles   the describing function of backlash; cycles predicted and tried on the exact plant
    systems        linear sampled systems: response, modes, crossings
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from softstart.chain.machines import Machine
from softstart.chain.model import load_machine
from softstart.controller.base import Controller, label_of
from softstart.controller.finding import make_controller
from softstart.drive.records import is_machine
from softstart.errors import InputError
from softstart.kernel import motor as exchange
from softstart.linear.law import (
    OperatingPoint,
    SampledRun,
    SampledStart,
    operating_point,
    run_until_steady,
)
from softstart.linear.limit_cycles import Cycle, limit_cycles
from softstart.linear.loop import Loop, Margins
from softstart.linear.plant import single, sizes_of
from softstart.linear.systems import Mode

if TYPE_CHECKING:
    import control

VARIATIONS = (("J2", "load_inertia", (0.4, 2.5)), ("c", "stiffness", (0.9, 1.1)))
POOR = 0.02  # mismatch above which a note says that the view is doubtful
NAMES = {
    exchange.M_MOTOR_ANGLE: "motor_angle",
    exchange.M_MOTOR_SPEED: "motor_speed",
    exchange.M_MOTOR_TORQUE: "motor_torque",
    exchange.M_SHAFT_TORQUE: "shaft_torque",
    exchange.M_LOAD_SPEED: "load_speed",
}


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
    run : SampledRun, optional
        The samples of the start.

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback")
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
    run: SampledRun | None = None

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
        return math.nan if self.point is None else self.point.period

    @property
    def margins(self) -> Margins | None:
        """Margins and crossings of the loop: rad, s, rad/s."""
        return None if self.own_loop is None else self.own_loop.margins

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Modes of the closed loop, by frequency."""
        return () if self.own_loop is None else self.own_loop.modes

    @property
    def stable(self) -> bool | None:
        """Whether the closed loop in contact is stable."""
        return None if self.own_loop is None else self.own_loop.stable

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
        """Least further dead time that makes the loop unstable, s; 0 for an unstable one."""
        return None if self.margins is None else self.margins.delay_margin

    @property
    def modulus_margin(self) -> float | None:
        """Least distance of L from -1."""
        return None if self.margins is None else self.margins.modulus_margin

    @cached_property
    def variations(self) -> tuple[Loop, ...]:
        """The same controller with another inertia of the load, another stiffness, and with all gaps open.

        Of a chain J2 is its load mass, and the factor on c is that of all shafts.
        """
        if self.own_loop is None:
            return ()
        own, found = self.own_loop, []
        machine = own.start.machine
        for symbol, key, factors in VARIATIONS:
            for factor in factors:
                varied = machine.with_values({key: factor * machine.knob(key).value})
                found.append(replace(own, machine=varied, name=f"{symbol} x {factor:g}"))
        return (*found, replace(own, name="all gaps open", open=True))

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """Limit cycles through the gap, predicted and checked; none of a chain, which has several gaps."""
        if self.own_loop is None or self.run is None or len(self.drive.shaft_names) > 1:
            return ()
        return limit_cycles(self.own_loop, self.run)

    @property
    def elastic_mode(self) -> Mode | None:
        """The oscillatory mode whose frequency is nearest to the elastic frequency Omega, on a log scale."""
        swinging = [mode for mode in self.modes if mode.damping_ratio < 1.0 and mode.value.imag > 0.0]
        Omega = sizes_of(self.drive).Omega
        return min(swinging, key=lambda mode: abs(math.log(mode.frequency / Omega)), default=None)

    @property
    def loop(self) -> control.StateSpace:
        """L(z): the negative of the demand in response to a demand fed in; -1 is critical."""
        import control

        loop = self._loop()
        return control.StateSpace(*loop.broken, loop.period, inputs=["demand"], outputs=["minus_answer"])

    @property
    def controller_system(self) -> control.StateSpace:
        """The controller's law: from the measured quantities to the demand in N m."""
        import control

        loop = self._loop()
        return control.StateSpace(
            *loop.point.law, loop.period, inputs=[NAMES[i] for i in loop.start.inputs],
            outputs=["demand"], name=re.sub(r"\W", "_", self.name) or "controller",
        )  # fmt: skip

    @property
    def conclusion(self) -> str:
        """One sentence."""
        from softstart.views import linear as views

        return views.conclusion(self)

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
        if self.own_loop is None:
            return found
        own, point, elastic = self.own_loop, self.own_loop.point, self.elastic_mode
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
            **_margin_figures(own.margins),
            "elastic_frequency": elastic and elastic.frequency,
            "elastic_damping_ratio": elastic and elastic.damping_ratio,
            "modes": [asdict(mode) for mode in self.modes],
            "variations": [
                {"name": one.name, "stable": one.stable, "least_damping": one.least_damping}
                | _margin_figures(one.margins)
                for one in self.variations
            ],
            "limit_cycles": [asdict(one) for one in self.cycles],
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


def linear_view(
    drive: Machine | str,
    controller: str | Controller,
    parameters: Mapping[str, object] | None = None,
    *,
    fitted_to: Machine | None = None,
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
    docs/linear-view.md.

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback")
    >>> view.kind, view.stable, round(view.elastic_mode.damping_ratio, 1)
    ('loop', True, 0.7)
    >>> linear_view("crane-4amtkf", "ramp").kind
    'open loop'
    """
    if isinstance(drive, str):
        drive = load_machine(drive)
    made = make_controller(controller, parameters)
    _check(drive, fitted_to)
    start = SampledStart.of(single(drive), made, fitted_to or drive)
    run = run_until_steady(start)
    name = label_of(start.controller)
    point = operating_point(start, run)
    if point is None or (point.feeds_back and not point.is_sampled):
        sentence = (
            f"{name} has no sampled loop: in contact it does not make a new demand, held until the next, at "
            "each of equal periods; margins do not apply."
        )
        return LinearView(drive, start.controller, "events", (sentence,), point)
    if not point.feeds_back:
        sentence = (
            f"{name} acts open loop: in contact nothing it measures changes its torque demand; "
            "margins do not apply."
        )
        return LinearView(drive, start.controller, "open loop", (sentence,), point)
    own = Loop(start, point, drive)
    return LinearView(drive, start.controller, "loop", _notes(name, run, own), point, own, run)


def _margin_figures(m: Margins) -> dict[str, Any]:
    """The margins: angles in rad, delays in s, frequencies in rad/s."""
    return {**asdict(m), "sensitivity_peak": m.sensitivity_peak}


def _check(*machines: Any) -> None:
    for one in machines:
        if one is not None and not is_machine(one):
            raise InputError(f"drive = {one!r}: give a Drive; Drive.load reads one from a file or by name.")
        if one is not None and (one.motor is None or one.target_speed is None):
            raise InputError(f"{one.name} has no motor or no target speed; add them to the chain.")


def _notes(name: str, run: SampledRun, own: Loop) -> tuple[str, ...]:
    notes, point = [], own.point
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
    if point.rough:
        states = ", ".join(map(str, point.rough))
        notes.append(f"The controller is not smooth at this instant in its states {states}.")
    if not own.stable:
        notes.append("The closed loop is unstable in contact: the margins are crossings, not reserves.")
    return tuple(notes)
