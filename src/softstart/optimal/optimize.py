"""The best start within a given time: `optimize`."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

from softstart.chain.machines import MachineLike, as_machine, listed_of, quantity_of
from softstart.drive import Limits
from softstart.drive.limits import Limit
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.optimal import pulse_coast_hold
from softstart.optimal.bounds import least_heat, momentum_bound, momentum_shortest_time
from softstart.optimal.check import check, replayed
from softstart.optimal.descent import Descent
from softstart.optimal.path import EDGE, Path
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
from softstart.optimal.search import Found
from softstart.optimal.torque_speed import Corners, RigidStart, refuse_weak_curve
from softstart.parallel import single_threaded_blas
from softstart.profile import TorqueProfile
from softstart.start.recommendation import Margin, Row, checked_limits, unchecked_life
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.views.numbers import units_of

WITHIN = 1e-5  # of the start time, and of a limit that is met
TIGHT = 1e-5  # a bound within this share needs no other one
TINY = 1e-7  # of the start time: by so much longer than its bound the closed form is tried
LONGEST = 100.0  # times the shortest start within the permissible torque: none longer is looked for
SUCCESSIVE = "successive linear programs on the exact start"

Progress = Callable[[str], object]


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
    bounds: bool = False,
    near: Optimum | TorqueProfile | None = None,
    progress: Progress | None = None,
) -> Optimum:
    """Find the torque over time that starts a machine most gently within a given time, and bound how gently.

    Where the closed form (pulse, coast, hold) holds it is the optimum. Else successive linear programs on the
    exact start lead to a local optimum, from the closed form of each start, the gentlest of a few hundred
    pulses, and starts known at other times. The figures are those of the exact machine running the profile;
    the bound says how much better any other start could be. One torque serves all `scenarios`, and all start
    positions of a machine whose position is unknown: the largest K_dyn counts.

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
    bounds : bool
        Also compute tight lower bounds on K_dyn, in some 10 s of processor time: for any number of contacts,
        and for starts whose gap closes once (`bound_once`). Without it the bound is that of momentum.
    near : Optimum or TorqueProfile, optional
        The answer to a similar question, one more first demand; the optima of each machine by itself
        (`alone`) are then left out.
    progress : callable, optional
        Called with a text as the work goes on: with the optimum of each start position as soon as it is
        known, then on the way to the one torque that serves all.

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
    began, machine = time.perf_counter(), as_machine(drive)
    usual = start_time is None and minimise != "start_time" and not limits
    asked_for = USUAL if usual else None if start_time is None else StartTime.of(start_time)
    some = None if asked_for is None and not limits else 1.0  # any: what is wrong with the rest is said first
    problem = Problem(
        machine, some, terminal, minimise, k_dyn, heat, torque_speed, smoothness, base, tuple(scenarios)
    )
    refuse_weak_curve(problem)
    if confirm and len(problem.machines) > 1:
        raise InputError("confirm: the CasADi problem is for one start; give one position and no scenarios.")
    if confirm and minimise == "start_time":
        raise InputError("confirm: the CasADi problem is solved for a given start time; leave it out.")
    if bounds and (limits or minimise != "k_dyn"):
        raise InputError("bounds: they are lower bounds on the K_dyn of a start time; leave it out here.")
    known = near.profile if isinstance(near, Optimum) else near
    if limits:
        given = {"start_time": start_time, "k_dyn": k_dyn, "confirm": confirm or None}
        given["minimise"] = None if minimise == "k_dyn" else minimise
        if wrong := [name for name, value in given.items() if value is not None]:
            raise InputError(
                [f"{name}: limits asks for the least start time; leave this out." for name in wrong]
            )
        return replace(_within_limits(problem), seconds=time.perf_counter() - began)
    if asked_for is not None:
        end = asked_for.seconds(lambda: start_time_of_direct(machine, problem.torque_speed))
        problem = replace(problem, start_time=end)
    tell = progress or (lambda doing: None)
    asked = len(problem.machines) > 1 and near is None and problem.start_time is not None
    alone = _alone(problem, tell) if asked else {}
    why = f"; no start time given: {asked_for} that of direct" if usual else ""
    try:
        best = solve(problem, known, Path(problem, tell))
    except InfeasibleError:
        if not usual or terminal is not None or problem.terminal == "reached":
            raise
        best = solve(replace(problem, terminal="reached"), known)
        why += ", in which only the load can have the target speed"
    if confirm:
        best = _confirmed(best)
    if bounds:
        best = _bounded(best)
    return replace(best, why=best.why + why, alone=alone, seconds=time.perf_counter() - began)


@single_threaded_blas
def solve(problem: Problem, near: TorqueProfile | None = None, path: Path | None = None) -> Optimum:
    """The optimum of a problem; see `optimize`. `path` has the starts that are known at other times."""
    began = time.perf_counter()
    refuse_weak_curve(problem)
    shortest = problem.minimise == "start_time"
    best = _least_start_time(problem) if shortest else _in_time(problem, near, path or Path(problem))
    return replace(best, seconds=time.perf_counter() - began)


def _in_time(problem: Problem, near: TorqueProfile | None, path: Path) -> Optimum:
    """The optimum within a start time."""
    assert problem.start_time is not None
    if problem.start_time < momentum_shortest_time(problem):
        raise _too_short(problem, path)
    if best := _by_formula(problem):
        return best
    if found := path.at(problem.start_time, near):
        return _answer(problem, found)
    raise _too_short(problem, path)


def _by_formula(problem: Problem) -> Optimum | None:
    try:
        profile, end, k_dyn = pulse_coast_hold.solve_pulse_coast_hold(problem)
    except pulse_coast_hold.NotApplicable:
        return None
    return _checked(problem, profile, end, k_dyn, "closed-form", "pulse, coast, hold is optimal here")


def _answer(problem: Problem, found: Found, why: str = SUCCESSIVE, method: Method = "descent") -> Optimum:
    claimed = {"k_dyn": found.peak / problem.base_torque, "heat": found.heat, "start_time": found.end}
    return _checked(problem, found.profile, found.end, claimed[problem.minimise], method, why)


def _checked(
    problem: Problem, profile: TorqueProfile, end: float, claimed: float, method: Method, why: str
) -> Optimum:
    """An answer that has passed the exact machine, with its bound."""
    runs = replayed(problem, profile, end)
    bound = momentum_bound(
        problem if problem.start_time else replace(problem, start_time=end, minimise="k_dyn", k_dyn=None)
    )
    check(problem, profile, runs, end, claimed, bound)
    least = least_heat(problem) if problem.minimise == "heat" else 0.0
    return Optimum(
        problem, profile, runs, bound, method, why, claimed, end, heat_at_least=least,
        tried=(Trial(method, claimed),),
    )  # fmt: skip


def _bounded(best: Optimum) -> Optimum:
    """The same with the lower bounds of weak duality, where that of momentum is low."""
    from softstart.optimal.duality import dual_bounds

    if best.problem.minimise != "k_dyn" or best.k_dyn <= best.bound.k_dyn * (1.0 + TIGHT):
        return best
    bound, once = dual_bounds(best.problem, best.k_dyn)
    check(best.problem, best.profile, best.runs, best.end_time, best.claimed, bound)
    return replace(best, bound=bound, bound_once=once)


def _alone(problem: Problem, tell: Progress) -> dict[str, Optimum]:
    """The optimum of each machine by itself, of equal ones once."""
    names = dict[Machine, str]()
    for number, each in enumerate((problem.drive, *problem.scenarios), start=1):
        scenario = f"scenario {number}" if problem.scenarios else ""
        for place, machine in each.positions.items():
            names.setdefault(machine, f"{scenario} {place if len(each.positions) > 1 else ''}".strip())
    found = {}
    for machine, name in names.items():
        one = replace(problem, drive=machine, base=problem.base or problem.drive, scenarios=())
        with suppress(SimulationError):
            found[name] = solve(one)
            tell(f"{name} alone: K_dyn {found[name].k_dyn:.4g}")
    return found


def _confirmed(best: Optimum) -> Optimum:
    """The better of an answer and that of the CasADi problem, which has only its order of contacts."""
    from softstart.optimal import statement

    problem = best.problem
    assert problem.start_time is not None
    try:
        claim = statement.solve_collocation(problem, whole_run(best), straight=True)
        search = Descent(problem, problem.start_time)
        found = search.play(search.onto(claim.profile), min(claim.end_time, search.latest))
        found = found and search.finished(found)
        if found is None:
            raise OptimumError("its demand could not be simulated.")
        other = _answer(problem, found, f"gentler than {best.method}", "collocation")
    except (InputError, NotConverged, OptimumError) as failed:
        return replace(best, tried=(*best.tried, Trial("collocation", None, str(failed))))
    tried = (*best.tried, Trial("collocation", claim.value))
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
    refuse_weak_curve(problem)
    found = Path(problem).shortest
    return math.inf if found is None else found.end


def _too_short(problem: Problem, path: Path) -> InfeasibleError:
    """The refusal, with the shortest start that was found and the proved bound."""
    assert problem.start_time is not None
    least, found = momentum_shortest_time(problem), path.shortest
    shortest = math.inf if found is None else found.end
    known = "none was found" if found is None else f"the shortest start found takes {shortest:.6g} s"
    bounds = "" if problem.heat is None else f" and a heat of {problem.heat:g} s"
    sentence = (
        f"No torque {'' if problem.start_time < least else 'was found that '}brings {problem.drive.name} to "
        f"{problem.target:g} rad/s ({problem.terminal}) within {problem.start_time:.6g} s{bounds}; {known}, "
        f"and none takes less than {least:.6g} s."
    )
    profile = None if found is None else found.profile
    return InfeasibleError(Infeasibility(problem, sentence, shortest, least, profile))


def _least_start_time(problem: Problem) -> Optimum:
    """The shortest start, or the shortest one within the K_dyn allowed."""
    found, at_least, quicker = _shortest_within(problem)
    bound = Limit("K_dyn", "1", "k_dyn", problem.k_dyn)
    margins = () if problem.k_dyn is None else (Margin(bound, found.k_dyn, ""),)
    refused = None if quicker is None else Margin(bound, quicker.peak / problem.base_torque, "")
    return replace(found, kept=Kept(margins, at_least, "", refused))


def _shortest_within(problem: Problem) -> tuple[Optimum, float, Found | None]:
    """The shortest start within the K_dyn allowed, the time that momentum asks for, and what is quicker."""
    at_least = momentum_shortest_time(problem)
    if problem.k_dyn is not None:
        timed = replace(problem, k_dyn=None, minimise="k_dyn", start_time=1.0)
        at_least = _soonest(timed, problem.k_dyn)
        exact = _by_formula(replace(timed, start_time=at_least * (1.0 + TINY)))
        if exact is not None and exact.k_dyn <= problem.k_dyn:
            return replace(exact, problem=problem, claimed=exact.end_time), at_least, None
    path = Path(replace(problem, k_dyn=None))
    if path.shortest is None:
        said = f"start_time: no start of {problem.drive.name} to {problem.target:g} rad/s was found."
        raise InfeasibleError(Infeasibility(problem, said))
    if problem.k_dyn is None or path.shortest.peak <= problem.k_dyn * problem.base_torque:
        gentlest = path.gentlest(path.shortest, path.shortest.end * (1.0 + EDGE))
        return _answer(problem, gentlest, f"the shortest start found; {SUCCESSIVE}"), at_least, None
    found, quicker = path.quickest_within(problem.k_dyn)
    if found is None:
        least = quicker.peak / problem.base_torque
        sentence = (
            f"limits: no start of {problem.drive.name} with a K_dyn of {problem.k_dyn:.4g} was found; the "
            f"gentlest one found has {least:.4g}."
        )
        raise InfeasibleError(Infeasibility(problem, sentence))
    return _answer(problem, found), at_least, quicker


def _within_limits(problem: Problem) -> Optimum:
    """The first start time whose gentlest start keeps the permissible shaft torque and the life."""
    limits = checked_limits(problem.drive)
    if limits.shaft_torque is None and limits.life is None:
        raise InputError(
            f"limits: {problem.drive.name or 'the drive'} has no permissible shaft torque; give "
            "limits.shaft_torque, or a life with [limits.fatigue]."
        )
    most = None if limits.shaft_torque is None else limits.shaft_torque / problem.base_torque
    timed = replace(problem, start_time=None, minimise="start_time", k_dyn=most)
    best, at_least, quicker = _shortest_within(timed)
    refused = next(
        (
            Margin(one, quicker.peak, "", units_of(problem.drive))
            for one in limits.each
            if quicker and one.figure == "peak_torque"
        ),
        None,
    )
    if limits.life is not None:
        best, refused = _that_lasts(problem, best, replace(limits, start_time=None), refused)
    margins = Row(best.run, None, worst_case=()).margins(limits)
    kept = Kept(margins, at_least, unchecked_life(problem.drive), refused)
    return replace(best, problem=problem, claimed=best.k_dyn, kept=kept)


def _that_lasts(
    problem: Problem, best: Optimum, limits: Limits, refused: Margin | None
) -> tuple[Optimum, Margin | None]:
    """The first start that also keeps the life, at a time after that of `best`.

    K_dyn of the gentlest start falls with the start time, and the life it uses with a power of it. A life may
    be kept by a start that is not the gentlest: the one that keeps it is followed to shorter times.
    """

    def tightest(one: Optimum) -> Margin:
        margins = [each for run in one.runs for each in Row(run, None, worst_case=()).margins(limits)]
        return min(margins, key=lambda each: each.share)

    if tightest(best).share >= -WITHIN:
        return best, refused
    path, low, high, found = Path(problem), best.end_time, math.inf, None
    refused, longest = tightest(best), LONGEST * best.end_time
    while not high - low <= WITHIN * low:
        end = math.sqrt(low * high) if found else 1.2 * low
        timed = replace(problem, start_time=end)
        tried = [path.at(end), None if found is None else path.followed(path.descent(end), found)]
        answers = [_answer(timed, one) for one in tried if one is not None]
        one = max(answers, key=lambda each: tightest(each).share)
        tight = tightest(one)
        if tight.share >= 0.0:
            best, high, found = one, end, tried[answers.index(one)] or found
            if tight.share < WITHIN:
                break
        else:
            low, refused = end, tight
        if low > longest:
            sentence = (
                f"limits: no start of {problem.drive.name} that keeps them was found up to {end:.4g} s."
            )
            raise InfeasibleError(Infeasibility(problem, sentence))
    return best, refused


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
            raise InfeasibleError(Infeasibility(problem, sentence))
        high *= 2.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_hard(middle) else (low, middle)
    return high


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
    read = {
        "gap": _values(drive, "gap", "gaps", gaps),
        "load_inertia": _values(drive, "load_inertia", "inertias", inertias),
        "load_torque": _values(drive, "load_torque", "load_torques", load_torques),
    }
    axes = {key: values for key, values in read.items() if values}
    grid = (
        drive.with_values(dict(zip(axes, each, strict=True))) for each in itertools.product(*axes.values())
    )
    return tuple(dict.fromkeys((drive, *grid)))


def _values(drive: Machine, key: str, name: str, given: Iterable[float | str]) -> list[float]:
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        raise InputError(f"{name} = {given!r}: give a list of numbers in SI units, or of texts with a unit.")
    return list(dict.fromkeys(quantity_of(drive, key, one, name) for one in listed_of(given, name)))
