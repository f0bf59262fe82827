"""What is claimed about softstart's optimum and its peers, and what became of each claim in this run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from softstart.study import Claim, Verdict
from softstart_studies.benchmarks.contest import shown
from softstart_studies.benchmarks.optima.entries import ENTRIES, OURS
from softstart_studies.benchmarks.optima.judge import Judged
from softstart_studies.benchmarks.optima.task import Task
from softstart_studies.benchmarks.optima.worker import Work

SAME = 1e-3  # relative; two K_dyn this close count as equal
AGREEMENT = 0.01  # relative; of a claimed K_dyn with the re-simulated one


@dataclass(frozen=True)
class Outcome:
    """A contender's work on a task and what the exact plant says of it; `guess` is that of a trap."""

    name: str
    task: Task
    work: Work
    judged: Judged | None
    guess: float | None = None

    @property
    def ours(self) -> bool:
        """Whether this is softstart."""
        return ENTRIES[self.name].package == OURS

    @property
    def kept(self) -> bool:
        """Whether there is an answer and it keeps all conditions of the task."""
        return self.judged is not None and not self.judged.broken

    @property
    def seconds(self) -> float:
        """Processor time: median of the solutions after the first; the first where there was no other."""
        return median(cost.cpu for cost in self.work.repeated or (self.work.first,))


def least(outcomes: Iterable[Outcome], task: Task) -> float | None:
    """Smallest K_dyn of softstart for a task, re-simulated."""
    found = [
        one.judged.k_dyn for one in outcomes if one.ours and one.task == task and one.kept and one.judged
    ]
    return min(found, default=None)


def fastest(outcomes: Iterable[Outcome], task: Task, name: str | None = None) -> float | None:
    """Seconds of softstart's fastest method for a task, or of the one named."""
    mine = [one for one in outcomes if one.ours and one.task == task and one.kept]
    return min((one.seconds for one in mine if name in (None, one.name)), default=None)


def claims(outcomes: Sequence[Outcome], guesses: Sequence[Outcome]) -> list[Claim]:
    """One claim for each question that this run can answer."""
    peers = [one for one in outcomes if not one.ours]
    makers: tuple[Callable[[], Claim | None], ...] = (
        lambda: _lowest(outcomes, [*peers, *guesses]),
        lambda: _faster(outcomes, [one for one in peers if one.judged and not ENTRIES[one.name].trap]),
        lambda: _honest([one for one in peers if one.judged]),
        lambda: _trap(outcomes, guesses),
    )
    return [claim for make in makers if (claim := make()) is not None]


def _lowest(outcomes: Sequence[Outcome], peers: Sequence[Outcome]) -> Claim | None:
    held, said, cheating = [], [], []
    for task in dict.fromkeys(one.task for one in outcomes):
        own = least(outcomes, task)
        theirs = [one for one in peers if one.task == task and one.judged]
        if own is None or not theirs:
            continue
        kept = {one.judged.k_dyn: one.name for one in theirs if one.judged and one.kept}
        if kept:
            held.append(own <= min(kept) * (1.0 + SAME))
            said.append(f"{task.start_time:g} s: {own:.5f} against {min(kept):.5f} of {kept[min(kept)]}")
        cheating += [
            f"{one.name} at {task.start_time:g} s ({one.judged.k_dyn:.4f}; {', '.join(one.judged.broken)})"
            for one in theirs
            if one.judged and not one.kept and one.judged.k_dyn < own * (1.0 - SAME)
        ]
    if not held:
        return None
    aside = f" Lower, but breaking a condition: {', '.join(cheating)}." if cheating else ""
    return Claim(
        "No peer's torque has a smaller K_dyn than softstart's, re-simulated, within 0.1 %.",
        Verdict.of(*held),
        f"Least K_dyn: {'; '.join(said)}.{aside}",
    )


def _faster(outcomes: Sequence[Outcome], peers: Sequence[Outcome]) -> Claim | None:
    held, said = [], []
    for one in peers:
        own = fastest(outcomes, one.task)
        if own is None:
            continue
        held.append(own <= one.seconds)
        alike = fastest(outcomes, one.task, "collocation")
        beside = [f"{_times(one.seconds / alike)} to its collocation"] if alike else []
        beside += [] if one.kept else ["breaking a condition"]
        text = f"{one.name} at {one.task.start_time:g} s {_times(one.seconds / own)}"
        said.append(f"{text} ({', '.join(beside)})" if beside else text)
    if not held:
        return None
    return Claim(
        "softstart's fastest method takes less time than any peer.",
        Verdict.of(*held),
        f"Processor time to that of softstart's fastest method: {', '.join(said)}.",
    )


def _honest(peers: Sequence[Outcome]) -> Claim | None:
    if not peers:
        return None
    apart = {
        f"{one.name} at {one.task.start_time:g} s {one.judged.disagreement:+.1%}": abs(
            one.judged.disagreement
        )
        for one in peers
        if one.judged
    }
    far = [text for text, value in apart.items() if value > AGREEMENT]
    return Claim(
        "Each peer's claimed K_dyn agrees with its exact re-simulation within 1 %.",
        Verdict.of(*(value <= AGREEMENT for value in apart.values())),
        f"Claimed less re-simulated, more than 1 %: {', '.join(far) or 'none'} (of {len(apart)} answers).",
    )


def _trap(outcomes: Sequence[Outcome], guesses: Sequence[Outcome]) -> Claim | None:
    measured = [(one, own) for one in guesses if (own := least(outcomes, one.task)) is not None]
    if not measured:
        return None
    found = [one for one, own in measured if one.kept and one.judged and one.judged.k_dyn <= own * 1.01]
    off = [one.judged.k_dyn / own for one, own in measured if one.judged and one not in found]
    none = sum(1 for one, _ in measured if one.judged is None)
    worst = f", the worst {max(off):.2f} times it" if off else ""
    return Claim(
        "Written as one phase, the problem is missed by more than 1 % from every guess of the torque.",
        Verdict.of(*(one not in found for one, _ in measured)),
        f"Of {len(measured)} guesses {len(found)} come within 1 % of the optimum and meet all conditions, "
        f"{len(off)} do not{worst}, {none} end without a solution.",
    )


def _times(ratio: float) -> str:
    """A ratio for a reader.

    >>> _times(0.5123), _times(6487.3)
    ('0.51', '6,490')
    """
    return shown(ratio) if ratio >= 10.0 else f"{ratio:.2g}"
