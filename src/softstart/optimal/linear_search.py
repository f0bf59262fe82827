"""The linear program's method: search over the instant of entry, then over the grid.

P over te is smooth but for steep kinks where the least v becomes just enough; a scan brackets them, golden
sections narrow them down, first on a coarse grid, then on grids cut finer where the torque switches.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.optimal.contact import Contact
from softstart.optimal.ideal import Entry, entry_of, no_ideal
from softstart.optimal.linear_program import FINE_ENDS, Answer, LinearProgram, first_grid
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate
from softstart.profile import TorqueProfile

Vector = NDArray[np.float64]

COARSE, MIDDLE, MOST = 40, 80, 400  # steps of the grid: to find the entry, to refine it, at most
ROUNDS = 3
SCANNED, LOCAL_MINIMA = 20, 3
SHARES = (0.0, 0.002, 0.006, 0.012, 0.02, 0.035, 0.05, 0.08, 0.12, 0.2, 0.4, 0.7, 1.0)  # of te, a first scan


def solve(problem: Problem) -> Candidate | None:
    """The optimum of a problem with an ideal torque; None where no torque meets the terms.

    Raises InputError where the problem is not linear from the contact on (see `no_ideal`).
    """
    reason = not_linear(problem)
    if reason:
        raise InputError(f"method = lp: {reason}; use method = collocation.")
    best = search(problem)
    if best is None:
        return None
    profile = assemble(problem, best)
    return Candidate(profile, best.end_time, best.P / problem.base_torque, "lp", f"{best.u.size} steps")


def not_linear(problem: Problem) -> str:
    """Why this is no linear program; empty if it is one."""
    if not problem.ideal_torque:
        return "the motor torque cannot jump freely (lag, rate, torque-speed curve or smoothness)"
    if problem.minimise != "k_dyn":
        return f"what is asked for is the least {problem.minimise}, and only K_dyn is linear"
    if problem.heat is not None:
        return "a bound on the heat is not linear"
    return no_ideal(problem)


def search(problem: Problem) -> Answer | None:
    """The best entry te and end t_f, and the answer there on a grid refined where the torque switches."""
    assert problem.start_time is not None
    entry = entry_of(problem)
    latest = float(problem.start_time)
    best = _best_entry(problem, entry, latest, COARSE)
    if best is None:
        if greatest_speed(problem, entry, latest, MIDDLE, math.nan)[0] < problem.target:
            return None
        # hardly enough time: the torque has no room for a coarse grid
        best = _best_entry(problem, entry, latest, MIDDLE)
    if best is None or _sooner(problem, best) < best.P * (1.0 - 1e-4):
        best = _best_end(problem, entry, latest) or best  # more time does not help, or does not fit
    if best is None:
        return None
    return _refined(problem, entry, best)


def _sooner(problem: Problem, best: Answer) -> float:
    """P with the same entry and a little less time, N m."""
    tau = 0.95 * best.end_time - best.te
    if tau <= 0.0:
        return math.inf
    grid = first_grid(Contact.of(problem.drive), tau, COARSE)
    return _peak(LinearProgram(problem, tau, grid).solve(best.te))


def _peak(answer: Answer | float | None) -> float:
    return answer.P if isinstance(answer, Answer) else math.inf


def _best_entry(problem: Problem, entry: Entry, end: float, steps: int) -> Answer | None:
    """Scan te, then narrow down around the best ones: P over te has kinks, and may have several minima.

    An entry so late that momentum alone asks for more than the best P known is not tried.
    """
    last = min(entry.latest, end)
    contact = Contact.of(problem.drive)
    if entry.earliest >= end:
        return None
    answers: dict[float, Answer | float | None] = {}

    def peak_at(te: float) -> float:
        if te not in answers:
            tau = end - te
            answers[te] = LinearProgram(problem, tau, first_grid(contact, tau, steps)).solve(te)
        return _peak(answers[te])

    def latest_for(P: float) -> float:
        """Momentum: J2 (target - w2(te)) <= (P - Mc)(end - te), by bisection."""
        low, high = entry.earliest, last
        for _ in range(40):
            te = 0.5 * (low + high)
            missing = problem.target - float(entry.load_speed(np.array([te]))[0])
            if contact.J2 * missing <= (P - contact.Mc) * (end - te):
                low = te
            else:
                high = te
        return high

    if last <= entry.earliest:
        peak_at(entry.earliest)
    else:
        lowest, limit = math.inf, last
        shares = np.linspace(0.0, 1.0, SCANNED, endpoint=False)
        for te in (entry.earliest + (last - entry.earliest) * shares**2.5).tolist():
            if te > limit:
                break
            if peak_at(te) < lowest:
                lowest = peak_at(te)
                limit = latest_for(lowest)
        if not math.isfinite(lowest):  # little time: a narrow window of te is left, if any
            speed, te = greatest_speed(problem, entry, end, steps, math.nan)
            if not speed >= problem.target:
                return None
            lowest = peak_at(te)
            if not math.isfinite(lowest):
                return None
            limit = latest_for(lowest)
        for share in np.linspace(0.0, 1.0, SCANNED)[1:] ** 1.5:
            peak_at(entry.earliest + (limit - entry.earliest) * float(share))
        tried = sorted(answers)
        for k in _minima([_peak(answers[te]) for te in tried]):
            low, high = tried[max(k - 1, 0)], tried[min(k + 1, len(tried) - 1)]
            golden(peak_at, low, high, max(1e-5 * end, 0.02 * (high - low)))
    found = answers[min(answers, key=lambda te: _peak(answers[te]))]
    return found if isinstance(found, Answer) else None


def _minima(values: list[float]) -> list[int]:
    """The lowest few local minima, lowest first."""
    padded = [math.inf, *values, math.inf]
    local = [
        i
        for i, value in enumerate(values)
        if math.isfinite(value) and padded[i] >= value and value <= padded[i + 2]
    ]
    return sorted(local, key=lambda i: values[i])[:LOCAL_MINIMA]


def greatest_speed(
    problem: Problem, entry: Entry, end: float, steps: int, near: float
) -> tuple[float, float]:
    """The greatest load speed at `end`, rad/s, and the te it needs; -inf where the terminal cannot be met."""
    contact = Contact.of(problem.drive)
    known: dict[float, float] = {}

    def short_by(te: float) -> float:
        te = min(max(te, entry.earliest), entry.latest)
        if te not in known:
            found = None
            if end > te:
                program = LinearProgram(problem, end - te, first_grid(contact, end - te, steps))
                found = program.solve(te, greatest_speed=True)
            known[te] = -found if isinstance(found, float) else math.inf
        return known[te]

    last = min(entry.latest, end)
    if last > entry.earliest:
        tried = []
        if not math.isnan(near):
            spread = 0.1 * (near - entry.earliest) + 1e-3 * end
            tried = [max(near - spread, entry.earliest), near, near + spread]
        if not tried or not short_by(near) <= min(short_by(tried[0]), short_by(tried[2])) < math.inf:
            tried += [entry.earliest + (last - entry.earliest) * share for share in SHARES]
            tried.sort()
        i = min(range(len(tried)), key=lambda k: short_by(tried[k]))
        if math.isfinite(short_by(tried[i])):
            low, high = tried[max(i - 1, 0)], tried[min(i + 1, len(tried) - 1)]
            golden(short_by, low, high, max(0.02 * (high - low), 1e-5 * end))
    else:
        short_by(entry.earliest)
    te = min(known, key=lambda t: known[t])
    return -known[te], te


def _best_end(problem: Problem, entry: Entry, latest: float) -> Answer | None:
    """The best end before `latest`: where more time does not help, or does not fit."""
    found: dict[float, Answer | None] = {}

    def peak_at(end: float) -> float:
        found[end] = _best_entry(problem, entry, end, COARSE)
        return _peak(found[end])

    for share in np.linspace(1.0, 0.05, 20):
        peak_at(latest * float(share))
    ends = sorted(found)
    i = min(range(len(ends)), key=lambda k: (_peak(found[ends[k]]), ends[k]))
    if not math.isfinite(_peak(found[ends[i]])):
        return None
    golden(peak_at, ends[max(i - 1, 0)], ends[min(i + 1, len(ends) - 1)], 1e-3 * latest)
    return found[min(found, key=lambda end: (_peak(found[end]), end))]


def golden(value: Callable[[float], float], low: float, high: float, width: float) -> None:
    """Golden-section search; `value` remembers what it was asked."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    at_a, at_b = value(a), value(b)
    while high - low > width:
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - ratio * (high - low)
            at_a = value(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (high - low)
            at_b = value(b)


def _refined(problem: Problem, entry: Entry, best: Answer) -> Answer:
    """The same entry, moved a little, on a grid cut finer where the torque switches or T is not kept.

    P may have a steep kink in te (the least slow entry), so that te itself is found to 2e-7 of t_f at last.
    """
    contact = Contact.of(problem.drive)
    tau = float(best.edges[-1])
    grid = first_grid(contact, tau, max(MIDDLE, int(1.6 * min(contact.Omega * tau, 2.0 * FINE_ENDS))))
    width = 4e-3 * best.end_time
    for _ in range(ROUNDS):
        best = _moved(problem, entry, best, grid, width, 0.1 * width)
        width *= 0.4
        if grid.size > MOST:
            break
        grid = cut(best, _switching(problem, best) | _broken(problem, best))
    for _ in range(ROUNDS):
        best = _moved(problem, entry, best, grid, width, 2e-7 * best.end_time)
        broken = _broken(problem, best)
        if not broken.any():
            break
        grid = cut(best, broken)
        width *= 0.3
    return best


def _broken(problem: Problem, answer: Answer) -> NDArray[np.bool_]:
    """Steps in which T is not kept between the checks."""
    tau = float(answer.edges[-1])
    return LinearProgram(problem, tau, answer.edges / tau).broken(answer, 1e-4)


def _switching(problem: Problem, answer: Answer) -> NDArray[np.bool_]:
    """Steps beside which the torque changes by more than 2 %."""
    jump = np.abs(np.diff(answer.u)) > 0.02 * problem.highest_torque
    near = np.zeros(answer.u.size, dtype=bool)
    near[:-1] |= jump
    near[1:] |= jump
    return near


def _moved(problem: Problem, entry: Entry, best: Answer, grid: Vector, width: float, within: float) -> Answer:
    """The best entry within `width` of the one known, on another grid."""
    answers: dict[float, Answer | float | None] = {}
    end = best.end_time

    def peak_at(te: float) -> float:
        te = min(max(te, entry.earliest), entry.latest, end)
        if te not in answers:
            answers[te] = LinearProgram(problem, end - te, grid).solve(te)
        return _peak(answers[te])

    peak_at(best.te)
    if entry.latest > entry.earliest:
        golden(peak_at, best.te - width, best.te + width, within)
    found = answers[min(answers, key=lambda te: _peak(answers[te]))]
    return found if isinstance(found, Answer) else best


def cut(answer: Answer, wanted: NDArray[np.bool_]) -> Vector:
    """The answer's grid with the wanted steps split in four, but for the few long ones and the finest.

    Its own grid: where a finer one had no answer, the last one stands, on the grid it was found on.
    """
    grid = answer.edges / answer.edges[-1]
    steps = np.diff(grid)
    split = wanted & (steps < 5.0 * np.median(steps)) & (steps > 1e-6)
    each = zip(grid[:-1], grid[1:], split, strict=True)
    parts = [np.linspace(a, b, 5)[1:] if finer else [b] for a, b, finer in each]
    return np.concatenate([[0.0], *parts])


def assemble(problem: Problem, answer: Answer) -> TorqueProfile:
    """The gap part that arrives with v, and the contact part, as one profile up to t_f.

    HiGHS keeps the limits of the torque to its own tolerance only; the profile keeps them exactly.
    """
    pieces = entry_of(problem).pieces(answer.te, answer.v)
    lengths = [max(duration, 0.0) for duration, _ in pieces] + np.diff(answer.edges).tolist()
    levels = [torque for _, torque in pieces] + np.clip(
        answer.u, problem.lowest_torque, problem.highest_torque
    ).tolist()
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    return TorqueProfile.steps(times, levels)
