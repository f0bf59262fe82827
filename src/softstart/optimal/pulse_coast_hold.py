"""Pulse, coast, hold: the gentlest start of an undamped drive with an active load, in closed form.

Let z = theta - gap/2 (negative while the gap is open), T = c max(0, z), a = Ms/J1 + Mc/J2 and b = Mc/J2 the
relative accelerations of full and of no torque, T0 = c b/Omega^2. A start whose T stays below P obeys a speed
limit z' <= V(z) at every twist of its first way up:

    V^2 <= v0^2 + 2 a (z - z0) [- Omega^2 (z^2 - z0^2)]            full torque brings no more       (pulse)
    V^2 <= Omega^2/c^2 ((P - T0)^2 - (T - T0)^2) [+ 2 b z]         else no torque at all ends above P (coast)

(terms in brackets in contact and in the gap respectively). Pulse, coast, hold moves at this limit all the way
and then holds T = P: no start of peak P, however often its gap closes, has a larger T at any instant, nor a
larger load speed, J2 w2' = T - Mc (proof: docs/theory/optimum.md). The least P whose load reaches the target
speed in time is the optimum: one scalar equation. What limits the form is only the hold: u_eq(P) <= Ms. Where
the load reaches its target before T is at its peak, no hold is needed (terminal `reached`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scipy.optimize import brentq

from softstart.drive import Drive
from softstart.optimal.problem import Problem
from softstart.profile import TorqueProfile


class NotApplicable(RuntimeError):  # noqa: N818 - an answer, not a failure
    """There is no start of this form for the problem: the message says why."""


@dataclass(frozen=True)
class Course:
    """A start of peak P: full torque to t1, none to t_peak, s; `peak`: P, or that of full torque, N m."""

    t1: float
    t_contact: float
    t_peak: float
    peak: float


class PulseCoastHoldStarts:
    """The starts of one drive under at most Ms N m, and all that follows from their peak P; no damping.

    SI units; z0 < 0 while the gap is open, w2 is the first load speed, v0 the first rate of z.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> starts = PulseCoastHoldStarts.of(Problem(crane, 0.2883042))
    >>> course = starts.course(48.063)
    >>> round(course.t1, 5), round(course.t_contact, 5), round(course.t_peak, 5)
    (0.00757, 0.02171, 0.03592)
    """

    def __init__(self, drive: Drive, Ms: float) -> None:
        self.J1, self.J2, self.c, self.Mc = map(float, (drive.J1, drive.J2, drive.c, drive.Mc))
        self.Ms, self.w2 = Ms, float(drive.initial_load_speed)
        self.v0 = float(drive.initial_motor_speed) - self.w2
        self.z0 = float(drive.theta0 - 0.5 * drive.gap)
        self.travel, self.preload = max(-self.z0, 0.0), max(self.z0, 0.0)  # of the gap; of the flanks
        self.Omega = math.sqrt(self.c / self.J1 + self.c / self.J2)
        self.pull, self.push = self.Mc / self.J2, Ms / self.J1  # b and Ms/J1: by the load, by full torque
        self.most_held = self.mean(Ms)
        self.least_peak = self.peak(0.0)  # without any motor torque; 0 where the gap never closes by itself
        self.full_peak = self.peak(Ms)  # no start has a larger one on its first way up

    @classmethod
    def of(cls, problem: Problem) -> PulseCoastHoldStarts:
        """Those of a problem."""
        return cls(problem.drive.two_masses, problem.highest_torque)

    def mean(self, u: float) -> float:
        """Shaft torque that the motor torque u holds, and about which T swings under it, N m."""
        return (u * self.J2 + self.Mc * self.J1) / (self.J1 + self.J2)

    def peak(self, u: float) -> float:
        """Peak of T under constant torque u, N m."""
        v = math.sqrt(self.v0**2 + 2.0 * (u / self.J1 + self.pull) * self.travel)
        return self.mean(u) + math.hypot(self.c * self.preload - self.mean(u), self.c * v / self.Omega)

    def held(self, P: float) -> float:
        """u_eq(P): the motor torque that holds the shaft torque P, N m."""
        return (P * (self.J1 + self.J2) - self.Mc * self.J1) / self.J2

    def course(self, P: float) -> Course:
        """The start of peak P >= least_peak."""
        least, full = self.least_peak, self.push + self.pull
        P = min(max(P, least), self.full_peak)
        Omega, c, T0 = self.Omega, self.c, self.mean(0.0)
        # (P - T0)^2 - (least - T0)^2: what the pulse has to bring; push times the way that it takes
        way = 0.5 * (Omega / c) ** 2 * (P - least) * (P + least - 2.0 * T0) / self.push
        z1, t_contact = self.z0 + way, fall_time(min(way, self.travel), self.v0, full)
        v = self.v0 + full * t_contact
        if z1 < 0.0:
            t1, t_contact = t_contact, t_contact + fall_time(-z1, v, self.pull)
            z1, v1 = 0.0, math.sqrt(v * v - 2.0 * self.pull * z1)
            begins = t_contact
        else:
            # the square of the speed at z1 by its factors: the arc ends at P, where it is 0
            v1 = Omega * math.sqrt(max((P / c - z1) * (P / c + z1 - 2.0 * T0 / c), 0.0))
            t1 = begins = t_contact + _swing_time(self.preload, v, z1, v1, self.most_held / c, Omega)
        return Course(t1, t_contact, begins + math.atan2(v1 / Omega, z1 - T0 / c) / Omega, P)

    def winding_time(self, v: float, z1: float) -> float:
        """Time in s in which full torque winds the shaft up to z1, from contact at the speed v, load held."""
        z, ws, mean = self.preload, math.sqrt(self.c / self.J1), self.Ms / self.c
        v1 = ws * math.sqrt(max((v / ws) ** 2 + (z1 - z) * (2.0 * mean - z - z1), 0.0))  # energy
        return _swing_time(z, v, z1, v1, mean, ws) if z1 > z else 0.0

    def load_speed(self, course: Course, t: float, P: float) -> float:
        """w2 at t in rad/s, T = P held from t_peak on (even where Ms would not do)."""
        t_swung = min(t, course.t_peak)
        momentum = self.J1 * self.v0 + (self.J1 + self.J2) * self.w2
        momentum += self.Ms * min(t_swung, course.t1) - self.Mc * t_swung
        w2 = (momentum - self.J1 * self._rate(course, t_swung)) / (self.J1 + self.J2)
        return w2 + (P - self.Mc) / self.J2 * (t - t_swung)

    def _rate(self, course: Course, t: float) -> float:
        """Rate z' at t <= t_peak, rad/s."""
        Omega = self.Omega
        if t >= course.t_peak:
            return 0.0
        if t <= course.t_contact:
            return self.v0 + self.pull * t + self.push * min(t, course.t1)
        if t >= course.t1:
            swing = Omega * (course.peak - self.mean(0.0)) / self.c
            return swing * math.sin(Omega * (course.t_peak - t))
        v, angle = self.v0 + (self.push + self.pull) * course.t_contact, Omega * (t - course.t_contact)
        away = (self.most_held / self.c - self.preload) * Omega
        return v * math.cos(angle) + away * math.sin(angle)

    def least_peak_for(self, target: float, time: float) -> float:
        """The least P in N m with which the load has the speed `target` at `time`; inf if none has.

        T is taken to be held at P whatever that needs: a lower bound for every start, the optimum itself
        where the hold is within the limits. The load speed grows with P and stays the same only where all of
        the start is under full torque.
        """

        def speed(P: float) -> float:
            return self.load_speed(self.course(P), time, P) - target

        # held from 0 on, P would be just enough: T is less at first
        low = max(self.least_peak, self.Mc + self.J2 * (target - self.w2) / time)
        high = max(low, self.full_peak)
        if speed(low) >= 0.0:
            return low
        if speed(high) < 0.0:  # full torque up to its peak; from there on any P is held
            full = self.course(high)
            left = time - full.t_peak
            missing = target - self.load_speed(full, full.t_peak, high)
            return self.Mc + self.J2 * missing / left if left > 0.0 else math.inf
        return float(brentq(speed, low, high, xtol=1e-15 * high, rtol=1e-15))


def fall_time(way: float, v: float, a: float) -> float:
    """Time in s over a way at v >= 0, a >= 0; no 0/0."""
    if way <= 0.0:
        return 0.0
    arriving = v + math.sqrt(v * v + 2.0 * a * way)
    return 2.0 * way / arriving if arriving > 0.0 else math.inf


def _swing_time(z: float, v: float, z1: float, v1: float, mean: float, omega: float) -> float:
    """Time in s of a swing about `mean` from z at the speed v to z1 at the speed v1, rad and rad/s."""
    return max(math.atan2(v / omega, z - mean) - math.atan2(v1 / omega, z1 - mean), 0.0) / omega


def reactive(drive: Drive) -> bool:
    """Whether friction holds the load at rest: while T >= 0 it is a reactive one, whatever its parts."""
    return bool(drive.reactive_torque > 0.0 and drive.rests)


def first_true(reasons: Mapping[str, bool]) -> str:
    """The first reason that applies; empty if none does."""
    return next((why for why, is_so in reasons.items() if is_so), "")


def falls_back(problem: Problem) -> str:
    """Why the twist may fall before the first contact; empty if it cannot."""
    drive = problem.drive
    return first_true({
        "the motor may brake": problem.lowest_torque < 0.0,
        "the load runs away from the motor at first": drive.initial_motor_speed < drive.initial_load_speed,
        "the start is wound up against the load": drive.theta0 < -0.5 * drive.gap,
    })  # fmt: skip


def off_course(problem: Problem) -> str:
    """Why the speed limit does not hold even for an undamped shaft; empty if it does."""
    drive = problem.drive
    held = {
        "a brake holds the motor at first": drive.brake != "none",
        "the load is reactive, friction holds it at rest": reactive(drive),
        "friction stops the load between falling and rising": drive.reactive_torque > 0.0 and not drive.rests,
    }
    return first_true(held) or falls_back(problem)


def applies(problem: Problem) -> str:
    """Why the closed form does not hold for a problem, in a few words; empty if it does.

    That no hold with u_eq(P) <= Ms exists turns out in `solve_pulse_coast_hold`.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> applies(Problem(crane, 0.5)), applies(Problem(crane.replace(damping=1), 0.5))
    ('', 'the shaft is damped')
    """
    drive = problem.drive
    if len(problem.machines) > 1:
        return "one torque serves several starts"
    if len(drive.mass_names) != 2 or drive.motor is not drive:
        return "it is for a drive of two masses"
    least = f"what is asked for is the least {problem.minimise}, and this form has the least K_dyn"
    asked = {
        "the drive has friction": any(drive.without_friction("")),
        least: problem.minimise != "k_dyn",
        "the heat is bounded": problem.heat is not None,
        "it ends holding its peak, not with T = Mc": problem.terminal == "steady",
    }
    motor = {
        "the shaft is damped": drive.d > 0.0,
        "the motor torque lags behind its demand": drive.torque_lag > 0.0,
        "the torque rate is limited": math.isfinite(drive.torque_rate),
        "the motor torque is limited over its speed": bool(problem.torque_speed),
        "a smooth torque is asked for": problem.smoothness > 0.0,
    }
    return first_true(asked) or off_course(problem) or first_true(motor)


def solve_pulse_coast_hold(problem: Problem) -> tuple[TorqueProfile, float, float]:
    """The gentlest start of the form Ms, 0, u_eq(P); raises NotApplicable where there is none.

    u_eq(P) = (P (J1 + J2) - Mc J1)/J2 holds T = P. t_f is the bound on the start time, or earlier where even
    the least peak, the load coming back through the gap by itself, is soon enough. Returns the demand, t_f in
    s and K_dyn.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> profile, end, k_dyn = solve_pulse_coast_hold(Problem(drive, start_time=0.2883042))
    >>> round(k_dyn, 8), profile.torque.round(3).tolist()
    (0.90924722, [62.0, 62.0, 0.0, 0.0, 56.243])
    """
    if reason := applies(problem):
        raise NotApplicable(f"{reason}.")
    assert problem.start_time is not None
    starts = PulseCoastHoldStarts.of(problem)
    target = problem.target * (1.0 + 1e-9)  # a little above, so that the exact plant finds it reached
    P = starts.least_peak_for(target, problem.start_time)
    if not math.isfinite(P):
        raise NotApplicable(
            "even full torque all the way is too slow, or ends before the shaft torque peaks."
        )
    course = starts.course(P)
    end = _end(starts, course, P, target, problem.start_time)
    held = starts.held(P)
    if end < course.t_peak and problem.terminal == "synchronous":
        raise NotApplicable(
            f"the load has its target speed at {end:g} s, before the shaft torque is at its peak."
        )
    if end >= course.t_peak and held > starts.Ms * (1.0 + 1e-12):
        raise NotApplicable(
            f"holding the shaft torque of {P:.6g} N m would need {held:.6g} N m, and the motor has "
            f"{starts.Ms:.6g} N m."
        )
    edges, levels = [0.0], list[float]()
    for until, torque in ((course.t1, starts.Ms), (course.t_peak, 0.0), (end, min(held, starts.Ms))):
        if min(until, end) > edges[-1]:
            edges.append(min(until, end))
            levels.append(torque)
    return TorqueProfile.steps(edges, levels), end, course.peak / problem.base_torque


def _end(starts: PulseCoastHoldStarts, course: Course, P: float, target: float, latest: float) -> float:
    """First instant at which the load has its target speed, s."""

    def missing(t: float) -> float:
        return target - starts.load_speed(course, t, P)

    left, last = missing(course.t_peak), min(course.t_peak, latest)
    if left >= 0.0:
        return min(course.t_peak + (left * starts.J2 / (P - starts.Mc) if left > 0.0 else 0.0), latest)
    # w2 falls while T < Mc, then rises to the peak: it passes the target once
    return latest if missing(last) >= 0.0 else float(brentq(missing, 0.0, last, rtol=1e-15))
