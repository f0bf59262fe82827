"""The steps of a duty, one after the other: each begins in the state that the last has left."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from softstart.controller.base import Controller, Regulation, Sensor, label_of
from softstart.drive import Drive, Machine
from softstart.drive.duty import LOAD_KEYS, DutyStep
from softstart.errors import InputError, SimulationError
from softstart.kernel import records as rec
from softstart.start.engine import segment_of
from softstart.start.kernel_input import MAX_EVENTS, PATIENT, SLOW_SHARE, KernelInput, kernel_input
from softstart.start.status import Status, status_of
from softstart.start.trajectory import FIRST_ROWS, StartRecorder, Trajectory

STANDING = 0.01  # share of the target speed within which a mass stands
HELD = 1e-9  # share of it that is left of the speed of a motor that a brake holds
NEVER_RELEASED = 1e300  # s
Go = Callable[[], int]  # goes on to the end that is set, and returns why it came back
Line = tuple[float, float, float]  # torque, N m, length, s, slope, N m/s
ZERO: list[Line] = [(0.0, math.inf, 0.0)]


class StepError(SimulationError):
    """A step that cannot be finished, or does not end, and how it ended."""

    def __init__(self, sentence: str, status: Status = Status.NOT_CARRIED_OUT) -> None:
        super().__init__(sentence)
        self.status = status


@dataclass(frozen=True, eq=False)
class Phase:
    """A part of a step under one torque: what is recorded of it, and where its time and angle begin.

    `time` and `angle` are those of the duty at the zero of the trajectory, s and rad of the load; `begin` is
    when it begins, s of the duty, `travel` the angle by which the load turns in it, rad at the motor shaft.
    """

    what: str
    step: int  # its place among the steps that are carried out in a cycle
    cycle: int
    time: float
    angle: float
    trajectory: Trajectory
    rest: float  # since when all masses stand, s of the duty; NaN where this does not end the phase
    begin: float
    travel: float

    @property
    def end(self) -> float:
        """When it ends, s of the duty."""
        return self.time + float(self.trajectory.notes.time)


class DutyCycle:
    """A machine in a duty: it carries out steps, and yields the phases of each.

    `stop` says how a step stops that does not say it itself: "strategy", "torque", "coast" or "brake".
    """

    def __init__(
        self, machine: Machine, controller: Controller, design: Drive, stop: str, room: int = FIRST_ROWS
    ) -> None:
        self.machine, self.controller, self.design, self.stop_by = machine, controller, design, stop
        self.regulation = controller.regulation(design)
        self.target = float(machine.target_speed or math.inf)
        self.rows = kernel_input(machine)
        self.recorder = StartRecorder(self.rows, int(controller.sensors), room)
        self.go: Go | None = None  # of the controller, while it is in command
        self.begun = False  # whether anything has been simulated
        self.closed = machine.brake_torque > 0.0  # whether the brake is
        self.sense = 1.0  # frame of the controller
        self.speed = 0.0  # commanded speed, rad/s; 0 at standstill
        self.time = self.angle = 0.0  # of the duty at the zero of the recorder
        self.begins_at = 0.0  # when the controller in command has begun, which waits for its brake
        self.began = 0.0  # when the phase began, of the recorder
        self.since = np.full(self.rows.count, math.nan)  # since when each mass stands, in a stop
        self.starts = self.step = self.cycle = 0

    @property
    def now(self) -> float:
        """The time of the recorder, s."""
        return float(self.recorder.state.time) if self.begun else 0.0

    @property
    def patience(self) -> float:
        """How long a step may take that ends by itself, s."""
        return float(self.rows.machine.time_limit)

    @property
    def motor_speed(self) -> float:
        """The speed of the motor, rad/s."""
        return float(self.recorder.state.w[int(self.rows.machine.motor)])

    @property
    def braked(self) -> bool:
        """Whether the motor has a brake."""
        return self.machine.brake_torque > 0.0

    @property
    def forward(self) -> float:
        """The direction of the command, 1 or -1."""
        return math.copysign(1.0, self.speed)

    # ---- phases ------------------------------------------------------------------------------------------

    def _input(self, begins: bool, release_at: float, begins_at: float) -> KernelInput:
        """The machine as it is now, with its brake, for the commanded speed."""
        machines, masses = self.rows.machines.copy(), self.rows.masses.copy()
        row, state = machines[0].view(rec.MACHINE)[0], self.recorder.state
        row.target = abs(self.speed) or self.target
        row.set_speed = self.sense * self.speed
        row.longest = math.inf
        row.event_cap = (state.asked if self.begun else 0.0) + MAX_EVENTS
        row.release_at, row.begins_at = release_at, begins_at
        row.noise_seed += max(self.starts - 1, 0)  # another noise in each start
        if not self.begun:
            row.encoder_phase *= self.sense
        else:
            row.encoder_phase = self._encoder_phase(row.encoder, begins)
            masses[0].view(rec.MASS)[:, 0]["w0"] = state.w[: self.rows.count]  # for the balance of energy
        if self.closed and math.isfinite(self.machine.brake_torque):
            masses[0].view(rec.MASS)[int(row.motor), 0].friction += self.machine.brake_torque
        return replace(self.rows, machines=machines, masses=masses)

    def _encoder_phase(self, count: float, begins: bool) -> float:
        """The phase with which the edges stay in place when the frame turns or the angle begins at 0."""
        state = self.recorder.state
        flip = self.sense * state.sense
        if count == 0.0 or (flip > 0.0 and not begins):
            return float(state.encoder_phase)
        begin = state.sense * state.phi / count if begins else 0.0
        phase = flip * (begin + state.encoder_phase + 0.5) - 0.5
        return float(phase - round(phase))

    def phase(
        self, what: str, go: Go | list[Line], until: float, *, begins: bool = False, release_at: float = 0.0,
        fields: Mapping[str, float] = {},
    ) -> Phase:  # fmt: skip
        """Go on to an instant of the recorder, or to an event of the step; SimulationError if that fails.

        `go` is the controller, or lines of the motor torque. `fields` are those of the state of the kernel.
        """
        recorder, lines = self.recorder, go if isinstance(go, list) else []
        if lines:
            self.sense = self.forward if self.speed != 0.0 else self.sense
        locked = self.closed and math.isinf(self.machine.brake_torque)
        begins_at = 0.0 if lines else self.begins_at
        recorder.input = self._input(begins, NEVER_RELEASED if locked else release_at, begins_at)
        on_gap = begins and bool(self.controller.sensors & Sensor.STAGE)
        if not self.begun:
            recorder.begin(until, on_gap)
            recorder.state.contacts = 0.0  # a start in contact closes no gap
            self.begun = True
        else:
            if begins:
                self.time, self.angle = self.time + self.now, self.angle + float(recorder.state.phi)
            recorder.go_on(begins)
        state = recorder.state
        self.began, angle = float(state.time), float(state.phi)
        state.sense, state.t_end = self.sense, until
        if self.speed != 0.0:
            state.toward = self.forward
        if begins:
            state.ask_on_gap = 1.0 if on_gap else 0.0
        if lines:
            state.ask_at, state.ask_on_gap = state.time, 0.0
        if locked or release_at > 0.0:
            state.braked, state.w[int(state.motor)] = 1.0, 0.0
        elif begins:
            state.braked = 0.0
        for name, value in fields.items():
            setattr(state, name, value)
        recorder.watch()
        reason = self._along(lines)() if isinstance(go, list) else go()
        state.status = reason
        status = status_of(reason, True, True)
        if not status.finished:
            raise StepError(f"{status.value} {self.where}, {what}.", status)
        slowed = "slow" in fields and math.isnan(state.slow)
        rest = self._rested(self.now < until and not slowed) if state.still > 0.0 else math.nan
        return Phase(
            what, self.step, self.cycle, self.time, self.angle, recorder.finished(), rest,
            self.time + self.began, float(state.phi) - angle,
        )  # fmt: skip

    def _rested(self, ended: bool) -> float:
        """Since when all masses stand, s of the duty; NaN where one does not, or has not for long enough."""
        state, count = self.recorder.state, self.rows.count
        since = self.time + state.still_since[:count]
        before = since > self.time + self.began  # a mass that stood as the phase began has stood for longer
        self.since = np.where(before | np.isnan(self.since) | np.isnan(since), since, self.since)
        return float(self.since.max()) if ended else math.nan

    def _along(self, lines: list[Line]) -> Go:
        """The motor torque along lines, the last one to the end."""
        recorder, left = self.recorder, iter(lines)

        def run() -> int:
            while True:
                reason = recorder.advance()
                if reason == rec.BUFFER_FULL:
                    recorder.grow()
                elif reason == rec.ASK:
                    torque, length, slope = next(left)
                    reason = recorder.answer(torque, recorder.state.time + length, slope)
                if reason not in (rec.ASK, rec.BUFFER_FULL):
                    return reason

        return run

    @property
    def where(self) -> str:
        """The step, for sentences."""
        return f"{self.machine.name}, {label_of(self.controller)}, cycle {self.cycle + 1} of the duty"

    def _give_up(self, step: DutyStep, why: str) -> NoReturn:
        raise StepError(f'[duty] {self.step + 1}, do = "{step.do}": {why} ({self.where}).')

    # ---- motion ------------------------------------------------------------------------------------------

    def carry_out(self, step: DutyStep, last: bool) -> list[Phase]:
        """The phases of a step; `last` in a duty that ends with it, in motion."""
        if step.do in ("start", "reverse"):
            return list(self._start(step, last))
        if step.do == "jog":
            return [*self._start(step, False), *self._stop(step, self.now, None)]
        if step.do == "hold":
            return list(self._hold(step))
        if step.do == "load":
            return list(self._load(step))
        return list(self._stop(step, self.now, step.time))

    def _start(self, step: DutyStep, last: bool) -> Iterator[Phase]:
        before, began = self.speed, self.now
        self.speed = float(step.set_speed or (-before if step.do == "reverse" else self.target))
        begins = self.go is None or not self.controller.can_reverse
        begins = begins or (step.do == "start" and self.forward != self.sense)
        if begins:
            self.sense = self.forward
            self.starts, began = self.starts + 1, 0.0
            self.go = segment_of(self.controller, self.design, self.recorder)
        assert self.go is not None
        release = self.machine.release_time if before == 0.0 and begins else 0.0
        if release > 0.0 and self.begun and abs(self.motor_speed) > 2.0 * HELD * self.target:
            raise InputError(
                f'[duty] {self.step + 1}, do = "{step.do}": the motor still moves, and its brake is to hold '
                f"it until it is open ({self.where}); let the stop before it end by itself, without a time."
            )
        if begins:
            self.begins_at = float(self.rows.machine.begins_at) if release > 0.0 else 0.0
        seen = began + (self.begins_at if begins else 0.0)
        self.closed = False
        travel = {} if step.angle is None else self._travel(step.angle, begins)
        until = began + (math.inf if step.time is None else step.time)
        if step.angle is not None:
            until = min(until, began + self._journey(step.angle))
        command = {"run": 1.0, "set_speed": self.sense * self.speed, "command_since": seen}
        fields = {**command, **travel}
        held = not (last and math.isinf(until))
        if self.regulation is not None:
            fields |= self._settling(self.regulation, seen, abs(self.speed - before) / self.target)
        else:
            fields |= {"ends_at_target": 1.0 if held else 0.0, "time_limit": began + self.patience}
        phase = self.phase(step.do, self.go, until, begins=begins, release_at=release, fields=fields)
        yield phase
        if self.regulation is not None:
            if math.isinf(until) and math.isnan(phase.trajectory.notes.settled):
                self._give_up(
                    step, f"the load does not settle at its set speed within {self.now - began:.4g} s"
                )
        else:
            reached = not math.isnan(phase.trajectory.notes.start_time)
            if math.isinf(until) and not reached:
                self._give_up(step, f"the load does not reach its set speed within {self.patience:.4g} s")
            if reached and not math.isinf(until) and self.now < until:
                yield self._held(step, until, travel)
        self._check_travel(step)

    def _settling(self, regulation: Regulation, began: float, change: float) -> dict[str, float]:
        """When a step under a strategy that holds the speed is over, which has no other end."""
        band, command = regulation.band * self.target, regulation.command_end * max(1.0, change)
        limit = PATIENT * (command + regulation.dwell) + SLOW_SHARE * self.patience
        return {
            "regulated": 1.0, "band_low": self.speed - band, "band_high": self.speed + band,
            "command_end": began + command, "dwell": regulation.dwell, "time_limit": began + limit,
        }  # fmt: skip

    def _travel(self, angle: float, begins: bool) -> dict[str, float]:
        """The angle of the load at which a step ends."""
        from_here = 0.0 if begins else float(self.recorder.state.phi)
        return {"travel_end": self.forward * from_here + angle}

    def _journey(self, angle: float) -> float:
        """How long a motion by an angle may take, s."""
        return self.patience + PATIENT * angle / abs(self.speed)

    def _check_travel(self, step: DutyStep) -> None:
        """Whether the load has turned by the angle of the step."""
        if step.angle is not None and not math.isnan(self.recorder.state.travel_end) and step.time is None:
            self._give_up(step, f"the load does not turn by {step.angle:.4g} rad")

    def _held(self, step: DutyStep, until: float, travel: dict[str, float]) -> Phase:
        """Behind a torque strategy: in a line to the torque that holds the load, then that."""
        self.go = None
        forward, period = self.forward, float(self.rows.machine.period)
        hold = forward * holding_torque(self.rows, self.speed)
        limits, room = self.rows.machine, HELD * self.machine.motor.starting_torque
        if not limits.u_min - room <= hold <= limits.u_max + room:
            key = "minimum_torque" if hold < limits.u_min else "maximum_torque"
            self._give_up(step, f"the motor has not the {hold:.4g} N*m that hold the load; see motor.{key}")
        torque = forward * float(self.recorder.state.u_ref)
        lines = [(hold, math.inf, 0.0)]
        if torque != hold and period > 0.0:
            lines.insert(0, (torque, period, (hold - torque) / period))
        return self.phase("hold", lines, until, fields=travel)

    def _hold(self, step: DutyStep) -> Iterator[Phase]:
        if self.speed == 0.0:  # a pause, without torque, or held by the strategy
            assert step.time is not None
            yield self.phase("pause", self.go or ZERO, self.now + step.time)
            return
        before, began = self.speed, self.now
        self.speed = float(step.set_speed or self.speed)
        travel = {} if step.angle is None else self._travel(step.angle, False)
        length = math.inf if step.time is None else step.time
        until = began + (length if step.angle is None else min(length, self._journey(step.angle)))
        if self.go is None or self.regulation is None:
            yield self._held(step, until, travel)
        else:
            command = {} if self.speed == before else {"command_since": began}
            fields = {"set_speed": self.sense * self.speed, **command, **travel}
            fields |= self._settling(self.regulation, began, 1.0)
            yield self.phase("hold", self.go, until, fields=fields)
        self._check_travel(step)

    def _load(self, step: DutyStep) -> Iterator[Phase]:
        speeds = self.recorder.state.w[: self.rows.count] if self.begun else np.zeros(1)
        if np.abs(speeds).max() > STANDING * self.target:
            raise InputError(
                f'[duty] {self.step + 1}, do = "load": the machine still moves when its load changes '
                f"({self.where}); let the stop before it end by itself, without a time."
            )
        changes = {key: value for key, value in step.given().items() if key in LOAD_KEYS}
        self.machine = self.machine.with_load(changes, step.mass or "")
        self.since[:] = math.nan
        self.rows = kernel_input(next(iter(self.machine.positions.values())))
        yield from self._rest(step, self.now, step.time)

    # ---- standstill --------------------------------------------------------------------------------------

    def _stop(self, step: DutyStep, command: float, time: float | None) -> Iterator[Phase]:
        """By the strategy, a torque, coasting or the brake, to rest."""
        by = "brake" if step.do == "brake" else step.by or self.stop_by
        if by != "strategy":
            self.go = None
        elif self.go is None:  # it has handed over
            self._give_up(step, f"{label_of(self.controller)} is not in command")
        self.since = np.full(self.rows.count, math.nan)
        stopping = self._watched(math.inf) | (
            {"run": 0.0, "command_since": command} if by == "strategy" else {}
        )
        torque = -float(step.braking_torque or -self.machine.motor.minimum_torque) if by == "torque" else 0.0
        go: Go | list[Line] = self.go or [(torque, math.inf, 0.0)]
        slow, still = 0.0 if step.brake_speed is None else step.brake_speed, STANDING * self.target
        timed = step.brake_time is not None
        slows = not timed and (by == "torque" or (by == "coast" and self.braked) or slow > 0.0)
        if timed or (slows and self.forward * self.motor_speed > slow):
            until = command + (self._coasting if step.brake_time is None else step.brake_time)
            until = min(until, math.inf if time is None else command + time)
            if slows:
                stopping["slow"] = slow if abs(holding_torque(self.rows, 0.0)) > 0.0 else max(slow, still)
            yield self.phase("stop", go, until, fields=stopping)
            if slows and not math.isnan(self.recorder.state.slow) and time is None:
                self._give_up(step, f"the motor does not come to a standstill within {until - command:.4g} s")
        stopped = timed or slows or by == "brake"
        over = time is not None and self.now >= command + time
        if stopped and self.braked and not over:
            yield from self._close(step)
        yield from self._rest(step, command, time, {} if stopped else stopping)
        if self.braked and not self.closed:
            yield from self._close(step)
            yield from self._motor_stands(step)

    @property
    def _coasting(self) -> float:
        """How long a stop may take, s: more where friction far from the motor slows the machine down."""
        inertia = self.rows.masses[0].view(rec.MASS)[:, 0]["J"]
        torque = abs(holding_torque(self.rows, 0.0))
        momentum = float(inertia[np.isfinite(inertia)].sum()) * abs(self.speed)
        return self.patience + (PATIENT * momentum / torque if torque > 0.0 else 0.0)

    def _watched(self, dwell: float | None = None) -> dict[str, float]:
        """That a phase ends once all masses have stood for `held_period`, or are watched only."""
        return {"still": STANDING * self.target, "dwell": held_period(self.rows) if dwell is None else dwell}

    def _close(self, step: DutyStep) -> Iterator[Phase]:
        """The brake is commanded, and closes after its delay; the strategy is in command until then."""
        if self.machine.closing_delay > 0.0:
            until, fields = self.now + self.machine.closing_delay, self._watched(math.inf)
            yield self.phase("brake closes", self.go or ZERO, until, fields=fields)
        if math.isinf(self.machine.brake_torque):
            yield from self._motor_stands(step)
        self.closed, self.go = True, None

    def _motor_stands(self, step: DutyStep) -> Iterator[Phase]:
        """On to the next standstill of the motor, if it moves: where a brake locks, or friction holds it."""
        speed, still = self.motor_speed, HELD * self.target
        if abs(speed) > still:
            until, toward = self.now + self.patience, math.copysign(1.0, speed)
            fields = {**self._watched(math.inf), "slow": still, "toward": toward}
            yield self.phase("motor stands", self.go or ZERO, until, fields=fields)
            if not math.isnan(self.recorder.state.slow):
                self._give_up(
                    step,
                    f"the motor does not come to a standstill within {self.patience:.4g} s, at which its "
                    "brake could lock; give brake.torque",
                )

    def _rest(
        self, step: DutyStep, command: float, time: float | None, fields: Mapping[str, float] = {}
    ) -> Iterator[Phase]:
        """On until all masses stand, or until the time of the step is over."""
        until = command + (self._coasting if time is None else time)
        phase = self.phase("rest", self.go or ZERO, until, fields={**fields, **self._watched()})
        yield phase
        if time is None and math.isnan(phase.rest):
            self._give_up(
                step,
                f"the machine does not come to rest within {until - command:.4g} s; give its shaft a "
                "damping, the motor a friction or a brake, or the step a time",
            )
        self.speed = 0.0
        if time is None and self.closed and math.isfinite(self.machine.brake_torque):
            yield from self._motor_stands(step)
        if time is not None and self.now < until:
            yield self.phase("pause", self.go or ZERO, until)


def held_period(machine_input: KernelInput) -> float:
    """An upper bound of the longest period with the motor held and all gaps closed, s, after Dunkerley.

    2 pi sqrt(sum of J flexibility), over the masses beside the motor; of a drive the period itself.
    """
    inertias = machine_input.masses[0].view(rec.MASS)[:, 0]["J"]
    shafts, motor = machine_input.shafts[0].view(rec.SHAFT)[:, 0], int(machine_input.machine.motor)
    flexibility = np.where(
        shafts["rigid"] == 0.0, 1.0 / np.where(shafts["c"] > 0.0, shafts["c"], np.inf), 0.0
    )
    before, behind = np.cumsum(flexibility[:motor][::-1])[::-1], np.cumsum(flexibility[motor:])
    moves = np.where(np.isfinite(inertias), inertias, 0.0)
    return 2.0 * math.pi * math.sqrt(float(moves[:motor] @ before + moves[motor + 1 :] @ behind))


def holding_torque(machine_input: KernelInput, speed: float) -> float:
    """The motor torque, N m, that holds a machine at a speed, rad/s at the motor shaft; with its losses."""
    machine = machine_input.machine
    masses, shafts = (
        machine_input.masses[0].view(rec.MASS)[:, 0],
        machine_input.shafts[0].view(rec.SHAFT)[:, 0],
    )
    load = masses["active"] - masses["mean"] + masses["ground"] * speed
    load = load + math.copysign(1.0, speed) * (masses["Mc"] + masses["friction"])
    for curve in machine_input.curves[0].view(rec.CURVE)[:, 0]:
        points = int(curve["points"])
        torques = curve["torque"][:points]
        by_angle = float(torques.mean())
        load[int(curve["mass"])] += (
            by_angle if curve["by_angle"] else np.interp(speed, curve["at"][:points], torques)
        )
    motor, total = int(machine.motor), 0.0
    for outer, way in ((0, 1), (len(load) - 1, -1)):
        torque = 0.0
        for i in range(outer, motor, way):
            torque += float(load[i])
            eta = float(shafts["eta"][i if way > 0 else i - 1])
            torque *= 1.0 / eta if torque * speed > 0.0 else eta
        total += torque
    return total + float(load[motor])
