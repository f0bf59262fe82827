"""The best start within a given time: `optimize`."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from softstart.chain.model import Chain, load_machine
from softstart.controller import make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal import pulse_coast_hold, within_limits
from softstart.optimal.certificate import certified_bound, not_certified
from softstart.optimal.exact import Hold, check, demand_of, hold_of, replay, with_tail
from softstart.optimal.lp import ideal, whole_search
from softstart.optimal.momentum import least_heat, momentum_bound, momentum_shortest_time
from softstart.optimal.problem import (
    USUAL,
    Objective,
    Problem,
    StartTime,
    Terminal,
    refuse_for_chain,
    usual_terminal,
)
from softstart.optimal.result import (
    Candidate,
    InfeasibleError,
    LowerBound,
    Method,
    NotConverged,
    Optimum,
    OptimumError,
    Trial,
    heat_of,
)
from softstart.optimal.shortest import from_quickest, shortest_start_time, start_time_of_direct, verdict_on
from softstart.optimal.whole_certificate import LITTLE_WORK, MOST_WORK, whole_bound
from softstart.optimal.whole_certificate import not_certified as no_whole
from softstart.processes import on_one_thread
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate

robust = late("softstart.optimal.robust.solving")  # compiled kernels of its own
collocation = late("softstart.optimal.collocation.search")
chains = late("softstart.optimal.chains.solving")

Choice = Literal["auto", "closed-form", "lp", "collocation"]
METHODS = get_args(Choice)
TIGHT = 1e-5  # a bound within this share needs no other one
NEAR = 1e-4  # the claim of a coarse mesh is no nearer to a start time
BOUNCING = 0.85  # of the shortest time of one contact, from which on several contacts are tried
# from one start time to the next: share of the work of a bound; the gap that is no reason to begin anew, as a
# multiple of the one before and beside that, relative
SHARED, MORE_LOOSE, DRIFT = 0.25, 1.3, 5e-4
TOLERANCE = 0.005  # gap to the bound, relative, at which `auto` is content


@on_one_thread
def optimize(
    drive: Drive | Chain | str,
    start_time: float | str | None = None,
    *,
    terminal: Terminal | None = None,
    minimise: Objective = "k_dyn",
    k_dyn: float | None = None,
    heat: float | None = None,
    torque_speed: Sequence[Sequence[float]] = (),
    smoothness: float = 0.0,
    method: Choice = "auto",
    base: Drive | Chain | None = None,
    warm: Any = None,
    tolerance: float = TOLERANCE,
    time_limit: float = math.inf,
    confirm: bool = False,
    limits: bool = False,
    seeds: Sequence[str] | None = None,
) -> Optimum:
    """Find the torque over time that starts a drive most gently within a given time, and prove how gently.

    Of a chain the largest torque of all its shafts is minimised, through all its gaps: a local optimum by
    successive linear programs on its exact start, from several first demands.

    The figures are those of the exact plant running the profile; the bound says how much better any other
    start could be. Where the start position is unknown, one profile serves all (`optimize_robust`), the worst
    counts, and `alone` has the optimum of each.

    Parameters
    ----------
    drive : Drive, Chain or str
        The drive or the chain, or the name or file of one. On a chain start_time, terminal, base, warm,
        tolerance, time_limit, confirm and seeds count.
    start_time : float or str, optional
        Bound on t_f: in s, with a unit ("300 ms"), or as a multiple of the start time of `direct`
        ("1.2x"). By default 1.2x, and `why` says so; none where the start time is minimised.
    terminal : {"synchronous", "steady", "reached"}, optional
        What holds at t_f: w1 = w2 = target_speed; also T = Mc; or only w2 = target_speed. By default
        synchronous; reached where no start time is given and none is synchronous in that time, and always
        where the start position is unknown. On a chain all masses
        have the target speed, by default only its load (reached).
    minimise : {"k_dyn", "heat", "start_time"}
        `heat` is the integral of (u/Ms)^2 from 0 to t_f, s. The least start time is the first at which the
        gentlest start has the K_dyn allowed; `kept` has its lower bound.
    k_dyn, heat : float, optional
        Bounds on those that are not minimised (1, s).
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor torque over the motor speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2; makes the torque continuous.
    method : {"auto", "closed-form", "lp", "collocation"}
        `closed-form` is pulse, coast, hold; `lp` linear programs; `auto` the cheapest that is exact here.
    base : Drive or Chain, optional
        To whose mean shaft torque K_dyn refers, if not `drive`.
    warm : object, optional
        `warm` of the optimum of a similar problem, from which the search and the proof start.
    tolerance : float
        `auto` ends when the answer is within this share of its lower bound (0.5 % by default); else it solves
        the CasADi problem too, from its own guess and from the answer; if the load need only reach its speed,
        it also plays the start of each shipped strategy without its feedback, and searches on the exact plant
        for a start with any number of contacts. It keeps the best one.
    time_limit : float
        s of the clock for further searches of `auto`, of which none is begun after this; by default without
        limit, so that the answer does not depend on the machine; 0 takes the first answer, and a bound that
        is quick to compute and may lie lower.
    confirm : bool
        Solve the CasADi problem in any case, from its own guess; `tried` has both answers, and the better one
        is returned. On a chain in the order of contacts of the answer.
    limits : bool
        Find instead the least start time at which the gentlest start keeps the limits of the drive: the
        permissible shaft torque and the life, from whichever position. `kept` has the margin to each limit,
        that of the start time too, and a lower bound of the start time.
    seeds : sequence of str, optional
        Of a chain, what the search starts from: names of controllers, and "cma" ("cma2", "cma3" ... with
        other random numbers) for a global search over a dozen torques (package cma), which finds gentler
        starts where little time is allowed. By default all controllers that need no parameter.

    Returns
    -------
    Optimum
        Profile, exact run, figures and lower bound.

    Raises
    ------
    InputError
        For bad input.
    InfeasibleError
        Where no torque meets the bounds, with a verdict.
    OptimumError
        If an answer does not stand up to the exact plant.

    Examples
    --------
    >>> from softstart import Drive, optimize
    >>> best = optimize(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> round(best.k_dyn, 6), best.method, best.bound.kind
    (0.909247, 'closed-form', 'momentum')

    References
    ----------
    Why it is optimal, and the bounds: docs/theory/optimum.md.
    HiGHS: Huangfu and Hall, Math. Prog. Comp. 10 (2018), doi 10.1007/s12532-017-0130-5.
    IPOPT: Waechter and Biegler, Math. Prog. 106 (2006), doi 10.1007/s10107-004-0559-y.
    CasADi: Andersson et al., Math. Prog. Comp. 11 (2019), doi 10.1007/s12532-018-0139-4.
    """
    if isinstance(drive, str):
        drive = load_machine(drive)
    if method not in METHODS:
        raise InputError(f"method = {method!r}: choose one of {', '.join(METHODS)}.")
    for name, number in (("tolerance", tolerance), ("time_limit", time_limit)):
        if not number >= 0.0:
            raise InputError(f"{name} = {number:g}: give a number that is 0 or more.")
    corners = tuple((float(speed), float(torque)) for speed, torque in torque_speed)
    if isinstance(drive, Chain):
        refuse_for_chain(method, limits)
        asked, why = chains.asked_of_chain(
            drive, start_time, terminal, base, minimise=minimise, k_dyn=k_dyn, heat=heat,
            torque_speed=corners, smoothness=smoothness,
        )  # fmt: skip
        found: Optimum = chains.optimize_chain(
            asked, tolerance=tolerance, time_limit=time_limit, seeds=seeds, warm=warm, why=why,
            confirm=confirm,
        )  # fmt: skip
        return found
    if seeds is not None:
        raise InputError(
            f"seeds = {seeds!r}: they are for the search on a chain; leave them out for a drive."
        )
    if isinstance(base, Chain):
        raise InputError("base: K_dyn of a drive refers to a drive; give a Drive.")
    usual = start_time is None and minimise != "start_time"
    bound = USUAL if usual else None if start_time is None else StartTime.of(start_time)
    some = None if bound is None else 1.0  # any time: what is wrong with the others is said first
    ending = usual_terminal(drive) if terminal is None else terminal
    about = Problem(drive, some, ending, minimise, k_dyn, heat, corners, smoothness, base)
    if limits:
        given = {"start_time": start_time, "k_dyn": k_dyn, "confirm": confirm or None}
        given["minimise"] = None if minimise == "k_dyn" else minimise
        wrong = [name for name, value in given.items() if value is not None]
        if wrong:
            raise InputError(
                [f"{name}: limits asks for the least start time; leave this out." for name in wrong]
            )
        within_limits.check_limits(about.drive)
        return within_limits.quickest(
            about, lambda one: solve(one, method, warm, certify=False), certified, time_limit
        )
    seconds = None if bound is None else bound.seconds(lambda: start_time_of_direct(about.drive))
    why = f"; no start time given: {bound} that of direct" if usual else ""
    asked = replace(about, start_time=seconds)
    try:
        best = solve(asked, method, warm, tolerance, time_limit, confirm)
    except InfeasibleError:
        if not usual or terminal is not None or ending == "reached":
            raise
        best = solve(replace(asked, terminal="reached"), method, warm, tolerance, time_limit, confirm)
        why += ", in which only the load can have the target speed"
    return replace(best, why=best.why + why)


def solve(
    problem: Problem,
    method: Choice = "auto",
    warm: Any = None,
    tolerance: float = TOLERANCE,
    time_limit: float = 0.0,
    confirm: bool = False,
    certify: bool = True,
) -> Optimum:
    """The optimum of a problem; see `optimize`. Without `certify` its bound is that of momentum."""
    began = time.perf_counter()
    if len(problem.drive.positions) > 1:
        return _over_positions(problem, method, quick=time_limit == 0.0)
    if problem.minimise == "start_time" and _by_roots(problem, method, warm):
        return _least_start_time(problem, method, tolerance, time_limit, confirm)
    hold = hold_of(problem)
    known = isinstance(warm, _Near) and warm.about == replace(problem, start_time=1.0)
    near = warm if known and certify and hold.until == 0.0 and method in ("auto", "lp") else None
    beside = None
    if near is not None:
        with suppress(InfeasibleError, OptimumError):
            beside = _beside_known(hold, near, method, began)
        content = math.inf if time_limit == 0.0 else tolerance
        if beside is not None and not confirm and beside.gap_percent <= 100.0 * min(near.allowed, content):
            return beside
    may_bounce = method == "auto" and time_limit > 0.0 and hold.until == 0.0 and _may_bounce(problem)
    try:
        candidate, why = (
            _candidate(hold.free, method, warm) if hold.until == 0.0 else _after(hold, method, warm)
        )
    except InfeasibleError as error:
        shortest = error.verdict.shortest_start_time  # inf: no start has a single contact
        assert problem.start_time is not None
        hopeless = problem.start_time < BOUNCING * shortest < math.inf
        if not may_bounce or (hopeless and not _direct_in_time(problem)):
            raise
        with suppress(InfeasibleError, OptimumError):
            found = _bouncing(hold, "no start with one contact is that quick", began)
            return replace(found, tried=(_trial(found),))
        raise
    work = 0.0 if not certify else MOST_WORK if time_limit > 0.0 else LITTLE_WORK
    best = _checked(hold, candidate, why, began, work, proof=near.proof if near else ())
    tried = [_trial(best)]
    goes_on = method == "auto" and best.method == "lp" and best.gap_percent > 100.0 * tolerance
    until = time.perf_counter() + time_limit
    # from the likely contact of the CasADi problem's own guess; where that disagrees, from the answer's
    for contact in (None, best.run.first_contact - hold.until):
        again = goes_on and time.perf_counter() < until and (contact is None or contact > 0.0)
        if not again and not (confirm and contact is None):
            break
        start = time.perf_counter()
        try:
            other = collocation.solve(hold.free, contact_guess=contact, until=None if confirm else until)
            found = _checked(hold, other, f"gentler than that of {best.method}", start, work)
        except (NotConverged, OptimumError) as failed:
            tried.append(Trial("collocation", None, time.perf_counter() - start, str(failed)))
            continue
        tried.append(_trial(found))
        goes_on = abs(found.minimised / best.minimised - 1.0) > tolerance
        bound = max(best.bound, found.bound, key=lambda one: one.k_dyn)  # both are of this problem
        best = replace(found if found.minimised < best.minimised * (1.0 - TIGHT) else best, bound=bound)
    if may_bounce and time.perf_counter() < until and best.gap_percent > 100.0 * tolerance:
        best, others = _beside_shipped(hold, best, work)
        tried += others
    more = MORE_LOOSE
    if beside is not None and near is not None:
        if beside.gap_percent < 1.05 * best.gap_percent + 100.0 * DRIFT:
            more = 2.0 * near.more - 1.0  # beginning anew gained nothing
        tried.append(_trial(beside))
        bound = max(best.bound, beside.bound, key=lambda one: one.k_dyn)
        best = replace(min(best, beside, key=lambda one: one.minimised), bound=bound)
    if best.method == "lp":
        answer = best.warm.answer if isinstance(best.warm, _Near) else best.warm
        about = replace(problem, start_time=1.0)
        left = _Near(about, answer, best.bound.proof, best.gap_percent / 100.0, more)
        best = replace(best, warm=left)
    return replace(best, tried=tuple(tried), seconds=time.perf_counter() - began)


@dataclass(frozen=True, eq=False)
class _Near:
    """What an optimum of linear programs leaves for another start time of its drive.

    Its answer, the proof of its bound, the gap between them, relative, and how many times as large that of
    an answer found from it may be.
    """

    about: Problem  # with any start time
    answer: Any
    proof: tuple[Any, ...]
    gap: float
    more: float

    @property
    def allowed(self) -> float:
        """The gap up to which an answer found from this one needs no search of its own."""
        return self.more * self.gap + DRIFT


def _beside_known(hold: Hold, near: _Near, method: Choice, began: float) -> Optimum | None:
    """The optimum from that of another start time, its proof first; None where there is none."""
    problem = hold.free
    linear = [one for one in (ideal, whole_search) if not one.not_linear(problem)]
    if not linear or (method == "auto" and not pulse_coast_hold.applies(problem)):
        return None
    found = linear[0].solve(problem, near=near.answer, loose=near.allowed > TOLERANCE)
    if found is None:
        return None
    best = _checked(
        hold, found, "from the optimum of another start time", began, SHARED * LITTLE_WORK, proof=near.proof,
        within=0.5 * (near.gap + near.allowed),
    )  # fmt: skip
    left = replace(near, answer=found.warm, proof=best.bound.proof or near.proof)
    return replace(best, warm=left, tried=(_trial(best),))


def _by_roots(problem: Problem, method: Choice, warm: Any) -> bool:
    """Whether the least start time is that of the gentlest starts: nothing but K_dyn and torque count."""
    alone = problem.heat is None and problem.smoothness == 0.0
    return alone and method != "collocation" and warm is None


def _least_start_time(
    problem: Problem, method: Choice, tolerance: float, time_limit: float, confirm: bool
) -> Optimum:
    """The first start time whose gentlest start has the K_dyn allowed; the shortest one if any is.

    The CasADi problem is solved where that search fails, where collocation claimed less, and where it was not
    asked and the answer is not proved within `tolerance`. Its start counts if it keeps the bound.
    """
    began = time.perf_counter()
    try:
        best = within_limits.quickest(
            problem, lambda one: solve(one, method, certify=False), certified, time_limit
        )
    except (InfeasibleError, OptimumError, NotConverged) as failed:
        if method != "auto":
            raise
        try:
            return solve(problem, "collocation")
        except (InfeasibleError, OptimumError, NotConverged) as error:
            raise failed from error
    claims = [one.value for one in best.tried if one.method == "collocation"]
    beaten = any(one is not None and one < best.end_time * (1.0 - NEAR) for one in claims)
    start = time.perf_counter()
    goes_on = beaten or (not claims and best.gap_percent > 100.0 * tolerance and start - began < time_limit)
    if not (confirm or (goes_on and method == "auto")):
        return best
    try:
        other = solve(problem, "collocation")
    except (InfeasibleError, OptimumError, NotConverged) as error:
        trial = Trial("collocation", None, time.perf_counter() - start, str(error))
    else:
        trial = Trial("collocation", other.end_time, time.perf_counter() - start, "")
        keeps = problem.k_dyn is None or other.k_dyn <= problem.k_dyn * (1.0 + TIGHT)
        if keeps and other.end_time < best.end_time * (1.0 - TIGHT):
            best = replace(other, kept=best.kept, tried=best.tried)
    return replace(best, tried=(*best.tried, trial), seconds=time.perf_counter() - began)


def _direct_in_time(problem: Problem) -> bool:
    """Whether the constant starting torque reaches the target speed within the start time."""
    with suppress(SimulationError):
        return bool(simulate(problem.drive, "direct").start_time <= (problem.start_time or math.inf))
    return False


def _may_bounce(problem: Problem) -> bool:
    """Whether nothing but K_dyn, torque and time count, and the load need only reach its speed."""
    alone = problem.minimise == "k_dyn" and problem.heat is None and problem.smoothness == 0.0
    return alone and problem.terminal == "reached" and not problem.torque_speed


def _bouncing(hold: Hold, why: str, began: float) -> Optimum:
    """The gentlest start found on the exact plant, whatever the number of contacts."""
    problem = hold.problem
    assert problem.start_time is not None
    found = robust.optimize_robust([problem.drive], problem.start_time, base=problem.base)
    return _played(hold, found.profile, found.runs[0].start_time, "robust", why, began)


def _played(
    hold: Hold, profile: TorqueProfile, end: float, method: Method, why: str, began: float,
    work: float = LITTLE_WORK,
) -> Optimum:  # fmt: skip
    """A start that is known as a demand over time."""
    problem = hold.problem
    whole = with_tail(problem, profile, end)
    run = replay(problem.drive, whole, end + float(problem.drive.elastic_period), problem.base)
    return _checked(hold, Candidate(profile, end, run.k_dyn, method), why, began, work, run.contacts > 1)


def _beside_shipped(hold: Hold, best: Optimum, work: float) -> tuple[Optimum, list[Trial]]:
    """The gentlest of an answer, of the starts of all shipped strategies, played without feedback, and of a
    search on the exact plant, for any number of contacts.
    """
    problem, tried = hold.problem, []
    latest, gentlest = problem.start_time or math.inf, best.k_dyn * (1.0 - TIGHT)
    for name in ready_controller_names():
        began = time.perf_counter()
        with suppress(InputError):
            run = simulate(problem.drive, name, base=problem.base)
            if not run.start_time <= latest or math.isnan(run.k_dyn):
                continue
            demand = demand_of(run, run.start_time)
            if replay(problem.drive, demand, run.start_time, problem.base).k_dyn >= gentlest:
                continue
            with suppress(OptimumError):
                found = _played(hold, demand, run.start_time, "trace", f"the start of {name}", began, work)
                tried.append(_trial(found))
                if found.k_dyn < gentlest:
                    best, gentlest = found, found.k_dyn * (1.0 - TIGHT)
    began = time.perf_counter()
    with suppress(InfeasibleError, OptimumError):
        found = _bouncing(hold, "gentler than any start with one contact found", began)
        tried.append(_trial(found))
        best = found if found.k_dyn < gentlest else best
    return best, tried


def certified(found: Optimum) -> Optimum:
    """The same start with the bound that little work proves; checked against it."""
    if found.method == "robust":
        return found
    hold = hold_of(found.problem)
    bound = _bound(hold, found.end_time - hold.until, found.run, LITTLE_WORK)
    check(found.problem, found.profile, found.end_time, found.claimed, bound)
    return replace(found, bound=bound)


def _trial(found: Optimum) -> Trial:
    return Trial(found.method, found.minimised, found.seconds, "")


def _checked(
    hold: Hold, candidate: Candidate, why: str, began: float, work: float, bounces: bool = False,
    proof: tuple[Any, ...] = (), within: float = 0.0,
) -> Optimum:  # fmt: skip
    """A candidate that has passed the exact plant, with its bound for so much work.

    The bound may begin with the proof of another start time, and need not come nearer than `within`.
    """
    problem = hold.problem
    end, claimed = hold.until + candidate.end_time, hold.claimed(candidate)
    profile = with_tail(problem, hold.before(candidate.profile), end)
    if bounces or work == 0.0:  # the certificates are about one contact
        bound = momentum_bound(problem)
    else:
        start = replay(problem.drive, profile, end, problem.base)
        bound = _bound(hold, candidate.end_time, start, work, proof, within)
    run = check(problem, profile, end, claimed, bound, bounces=bounces)
    heat = heat_of(run, end)
    if heat < (least := least_heat(problem) if problem.minimise == "heat" else 0.0) * (1.0 - TIGHT):
        raise OptimumError(f"The heat is {heat:.8g} s, below its lower bound of {least:.8g} s.")
    return Optimum(
        problem=problem,
        profile=profile,
        run=run,
        bound=bound,
        method=candidate.method,
        why=why,
        claimed=claimed,
        end_time=end,
        seconds=time.perf_counter() - began,
        warm=candidate.warm,
        heat_at_least=least,
    )


def _over_positions(problem: Problem, method: Choice, quick: bool) -> Optimum:
    """One profile for all positions at which the start may begin; unless quick, with the optimum of each."""
    began = time.perf_counter()
    drive, latest = problem.drive, problem.start_time
    assert latest is not None
    if method != "auto":
        raise InputError(
            f"method = {method}: the start position is unknown, and one profile for all positions has a "
            "search of its own; use method = auto, or give a position."
        )
    if latest < momentum_shortest_time(problem):
        raise InfeasibleError(verdict_on(problem))  # at once: the search takes its time to say so
    found = robust.optimize_robust(
        list(drive.positions.values()), latest, base=problem.base or drive, quick=quick
    )
    alone = {}
    for name, one in drive.positions.items() if not quick else ():
        with suppress(InfeasibleError, OptimumError, NotConverged):
            alone[name] = solve(replace(problem, drive=one), certify=False)  # the bound is that of all
    return Optimum(
        problem=problem,
        profile=found.profile,
        run=simulate(drive, make_controller("profile", {"profile": found.profile}), base=problem.base),
        bound=found.lower_bound,
        method="robust",
        why=f"the start position is unknown: one profile for {', '.join(drive.positions)}",
        claimed=found.k_dyn,
        end_time=max(found.start_times),
        seconds=time.perf_counter() - began,
        alone=alone,
    )


def _after(hold: Hold, method: Choice, warm: Any) -> tuple[Candidate, str]:
    """What a method offers once the brake has let the motor go; a refusal is about the time asked for."""
    try:
        return _candidate(hold.free, method, warm)
    except InfeasibleError as error:
        verdict = error.verdict
        raise InfeasibleError(
            replace(
                verdict,
                problem=hold.problem,
                shortest_start_time=hold.until + verdict.shortest_start_time,
                sentence=f"{verdict.sentence} These times count from {hold.until:.6g} s on, when the brake "
                "is released.",
            )
        ) from None


def _candidate(problem: Problem, method: Choice, warm: Any) -> tuple[Candidate, str]:
    """What the chosen method offers, and why it was chosen."""
    if problem.start_time is not None and problem.start_time < momentum_shortest_time(problem):
        raise InfeasibleError(verdict_on(problem))
    asked = "asked for"
    no_formula = pulse_coast_hold.applies(problem)
    if method == "closed-form" and no_formula:
        raise InputError(f"method = closed-form: {no_formula}; use method = auto.")
    if not no_formula and method in ("auto", "closed-form"):
        try:
            found = pulse_coast_hold.solve(problem)
        except pulse_coast_hold.NotApplicable as reason:
            no_formula = str(reason)
            if method == "closed-form":
                raise InputError(f"method = closed-form: {reason} Use method = auto.") from None
        else:
            return found, "pulse, coast, hold is optimal here" if method == "auto" else asked
    linear = [one for one in (ideal, whole_search) if not one.not_linear(problem)]
    if method == "lp" or (method == "auto" and linear):
        if not linear:
            raise InputError(f"method = lp: {whole_search.not_linear(problem)}; use method = collocation.")
        best = linear[0].solve(problem)
        if best is None and linear[0] is whole_search:
            best = from_quickest(problem)
        if best is None:
            refusal = _refusal(problem)
            if method == "lp" or isinstance(refusal, InfeasibleError):
                raise refusal
            try:
                return collocation.solve(problem), "the linear program found no start"
            except NotConverged:
                raise refusal from None
        return best, f"no closed form: {no_formula}" if method == "auto" else asked
    try:
        best = collocation.solve(problem, warm=warm)
    except NotConverged:
        if problem.start_time is not None and problem.start_time < shortest_start_time(problem):
            raise InfeasibleError(verdict_on(problem)) from None
        raise
    no_program = whole_search.not_linear(problem)
    return best, f"no linear program: {no_program}" if method == "auto" else asked


def _refusal(problem: Problem) -> InfeasibleError | OptimumError:
    """The verdict, unless a start so quick exists and was only not found."""
    verdict = verdict_on(problem)
    assert problem.start_time is not None
    if verdict.shortest_start_time <= problem.start_time * (1.0 - 1e-4):
        return OptimumError(
            f"The linear program found no start within {problem.start_time:g} s, though one of "
            f"{verdict.shortest_start_time:.6g} s exists; ask for a little more time "
            "or for method = collocation."
        )
    return InfeasibleError(verdict)


def _bound(
    hold: Hold, end_time: float, run: Run, work: float, proof: tuple[Any, ...] = (), within: float = 0.0
) -> LowerBound:
    """The certificate where there is one for this class of problems, else the bound by momentum.

    It is that of the motor without its brake, in the time that is left after the earliest release.
    """
    problem = hold.free
    timed = problem
    if problem.start_time is None:
        timed = replace(problem, start_time=end_time, minimise="k_dyn", k_dyn=None)
    by_momentum = momentum_bound(timed)
    if problem.minimise != "k_dyn" or run.k_dyn <= by_momentum.k_dyn * (1.0 + TIGHT):
        return by_momentum  # nothing better can be proved
    known = [by_momentum]
    if not (problem.ideal_torque and not not_certified(problem)) and not no_whole(problem):
        entry = _entry_of(run, hold.until)
        contact = run.first_contact - hold.until if problem.drive.theta0 < 0.5 * problem.drive.gap else 0.0
        near = contact, max(entry, contact), end_time
        known.append(whole_bound(problem, run.k_dyn, near, max(within, 1e-3), work, proof))
    best = max(known, key=lambda one: one.k_dyn)
    far = run.k_dyn > best.k_dyn * (1.0 + TOLERANCE) and (work == MOST_WORK or len(known) == 1)
    if not not_certified(problem) and (problem.ideal_torque or far):
        k_dyn, start = (
            (run.k_dyn, _entry_of(run, hold.until)) if problem.ideal_torque else _ideal(problem, run)
        )
        # what a lag costs it does not know anyway
        within = max(within, 5e-4 if problem.ideal_torque else 2e-3)
        known.append(certified_bound(problem, k_dyn, entry_near=start, within=within, proof=proof))
    return max(known, key=lambda one: one.k_dyn)


def _ideal(problem: Problem, run: Run) -> tuple[float, float | None]:
    """K_dyn of the best start with an ideal torque, which the certificate is about, and its entry, s."""
    instant = problem.drive.replace(torque_lag=0.0, torque_rate=math.inf)
    without = replace(problem, drive=instant, torque_speed=(), smoothness=0.0)
    best = None if pulse_coast_hold.applies(without) else _by_formula(without)
    if best is None:
        best = ideal.solve(without)
    if best is None or best.claimed >= run.k_dyn:
        return run.k_dyn, _entry_of(run)
    start = replay(instant, best.profile, best.end_time, problem.base)
    return best.claimed, _entry_of(start)


def _by_formula(problem: Problem) -> Candidate | None:
    try:
        return pulse_coast_hold.solve(problem)
    except pulse_coast_hold.NotApplicable:
        return None


def _entry_of(run: Run, since: float = 0.0) -> float:
    """When both masses begin to move in contact, s from `since` on."""
    starts = [event.time for event in run.events if event.kind == "load starts"]
    entry = starts[0] if starts and run.drive.load_kind == "reactive" else run.first_contact
    return entry - since
