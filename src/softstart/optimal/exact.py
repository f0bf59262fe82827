"""A torque profile on the exact plant: replaying it, what follows t_f, and whether a method's answer holds.

After t_f a start is judged by its run to one elastic period beyond the start time. Synchronous and steady:
u_eq(T) = (T (J1 + J2) - Mc J1)/J2 holds the T of t_f. Reached: the motor coasts until w1 = w2 (undamped, that
is the peak of T; damped, just after it), then u_eq holds the T of then; no controller whose torque is
lowest_torque or more has a lower peak after t_f.

`check` reads nothing off a method's own grid: the demand is judged over all of its straight lines, the
realised torque over every span of the run, the peak is located, the terminal condition is the plant's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.kernel import records as at
from softstart.optimal.lp.motion import MARGIN
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate, LowerBound, OptimumError, heat_of
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate

LEVELS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.0)  # shares of the holding torque that are tried where it lags
TURN_SAMPLES = 512  # instants at which the sign of w1 - w2 is looked at
EQUAL = 1e-9  # of the target speed: w1 and w2 that differ by less are equal
RISE = 1e-9  # a peak after t_f that is higher by no more than this share is none

ROUNDING = 1e-9  # of limits and times
SHORT = 1e-6  # of the target speed: by so much it may be missed
BELOW = 1e-5  # K_dyn may lie below its bound by what SHORT is worth
TOUCHING = 3.0  # times as hard may the flanks meet again where a start ends steady without load torque
LOCAL = 0.05  # above a certificate by more than this share: not the optimum
CURVE_SAMPLES = 64  # an elastic period, where the torque is compared with a torque-speed curve


def replay(drive: Drive, profile: TorqueProfile, until: float, base: Drive | None = None) -> Run:
    """The start of the drive under the profile, to `until` in s, exactly.

    >>> run = replay(Drive.load("crane-4amtkf"), TorqueProfile([0.0], [62.0]), until=0.4)
    >>> round(run.k_dyn, 4)
    3.1179
    """
    player = make_controller("profile", {"profile": profile})
    return simulate(drive, player, until, base=base)


def demand_of(run: Run, until: float) -> TorqueProfile:
    """The demand that the motor followed in a run up to `until` in s, after its limits of torque and rate.

    >>> run = replay(Drive.load("crane-4amtkf"), TorqueProfile.steps([0.0, 0.1, 0.2], [62.0, 9.0]), until=0.4)
    >>> demand_of(run, 0.3).torque.tolist()
    [62.0, 62.0, 9.0]
    """
    spans = run.recorded.spans
    spans = spans[spans[:, at.S_START] < until]
    times = np.column_stack([spans[:, at.S_START], np.minimum(spans[:, at.S_END], until)])
    first = spans[:, at.S_REF]
    levels = np.column_stack([first, first + spans[:, at.S_SLOPE] * (times[:, 1] - times[:, 0])])
    return TorqueProfile(times.ravel(), levels.ravel()).simplified()


# while a brake holds the motor ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hold:
    """The brake of a motor, and the problem that is left at its release, on a clock that starts then.

    By torque proving the load rests until the motor torque has reached the shaft torque: at once where
    nothing delays the torque, else after the quickest rise, `demand`. At a time: what the motor does before
    makes no difference, and the load may have moved. `until` in s, `peak` of T in N m until then.
    """

    problem: Problem
    free: Problem
    until: float = 0.0
    demand: float = 0.0
    peak: float = 0.0

    def before(self, profile: TorqueProfile) -> TorqueProfile:
        """The demand of the whole start, `profile` beginning when the motor is free."""
        if self.until == 0.0:
            return profile
        return TorqueProfile([0.0], [self.demand]).followed_by(self.until, profile)

    def claimed(self, candidate: Candidate) -> float:
        """The figure that the candidate claims, for the whole start."""
        if self.problem.minimise == "start_time":
            return self.until + candidate.claimed
        return max(candidate.claimed, self.peak / self.problem.base_torque)


def hold_of(problem: Problem) -> Hold:
    """What the brake of the drive leaves to be found; InputError where that is no problem of its own.

    >>> crane = Drive.load("crane-4amtkf")
    >>> drive = crane.replace(start_position="hanging", brake="motor", torque_lag=0.01)
    >>> held = hold_of(Problem(drive, 0.5))
    >>> round(held.until, 6), round(held.free.first_torque, 3)
    (0.001227, 7.16)
    """
    drive = problem.drive
    if drive.brake == "none":
        return Hold(problem, problem)
    free = drive.replace(brake="none", start_position=float(drive.theta0))
    T = float(drive.c) * max(float(drive.theta0) - 0.5 * float(drive.gap), 0.0)
    late = drive.torque_lag > 0.0 or math.isfinite(drive.torque_rate)
    proving = math.isinf(drive.release_time)
    excess = T - float(drive.Mc)
    balanced = excess <= 0.0 if drive.load_kind == "reactive" else abs(excess) <= ROUNDING * drive.Mc
    resting = balanced and drive.initial_load_speed == 0.0
    if proving and (T == 0.0 or (resting and not late)):  # nothing to wait for
        return Hold(problem, replace(problem, drive=free))
    wrong = []
    if proving and not resting:
        wrong.append("the load swings on the wound-up shaft while the brake waits for the motor torque")
    if not proving and late:
        wrong.append("the torque that the motor has built up at the release is another unknown")
    if problem.heat is not None or problem.minimise == "heat":
        wrong.append("the heat while the motor is held is not counted")
    if problem.smoothness > 0.0:
        wrong.append("a smooth torque from 0 on is not one that begins at the release")
    if wrong:
        raise InputError(
            f'brake = "motor": an optimum is not found here, for {"; ".join(wrong)}; leave that out, or '
            'brake = "none".'
        )
    return _proved(problem, free, T) if proving else _timed(problem, free)


def _timed(problem: Problem, free: Drive) -> Hold:
    """The state at a release by time."""
    until = float(problem.drive.release_time)
    run = replay(problem.drive, TorqueProfile([0.0], [problem.lowest_torque]), until, problem.base)
    state = {name: float(run.at(until)[name]) for name in ("theta", "w2")}
    if abs(state["w2"]) > ROUNDING * problem.target:  # else it hangs still
        speed = {"initial_motor_speed": 0.0, "initial_load_speed": state["w2"]}
        free = free.replace(start_position=state["theta"], **speed)
    return _left(problem, free, until, peak=run.peak_torque)


def _proved(problem: Problem, free: Drive, T: float) -> Hold:
    """The quickest rise of the motor torque to T: full demand, at the largest rate, behind the lag."""
    drive, most = problem.drive, problem.highest_torque
    if most <= T:
        raise InputError(
            f"load_torque = {drive.Mc:g} N m: the motor has no more than {most:g} N m, so the brake is never "
            "released."
        )
    lag, rate = float(drive.torque_lag), float(drive.torque_rate)

    def realised(t: float) -> float:
        rising = min(t, most / rate)
        if lag == 0.0:
            return rate * rising
        ramp = 0.0 if math.isinf(rate) else rate * (rising + lag * math.expm1(-rising / lag))
        return most + (ramp - most) * math.exp(-(t - rising) / lag)

    longest = most / rate + lag * (1.0 - math.log1p(-T / most))
    until = float(brentq(lambda t: realised(t) - T, 0.0, longest, xtol=1e-16, rtol=1e-15))
    reached = min(rate * until, most) if math.isfinite(rate) else most
    return _left(problem, free, until, demand=most, torque=T, reached=reached, peak=T)


def _left(
    problem: Problem, free: Drive, until: float, *, peak: float, demand: float = 0.0, torque: float = 0.0,
    reached: float = 0.0,
) -> Hold:  # fmt: skip
    time = problem.start_time
    if time is not None and time <= until:
        raise InputError(
            f"start_time = {time:g} s: the brake holds the motor until {until:.6g} s; give more time."
        )
    left = None if time is None else time - until
    after = replace(problem, drive=free, start_time=left, first_torque=torque, first_demand=reached)
    return Hold(problem, after, until, demand, peak)


# after t_f -------------------------------------------------------------------------------------------------


def with_tail(problem: Problem, profile: TorqueProfile, end_time: float) -> TorqueProfile:
    """The demand of `profile` up to `end_time`, t_f in s, and what follows.

    Reached with T falling at t_f: its peak is over. Held at once, T would swing about T(t_f) and perhaps
    above its peak; some torque turns it back to rising without opening the gap, and at w1 = w2 it is held.
    With a lag or rate limit the realised torque comes late and T swings: a lower holding torque is taken
    where it keeps the peak of the run down. A torque-speed curve is kept to by holding less.

    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> pulse = TorqueProfile([0.0, 0.0075668, 0.0075668], [62.0, 62.0, 0.0])
    >>> held = with_tail(problem, pulse, 0.03591682)
    >>> held.torque.round(3).tolist()
    [62.0, 62.0, 0.0, 0.0, 56.243]
    """
    before = profile.followed_by(end_time, TorqueProfile([0.0], [problem.lowest_torque]))
    run = replay(problem.drive, before, end_time, problem.base)
    hold = _held(problem, run)
    if problem.terminal != "reached":
        return _joined(before, end_time, [(0.0, hold)])
    v = float(run.at(end_time)["v"])
    levels = [problem.lowest_torque]
    if v < -EQUAL * problem.target:
        levels = [hold, problem.highest_torque, problem.lowest_torque]
    last = end_time + float(problem.drive.elastic_period)
    tried = []
    for level in levels:
        for made, allowed in _held_after(problem, before, end_time, level, v):
            peak = replay(problem.drive, made, last, problem.base).peak_torque
            if peak <= allowed * (1.0 + RISE):
                return made
            tried.append((peak, made))
    return min(tried, key=lambda one: one[0])[1]


def _held_after(
    problem: Problem, before: TorqueProfile, end: float, level: float, v: float
) -> Iterator[tuple[TorqueProfile, float]]:
    """`level` from t_f until w1 = w2, then held: profiles, best first, with the peak of T until then."""
    turning = _turn(problem, before, end, level, v)
    going = _joined(before, end, [(0.0, level)])
    if not math.isfinite(turning):
        yield going, replay(problem.drive, before, end, problem.base).peak_torque
        return
    run = replay(problem.drive, going, turning, problem.base)
    hold, low = _held(problem, run), problem.lowest_torque
    late = problem.drive.torque_lag > 0.0 or math.isfinite(problem.drive.torque_rate)
    for share in LEVELS if late else LEVELS[:1]:
        steps = [(0.0, level), (turning - end, low + share * (hold - low))]
        yield _joined(before, end, steps), run.peak_torque


def _held(problem: Problem, run: Run) -> float:
    """u_eq(T) for T at the end of the run, within the limits, N m.

    Beyond a torque-speed curve it is what the curve leaves at the greatest speed of the period to come: the
    acceleration now, and a swing of all of T.
    """
    drive = problem.drive
    state = run.at(run.end_time)
    T, w1 = float(state["T"]), float(state["w1"])
    J = drive.J1 + drive.J2
    u = (T * J - drive.Mc * drive.J1) / drive.J2
    if problem.torque_speed and u > float(torque_allowed(problem, _fastest(problem, w1, T, 0.0))):
        u = float(torque_allowed(problem, _fastest(problem, w1, T, T)))
    return float(min(max(u, problem.lowest_torque), problem.highest_torque))


def _fastest(problem: Problem, w1: float, T: float, swing: float) -> float:
    """An upper bound of w1 over one elastic period in which T is at most what it is now, rad/s."""
    drive = problem.drive
    gained = max(T - drive.Mc, 0.0) / drive.J2 * drive.elastic_period
    swings = drive.J2 / (drive.J1 + drive.J2) * drive.Omega / drive.c * swing
    return float(w1 + gained + swings)


def torque_allowed(problem: Problem, w1: ArrayLike) -> Vector:
    """What the (concave) torque-speed curve allows at w1 in rad/s, N m: the least of its lines.

    >>> from softstart import Drive
    >>> limit = ((0.0, 62.0), (60.0, 62.0), (100.0, 22.0))
    >>> problem = Problem(Drive.load("crane-4amtkf"), 0.5, torque_speed=limit)
    >>> torque_allowed(problem, [10.0, 80.0]).tolist()
    [62.0, 42.0]
    """
    speed = np.asarray(w1, dtype=np.float64)
    lines = [
        u_a + (u_b - u_a) / (w_b - w_a) * (speed - w_a)
        for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed)
    ]
    return np.asarray(np.min(lines, axis=0))


def _joined(before: TorqueProfile, end: float, steps: list[tuple[float, float]]) -> TorqueProfile:
    """The profile up to `end`, then constant demands, each from so long after it on."""
    edges = [start for start, _ in steps]
    tail = TorqueProfile.steps([*edges, edges[-1] + 1.0], [level for _, level in steps])
    return before.followed_by(end, tail).simplified()


def _turn(problem: Problem, before: TorqueProfile, end: float, level: float, v: float) -> float:
    """First instant from `end` on in s at which w1 = w2 under a constant demand; inf if the gap opens before.

    Not T' = 0: where the shaft is damped, T' jumps with the torque, and only at w1 = w2 does u_eq hold T.
    """
    drive = problem.drive
    if abs(v) < EQUAL * problem.target:
        return end
    horizon = end + float(drive.elastic_period) + 5.0 * float(drive.torque_lag)
    run = replay(drive, _joined(before, end, [(0.0, level)]), horizon, problem.base)
    times = np.linspace(end, horizon, TURN_SAMPLES)
    state = run.at(times)
    turned = np.flatnonzero((state["v"] * v <= 0.0) | (state["T"] <= 0.0))
    if turned.size == 0 or state["T"][turned[0]] <= 0.0:
        return math.inf
    i = int(turned[0])
    return float(brentq(lambda t: float(run.at(t)["v"]), times[i - 1], times[i], xtol=1e-14))


# the check -------------------------------------------------------------------------------------------------


def check(
    problem: Problem,
    profile: TorqueProfile,
    end_time: float,
    claimed: float,
    bound: LowerBound,
    *,
    tolerance: float = 1e-3,
    bounces: bool = False,
) -> Run:
    """Run a profile on the exact plant to one elastic period after `end_time`; compare it with the claims.

    `end_time` is t_f in s, `claimed` the value of what is minimised as the method computed it, `tolerance`
    how far, relatively, the exact figures may be from it and above bounds. The gap may close several times if
    the start `bounces`. Returns the run; raises
    OptimumError with one sentence for each thing that does not hold, each with both numbers.

    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> bound = LowerBound(0.909, "momentum", "every torque")
    >>> check(problem, TorqueProfile([0.0], [62.0]), 0.2402535, 0.9, bound)
    Traceback (most recent call last):
    softstart.optimal.result.OptimumError: ...K_dyn is 3.1... in the exact re-simulation, 0.9 was claimed...
    """
    period = float(problem.drive.elastic_period)
    if not 0.0 < end_time < math.inf:
        raise OptimumError(f"The end time of the start is {end_time:g} s, which is no time above 0 s.")
    run = replay(problem.drive, profile, end_time + period, problem.base)
    idle = problem.terminal == "steady" and problem.drive.Mc < MARGIN * problem.highest_torque
    wrong = [
        *_demand(problem, profile),
        *_realised(problem, run),
        *_torque_speed(problem, run),
        *_times(problem, run, end_time, tolerance),
        *_terminal(problem, run, end_time, tolerance),
        *(() if bounces else _contacts(run, end_time, (TOUCHING if idle else 1.0) * tolerance)),
        *_figures(problem, run, end_time, claimed, tolerance),
        *_against_bound(problem, run, bound),
    ]
    if wrong:
        raise OptimumError(" ".join(wrong))
    return run


def _demand(problem: Problem, profile: TorqueProfile, name: str = "demand") -> Iterator[str]:
    """A straight line is extreme at its ends."""
    low, high = problem.lowest_torque, problem.highest_torque
    for torque, i, limit, beyond in _beyond(profile.torque, low, high):
        yield (
            f"The {name} is {torque:.6g} N m at {profile.time[i]:.6g} s, {beyond} motor torque of "
            f"{limit:.6g} N m."
        )
    if profile.after_contact is not None:
        yield from _demand(problem, profile.after_contact, "demand after contact")


def _realised(problem: Problem, run: Run) -> Iterator[str]:
    """In each span lag u' = ref + slope s - u: u is extreme at its ends or where u' = 0."""
    low, high = problem.lowest_torque, problem.highest_torque
    lag = float(problem.drive.torque_lag)
    columns = (at.S_START, at.S_END, at.S_U, at.S_REF, at.S_SLOPE)
    start, end, first, ref, ub = (run.recorded.spans[:, column] for column in columns)
    length, ua = end - start, ref - lag * ub  # u(s) = ua + ub s + ue exp(-s/lag)
    ue = first - ua
    turns = np.zeros_like(length)
    if lag > 0.0:
        bent = (ub != 0.0) & (ue / np.where(ub != 0.0, ub * lag, 1.0) > 0.0)
        turns[bent] = lag * np.log(ue[bent] / (ub[bent] * lag))
    s = np.stack([np.zeros_like(length), length, np.clip(turns, 0.0, length)])
    u = ua + ub * s + (ue * np.exp(-s / lag) if lag > 0.0 else 0.0)
    for torque, i, limit, beyond in _beyond(u.ravel(), low, high):
        row, span = np.unravel_index(i, u.shape)
        yield (
            f"The motor torque is {torque:.6g} N m at {start[span] + s[row, span]:.6g} s, {beyond} of "
            f"{limit:.6g} N m."
        )


def _beyond(torques: Vector, low: float, high: float) -> Iterator[tuple[float, int, float, str]]:
    """Largest and least of some torques where they exceed a limit: torque, index, limit, on which side."""
    allowed = ROUNDING * max(abs(low), abs(high))
    for i, limit, sign, beyond in (
        (int(np.argmax(torques)), high, 1.0, "above the highest"),
        (int(np.argmin(torques)), low, -1.0, "below the lowest"),
    ):
        if sign * (float(torques[i]) - limit) > allowed:
            yield float(torques[i]), i, limit, beyond


def _torque_speed(problem: Problem, run: Run) -> Iterator[str]:
    worst, when, span = beyond_curve(problem, run)
    if worst > SHORT * problem.highest_torque:
        state = run.recorded.at([when], np.array([span]))
        u, w1 = float(state["u"][0]), float(state["w"][0, 0])
        yield (
            f"The motor torque is {u:.6g} N m at {when:.6g} s and {w1:.6g} rad/s, where the torque-speed "
            f"curve allows {u - worst:.6g} N m."
        )


def beyond_curve(problem: Problem, run: Run) -> tuple[float, float, int]:
    """By how much the motor torque exceeds the curve at worst, N m; when, s, and in which span.

    Densely in each span, then the worst instant located; minus infinity without a curve.
    """
    if not problem.torque_speed:
        return -math.inf, 0.0, 0
    recorded, step = run.recorded, float(problem.drive.elastic_period) / CURVE_SAMPLES

    def excess(times: ArrayLike, spans: ArrayLike) -> Vector:
        state = recorded.at(times, np.atleast_1d(spans))
        found: Vector = state["u"] - torque_allowed(problem, state["w"][:, 0])
        return found

    ends = recorded.spans[:, [at.S_START, at.S_END]].tolist()
    each = [np.linspace(start, end, 2 + math.ceil((end - start) / step)) for start, end in ends]
    times, spans = np.concatenate(each), np.repeat(np.arange(len(each)), [one.size for one in each])
    beyond = excess(times, spans)
    i = int(np.argmax(beyond))
    worst, when, span = float(beyond[i]), float(times[i]), int(spans[i])
    near = max(ends[span][0], when - step), min(ends[span][1], when + step)
    found = minimize_scalar(
        lambda t: -float(excess([t], span)[0]), bounds=near, method="bounded", options={"xatol": 1e-6 * step}
    )
    return (-float(found.fun), float(found.x), span) if -float(found.fun) > worst else (worst, when, span)


def _times(problem: Problem, run: Run, end_time: float, tolerance: float) -> Iterator[str]:
    latest = problem.start_time
    if latest is not None and end_time > latest * (1.0 + ROUNDING):
        yield f"The start takes {end_time:.9g} s, longer than the start time of {latest:.9g} s."
    reached = run.start_time
    if problem.minimise == "start_time" and reached < end_time * (1.0 - tolerance):
        yield f"The load has its target speed at {reached:.6g} s already, {end_time:.6g} s was claimed."


def _terminal(problem: Problem, run: Run, end_time: float, tolerance: float) -> Iterator[str]:
    at_end = run.at(end_time)
    state = {name: float(at_end[name]) for name in ("w1", "w2", "v", "T")}
    drive, target = problem.drive, problem.target
    if state["w2"] < target * (1.0 - SHORT):
        yield (
            f"The load speed is {state['w2']:.9g} rad/s at {end_time:.6g} s, below its target of "
            f"{target:.9g} rad/s."
        )
    if state["w2"] > target * (1.0 + tolerance):
        yield (
            f"The load speed is {state['w2']:.9g} rad/s at {end_time:.6g} s, above its target of "
            f"{target:.9g} rad/s."
        )
    if problem.terminal == "reached":
        return
    # what is left of the relative speed swings T by c v/Omega: it must not show
    swing = float(drive.c / drive.Omega) * abs(state["v"])
    if swing > tolerance * problem.base_torque:
        yield (
            f"The motor speed is {state['w1']:.9g} rad/s and the load speed {state['w2']:.9g} rad/s at "
            f"{end_time:.6g} s, and they should be equal."
        )
    if problem.terminal == "steady" and abs(state["T"] - float(drive.Mc)) > tolerance * problem.base_torque:
        yield (
            f"The shaft torque is {state['T']:.6g} N m at {end_time:.6g} s, and it should be the load torque "
            f"of {drive.Mc:.6g} N m."
        )


def _contacts(run: Run, end_time: float, tolerance: float) -> Iterator[str]:
    """Contacts until t_f; the gap closing again so softly that it does not show is none."""
    drive = run.drive
    closed = [
        event.time
        for event in run.events
        if event.kind == "gap closed" and event.time < end_time * (1.0 - ROUNDING)
    ]
    soft = tolerance * run.peak_torque * float(drive.Omega / drive.c)
    speeds = np.abs(run.at(closed)["v"]) if closed else np.zeros(0)
    began_closed = run.contacts > sum(event.kind == "gap closed" for event in run.events)
    first = 0 if began_closed else 1
    again = [time for time, v in zip(closed[first:], speeds[first:], strict=True) if v > soft]
    if again:
        yield (
            f"The gap closes {len(again) + 1} times before {end_time:.6g} s (again at {again[0]:.6g} s), and "
            "it may close 1 time."
        )
    elif not closed and not began_closed:
        yield f"The gap closes 0 times before {end_time:.6g} s, and it has to close 1 time."


def _figures(problem: Problem, run: Run, end_time: float, claimed: float, tolerance: float) -> Iterator[str]:
    """What was claimed, and the bounds of the problem on what is not minimised."""
    k_dyn = run.k_dyn
    heat = heat_of(run, end_time)
    short = not run.start_time <= end_time  # by so little that it passed as reached
    taken = end_time if short else run.start_time
    name, value, unit = {
        "k_dyn": ("K_dyn", k_dyn, ""),
        "heat": ("The heat", heat, " s"),
        "start_time": ("The start time", taken, " s"),
    }[problem.minimise]
    if not abs(value - claimed) <= tolerance * abs(value):
        yield (
            f"{name} is {value:.8g}{unit} in the exact re-simulation, {claimed:.8g}{unit} was claimed "
            f"({100.0 * (claimed / value - 1.0):+.3g} %)."
        )
    if problem.k_dyn is not None and k_dyn > problem.k_dyn * (1.0 + tolerance):
        yield f"K_dyn is {k_dyn:.8g}, above its bound of {problem.k_dyn:.8g}."
    if problem.heat is not None and heat > problem.heat * (1.0 + tolerance):
        yield f"The heat is {heat:.8g} s, above its bound of {problem.heat:.8g} s."


def _against_bound(problem: Problem, run: Run, bound: LowerBound) -> Iterator[str]:
    if bound.kind == "none":
        return
    k_dyn = run.k_dyn
    if k_dyn < bound.k_dyn * (1.0 - BELOW):
        yield f"K_dyn is {k_dyn:.8g}, below its lower bound of {bound.k_dyn:.8g} ({bound.kind})."
    # a certificate is close to the optimum only where nothing but K_dyn and the torque's limits count
    alone = problem.minimise == "k_dyn" and problem.ideal_torque and problem.heat is None
    if bound.kind == "certificate" and bound.near and alone and k_dyn > bound.k_dyn * (1.0 + LOCAL):
        yield (
            f"K_dyn is {k_dyn:.8g}, {100.0 * (k_dyn / bound.k_dyn - 1.0):.3g} % above its lower bound of "
            f"{bound.k_dyn:.8g}: a local optimum."
        )
