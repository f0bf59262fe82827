"""Numbers and quantities as report and page print them: a true minus sign, a dash for a missing value."""

from __future__ import annotations

import math

from softstart.chain.model import Chain
from softstart.drive import Drive
from softstart.quantities import Units
from softstart.views import numbers

MINUS, NOTHING = "\N{MINUS SIGN}", "\N{EN DASH}"
UNITS = {
    "kg*m^2": "kg m\N{SUPERSCRIPT TWO}",
    "N*m": "N m",
    "N*m/rad": "N m/rad",
    "N*m*s/rad": "N m s/rad",
    "N*m/s": "N m/s",
    "1": "",
}
AT_OUTPUT = {  # exponent of the gear ratio that brings a value from the motor shaft to the output shaft
    **dict.fromkeys(("N*m", "N*m/s"), 1),
    **dict.fromkeys(("kg*m^2", "N*m/rad", "N*m*s/rad"), 2),
    **dict.fromkeys(("rad", "rad/s"), -1),
}
RPM = 30.0 / math.pi  # of one rad/s


def printed(text: str) -> str:
    """A number of `views.numbers` as it is printed: a true minus sign, a dash for a missing value."""
    return NOTHING if text == numbers.NOTHING else text.replace("-", MINUS).replace("inf", "infinite")


def fixed(value: float | None, decimals: int) -> str:
    """A number with so many decimals; a dash for a missing value.

    >>> fixed(0.98123, 3), fixed(float("nan"), 3), fixed(-1.5, 1)
    ('0.981', '\N{EN DASH}', '\N{MINUS SIGN}1.5')
    """
    return printed(numbers.number(value, decimals))


def digits(value: float | None, count: int = 4) -> str:
    """A number with so many significant digits, without an exponent where that can be read.

    >>> digits(0.0165988), digits(164.81), digits(2.6e-5), digits(368.465, 6)
    ('0.01660', '164.8', '2.600e\N{MINUS SIGN}05', '368.465')
    """
    return printed(numbers.column_of([value], count)[0])


def short(value: float) -> str:
    """A number as short as it is, at most six digits.

    >>> short(0.175), short(62.0), short(float("inf"))
    ('0.175', '62', 'infinite')
    """
    return NOTHING if math.isnan(value) else printed(numbers.short(value))


def unit(written: str) -> str:
    """A unit as it is printed.

    >>> unit("N*m"), unit("rad/s")
    ('N m', 'rad/s')
    """
    return UNITS.get(written, written.replace("*", " "))


def units_of(machine: Drive | Chain) -> Units:
    """The units in which angles and speeds of a machine are seen: those that it names, else as it has them.

    >>> units_of(Drive.load("hoist-15kw")), units_of(Drive.load("servo-axis-small")).angle
    (Units(angle='deg', speed='rpm', diameter=0.0), ...)
    """
    speeds = [] if machine.target_speed is None else [float(machine.target_speed)]
    return Units.read(machine.units, machine.own_gaps, speeds)


def at_output(machine: Drive | Chain, value: float, unit: str = "N*m") -> str:
    """A value of the motor shaft at the output shaft of the gear, without losses; "" where it has none there.

    Torque times i, inertia, stiffness and damping times i^2, angle and speed divided by i; the `unit` is that
    of the parameter, the value may be in another one of its kind.

    >>> crane = Drive.load("crane-4amtkf")
    >>> geared = crane.replace(gear_ratio=38.0)
    >>> at_output(geared, 169.7), at_output(geared, 0.20083, "kg*m^2"), at_output(crane, 169.7)
    ('6449', '290.0', '')
    """
    ratio, power = machine.gear_ratio, AT_OUTPUT.get(unit)
    return "" if ratio is None or power is None else digits(float(ratio) ** power * value)


def percent(share: float, decimals: int = 1) -> str:
    """A share in per cent.

    >>> percent(0.0772)
    '7.7\N{NO-BREAK SPACE}%'
    """
    return f"{fixed(100.0 * share, decimals)}\N{NO-BREAK SPACE}%"


def decimals_of(step: float) -> int:
    """Decimals that show every multiple of a step.

    >>> decimals_of(0.5), decimals_of(0.01), decimals_of(1.0), decimals_of(0.125)
    (1, 2, 0, 3)
    """
    for count in range(9):
        if abs(step * 10**count - round(step * 10**count)) < 1e-9 * max(1.0, step * 10**count):
            return count
    return 9
