"""How often the intervals of `identify` hold the truth, and how often its search finds the best minimum.

    python -m tests.robustness.test_identification --fits 200 --lines 64 --period 4e-3 --seed 3

Simulated logs of one drive with a torque error of 2.5 %, from random places in the gap and random phases of
the encoder, each fitted from a guess that is off by up to a factor of 3 in every parameter.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict

import numpy as np

from softstart import Drive, identify
from softstart.identification.planning import made_up_log

DRIVE = Drive.load("crane-4amtkf").replace(
    damping=0.3, torque_lag=0.004, load_kind="reactive", gap=0.08, start_position="unknown"
)
NAMES = (
    "motor_inertia", "load_inertia", "stiffness", "gap", "damping", "load_torque", "torque_lag",
)  # fmt: skip
RIPPLE = 1.0  # N m, 2.5 % of the level of the experiments
FAR = 3.0  # half widths


def attack(
    experiment: str, fits: int, lines: float, period: float, seed: int, factor: float = 3.0
) -> dict[str, list[float]]:
    """Distance from the truth in half widths of the interval, by parameter; those unknown under `unknown`."""
    generator = np.random.default_rng(seed)
    drive = DRIVE.replace(encoder_lines=lines)
    off: dict[str, list[float]] = defaultdict(list)
    for number in range(fits):
        moves = math.log(factor) * generator.uniform(-1.0, 1.0, len(NAMES))
        guess = drive.replace(
            **{n: float(getattr(drive, n)) * math.exp(m) for n, m in zip(NAMES, moves, strict=True)}
        )
        position, phase = generator.uniform(-1.0, 1.0), generator.uniform()
        log = made_up_log(
            drive, experiment, log_period=period, ripple=RIPPLE, position=position, phase=phase,
            seed=int(generator.integers(2**31)),
        )  # fmt: skip
        found = identify(log, guess, searches=8, seed=number)
        for one in found.estimates:
            truth = position if one.name not in NAMES else float(getattr(drive, one.name))
            if not one.known:
                off[f"unknown: {one.name}"].append(0.0 if one.lower <= truth <= one.upper else 2.0)
                continue
            end = one.upper if truth > one.value else one.lower
            off[one.name].append(abs(truth - one.value) / max(abs(end - one.value), 1e-300))
            if off[one.name][-1] > FAR:
                off["far"].append(number)
        off["seconds"].append(found.seconds)
        off["ripple"].append(found.ripple)
    return off


def test_intervals_hold_the_truth() -> None:
    off = attack("two levels, then reverse", 6, 1024.0, 4e-3, seed=1)
    every = np.concatenate([off[name] for name in NAMES])
    assert every.size == 6 * len(NAMES)
    assert not off["far"]
    assert np.mean(every <= 1.0) >= 0.8
    assert np.mean(every) > 0.2  # nor are they far too wide


def main() -> None:
    """Print a row for each parameter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--experiment", default="two levels, then reverse")
    parser.add_argument("--fits", type=int, default=50)
    parser.add_argument("--lines", type=float, default=1024.0)
    parser.add_argument("--period", type=float, default=4e-3)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    off = attack(given.experiment, given.fits, given.lines, given.period, given.seed)
    seconds, far = np.array(off.pop("seconds")), off.pop("far", [])
    ripple = np.array(off.pop("ripple"))
    print(
        f"{given.experiment}: {given.fits} fits, {given.lines:g} lines, {1e3 * given.period:g} ms, "
        f"seed {given.seed}"
    )
    print(
        f"{np.median(seconds):.1f} s in the median, {seconds.max():.1f} s at most; ripple "
        f"{ripple.mean():.2f} N m"
    )
    for name, one in sorted(off.items()):
        print(
            f"{name:28} {len(one):4}  the interval holds the truth in "
            f"{100.0 * np.mean(np.array(one) <= 1.0):5.1f} %"
        )
    print(f"further off than {FAR:g} half widths: {len(far)} {sorted(set(map(int, far)))}")


if __name__ == "__main__":
    main()
