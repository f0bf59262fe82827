"""`softstart study benchmark-starts`: starts a second of softstart and of its peers, as ratios of one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from softstart.study import Claim
from softstart_studies.benchmarks.contest import Contest, Duel, Outcome, agreement_claim, ratio_claim
from softstart_studies.benchmarks.problem import Problem

__all__ = ["BenchmarkStarts"]

MANY = 150.0  # times LSODA, in every row
DIRECT, FIRST, TWO = (Problem(name) for name in ("direct", "reduced-first-stage", "reduced-two-stage"))
# as many starts as make a pass last about a tenth of a second or two
DUELS = (
    Duel(DIRECT, "lsoda", 20, "kernel", 4_000, MANY),
    Duel(FIRST, "lsoda", 20, "kernel", 4_000, MANY),
    Duel(TWO, "lsoda", 20, "kernel", 4_000, MANY),
    Duel(Problem("damped direct"), "lsoda-restarted", 20, "kernel", 4_000, MANY),
    Duel(Problem("damped reduced-two-stage"), "lsoda-restarted", 20, "kernel", 4_000, MANY),
    Duel(Problem("ramp"), "lsoda-sampled", 2, "kernel", 2_000, MANY),
    Duel(Problem("damped ramp"), "lsoda-sampled", 2, "kernel", 2_000, MANY),
    Duel(DIRECT, "lsoda", 20, "formula", 50_000),
    Duel(DIRECT, "lsoda", 20, "batch", 4_000),
    Duel(DIRECT, "lsoda", 20, "run", 200, 20.0),
    Duel(DIRECT, "lsoda", 20, "run-traces", 200, 20.0),
    Duel(DIRECT, "control", 4, "run-traces", 200),
    Duel(DIRECT, "control-tight", 4, "run-traces", 200),
    Duel(DIRECT, "diffrax", 1_000, "kernel", 4_000),
)


class BenchmarkStarts(Contest):
    """Constant, staged and sampled torque on the crane drive of [G]: scipy, python-control, diffrax and we.

    >>> BenchmarkStarts.name, BenchmarkStarts.pictures
    ('benchmark-starts', ('benchmark-starts-ratios',))
    """

    name: ClassVar[str] = "benchmark-starts"
    title: ClassVar[str] = "Speed and memory beside scipy, python-control and diffrax, as ratios of one run"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-starts-ratios",)
    libraries: ClassVar[tuple[str, ...]] = ("numpy", "scipy", "numba", "control", "jax", "diffrax")
    duels = DUELS

    def claims(self, outcomes: Sequence[Outcome]) -> list[Claim]:
        """One claim for each kind of duel that has been fought."""
        staged = [one for one in outcomes if one.duel.peer in {"lsoda", "lsoda-restarted"}]
        kinds = {
            "In a batch, constant and staged torque, undamped and damped": [
                one for one in staged if one.duel.ours == "kernel"
            ],
            "In a batch, a ramp sampled at 1 kHz": [
                one for one in outcomes if one.duel.peer == "lsoda-sampled"
            ],
            "One simulate call with its full Run": [one for one in staged if one.duel.ours.startswith("run")],
        }
        found = [ratio_claim(what, some) for what, some in kinds.items() if some]
        if staged:
            found.append(agreement_claim("LSODA at rtol 1e-8 has the same K_dyn within 1e-6.", staged))
        return found
