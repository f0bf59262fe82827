"""Inputs and expected outputs of real starts, in cycles: what an exported control block is tested with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from softstart.controller.base import SAME_SAMPLE, Command, Controller, PlainController, Sensor
from softstart.drive import Drive
from softstart.drive.machine import Machine
from softstart.errors import SimulationError
from softstart.kernel.guard import FAULTS
from softstart.kernel.records import Measured
from softstart.start.block import ControlBlock
from softstart.start.run import Run
from softstart.start.simulation import DriveCommand, simulate

Precision = Literal["float64", "float32"]

ALWAYS = ("cycles", "run", "set_speed", "motor_angle", "motor_speed", "motor_torque")
DECLARED = {
    Sensor.STAGE: "stage", Sensor.SHAFT_TORQUE: "shaft_torque", Sensor.LOAD_SPEED: "load_speed"
}  # fmt: skip
OUTPUTS = ("torque", "fault")
WHOLE = ("cycles", "fault")
DOUBLE = ("motor_angle",)  # in double precision in exports of single precision too

WORN = 4.0  # times the gap
NOISE = 0.005  # of the starting torque, where the drive has no noise of its own
LINES = 4096.0  # of the encoder, where the drive has none
MOST = 2000  # cycles of a start
SHORT = 400  # cycles of a start with a fault
TAIL = 20  # cycles kept of what stays constant
PAUSE = 15  # cycles between a fault and the next start
# how far a block in single precision may be from the expected torque, of the largest torque
ROOM_FLOAT32 = 2e-3

Fault = Literal["", "not finite", "stuck", "jumped", "missed", "torque"]


class VectorRow(NamedTuple):
    """One cycle: the scenario, the inputs by name, torque in N m and code of the fault."""

    scenario: str
    inputs: dict[str, float]
    torque: float
    fault: int


@dataclass(frozen=True)
class Vectors:
    """Cycles of several starts, each with a block that begins anew.

    `columns` are those of the table: scenario, inputs, outputs. `room` is by how much a torque may be off,
    N m: 0 in double precision; else it is compared with the torques of the cycles beside it too, as a
    decision may fall a cycle earlier or later.
    """

    inputs: tuple[str, ...]
    rows: tuple[VectorRow, ...]
    room: float = 0.0

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return ("scenario", *self.inputs, *OUTPUTS)

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios in their order."""
        return tuple(dict.fromkeys(row.scenario for row in self.rows))

    def csv(self) -> str:
        """The table as text: numbers with all digits of a double, nan for what is not a number."""
        lines = [",".join(self.columns)]
        for row in self.rows:
            numbers = [_text(name, row.inputs[name]) for name in self.inputs]
            lines.append(",".join((row.scenario, *numbers, repr(row.torque), str(row.fault))))
        return "\n".join(lines) + "\n"


def _text(name: str, value: float) -> str:
    return str(int(value)) if name in WHOLE or name == "run" else repr(float(value))


def input_names(sensors: Sensor) -> tuple[str, ...]:
    """The inputs of a block, in their order.

    >>> input_names(Sensor.STAGE)[-2:]
    ('motor_torque', 'stage')
    """
    return (*ALWAYS, *(name for sensor, name in DECLARED.items() if sensors & sensor))


@dataclass(frozen=True)
class Scenario:
    """A start: on a machine, commanded, perhaps with a fault of the signals from a cycle on."""

    name: str
    machine: Machine
    cycles: int
    commands: tuple[DriveCommand, ...] = ()
    fault: Fault = ""
    fault_from: int = 0
    fault_until: int = 0


@dataclass(frozen=True)
class Recorded(PlainController):
    """A block that runs as the controller and records its inputs and outputs; for one run."""

    name: ClassVar[str] = "block"
    saturates: ClassVar[bool] = True
    can_stop: ClassVar[bool] = True
    can_reverse: ClassVar[bool] = True
    block: Any = None
    period: float = 0.001
    seen: Sensor = Sensor.NONE
    scenario: Scenario | None = None
    single: bool = False
    rows: list[VectorRow] = field(default_factory=list)
    last: list[float] = field(default_factory=lambda: [-1.0, 0.0, 0.0])  # cycle, torque, angle

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the strategy."""
        return self.seen

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        """One cycle of the block; being asked between two cycles, at an event of the gap, changes nothing."""
        cycle = round(measured.time / self.period)
        last, torque, _ = self.last
        between = abs(measured.time / self.period - cycle) > SAME_SAMPLE * max(1.0, cycle)
        if between or cycle == last:
            return Command(torque)
        assert self.scenario is not None
        if self.scenario.fault == "missed" and cycle == self.scenario.fault_from:
            return Command(torque)  # no cycle here
        seen = self._disturbed(measured, cycle)
        seen = rounded_single(seen) if self.single else seen
        torque, fault = self.block.step(seen)
        names = input_names(self.seen)
        inputs = {name: float(getattr(seen, name)) for name in names if name != "cycles"}
        inputs["cycles"] = 1.0 if last < 0.0 else cycle - last
        self.rows.append(VectorRow(self.scenario.name, inputs, torque, FAULTS.index(fault)))
        self.last[:] = cycle, torque, seen.motor_angle
        return Command(torque)

    def _disturbed(self, measured: Measured, cycle: int) -> Measured:
        """What is measured with the fault of the scenario."""
        case = self.scenario
        assert case is not None
        if not case.fault_from <= cycle < case.fault_until:
            return measured
        drive = case.machine.design_drive
        if case.fault == "not finite":
            return measured._replace(motor_speed=math.nan)
        if case.fault == "stuck":
            return measured._replace(motor_angle=self.last[2], motor_speed=0.0)
        if case.fault == "jumped":
            return measured._replace(motor_angle=measured.motor_angle + 1000.0)
        if case.fault == "torque":
            range_of_torque = float(drive.maximum_torque - drive.minimum_torque)
            return measured._replace(motor_torque=measured.motor_torque - 2.0 * range_of_torque)
        return measured


def rounded_single(measured: Measured) -> Measured:
    """What is measured, in single precision but for time and angle.

    >>> rounded_single(Measured(0.1, 0.1, 0.1, 0.0))[:3]
    (0.1, 0.1, 0.10000000149011612)
    """
    kept = {"time", "command_time", *DOUBLE}
    values = {
        name: value if name in kept else float(np.float32(value))
        for name, value in measured._asdict().items()
    }
    return Measured(**values)


def make_vectors(
    controller: Controller, machine: Machine, period: float | None = None, real: Precision = "float64"
) -> Vectors:
    """Cycles of starts of a machine under the control block of a controller.

    Parameters
    ----------
    controller : with the parameters that are exported.
    machine : the drive or chain for which it is exported; its guard is that of this one.
    period : time between two cycles, s.
    real : the precision of the export; in single precision the inputs are rounded to it.

    Returns
    -------
    The scenarios: the start as it is, with a worn gap, with encoder and noise, stopped on the way and started
    again, reversed (strategies that can), and with faults of the signals, each with a new start behind it.

    Raises
    ------
    SimulationError
        If the start as it is cannot be finished.

    Examples
    --------
    >>> from softstart.controller import make_controller
    >>> vectors = make_vectors(make_controller("direct"), Drive.load("crane-4amtkf"))
    >>> vectors.columns[:4], vectors.rows[0].torque
    (('scenario', 'cycles', 'run', 'set_speed'), 62.0)
    """
    rows: list[VectorRow] = []
    sample = ControlBlock(controller, block_drive(machine), period)
    for scenario in scenarios(sample.controller, machine, sample.period):
        block = ControlBlock(controller, block_drive(machine), period)
        recorder, failure = record(scenario, block, real == "float32")
        if failure is not None and scenario.name == "nominal":
            raise failure
        rows += _without_constant_tail(recorder.rows)
    drive = block_drive(machine)
    room = ROOM_FLOAT32 * max(abs(float(drive.maximum_torque)), abs(float(drive.minimum_torque)))
    return Vectors(input_names(sample.controller.sensors), tuple(rows), room if real == "float32" else 0.0)


def block_drive(machine: Machine) -> Drive:
    """The drive by whose limits a block guards: the machine itself, or the two masses of a chain."""
    return machine if isinstance(machine, Drive) else machine.design_drive


def record(
    scenario: Scenario, block: Any, single: bool = False
) -> tuple[Recorded, SimulationError | None]:  # fmt: skip
    """The start of a scenario under a block, cycle by cycle; what has failed, if it could not be finished."""
    recorder = Recorded(block, block.period, block.controller.sensors, scenario, single)
    try:
        simulate(
            scenario.machine, recorder, until=scenario.cycles * block.period, commands=scenario.commands
        )  # fmt: skip
    except SimulationError as error:
        return recorder, error
    return recorder, None


def run_in_cycles(machine: Machine, block: Any, until: float | None = None) -> Run:
    """The start of a machine under a block that is called in cycles, as a drive calls it: for K_dyn."""
    case = Scenario("nominal", machine, 0)
    run = simulate(machine, Recorded(block, block.period, block.controller.sensors, case), until=until)
    assert isinstance(run, Run)
    return run


def scenarios(controller: Controller, machine: Machine, period: float) -> list[Scenario]:
    """The starts that are recorded."""
    known = _at_one_position(machine)
    target, base = float(known.design_drive.target_speed), simulate(known, controller)
    whole = min(math.ceil(base.end_time / period) + TAIL, MOST)
    nominal = Scenario("nominal", known, whole)
    found = [nominal]
    if isinstance(known, Drive) and known.gap > 0.0:
        found.append(Scenario("worn", known.replace(gap=WORN * known.gap), min(2 * whole, MOST)))
    if isinstance(known, Drive):
        found.append(Scenario("noisy", _noisy(known), whole))
    middle = max(whole // 3, 5)
    stop, again = middle * period, (middle + 60) * period
    off_again: tuple[DriveCommand, ...] = ((stop, 0, target), (again, 1, target))
    short = min(middle + 60 + SHORT, MOST)
    found.append(Scenario("stopped", known, short, off_again))
    if controller.can_reverse:
        found.append(Scenario("reversed", known, min(whole + SHORT, MOST), ((stop, 1, -target),)))
    early = min(max(whole // 5, 4), SHORT // 2)
    faults: Sequence[Fault] = ("not finite", "stuck", "jumped", "missed", "torque")
    for fault in faults:
        lasts = SHORT // 2 if fault == "stuck" else 10 if fault == "torque" else 1
        end = early + lasts
        restart = ((end + 5) * period, 0, target), ((end + PAUSE) * period, 1, target)
        name = fault.replace(" ", "-")
        found.append(Scenario(name, known, end + PAUSE + SHORT // 2, restart, fault, early, end))
    return found


def _at_one_position(machine: Machine) -> Machine:
    """The machine, which begins at the middle of its gap where its position is unknown."""
    if isinstance(machine, Drive) and len(machine.positions) > 1:
        return machine.replace(start_position="mid-gap")
    return machine


def _noisy(drive: Drive) -> Drive:
    """The drive with the lag that it has, and with an encoder and noise of the torque."""
    return drive.replace(
        encoder_lines=drive.encoder_lines or LINES, torque_noise=drive.torque_noise or NOISE * drive.Ms
    )


def _without_constant_tail(rows: list[VectorRow]) -> list[VectorRow]:
    """The rows up to where torque, fault and command do not change any more, and some of those."""
    kept = len(rows)

    def same(one: VectorRow, other: VectorRow) -> bool:
        return (one.torque, one.fault, one.inputs["run"]) == (other.torque, other.fault, other.inputs["run"])

    while kept > 1 and same(rows[kept - 1], rows[kept - 2]):
        kept -= 1
    return rows[: kept + TAIL]
