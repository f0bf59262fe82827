"""Pulse, coast, hold: the gentlest start of an undamped drive with an active load, in closed form.

Let z = theta - gap/2 (negative while the gap is open), T = c max(0, z), a = Ms/J1 + Mc/J2 and b = Mc/J2 the
relative accelerations of full and of no torque, T0 = c b/Omega^2. A start whose T stays below P obeys a speed
limit z' <= V(z) at every twist of its first way up:

    V^2 <= v0^2 + 2 a (z - z0) [- Omega^2 (z^2 - z0^2)]            full torque brings no more       (pulse)
    V^2 <= Omega^2/c^2 ((P - T0)^2 - (T - T0)^2) [+ 2 b z]         else no torque at all ends above P (coast)

(terms in brackets in contact and in the gap respectively). For d(z'^2/2)/dz = z'' lies between that
without and that with full torque. Pulse, coast, hold moves at this limit all the way and then holds T = P. So
no start of peak P has a larger T at any instant, nor a larger load speed, J2 w2' = T - Mc. That counts starts
whose gap closes several times. The second limit holds on every way up. After a
fall the first one can be passed, but too late: docs/theory/optimum.md has the proof, about instants in place
of twists.

The least P whose load reaches the target speed in time is the optimum; it is where the load speed at the
bound, which grows with P, is the target: one scalar equation.

The pulse ends in the gap or in contact. What limits the form is only the hold: u_eq(P) <= Ms. Where the load
reaches its target before T is at its peak, no hold is needed (terminal `reached`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from softstart.drive import Drive
from softstart.optimal.problem import Problem
from softstart.profile import TorqueProfile

AIM = 1.0 + 1e-9  # a little above the target, so that the exact plant finds it reached


class NotApplicable(RuntimeError):  # noqa: N818 - an answer, not a failure
    """There is no start of this form for the problem: the message says why."""


@dataclass(frozen=True)
class Course:
    """A start of peak P: full torque to t1, none to t_peak; z1 and v1 are twist and its rate at t1.

    Times in s. `peak` is P in N m, or the peak under full torque where P is above it.
    """

    t1: float
    t_contact: float
    t_peak: float
    z1: float
    v1: float
    peak: float


@dataclass(frozen=True)
class PulseCoastHold:
    """The starts of one drive and all that follows from their peak P: SI units, z0 < 0 while the gap is open.

    >>> from softstart import Drive
    >>> starts = PulseCoastHold.of(Problem(Drive.load("crane-4amtkf").replace(target_speed=60), 0.2883042))
    >>> course = starts.course(48.063)
    >>> round(course.t1, 5), round(course.t_contact, 5), round(course.t_peak, 5)
    (0.00757, 0.02171, 0.03592)
    """

    J1: float
    J2: float
    c: float
    Mc: float
    Ms: float
    z0: float
    v0: float
    w2: float

    @classmethod
    def of(cls, problem: Problem) -> PulseCoastHold:
        """Those of a problem; damping is left out."""
        return cls.of_drive(problem.drive.two_masses, problem.highest_torque)

    @classmethod
    def of_drive(cls, drive: Drive, Ms: float) -> PulseCoastHold:
        """Those of a drive under at most Ms N m; damping is left out."""
        return cls(
            float(drive.J1),
            float(drive.J2),
            float(drive.c),
            float(drive.Mc),
            Ms,
            float(drive.theta0 - 0.5 * drive.gap),
            float(drive.initial_motor_speed - drive.initial_load_speed),
            float(drive.initial_load_speed),
        )

    @property
    def Omega(self) -> float:
        """Elastic frequency, rad/s."""
        return math.sqrt(self.c / self.J1 + self.c / self.J2)

    @property
    def pull(self) -> float:
        """b: relative acceleration by the load alone, rad/s^2."""
        return self.Mc / self.J2

    @property
    def push(self) -> float:
        """Relative acceleration by the full motor torque alone, rad/s^2."""
        return self.Ms / self.J1

    @property
    def T0(self) -> float:
        """Shaft torque about which a coasting drive swings, N m: Mc J1/(J1 + J2)."""
        return self.Mc * self.J1 / (self.J1 + self.J2)

    @property
    def most_held(self) -> float:
        """The largest shaft torque that Ms holds, N m: (Ms J2 + Mc J1)/(J1 + J2)."""
        return (self.Ms * self.J2 + self.Mc * self.J1) / (self.J1 + self.J2)

    @property
    def least_peak(self) -> float:
        """Peak of T without any motor torque, N m; 0 where the gap never closes by itself."""
        return self.T0 + math.hypot(self._arriving(0.0)[0] * self.c - self.T0, self._arriving(0.0)[1])

    @property
    def full_peak(self) -> float:
        """Peak of T under full torque, N m: no start has a larger one on its first way up."""
        mean = self.most_held
        z, swing = self._arriving(self.push)
        return mean + math.hypot(z * self.c - mean, swing)

    def _arriving(self, push: float) -> tuple[float, float]:
        """z, and c z'/Omega in N m, where the contact begins under constant torque."""
        square = self.v0**2 + 2.0 * (push + self.pull) * max(-self.z0, 0.0)
        return max(self.z0, 0.0), self.c * math.sqrt(square) / self.Omega

    def course(self, P: float) -> Course:
        """The start of peak P >= least_peak."""
        least, most = self.least_peak, self.full_peak
        P = min(max(P, least), most)
        Omega, c = self.Omega, self.c
        # (P - T0)^2 - (least - T0)^2: what the pulse has to bring; push times the way that it takes
        way = 0.5 * (Omega / c) ** 2 * (P - least) * (P + least - 2.0 * self.T0) / self.push
        z1 = self.z0 + way
        if z1 < 0.0:
            t1 = fall_time(way, self.v0, self.push + self.pull)
            v1 = self.v0 + (self.push + self.pull) * t1
            v_contact = math.sqrt(v1 * v1 - 2.0 * self.pull * z1)
            t_contact = t1 + (-2.0 * z1 / (v1 + v_contact) if v1 + v_contact > 0.0 else math.inf)
            return Course(t1, t_contact, t_contact + self._rise(0.0, v_contact), z1, v1, P)
        z_contact, swing = self._arriving(self.push)
        v_contact = swing * Omega / c
        t_contact = fall_time(max(-self.z0, 0.0), self.v0, self.push + self.pull)
        mean = self.most_held / c
        # the square of the speed at z1 by its factors: the arc ends at P, where it is 0
        v1 = Omega * math.sqrt(max((P / c - z1) * (P / c + z1 - 2.0 * self.T0 / c), 0.0))
        before = math.atan2(v_contact / Omega, z_contact - mean)
        after = math.atan2(v1 / Omega, z1 - mean)
        t1 = t_contact + max(before - after, 0.0) / Omega
        return Course(t1, t_contact, t1 + self._rise(z1, v1), z1, v1, P)

    def _rise(self, z: float, v: float) -> float:
        """Time in s from there to the peak, coasting in contact."""
        return math.atan2(v / self.Omega, z - self.T0 / self.c) / self.Omega

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
        if t >= max(course.t1, course.t_contact):
            swing = Omega * (course.peak - self.T0) / self.c
            return swing * math.sin(Omega * (course.t_peak - t))
        if t <= course.t_contact:
            return self.v0 + self.pull * t + self.push * min(t, course.t1)
        z, swing = self._arriving(self.push)
        angle = Omega * (t - course.t_contact)
        away = (self.most_held / self.c - z) * Omega
        return swing * Omega / self.c * math.cos(angle) + away * math.sin(angle)

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
        if speed(low) >= 0.0:
            return low
        high = max(2.0 * low, self.full_peak)
        while speed(high) < 0.0:
            if self.course(high).t_peak >= time or not math.isfinite(high):
                return math.inf
            high *= 2.0
        return float(brentq(speed, low, high, xtol=1e-15 * high, rtol=1e-15))


def fall_time(way: float, v: float, a: float) -> float:
    """Time in s over a way at v >= 0, a > 0; no 0/0."""
    arriving = v + math.sqrt(v * v + 2.0 * a * way)
    return 2.0 * way / arriving if arriving > 0.0 else 0.0


def applies(problem: Problem) -> str:
    """Why the closed form does not hold for a problem, in a few words; empty if it does.

    That no hold with u_eq(P) <= Ms exists turns out in `solve`.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> applies(Problem(crane, 0.5)), applies(Problem(crane.replace(damping=1), 0.5))
    ('', 'the shaft is damped')
    """
    if len(problem.machines) > 1:
        return "one torque serves several starts"
    drive = problem.drive
    if len(drive.mass_names) != 2 or drive.motor is not drive:
        return "it is for a drive of two masses"
    if next(drive.without_friction(""), ""):
        return "the drive has friction"
    if problem.minimise != "k_dyn":
        return f"what is asked for is the least {problem.minimise}, and this form has the least K_dyn"
    if problem.heat is not None:
        return "the heat is bounded"
    if problem.terminal == "steady":
        return "it ends holding its peak, not with T = Mc"
    return off_course(problem) or (
        "the shaft is damped"
        if drive.d > 0.0
        else "the motor torque lags behind its demand"
        if drive.torque_lag > 0.0
        else "the torque rate is limited"
        if math.isfinite(drive.torque_rate)
        else "the motor torque is limited over its speed"
        if problem.torque_speed
        else "a smooth torque is asked for"
        if problem.smoothness > 0.0
        else ""
    )


def off_course(problem: Problem) -> str:
    """Why the speed limit does not hold even for an undamped shaft; empty if it does."""
    drive = problem.drive
    if drive.brake != "none":
        return "a brake holds the motor at first"
    if drive.load_kind == "reactive" and drive.Mc > 0.0:
        return "the load is reactive"
    if problem.lowest_torque < 0.0:
        return "the motor may brake"
    if drive.initial_motor_speed < drive.initial_load_speed:
        return "the load runs away from the motor at first"
    if drive.theta0 < -0.5 * drive.gap:
        return "the start is wound up against the load"
    return ""


def solve(problem: Problem) -> tuple[TorqueProfile, float, float]:
    """The gentlest start of the form Ms, 0, u_eq(P); raises NotApplicable where there is none.

    u_eq(P) = (P (J1 + J2) - Mc J1)/J2 holds T = P. t_f is the bound on the start time, or earlier where even
    the least peak, the load coming back through the gap by itself, is soon enough. Returns the demand, t_f in
    s and K_dyn.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> profile, end, k_dyn = solve(Problem(drive, start_time=0.2883042))
    >>> round(k_dyn, 8), profile.torque.round(3).tolist()
    (0.90924722, [62.0, 62.0, 0.0, 0.0, 56.243])
    """
    reason = applies(problem)
    if reason:
        raise NotApplicable(f"{reason}.")
    assert problem.start_time is not None
    starts = PulseCoastHold.of(problem)
    target = problem.target * AIM
    P = starts.least_peak_for(target, problem.start_time)
    if not math.isfinite(P):
        raise NotApplicable(
            "even full torque all the way is too slow, or ends before the shaft torque peaks."
        )
    course = starts.course(P)
    end = _end(starts, course, P, target, problem.start_time)
    if end < course.t_peak:
        if problem.terminal == "synchronous":
            raise NotApplicable(
                f"the load has its target speed at {end:g} s, before the shaft torque is at its peak."
            )
        steps = [(min(course.t1, end), starts.Ms), (end, 0.0)]
    else:
        held = (P * (starts.J1 + starts.J2) - starts.Mc * starts.J1) / starts.J2
        if held > starts.Ms * (1.0 + 1e-12):
            raise NotApplicable(
                f"holding the shaft torque of {P:.6g} N m would need {held:.6g} N m, and the motor has "
                f"{starts.Ms:.6g} N m."
            )
        steps = [(course.t1, starts.Ms), (course.t_peak, 0.0), (end, min(held, starts.Ms))]
    edges: list[float] = [0.0]
    levels: list[float] = []
    for until, torque in steps:
        if until > edges[-1]:
            edges.append(until)
            levels.append(torque)
    return TorqueProfile.steps(edges, levels), end, course.peak / problem.base_torque


def _end(starts: PulseCoastHold, course: Course, P: float, target: float, latest: float) -> float:
    """First instant at which the load has its target speed, s."""
    at_peak = starts.load_speed(course, course.t_peak, P)
    if at_peak <= target:
        held = (target - at_peak) * starts.J2 / (P - starts.Mc) if at_peak < target else 0.0
        return min(course.t_peak + held, latest)
    # w2 falls while T < Mc, then rises to the peak: it passes the target once
    if starts.load_speed(course, min(course.t_peak, latest), P) <= target:
        return latest
    end = brentq(
        lambda t: starts.load_speed(course, t, P) - target, 0.0, min(course.t_peak, latest), rtol=1e-15
    )
    return float(end)
