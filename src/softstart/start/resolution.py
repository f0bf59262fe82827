"""How finely an inverter can be set, and rounding to that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Self

from softstart.drive import Drive
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.quantities import to_si
from softstart.views.numbers import RPM, decimals_of

EXAMPLE = "torque=0.5%,time=10ms,speed=1rpm"
RATED = "rated torque"
_KEYS = {
    "torque": ("N*m", '"0.5%" of the rated torque, or "0.2 N*m"'),
    "time": ("s", '"10 ms"'),
    "speed": ("rad/s", '"1 rpm"'),
    "frequency": ("Hz", '"0.1 Hz"'),
    "share": ("1", '"1%" or 0.01'),
}


@dataclass(frozen=True)
class Resolution:
    """The steps in which the settings of an inverter can be changed.

    torque : in N m, or as a share of the rated torque where `torque_share` is given (then that counts);
    time in s, speed in rad/s, frequency in Hz, share: of numbers without a unit.

    The defaults are those of usual inverters: torque in 0.1 % of the rated torque, times in ms, speeds in
    rpm, frequencies in 0.1 Hz, S-curve shares and gains in 0.01.

    >>> Resolution.read("torque=0.5%, time=10 ms").time
    0.01
    """

    torque: float | None = None
    torque_share: float = 0.001
    time: float = 1e-3
    speed: float = 1.0 / RPM
    frequency: float = 0.1
    share: float = 0.01

    def __post_init__(self) -> None:
        wrong = Mistakes()
        for one in fields(self):
            value = getattr(self, one.name)
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (is_number and 0.0 < value < math.inf) and not (one.name == "torque" and value is None):
                wrong.sentences.append(f"{one.name} = {value!r}: a step is a number above 0.")
        wrong.raise_if_any()

    @classmethod
    def read(cls, given: str | Mapping[str, object], option: str = "resolution") -> Self:
        """From `key=value,...` or a mapping; all mistakes at once, sentences begin with `option`.

        >>> Resolution.read("tme=10ms")
        Traceback (most recent call last):
        softstart.errors.InputError: resolution "tme=10ms": there is no such key; did you mean time?
        """
        if isinstance(given, str):
            parts = [tuple(one.strip() for one in part.partition("=")) for part in given.split(",")]
            if wrong := ["".join(part) for part in parts if not all(part)]:
                raise InputError(
                    [f'{option} "{part}": write keys and values, as {EXAMPLE}.' for part in wrong]
                )
            pairs: list[tuple[str, object]] = [(key, value) for key, _, value in parts]
        else:
            pairs = list(given.items())
        made, mistakes, seen = cls(), Mistakes(), set[str]()
        for key, value in pairs:
            with mistakes.collect(f'{option} "{key}={value}": '):
                if key not in _KEYS:
                    near = nearest(str(key), _KEYS)
                    hint = f"did you mean {near}?" if near else f"there are {', '.join(_KEYS)}."
                    raise InputError(f"there is no such key; {hint}")
                if key in seen:
                    raise InputError(f"{key} is given twice; keep one of the two.")
                seen.add(key)
                made = replace(made, **_read(key, value))  # type: ignore[arg-type]
        mistakes.raise_if_any()
        return made

    def step(self, name: str, unit: str, rated_torque: float) -> float | None:
        """The step of a parameter in its SI unit; None where it is not rounded.

        >>> Resolution().step("time", "s", 24.0), Resolution().step("low_torque", "N*m", 24.0)
        (0.001, 0.024)
        """
        if unit == "N*m":
            return self.torque if self.torque is not None else self.torque_share * rated_torque
        if unit == "rad/s":
            return 2.0 * math.pi * self.frequency if "frequency" in name else self.speed
        return {"s": self.time, "1": self.share}.get(unit)


def _read(key: str, value: object) -> dict[str, float | None]:
    unit, example = _KEYS[key]
    shown = str(value).strip()
    share = key in ("torque", "share") and isinstance(value, str) and shown.endswith("%")
    try:
        number = float(to_si(shown[:-1], "1")) / 100.0 if share else float(to_si(value, unit))
    except InputError as error:
        raise InputError(error.sentences[0].partition(": ")[2] or error.sentences[0]) from None
    if not number > 0.0:
        raise InputError(f"a step is above 0; write {example}.")
    return {"torque_share": number, "torque": None} if share and key == "torque" else {key: number}


def rated_torque(drive: Drive) -> tuple[float, str]:
    """What 100 % means, N m, and what that is: the rated torque or power/speed, else the starting torque.

    >>> round(rated_torque(Drive.load("crane-4amtkf"))[0], 2)
    23.87
    """
    rated = drive.rated
    return (float(drive.Ms), "starting torque") if rated is None else (float(rated), RATED)


def gain_base(drive: Drive) -> tuple[float, str]:
    """The gain in N m s/rad that is 1 per cent of torque per per cent of speed, and what 100 % speed is.

    >>> base, what = gain_base(Drive.load("crane-4amtkf"))
    >>> round(base, 4), what
    (0.2591, 'rated speed')
    """
    rated, torque = drive.rated_speed, rated_torque(drive)[0]
    if rated is None or not rated > 0.0:
        return torque / float(drive.target_speed), "target speed"
    return torque / float(rated), "rated speed"


def nearest_step(value: float, step: float, most: float = math.inf) -> float:
    """The nearest multiple of `step` up to `most`; what is not 0 stays at least one step.

    >>> nearest_step(0.1118, 0.01), nearest_step(0.0004, 0.001), nearest_step(0.0, 0.001)
    (0.11, 0.001, 0.0)
    """
    if value == 0.0:
        return 0.0
    count = max(1, round(abs(value) / step))
    if count * step > most * (1.0 + 1e-12):
        count = max(1, math.floor(most / step * (1.0 + 1e-12)))
    exact, decimals = count * step, decimals_of(step)
    # without the noise of binary fractions, of a step that is a short decimal
    decimal = round(exact, decimals)
    noise = decimals < 9 and abs(decimal - exact) <= 1e-12 * exact
    return math.copysign(decimal if noise else exact, value)
