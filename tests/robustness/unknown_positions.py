"""Random drives of unknown position: the best fixed profile against its bound and every shipped strategy.

    python -m tests.robustness.unknown_positions results.jsonl --first 0 --count 200

Each drive takes a search of five seconds or more; those in the file are not searched again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from pathlib import Path
from typing import Any

from tests.softstart.optimal.drives import played, random_unknown

from softstart import Optimum, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.errors import SimulationError
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.problem import Problem
from softstart.optimal.result import InfeasibleError, OptimumError

BLIND = ("direct", "ramp", "s-curve")  # strategies that measure nothing


def compared(best: Optimum) -> dict[str, float]:
    """The answer against its bound and all strategies in its time; shares, 0 or more is right."""
    drive: Any = best.problem.drive
    singles = [played(one, best.profile, base=drive) for one in drive.positions.values()]
    found = {
        "over its bound": best.k_dyn / best.bound.k_dyn - 1.0,
        "as each position has it": -abs(max(run.k_dyn for run in singles) / best.k_dyn - 1.0),
    }
    for name in ready_controller_names():
        try:
            run = simulate(drive, name)
        except SimulationError:
            continue
        if math.isnan(run.start_time):
            continue
        bound = momentum_bound(Problem(drive, run.start_time, "reached"))
        found[f"{name} over the bound"] = run.k_dyn / bound.k_dyn - 1.0
        if run.start_time <= best.end_time:
            found[f"{name} over it"] = run.k_dyn / best.k_dyn - 1.0
    return found


def wrong_in(found: dict[str, float]) -> dict[str, float]:
    """What contradicts the answer: below a bound, or gentler and as quick without measuring."""
    blind = {f"{name} over it" for name in BLIND}
    return {
        name: share
        for name, share in found.items()
        if share < -1e-9 and (name in blind or not name.endswith("over it"))
    }


def answered(seed: int) -> dict[str, Any]:
    """A random drive, its answer and how everything compares with it."""
    began = time.process_time()
    try:
        best = optimize(random_unknown(seed), "1.2x")
        found = compared(best)
    except (InfeasibleError, OptimumError, SimulationError) as error:
        return {"seed": seed, "error": str(error)}
    return {
        "seed": seed, "k_dyn": best.k_dyn, "seconds": time.process_time() - began, "found": found,
        "wrong": wrong_in(found),
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> str:
    """How many drives, contradictions, and how often a strategy is gentler and as quick."""
    done = [row for row in rows if "found" in row]
    over = sorted(row["found"]["over its bound"] for row in done)
    gentler = Counter(
        name.removesuffix(" over it")
        for row in done
        for name, share in row["found"].items()
        if name.endswith("over it") and share < -1e-9
    )
    blind = sum(count for name, count in gentler.items() if name in BLIND)
    measuring = ", ".join(f"{name} {count}" for name, count in gentler.most_common() if name not in BLIND)
    wrong = sum(bool(row["wrong"]) for row in done)
    return (
        f"{len(done)} of {len(rows)} drives answered; contradictions: {wrong}; "
        f"median over the bound {100 * over[len(over) // 2]:.1f} %\n"
        f"gentler and as quick: strategies that measure nothing {blind}; feedback: {measuring or 'none'}"
    )


def main() -> None:
    """Answer the drives that are missing in the file, and sum up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    given = parser.parse_args()
    lines = given.file.read_text(encoding="utf-8").splitlines() if given.file.exists() else []
    rows = {row["seed"]: row for row in map(json.loads, lines)}
    for seed in range(given.first, given.first + given.count):
        if seed not in rows:
            rows[seed] = answered(seed)
            with given.file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(rows[seed]) + "\n")
            print(rows[seed], flush=True)
    print(summary(list(rows.values())))


if __name__ == "__main__":
    main()
