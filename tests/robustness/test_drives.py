"""Extreme drives: parameters over many decades, against an independent integrator or conservation laws.

    python tests/robustness/test_drives.py --drives 500 --seed 1
    python tests/robustness/test_drives.py --events 100000 --seed 1

A start is drawn from a seed: inertias, stiffness, damping, gap, load, lag, rate limit, dead time, contact
law, start position, brake, a demand in lines and steps or a feedback that sees an encoder. Where the oracle
(`tests/oracle.py`, DOP853) copes, peak, events and final state must be its; where it does not, energy and
angular momentum must be kept. A start is also the same to the bit in a batch, its peak is no less than any
|T| on a grid, and an encoder shows the angle to one count. Nothing may hang, print a traceback or warn, and
every event must be located. A difference counts as sensitivity, not as an error, where the plant itself
changes as much when its parameters change by 1e-9.

`--events`: as many starts of the kind whose events were once lost, rates decades apart, in batches.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))  # run by hand

from tests.oracle import Start, integrate
from tests.softstart.kernel.test_against_oracle import KINDS

from softstart import Drive, InputError, Run, SimulationError, Status, TorqueProfile, records, simulate
from softstart.controller import Command, Controller, PlainController, make_controller
from softstart.controller.base import Measured
from softstart.kernel import records as at
from softstart.kernel.events import GRAZE

LONGEST = 10.0  # s of processor time of one start
PATIENCE = 2.0  # s for the oracle
SAME = 1e-7  # of peaks and final states
CHANGED = 1e-9  # of parameters, to see how sensitive a start is


class SlowError(Exception):
    """The time is up."""


@contextlib.contextmanager
def no_longer_than(seconds: float) -> Iterator[None]:
    """Raise SlowError in Python code after so many seconds."""

    def stop(*_: object) -> None:
        raise SlowError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@dataclass(frozen=True)
class Logged(PlainController):
    """A sampled speed loop behind an encoder; what it saw and answered is kept."""

    name: ClassVar[str] = "logged"
    speed: float = 0.0
    gain: float = 0.0
    period: float = 1.0
    log: list[tuple[float, float, float]] = field(default_factory=list)

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        torque = self.gain * (self.speed - measured.motor_speed)
        self.log.append((measured.time, measured.motor_angle, torque))
        return Command(torque, (len(self.log)) * self.period)


@dataclass(frozen=True)
class Case:
    """A drawn start: the drive, its demand as pieces (instant, torque, slope) or a feedback, and its end."""

    values: dict[str, Any]
    pieces: tuple[tuple[float, float, float], ...]
    feedback: tuple[float, float, float] | None  # speed, gain, sample period
    until: float

    def drive(self, change: float = 0.0) -> Drive:
        """The drive; stiffness, load inertia and gap changed by this share."""
        scaled = {name: self.values[name] * (1.0 + change) for name in ("stiffness", "load_inertia", "gap")}
        return Drive(**{**self.values, **scaled})

    def controller(self) -> Controller:
        """The profile of the pieces, or the feedback."""
        if self.feedback is not None:
            speed, gain, period = self.feedback
            return Logged(speed, gain, period, [])
        times, torques = [], []
        ends = [*(start for start, _, _ in self.pieces[1:]), self.until]
        for (start, torque, slope), end in zip(self.pieces, ends, strict=True):
            times += [start, end]
            torques += [torque, torque + slope * (end - start)]
        return make_controller("profile", {"profile": TorqueProfile(times, torques)})


def drawn(rng: np.random.Generator) -> Case:
    """A start, a few elastic periods long."""

    def decades(low: float, high: float) -> float:
        return float(10.0 ** rng.uniform(math.log10(low), math.log10(high)))

    def often(share: float) -> bool:
        return bool(rng.random() < share)

    J1 = decades(1e-6, 1e5)
    J2 = J1 * (decades(1e-6, 1e6) if often(0.3) else decades(1e-2, 1e2))
    period, twist = decades(1e-5, 1e3), decades(1e-6, 3.0)
    Omega = 2.0 * math.pi / period
    c = Omega**2 / (1.0 / J1 + 1.0 / J2)
    Ms, speed, until = c * twist, Omega * twist, period * float(rng.uniform(2.0, 12.0))
    gap = 0.0 if often(0.05) else twist * decades(1e-6, 1e5)
    kind = str(rng.choice(["active", "reactive"]))
    place: Any = gap * float(rng.uniform(-0.5, 0.5))
    if often(0.2):
        place = float(rng.choice([-1, 1])) * (0.5 * gap + twist * float(rng.uniform(0.0, 2.0)))
    elif often(0.4) and gap > 0.0:
        place = str(rng.choice(["mid-gap", "driving-flank", "opposite-flank"]))
    elif often(0.3) and gap > 0.0 and kind == "active":
        place = "hanging"
    braked = often(0.2)
    w1, w2 = (0.0 if often(0.6) else speed * float(rng.normal()) for _ in range(2))
    if place == "hanging":
        w1 = w2 = 0.0
    starts = [0.0, *sorted(float(t) for t in rng.uniform(0.0, until, rng.integers(0, 4)))]
    torques = [Ms * float(rng.uniform(-0.5, 1.0)) for _ in starts]
    slopes = [Ms / period * float(rng.normal()) if often(0.4) else 0.0 for _ in starts]
    least = -Ms if often(0.5) else 0.0
    feedback = (speed, Ms / speed * decades(0.1, 3.0), period * decades(0.01, 0.3)) if often(0.3) else None
    values = {
        "motor_inertia": J1,
        "load_inertia": J2,
        "stiffness": c,
        "damping": 0.0
        if often(0.3)
        else 2.0 * c / Omega * (decades(1e-6, 1e5) if often(0.3) else decades(1e-3, 3.0)),
        "gap": gap,
        "load_torque": 0.0 if often(0.1) else Ms * decades(1e-5, 0.95),
        "load_kind": kind,
        "contact_law": str(rng.choice(["no-pull", "dead-zone", "modelica"])),
        "start_position": place,
        "initial_motor_speed": 0.0 if braked else w1,
        "initial_load_speed": w2,
        "torque_lag": 0.0 if often(0.4) else period * decades(1e-8, 1e4),
        "torque_rate": math.inf if often(0.5) else Ms / (period * decades(1e-6, 1e3)),
        "computing_delay": 0.0 if often(0.6) else period * decades(1e-4, 0.2),
        "starting_torque": Ms,
        "maximum_torque": Ms,
        "minimum_torque": least,
        "target_speed": max(speed * decades(1e-3, 10.0), w2 + 1e-3 * abs(w2) + 1e-12 * speed),
        "encoder_lines": float(rng.integers(8, 5000)) if often(0.5) else 0.0,
    }
    if braked:
        release = "torque" if often(0.5) else until * float(rng.uniform(0.02, 0.6))
        values |= {"brake": "motor", "release": release}
    return Case(values, tuple(zip(starts, torques, slopes, strict=True)), feedback, until)


# what the integrator and the balances say -----------------------------------------------------------------


def demanded(case: Case, drive: Drive, controller: Controller) -> list[tuple[float, float, float]]:
    """The demand as the machine takes it, cut off at its limits: pieces (instant, torque, slope)."""
    low, high, late = float(drive.minimum_torque), float(drive.maximum_torque), float(drive.computing_delay)
    if isinstance(controller, Logged):
        return [(t + late, min(max(torque, low), high), 0.0) for t, _, torque in controller.log]
    found = []
    ends = [*(start for start, _, _ in case.pieces[1:]), case.until]
    for (start, torque, slope), end in zip(case.pieces, ends, strict=True):
        corners = [start]
        if slope != 0.0:
            crossings = (start + (limit - torque) / slope for limit in (low, high))
            corners += sorted(t for t in crossings if start < t < end)
        for begin, finish in zip(corners, [*corners[1:], end], strict=True):
            first = torque + slope * (begin - start)
            middle = torque + slope * (0.5 * (begin + finish) - start)
            if low <= middle <= high:
                found.append((begin + late, min(max(first, low), high), slope))
            else:
                found.append((begin + late, min(max(middle, low), high), 0.0))
    last, (torque, slope) = ends[-1], case.pieces[-1][1:]
    found.append((last + late, min(max(torque + slope * (last - case.pieces[-1][0]), low), high), 0.0))
    return [piece for piece in found if piece[0] < case.until]


def integrated(
    case: Case, drive: Drive, pieces: list[tuple[float, float, float]], rtol: float = 1e-11
) -> Start:
    """The oracle's answer; a reactive load without torque never rests, it is an active one."""
    kind = drive.load_kind if drive.Mc > 0.0 else "active"
    release = drive.release_time if drive.brake == "motor" else 0.0
    return integrate(
        J1=drive.J1, J2=drive.J2, c=drive.c, d=drive.d, gap=drive.gap, Mc=drive.Mc, kind=kind,
        law=drive.contact_law, theta0=float(drive.theta0), w1_0=drive.initial_motor_speed,
        w2_0=drive.initial_load_speed, torque_pieces=list(pieces), lag=drive.torque_lag,
        rate=drive.torque_rate, u0=0.0, t_end=case.until, target=drive.target_speed, release=float(release),
        rtol=rtol,
    )  # fmt: skip


def without_touches(drive: Drive, events: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """The events less the openings no deeper than 1e-12 of the gap, which only rounding tells from a touch.

    A load that winds up from rest on the flank, undamped, comes back to it with no speed at all. A flight of
    length t under an acceleration of at most a is no deeper than a t^2/8.
    """
    torque = max(abs(float(drive.minimum_torque)), abs(float(drive.maximum_torque)))
    most = torque / float(drive.J1) + float(drive.Mc) / float(drive.J2)
    shortest = math.sqrt(8.0 * GRAZE * float(drive.gap) / most)
    kept: list[tuple[float, str]] = []
    for time_, kind in events:
        if kept and kind == "closed" and kept[-1][1] == "opened" and time_ - kept[-1][0] < shortest:
            kept.pop()
        else:
            kept.append((time_, kind))
    return kept


def against(run: Run, other: Start) -> list[str]:
    """In what the run differs from the oracle."""
    wrong = []
    drive, end = run.drive, run.at(run.end_time)
    least = 1e-12 * float(drive.c * drive.gap) + 1e-9 * float(drive.Ms)
    if abs(run.peak_torque - abs(other.peak)) > SAME * abs(other.peak) + least:
        wrong.append(f"peak {run.peak_torque!r}, oracle {abs(other.peak)!r}")
    ours = without_touches(drive, [(event.time, KINDS[event.kind]) for event in run.events])
    others = without_touches(drive, other.events)
    names, kinds = [kind for _, kind in ours], [kind for _, kind in others]
    first = sum(t == 0.0 for t, _ in ours)  # what happens at t = 0 has no order
    if sorted(names[:first]) + names[first:] != sorted(kinds[:first]) + kinds[first:]:
        wrong.append(f"events {names[:8]}, oracle {kinds[:8]}")
    else:
        mine, theirs = [t for t, _ in ours], [t for t, _ in others]
        apart = np.abs(np.subtract(mine, theirs)).max(initial=0.0)
        # from rest on a flank, under a torque that begins at zero, rounding chooses the instant of contact
        on_flank = abs(abs(float(drive.theta0)) - 0.5 * float(drive.gap)) <= 1e-12 * float(drive.gap)
        if apart > 1e-6 * run.end_time:
            if on_flank and drive.torque_lag + 1.0 / drive.torque_rate > 0.0:
                raise ValueError("not to be compared")
            wrong.append(f"events {apart / run.end_time:.2g} of the run apart")
    scale = float(np.abs(run.w1).max() + np.abs(run.w2).max())
    for name, value in (("w1", other.w1), ("w2", other.w2)):
        if abs(float(end[name]) - value) > 10 * SAME * scale:
            wrong.append(f"{name} {float(end[name])!r}, oracle {value!r}")
    if abs(float(end["u"]) - other.u) > SAME * float(drive.Ms):
        wrong.append(f"u {float(end['u'])!r}, oracle {other.u!r}")
    return wrong


def balances(run: Run) -> list[str]:
    """Whether energy and, of loads that slide and motors that are free, angular momentum are kept."""
    wrong = []
    drive, energy, rows = run.drive, run.energy, run.recorded.spans
    first, last = run.at(0.0), run.at(run.end_time)
    stored = 0.5 * drive.J1 * np.max(run.w1**2) + 0.5 * drive.J2 * np.max(run.w2**2)
    stored += 0.5 * run.peak_torque**2 / drive.c
    scale = stored + abs(energy.motor) + abs(energy.load) + abs(energy.dissipated)
    if abs(energy.residual) > 1e-6 * scale:
        wrong.append(f"energy: {energy.residual / scale:.2g} of it is missing")
    slides = run.recorded.of_masses(1)[:-1]
    if np.all(slides != 0.0) and np.all(rows[:, at.S_BRAKED] == 0.0):
        h = rows[:, at.S_END] - rows[:, at.S_START]
        lag, line = drive.torque_lag, rows[:, at.S_REF] - rows[:, at.S_SLOPE] * drive.torque_lag
        fade = -lag * np.expm1(-h / lag) if lag > 0.0 else 0.0
        pushed = line * h + 0.5 * rows[:, at.S_SLOPE] * h * h + (rows[:, at.S_U] - line) * fade
        braked = slides[:, 1] * drive.Mc * h
        gained = drive.J1 * (last["w1"] - first["w1"]) + drive.J2 * (last["w2"] - first["w2"])
        size = drive.J1 * np.abs(run.w1).max() + drive.J2 * np.abs(run.w2).max()
        size += np.abs(pushed).sum() + np.abs(braked).sum()
        if abs(gained - pushed.sum() + braked.sum()) > 1e-9 * size:
            wrong.append(f"momentum: {(gained - pushed.sum() + braked.sum()) / size:.2g} of it is missing")
    return wrong


def itself(case: Case, run: Run, controller: Controller) -> list[str]:
    """What must hold of any start by itself."""
    wrong = []
    largest = float(np.abs(run.T).max())
    if run.peak_torque < largest * (1.0 - 1e-9) - 1e-15 * float(run.drive.c * run.drive.gap):
        wrong.append(f"peak {run.peak_torque!r} is less than |T| {largest!r} on the grid")
    figures = [run.peak_torque, run.k_dyn, run.end_time, *run.energy.__dict__.values()]
    if not np.all(np.isfinite([*figures, *run.w1, *run.w2, *run.T])):
        wrong.append("a figure is not finite")
    if isinstance(controller, Logged):
        count = float(run.recorded.rows.machine["encoder"])
        seen = np.array([(t, angle) for t, angle, _ in controller.log if t <= run.end_time])
        off = np.abs(run.at(seen[:, 0])["phi1"] - seen[:, 1] - run.at(0.0)["phi1"] * 0.0).max()
        if off > 1.001 * max(count, 1e-9 * np.abs(seen[:, 1]).max()):
            wrong.append(f"the encoder is {off:.3g} rad off")
        return wrong
    batch = simulate([run.drive], controller, case.until)
    for name in ("peak_torque", "start_time", "end_time", "contacts", "torque_excess", "torque_excess_time"):
        value = {"torque_excess": run.clipped.excess, "torque_excess_time": run.clipped.time}.get(name)
        mine = float(getattr(run, name) if value is None else value)
        if not np.array_equal(mine, float(batch[name].item()), equal_nan=True):
            wrong.append(f"{name} {mine!r}, in a batch {batch[name].item()!r}")
    return wrong


def sensitive(case: Case, run: Run) -> bool:
    """Whether the start itself changes by as much as is complained about, if its parameters hardly do."""
    for change in (CHANGED, -CHANGED):
        try:
            other = simulate(case.drive(change), case.controller(), case.until)
        except (SimulationError, InputError):
            return True
        if [e.kind for e in other.events] != [e.kind for e in run.events]:
            return True
        if abs(other.peak_torque - run.peak_torque) > 0.1 * SAME * run.peak_torque:
            return True
        mine, theirs = run.at(run.end_time), other.at(min(run.end_time, other.end_time))
        scale = float(np.abs(run.w1).max() + np.abs(run.w2).max())
        if any(abs(float(mine[n]) - float(theirs[n])) > SAME * scale for n in ("w1", "w2")):
            return True
        apart = [abs(a.time - b.time) for a, b in zip(run.events, other.events, strict=True)]
        if max(apart, default=0.0) > 1e-7 * run.end_time:
            return True
    return False


def judged(seed: int, number: int) -> tuple[str, list[str]]:
    """How the start was examined, and what is wrong with it."""
    case = drawn(np.random.default_rng([seed, number]))
    began = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            drive, controller = case.drive(), case.controller()
            run = simulate(drive, controller, case.until)
            wrong = itself(case, run, controller)
    except InputError:
        return "refused", []
    except SimulationError as error:
        lost = any(one.value in str(error) for one in (Status.NOT_LOCATED, Status.NOT_FINITE))
        return "given up", [str(error)] if lost else []
    except Exception:  # whatever else happens is a defect, and is reported as one
        return "failed", [traceback.format_exc()]
    wrong += balances(run)
    took = time.process_time() - began
    if took > LONGEST:
        wrong.append(f"hang: {took:.1f} s")
    how = "balances"
    at_rest = drive.initial_motor_speed == drive.initial_load_speed == 0.0
    if not (drive.gap == 0.0 and at_rest and float(drive.theta0) == 0.0):  # else rounding chooses the flank
        try:
            with no_longer_than(PATIENCE), warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                other = integrated(case, drive, demanded(case, drive, controller))
                differing = against(run, other)
                if differing:  # in smaller steps it misses less
                    other = integrated(case, drive, demanded(case, drive, controller), 1e-13)
                    differing = against(run, other)
            how = "oracle"
        except (SlowError, RuntimeError, ValueError, ArithmeticError, AssertionError, IndexError):
            differing = []
        if differing and sensitive(case, run):
            how, differing = "sensitive", []
        wrong += differing
    return how, wrong


@pytest.mark.parametrize("block", range(4))
def test_extreme_drives(block: int) -> None:
    judged(0, 0)  # compiled and loaded
    found = {number: judged(0, number) for number in range(6 * block, 6 * block + 3)}
    assert not {number: wrong for number, (_, wrong) in found.items() if wrong}
    assert "oracle" in {how for how, _ in found.values()}


# rates decades apart --------------------------------------------------------------------------------------


def events_located(count: int, seed: int) -> Counter[str]:
    """How many starts of drives with rates decades apart, behind lags of any length, end in which status."""
    rng = np.random.default_rng([seed, 77])

    def decades(low: float, high: float, size: int) -> np.ndarray:
        return 10.0 ** rng.uniform(math.log10(low), math.log10(high), size)

    ended: Counter[str] = Counter()
    laws, kinds = ("no-pull", "dead-zone", "modelica"), ("active", "reactive")
    parts = [(law, kind) for law in laws for kind in kinds]
    for law, kind in parts:
        size = -(-count // len(parts))
        gap = decades(1e-3, 10.0, size)
        lag = np.where(rng.random(size) < 0.5, decades(1e-42, 1e-3, size), decades(1e-3, 10.0, size))
        J1, J2, c = decades(1e-3, 0.1, size), decades(0.01, 1.0, size), decades(1e2, 1e4, size)
        critical = 2.0 * np.sqrt(c / (1.0 / J1 + 1.0 / J2))
        drives = records(
            Drive.load("crane-4amtkf").replace(load_kind=kind, contact_law=law, minimum_torque=-64.0),
            motor_inertia=J1, load_inertia=J2, stiffness=c, gap=gap, torque_lag=lag,
            damping=critical * decades(1e-3, 1e4, size), load_torque=decades(1e-3, 20.0, size),
            start_position=gap * rng.uniform(-0.5, 0.5, size),
        )  # fmt: skip
        profile = TorqueProfile([0.0, 0.15, 0.15, 0.3, 0.3], [40.0, 40.0, 15.0, 15.0, -25.0])
        batch = simulate(drives, make_controller("profile", {"profile": profile}), 0.6)
        ended.update(batch.status.values.tolist())
        finished = np.isin(batch.status.values, ["REACHED", "STOPPED_EARLY"])
        assert np.all(np.isfinite(batch.peak_torque.values[finished]))
    return ended


def test_events_are_located_where_rates_lie_decades_apart() -> None:
    ended = events_located(600, 0)
    assert set(ended) <= {"REACHED", "STOPPED_EARLY"}


def by_hand() -> int:
    """Examine many; print what is wrong, and the counts."""
    parser = argparse.ArgumentParser(description=by_hand.__doc__)
    parser.add_argument("--drives", type=int, default=0, help="how many")
    parser.add_argument("--events", type=int, default=0, help="how many with rates decades apart")
    parser.add_argument("--seed", type=int, default=1, help="which")
    parser.add_argument("--only", type=int, help="one number: that drive alone")
    given = parser.parse_args()
    bad = 0
    if given.events:
        began = time.monotonic()
        ended = events_located(given.events, given.seed)
        print(f"{sum(ended.values())} starts in {time.monotonic() - began:.0f} s: {dict(ended)}")
        bad += sum(number for name, number in ended.items() if name not in ("REACHED", "STOPPED_EARLY"))
    judged(0, 0)  # compiled and loaded
    how: Counter[str] = Counter()
    slowest = 0.0
    numbers = range(given.drives) if given.only is None else [given.only]
    for number in numbers:
        began = time.monotonic()
        examined, wrong = judged(given.seed, number)
        slowest = max(slowest, time.monotonic() - began)
        how[examined] += 1
        if wrong or given.only is not None:
            bad += bool(wrong)
            print(f"{number:5} {examined}: {'; '.join(wrong)}", flush=True)
    if how:
        print(f"{sum(how.values())} drives, examined by: {dict(how)}; the slowest took {slowest:.1f} s")
    print(f"wrong: {bad or 'nothing'}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(by_hand())
