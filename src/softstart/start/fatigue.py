"""How long the shafts of a machine last that is started so: cycles of their torque, damage, and impacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.chain.machines import quantity_of
from softstart.drive import Machine, SNCurve
from softstart.errors import InputError, Sentence
from softstart.kernel import records as rec
from softstart.quantities import number_in
from softstart.results import OneLine, Result
from softstart.start.metrics import REFERENCE
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.start.trajectory import Trajectory

AnyMachine = TypeVar("AnyMachine", bound=Machine)
# pitting of case-hardened gears: the life factor of ISO 6336-2 falls as N^-0.0756, the torque as its square
DEFAULT_SLOPE = 6.6
# reversals by no more than this share of the peak are rounding
STILL = 1e-9
# gaps at which a start is computed over wear
GAPS = 33
HOURS_PER_YEAR = 8766.0
# a damping ratio where none is known, see `estimated_ratio`
RATIO_OF_A_GEAR, RATIO_OF_A_COUPLING, LARGEST_RATIO = 0.01, 0.005, 0.06


@dataclass(frozen=True, eq=False, repr=False)
class Life(OneLine):
    """What one start does to one shaft, and how often it can be repeated. Torques are at the motor shaft.

    Attributes
    ----------
    start : Run
        The start. K_dyn, peak torque, start time and utilisation are its own, of an unknown position the
        worst.
    run : Run
        The same; of an unknown position the start that does most damage to this shaft, to which cycles,
        impacts and life belong.
    shaft : int
        The index of the shaft; 0 of a drive.
    turning_points : array of shape (n, 2)
        Time, s, and torque, N m, at the reversals of its torque and at both ends, located.
    spectrum : array of shape (k, 3)
        Range and mean, N m, and number of the rainflow cycles of one start, the largest first.
    equivalent_torque : float
        Damage-equivalent torque, N m: one cycle of it from 0 and back in each start does the same damage.
    relative : float
        Life over that of this shaft under `direct`.
    relative_range : tuple of float
        The same with half and with twice the damping ratio, where that is estimated; else empty.
    starts : float
        Starts to failure; NaN without points of the S-N curve.
    hours : float
        Time of operation to failure at the starts per hour, h; NaN where one of the two is missing.
    utilisation : float
        Largest torque over the permissible one of the shaft; NaN where none is given.
    impacts : int
        How often the flanks met at a speed.
    impact_energy : float
        Kinetic energy of the relative motion at all impacts together, J, 1/2 J1 J2/(J1 + J2) v^2 each, of the
        two masses that the shaft joins: what a rigid contact without rebound would lose.
    worn_relative, worn_hours : float
        Life over that of `direct`, and hours to failure, while the gaps grow; NaN where no wear is asked for.
    wear_error : float
        How much the damage over wear, a share of it, changes with half the number of gaps.
    """

    start: Run
    run: Run
    shaft: int
    turning_points: Matrix
    spectrum: Matrix
    equivalent_torque: float
    relative: float
    starts: float
    hours: float
    utilisation: float
    impacts: int
    impact_energy: float
    relative_range: tuple[float, ...] = ()
    worn_relative: float = math.nan
    worn_hours: float = math.nan
    wear_error: float = math.nan

    @property
    def shaft_name(self) -> str:
        """The shaft by the masses that it joins."""
        return str(self.run.drive.shaft_names[self.shaft])

    @property
    def years(self) -> float:
        """`hours` in years of 8766 h."""
        return self.hours / HOURS_PER_YEAR

    @property
    def worn_years(self) -> float:
        """`worn_hours` in years of 8766 h."""
        return self.worn_hours / HOURS_PER_YEAR

    def summary(self) -> dict[str, object]:
        """The figures under the names used everywhere."""
        wear = {"worn_relative": self.worn_relative, "worn_hours": self.worn_hours}
        return {
            "controller": self.run.controller_name,
            "shaft": self.shaft_name,
            "position": self.run.position,
            "k_dyn": float(self.start.k_dyns[self.shaft]),
            "peak_torque": float(self.start.peak_torques[self.shaft]),
            "start_time": self.start.start_time,
            "equivalent_torque": self.equivalent_torque,
            "relative_life": self.relative,
            **({"relative_life_range": self.relative_range} if self.relative_range else {}),
            "starts_to_failure": self.starts,
            "hours": self.hours,
            "years": self.years,
            "utilisation": self.utilisation,
            "cycles": float(self.spectrum[:, 2].sum()),
            "impacts": self.impacts,
            "impact_energy": self.impact_energy,
            **({} if math.isnan(self.worn_relative) else {**wear, "wear_error": self.wear_error}),
            "spectrum": [
                dict(zip(("range", "mean", "count"), row.tolist(), strict=True)) for row in self.spectrum
            ],
        }


@dataclass(frozen=True, eq=False, repr=False)
class Fatigue(Result, view="fatigue.fatigue_sheet"):
    """Lives of the shafts of a machine under several strategies. It is returned by `fatigue`.

    Attributes
    ----------
    drive : Drive or Chain
        The machine that is started, with the damping that was estimated if so.
    curve : SNCurve
        The S-N curve of all shafts: slope m, and points if there are any.
    rows : tuple of Life
        For each run, in the order given, one for each shaft: a single one of a drive.
    slope_given : bool
        Whether the S-N curve is the user's; else the slope is that of case-hardened gears.
    estimate : mapping of str to int
        Numbers of gears and couplings from which the damping ratio is estimated; empty if it is given.
    worn_gap : float
        The gap at the end of the life asked for, rad; NaN where no wear is asked for.

    Examples
    --------
    >>> from softstart import Drive, fatigue, simulate
    >>> drive = Drive.load("crane-4amtkf").replace(damping=1.0)
    >>> lives = fatigue([simulate(drive, name) for name in ("direct", "s-curve")])
    >>> [round(row.relative) for row in lives.rows]
    [1, 101]

    References
    ----------
    Rainflow counting: ASTM E1049.
    """

    drive: Any  # a Machine
    curve: SNCurve
    rows: tuple[Life, ...]
    slope_given: bool
    estimate: Mapping[str, int]
    worn_gap: float

    @property
    def by_run(self) -> list[tuple[Life, ...]]:
        """The rows of each run, that is of all shafts under one strategy."""
        shafts = len(self.drive.shaft_names)
        return [self.rows[i : i + shafts] for i in range(0, len(self.rows), shafts)]

    @property
    def ranked(self) -> tuple[Life, ...]:
        """The rows, those of the strategy first under which the shaft that gains least lasts longest."""
        runs = sorted(self.by_run, key=lambda lives: -min(life.relative for life in lives))
        return tuple(life for lives in runs for life in lives)

    def summary(self) -> dict[str, object]:
        """Everything as plain data, for JSON."""
        machine = self.drive
        return {
            **machine.identity,
            "slope": self.curve.slope,
            "points": [list(point) for point in self.curve.points],
            "slope_given": self.slope_given,
            "dampings": machine.dampings.tolist(),
            "damping_ratio": machine.damping_ratio,
            "damping_estimated_from": dict(self.estimate) or None,
            "starts_per_hour": machine.limits.starts_per_hour,
            "starts_asked_for": machine.limits.starts,
            "gap": float(machine.gaps.sum()),
            "worn_gap": self.worn_gap,
            "strategies": [row.summary() for row in self.rows],
        }


def fatigue(
    runs: Run | Sequence[Run],
    *,
    slope: float | None = None,
    worn_gap: float | str | None = None,
    estimate_damping: Mapping[str, int] | None = None,
) -> Fatigue:
    """How long each shaft lasts under these starts, beside `direct`.

    The turning points of the shaft torque are located, not sampled. A start is repeated: behind its end the
    torque goes back to that of its beginning, so that rainflow counting leaves whole cycles only. Miner's
    rule adds their damage. S-N curve, starts per hour and the life asked for are `limits` of the machine: the
    tables `[limits]` and `[limits.fatigue]` of a drive file.

    Parameters
    ----------
    runs : Run or sequence of Run
        Starts of one drive or chain.
    slope : float, optional
        Slope m of the S-N curve instead of that of `limits.fatigue`. Without either it is 6.6, pitting of
        case-hardened gears after ISO 6336-2.
    worn_gap : float or str, optional
        Gap at the end of the life asked for, rad or with a unit: it grows in proportion to time from that
        of the machine, and stays from then on. Of a chain it is that of all gaps together at the motor shaft,
        which grow alike. The controllers stay as they were set up.
    estimate_damping : mapping, optional
        `{"gears": 3, "couplings": 2}`: for shafts without damping, a ratio of 1 % for each pair of gears and
        0.5 % for each coupling, at most 6 %. The starts are simulated again with it.

    Returns
    -------
    Fatigue
        A `Life` for each shaft of each run, in the order given.

    Raises
    ------
    InputError
        For bad input, for a shaft without damping, whose rattling never ends, and for a rigid gap, whose
        impacts have no finite torque.
    SimulationError
        If a start with another gap or damping cannot be finished.

    Examples
    --------
    >>> from softstart import Drive, fatigue, simulate
    >>> hoist = Drive.load("hoist-15kw").replace(fatigue_slope=6.6, fatigue_torque=200, fatigue_cycles=2e6)
    >>> life, = fatigue(simulate(hoist, "direct")).rows
    >>> life.relative, life.equivalent_torque < life.run.peak_torque, life.impacts
    (1.0, True, 0)
    >>> fatigue(simulate(Drive.load("crane-4amtkf"), "direct"))
    Traceback (most recent call last):
    softstart.errors.InputError: damping is missing in motor - load: an undamped shaft oscillates ...
    >>> crane = fatigue(simulate("crane-4-mass", "ramp"), estimate_damping={"gears": 2})
    >>> [life.shaft_name for life in crane.rows]
    ['rotor - pinion', 'pinion - wheel shaft', 'wheel shaft - crane']

    References
    ----------
    ASTM E1049, rainflow counting; ISO 6336-2, life factors; H. R. Simmons, A. J. Smalley on damping of geared
    trains, J. Eng. Gas Turbines Power 106 (1984) 946.
    """
    asked = _runs(runs)
    machine, estimate = asked[0].drive, _read_estimate(estimate_damping)
    curve, given = curve_of(machine, slope)
    gap = _read_gap(worn_gap, machine)
    near = [damped(machine, estimate, factor) for factor in (0.5, 2.0)] if estimate else []
    machine = damped(machine, estimate) if estimate else machine
    check_shafts(machine)
    if estimate:
        asked = [_again(run, machine) for run in asked]
    found = next((run for run in asked if run.controller_name == REFERENCE), None)
    direct = found or simulate(machine, REFERENCE, fitted_to=asked[0].design_drive)
    reference = damages(direct, curve)
    others = [[damages(_again(run, one), curve) for one in near] for run in (direct, *asked)]
    worn = [_over_wear(run, curve, gap) for run in (direct, *asked)] if not math.isnan(gap) else []
    rows = []
    for i, run in enumerate(asked, 1):
        for k, counted in enumerate(damages(run, curve)):
            life = _life(run, counted, curve, reference[k].damage)
            pairs = zip(others[0], others[i], strict=True)
            both = tuple(life_ratio(first[k].damage, own[k].damage) for first, own in pairs)
            life = replace(life, relative_range=both)
            if worn:
                (mean, hours, error), first_mean = worn[i][k], worn[0][k].mean
                ratio = life_ratio(first_mean, mean)
                life = replace(life, worn_relative=ratio, worn_hours=hours, wear_error=error)
            rows.append(life)
    return Fatigue(machine, curve, tuple(rows), given, estimate, gap)


def torque_turning_points(run: Run, shaft: int = 0) -> Matrix:
    """Times, s, and values, N m, of a shaft's torque at its reversals and both ends; located, not sampled.

    Where damping makes the torque jump at a contact, both sides count.

    >>> from softstart import simulate
    >>> points = torque_turning_points(simulate("hoist-15kw", "direct"))
    >>> [round(float(torque), 1) for torque in points[:2, 1]]
    [120.0, 180.8]
    """
    return run.trajectory.turning_points(shaft, STILL * float(run.peak_torques[shaft]))


def rainflow_cycles(torques: Iterable[float], *, repeated: bool = False) -> Matrix:
    """Range, mean and count of the rainflow cycles of a history, the largest range first (ASTM E1049).

    A history that is `repeated` is counted from its largest absolute value on, so that all cycles are whole.

    >>> rainflow_cycles([0.0, 3.0, 1.0, 2.0, 0.0]).tolist()
    [[3.0, 1.5, 0.5], [3.0, 1.5, 0.5], [1.0, 1.5, 1.0]]
    >>> rainflow_cycles([0.0, 3.0, 1.0, 2.0], repeated=True).tolist()
    [[3.0, 1.5, 1.0], [1.0, 1.5, 1.0]]
    """
    return indexed_cycles(torques, repeated=repeated)[:, :3]


def indexed_cycles(torques: Iterable[float], *, repeated: bool = False) -> Matrix:
    """The rows of `rainflow_cycles`, each with the places of its two ends in the history.

    >>> indexed_cycles([0.0, 3.0, 1.0, 2.0], repeated=True).tolist()
    [[3.0, 1.5, 1.0, 1.0, 0.0], [1.0, 1.5, 1.0, 2.0, 3.0]]
    """
    import rainflow

    history, top = list(torques), 0
    count = len(history)
    if repeated and history:
        sizes = list(map(abs, history))
        top = sizes.index(max(sizes))
        history = history[top:] + history[: top + 1]
    cycles = sorted(rainflow.extract_cycles(history), reverse=True)
    if repeated:  # the largest comes as two halves, from the top down and up to it
        halves = [one for one in cycles if one[2] == 0.5]
        whole = [one for one in cycles if one[2] != 0.5]
        cycles = sorted([*whole, *((r, mean, 1.0, i, k) for r, mean, _, i, k in halves[1::2])], reverse=True)
    rows = np.array(cycles, dtype=np.float64).reshape(-1, 5)
    rows[:, 3:] = (rows[:, 3:] + top) % max(count, 1)
    return rows


def impacts(run: Run, shaft: int = 0) -> Vector:
    """Kinetic energy of the relative motion, J, at each instant at which a shaft's flanks meet at a speed.

    >>> from softstart import simulate
    >>> impacts(simulate("hoist-15kw", "direct")).size
    0
    """
    return impact_energies(run.trajectory, shaft)


def impact_energies(trajectory: Trajectory, shaft: int) -> Vector:
    """The same of what is recorded of a start, or of a step of a duty."""
    rows = trajectory.input
    side, w = trajectory.of_shafts("side")[:, shaft], trajectory.of_masses("speed")
    closed = np.isin(trajectory.of_shafts("mode")[:, shaft], [rec.CONTACT, rec.DOUBLED])
    meets = (closed[1:] > closed[:-1]).nonzero()[0] + 1
    # not above 0 where flanks that overlap still take hold again
    speed = side[meets] * (w[meets, shaft] - w[meets, shaft + 1])
    # rigid joints without a gap make one body of their masses; the motor's is fixed while its brake holds
    joints = rows.shafts[0].view(rec.SHAFT)[:, 0]
    body = np.append(0, np.cumsum((joints["rigid"] == 0.0) | (joints["half_gap"] > 0.0)))
    light = 1.0 / np.bincount(body, rows.masses[0].view(rec.MASS)[:, 0]["J"])
    inverse = np.tile(light, (meets.size, 1))
    inverse[trajectory.states[meets, rec.S_BRAKED] == 1.0, body[int(rows.machine.motor)]] = 0.0
    energy: Vector = 0.5 * speed**2 / (inverse[:, body[shaft]] + inverse[:, body[shaft + 1]])
    return energy[speed > 0.0]


def estimated_ratio(gears: int, couplings: int) -> float:
    """A damping ratio where none is known: 1 % a pair of gears, 0.5 % a coupling, at most 6 %.

    A rule of this program, inside what was measured on geared trains: 1 to 6 % (Simmons and Smalley 1984).

    >>> estimated_ratio(3, 2), estimated_ratio(9, 0)
    (0.04, 0.06)
    """
    return min(RATIO_OF_A_GEAR * gears + RATIO_OF_A_COUPLING * couplings, LARGEST_RATIO)


def damped(machine: AnyMachine, estimate: Mapping[str, int], factor: float = 1.0) -> AnyMachine:
    """The machine with `factor` times the damping ratio that is estimated, in its shafts without damping.

    Raises `InputError` if each has one of its own.
    """
    if not undamped(machine):
        values = ", ".join(f"{d:.6g}" for d in machine.dampings.tolist())
        raise InputError(
            f"estimate_damping: each shaft has a damping of its own, {values} N m s/rad; leave the estimate "
            "out, or set shaft.damping to 0."
        )
    ratio = factor * estimated_ratio(estimate.get("gears", 0), estimate.get("couplings", 0))
    return machine.with_damping_ratio(ratio)


def with_estimated_damping(machine: AnyMachine, given: Mapping[str, int]) -> AnyMachine:
    """The machine with the damping ratio that numbers of gears and couplings give, see `fatigue`."""
    return damped(machine, _read_estimate(given))


def undamped(machine: Machine) -> list[str]:
    """The elastic shafts without damping, by their names.

    >>> from softstart import Drive
    >>> undamped(Drive.load("crane-4amtkf")), undamped(Drive.load("hoist-15kw"))
    (['motor - load'], [])
    """
    columns = zip(machine.shaft_names, machine.stiffnesses, machine.dampings, strict=True)
    return [name for name, c, d in columns if math.isfinite(c) and d == 0.0]


# what one start does -------------------------------------------------------------------------------------


class Damage(NamedTuple):
    """One shaft in one start: its turning points, its cycles, and the share of the life that they take."""

    run: Run
    shaft: int
    points: Matrix
    spectrum: Matrix
    damage: float  # without points of the S-N curve: cycles of 1 N m beside which it counts as much


def damage_of(run: Run, curve: SNCurve, shaft: int = 0) -> Damage:
    """The damage of one start to a shaft, by Miner's rule."""
    points = torque_turning_points(run, shaft)
    spectrum = rainflow_cycles(points[:, 1].tolist(), repeated=True)
    return Damage(run, shaft, points, spectrum, miner(spectrum, curve))


def miner(spectrum: Matrix, curve: SNCurve) -> float:
    """The damage of cycles (range, mean, count) by Miner's rule: the sum of n/N.

    >>> miner(np.array([[90.0, 45.0, 2.0]]), SNCurve(6.6, ((90.0, 2e6),)))
    1e-06
    """
    return float(np.sum(spectrum[:, 2] / curve.cycles(spectrum[:, 0]))) if spectrum.size else 0.0


def damages(run: Run, curve: SNCurve) -> list[Damage]:
    """The damage to each shaft, where the start position is unknown from the one that does most to it."""
    each = run.each
    shafts = range(len(run.drive.shaft_names))
    return [max((damage_of(one, curve, k) for one in each), key=lambda found: found.damage) for k in shafts]


def worst_damage(run: Run, curve: SNCurve) -> Damage:
    """The damage to the shaft that takes most."""
    return max(damages(run, curve), key=lambda found: found.damage)


def _life(start: Run, found: Damage, curve: SNCurve, reference: float) -> Life:
    """The figures of a shaft that is counted in a start, beside the damage of `direct`."""
    damage, run, shaft = found.damage, found.run, found.shaft
    energies = impacts(run, shaft)
    torque = float(curve.torque(1.0 / damage)) if damage > 0.0 else 0.0
    starts = (1.0 / damage if damage > 0.0 else math.inf) if curve.points else math.nan
    rate = run.drive.limits.starts_per_hour
    hours = starts / rate if rate is not None else math.nan
    return Life(
        start, run, shaft, found.points, found.spectrum, torque, life_ratio(reference, damage), starts, hours,
        float(start.utilisation[shaft]), energies.size, float(energies.sum()),
    )  # fmt: skip


def life_ratio(reference: float, damage: float) -> float:
    """Life over that of `direct`, from the damage of both."""
    return reference / damage if damage > 0.0 else math.inf


def _again(run: Run, machine: Machine) -> Run:
    """The same start of a changed machine, its controller as it was set up."""
    until = max(one.end_time for one in run.each) if math.isnan(run.limited_time) else None
    return simulate(machine, run.controller, until, fitted_to=run.design_drive, base=run.base)


# over wear -----------------------------------------------------------------------------------------------


class _Worn(NamedTuple):
    """Damage while the gap grows: its mean in a start, hours to failure, and the error of the mean."""

    mean: float
    hours: float
    error: float


def _over_wear(run: Run, curve: SNCurve, worn_gap: float) -> list[_Worn]:
    """The damage to each shaft while the gap grows in proportion to time, to `worn_gap` over the life."""
    machine, found = run.drive, []
    gaps = np.linspace(float(machine.gaps.sum()), worn_gap, GAPS).tolist()
    each = [[one.damage for one in damages(_again(run, machine.with_gap(gap)), curve)] for gap in gaps]
    limits = machine.limits
    for damage in np.array(each).T:
        mean, coarse = (float(np.mean(0.5 * (d[1:] + d[:-1]))) for d in (damage, damage[::2]))
        error = abs(coarse - mean) / mean if mean > 0.0 else 0.0
        known = curve.points and limits.starts_per_hour is not None and limits.life is not None
        rates = damage * limits.starts_per_hour if known else damage
        hours = _hours_to_failure(rates, limits.life / 3600.0) if known else math.nan
        found.append(_Worn(mean, hours, error))
    return found


def _hours_to_failure(rates: Vector, hours: float) -> float:
    """When the sum of the damage reaches 1, for rates in 1/h, straight between even instants up to `hours`.

    >>> _hours_to_failure(np.array([0.0, 0.1]), 10.0), _hours_to_failure(np.array([0.0, 0.4]), 10.0)
    (15.0, 7.0710678...)
    """
    step = hours / (rates.size - 1)
    sums = np.concatenate([[0.0], np.cumsum(0.5 * step * (rates[1:] + rates[:-1]))])
    if sums[-1] < 1.0:
        return float(hours + (1.0 - sums[-1]) / rates[-1]) if rates[-1] > 0.0 else math.inf
    i = int(np.searchsorted(sums, 1.0)) - 1
    slope, rest = (rates[i + 1] - rates[i]) / step, 1.0 - sums[i]
    return float(i * step + 2.0 * rest / (rates[i] + math.sqrt(rates[i] ** 2 + 2.0 * slope * rest)))


# reading what is asked for -------------------------------------------------------------------------------


def _runs(runs: object) -> list[Run]:
    found = [runs] if isinstance(runs, Run) else list(runs) if isinstance(runs, list | tuple) else []
    if not found or not all(isinstance(one, Run) for one in found):
        raise InputError("runs: give one Run or several, as softstart.simulate returns them for one machine.")
    if any(one.drive is not found[0].drive and one.drive != found[0].drive for one in found):
        raise InputError("runs: these are starts of different drives; give those of one drive or chain.")
    return found


def check_shafts(machine: Machine) -> None:
    """Refuse rigid gaps and undamped shafts, whose damage is undefined."""
    columns = zip(machine.shaft_names, machine.stiffnesses, machine.gaps, strict=True)
    if rigid := [name for name, c, gap in columns if math.isinf(c) and gap > 0.0]:
        raise InputError(
            Sentence(
                f"stiffness is infinite in {', '.join(rigid)}: impacts in a rigid gap have no finite torque, "
                "so that their damage is undefined.",
                "Give these shafts a stiffness.",
            )
        )
    if lacking := undamped(machine):
        raise InputError(
            Sentence(
                f"damping is missing in {', '.join(lacking)}: an undamped shaft oscillates indefinitely, so "
                "its fatigue life is undefined.",
                "Give each shaft a damping, or have its ratio estimated from numbers of gears and couplings "
                '(estimate_damping={"gears": 3, "couplings": 2}, or '
                "--estimate-damping gears=3,couplings=2).",
                page="Give each shaft a damping.",
            )
        )


def curve_of(machine: Machine, slope: float | None) -> tuple[SNCurve, bool]:
    """The S-N curve asked for, and whether it was."""
    own = machine.limits.fatigue
    if slope is None:
        return (own, True) if own is not None else (SNCurve(DEFAULT_SLOPE), False)
    m = number_in("1", slope, "slope")
    if not 0.0 < m < 100.0:
        raise InputError(f"slope = {slope}: the slope m of an S-N curve is above 0 and below 100, as 6.6.")
    if own is not None and own.slope is None:
        raise InputError("slope: the points of limits.fatigue give the slopes; leave out one of the two.")
    return SNCurve(m, own.points if own is not None else ()), True


def _read_gap(worn_gap: float | str | None, machine: Machine) -> float:
    if worn_gap is None:
        return math.nan
    gap, own = quantity_of(machine, "gap", worn_gap, "worn_gap"), float(machine.gaps.sum())
    if not gap > own:
        raise InputError(
            f"worn_gap = {worn_gap}: wear widens the gap; give one above that of the machine, {own:.6g} rad."
        )
    return gap


def _read_estimate(given: Mapping[str, int] | None) -> dict[str, int]:
    """Numbers of gears and couplings, checked."""
    if given is None:
        return {}
    known = {"gears", "couplings"}
    if not isinstance(given, Mapping) or not given or set(given) - known:
        raise InputError(
            f"estimate_damping = {given}: give numbers of gears and couplings, as "
            '{"gears": 3, "couplings": 2}.'
        )
    for name, count in given.items():
        if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= 100:
            raise InputError(f"estimate_damping: {name} = {count}: give a whole number from 0 to 100.")
    if not any(given.values()):
        raise InputError("estimate_damping: without gears and couplings nothing damps; give shaft.damping.")
    return dict(given)
