"""Extreme drives: parameters over many decades, against an independent integrator and conservation laws.

A start is drawn from its number: inertias, stiffness, damping, gap, load, lag, rate limit, dead time, contact
law, start position, brake, a demand in lines and steps. Where the oracle (`tests/oracle.py`, DOP853) copes,
peak, events and final state must be its; energy and angular momentum are kept in any case, and a start is the
same to the bit in a batch. A difference counts as sensitivity where the plant itself changes as much when its
parameters change by 1e-9. `--size 50`: 50 times as many.
"""

from __future__ import annotations

import math
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from tests.oracle import Start, integrate
from tests.softstart.kernel.test_against_oracle import KINDS

from softstart import Drive, InputError, Run, SimulationError, Status, TorqueProfile, records, simulate
from softstart.kernel import records as at
from softstart.kernel.events import GRAZE
from softstart_controllers.profile import Profile

PATIENCE = 2.0  # s for the oracle
SAME = 1e-7  # of peaks and final states


@dataclass(frozen=True)
class Case:
    """A drawn start: the drive, its demand, and its end."""

    values: dict[str, Any]
    profile: TorqueProfile
    until: float

    def start(self, change: float = 0.0) -> Run:
        """The start; stiffness, load inertia and gap changed by this share."""
        scaled = {name: self.values[name] * (1.0 + change) for name in ("stiffness", "load_inertia", "gap")}
        return simulate(Drive(**{**self.values, **scaled}), Profile(profile=self.profile), self.until)


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
    w1, w2 = (0.0 if often(0.6) or place == "hanging" else speed * float(rng.normal()) for _ in range(2))
    knots = [0.0, *sorted(float(t) for t in rng.uniform(0.0, until, rng.integers(0, 4))), until]
    begins = rng.uniform(-0.5, 1.0, len(knots) - 1)
    ends = np.where(rng.random(begins.size) < 0.4, rng.uniform(-0.5, 1.0, begins.size), begins)
    profile = TorqueProfile(np.repeat(knots, 2)[1:-1], Ms * np.column_stack([begins, ends]).ravel())
    relative = decades(1e-6, 1e5) if often(0.3) else decades(1e-3, 3.0)
    values = {
        "motor_inertia": J1,
        "load_inertia": J2,
        "stiffness": c,
        "damping": 0.0 if often(0.3) else 2.0 * c / Omega * relative,
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
        "minimum_torque": -Ms,
        "target_speed": max(speed * decades(1e-3, 10.0), w2 + 1e-3 * abs(w2) + 1e-12 * speed),
    }
    if braked:
        values |= {
            "brake": "motor", "release": "torque" if often(0.5) else until * float(rng.uniform(0.02, 0.6)),
        }  # fmt: skip
    return Case(values, profile, until)


# the independent integrator -------------------------------------------------------------------------------


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


def integrated(case: Case, run: Run, rtol: float) -> Start:
    """The oracle's answer; a reactive load without torque never rests, it is an active one."""
    drive, late = run.drive, float(run.drive.computing_delay)
    t, u = case.profile.time, case.profile.torque
    slopes = (u[1::2] - u[::2]) / (t[1::2] - t[::2])
    pieces = [*zip(t[::2] + late, u[::2], slopes, strict=True), (t[-1] + late, u[-1], 0.0)]
    return integrate(
        J1=drive.J1, J2=drive.J2, c=drive.c, d=drive.d, gap=drive.gap, Mc=drive.Mc,
        kind=drive.load_kind if drive.Mc > 0.0 else "active",
        law=drive.contact_law if drive.gap > 0.0 else "dead-zone",
        theta0=float(drive.theta0), w1_0=drive.initial_motor_speed, w2_0=drive.initial_load_speed,
        torque_pieces=[(float(t), float(u), float(slope)) for t, u, slope in pieces if t < case.until],
        lag=drive.torque_lag, rate=drive.torque_rate, u0=0.0, t_end=case.until, target=drive.target_speed,
        release=float(drive.release_time if drive.brake == "motor" else 0.0), rtol=rtol,
    )  # fmt: skip


def without_touches(drive: Drive, events: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """The events less the openings no deeper than 1e-12 of the gap, which only rounding tells from a touch.

    A load that winds up from rest on the flank, undamped, comes back to it with no speed at all. A flight of
    length t under an acceleration of at most a is no deeper than a t^2/8.
    """
    most = float(drive.Ms) / float(drive.J1) + float(drive.Mc) / float(drive.J2)
    shortest = math.sqrt(8.0 * GRAZE * float(drive.gap) / most)
    kept: list[tuple[float, str]] = []
    for time, kind in events:
        if kept and kind == "closed" and kept[-1][1] == "opened" and time - kept[-1][0] < shortest:
            kept.pop()
        else:
            kept.append((time, kind))
    return kept


def against(run: Run, other: Start) -> list[str]:
    """In what the run differs from the oracle."""
    wrong = []
    drive, end = run.drive, run.at(run.end_time)
    least = 1e-12 * float(drive.c * drive.gap) + 1e-9 * float(drive.Ms)
    if abs(run.peak_torque - abs(other.peak)) > SAME * abs(other.peak) + least:
        wrong.append(f"peak {run.peak_torque!r}, oracle {abs(other.peak)!r}")
    ours = without_touches(drive, [(event.time, KINDS[event.kind]) for event in run.events])
    flanks = ("closed", "opened") if drive.gap == 0.0 else ()  # no gap, no flanks: the shaft pulls too
    others = without_touches(drive, [one for one in other.events if one[1] not in flanks])
    names, kinds = [kind for _, kind in ours], [kind for _, kind in others]
    first = sum(t == 0.0 for t, _ in ours)  # what happens at t = 0 has no order
    if sorted(names[:first]) + names[first:] != sorted(kinds[:first]) + kinds[first:]:
        wrong.append(f"events {names[:8]}, oracle {kinds[:8]}")
    else:
        apart = np.abs(np.subtract([t for t, _ in ours], [t for t, _ in others])).max(initial=0.0)
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


def sensitive(case: Case, run: Run) -> bool:
    """Whether the start itself changes by as much as is complained about, if its parameters hardly do."""
    scale = float(np.abs(run.w1).max() + np.abs(run.w2).max())
    for change in (1e-9, -1e-9):
        try:
            other = case.start(change)
        except (SimulationError, InputError):
            return True
        if [e.kind for e in other.events] != [e.kind for e in run.events]:
            return True
        mine, theirs = run.at(run.end_time), other.at(min(run.end_time, other.end_time))
        apart = [abs(a.time - b.time) for a, b in zip(run.events, other.events, strict=True)]
        if (
            abs(other.peak_torque - run.peak_torque) > 0.1 * SAME * run.peak_torque
            or any(abs(float(mine[n]) - float(theirs[n])) > SAME * scale for n in ("w1", "w2"))
            or max(apart, default=0.0) > 1e-7 * run.end_time
        ):
            return True
    return False


# the run by itself ----------------------------------------------------------------------------------------


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


def itself(case: Case, run: Run) -> list[str]:
    """What must hold of any start by itself."""
    wrong = []
    largest = float(np.abs(run.T).max())
    if run.peak_torque < largest * (1.0 - 1e-9) - 1e-15 * float(run.drive.c * run.drive.gap):
        wrong.append(f"peak {run.peak_torque!r} is less than |T| {largest!r} on the grid")
    figures = [run.peak_torque, run.k_dyn, run.end_time, *run.energy.__dict__.values()]
    if not np.all(np.isfinite([*figures, *run.w1, *run.w2, *run.T])):
        wrong.append("a figure is not finite")
    batch = simulate([run.drive], Profile(profile=case.profile), case.until)
    for name in ("peak_torque", "start_time", "end_time", "contacts"):
        mine, of_batch = float(getattr(run, name)), float(batch[name].item())
        if not np.array_equal(mine, of_batch, equal_nan=True):
            wrong.append(f"{name} {mine!r}, in a batch {of_batch!r}")
    return wrong


def judged(number: int) -> tuple[str, list[str]]:
    """How the start was examined, and what is wrong with it."""
    case = drawn(np.random.default_rng([1, number]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run = case.start()
            wrong = itself(case, run) + balances(run)
    except InputError:
        return "refused", []
    except SimulationError as error:
        lost = any(one.value in str(error) for one in (Status.NOT_LOCATED, Status.NOT_FINITE))
        return "given up", [str(error)] if lost else []
    try:
        with no_longer_than(PATIENCE), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            for rtol in (1e-11, 1e-13):  # in smaller steps it misses less
                differing = against(run, integrated(case, run, rtol))
                if not differing:
                    break
    except (TimeoutError, RuntimeError, ValueError, ArithmeticError, AssertionError, IndexError):
        return "balances", wrong
    if differing and sensitive(case, run):
        return "sensitive", wrong
    return "oracle", wrong + differing


@pytest.mark.parametrize("first", [0, pytest.param(1000, marks=pytest.mark.slow)])
def test_extreme_drives(first: int, pytestconfig: pytest.Config) -> None:
    count = (100 if first else 12) * pytestconfig.getoption("size")
    found = {number: judged(number) for number in range(first, first + count)}
    assert not {number: wrong for number, (_, wrong) in found.items() if wrong}
    assert sum(how == "oracle" for how, _ in found.values()) >= len(found) // 3


@pytest.mark.parametrize("size", [6, pytest.param(100, marks=pytest.mark.slow)])
def test_events_are_located_where_rates_lie_decades_apart(size: int, pytestconfig: pytest.Config) -> None:
    """Each start of drives with rates decades apart, behind lags of any length, comes to its end."""
    rng = np.random.default_rng([0, 77])
    size *= pytestconfig.getoption("size")

    def decades(low: float, high: float) -> np.ndarray:
        return 10.0 ** rng.uniform(math.log10(low), math.log10(high), size)

    profile = TorqueProfile([0.0, 0.15, 0.15, 0.3, 0.3], [40.0, 40.0, 15.0, 15.0, -25.0])
    for law in ("no-pull", "dead-zone", "modelica"):
        for kind in ("active", "reactive"):
            gap = decades(1e-3, 10.0)
            lag = np.where(rng.random(size) < 0.5, decades(1e-42, 1e-3), decades(1e-3, 10.0))
            J1, J2, c = decades(1e-3, 0.1), decades(0.01, 1.0), decades(1e2, 1e4)
            critical = 2.0 * np.sqrt(c / (1.0 / J1 + 1.0 / J2))
            drives = records(
                Drive.load("crane-4amtkf").replace(load_kind=kind, contact_law=law, minimum_torque=-64.0),
                motor_inertia=J1, load_inertia=J2, stiffness=c, gap=gap, torque_lag=lag,
                damping=critical * decades(1e-3, 1e4), load_torque=decades(1e-3, 20.0),
                start_position=gap * rng.uniform(-0.5, 0.5, size),
            )  # fmt: skip
            batch = simulate(drives, Profile(profile=profile), 0.6)
            assert set(batch.status.values.tolist()) <= {"REACHED", "STOPPED_EARLY"}
            assert np.all(np.isfinite(batch.peak_torque.values))
