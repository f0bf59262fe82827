"""A control block on the exact plant, with 500 faults: of the signals, of the cycles, and of the command.

A block is anything with `period`, `controller` and `step(measured)`: what is exported can take its place.

*No harder than a step.* From an instant on the peak of the shaft torque is at most that of a step of the
motor torque from 0 to Ms out of the state of that instant. Of that step the exact simulator is continued from
a copy of its whole state, with the realised torque Ms from then on: no lag, no dead time. A torque that only
falls cannot exceed it: let M be the mean of the shaft torque and A the amplitude of its swing. Ms raises M at
once to the most that it can be; each fall of M by x raises A by x at most, so M + A never grows.

- From the detection of a fault on this holds in every case: the torque falls to 0 and stays there.
- From the fault itself on it holds too, but for a stuck encoder, which is found once the motor should have
  moved (0.05 to 0.2 s later where friction may hold it). Until then the strategy goes on with what it sees,
  and its torque comes at another time than that of the step, when a gap that was closed may have opened.
  `test_a_stuck_encoder_...` has the worst case of 1,500: 1.5 times the step.
- From a restart on it holds but for a load that only its brake can hold, which is open in these starts: while
  the torque comes late, by lag or strategy, it falls faster and faster (`test_a_load_...`, 1.35 times).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
import pytest
from tests.softstart.test_guard import STRATEGIES, loop_of, random_drive

from softstart import Drive, Measured, control_block, make_controller, simulate
from softstart.controller import Controller
from softstart.controller.base import period_of
from softstart.kernel import records as rec
from softstart.start.block import BlockOutput
from softstart.start.kernel_input import kernel_input
from softstart.start.trajectory import StartRecorder

WORDS = {
    "nan": "measured value not finite", "inf": "measured value not finite", "jumped": "encoder jumped",
    "late": "sample late", "missed": "sample late", "torque": "torque does not follow",
}  # fmt: skip
KINDS = ("nan", "inf", "stuck", "jumped", "late", "missed", "torque", "restart", "stop")
SIGNALS = ("motor_angle", "motor_speed", "motor_torque")
AFTER = 0.3  # s that are followed after a fault
AGAIN = 0.2  # s after it, when all is well again and a new start is commanded
ROUNDING = 1e-9
PAUSE = 5  # cycles without `run`


class Block(Protocol):
    """What is tested."""

    period: float
    controller: Controller

    def step(self, measured: Measured) -> BlockOutput:
        """One cycle."""


@dataclass
class Case:
    """A fault at the first cycle from `begin` on."""

    kind: str
    begin: float
    rng: np.random.Generator
    drive: Drive
    wrong: str = field(init=False)
    sign: float = field(init=False)
    kept: Measured | None = None  # of the cycle before

    def __post_init__(self) -> None:
        self.wrong, self.sign = str(self.rng.choice(SIGNALS)), float(self.rng.choice([-1.0, 1.0]))

    def seen(self, measured: Measured, since: float, period: float) -> Measured:
        """What the block is given, so long after the begin of the fault."""
        if since < 0.0:
            self.kept = measured
            return measured
        if since >= AGAIN:  # well again: a new start
            return measured._replace(run=0.0 if since < AGAIN + PAUSE * period else 1.0)
        if self.kind == "nan":
            return measured._replace(**{self.wrong: math.nan})
        if self.kind == "inf":
            return measured._replace(**{self.wrong: self.sign * math.inf})
        if self.kind == "stuck":
            angle = 0.0 if self.kept is None else self.kept.motor_angle
            return measured._replace(motor_angle=angle, motor_speed=0.0)
        if self.kind == "jumped":
            return measured._replace(motor_angle=measured.motor_angle + 1e3 * self.sign)
        if self.kind == "torque":
            room = 3.0 * (self.drive.maximum_torque - self.drive.minimum_torque)
            return measured._replace(motor_torque=measured.motor_torque + self.sign * room)
        if self.kind == "restart":
            return measured._replace(run=0.0 if since < PAUSE * period else 1.0)
        return measured._replace(run=0.0) if self.kind == "stop" else measured


class Cycle(NamedTuple):
    """A cycle of a block, so long after the fault (s), with the realised torque."""

    since: float
    torque: float
    fault: str
    realised: float


@dataclass
class Comparison:
    """Peak of the shaft torque from an instant on, and that of the step out of the state of then, N m."""

    of_step: float
    peak: float = 0.0

    @property
    def share(self) -> float:
        """The peak as a share of that of the step."""
        return self.peak / self.of_step


@dataclass
class Outcome:
    """All cycles; what is compared from the fault, its detection, and the restart on."""

    cycles: list[Cycle]
    compared: dict[str, Comparison]


def advance(recorder: StartRecorder) -> int:
    """To the next cycle or the end."""
    reason = recorder.advance()
    assert reason in (rec.ASK, rec.ENDED)
    return reason


def peak_of_step(recorder: StartRecorder, torque: float, until: float) -> float:
    """Peak of the shaft torque if from this state on the motor torque is constant; N m."""
    other = StartRecorder(recorder.input, recorder.sees, 0)
    other.work[:] = recorder.work
    now = other.state
    now.u = now.u_ref = now.demand = torque
    now.slope = now.demand_slope = now.pending = now.peak[0] = 0.0
    now.t_end = until
    assert other.answer(torque, math.inf, 0.0) == rec.ASK
    while advance(other) != rec.ENDED:
        pass
    return float(now.peak[0])


def follow(block: Block, drive: Drive, case: Case) -> Outcome:
    """A start of the exact plant under the block, with the fault."""
    recorder = StartRecorder(kernel_input(drive), int(block.controller.sensors), 0)
    recorder.begin(case.begin + AGAIN + AFTER, False)
    now, period, begin = recorder.state, block.period, math.inf
    outcome = Outcome([], {})

    def compare(what: str) -> None:
        outcome.compared[what] = Comparison(peak_of_step(recorder, float(drive.Ms), begin + AGAIN))

    while advance(recorder) == rec.ASK:
        recorder.measure()
        measured = Measured(*recorder.measured.tolist())
        since = measured.time - begin
        for what, one in outcome.compared.items():
            if since < AGAIN and not (what == "fault" and "restart" in outcome.compared):
                one.peak = max(one.peak, float(now.peak[0]))
        now.peak[0] = 0.0
        next_at = (round(measured.time / period) + 1) * period
        if measured.time >= case.begin and begin == math.inf:
            begin, since = measured.time, 0.0
            compare("fault")
            if case.kind == "late":
                next_at += period * float(case.rng.uniform(0.6, 20.0))
            if case.kind == "missed":
                recorder.answer(outcome.cycles[-1].torque, next_at, 0.0)
                continue
        if case.kind == "restart" and abs(since - PAUSE * period) < 0.5 * period:
            compare("restart")
        torque, fault = block.step(case.seen(measured, since, period))
        if fault and "found" not in outcome.compared:
            compare("found")
        outcome.cycles.append(Cycle(since, torque, fault, float(now.u)))
        recorder.answer(torque, next_at, 0.0)
    return outcome


def injected(number: int) -> tuple[Outcome, Case, Block]:
    """A fault of each kind, under each strategy, at a random instant of the start of a random drive."""
    rng = np.random.default_rng(5000 + number)
    kind, name = KINDS[number % len(KINDS)], STRATEGIES[(number // len(KINDS)) % len(STRATEGIES)]
    drive = next(iter(random_drive(number).positions.values()))
    case = Case(kind, float(rng.uniform(0.01, 0.3)), rng, drive)
    block = control_block(make_controller(name), drive)
    return follow(block, drive, case), case, block


def check(number: int) -> str:
    """That all is safe; the fault that the block has found, "" for none."""
    outcome, case, block = injected(number)
    drive, cycles = case.drive, outcome.cycles
    low, high = drive.minimum_torque, drive.maximum_torque
    limit = getattr(block.controller, "torque_limit", high)
    for cycle in cycles:
        assert max(low, -limit) <= cycle.torque <= min(high, limit)  # and so it is a number
        assert low - 1e-9 <= cycle.realised <= high + 1e-9
    before = [cycle for cycle in cycles if cycle.since < 0.0]
    during = [cycle for cycle in cycles if 0.0 <= cycle.since < AGAIN]
    after = [cycle for cycle in cycles if cycle.since > AGAIN + (PAUSE + 1) * block.period]
    assert {cycle.fault for cycle in before} <= {""}
    found = next((k for k, cycle in enumerate(during) if cycle.fault), None)
    word = "" if found is None else during[found].fault
    if case.kind in WORDS:
        assert word == WORDS[case.kind]
    elif case.kind != "stuck":
        assert word == ""
    if found is not None:
        assert {cycle.fault for cycle in during[found:]} == {word}  # latched
        assert {cycle.torque for cycle in during[found:]} == {0.0}
    if case.kind == "stop" and not block.controller.can_stop:
        assert {cycle.torque for cycle in during} == {0.0}
    assert {cycle.fault for cycle in after} == {""}  # a new start runs
    for what, one in outcome.compared.items():
        falls = what == "restart" and drive.brake != "none"
        if not falls and not (what == "fault" and case.kind == "stuck"):
            assert one.peak <= one.of_step * (1.0 + ROUNDING), what
    return word


@pytest.mark.parametrize("number", range(40))
def test_a_fault(number: int) -> None:
    check(number)


@pytest.mark.slow
def test_500_faults() -> None:
    words = [check(number) for number in range(500)]
    assert set(words) == {*WORDS.values(), "encoder stuck", ""}


def test_a_stuck_encoder_that_is_found_late_may_be_harder_than_the_step() -> None:
    outcome, case, _ = injected(641)
    assert case.kind == "stuck"
    assert 1.4 < outcome.compared["fault"].share < 1.6
    assert outcome.compared["found"].share <= 1.0 + ROUNDING


def test_a_load_that_its_brake_does_not_hold_is_caught_the_harder_the_later() -> None:
    outcome, case, _ = injected(439)
    assert (case.kind, case.drive.brake) == ("restart", "motor")
    assert 1.3 < outcome.compared["restart"].share < 1.4


SAMPLED = (
    "acceleration-delay", "current-limit-feedback", "pulse-coast-hold", "ramp", "s-curve", "shaped",
    "speed-ramp", "state-feedback", "take-up",
)  # fmt: skip


def test_these_are_the_strategies_with_samples() -> None:
    drive = Drive.load("crane-4amtkf")
    fitted = [make_controller(name).set_up(drive)[0] for name in STRATEGIES]
    assert tuple(one.name for one in fitted if period_of(one) > 0.0) == SAMPLED


@pytest.mark.parametrize("name", SAMPLED)
def test_a_block_demands_what_the_simulated_strategy_does_to_the_bit(name: str) -> None:
    """A start at t = 0 and angle 0 (else the block subtracts the first angle), cycles as long as samples.

    Without a slew limiter, whose output is recorded in place of the demand.
    """
    for seed in range(4):
        drive = random_drive(seed).replace(start_position="mid-gap", torque_rate=math.inf)
        loop = loop_of(make_controller(name), drive)
        demands = []
        for controller in (name, loop):
            trajectory = simulate(drive, controller, until=0.4).trajectory
            times = (np.arange(math.floor(0.4 / loop.period) - 1) + 0.5) * loop.period
            demands.append(trajectory.spans[trajectory.index(times), rec.S_REF])
        assert demands[0].tobytes() == demands[1].tobytes()
