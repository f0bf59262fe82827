"""`softstart study benchmark-float32`: what single precision does to K_dyn of the exported strategies.

Each strategy is set up for each drive, translated to C, compiled, and called in cycles on the exact drive: in
single and in double precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import ClassVar

from softstart import Drive, SimulationError, make_controller
from softstart.controller import ready_controller_names
from softstart.errors import InputError
from softstart.export.block import block_program
from softstart.export.block_c import block_c
from softstart.export.closed_loop import compiler, k_dyn_in_c, k_dyn_in_python
from softstart.export.design import design_for
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict

__all__ = ["BenchmarkFloat32"]

GAPS = (0.125, 0.5, 1.0, 2.0, 4.0)  # rad
INERTIAS = (0.07, 0.175, 0.7)  # kg m2
WORST, NAMED = 5e-3, 1e-3  # change of K_dyn: never above; those above are counted


class BenchmarkFloat32(Study):
    """Change of K_dyn from double to single precision, over a grid of gaps and load inertias.

    >>> BenchmarkFloat32.name
    'benchmark-float32'
    """

    name: ClassVar[str] = "benchmark-float32"
    title: ClassVar[str] = "K_dyn of exported strategies in single precision"
    pictures: ClassVar[tuple[str, ...]] = ()

    def __init__(self, gaps: Sequence[float] = GAPS, inertias: Sequence[float] = INERTIAS) -> None:
        self.gaps, self.inertias = tuple(gaps), tuple(inertias)

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All strategies that need no parameter; about five minutes, and a C compiler."""
        if not compiler():
            raise InputError("benchmark-float32: it compiles C code; install gcc, or name a compiler in CC.")
        crane, rows, worst = Drive.load("crane-4amtkf"), [], dict[str, float]()
        for name in ready_controller_names():
            progress(name)
            changes: list[tuple[float, str]] = []
            for gap in self.gaps:
                for inertia in self.inertias:
                    change = change_of(name, crane.replace(gap=gap, load_inertia=inertia))
                    if change is not None:
                        changes.append((change, f"gap {gap:g} rad, J2 {inertia:g} kg m2"))
            most, place = max(changes)
            worst[name] = most
            above = sum(change > NAMED for change, _ in changes)
            half = median(change for change, _ in changes)
            rows.append((name, len(changes), float(f"{half:.1e}"), float(f"{most:.1e}"), above, place))
        columns = ("strategy", "drives", "median", "worst", f"above {NAMED:g}", "worst at")
        most, name = max((change, name) for name, change in worst.items())
        claim = Claim(
            f"Single precision changes K_dyn by less than {WORST:g}.",
            Verdict.of(*(change < WORST for change in worst.values())),
            f"Largest change: {most:.1e}, {name}.",
        )
        return self.result((Table("Change of K_dyn, float32 beside float64", columns, rows),), [claim], [])


def change_of(name: str, drive: Drive) -> float | None:
    """How far K_dyn of a strategy in single precision is from that in double; None without a start."""
    design = design_for(make_controller(name), drive)
    prefix = "block"
    try:
        (double,) = k_dyn_in_python(design)
        (single,) = k_dyn_in_c(design, block_c(block_program(design.block()), prefix, True), prefix)
    except SimulationError:
        return None
    return abs(single - double)
