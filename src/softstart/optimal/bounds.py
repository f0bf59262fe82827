"""Lower bounds from momentum: valid for every torque over time, whatever controller makes it.

Two masses. Integrated from 0 to t_f, the load's J2 w2' = T - Mc says

    J2 (target - w2(0)) = integral T dt - Mc t_f <= P (t_f - t_c) - Mc t_f

for an active load: T <= P by what P is, and T <= 0 until t_c, the earliest instant at which the gap can close
on the driving side (on the other side T < 0; the load falls back meanwhile, which Mc t_f counts). The least P
that this allows falls with t_f, so t_f = start_time decides. Number of contacts, damping, contact law, torque
lag, rate, torque-speed curve and smoothing do not enter: the realised torque stays within the limits of its
demand, and that is all that is used.

A reactive load takes Mc from a moving load only. Let t_s be the last instant at which it stands still: just
after it T > Mc, so t_s >= t_c, and J2 target <= (P - Mc)(t_f - t_s). A load that moves at first may also
never stop; then the line above holds. The lesser of both bounds counts.

t_c. Where the twist cannot fall before the first contact (v0 >= 0, no braking torque), full torque is the
soonest. Otherwise the motor may bounce off the other flank first: the speed v = theta' on a path, with the
spring's energy, satisfies |d(v^2/2)| <= A |d theta|, where A is the largest relative acceleration, so that no
path is quicker than the direct one with |v0| and A. (Bouncing dead-zone dampers may pull, and a reactive load
that breaks away on the other flank may add energy: t_c = 0 then.) An undamped shaft does not move a reactive
load at rest before T = Mc: the motor alone, at full torque, winds it up soonest (a bounce before costs more
than the quarter period that this takes).

Two sharper forms, where the twist cannot fall first and the load is active:

- undamped: T is at no instant above that of pulse, coast, hold with the same peak P (pulse_coast_hold.py,
  where the proof stands), and the hold is taken as possible whether or not Ms suffices;
- damped (`no-pull`, `dead-zone`): no torque of 0 or more makes T(s) lower than coasting does, up to the
  first zero of c h + d h' after the contact (the answer of T to an impulse is not negative so long, so that
  T stays above 0 and the contact lasts). So the impact speed v has T_coasting(s; v) <= P for every s, which
  limits v; and in the gap the soonest contact with at most that speed is an early pulse. A contact that has
  to be gentle comes later than t_c. Fewer instants s only lower the bound: a grid proves as much as it
  says.

A brake that holds the motor at first is left out: the motor could hold it too.

N masses. The load mass alone obeys J_L w_L' = T - M_L, T the torque of the n shafts beside it (1 at the end
of a chain), brought to the motor's direction; with |T| <= P from the instant t_c on at which one can first
drive it, J_L (target - w_L(0)) + M_L t_f <= n P (t_f - t_c) for an active load torque and a load mass without
damping to the ground. Else, and where the load moves forward at first, what is left after its last standstill
counts, J_L target <= (n P - M_L)(t_f - t_c). For t_c the chain has to begin at rest, motor and load on its
ends, all gaps open or touching, no load torque on other masses, gears without losses, no friction; everywhere
else t_c = 0:

- Nothing but the motor's mass and the falling load mass moves before t_1, when the motor's shaft can close
  under full torque U: t_1^2 = 2 J_1 travel/U.
- From then on the speed of each mass is bounded by energy. E, kinetic and elastic, grows by no more than
  U |w_1| + M_L |w_L| a second, so that d sqrt(2E)/dt <= S = U/sqrt(J_1) + M_L/sqrt(J_L), and the relative
  speed at the load's shaft is at most A t, A = S sqrt(1/J_b + 1/J_L), J_b the mass before the load.

So the shaft cannot pull before t_c, where M_L t_1^2/(2 J_L) + A (t_c^2 - t_1^2)/2 is what its gap leaves. No
contact law adds energy.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from softstart.arrays import Vector
from softstart.drive import Drive
from softstart.kernel import records as at
from softstart.optimal.contact_motion import Contact
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold, fall_time, off_course
from softstart.optimal.result import LowerBound
from softstart.start.rows import rows_of

ROUNDING = 1e-10  # by so much, relatively, time is stretched and a bound lowered: not to lie above an optimum
INSTANTS = 64  # at which the coasting shaft torque is looked at


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
    each = [(problem.base_torque, *_least_peak(problem, one)) for one in problem.machines]
    unknown = next((why for _, _, why in each if why), "")
    if unknown:
        return LowerBound(0.0, "none", unknown)
    peak = max(P for _, P, _ in each) * (1.0 - ROUNDING)
    covers = (
        f"every torque from {problem.lowest_torque:g} to {problem.highest_torque:g} N m over time, by "
        "whatever controller, however often the gap closes"
    )
    return LowerBound(peak / problem.base_torque, "momentum", covers)


def two_masses(machine: Any) -> Drive | None:
    """The machine as a drive of two masses without friction, load curves and losses; None where it is not.

    >>> two_masses(Drive.load("crane-4amtkf")).name == Drive.load("crane-4amtkf").name
    True
    """
    if len(machine.mass_names) != 2:
        return None
    given = rows_of(machine)
    masses, shaft = given.masses[0].view(at.MASS)[:, 0], given.shafts[0, 0].view(at.SHAFT)[0]
    rubs = bool(masses["friction"].any() or masses["ground"].any())
    plain = shaft["eta"] == 1.0 and not given.curves.size and bool(np.isfinite(masses["J"]).all())
    straight = given.machine.motor == 0.0 and given.machine.load == 1.0
    if rubs or not plain or not straight:
        return None
    drive: Drive = machine.two_masses
    if drive.brake == "none":
        return drive
    return drive.replace(brake="none", start_position=float(drive.theta0))


def _least_peak(problem: Problem, machine: Any) -> tuple[float, str]:
    """No start of a machine has a lower peak of T than this, N m; or why none is known."""
    pair = two_masses(machine)
    if pair is None:
        return _of_chain(problem, machine)
    base = problem.base or problem.drive
    return least_peak(replace(problem, drive=pair, base=base, scenarios=(), terminal=problem.terminal)), ""


def _of_chain(problem: Problem, machine: Any) -> tuple[float, str]:
    """The same from the load mass of a chain alone."""
    given = rows_of(machine)
    load, masses = int(given.machine.load), given.masses[0].view(at.MASS)[:, 0]
    shafts, one = given.shafts[0].view(at.SHAFT)[:, 0], masses[load]
    J, taken, w0 = float(one["J"]), float(one["Mc"] + one["active"]), float(one["w0"])
    if load == given.machine.motor or (shafts["eta"] != 1.0).any():
        return 0.0, "no bound is known where the motor or a gear with losses adds to T"
    if given.curves.size and (given.curves.view(at.CURVE)["mass"] == load).any():
        return 0.0, "no bound is known where the load torque follows a curve"
    if problem.start_time is None:
        return taken, ""
    left = problem.start_time * (1.0 + ROUNDING) - _first_pull(problem, machine)
    if left <= 0.0:
        return math.inf, ""
    gained, sides = J * (problem.target - w0), (load > 0) + (load < masses.size - 1)
    if w0 <= 0.0 and (one["Mc"] > 0.0 or one["ground"] > 0.0):
        gained = J * problem.target
    elif w0 <= 0.0:
        taken *= problem.start_time / left
    return (gained / left + taken) / sides, ""


def _first_pull(problem: Problem, machine: Any) -> float:
    """No shaft drives the load mass of a chain before this instant, s; see the top of this file."""
    given = rows_of(machine)
    masses, shafts = given.masses[0].view(at.MASS)[:, 0], given.shafts[0].view(at.SHAFT)[:, 0]
    last, record = masses.size - 1, given.machine
    torques: Vector = masses["Mc"] + masses["active"]
    alone = record.motor == 0.0 and record.load == last and last > 1
    quiet = not masses["w0"].any() and not torques[:last].any() and not masses["friction"].any()
    quiet = quiet and bool((np.abs(shafts["theta0"]) <= shafts["half"]).all()) and not given.curves.size
    if not (alone and quiet) or (shafts["eta"] != 1.0).any() or not np.isfinite(masses["J"]).all():
        return 0.0
    U = max(problem.highest_torque, -problem.lowest_torque)
    J1, Jb, JL = (float(masses["J"][i]) for i in (0, last - 1, last))
    falls = float(masses["active"][last])
    reach = float(shafts["half"][-1] - shafts["theta0"][-1])
    t1 = math.sqrt(2.0 * float(shafts["half"][0] - abs(shafts["theta0"][0])) * J1 / U)
    fallen = 0.5 * falls / JL * t1 * t1
    if fallen >= reach:
        return math.sqrt(2.0 * reach * JL / falls) if falls > 0.0 else 0.0
    A = (U / math.sqrt(J1) + falls / math.sqrt(JL)) * math.sqrt(1.0 / Jb + 1.0 / JL)
    return math.sqrt(t1 * t1 + 2.0 * (reach - fallen) / A)


def least_heat(problem: Problem) -> float:
    """No start of a problem with a bound on its start time has less I2t heat than this, s.

    Integrated over both masses, with H the momentum that they gain and L what the load torque takes,

        integral u dt = H + L,    so that    integral u^2 dt >= (H + L)^2/t    (Cauchy and Schwarz)

    at every end t. An active load takes L = Mc t; then the bound is least at t = H/Mc, or at t_f before that.
    A reactive one takes Mc while it moves, no less than J2 (target - w2(0))/(P - Mc) s if no T is above P.
    Lag, rate and curve of the torque, damping and number of contacts do not enter. Where only the load is to
    reach its speed, or a brake takes part of the impulse, H + L is not known, and the bound is 0.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> round(least_heat(Problem(drive, 0.3, minimise="heat")), 4)
    0.1886
    """
    time, pair = problem.start_time, two_masses(problem.machines[0])
    held = rows_of(problem.machines[0]).machine.release_at > 0.0
    if problem.terminal == "reached" or time is None or pair is None or held:
        return 0.0
    drive: Any = pair
    J1, J2, Mc = float(drive.J1), float(drive.J2), float(drive.Mc)
    w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
    gained = J1 * (problem.target - w1) + J2 * (problem.target - w2)
    if _reactive(problem):
        peak = math.inf if problem.k_dyn is None else problem.k_dyn * problem.base_torque
        if w2 < 0.0 or peak <= Mc:
            return 0.0
        impulse = gained + Mc * J2 * (problem.target - w2) / (peak - Mc)
    else:
        time = min(time, gained / Mc) if Mc > 0.0 else time
        impulse = gained + Mc * time
    return float(max(impulse, 0.0) ** 2 / time / drive.Ms**2) * (1.0 - ROUNDING)


def least_peak(problem: Problem) -> float:
    """No start has a lower peak of T than this, N m."""
    drive = problem.drive
    if problem.start_time is None:
        return float(drive.Mc)
    time = problem.start_time * (1.0 + ROUNDING)
    plain = _plain(problem, time)
    if off_course(problem) or not math.isfinite(plain):
        return plain
    starts = PulseCoastHold.of(problem)
    if drive.d == 0.0:
        return max(plain, starts.least_peak_for(problem.target, time))
    if starts.z0 < 0.0 and drive.contact_law != "modelica":
        return max(plain, _gentle_contact(problem, starts, time, plain))
    return plain


def _plain(problem: Problem, time: float) -> float:
    """T <= P from the earliest contact on."""
    drive = problem.drive
    left = time - earliest_pull(problem)
    if left <= 0.0:
        return math.inf
    w2 = drive.initial_load_speed
    if _reactive(problem):
        # standing still at last, or never: J2 w2 is then what is left of it at the contact
        w2 = max(w2 - drive.Mc / drive.J2 * (time - left), 0.0)
        return float(drive.Mc + drive.J2 * (problem.target - w2) / left)
    return float((drive.J2 * (problem.target - w2) + drive.Mc * time) / left)


def _gentle_contact(problem: Problem, starts: PulseCoastHold, time: float, plain: float) -> float:
    """The least P, N m, with P (time - t_c(P)) >= J2 (target - w2) + Mc time; damped shaft, gap open."""
    contact = Contact.of(problem.drive)
    reach = min(contact.half_period, math.pi / contact.Omega)
    s = reach * np.arange(INSTANTS + 1) / INSTANTS
    _, by_speed, by_load, _ = contact.torque(s, np.array([0.0, 2.0 * reach]))
    kept = by_speed > 1e-9 * float(np.max(by_speed))
    by_speed, by_load = by_speed[kept], by_load[kept]

    def peak(v: float) -> float:
        return float(np.max(by_speed * v + by_load))

    def missing(P: float) -> float:
        v = float(np.min((P - by_load) / by_speed))
        return P * (time - min(_contact_at(starts, v), 2.0 * time)) - needed

    slowest = math.sqrt(starts.v0**2 - 2.0 * starts.pull * starts.z0)
    fastest = math.sqrt(starts.v0**2 - 2.0 * (starts.pull + starts.push) * starts.z0)
    needed = starts.J2 * (problem.target - starts.w2) + starts.Mc * time
    low, high = max(plain, peak(slowest)), peak(fastest)
    if low >= high or missing(low) >= 0.0:
        return low
    # rounding: at `high` the contact is the earliest, so that only the plain bound can ask for more
    return float(brentq(missing, low, high, xtol=1e-14 * high)) if missing(high) > 0.0 else low


def _contact_at(starts: PulseCoastHold, v: float) -> float:
    """Earliest contact in s with an impact speed of at most v: pulse, then coast."""
    travel = 0.5 * (v * v - starts.v0**2 + 2.0 * starts.pull * starts.z0) / starts.push
    travel = min(max(travel, 0.0), -starts.z0)
    t1 = fall_time(travel, starts.v0, starts.push + starts.pull)
    v1 = starts.v0 + (starts.push + starts.pull) * t1
    rest = -starts.z0 - travel
    if rest > 0.0 and v1 == 0.0 and starts.pull == 0.0:
        return math.inf
    return t1 + fall_time(rest, v1, starts.pull)


def _reactive(problem: Problem) -> bool:
    return bool(problem.drive.load_kind == "reactive" and problem.drive.Mc > 0.0)


def _straight_up(problem: Problem) -> bool:
    """Whether the twist cannot fall before the first contact."""
    drive = problem.drive
    return bool(
        problem.lowest_torque >= 0.0
        and drive.initial_motor_speed >= drive.initial_load_speed
        and drive.theta0 >= -0.5 * drive.gap
        and not (_reactive(problem) and drive.initial_load_speed < 0.0)
    )


def earliest_pull(problem: Problem) -> float:
    """Earliest instant in s at which the shaft can drive the load (a reactive one at rest: move it).

    >>> from softstart import Drive
    >>> round(earliest_pull(Problem(Drive.load("crane-4amtkf"), 0.5)), 5)
    0.01661
    """
    drive = problem.drive
    z0 = float(drive.theta0 - 0.5 * drive.gap)
    v0 = float(drive.initial_motor_speed - drive.initial_load_speed)
    travel = max(-z0, 0.0)
    if not _straight_up(problem):
        if _reactive(problem) or (drive.contact_law == "dead-zone" and drive.d > 0.0):
            return 0.0
        wound_up = drive.Omega * max(-0.5 * drive.gap - drive.theta0, 0.0)
        U = max(problem.highest_torque, -problem.lowest_torque)
        A = float(U / drive.J1 + drive.Mc / drive.J2)
        return fall_time(travel, math.hypot(v0, wound_up), A)
    at_rest = _reactive(problem) and drive.initial_load_speed == 0.0
    A = float(problem.highest_torque / drive.J1 + (0.0 if at_rest else drive.Mc / drive.J2))
    contact = fall_time(travel, v0, A)
    if not at_rest or drive.d > 0.0:
        return contact
    return contact + _winding_up(problem, max(z0, 0.0), v0 + A * contact if travel > 0.0 else v0)


def _winding_up(problem: Problem, z: float, v: float) -> float:
    """Time in s in which full torque winds the held shaft up from (z, v) to c z = Mc, undamped."""
    drive = problem.drive
    held = drive.Mc / drive.c
    if z >= held:
        return 0.0
    w, mean = math.sqrt(drive.c / drive.J1), problem.highest_torque / drive.c
    radius = math.hypot(z - mean, v / w)
    before = math.atan2(v / w, z - mean)
    after = math.acos(max((held - mean) / radius, -1.0))
    return max(before - after, 0.0) / w


def momentum_shortest_time(problem: Problem) -> float:
    """No start of any kind can end sooner than this, in s, whatever its K_dyn.

    Synchronous and steady, active load: the momentum (J1 + J2) target has to come from the motor, at no more
    than Ms, and the load takes Mc all the time.

    Synchronous and steady, reactive load: a load at rest is a wall off which the motor may bounce. Up to the
    last standstill t_s the energy E of all grows by no more than U |w1| a second (U the largest |u|), so that
    J1 |w1(t_s)| <= sqrt(2 J1 E(0)) + U t_s; from then on Ms - Mc is left of the motor torque. A load that
    moves at first may never stand still: then it is as with an active one.

    Reached, active load: with V the speed of both masses' centre and v = w1 - w2, w2 = V - v J1/(J1 + J2).
    The swing sqrt(v^2 + Omega^2 z^2) (z the overlap) grows by no more than the largest relative acceleration
    A a second, in contact and out of it, damped or not, so that |v| <= swing(0) + A t.

    Always: the shaft has to pull before the load gains speed.

    >>> from softstart import Drive
    >>> round(momentum_shortest_time(Problem(Drive.load("crane-4amtkf").replace(target_speed=60), 0.3)), 4)
    0.2298
    """
    return max(_shortest(problem, machine) for machine in problem.machines)


def _shortest(problem: Problem, machine: Any) -> float:
    drive = two_masses(machine)
    if drive is None:
        return _first_pull(problem, machine)
    problem = replace(problem, drive=drive, base=problem.base or problem.drive, scenarios=())
    if rows_of(machine).machine.release_at > 0.0:
        return earliest_pull(problem)  # the brake may carry more than the motor can
    J1, J2, Mc = float(drive.J1), float(drive.J2), float(drive.Mc)
    w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
    Ms, U = problem.highest_torque, max(problem.highest_torque, -problem.lowest_torque)
    aim = (J1 + J2) * problem.target
    overlap = max(abs(float(drive.theta0)) - 0.5 * float(drive.gap), 0.0)
    first = earliest_pull(problem)
    moving = (aim - J1 * w1 - J2 * w2) / (Ms - Mc)  # the load never stands still
    if not _reactive(problem):
        if problem.terminal != "reached":
            return max(first, moving)
        swing, A = math.hypot(w1 - w2, float(drive.Omega) * overlap), U / J1 + Mc / J2
        return max(first, (aim - J1 * w1 - J2 * w2 - J1 * swing) / (Ms - Mc + J1 * A))
    if problem.terminal == "reached":
        return first  # breaking away on either flank adds to the swing
    energy = 0.5 * (J1 * w1**2 + J2 * w2**2 + float(drive.c) * overlap**2)
    stopping = (aim - math.sqrt(2.0 * J1 * energy)) / U
    return max(first, min(stopping, moving) if w2 > 0.0 else stopping)
