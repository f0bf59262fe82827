"""The linear view of a controller that runs: `linear_view`.

The loop in contact with its margins, for example at which delay it becomes unstable (`delay_margin`, computed
in `loop`); its modes; and the limit cycles that backlash causes (`limit_cycles`). The room:

    law            the start on the exact plant, sample by sample; the derivative of the controller's step
    plant          the machine in contact at the sample instants
    loop           law and plant joined: margins, delay margin, modes
    limit_cycles   the describing function of backlash, and the cycles that it predicts
    systems        linear sampled systems: response, modes, crossings
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.base import Controller, label_of
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.linear.law import SampledRun, SampledStart, operating_point, run_until_steady
from softstart.linear.limit_cycles import Cycle, limit_cycles
from softstart.linear.loop import Loop, Margins
from softstart.linear.plant import at_one_position, plant_scales
from softstart.linear.systems import Mode
from softstart.results import Result
from softstart.start.demand import ControllerLike, as_controller
from softstart.views.numbers import units_of

VARIATIONS = (("J2", "load_inertia", (0.4, 2.5)), ("c", "stiffness", (0.9, 1.1)))
POOR = 0.02  # mismatch above which a note says that the view is doubtful


def _fastest_growth(loop: Loop) -> str:
    """The pole that grows fastest in words."""
    mode = max(loop.modes, key=lambda mode: -mode.damping_ratio * mode.frequency)
    if mode.imag == 0.0 and mode.real > 0.0:
        return f"its speed runs away with a time constant of {1e3 / mode.frequency:.3g} ms"
    return f"an oscillation at {mode.frequency:.4g} rad/s grows"


def margin_texts(m: Margins) -> dict[str, str]:
    """The margins in words; the phase margin is not limited where the loop has no gain crossover."""
    texts = {
        "gain margin": (m.gain_margin, f"{m.gain_margin:.3g} ({20.0 * math.log10(m.gain_margin):.1f} dB)"),
        "phase margin": (m.phase_margin, f"{math.degrees(m.phase_margin):.1f} degrees"),
        "delay margin": (m.delay_margin, f"{1e3 * m.delay_margin:.3g} ms"),
    }
    return {name: "not limited" if math.isinf(value) else text for name, (value, text) in texts.items()}


@dataclass(frozen=True, eq=False, repr=False)
class LinearView(Result, view="linear.linear_sheet"):
    """The result of `linear_view`.

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
    run : SampledRun
        The samples of the start.
    loop : Loop, optional
        The loop on this drive, with `margins`, `modes`, `stable`, and for python-control `system`, L(z), and
        `controller_system`; None where the kind is not "loop", as margins do not apply.

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback")
    >>> view
    <LinearView: current-limit-feedback on ...: gain margin ..., phase margin ..., delay margin ...>

    References
    ----------
    M. Nordin and P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002)
    1633-1649, doi:10.1016/S0005-1098(02)00047-X.
    """

    drive: Machine
    controller: Controller
    kind: str
    notes: tuple[str, ...]
    run: SampledRun
    loop: Loop | None = None

    def __repr__(self) -> str:
        """One line with the conclusion."""
        return f"<LinearView: {self.name} on {self.drive.name}: {self.conclusion}>"

    @property
    def name(self) -> str:
        """The controller's name."""
        return label_of(self.controller)

    @cached_property
    def variations(self) -> tuple[Loop, ...]:
        """The same controller with another inertia of the load, another stiffness, and with all gaps open.

        Of a chain J2 is its load mass, and the factor on c is that of all shafts.
        """
        if self.loop is None:
            return ()
        machine = self.loop.start.machine
        varied = [
            replace(
                self.loop,
                machine=machine.with_values({key: factor * machine.parameter_value(key).value}),
                name=f"{symbol} x {factor:g}",
            )
            for symbol, key, factors in VARIATIONS
            for factor in factors
        ]
        return (*varied, self.loop.with_gaps_open)

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """Limit cycles through the gap, predicted; none of a chain, which has several gaps."""
        if self.loop is None or len(self.drive.shaft_names) > 1:
            return ()
        return limit_cycles(self.loop, self.run)

    @cached_property
    def warning(self) -> str:
        """One sentence where a loop is unstable or a limit cycle is predicted; "" elsewhere.

        The loop with all gaps open counts where the strategy holds the speed, and so acts in the gap too.
        """
        loop = self.loop
        if loop is None:
            return ""
        if not loop.stable:
            return f"Unstable with the gap closed: {_fastest_growth(loop)}."
        cycle = max(self.cycles, key=lambda cycle: (cycle.stable, cycle.amplitude), default=None)
        vibration = ""
        if cycle is not None:
            units = units_of(self.drive)
            size = f"{units.shown(cycle.amplitude, 'rad'):.3g} {units.label('rad')}{units.behind}"
            amplitude = f"amplitude of the twist {size}"
            vibration = f"{cycle.frequency:.4g} rad/s, {amplitude}" if cycle.stable else amplitude
        alone = loop.with_gaps_open
        if loop.holds_speed and not alone.stable:
            growth = _fastest_growth(alone)
            end = f", to a limit cycle of {vibration}" if cycle is not None and cycle.stable else ""
            return f"Unstable with the gap open, where the motor is alone: {growth}{end}."
        if cycle is None:
            return ""
        if cycle.stable:
            return f"A limit cycle through the gap is predicted: {vibration}."
        return f"Vibrations through the gap are predicted to grow from this size on: {vibration}."

    @property
    def elastic_mode(self) -> Mode | None:
        """The oscillatory mode whose frequency is nearest to the elastic frequency Omega, on a log scale."""
        of_loop = () if self.loop is None else self.loop.modes
        oscillatory = [mode for mode in of_loop if mode.damping_ratio < 1.0 and mode.imag > 0.0]
        Omega = plant_scales(self.drive).Omega
        return min(oscillatory, key=lambda mode: abs(math.log(mode.frequency / Omega)), default=None)

    @property
    def conclusion(self) -> str:
        """One sentence: the margins and the damping of the elastic mode, or why there are none."""
        if self.loop is None:
            return self.notes[0]
        if not self.loop.stable:
            return "the closed loop is unstable in contact"
        margins = ", ".join(f"{name} {text}" for name, text in margin_texts(self.loop.margins).items())
        mode = self.elastic_mode
        return margins if mode is None else f"{margins}; elastic mode damped by {mode.damping_ratio:.3g}"

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        plain: dict[str, Any] = {
            "drive": self.drive.name,
            "controller": self.name,
            "parameters": self.controller.parameters,
            "kind": self.kind,
            "conclusion": self.conclusion,
            "notes": list(self.notes),
            "warning": self.warning,
        }
        if self.loop is None:
            return plain
        point, elastic = self.loop.point, self.elastic_mode
        return plain | {
            "stable": self.loop.stable,
            "period": self.loop.period,
            "operating_point": {
                "time": point.sample.time,
                "steady": point.steady,
                "demand": point.sample.demand,
                "states": point.states,
                "mismatch": point.mismatch,
            },
            **asdict(self.loop.margins),
            "bandwidth": self.loop.bandwidth,
            "elastic_frequency": elastic and elastic.frequency,
            "elastic_damping_ratio": elastic and elastic.damping_ratio,
            "modes": [asdict(mode) for mode in self.loop.modes],
            "variations": [
                {"name": one.name, "stable": one.stable, "least_damping": one.least_damping}
                | {"bandwidth": one.bandwidth}
                | asdict(one.margins)
                for one in self.variations
            ],
            "limit_cycles": [asdict(one) for one in self.cycles],
        }


def linear_view(
    drive: MachineLike,
    controller: ControllerLike,
    parameters: Mapping[str, object] | None = None,
    *,
    fitted_to: MachineLike | None = None,
) -> LinearView:
    """Linearise a controller as it runs, in contact, and analyse its loop: margins, modes, limit cycles.

    Of a chain it is the loop from motor torque to motor speed through all its masses, with all gaps closed;
    among the variations stands the same controller with all gaps open.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        A drive or chain, or the name or file of one.
    controller : str, Controller or torque over time
        As in `simulate`.
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

    Examples
    --------
    >>> view = linear_view("crane-4amtkf", "current-limit-feedback")
    >>> view.kind, view.loop.stable, round(view.elastic_mode.damping_ratio, 1)
    ('loop', True, 0.7)
    >>> linear_view("crane-4amtkf", "ramp").kind
    'open loop'
    """
    drive, strategy = as_machine(drive), as_controller(controller, parameters)
    fitted_to = None if fitted_to is None else as_machine(fitted_to, "fitted_to")
    for machine in (drive, fitted_to or drive):
        if machine.motor is None or machine.target_speed is None:
            raise InputError(f"{machine.name} has no motor or no target speed; add them to the chain.")
    start = SampledStart.of(at_one_position(drive), strategy, fitted_to or drive)
    run = run_until_steady(start)
    name = label_of(start.controller)
    point = operating_point(start, run)
    if point is not None and point.feeds_back and point.is_sampled:
        loop = Loop(start, point, at_one_position(drive))
        return LinearView(drive, start.controller, "loop", _notes(name, run, loop), run, loop)
    kind, why = "open loop", "is open-loop in contact (no measurement affects its demand)"
    if point is None or point.feeds_back:
        kind, why = "events", "has no sampled loop in contact (no new demand at equal periods)"
    notes = (f"{name} {why}: stability margins do not apply.",)
    return LinearView(drive, start.controller, kind, notes, run)


def loop_in_words(drive: MachineLike, controller: Controller) -> str:
    """Of a strategy that holds the speed: what is unstable, or the margins of both loops; "" of others.

    >>> from softstart.controller import make_controller
    >>> loop_in_words("crane-4amtkf", make_controller("ramp"))
    ''
    """
    machine = as_machine(drive)
    ready, own = controller.set_up(machine.design_drive)
    if ready.regulation(own) is None:
        return ""
    try:
        view = linear_view(machine, controller)
    except SimulationError:
        return ""
    if view.loop is None or view.warning:
        return view.warning
    closed, alone = (margin_texts(loop.margins) for loop in (view.loop, view.loop.with_gaps_open))
    names = ("phase margin", "delay margin")
    each = (", ".join(f"{name} {texts[name]}" for name in names) for texts in (closed, alone))
    return "Speed loop with the gap closed: {}; open: {}.".format(*each)


def _notes(name: str, run: SampledRun, loop: Loop) -> tuple[str, ...]:
    notes, point = [], loop.point
    if not point.steady:
        why = "the start does not become steady in contact"
        if run.steady:
            why = "a linear law is less accurate where the start is steady (a limit or a switch)"
        notes.append(f"Linearised at t = {point.sample.time:.4g} s, during the start: {why}.")
    if point.mismatch > POOR:
        notes.append(
            f"{name} is poorly approximated by one linear law (linearisation error "
            f"{100.0 * point.mismatch:.2g} %); use the margins with caution."
        )
    if not loop.stable:
        notes.append("The margins of an unstable loop are those of crossings, not reserves.")
    return tuple(notes)
