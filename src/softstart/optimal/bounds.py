"""Lower bounds from momentum: valid for every torque over time, whatever controller makes it.

The load's J2 w2' = T - Mc is integrated from 0 to t_f, with T <= P, and T <= 0 until t_c, the earliest
instant at which the shaft can drive the load. The least P falls with t_f, so t_f = start_time decides:

    active load            J2 (target - w2(0)) + Mc t_f <= P (t_f - t_c)
    reactive load          J2 target <= (P - Mc) (t_f - t_c), from its last standstill on; a load that moves
                           at first may never stop, then less is needed, J2 (target - what is left of w2)
    active with friction   the line of the reactive load, and that of the active one with Mb for Mc: the load
                           takes Mc = active + friction forward, Mb = active - friction backward, no less ever
    load mass of a chain   the same with J_L, M_L and n P, n the shafts beside it

Number of contacts, damping, contact law, lag, rate, curve and smoothing of the torque do not enter: the
realised torque stays within the limits of its demand, and that is all that is used. An undamped shaft has the
bound of pulse, coast, hold where that is higher, a damped one (`no-pull`, `dead-zone`) that of a contact
gentle enough to stay below P. A brake that holds the motor at first is left out: the motor could hold it too.
Why each t_c is the earliest: docs/theory/optimum.md, "The momentum bound".
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from softstart.arrays import Vector
from softstart.drive import Drive
from softstart.kernel import records as rec
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import (
    PulseCoastHoldStarts,
    fall_time,
    falls_back,
    off_course,
    reactive,
)
from softstart.optimal.result import LowerBound
from softstart.optimal.starts import parts

ROUNDING = 1e-10  # by so much, relatively, time is stretched and a bound lowered: not to lie above an optimum


def momentum_bound(problem: Problem) -> LowerBound:
    """A lower bound on K_dyn for every torque between the limits, any number of contacts, any drive.

    Without a bound on the start time the peak must be above Mc, no more. It is inf where no torque at all
    brings the load to its target speed in time.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> round(momentum_bound(Problem(drive, 0.2883042)).k_dyn, 4)
    0.9092
    >>> round(momentum_bound(Problem(drive.replace(load_kind="reactive"), 0.2883042)).k_dyn, 4)
    0.8688
    """
    each = [_least_peak(problem, one) for one in problem.machines]
    if unknown := [why for why in each if isinstance(why, str)]:
        return LowerBound(0.0, "none", unknown[0])
    peak = max(P for P in each if not isinstance(P, str)) * (1.0 - ROUNDING)
    covers = (
        f"every torque from {problem.torques} over time, by whatever controller, however often the gap closes"
    )
    return LowerBound(peak / problem.base_torque, "momentum", covers)


def two_masses(machine: Any) -> Drive | None:
    """The machine as a drive of two masses without friction, load curves and losses; None where it is not.

    >>> two_masses(Drive.load("crane-4amtkf")).name == Drive.load("crane-4amtkf").name
    True
    """
    if len(machine.mass_names) != 2:
        return None
    rows, masses, shafts = parts(machine)
    rubs = masses["friction"].any() or masses["ground"].any()
    plain = shafts["eta"][0] == 1.0 and not rows.curves.size and np.isfinite(masses["J"]).all()
    if rubs or not plain or (rows.machine.motor, rows.machine.load) != (0.0, 1.0):
        return None
    drive: Drive = machine.two_masses
    return drive if drive.brake == "none" else drive.replace(brake="none", start_position=float(drive.theta0))


def _two_masses(problem: Problem, machine: Any) -> Problem | None:
    """The problem of one machine alone, as a drive of two masses; None where it is none."""
    if (drive := two_masses(machine)) is None:
        return None
    return replace(problem, drive=drive, base=problem.base or problem.drive, scenarios=())


# the least peak ---------------------------------------------------------------------------------------------


def _least_peak(problem: Problem, machine: Any) -> float | str:
    """No start of a machine has a lower peak of T than this, N m; or why none is known."""
    pair = _two_masses(problem, machine)
    return _of_pair(pair) if pair else _of_chain(problem, machine)


def _of_pair(problem: Problem) -> float:
    """The same of two masses."""
    drive = problem.drive
    if problem.start_time is None:
        return float(drive.Mc)
    time = problem.start_time * (1.0 + ROUNDING)
    left = time - earliest_pull(problem)
    if left <= 0.0:
        return math.inf
    w2 = drive.initial_load_speed
    plain = float((drive.J2 * (problem.target - w2) + drive.backward_torque * time) / left)
    if drive.reactive_torque > 0.0:
        # standing still at last, or never: J2 w2 is then what is left of it at the contact
        w2 = max(w2 - drive.Mc / drive.J2 * (time - left), 0.0)
        moving = float(drive.Mc + drive.J2 * (problem.target - w2) / left)
        plain = moving if reactive(problem.drive) else max(plain, moving)
    if off_course(problem):
        return plain
    starts = PulseCoastHoldStarts.of(problem)
    if drive.d == 0.0:
        return max(plain, starts.least_peak_for(problem.target, time))
    if starts.travel > 0.0 and drive.contact_law != "modelica":
        return max(plain, _gentle_contact(problem, starts, time, plain))
    return plain


def _gentle_contact(problem: Problem, starts: PulseCoastHoldStarts, time: float, plain: float) -> float:
    """The least P, N m, with P (time - t_c(P)) >= J2 (target - w2) + Mc time; damped shaft, gap open.

    t_c(P) is that of the soonest contact whose T, coasting, stays below P, on a grid: fewer instants only
    lower the bound.
    """
    s = np.linspace(0.0, min(half_period(problem.drive), math.pi / problem.drive.Omega), 65)
    by_speed, by_load = _coasting(problem.drive, s)
    kept = by_speed > 1e-9 * float(np.max(by_speed))
    by_speed, by_load = by_speed[kept], by_load[kept]
    full = starts.push + starts.pull

    def peak(a: float) -> float:
        """Of coasting, after a gap crossed at the acceleration a."""
        return float(np.max(by_speed * math.sqrt(starts.v0**2 + 2.0 * a * starts.travel) + by_load))

    def missing(P: float) -> float:
        v = float(np.min((P - by_load) / by_speed))
        # the contact with a speed of at most v: pulse, then coast
        pulse = 0.5 * (v * v - starts.v0**2 - 2.0 * starts.pull * starts.travel) / starts.push
        pulse = min(max(pulse, 0.0), starts.travel)
        t1 = fall_time(pulse, starts.v0, full)
        t_c = t1 + fall_time(starts.travel - pulse, starts.v0 + full * t1, starts.pull)
        return P * (time - min(t_c, 2.0 * time)) - needed

    needed = starts.J2 * (problem.target - starts.w2) + starts.Mc * time
    low, high = max(plain, peak(starts.pull)), peak(full)
    # rounding: at `high` the contact is the earliest, so that only the plain bound can ask for more
    if low >= high or missing(low) >= 0.0 or missing(high) <= 0.0:
        return low
    return float(brentq(missing, low, high, xtol=1e-14 * high))


def half_period(drive: Drive) -> float:
    """Up to when, s, an impulse of torque cannot lower T in contact: first zero of its response.

    >>> round(half_period(Drive.load("crane-4amtkf").replace(damping=1.0)), 6)
    0.025525
    """
    # c sin(qs)/q + d (cos(qs) - zeta/q sin(qs)) = 0; overdamped with sinh and cosh
    share = 0.5 * drive.d * drive.Omega / drive.c
    q = drive.Omega * math.sqrt(abs(1.0 - share * share))
    if q < 1e-6 * drive.Omega:
        return float(2.0 / drive.Omega)
    return float(2.0 * (math.acos(share) if share < 1.0 else math.acosh(share)) / q)


def _coasting(drive: Drive, s: Vector) -> tuple[Vector, Vector]:
    """T after s of contact without motor torque is the first times z' at first, and the second."""
    both = 1.0 / drive.J1 + 1.0 / drive.J2
    motion = np.array([[0.0, 1.0, 0.0], [-drive.c * both, -drive.d * both, drive.Mc / drive.J2], [0.0] * 3])
    every = expm(motion * s[:, None, None])[:, :2, 1:]  # (z, z') by (z', 1) at first
    by_speed, by_load = (drive.c * every[:, 0] + drive.d * every[:, 1]).T
    return by_speed, by_load


def _of_chain(problem: Problem, machine: Any) -> float | str:
    """The same from the load mass of a chain alone."""
    rows, masses, shafts = parts(machine)
    load = int(rows.machine.load)
    if load == rows.machine.motor or (shafts["eta"] != 1.0).any():
        return "no bound is known where the motor or a gear with losses adds to T"
    if rows.curves.size and (rows.curves.view(rec.CURVE)["mass"] == load).any():
        return "no bound is known where the load torque follows a curve"
    one = masses[load]
    J, taken, w0 = float(one["J"]), float(one["Mc"] + one["active"]), float(one["w0"])
    if problem.start_time is None:
        return taken
    left = problem.start_time * (1.0 + ROUNDING) - _first_pull(problem, machine)
    if left <= 0.0:
        return math.inf
    gained = J * (problem.target - w0)
    if w0 <= 0.0 and (one["Mc"] > 0.0 or one["ground"] > 0.0):
        gained = J * problem.target
    elif w0 <= 0.0:
        taken *= problem.start_time / left
    return (gained / left + taken) / ((load > 0) + (load < masses.size - 1))


# the earliest contact ---------------------------------------------------------------------------------------


def earliest_pull(problem: Problem) -> float:
    """Earliest instant in s at which the shaft can drive the load (a reactive one at rest: move it).

    >>> from softstart import Drive
    >>> round(earliest_pull(Problem(Drive.load("crane-4amtkf"), 0.5)), 5)
    0.01661
    """
    # (a load that falls against friction is slowed by less than the pull of Mc: its contact is later)
    drive, held, starts = problem.drive, reactive(problem.drive), PulseCoastHoldStarts.of(problem)
    if falls_back(problem) or (held and starts.w2 < 0.0):  # the motor may bounce off the other flank first
        if held or (drive.contact_law == "dead-zone" and drive.d > 0.0):
            return 0.0
        wound_up = drive.Omega * max(-0.5 * drive.gap - drive.theta0, 0.0)
        most = _largest(problem) / starts.J1 + starts.pull
        return fall_time(starts.travel, math.hypot(starts.v0, wound_up), most)
    at_rest = held and starts.w2 == 0.0
    a = starts.push + starts.pull * (not at_rest)
    contact = fall_time(starts.travel, starts.v0, a)
    if not at_rest or drive.d > 0.0:
        return contact
    return contact + starts.winding_time(starts.v0 + a * contact, starts.Mc / starts.c)


def _largest(problem: Problem) -> float:
    """U, the largest |u|, N m."""
    return max(problem.highest_torque, -problem.lowest_torque)


def _first_pull(problem: Problem, machine: Any) -> float:
    """No shaft drives the load mass of a chain before this instant, s."""
    rows, masses, shafts = parts(machine)
    last, record = masses.size - 1, rows.machine
    alone = record.motor == 0.0 and record.load == last and last > 1
    quiet = not masses["w0"].any() and not (masses["Mc"] + masses["active"])[:last].any()
    quiet = quiet and not masses["friction"].any() and (np.abs(shafts["theta0"]) <= shafts["half_gap"]).all()
    plain = not rows.curves.size and (shafts["eta"] == 1.0).all() and np.isfinite(masses["J"]).all()
    if not (alone and quiet and plain):
        return 0.0
    U, falls = _largest(problem), float(masses["active"][last])
    J1, Jb, JL = (float(masses["J"][i]) for i in (0, last - 1, last))
    reach = float(shafts["half_gap"][-1] - shafts["theta0"][-1])
    t1 = math.sqrt(2.0 * float(shafts["half_gap"][0] - abs(shafts["theta0"][0])) * J1 / U)
    fallen = 0.5 * falls / JL * t1 * t1
    if fallen >= reach:
        return math.sqrt(2.0 * reach * JL / falls) if falls > 0.0 else 0.0
    A = (U / math.sqrt(J1) + falls / math.sqrt(JL)) * math.sqrt(1.0 / Jb + 1.0 / JL)
    return math.sqrt(t1 * t1 + 2.0 * (reach - fallen) / A)


# heat and start time ----------------------------------------------------------------------------------------


def least_heat(problem: Problem) -> float:
    """No start of a problem with a bound on its start time has less I2t heat than this, s.

    With H the momentum that both masses gain and L what the load torque takes, by Cauchy and Schwarz

        integral u dt = H + L,    so that    integral u^2 dt >= (H + L)^2/t    at every end t.

    An active load takes L = Mc t: least at t = H/Mc, or at t_f before that. A reactive one takes Mc while it
    moves, no less than J2 (target - w2(0))/(P - Mc) s if no T is above P. One that falls against friction
    takes L >= Mb t. Where only the load is to reach its speed, a brake takes part of the impulse, or friction
    holds an active load, H + L is not known, and the bound is 0.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> round(least_heat(Problem(drive, 0.3, minimise="heat")), 4)
    0.1886
    """
    time, machine = problem.start_time, problem.machines[0]
    drive: Any = two_masses(machine)
    held = parts(machine)[0].machine.release_at > 0.0
    if problem.terminal == "reached" or time is None or drive is None or held:
        return 0.0
    J1, J2, Mc, Mb = map(float, (drive.J1, drive.J2, drive.Mc, drive.backward_torque))
    w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
    gained = J1 * (problem.target - w1) + J2 * (problem.target - w2)
    if reactive(drive):
        peak = math.inf if problem.k_dyn is None else problem.k_dyn * problem.base_torque
        if w2 < 0.0 or peak <= Mc or drive.active_torque != 0.0:
            return 0.0
        impulse = gained + Mc * J2 * (problem.target - w2) / (peak - Mc)
    else:
        time = min(time, gained / Mb) if Mb > 0.0 else time
        impulse = gained + Mb * time
    return float(max(impulse, 0.0) ** 2 / time / drive.Ms**2) * (1.0 - ROUNDING)


def momentum_shortest_time(problem: Problem) -> float:
    """No start of any kind can end sooner than this, in s, whatever its K_dyn.

    The shaft has to pull before the load gains speed, and the momentum has to come from the motor; see
    docs/theory/optimum.md, "The shortest time".

    >>> from softstart import Drive
    >>> round(momentum_shortest_time(Problem(Drive.load("crane-4amtkf").replace(target_speed=60), 0.3)), 4)
    0.2298
    """
    return max(_shortest(problem, machine) for machine in problem.machines)


def _shortest(problem: Problem, machine: Any) -> float:
    pair = _two_masses(problem, machine)
    if pair is None:
        return _first_pull(problem, machine)
    drive, first = pair.drive, earliest_pull(pair)
    if parts(machine)[0].machine.release_at > 0.0:
        return first  # the brake may carry more than the motor can
    J1, J2, Mc = float(drive.J1), float(drive.J2), float(drive.Mc)
    w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
    least = Mc if reactive(pair.drive) else float(drive.backward_torque)  # that the load takes while it moves
    left, U, aim = pair.highest_torque - least, _largest(pair), (J1 + J2) * pair.target
    overlap = max(abs(float(drive.theta0)) - 0.5 * float(drive.gap), 0.0)
    missing = aim - J1 * w1 - J2 * w2
    if pair.terminal == "reached":
        swing, A = math.hypot(w1 - w2, float(drive.Omega) * overlap), U / J1 + Mc / J2
        # breaking away on either flank adds to the swing
        return first if reactive(pair.drive) else max(first, (missing - J1 * swing) / (left + J1 * A))
    moving = missing / left  # the load never stands still
    energy = 0.5 * (J1 * w1**2 + J2 * w2**2 + float(drive.c) * overlap**2)
    stopping = (aim - math.sqrt(2.0 * J1 * energy)) / U
    if not reactive(pair.drive):
        return max(first, moving)
    return max(first, min(stopping, moving) if w2 > 0.0 else stopping)
