"""Extreme drives: parameters over many decades, against an independent integrator and conservation laws.

A start is drawn from its number. Where the oracle (`tests/oracle.py`, DOP853) copes, peak and final state
must be its; energy is kept in any case, and a start is the same to the bit in a batch. A difference counts
as sensitivity where the plant itself changes as much when its parameters change by 1e-9. `--size 50`: 50
times as many.
"""

from __future__ import annotations

import math
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from tests.oracle import integrate
from tests.softstart.kernel.pieces import Pieces
from tests.softstart.kernel.test_against_oracle import run_of

from softstart import InputError, Run, SimulationError, Status, simulate

PATIENCE = 2.0  # s for the oracle
SAME = 1e-7  # of peaks and final states


def extreme(number: int) -> dict[str, Any]:
    """A start, a few elastic periods long."""
    rng = np.random.default_rng([1, number])

    def decades(low: float, high: float, share: float = 1.0, otherwise: float = 0.0) -> float:
        found = float(10.0 ** rng.uniform(math.log10(low), math.log10(high)))
        return found if rng.random() < share else otherwise

    J1, period, twist = decades(1e-6, 1e5), decades(1e-5, 1e3), decades(1e-6, 3.0)
    J2 = J1 * decades(1e-6, 1e6, 0.3, decades(1e-2, 1e2))
    Omega = 2.0 * math.pi / period
    c = Omega**2 / (1.0 / J1 + 1.0 / J2)
    Ms, speed, t_end = c * twist, Omega * twist, period * float(rng.uniform(2.0, 12.0))
    gap, Mc = twist * decades(1e-6, 1e5, 0.95), Ms * decades(1e-5, 0.95, 0.9)
    lag, rate = period * decades(1e-8, 1e4, 0.6), Ms / period * decades(1e-3, 1e6, 0.5, math.inf)
    # at rest on a flank, under a torque that begins at zero, rounding chooses the instant of contact
    flank = 0.5 if lag == 0.0 and math.isinf(rate) else 0.4
    theta0 = gap * float(rng.choice([-flank, 0.0, flank, rng.uniform(-0.5, 0.5)]))
    if rng.random() < 0.2:
        theta0 = float(rng.choice([-1, 1])) * (0.5 * gap + twist * float(rng.uniform(0.0, 2.0)))
    release = float(rng.choice([*[0.0] * 8, math.inf, t_end * rng.uniform(0.02, 0.6)]))
    w1, w2 = (speed * rng.normal(size=2) * (rng.random(2) < 0.4)).tolist()
    knots = [0.0, *np.sort(rng.uniform(0.0, t_end, rng.integers(0, 4))).tolist()]
    levels = Ms * rng.uniform(-0.5, 1.0, len(knots))
    slopes = Ms / t_end * rng.uniform(-0.5, 0.5, len(knots)) * (rng.random(len(knots)) < 0.4)
    return {
        "J1": J1, "J2": J2, "c": c, "gap": gap, "Mc": Mc, "theta0": theta0, "t_end": t_end, "u0": 0.0,
        "d": 2.0 * c / Omega * decades(1e-6, 1e5, 0.3, decades(1e-3, 3.0, 0.6)),
        "kind": str(rng.choice(["active", "reactive"])) if Mc > 0.0 else "active",
        "law": str(rng.choice(["no-pull", "dead-zone", "modelica"])) if gap > 0.0 else "dead-zone",
        "w1_0": 0.0 if release else w1, "w2_0": w2, "release": release,
        "torque_pieces": list(zip(knots, levels.tolist(), slopes.tolist(), strict=True)),
        "lag": lag, "rate": rate,
        "target": max(speed * decades(1e-3, 10.0), w2 + 1e-3 * abs(w2) + 1e-12 * speed),
    }  # fmt: skip


@contextmanager
def no_longer_than(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in Python code after so many seconds."""

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def apart(run: Run, peak: float, w1: float, w2: float, u: float) -> float:
    """The largest difference in peak, final speeds and motor torque, as a share of what is allowed."""
    drive, end = run.drive, run.at(run.end_time)
    least = 1e-12 * float(drive.c * drive.gap) + 1e-9 * float(drive.Ms)
    scale = float(np.abs(run.w1).max() + np.abs(run.w2).max())
    speeds = max(abs(float(end["w1"]) - w1), abs(float(end["w2"]) - w2)) / (10.0 * SAME * scale)
    torques = abs(float(end["u"]) - u) / (SAME * float(drive.Ms))
    return max(abs(run.peak_torque - abs(peak)) / (SAME * abs(peak) + least), speeds, torques)


def sensitive(drawn: dict[str, Any], run: Run) -> bool:
    """Whether the start itself changes by as much as is complained about, if its parameters hardly do."""
    for change in (1e-9, -1e-9):
        try:
            other = run_of(drawn | {name: drawn[name] * (1.0 + change) for name in ("c", "J2", "gap")})
        except (SimulationError, InputError):
            return True
        end = other.at(other.end_time)
        if apart(run, other.peak_torque, *(float(end[name]) for name in ("w1", "w2", "u"))) > 0.1:
            return True
    return False


def alone(drawn: dict[str, Any], run: Run) -> list[str]:
    """What is wrong with the start by itself."""
    drive, energy, largest = run.drive, run.energy, float(np.abs(run.T).max())
    stored = 0.5 * (
        drive.J1 * np.max(run.w1**2) + drive.J2 * np.max(run.w2**2) + run.peak_torque**2 / drive.c
    )
    scale = stored + abs(energy.motor) + abs(energy.load) + abs(energy.dissipated)
    figures = [run.peak_torque, run.k_dyn, *energy.__dict__.values(), *run.w1, *run.w2, *run.T]
    batch = simulate(
        [drive], Pieces(pieces=tuple(drawn["torque_pieces"]), end=drawn["t_end"]), drawn["t_end"]
    )
    wrong = {
        "energy": abs(energy.residual) > 1e-6 * scale,
        "peak": run.peak_torque < largest * (1.0 - 1e-9) - 1e-15 * float(drive.c * drive.gap),
        "not finite": not np.all(np.isfinite(figures)),
        "batch": not all(
            np.array_equal(getattr(run, name), batch[name].item(), equal_nan=True)
            for name in ("peak_torque", "start_time", "end_time", "contacts")
        ),
    }
    return [name for name, so in wrong.items() if so]


def judged(number: int) -> tuple[str, list[str]]:
    """How the start was examined, and what is wrong with it."""
    drawn = extreme(number)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run = run_of(drawn)
            wrong = alone(drawn, run)
    except InputError:
        return "refused", []
    except SimulationError as error:
        lost = any(one.value in str(error) for one in (Status.NOT_LOCATED, Status.NOT_FINITE))
        return "given up", [str(error)] if lost else []
    try:
        with no_longer_than(PATIENCE), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            for rtol in (1e-11, 1e-13):  # in smaller steps it misses less
                other = integrate(**drawn, rtol=rtol)
                differing = apart(run, other.peak, other.w1, other.w2, other.u)
                if differing <= 1.0:
                    return "oracle", wrong
    except (TimeoutError, RuntimeError, ValueError, ArithmeticError, AssertionError, IndexError):
        return "balances", wrong
    if sensitive(drawn, run):
        return "sensitive", wrong
    return "oracle", [*wrong, f"{differing:.3g} times as far from the oracle as is allowed"]


@pytest.mark.parametrize("first", [0, pytest.param(1000, marks=pytest.mark.slow)])
def test_extreme_drives(first: int, pytestconfig: pytest.Config) -> None:
    count = (100 if first else 12) * pytestconfig.getoption("size")
    found = {number: judged(number) for number in range(first, first + count)}
    assert not {number: wrong for number, (_, wrong) in found.items() if wrong}
    assert sum(how == "oracle" for how, _ in found.values()) >= 0.8 * len(found)
