"""The best start within a given time: `optimize`."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from softstart.chain.machines import MachineLike, as_machine, listed_of, quantity_of
from softstart.controller import ready_controller_names
from softstart.drive import Limits
from softstart.drive.limits import Limit
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.kernel import records as rec
from softstart.optimal import pulse_coast_hold, seeds
from softstart.optimal.bounds import least_heat, momentum_bound, momentum_shortest_time
from softstart.optimal.check import check, replayed
from softstart.optimal.descent import APART, MANY, MISSED, MOST_KNOTS, TASTE, Candidate, Descent
from softstart.optimal.problem import USUAL, Objective, Problem, StartTime, Terminal
from softstart.optimal.result import (
    Infeasibility,
    InfeasibleError,
    Kept,
    Method,
    NotConverged,
    Optimum,
    OptimumError,
    Trial,
)
from softstart.optimal.torque_speed import Corners, RigidStart, refuse_weak_curve, rigid_start_time
from softstart.parallel import single_threaded_blas
from softstart.profile import TorqueProfile
from softstart.start.kernel_input import kernel_input
from softstart.start.recommendation import Margin, Row, checked_limits, unchecked_life
from softstart.start.run import Run
from softstart.start.simulation import simulate

RUNGS = (0.8, 0.9)  # of the start time: asked first where one torque serves several machines
FIRST, BESIDE, FINISHED = 4, 2, 2  # first demands followed a few steps, beside a known one, to the end
DAMPED = (0.02, 0.005)  # damping ratios through which an undamped chain is approached
TRIES = 1500  # knots in all starts around one, where one torque serves several machines
ALIKE = 1e-3  # of K_dyn: descents so near to each other lead to the same start
SHORTEST = 1e-4  # of the shortest start time: how exactly it is found
SCAN = 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9  # between its bound and a start: where others are looked for
# under a torque-speed curve no start is looked for that is shorter than that of a rigid drive by more than
SWING, SWUNG = 0.5, 0.2  # so much of a period; so much of its time where the load alone has to be quick
NARROW = 0.1  # between a bound and a start: then no other starts are looked for
EDGE = 1e-6  # of the start time: so much longer than the shortest start
WITHIN = 1e-5  # of the start time, and of a limit that is met
NO_SHARE = 1e-9  # of a limit: its logarithm is taken, as a life falls with a power of the torque
STAYS = 4  # times that one end stays: then the middle is tried
MOST_TRIALS = 32
LONGEST = 100.0  # times what the inertia alone takes: no longer start is looked for
ROUGH = 3e-4  # of K_dyn: how exactly an answer is followed before its knots are refined
TIGHT = 1e-5  # a bound within this share needs no other one
SECONDS = 3.0  # of processor time for the bounds of an answer


@single_threaded_blas
def optimize(
    drive: MachineLike,
    start_time: float | str | None = None,
    *,
    terminal: Terminal | None = None,
    minimise: Objective = "k_dyn",
    k_dyn: float | None = None,
    heat: float | None = None,
    torque_speed: Sequence[Sequence[float]] = (),
    smoothness: float = 0.0,
    base: Machine | None = None,
    scenarios: Iterable[Machine] = (),
    limits: bool = False,
    confirm: bool = False,
    near: Optimum | TorqueProfile | None = None,
) -> Optimum:
    """Find the torque over time that starts a machine most gently within a given time, and bound how gently.

    Where the closed form (pulse, coast, hold) holds it is the optimum. Else successive linear programs on the
    exact start lead to a local optimum, from the closed form of each start, the gentlest of a few hundred
    pulses, and the strategies. The figures are those of the exact machine running the profile; the bound says
    how much better any other start could be. One torque serves all `scenarios`, and all start positions of a
    machine whose position is unknown: the largest K_dyn counts.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        The machine, or the name or file of one.
    start_time : float or str, optional
        Bound on t_f: in s, with a unit ("300 ms"), or as a multiple of the start time of `direct`
        ("1.2x"; under a torque-speed curve of that of a rigid drive, if it is longer). By default 1.2x, and
        `why` says so; none where the start time is minimised.
    terminal : {"synchronous", "steady", "reached"}, optional
        What holds at t_f: all masses have the target speed; also every shaft the torque that it carries then;
        or only the load has its speed. By default synchronous for two masses, where it is possible in that
        time; reached for chains, and always where one torque serves several starts.
    minimise : {"k_dyn", "heat", "start_time"}
        `heat` is the integral of (u/Ms)^2 from 0 to t_f, s. The least start time is the first at which the
        gentlest start has the K_dyn allowed; `kept` has its lower bound.
    k_dyn, heat : float, optional
        Bounds on those that are not minimised (1, s).
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor torque over the motor speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2; makes the torque continuous.
    base : Drive or Chain, optional
        To whose mean shaft torque K_dyn refers, if not `drive`.
    scenarios : iterable of Drive or Chain
        Other machines that the same torque serves, as `scenarios_of` makes them.
    limits : bool
        Find instead the least start time at which the gentlest start keeps the limits of the machine: the
        permissible shaft torque and the life. `kept` has the margin to each limit.
    confirm : bool
        Also solve the CasADi problem from its own first guess, in the order of contacts of the answer;
        `tried` has both answers, and the better one is returned.
    near : Optimum or TorqueProfile, optional
        The answer to a similar question, one more first demand; the optima of each machine by itself
        (`alone`) are then left out.

    Returns
    -------
    Optimum
        Profile, exact runs, figures and lower bound.

    Raises
    ------
    InputError
        For bad input.
    InfeasibleError
        Where no start is that quick, with the shortest start time that was found.
    OptimumError
        If no start was found, or an answer does not stand up to the exact machine.

    Examples
    --------
    >>> from softstart import Drive, optimize
    >>> best = optimize(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> round(best.k_dyn, 6), best.method, best.bound.kind
    (0.909247, 'closed-form', 'momentum')

    References
    ----------
    HiGHS: Huangfu and Hall, Math. Prog. Comp. 10 (2018), doi 10.1007/s12532-017-0130-5. IPOPT: Waechter and
    Biegler, Math. Prog. 106 (2006), doi 10.1007/s10107-004-0559-y. CasADi: Andersson et al., Math. Prog.
    Comp. 11 (2019), doi 10.1007/s12532-018-0139-4.
    """
    machine = as_machine(drive)
    usual = start_time is None and minimise != "start_time" and not limits
    asked_for = USUAL if usual else None if start_time is None else StartTime.of(start_time)
    corners = tuple((float(speed), float(torque)) for speed, torque in torque_speed)
    some = None if asked_for is None and not limits else 1.0  # any: what is wrong with the rest is said first
    problem = Problem(
        machine, some, terminal, minimise, k_dyn, heat, corners, smoothness, base, tuple(scenarios)
    )
    refuse_weak_curve(problem)
    if confirm and len(problem.machines) > 1:
        raise InputError("confirm: the CasADi problem is for one start; give one position and no scenarios.")
    if confirm and minimise == "start_time":
        raise InputError("confirm: the CasADi problem is solved for a given start time; leave it out.")
    known = near.profile if isinstance(near, Optimum) else near
    if limits:
        given = {"start_time": start_time, "k_dyn": k_dyn, "confirm": confirm or None}
        given["minimise"] = None if minimise == "k_dyn" else minimise
        if wrong := [name for name, value in given.items() if value is not None]:
            raise InputError(
                [f"{name}: limits asks for the least start time; leave this out." for name in wrong]
            )
        return _within_limits(problem, known)
    if asked_for is not None:
        end = asked_for.seconds(lambda: start_time_of_direct(machine, corners))
        problem = replace(problem, start_time=end)
    why = f"; no start time given: {asked_for} that of direct" if usual else ""
    try:
        best = solve(problem, known, confirm)
    except InfeasibleError:
        if not usual or terminal is not None or problem.terminal == "reached":
            raise
        best = solve(replace(problem, terminal="reached"), known, confirm)
        why += ", in which only the load can have the target speed"
    asked = len(problem.machines) > 1 and near is None and problem.start_time is not None
    alone = _alone(best.problem) if asked else {}
    return replace(best, why=best.why + why, alone=alone)


@single_threaded_blas
def solve(
    problem: Problem, near: TorqueProfile | None = None, confirm: bool = False, follow: float = 0.0
) -> Optimum:
    """The optimum of a problem; see `optimize`.

    Where `near` is the answer for a start time close by, `follow` in s, and a start is found from it, no
    other first demand is tried.
    """
    began = time.perf_counter()
    if problem.minimise == "start_time":
        return _least_start_time(problem, near, began)
    assert problem.start_time is not None
    if problem.start_time < momentum_shortest_time(problem):
        raise _too_short(problem, shortest_start_time(problem))
    refuse_weak_curve(problem)
    best = _by_formula(problem, began)
    if best is None and near is not None and follow:
        best = _followed(problem, near, problem.start_time / follow, began)
    best = best or _by_descent(problem, near, began)
    if confirm:
        best = _confirmed(best)
    return replace(best, seconds=time.perf_counter() - began)


def _by_formula(problem: Problem, began: float) -> Optimum | None:
    if pulse_coast_hold.applies(problem):
        return None
    try:
        profile, end, k_dyn = pulse_coast_hold.solve_pulse_coast_hold(problem)
    except pulse_coast_hold.NotApplicable:
        return None
    return _checked(problem, profile, end, k_dyn, "closed-form", "pulse, coast, hold is optimal here", began)


def _by_descent(problem: Problem, near: TorqueProfile | None, began: float) -> Optimum:
    assert problem.start_time is not None
    found = None if problem.start_time < _hardly_shorter(problem) else searched(problem, near)
    if found is None or found[1].missed > MISSED:
        found = _sooner(problem)
    return _answer(problem, *found, began)


def _followed(problem: Problem, near: TorqueProfile, scale: float, began: float) -> Optimum | None:
    """The local optimum below the answer for a start time close by, as it is or scaled in time, if any."""
    search, firsts = Descent(problem), []
    search.apart = APART
    for share in (1.0, scale):
        demand = TorqueProfile(near.time * share, near.torque)
        start = search.play(search.onto(demand), search.latest)
        firsts += [] if start is None else [(start.merit, share, demand)]
    for *_, demand in sorted(firsts, key=lambda one: one[:2])[:1]:
        found = search.down(demand, search.latest, least=ROUGH)
        found = None if found is None else search.finished(search.refined(found, 1))
        if found is not None and found.missed <= MISSED:
            profile = TorqueProfile(search.time, found.torques).simplified()
            with suppress(OptimumError):
                return _answer(problem, "the answer for the next start time", found, profile, began)
    return None


def _answer(problem: Problem, name: str, best: Candidate, profile: TorqueProfile, began: float) -> Optimum:
    claimed = {"k_dyn": best.peak / problem.base_torque, "heat": best.heat}[problem.minimise]
    why = f"successive linear programs on the exact start, from {name}"
    return _checked(problem, profile, best.end, claimed, "descent", why, began)


def _sooner(problem: Problem) -> tuple[str, Candidate, TorqueProfile]:
    """A start from the shortest one found, where none was from others; the refusal if that takes longer."""
    shortest = _shortest(problem)
    assert problem.start_time is not None
    if shortest is None or shortest[0] > problem.start_time:
        raise _too_short(problem, math.inf if shortest is None else shortest[0])
    end = min(shortest[0] * (1.0 + EDGE), problem.start_time)
    return _at_the_edge(replace(problem, start_time=end), shortest[1])


def _at_the_edge(problem: Problem, demand: TorqueProfile) -> tuple[str, Candidate, TorqueProfile]:
    """The gentlest start in the shortest time, in which a demand ends; else that of the demand itself."""
    assert problem.start_time is not None
    search = Descent(problem)
    found = None if _too_long(search) else searched(problem, demand)
    if found is None or found[1].missed > MISSED:
        search.apart = APART
        start = search.into(demand, problem.start_time)
        start = None if start is None else search.finished(start)
        if start is not None:
            found = "", start, TorqueProfile(search.time, start.torques).simplified()
    if found is None or found[1].missed > MISSED:
        raise OptimumError(
            f"No start of {problem.drive.name} within {problem.start_time:.6g} s was found that keeps all "
            "bounds, though one exists; ask for more time."
        )
    return "the shortest start found", *found[1:]


def _too_long(search: Descent) -> bool:
    """Whether a descent takes minutes and ends worse than it began: many knots under a torque-speed curve."""
    return bool(search.problem.torque_speed) and search.even.size > MANY


def searched(
    problem: Problem, near: TorqueProfile | None = None, quick: bool = False
) -> tuple[str, Candidate, TorqueProfile] | None:
    """The best start by descents, the name of its first demand, and its profile; None if there was none.

    Where one torque serves several machines there are many local optima: a start of a shorter time is found
    first, and others are looked for around each.
    """
    search = Descent(problem)
    several = len(problem.machines) > 1
    long = several and search.even.size > MANY
    if near is None and not quick and not long:
        for like in _easier(problem):
            known = searched(like, near, quick=True)
            near = near if known is None or known[1].missed > MISSED else known[2]
    firsts = _first_demands(search, near)
    if problem.terminal != "reached":  # begin with an easier end
        easier = Descent(replace(problem, terminal="reached"), search.players)
        direct = firsts if problem.terminal == "steady" else firsts[:FINISHED]
        firsts = [*_tasted(easier, firsts)[:FINISHED], *direct]
    done, merits = [], list[float]()
    for name, demand in _tasted(search, firsts)[: 1 if long else FINISHED]:
        found = search.down(demand, search.latest)
        if found is None or any(abs(found.merit - one) < ALIKE * one for one in merits):
            continue
        merits.append(found.merit)
        if several and len(merits) == 1 and found.missed <= MISSED:
            found = search.around(found, max(TRIES // search.even.size, 4))
        found = found if quick else search.finished(search.refined(found))
        if found is not None:
            done.append((name, found, TorqueProfile(search.time, found.torques).simplified()))
    return min(done, key=lambda one: (one[1].missed > MISSED, one[1].objective), default=None)


def _easier(problem: Problem) -> Iterator[Problem]:
    """Problems whose answers lead to a good one of this: shorter starts of several machines, damped chains.

    From strategies an undamped chain comes to poor local optima, and one torque for several machines often.
    """
    assert problem.start_time is not None
    shafts = kernel_input(problem.machines[0]).shafts[0].view(rec.SHAFT)[:, 0]
    if len(problem.machines) > 1:
        for share in RUNGS:
            shorter = replace(problem, start_time=share * problem.start_time)
            if share * problem.start_time > momentum_shortest_time(shorter):
                yield shorter
    elif shafts.size > 1 and not shafts["d"].any():
        base = problem.base or problem.drive
        for ratio in DAMPED:
            yield replace(problem, drive=problem.drive.with_damping_ratio(ratio), base=base)


def _tasted(search: Descent, firsts: list[tuple[str, TorqueProfile]]) -> list[tuple[str, TorqueProfile]]:
    """First demands after a few steps, the best first; of those that are alike one."""
    after: list[tuple[float, str, TorqueProfile]] = []
    for name, demand in firsts:
        found = search.down(demand, search.latest, TASTE, 1e-3)
        if found is not None:
            after.append((found.merit, name, TorqueProfile(search.time, found.torques)))
    after.sort(key=lambda one: one[0])
    apart = [b for a, b in itertools.pairwise([(0.0, "", None), *after]) if b[0] > a[0] * (1.0 + 1e-4)]
    return [(name, demand) for _, name, demand in apart if demand is not None]


def _first_demands(search: Descent, near: TorqueProfile | None) -> list[tuple[str, TorqueProfile]]:
    """The answer to a similar question; then, the gentlest first, closed forms, pulses and strategies."""
    first = [] if near is None else [("the answer to a similar question", near)]
    own = [("pulse, coast, level", one) for one in seeds.pulse_coast_level(search)[:FINISHED]]
    for player in search.players:
        formula = seeds.pulse_coast_hold(search, player)
        own += [] if formula is None else [("pulse, coast, hold", formula)]
        own += [
            (name, one) for name in ready_controller_names() if (one := seeds.trace(search, player, name))
        ]
    found: list[tuple[float, str, TorqueProfile]] = []
    for name, demand in own:
        start = search.play(search.onto(demand), search.latest)
        found += [] if start is None else [(start.merit, name, demand)]
    found.sort(key=lambda one: one[0])
    many = (FIRST if near is None else BESIDE) + 2 * (len(search.players) - 1)
    return [*first, *[(name, demand) for _, name, demand in found[:many]]]


def _checked(
    problem: Problem, profile: TorqueProfile, end: float, claimed: float, method: Method, why: str,
    began: float,
) -> Optimum:  # fmt: skip
    """An answer that has passed the exact machine, with its bound."""
    runs = replayed(problem, profile, end)
    if problem.terminal == "reached":
        end = max(run.start_time for run in runs)
    bound = momentum_bound(
        problem if problem.start_time else replace(problem, start_time=end, minimise="k_dyn")
    )
    k_dyn = max(run.peak_torque for run in runs) / problem.base_torque
    once = None
    if problem.minimise == "k_dyn" and k_dyn > bound.k_dyn * (1.0 + TIGHT):
        from softstart.optimal.duality import dual_bounds

        bound, once = dual_bounds(problem, k_dyn, seconds=SECONDS)
    check(problem, profile, runs, end, claimed, bound)
    least = least_heat(problem) if problem.minimise == "heat" else 0.0
    seconds = time.perf_counter() - began
    return Optimum(
        problem, profile, runs, bound, method, why, claimed, end, seconds, heat_at_least=least,
        tried=(Trial(method, claimed, seconds, ""),), bound_once=once,
    )  # fmt: skip


def _alone(problem: Problem) -> dict[str, Optimum]:
    """The optimum of each machine by itself, of equal ones once."""
    names = dict[Machine, str]()
    for number, each in enumerate((problem.drive, *problem.scenarios), start=1):
        scenario = f"scenario {number}" if problem.scenarios else ""
        for place, machine in each.positions.items():
            names.setdefault(machine, f"{scenario} {place if len(each.positions) > 1 else ''}".strip())
    found = {}
    for machine, name in names.items():
        one = replace(problem, drive=machine, base=problem.base or problem.drive, scenarios=())
        with suppress(InfeasibleError, OptimumError, SimulationError):
            found[name] = _by_formula(one, time.perf_counter()) or _by_descent(one, None, time.perf_counter())
    return found


def _confirmed(best: Optimum) -> Optimum:
    """The better of an answer and that of the CasADi problem, which has only its order of contacts."""
    from softstart.optimal import statement

    problem, began = best.problem, time.perf_counter()
    try:
        claim = statement.solve_collocation(problem, whole_run(best), straight=True)
        search = Descent(problem)
        torques = search.onto(claim.profile)
        found = search.play(torques, min(claim.end_time, search.latest))
        found = None if found is None else search.finished(found)
        if found is None:
            raise OptimumError("its demand could not be simulated.")
        profile = TorqueProfile(search.time, found.torques).simplified()
        value = {"k_dyn": found.peak / search.base, "heat": found.heat}[problem.minimise]
        other = _checked(
            problem, profile, found.end, value, "collocation", f"gentler than {best.method}", began
        )
    except (InputError, NotConverged, OptimumError) as failed:
        trial = Trial("collocation", None, time.perf_counter() - began, str(failed))
        return replace(best, tried=(*best.tried, trial))
    tried = (*best.tried, Trial("collocation", claim.value, time.perf_counter() - began, ""))
    return replace(other if other.minimised < best.minimised else best, tried=tried)


def whole_run(best: Optimum) -> Run:
    """The run of an answer to one elastic period after the time allowed, though it may arrive early."""
    problem = best.problem
    until = (problem.start_time or best.end_time) + best.run.elastic_period
    return simulate(problem.drive, best.run.controller, until, base=problem.base or problem.drive)


# the shortest start ----------------------------------------------------------------------------------------


def start_time_of_direct(machine: Machine, torque_speed: Corners = ()) -> float:
    """Start time under the constant starting torque, s. Raises SimulationError where there is none.

    Under a torque-speed curve that of a rigid drive, if it is longer: the motor does not have that torque.

    >>> from softstart import Drive
    >>> round(start_time_of_direct(Drive.load("crane-4amtkf")), 4)
    0.3735
    """
    run = simulate(machine, "direct")
    if math.isnan(run.start_time):
        raise SimulationError(
            f"direct does not bring this load to its target speed ({run.status.value[:-1]}); "
            "give start times in s instead of multiples."
        )
    if not torque_speed:
        return float(run.start_time)
    refuse_weak_curve(Problem(machine, 1.0, torque_speed=torque_speed))
    return max(float(run.start_time), RigidStart(machine, torque_speed).time)


def shortest_start_time(problem: Problem) -> float:
    """The shortest t_f in s that was found, whatever its K_dyn; infinite if none was.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(gap=0.0, target_speed=20.0)
    >>> round(shortest_start_time(Problem(drive, 0.3, "reached")), 4)
    0.0804
    """
    found = _shortest(problem)
    return math.inf if found is None else found[0]


def _hardly_shorter(problem: Problem) -> float:
    """A time in s below which no start under a torque-speed curve is looked for; 0 without one."""
    rigid = rigid_start_time(problem)
    if problem.terminal == "reached":
        return (1.0 - SWUNG) * rigid
    return rigid - SWING * max(float(machine.elastic_period) for machine in problem.machines)


def _shortest(problem: Problem, near: TorqueProfile | None = None) -> tuple[float, TorqueProfile] | None:
    """The shortest t_f in s within which a start was found, by halving, and that start."""
    refuse_weak_curve(problem)
    low, rigid = max(momentum_shortest_time(problem), _hardly_shorter(problem)), rigid_start_time(problem)
    period = max(float(machine.elastic_period) for machine in problem.machines)
    longest = LONGEST * (low + period)
    high = max(low, rigid) + 0.2 * period
    with suppress(SimulationError):
        high = max(high, *(start_time_of_direct(one) for one in problem.machines))
    timed = replace(problem, minimise="k_dyn", k_dyn=None, start_time=1.0)
    demand = None
    while demand is None:
        found = searched(replace(timed, start_time=high), near, quick=True)
        if found is not None and found[1].missed <= MISSED:
            demand = found[2]
        else:
            low, high = high, 1.3 * high + 0.1 * period
            if high > longest:
                return None
    scan = SCAN if low < (1.0 - NARROW) * high else ()  # starts unlike that one may be shorter
    for middle in (low + share * (high - low) for share in scan):
        found = searched(replace(timed, start_time=middle), quick=True)
        if found is not None and found[1].missed <= MISSED:
            high, demand = middle, found[2]
            break
    while high - low > SHORTEST * high:
        middle = 0.5 * (low + high)
        search = Descent(replace(timed, start_time=middle))
        search.apart = APART if demand.time.size > MOST_KNOTS else search.apart  # else knots add up
        tried = search.into(demand, middle)
        if tried is not None and tried.missed <= MISSED:
            high, demand = middle, TorqueProfile(search.time, tried.torques)
        else:
            low = middle
    return high, demand


def _too_short(problem: Problem, shortest: float) -> InfeasibleError:
    assert problem.start_time is not None
    proved = problem.start_time < momentum_shortest_time(problem)
    known = "none was found" if math.isinf(shortest) else f"the shortest start found takes {shortest:.6g} s"
    bounds = "" if problem.heat is None else f" and a heat of {problem.heat:g} s"
    sentence = (
        f"No torque {'' if proved else 'was found that '}brings {problem.drive.name} to {problem.target:g} "
        f"rad/s ({problem.terminal}) within {problem.start_time:.6g} s{bounds}; {known}."
    )
    return InfeasibleError(Infeasibility(problem, shortest, sentence))


def _least_start_time(problem: Problem, near: TorqueProfile | None, began: float) -> Optimum:
    """The first start time whose gentlest start has the K_dyn allowed; the shortest one if any has."""
    if problem.k_dyn is None:
        found = _shortest(problem, near)
        if found is None:
            sentence = f"start_time: no start of {problem.drive.name} to {problem.target:g} rad/s was found."
            raise InfeasibleError(Infeasibility(problem, math.inf, sentence))
        for edge in (EDGE, 10.0 * EDGE, SHORTEST):  # at the very edge no descent may end well
            timed = replace(problem, minimise="k_dyn", start_time=found[0] * (1.0 + edge))
            with suppress(OptimumError):
                best = _answer(timed, *_at_the_edge(timed, found[1]), began)
                break
        else:
            raise OptimumError(f"No start near the shortest found, {found[0]:.6g} s, keeps all bounds.")
        gentle = "" if _too_long(Descent(timed)) else ", the gentlest of these"
        why = f"the shortest start found{gentle}; {best.why}"
        best = replace(best, problem=problem, why=why)
        return replace(best, kept=_kept(best, Limits(), momentum_shortest_time(problem)))
    bound = Limit("K_dyn", "1", "k_dyn", problem.k_dyn)

    def margins(best: Optimum) -> tuple[Margin, ...]:
        return (Margin(bound, best.k_dyn, ""),)

    best, at_least, refused = _first_that_keeps(problem, margins, problem.k_dyn)
    best = replace(best, problem=problem, claimed=best.end_time)
    kept = _kept(best, Limits(), at_least, refused, margins(best))
    return replace(best, kept=kept, seconds=time.perf_counter() - began)


def _within_limits(problem: Problem, near: TorqueProfile | None) -> Optimum:
    """The first start time whose gentlest start keeps the permissible shaft torque and the life."""
    began = time.perf_counter()
    limits = checked_limits(problem.drive)
    if limits.shaft_torque is None and limits.life is None:
        raise InputError(
            f"limits: {problem.drive.name or 'the drive'} has no permissible shaft torque; give "
            "limits.shaft_torque, or a life with [limits.fatigue]."
        )
    timeless = replace(limits, start_time=None)

    def margins(best: Optimum) -> tuple[Margin, ...]:
        return tuple(one for run in best.runs for one in Row(run, None, worst_case=()).margins(timeless))

    most = math.inf if limits.shaft_torque is None else limits.shaft_torque / problem.base_torque
    best, at_least, refused = _first_that_keeps(problem, margins, most)
    kept = _kept(best, limits, at_least, refused)
    return replace(best, kept=kept, seconds=time.perf_counter() - began)


def _first_that_keeps(
    problem: Problem, margins: Callable[[Optimum], tuple[Margin, ...]], most: float
) -> tuple[Optimum, float, Margin | None]:
    """The first start that keeps its limits, among the gentlest of each start time.

    K_dyn of the gentlest start falls with the start time: regula falsi with the Illinois rule (M. Dowell,
    P. Jarratt, BIT 11 (1971) 168-174, doi:10.1007/BF01934364), which halves the value of an end that stays,
    over the logarithm of the share of the limit; where an end stays too long, the middle. A life may be kept
    by a start that is not the gentlest: then the one that keeps it is followed to shorter times.

    Also the time before which no start has a K_dyn of `most` or less, by momentum, and by what the next
    quicker start exceeds its limits; None if there is no such start.
    """

    def share_left(best: Optimum) -> tuple[float, Margin | None]:
        return min(((one.share, one) for one in margins(best)), key=lambda pair: pair[0], default=(1.0, None))

    timed = replace(problem, minimise="k_dyn", k_dyn=None, start_time=1.0)
    soonest = _soonest(timed, most)
    low, high, end = 0.0, math.inf, soonest * (1.0 + WITHIN)
    f_low, f_high, found, near, stays, refused = math.inf, -math.inf, None, None, 0, None
    for _ in range(MOST_TRIALS):
        try:
            best = solve(replace(timed, start_time=end), near)
        except OptimumError:  # of two that are near to each other one is found
            end *= 1.0 + 3.0 * WITHIN
            continue
        except InfeasibleError as none:
            if math.isinf(none.verdict.shortest_start_time):
                raise
            low, f_low, refused = max(end, none.verdict.shortest_start_time), math.inf, None
            end = low * (1.0 + EDGE) if math.isinf(high) else 0.5 * (low + high)
            continue
        left, tight = share_left(best)
        if found is not None and left < 0.0 and tight is not None and tight.of.figure == "used_life":
            other = _followed(best.problem, found.profile, end / found.end_time, time.perf_counter())
            best = best if other is None else max(best, other, key=lambda one: share_left(one)[0])
            left, tight = share_left(best)
        near, over = best.profile, math.log(max(1.0 - left, NO_SHARE))
        if over <= 0.0:
            f_low *= 0.5 if stays > 0 else 1.0
            found, high, f_high, stays = best, end, over, max(stays, 0) + 1
            if over > -WITHIN:
                break
        else:
            f_high *= 0.5 if stays < 0 and found is not None else 1.0
            low, f_low, stays, refused = end, over, min(stays, 0) - 1, tight
        if high - low <= WITHIN * end or (end <= soonest * (1.0 + 2.0 * WITHIN) < end and over <= 0.0):
            break
        if math.isinf(high):
            end *= 1.0 + min(max(over, 0.02), 1.0)
        elif math.isfinite(f_low) and abs(stays) < STAYS:
            end = low + (high - low) * min(max(f_low / (f_low - f_high), 0.02), 0.98)
        else:
            end = 0.5 * (low + high)
    if found is None:
        name = problem.drive.name
        sentence = f"limits: no start of {name} that keeps them was found up to {end:.4g} s."
        raise InfeasibleError(Infeasibility(problem, math.inf, sentence))
    return found, soonest, refused


def _soonest(problem: Problem, most: float) -> float:
    """No start has a K_dyn of `most` or less in less time, s, by momentum."""
    low = max(momentum_shortest_time(problem), 1e-3 * float(problem.machines[0].elastic_period))

    def too_hard(end: float) -> bool:
        return momentum_bound(replace(problem, start_time=end)).k_dyn > most

    if not too_hard(low):
        return low
    high = 2.0 * low
    while too_hard(high):
        if high > 1e4 * low:
            least = momentum_bound(replace(problem, start_time=high)).k_dyn
            sentence = (
                f"limits: no start of {problem.drive.name} has a K_dyn below {least:.4g} within {high:.4g} s."
            )
            raise InfeasibleError(Infeasibility(problem, math.inf, sentence))
        high *= 2.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_hard(middle) else (low, middle)
    return high


def _kept(
    best: Optimum, limits: Limits, at_least: float, refused: Margin | None = None, more: Sequence[Margin] = ()
) -> Kept:
    margins = (*Row(best.run, None, worst_case=()).margins(limits), *more)
    unchecked = unchecked_life(best.problem.drive) if limits.shaft_torque or limits.life else ""
    return Kept(margins, at_least, unchecked, refused)


# several machines ------------------------------------------------------------------------------------------


def scenarios_of(
    drive: Machine,
    *,
    gaps: Iterable[float | str] = (),
    inertias: Iterable[float | str] = (),
    load_torques: Iterable[float | str] = (),
) -> tuple[Machine, ...]:
    """The full grid of a machine's gaps, load inertias and load torques.

    Parameters
    ----------
    drive : Drive or Chain
        The machine; it comes first, also where it is not on the grid, since K_dyn refers to it.
    gaps : iterable of float or str
        Gaps, rad, or texts with a unit, as "9 arcmin at output"; the machine's own where the list is left
        out, as of the others.
    inertias : iterable of float or str
        Load inertias, kg m2.
    load_torques : iterable of float or str
        Load torques, N m.

    Returns
    -------
    tuple of Drive or Chain
        Each once.

    Raises
    ------
    InputError
        For values that no machine can have.

    Examples
    --------
    >>> from softstart import Drive, scenarios_of
    >>> nominal = Drive.load("crane-4amtkf")
    >>> [s.gap for s in scenarios_of(nominal, gaps=[0.3, 0.5, 1.0])]
    [0.5, 0.3, 1.0]
    >>> len(scenarios_of(nominal, gaps=[0.3, 1.0], inertias=[0.07, 0.175]))
    5
    """
    drive = as_machine(drive)
    given = {"gap": gaps, "load_inertia": inertias, "load_torque": load_torques}
    names = dict(zip(given, ("gaps", "inertias", "load_torques"), strict=True))
    axes = {key: _values(drive, key, names[key], values) for key, values in given.items()}
    used = {name: values for name, values in axes.items() if values}
    grid = [
        drive.with_values(dict(zip(used, each, strict=True))) for each in itertools.product(*used.values())
    ]
    return tuple(dict.fromkeys((drive, *(grid if used else ()))))


def _values(drive: Machine, key: str, name: str, given: Iterable[float | str]) -> list[float]:
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        raise InputError(f"{name} = {given!r}: give a list of numbers in SI units, or of texts with a unit.")
    return list(dict.fromkeys(quantity_of(drive, key, one, name) for one in listed_of(given, name)))
