"""What is safe: the torque stays within its limits and a fault stays, whatever is measured."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.twin import plain

from softstart import (
    Chain,
    Command,
    Drive,
    Measured,
    PlainController,
    Run,
    control_block,
    make_controller,
    simulate,
)
from softstart.chain.elements import LIBRARY
from softstart.controller import Controller, Sensor, ready_controller_names
from softstart.drive import library
from softstart.kernel import guard
from softstart.start.block import ControlBlock
from softstart.start.kernel_input import kernel_input

CRANE = Drive.load("crane-4amtkf")
STRATEGIES = ready_controller_names()
KINDS = ("nan", "late", "jump", "stuck", "torque")


def random_drive(
    seed: int, names: tuple[str, ...] = ("crane-4amtkf", "hoist-15kw", "conveyor-11kw")
) -> Drive:
    """A shipped drive with another gap, load, shaft and path from the demand to the torque."""
    rng = np.random.default_rng(seed)
    drive = Drive.load(names[seed % len(names)])
    options: dict[str, Any] = {
        "gap": float(rng.choice([0.0, drive.gap * rng.uniform(0.2, 4.0)])),
        "load_inertia": float(drive.J2 * 10.0 ** rng.uniform(-1.0, 0.5)),
        "stiffness": float(drive.c * 10.0 ** rng.uniform(-1.0, 0.7)),
        "torque_lag": float(rng.choice([0.0, 10.0 ** rng.uniform(-3.5, -1.5)])),
        "computing_delay": float(rng.choice([0.0, rng.uniform(1e-4, 1e-3)])),
        "encoder_lines": float(rng.choice([0.0, 100.0, 1024.0, 4096.0])),
        "encoder_phase": float(rng.uniform(0.0, 0.9)),
        "torque_noise": float(rng.choice([0.0, 0.02 * drive.Ms])),
        "minimum_torque": float(rng.choice([0.0, -drive.Ms])),
    }
    if rng.random() < 0.3:
        options["torque_rate"] = drive.Ms / float(rng.uniform(0.02, 0.2))
    if rng.random() < 0.3 and options["gap"] > 0.0:
        options["start_position"] = "unknown"
    return drive.replace(**options)


def healthy(machine: Any, name: str) -> None:
    run = simulate(machine, name, time_limit=5.0)
    assert run.fault == "", (machine.name, name, run.fault)


@pytest.mark.parametrize("name", STRATEGIES)
def test_no_start_of_a_shipped_strategy_on_a_shipped_machine_trips(name: str) -> None:
    for drive in map(Drive.load, library.names()):
        healthy(drive, name)
        healthy(drive.replace(torque_lag=0.005, encoder_lines=512, torque_noise=0.02 * drive.Ms), name)
    for chain in map(Chain.load, LIBRARY.names()):
        if chain.motor is not None and chain.target_speed is not None:
            healthy(chain, name)


@pytest.mark.parametrize("seed", range(26))
def test_no_start_on_a_random_drive_trips(seed: int) -> None:
    healthy(random_drive(seed), STRATEGIES[seed % len(STRATEGIES)])


@dataclass(frozen=True)
class InTheLoop(PlainController):
    """A block in place of the controller; what it measures may be changed before. For one run."""

    name: ClassVar[str] = "block"
    saturates: ClassVar[bool] = True
    can_stop: ClassVar[bool] = True
    block: Any = None
    period: float = 0.001
    seen: Sensor = Sensor.NONE
    fault: Fault | None = None
    log: list[tuple[float, float, str]] = field(default_factory=list)

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the strategy."""
        return self.seen

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        share = measured.time / self.period
        if self.seen and self.log and abs(share - round(share)) > 1e-6 * max(share, 1.0):
            return Command(self.log[-1][1])  # an event of the gap: a cyclic program is not called there
        measured, next_sample = (measured, 0.0) if self.fault is None else self.fault.on(measured, self)
        torque, fault = self.block.step(measured)
        self.log.append((measured.time, torque, fault))
        return Command(torque, measured.time + next_sample if next_sample else None)


def loop_of(controller: Controller, drive: Drive, fault: Fault | None = None) -> InTheLoop:
    block = control_block(controller, drive)
    return InTheLoop(block, block.period, block.controller.sensors, fault)


class Fault:
    """One fault from the instant `begin` on."""

    def __init__(self, kind: str, begin: float, rng: np.random.Generator, drive: Drive) -> None:
        self.kind, self.begin, self.rng, self.drive = kind, begin, rng, drive
        self.limits: Any = kernel_input(drive).guarded(0.001).machine.guard
        self.angle = self.fastest = self.offset = 0.0
        self.wrong = rng.choice(["motor_angle", "motor_speed", "motor_torque"])
        self.value = float(rng.choice([math.nan, math.inf, -math.inf]))
        self.sign = float(rng.choice([-1.0, 1.0]))
        self.injected = self.found = math.nan
        self.torques: list[tuple[float, float]] = []  # measured since the sample before

    def on(self, measured: Measured, loop: InTheLoop) -> tuple[Measured, float]:
        """What is measured with the fault, and in how many seconds the next sample comes (0: in time)."""
        active = measured.time >= self.begin
        later = 0.0
        if not active:
            self.fastest = max(self.fastest, abs(measured.motor_speed))
            self.angle = measured.motor_angle
            self.torques = [(measured.time, measured.motor_torque)]
            return measured, later
        first = math.isnan(self.injected)
        self.injected = measured.time if first else self.injected
        self.torques.append((measured.time, measured.motor_torque))
        if self.kind == "nan":
            measured = measured._replace(**{self.wrong: self.value})
        elif self.kind == "late" and first:
            later = float(self.rng.uniform(1.6, 20.0)) * loop.period
        elif self.kind == "jump":
            if first:  # from the size on that the documentation states
                p, T = self.limits, loop.period
                room = (2.0 * self.fastest + p["speed"] + p["acceleration"] * T) * T + 2.0 * p["count"]
                moved = measured.motor_angle - self.angle
                self.offset = self.sign * float(self.rng.uniform(1.01, 50.0)) * (room + abs(moved))
            measured = measured._replace(motor_angle=measured.motor_angle + self.offset)
        elif self.kind == "stuck":
            measured = measured._replace(motor_angle=self.angle, motor_speed=0.0)
        elif self.kind == "torque":
            beyond = 1.5 * (self.drive.maximum_torque - self.drive.minimum_torque) + self.limits["tolerance"]
            measured = measured._replace(motor_torque=measured.motor_torque + self.sign * beyond)
        return measured, later


def moves(fault: Fault, period: float) -> float:
    """When the measured torque must have moved the encoder further than it may miss, by Newton's law."""
    if fault.drive.brake != "none" and fault.angle == 0.0:
        return math.inf  # the brake may hold it
    p, speed, way = fault.limits, 0.0, 0.0
    for (_, before), (time, torque) in itertools.pairwise(fault.torques):
        if torque * before < 0.0:  # the two pushes may cancel each other
            speed = way = 0.0
            continue
        speed = max(speed + (abs(torque) - p["hold"]) / p["inertia"] * period, 0.0)
        way += speed * period
        if way > p["slack"]:
            return time
    return math.inf


def check_safe(name: str, drive: Drive, fault: Fault) -> str:
    """The fault found; the torque is within the limits in each sample, and 0 after the fault."""
    loop = loop_of(make_controller(name), drive, fault)
    run = simulate(drive, loop, until=fault.begin + 0.4)
    times, torques, faults = (list(column) for column in zip(*loop.log, strict=True))
    low, high = drive.minimum_torque, drive.maximum_torque
    limit = getattr(loop.block.controller, "torque_limit", high)
    assert all(max(low, -limit) <= torque <= min(high, limit) for torque in torques)
    realised = run.at(np.linspace(0.0, run.end_time, 500))["u"]
    assert realised.min() >= low - 1e-9
    assert realised.max() <= high + 1e-9
    found = next((k for k, one in enumerate(faults) if one), None)
    if found is None:
        return ""
    assert times[found] >= fault.injected
    assert set(faults[found:]) == {faults[found]}  # latched
    assert set(torques[found:]) == {0.0}
    fault.found = times[found]
    return faults[found]


WORDS = {
    "nan": "measured value not finite", "late": "sample late", "jump": "encoder jumped",
    "torque": "torque does not follow",
}  # fmt: skip


def cases(count: int) -> Iterator[tuple[int, str, str]]:
    for k in range(count):
        yield k, KINDS[k % len(KINDS)], STRATEGIES[(k // len(KINDS)) % len(STRATEGIES)]


def inject(number: int, kind: str, name: str) -> str:
    """Inject it at random; found within the stated time, the word of it or "" where it does not matter."""
    rng = np.random.default_rng(number)
    drive = random_drive(number).replace(start_position="mid-gap", torque_noise=0.0)
    fault = Fault(kind, float(rng.uniform(0.01, 0.3)), rng, drive)
    word = check_safe(name, drive, fault)
    period = control_block(make_controller(name), drive).period
    samples = (fault.found - fault.injected) / period
    if kind == "stuck":  # at once when the torque must have moved it, else not
        bound = moves(fault, period)
        assert word == ("encoder stuck" if math.isfinite(bound) else "")
        assert not word or fault.found <= bound + 1.5 * period
        return word
    assert word == WORDS[kind]
    if kind == "late":
        assert samples < 21.5  # the next sample, whenever it comes
    else:
        assert samples == pytest.approx(2.0 if kind == "torque" else 0.0, abs=0.01)
    return word


@pytest.mark.parametrize(("number", "kind", "name"), list(cases(40)))
def test_an_injected_fault(number: int, kind: str, name: str) -> None:
    inject(number, kind, name)


@pytest.mark.slow
def test_500_injected_faults() -> None:
    words = [(kind, inject(1000 + number, kind, name)) for number, kind, name in cases(500)]
    stuck = [word for kind, word in words if kind == "stuck"]
    assert len(stuck) == 100
    assert sum(word != "" for word in stuck) > 50


ALWAYS_SAMPLED = ("take-up", "state-feedback", "current-limit-feedback", "speed-ramp", "acceleration-delay")


@pytest.mark.parametrize("name", ALWAYS_SAMPLED)
def test_without_a_fault_a_block_has_the_bits_of_the_simulated_controller(name: str) -> None:
    drive = CRANE.replace(torque_lag=0.003, encoder_lines=1024, minimum_torque=-62.0)
    loop = loop_of(make_controller(name), drive)
    one, other = simulate(drive, name, until=0.6), simulate(drive, loop, until=0.6)
    times = np.linspace(0.0, 0.6, 301)
    for key in ("w1", "w2", "T", "u"):
        assert one.at(times)[key] == pytest.approx(other.at(times)[key], rel=1e-12, abs=1e-9), key
    assert {fault for _, _, fault in loop.log} == {""}


@pytest.mark.parametrize("name", ["direct", "ramp", "s-curve", "pulse-coast-hold"])
def test_a_strategy_without_samples_in_a_block_is_sampled_in_each_cycle(name: str) -> None:
    loop = loop_of(make_controller(name), CRANE)
    one, other = simulate(CRANE, name), simulate(CRANE, loop)
    assert {fault for _, _, fault in loop.log} == {""}
    assert other.k_dyn == pytest.approx(one.k_dyn, rel=0.05)
    assert other.start_time == pytest.approx(one.start_time, abs=0.003)


def cycles(block: ControlBlock, count: int, begin: float = 0.0, **values: float) -> list[Any]:
    """Outputs in a row of cycles in which all else is as it should be at rest."""
    at_rest = {"motor_angle": 0.0, "motor_speed": 0.0, "motor_torque": 0.0, "set_speed": 90.0}
    outputs = []
    for k in range(count):
        time = begin + k * block.period
        measured = Measured(time, **{**at_rest, "command_time": time - begin, **values})  # type: ignore[arg-type]
        outputs.append(block.step(measured))
    return outputs


def test_a_new_start_after_a_fault_when_run_goes_from_0_to_1() -> None:
    for name in ("ramp", "speed-ramp", "take-up"):
        block = control_block(make_controller(name), CRANE)
        fresh = cycles(block, 3, motor_torque=3.0)
        assert fresh[-1].fault == ""
        assert cycles(block, 1, 0.004, motor_speed=math.nan)[0] == (0.0, "measured value not finite")
        # all is well again, and the command goes on: no torque
        assert set(cycles(block, 5, 0.005)) == {(0.0, "measured value not finite")}
        assert set(cycles(block, 5, 0.010, run=0.0)) == {(0.0, "measured value not finite")}
        again = cycles(block, 3, 0.015, motor_angle=7.0, motor_torque=3.0)
        assert [output.fault for output in again] == [""] * 3
        assert [output.torque for output in again] == pytest.approx([output.torque for output in fresh])


def test_a_strategy_that_cannot_stop_or_reverse_gives_no_torque_instead() -> None:
    block = control_block(make_controller("direct"), CRANE)
    assert [output.torque for output in cycles(block, 2, motor_torque=62.0)] == [62.0, 62.0]
    assert set(cycles(block, 3, 0.002, run=0.0, motor_torque=10.0)) == {(0.0, "")}
    assert set(cycles(block, 3, 0.005, set_speed=-90.0)) == {(0.0, "")}
    assert [output.torque for output in cycles(block, 2, 0.008, motor_torque=60.0)] == [62.0, 62.0]


@dataclass(frozen=True)
class Wild(PlainController):
    """Demands whatever it is told to."""

    name: ClassVar[str] = "wild"
    demand: float = 0.0
    period: float = 0.001

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        return Command(self.demand)


@pytest.mark.parametrize("demand", [1e300, -1e300, math.inf, -math.inf, math.nan, 63.0])
def test_one_rule_bounds_every_demand(demand: float) -> None:
    for least in (0.0, -20.0):
        drive = CRANE.replace(minimum_torque=least, maximum_torque=62.0)
        torque, fault = control_block(Wild(demand), drive).step(Measured(0.0, 0.0, 0.0, 0.0))
        assert torque == (0.0 if math.isnan(demand) else min(max(demand, least), 62.0))
        assert fault == ("demand not a number" if math.isnan(demand) else "")


def test_a_clock_that_goes_back_is_late() -> None:
    block = control_block(make_controller("take-up"), CRANE)
    cycles(block, 3)
    assert cycles(block, 1, 0.001)[0] == (0.0, "sample late")


def faulty_runs(monkeypatch: pytest.MonkeyPatch) -> list[Run]:
    """Compiled and plain, in a machine whose torque does not follow as its guard thinks."""
    monkeypatch.setattr(guard, "TORQUE_ROOM", -0.01)
    controller = make_controller("take-up").fitted(CRANE)

    class Twin(type(plain(controller, CRANE))):  # type: ignore[misc]
        period = controller.period  # type: ignore[attr-defined]

    twin: Controller = Twin(controller, plain(controller, CRANE).numbers)
    return [simulate(CRANE, one, until=0.1) for one in (controller, twin)]


def test_a_fault_of_a_simulated_start_is_latched_and_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = faulty_runs(monkeypatch)
    for run in runs:
        assert run.fault == "torque does not follow"
        assert run.status.name == "FAULT"
        assert run.summary()["fault"] == run.fault
        u = run.at(np.linspace(0.0, 0.1, 1001))["u"]
        assert (
            np.count_nonzero(u) == 30
        )  # three samples of 1 ms; the third torque is off in a row, and ends it
    assert runs[0].trajectory.states.tobytes() == runs[1].trajectory.states.tobytes()
    assert "fault" not in simulate(CRANE, "direct", until=0.1).summary()
