"""The machine of a result in a few lines, and for which machine the controllers are set up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from softstart.chain.model import Chain
from softstart.drive import INFORMATIVE_TABLES, Machine
from softstart.quantities import Units
from softstart.views.numbers import RPM, plural, printable, seen, short, units_of

MOST = 6  # differences that are told
POSITIONS = {
    "driving-flank": "on the driving flank",
    "mid-gap": "in the middle of the gap",
    "opposite-flank": "on the opposite flank",
    "hanging": "with the load hanging in the wound-up shaft",
    "unknown": "at an unknown position in the gap: the worst of both flanks and the middle counts",
}
LIMITS_OF_MOTOR = (
    ("torque lag", "torque_lag", "s"),
    ("torque rate", "torque_rate", "N*m/s"),
    ("computing delay", "computing_delay", "s"),
    ("noise of the measured torque", "torque_noise", "N*m"),
)


def drive_lines(machine: Any) -> list[str]:
    """The machine in a few lines: its name, the parameters that matter, and under which laws it starts."""
    two, masses, motor = machine.lever_rule_model, machine.mass_names, machine.motor
    units = units_of(machine)
    J1, J2, c, gap, Mc = _values(two, units)
    kind = load_kind(two, lambda torque: seen(torque, "N*m", units))
    named = f"  motor on {masses[machine.motor_index]}, load {masses[machine.load_index]}"
    if len(masses) == 2:
        Ms = math.nan if motor is None else float(motor.starting_torque)
        torque = "" if math.isnan(Ms) else f", starting torque Ms = {seen(Ms, 'N*m', units)}"
        parts = [
            f"  motor  J1 = {J1}{torque}",
            f"  shaft  c = {c}, gap = {gap}, contact law {machine.contact_laws[0]}",
            f"  load   J2 = {J2}, Mc = {Mc}, {kind}",
            *([named] if masses != ("motor", "load") else []),
            *_there(machine, units),
        ]
    else:
        count, inertia = int((machine.gaps > 0.0).sum()), float(machine.at_motor_shaft().moving_J.sum())
        parts = [
            f"  {len(masses)} masses, {plural(count, 'gap')}; at the motor shaft J = "
            f"{short(inertia)} kg m2, gaps {seen(float(machine.gaps.sum()), 'rad', units)}, load torque {Mc}",
            named,
        ]
    damping = f"d = {seen(float(two.d), 'N*m*s/rad', units)}" if len(masses) == 2 and two.d else ""
    also = ", ".join(filter(None, (damping, *_also(machine))))
    speed = units._replace(speed="rad/s").shown(two.speed, "rad/s")
    start = f"  start  to {short(speed)} rad/s ({speed * RPM:.4g} rpm)"
    lines = [
        printable(machine.name),
        *parts,
        "" if math.isnan(two.speed) else start,
        f"  also   {also}" if also else "",
        f"  assumed: {printable(machine.assumed)}" if machine.assumed else "",
    ]
    return list(filter(None, lines))


VALUES = (("J1", "kg*m^2"), ("J2", "kg*m^2"), ("c", "N*m/rad"), ("gap", "rad"), ("Mc", "N*m"))


def _values(two: Any, units: Units) -> list[str]:
    """The values of two masses in these units."""
    return [seen(float(getattr(two, name)), si, units) for name, si in VALUES]


def load_kind(two: Any, said: Callable[[float], str]) -> str:
    """The parts of the load torque in words: "active", "reactive", or both with their size, as it is said."""
    if two.active and two.friction > 0.0:
        return f"{said(float(two.Mc - two.friction))} active and {said(float(two.friction))} friction"
    return "active" if two.active else "reactive"


def _there(machine: Machine, units: Units) -> Iterator[str]:
    """The same at the output of a gear; or, where everything is, through which gear."""
    if (gear := machine.gear) is not None:
        through = f"i = {short(float(gear.ratio))}, eta = {short(float(gear.efficiency))}"
        _, J2, c, gap, Mc = _values(machine.lever_rule_model, units._replace(angle="arcmin", gear=gear))
        if units.gear:
            yield f"  output all values are at the output of the gear, {through}"
        else:
            yield f"  output c = {c}, gap = {gap}, J2 = {J2}, Mc = {Mc}; {through}"


def _also(machine: Any) -> Iterator[str]:
    """What else decides the start, where it is not as by default."""
    units = units_of(machine)
    motor, where = machine.motor, next(iter(machine.positions)) if len(machine.positions) == 1 else "unknown"
    friction, b1, b2 = map(float, machine.frictions)
    w1, w2 = float(machine.initial_motor_speed), float(machine.initial_load_speed)
    if where not in ("mid-gap", ""):
        yield f"starts {POSITIONS[where]}{', of all gaps alike' if len(machine.gaps) > 1 else ''}"
    elif where == "" and machine.theta0:
        yield f"starts at twist {seen(float(machine.theta0), 'rad', units)}"
    if machine.brake == "motor" and machine.release_time > 0.0:
        proving = math.isinf(machine.release_time)
        until = "its torque has reached the shaft torque" if proving else f"{short(machine.release_time)} s"
        yield f"the brake holds the motor until {until}"
    if 0.0 < machine.brake_torque < math.inf:
        yield f"the brake slips at {seen(machine.brake_torque, 'N*m', units)}"
    if friction:
        yield f"friction of the motor {seen(friction, 'N*m', units)}"
    if b1 or b2:
        first = short(float(units.shown(b1, "N*m*s/rad")))
        yield f"viscous friction b1 = {first}, b2 = {seen(b2, 'N*m*s/rad', units)}"
    for words, name, si in LIMITS_OF_MOTOR if motor is not None else ():
        value = float(getattr(motor, name))
        if value and math.isfinite(value):
            yield f"{words} {seen(value, si, units)}"
    yield from curves(machine)
    if w1 or w2:
        first = short(float(units.shown(w1, "rad/s")))
        yield f"initial speeds w1 = {first}, w2 = {seen(w2, 'rad/s', units)}"


def curves(machine: Machine) -> Iterator[str]:
    """The load curves of a chain, in words."""
    for mass in machine.masses if isinstance(machine, Chain) else ():
        if mass.curve is not None:
            points, _, by_angle = mass.curve
            name, over = printable(mass.name), "angle" if by_angle else "speed"
            yield f"load curve of {name} over its {over}, {len(points)} points"


def controllers_set_up(machine: Machine | None, fitted_to: Machine) -> str:
    """For which machine the controllers are set up, and by what that differs from one that is given.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> controllers_set_up(crane.replace(gap=2.0), crane)
    'strategies are set up for "Crane travel drive 4AMTKF(H)112L6": shaft.gap 0.5 there, 2 here'
    """
    here, there = (
        {path: one for path, one in given.items() if one[0].table not in INFORMATIVE_TABLES}
        for given in ({} if machine is None else machine.parameters_by_path(), fitted_to.parameters_by_path())
    )
    found = [
        f"{path} {_set(there[path][1])} there, {_set(value)} here"
        for path, (parameter, value) in here.items()
        if here.keys() == there.keys()
        and there[path][1] != value
        and parameter.name not in ("name", "source", "assumed", "units")
    ]
    more = f"; and {len(found) - MOST} more" if len(found) > MOST else ""
    differs = ": " + "; ".join(found[:MOST]) + more if found else ""
    return f'strategies are set up for "{printable(fitted_to.name)}"{differs}'


def _set(value: object) -> str:
    return short(value) if isinstance(value, float) else "not set" if value in (None, "") else str(value)
