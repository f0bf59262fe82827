"""Values of a machine that are possible and hardly ever true: mostly a wrong unit, or an inverted ratio."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from softstart.drive.checks import GRAVITY, elastic_frequency, mean_torque_of
from softstart.drive.machine import Machine, TwoMasses

# usual speeds of the load, m/min; lifts, which have a counterweight, are faster
USUAL_SPEEDS = {"hoist": (0.5, 150.0), "travel": (1.0, 300.0), "belt": (1.0, 480.0)}
LIFTS = 600.0
ADHESION = (0.12, 0.2)  # force over weight that steel wheels transmit to rails, damp and dry


def plausibility_warnings(machine: Machine) -> list[str]:
    """Sentences on what can hardly be: each with the value, what is usual, and the likeliest mistake.

    Elastic frequency, [G](8), 0.5 to 500 Hz; its damping ratio at most 1; gap at most half a turn of the
    motor; J2/J1 0.01 to 100; speed at most 10,000 rpm; start under the starting torque,
    (J1 + J2) w/(Ms - Mc), at most a minute; K_dyn of direct at the first contact, [G](16) and (18), at most
    8; Ms 0.5 to 6 times the rated torque; permissible torques at most 10 Ms, which no start comes near; no
    ratio below 1 before the larger inertia. A chain counts by the lever rule.

    >>> from softstart.drive import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> plausibility_warnings(crane)
    []
    >>> plausibility_warnings(crane.replace(target_speed=1460))[0][:25]
    'speed 13,942 rpm, where m'
    """
    return [
        *_doubts(machine.lever_rule_model),
        *_not_the_rated_torque(machine.motor),
        *permits_anything(machine),
        *_nothing_holds(machine),
    ]  # fmt: skip


def motion_warnings(
    machine: str, speed: float, acceleration: float, sine: float, balanced: bool
) -> Iterator[str]:
    """Sentences on how the load of a data sheet moves: `speed` in m/s, mean `acceleration` in m/s2.

    `sine` is that of the slope; `balanced` says that there is a counterweight. Driven wheels transmit
    m (a + g sin) of the weight m g cos that they carry, at most: all of it if every wheel is driven.

    >>> [one[:52] for one in motion_warnings("travel", 0.61, 1.5, 0.0, False)]
    ['mean acceleration 1.5 m/s^2 needs 0.153 of the weigh']
    >>> [one[:27] for one in motion_warnings("belt", 25.0, 1.5, 0.0, False)]
    ['speed of the load 1,500 m/m']
    """
    low, high = USUAL_SPEEDS.get(machine, (0.0, math.inf))
    high, rate = LIFTS if balanced else high, 60.0 * speed
    if not low <= rate <= high:
        yield (
            f"speed of the load {rate:,.4g} m/min, where a {machine} has {low:g} to {high:g} m/min: a "
            "diameter written as radius, mm as m, the ratio, or the falls of a rope?"
        )
    needed = (acceleration / GRAVITY + sine) / math.sqrt(1.0 - sine**2)
    if machine == "travel" and needed > ADHESION[0]:
        yield (
            f"mean acceleration {acceleration:.4g} m/s^2 needs {needed:.3g} of the weight as friction at the "
            f"wheels if all of them are driven, {2.0 * needed:.3g} if half of them are, where steel wheels "
            f"transmit {ADHESION[0]:g} to {ADHESION[1]:g}: they slip, or the diameter was written as radius, "
            "t as kg, or the torque is higher than the inverter will give?"
        )


def _doubts(of: TwoMasses) -> Iterator[str]:
    """Comparisons with NaN are false, so that nothing is doubted that is not known."""
    J1, J2, c, Ms, Mc = of.J1, of.J2, of.c, of.Ms, of.Mc
    rpm = of.speed * 30.0 / math.pi
    Omega = elastic_frequency(J1, J2, c)
    frequency = float(Omega) / (2.0 * math.pi)
    if frequency < 0.5 or 500.0 < frequency < math.inf:
        yield (
            f"elastic frequency {frequency:.4g} Hz, where drives have 0.5 to 500 Hz: a stiffness per degree "
            "or in kN m, an inertia in kg cm2 or g m2 written as kg m2, or a value that is not at the motor "
            "shaft (divided by the ratio squared)?"
        )
    ratio = of.d * float(Omega) / (2.0 * c) if c > 0.0 else math.nan
    if ratio > 1.0:
        yield (
            f"damping ratio {ratio:.4g} of the elastic mode, d/2 sqrt((J1 + J2)/(c J1 J2)), where drives "
            "have 0.001 to 0.2 and from 1 on nothing oscillates: a damping in another unit, or not at the "
            "motor shaft (divided by the ratio squared)?"
        )
    if of.gap > math.pi:
        yield (
            f"gap {of.gap:.4g} rad at the motor shaft, more than half a turn (3.14 rad), where drives have "
            "0.001 to 2 rad: degrees, arcmin or mm written as rad?"
        )
    if not math.isnan(J2 / J1) and not 0.01 <= J2 / J1 <= 100.0:
        yield (
            f"inertia of the load {J2 / J1:.4g} times that of the motor, where drives have 0.01 to 100 "
            "times: not at the motor shaft (divided by the ratio squared), the ratio inverted, a diameter "
            "written as radius, or kg cm2 or g m2 written as kg m2?"
        )
    if of.ratio < 1.0 and J2 > J1:
        yield (
            f"gear ratio {of.ratio:.4g} before a load of {J2 / J1:.4g} times the inertia of the motor, where "
            f"gears slow such a load down: inverted? It counts turns of the motor for one of the output, "
            f"perhaps {1.0 / of.ratio:.4g}."
        )
    if rpm > 10_000.0:
        yield (
            f"speed {rpm:,.0f} rpm, where motors run at up to 10,000 rpm: if rpm was written without a "
            f'unit, which is read as rad/s, write "{of.speed:.4g} rpm".'
        )
    time = (J1 + J2) * of.speed / (Ms - Mc) if Ms > Mc else math.nan
    if time > 60.0:
        yield (
            f"start under full starting torque {time:,.4g} s, (J1 + J2) w/(Ms - Mc), where starts take up to "
            "a minute: kW written as W, kg cm2 as kg m2, a load that is not at the motor shaft, or the ratio "
            "inverted?"
        )
    k = _k_dyn_of_direct(of, float(Omega))
    if 8.0 < k < math.inf:
        yield (
            f"K_dyn of direct about {k:.4g} by [G](16) and (18), where drives have up to 8: a gap "
            "in degrees, arcmin or mm written as rad, the stiffness of one part alone, or a wrong unit?"
        )


def _k_dyn_of_direct(of: TwoMasses, Omega: float) -> float:
    """Peak of the first contact over M12avg, (16) and (18), less what a quarter period of damping takes off.

    An active load turns back in the gap; the flanks meet at sqrt(2 a travel).
    """
    J = of.J1 * of.J2 / (of.J1 + of.J2)
    mean = mean_torque_of(of.Ms, of.J1, of.J2, of.Mc)
    if not mean > 0.0:
        return math.nan
    a = of.Ms / of.J1 + math.copysign(of.falling, of.Mc - of.friction) / of.J2
    decay = math.exp(-0.25 * math.pi * of.d / (J * Omega))
    return 1.0 + decay * math.sqrt(1.0 + of.c * J * 2.0 * a * of.travel / mean**2)


def _not_the_rated_torque(motor: Any) -> Iterator[str]:
    """Of a drive, or of the motor of a chain; None for a chain without one."""
    if motor is None:
        return
    rated = motor.rated_torque
    if rated is None and motor.rated_power is not None and motor.rated_speed is not None:
        rated = motor.rated_power / motor.rated_speed
    if rated is not None and not 0.5 <= (times := float(motor.starting_torque / rated)) <= 6.0:
        yield (
            f"starting torque {times:.4g} times the rated torque, where motors have 0.5 to 6 times: a ratio "
            "in per cent, rpm written as rad/s, or kW written as W?"
        )


def permits_anything(machine: Machine) -> Iterator[str]:
    """A permissible torque that decides nothing: mostly that of the output of a gear, taken at the motor."""
    if machine.motor is None:
        return
    most, several = machine.permissible_torques.tolist(), len(machine.shaft_names) > 1
    for name, torque in zip(machine.shaft_names, most, strict=True):
        if (times := torque / float(machine.motor.starting_torque)) > 10.0:
            of, side = (f"of {name}", "shaft.side") if several else ("of the shaft", "limits.output_torque")
            yield (
                f"permissible torque {of} {torque:.4g} N m at the motor shaft, {times:.4g} times the "
                "starting torque, where shafts have up to 10 times: that at the other side of a gear "
                f"({side}), or a wrong unit?"
            )


def _nothing_holds(machine: Machine) -> Iterator[str]:
    """The start begins in a state that cannot last, and nobody said that it does."""
    two = machine.lever_rule_model
    falls = two.falling > 0.0 and machine.brake == "none"
    at_rest = machine.initial_load_speed == machine.initial_motor_speed == 0.0
    if falls and at_rest and not machine.position_given:
        yield (
            "start.position is not given: the start begins in mid-gap, where nothing holds this active load; "
            'write "hanging" (and start.brake "motor" if a brake holds the motor), "mid-gap" if it is so; '
            'for a load that stands on the ground write load.kind "reactive".'
        )
