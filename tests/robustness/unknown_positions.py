"""Random drives of unknown position: the robust optimum against its bound and every shipped strategy.

    python -m tests.robustness.unknown_positions results.jsonl --first 0 --count 200

Each drive takes a search of five seconds or more; those in the file are not searched again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

from tests.softstart.optimal.test_from_positions import BLIND, compared, random_unknown, wrong_in

from softstart.errors import SimulationError
from softstart.optimal.result import InfeasibleError, NotConverged, OptimumError
from softstart.optimal.robust import optimize_robust
from softstart.optimal.shortest import start_time_of_direct

ALLOWED = 1.2  # times the start time of direct


def answered(seed: int) -> dict[str, Any]:
    """A random drive, its robust optimum and how everything compares with it."""
    began = time.process_time()
    drive = random_unknown(seed)
    try:
        latest = ALLOWED * start_time_of_direct(drive)
        best = optimize_robust(list(drive.positions.values()), latest, base=drive)
        found = compared(drive, best)
    except (InfeasibleError, OptimumError, NotConverged, SimulationError) as error:
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
