"""`softstart study benchmark-optima`: one optimal start by softstart, and written plainly in CasADi.

Whatever a contender claims, its torque is replayed on the exact plant: that K_dyn counts, and so do the
conditions that it breaks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from softstart import Run, simulate
from softstart.controller import make_controller
from softstart.errors import InputError, SimulationError
from softstart.optimal import pulse_coast_hold, statement
from softstart.optimal.path import Path as StartPath
from softstart.optimal.problem import Problem
from softstart.profile import TorqueProfile
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import drawing, head, mark_points, new_figure
from softstart_studies.benchmarks.starts import conditions, rounded
from softstart_studies.crane import CRANE, K_DYN, TARGET

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BenchmarkOptima"]

DRIVE = CRANE.replace(target_speed=TARGET)
START_TIMES = (0.2883042, 0.2522662)  # s: 1.2 and 1.05 times that of constant Ms
REPETITIONS = 3
GUESSES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the torque, as a share of Ms
SAME = 1e-3  # relative; two K_dyn this close count as equal
SPEED_TOLERANCE = 1e-3  # of the target speed, above which an end speed does not count as reached
ROUNDING = 1e-6  # of times and torques


class Answer(NamedTuple):
    """K_dyn as the contender computed it, its torque up to the end in s."""

    claimed: float
    profile: TorqueProfile
    end: float


# contenders ----------------------------------------------------------------------------------------------


def closed_form(start_time: float) -> Answer:
    """softstart: pulse, coast, hold."""
    profile, end, claimed = pulse_coast_hold.solve_pulse_coast_hold(Problem(DRIVE, start_time))
    return Answer(claimed, profile, end)


def descent(start_time: float) -> Answer:
    """softstart: successive linear programs on the exact start, HiGHS."""
    problem = Problem(DRIVE, start_time)
    best = StartPath(problem).at(start_time)
    if best is None:
        raise RuntimeError("no start was found.")
    return Answer(best.peak / problem.base_torque, best.profile, best.end)


def collocation(start_time: float) -> Answer:
    """softstart: the CasADi statement with one contact, IPOPT."""
    run = simulate(DRIVE, "pulse-coast-hold", start_time + float(DRIVE.elastic_period))
    claim = statement.solve_collocation(Problem(DRIVE, start_time), run, straight=True)
    return Answer(claim.value, claim.profile, claim.end_time)


def casadi_phases(start_time: float) -> Answer:
    """CasADi, IPOPT: phases with the gap open (25 intervals) and in contact (75), free durations."""
    return _collocated(start_time, 0.5, (25, 75))


def casadi_one_phase(start_time: float, guess: float) -> Answer:
    """CasADi, IPOPT: one phase of 100 intervals, T = c max(0, .); the guess of the torque in Ms."""
    return _collocated(start_time, guess, (100,))


def _collocated(start_time: float, guess: float, intervals: Sequence[int]) -> Answer:
    """Radau collocation of degree 3, constant torque in each interval; the first of two phases is the gap.

    States: twist over half the gap, both speeds over the target speed.
    """
    import casadi

    ca: Any = casadi
    J1, J2, c, Mc, Ms = (float(one) for one in (DRIVE.J1, DRIVE.J2, DRIVE.c, DRIVE.Mc, DRIVE.Ms))
    half, base = 0.5 * float(DRIVE.gap), float(DRIVE.mean_torque)
    C, _, _ = ca.collocation_coeff(ca.collocation_points(3, "radau"))
    opti, phases = ca.Opti(), len(intervals)
    K_dyn, shares = opti.variable(), opti.variable(phases)
    opti.minimize(K_dyn)
    opti.set_initial(K_dyn, 1.0)
    opti.set_initial(shares, [0.1, 0.9] if phases == 2 else 1.0)
    opti.subject_to(opti.bounded(0.01, shares, 1.0))
    opti.subject_to(ca.sum1(shares) <= 1.0)
    state, done, torques = ca.DM.zeros(3), 0, []
    for phase, count in enumerate(intervals):
        closed = phase == 1
        h = start_time * shares[phase] / count
        u = opti.variable(count)
        torques.append(u)
        opti.subject_to(opti.bounded(0.0, u, 1.0))
        opti.set_initial(u, guess)
        for k in range(count):
            inner = opti.variable(3, 3)
            depth = inner[0, :] - 1.0
            T = c * half * (depth if closed else 0.0 * depth if phases == 2 else ca.fmax(0.0, depth))
            rates = ca.vertcat(
                TARGET / half * (inner[1, :] - inner[2, :]),
                (u[k] * Ms - T) / (J1 * TARGET),
                (T - Mc) / (J2 * TARGET),
            )
            opti.subject_to(ca.horzcat(state, inner) @ C == h * rates)
            opti.subject_to(ca.vec(T / base) <= K_dyn)
            if phases == 2:
                opti.subject_to(ca.vec(depth) >= 0.0 if closed else ca.vec(depth) <= 0.0)
            along = (done + k + 1) / sum(intervals)
            opti.set_initial(inner, np.outer([1.0 + closed, along, along], np.ones(3)))
            state = inner[:, -1]
        done += count
        if phases == 2 and not closed:
            opti.subject_to(state[0] == 1.0)
    opti.subject_to(state[1:] == 1.0)
    quiet = {"print_level": 0, "sb": "yes", "max_iter": 1000}
    opti.solver("ipopt", {"expand": True, "print_time": False}, quiet)
    try:
        found = opti.solve()
    except RuntimeError:
        raise RuntimeError(f"IPOPT: {opti.return_status()}.") from None
    lengths = start_time * np.atleast_1d(found.value(shares)) / intervals
    edges = np.concatenate([[0.0], np.cumsum(np.repeat(lengths, intervals))])
    levels = Ms * np.concatenate([np.atleast_1d(found.value(u)) for u in torques])
    return Answer(float(found.value(K_dyn)), TorqueProfile.steps(edges, levels), float(edges[-1]))


CONTENDERS: dict[str, Callable[[float], Answer]] = {
    "closed-form": closed_form,
    "descent": descent,
    "collocation": collocation,
    "casadi": casadi_phases,
    **{f"casadi, one phase {guess:g}": partial(casadi_one_phase, guess=guess) for guess in GUESSES},
}
PEER = "casadi"


# what the exact plant says -------------------------------------------------------------------------------


class Judged(NamedTuple):
    """K_dyn of the whole run to an elastic period after t_f, and how well the conditions are met.

    `motor_error`, `load_error`: w1 and w2 at t_f less the target, rad/s. `broken` names what is not kept.
    """

    k_dyn: float
    motor_error: float
    load_error: float
    contacts: int
    broken: tuple[str, ...]


def judge(start_time: float, answer: Answer) -> Judged:
    """Replay an answer. From t_f on the torque holds the shaft torque of that instant, within [0, Ms].

    >>> judged = judge(0.25, Answer(3.0, TorqueProfile([0.0], [62.0]), 0.25))
    >>> round(judged.k_dyn, 2), judged.contacts, judged.broken
    (3.12, 5, ('end speed', 'contact'))
    """
    profile, end, Ms = answer.profile, answer.end, float(DRIVE.Ms)
    within = TorqueProfile(profile.time, profile.torque.clip(0.0, Ms))
    state = _replayed(within, end).at(end)
    w1, w2, T = (float(state[name]) for name in ("w1", "w2", "T"))
    holding = (T * (DRIVE.J1 + DRIVE.J2) - DRIVE.Mc * DRIVE.J1) / DRIVE.J2
    tail = TorqueProfile([0.0], [float(np.clip(holding, 0.0, Ms))])
    run = _replayed(within.followed_by(end, tail), end + float(DRIVE.elastic_period))
    errors = w1 - TARGET, w2 - TARGET
    kept = {
        "start time": end <= start_time * (1.0 + ROUNDING),
        "end speed": max(map(abs, errors)) <= SPEED_TOLERANCE * TARGET,
        "contact": run.contacts == 1,
        "torque limits": float(np.abs(profile.torque - within.torque).max()) <= ROUNDING * Ms,
    }
    return Judged(run.k_dyn, *errors, run.contacts, tuple(name for name, is_so in kept.items() if not is_so))


def _replayed(profile: TorqueProfile, until: float) -> Run:
    return simulate(DRIVE, make_controller("profile", {"profile": profile}), until)


@dataclass(frozen=True)
class Outcome:
    """An answer with the median processor time of its computation, s; or the sentence why there is none."""

    name: str
    start_time: float
    answer: Answer | None
    judged: Judged | None
    seconds: float = 0.0
    trouble: str = ""

    @property
    def k_dyn(self) -> float | None:
        """Re-simulated; None where there is no answer that keeps all conditions."""
        return self.judged.k_dyn if self.judged and not self.judged.broken else None


def outcome(name: str, start_time: float, repetitions: int = 1) -> Outcome:
    """A contender solves one task, so many times after a first one with its imports."""
    spent = []
    try:
        for _ in range(repetitions + 1):
            begin = time.process_time()
            answer = CONTENDERS[name](start_time)
            spent.append(time.process_time() - begin)
    except (SimulationError, InputError, RuntimeError) as error:  # a solver's refusal is a result
        return Outcome(name, start_time, None, None, trouble=str(error).splitlines()[0][:100])
    return Outcome(name, start_time, answer, judge(start_time, answer), median(spent[1:] or spent))


# the study -----------------------------------------------------------------------------------------------


class BenchmarkOptima(Study):
    """Least peak torque of a start within 0.2883 s and within 0.2523 s, the crane drive of [G].

    >>> BenchmarkOptima.name, BenchmarkOptima.pictures
    ('benchmark-optima', ('benchmark-optima-answers',))
    """

    name: ClassVar[str] = "benchmark-optima"
    title: ClassVar[str] = "The same optimal start with softstart and plainly with CasADi, re-simulated"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-optima-answers",)

    def __init__(
        self,
        names: Sequence[str] = tuple(CONTENDERS),
        start_times: Sequence[float] = START_TIMES,
        repetitions: int = REPETITIONS,
    ) -> None:
        self.names, self.start_times, self.repetitions = tuple(names), tuple(start_times), repetitions

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All contenders, about a minute; nothing is written to `out`."""
        found = []
        for start_time in self.start_times:
            for name in self.names:
                progress(f"start within {start_time:g} s: {name}")
                found.append(outcome(name, start_time, self.repetitions))
        tables = (answers(found), conditions("numpy", "scipy", "casadi"))
        return self.result(tables, claims(found), [figure(found)])


def answers(outcomes: Sequence[Outcome]) -> Table:
    """Claimed and re-simulated K_dyn, the errors at the end, and the computing time."""
    rows: list[tuple[object, ...]] = []
    for one in outcomes:
        if one.answer is None or one.judged is None:
            rows.append((one.start_time, one.name, *[None] * 6, one.trouble))
            continue
        judged = one.judged
        figures = round(one.answer.claimed, 5), round(judged.k_dyn, 5)
        errors = (float(f"{error:.1e}") for error in (judged.motor_error, judged.load_error))
        remark = f"not kept: {', '.join(judged.broken)}" if judged.broken else ""
        row = *figures, *errors, judged.contacts, rounded(one.seconds), remark
        rows.append((one.start_time, one.name, *row))
    columns = ("start time, s", "contender", "claimed", "K_dyn", "w1 error, rad/s", "w2 error, rad/s",
               "contacts", "processor time, s", "remark")  # fmt: skip
    return Table("Claimed and re-simulated K_dyn", columns, rows)


def claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """That plain CasADi has no smaller K_dyn, and that one phase is a trap."""
    own: dict[float, float] = {}
    for one in outcomes:
        if one.k_dyn is not None and not one.name.startswith(PEER):
            own[one.start_time] = min(one.k_dyn, own.get(one.start_time, np.inf))
    judged = [one for one in outcomes if one.start_time in own]
    made = []
    if peers := [(one.start_time, one.k_dyn) for one in judged if one.name == PEER and one.k_dyn is not None]:
        said = "; ".join(f"{t:g} s: {own[t]:.5f} against {k:.5f}" for t, k in peers)
        made.append(
            Claim(
                "Plain collocation has no smaller K_dyn than softstart, re-simulated, within 0.1 %.",
                Verdict.of(*(own[t] <= k * (1.0 + SAME) for t, k in peers)),
                f"Least K_dyn with all conditions kept: {said}.",
            )
        )
    if trapped := [one for one in judged if one.name.startswith(f"{PEER}, one phase")]:
        missed = [one.k_dyn is None or one.k_dyn > 1.01 * own[one.start_time] for one in trapped]
        made.append(
            Claim(
                "Written as one phase, the problem is missed by more than 1 % from every guess of torque.",
                Verdict.of(*missed),
                f"Of {len(trapped)} guesses {missed.count(False)} come within 1 % of the optimum and meet "
                f"all conditions, {sum(one.answer is None for one in trapped)} end without a solution.",
            )
        )
    return made


def figure(outcomes: Sequence[Outcome]) -> Figure:
    """K_dyn over computing time, a panel a start time; hollow where a condition breaks."""
    times = list(dict.fromkeys(one.start_time for one in outcomes))
    with drawing():
        drawn, grid = new_figure(1, len(times), (5.2 * len(times), 4.2), squeeze=False, sharex=True)
        for axes, start_time in zip(grid[0], times, strict=True):
            here = [one for one in outcomes if one.start_time == start_time and one.judged]
            points = [(one.name, one.seconds, one.judged.k_dyn) for one in here if one.judged]
            mark_points(axes, points, [i for i, one in enumerate(here) if one.k_dyn is not None])
            axes.set_xscale("log")
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.margins(x=0.25, y=0.12)
            head(axes, f"start within {start_time:g} s", "", "processor time, s")
        grid[0][0].set_ylabel(f"{K_DYN} re-simulated (hollow: a condition is not kept)")
    return drawn
