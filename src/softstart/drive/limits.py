"""What a machine withstands and must do: the table `[limits]` of a drive file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.input.gear import Gear
from softstart.input.parameters import Parameter, Wording

# what stands there changes no start
INFORMATIVE_TABLES = ("limits", "limits.fatigue", "gear", "duty", "shift")


@dataclass(frozen=True)
class SNCurve:
    """How many cycles of a torque the shaft line withstands; a cycle goes from 0 to the torque and back.

    Between the points the curve is straight in logarithms; beyond them it goes on, so that small cycles
    count as well (Miner's rule in its elementary form).

    Attributes
    ----------
    slope : float or None
        Exponent m of the S-N curve N = cycles (torque/T)^m; None where `points` give the curve.
    points : tuple of (float, float)
        Torque, N m at the motor shaft, and cycles to failure: the reference of the curve with `slope`, or
        two and more points of an S-N curve, the largest torque first. Empty where only the slope is known,
        so that lives can be compared but not computed.

    Examples
    --------
    >>> curve = SNCurve(None, ((200.0, 1e4), (100.0, 1e6)))
    >>> [round(float(n)) for n in curve.cycles([200.0, 100.0, 50.0])], round(float(curve.torque(1e5)), 3)
    ([10000, 1000000, 100000000], 141.421)
    """

    slope: float | None
    points: tuple[tuple[float, float], ...] = ()

    def cycles(self, torque: ArrayLike) -> NDArray[np.float64]:
        """Cycles of this torque to failure; without points those beside one cycle of 1 N m."""
        sizes = np.asarray(torque, dtype=np.float64)
        if self.slope is not None:
            ((reference, number),) = self.points or ((1.0, 1.0),)
            return np.asarray(number * (reference / sizes) ** self.slope)
        log_torque, log_cycles, slopes = self._lines()
        log = np.log(sizes)
        piece = np.searchsorted(-log_torque[1:-1], -log)
        return np.exp(log_cycles[piece] - slopes[piece] * (log - log_torque[piece]))

    def torque(self, cycles: ArrayLike) -> NDArray[np.float64]:
        """The torque of which so many cycles lead to failure, N m."""
        log_torque, log_cycles, slopes = self._lines()
        log = np.log(np.asarray(cycles, dtype=np.float64))
        piece = np.searchsorted(log_cycles[1:-1], log)
        return np.exp(log_torque[piece] - (log - log_cycles[piece]) / slopes[piece])

    def _lines(self) -> tuple[NDArray[np.float64], ...]:
        """Logarithms of the points, the largest torque first, and the slope from each to the next."""
        log_torque, log_cycles = np.log(np.array(self.points or ((1.0, 1.0),))).T
        if self.slope is not None:
            return log_torque, log_cycles, np.array([self.slope])
        return log_torque, log_cycles, np.diff(log_cycles) / -np.diff(log_torque)


@dataclass(frozen=True)
class Limit:
    """One limit of a drive: its name and unit, the figure of a start that it bounds, how large that may be.

    `most` is an array where the limit differs from start to start. It bounds `scale` times the figure: of a
    torque at the output that is the factor by which the gear brings torques there.
    """

    name: str
    unit: str
    figure: str
    most: Any
    scale: Any = 1.0

    def share_left(self, value: ArrayLike) -> NDArray[np.float64]:
        """What such a figure leaves of the limit, a share: below 0 where it is exceeded.

        >>> float(Limit("shaft torque", "N m", "peak_torque", 200.0).share_left(150.0))
        0.25
        """
        return np.asarray(1.0 - np.asarray(value, dtype=np.float64) / (self.most / self.scale))


@dataclass(frozen=True)
class Limits:
    """The limits of a drive (`drive.limits`); None where a limit is not given.

    Attributes
    ----------
    shaft_torque : float or None
        Permissible peak of the shaft torque, N m at the motor shaft; of a limit there and one at the output
        the stricter.
    start_time : float or None
        Longest start time, s.
    starts_per_hour : float or None
        Starts in each hour of `life`.
    life : float or None
        Time that the shaft line must last, s.
    fatigue : SNCurve or None
        What it withstands.
    used_torque : float or None
        What a start may use of the permissible torques of the shafts of a chain, %: 100 where one is given.
    output_torque : float or None
        Permissible peak of the torque at the output of the gear, N m there: `shaft_torque` is at most
        `output_torque/to_output`.
    to_output : float or None
        Torque at the output over that at the motor shaft, with losses: i eta, or i/eta where the load drives.
    """

    shaft_torque: float | None = None
    start_time: float | None = None
    starts_per_hour: float | None = None
    life: float | None = None
    fatigue: SNCurve | None = None
    used_torque: float | None = None
    output_torque: float | None = None
    to_output: float | None = None

    @property
    def starts(self) -> float | None:
        """Starts that the shaft line must last: `starts_per_hour` times `life`.

        >>> Limits(starts_per_hour=60.0, life=3600.0 * 20000.0).starts
        1200000.0
        """
        if self.life is None or self.starts_per_hour is None:
            return None
        return self.starts_per_hour * self.life / 3600.0

    @property
    def each(self) -> tuple[Limit, ...]:
        """The limits that there are; of the life the share in per cent that the starts asked for use."""
        output, factor = self.output_torque, self.to_output
        torque = Limit("shaft torque", "N m", "peak_torque", self.shaft_torque)
        if output is not None and factor is not None and np.all(self.shaft_torque == output / factor):
            # where the output decides, it is told there
            torque = Limit("output torque", "N m", "peak_torque", output, factor)
        limits = (
            torque,
            Limit("permissible torque", "%", "used_torque", self.used_torque),
            Limit("start time", "s", "start_time", self.start_time),
            Limit("used life", "%", "used_life", None if self.life is None else 100.0),
        )
        return tuple(one for one in limits if one.most is not None)

    def margin(self, figures: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
        """The least share left of those limits whose figure is given, one number a start.

        NaN where a figure is NaN, and where none of these limits is there.

        >>> Limits(shaft_torque=200.0, start_time=0.5).margin({"peak_torque": [150.0], "start_time": [0.3]})
        array([0.25])
        """
        shares = [one.share_left(figures[one.figure]) for one in self.each if one.figure in figures]
        return (
            np.minimum.reduce(shares) if shares else np.full(np.shape(next(iter(figures.values()))), np.nan)
        )

    def __bool__(self) -> bool:
        """Whether a start can pass or fail: there is a limit of torque, time or life."""
        given = (self.shaft_torque, self.start_time, self.life, self.used_torque)
        return any(one is not None for one in given)


def limits_of(values: Mapping[str, Any], gear: Gear | None = None) -> Limits:
    """The limits among the values of a drive with this gear.

    >>> limits = limits_of({"permissible_output_torque": 1600.0}, Gear(40.0, 0.8, load=5.0))
    >>> limits.shaft_torque, limits.each[0].name
    (50.0, 'output torque')
    """
    slope, torques, cycles = (values.get(f"fatigue_{key}") for key in ("slope", "torque", "cycles"))
    points = tuple(sorted(zip(torques or (), cycles or (), strict=True), reverse=True))
    fatigue = SNCurve(slope, points) if slope is not None or points else None
    torque, output = values.get("permissible_torque"), values.get("permissible_output_torque")
    factor = None if gear is None else gear.of_torques
    if output is not None and factor is not None:  # the stricter of two
        torque = output / factor if torque is None else np.minimum(torque, output / factor)
    return Limits(
        torque, values.get("permissible_start_time"), values.get("starts_per_hour"),
        values.get("required_life"), fatigue, None, output, factor,
    )  # fmt: skip


def contradicting_limits(
    values: Mapping[str, Any], parameters: Mapping[str, Parameter], wording: Wording
) -> Iterator[str]:
    """A sentence for a life or an S-N curve that is incomplete; `values` holds those that are valid."""

    def wrong(key: str, reason: str, other: str = "") -> str:
        value = values[key]
        value = value[0] if isinstance(value, tuple) and len(value) == 1 else value
        subject = f"{wording.label(parameters[key])} = {wording.show(value)}"
        return wording.sentence(subject, reason.format(other=other and wording.label(parameters[other])))

    if values.get("gear_ratio") is None:
        for key in ("permissible_output_torque", "gear_efficiency"):
            if values.get(key) not in (None, parameters[key].default):
                yield wrong(
                    key, "without {other} there is no output; give it, or leave this out", "gear_ratio"
                )
    if values.get("required_life") is not None and values.get("starts_per_hour") is None:
        yield wording.missing(parameters["starts_per_hour"]).sentence
    slope, torque, cycles = (values.get(f"fatigue_{key}") for key in ("slope", "torque", "cycles"))
    if torque is None or cycles is None:
        for key, other in (("fatigue_torque", "fatigue_cycles"), ("fatigue_cycles", "fatigue_torque")):
            if values.get(key) is not None:
                yield wrong(key, "an S-N curve has torque and cycles; give {other} as well", other)
        return
    points = sorted(zip(torque, cycles, strict=False), reverse=True)
    if len(torque) != len(cycles):
        count = f"there are {len(cycles)} for {len(torque)} values of {{other}}; give one for each"
        yield wrong("fatigue_cycles", count, "fatigue_torque")
    elif len(torque) == 1 and slope is None:
        yield wrong("fatigue_torque", "one point is no curve; give {other}, or more points", "fatigue_slope")
    elif len(torque) > 1 and slope is not None:
        reason = "the points of the S-N curve give its slopes; leave out the slope, or all points but one"
        yield wrong("fatigue_slope", reason)
    elif any(a[0] == b[0] or a[1] >= b[1] for a, b in pairwise(points)):
        reason = "a smaller torque must be withstood for more cycles, in each point; sort them as {other}"
        yield wrong("fatigue_cycles", reason, "fatigue_torque")
