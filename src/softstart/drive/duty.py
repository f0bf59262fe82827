"""A duty: one cycle of starts, stops, reversals, jogs and load changes, and how often it is repeated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal, Self, cast, get_args

from softstart.drive.machine import LoadKind, Machine
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.input.files import Library
from softstart.input.gear import Gear
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import MaybeNumber, Number, ParameterSet, Rows, component, parameter
from softstart.input.parameters import Wording
from softstart.quantities import show

Do = Literal["start", "stop", "hold", "reverse", "jog", "load", "brake"]
StopBy = Literal["strategy", "torque", "coast", "brake"]

STOP_KEYS: Final = ("by", "braking_torque", "brake_speed", "brake_time")
LOAD_KEYS: Final = ("torque", "kind", "inertia", "friction")
# the keys that each kind of step has
KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "start": ("set_speed", "time", "angle", "repeat"),
    "stop": (*STOP_KEYS, "time"),
    "hold": ("time", "angle", "set_speed"),
    "reverse": ("set_speed", "time", "angle"),
    "jog": ("time", "set_speed", *STOP_KEYS, "repeat"),
    "load": (*LOAD_KEYS, "mass", "time"),
    "brake": ("time",),
}
ENDS: Final = ("stop", "brake")  # steps that end a motion

MOST_STEPS: Final = 10_000  # of one cycle
MOST_SHIFTS: Final = 1098.0  # of a year: three on each of 366 days
MOST_SPEED: Final = 2.0  # times rated or target speed; beyond, a motor in field weakening lacks torque

library = Library("softstart.drive", "a duty", "duties", folder="duties")


class DutyStep(ParameterSet, what="a step of a duty"):
    """One step of a duty.

    Angles, speeds and torques are at the motor shaft, torque, friction and inertia of a load of a chain at
    the shaft of its mass.

    `do` is one of

    - "start": start from rest, by the strategy, to `set_speed` (negative: backwards). With `repeat` all steps
      up to and including the stop that ends it are repeated so many times.
    - "stop": until all masses stand, `by` the strategy, the motor's `braking_torque`, coasting or the brake.
      The brake, if there is one, closes at standstill, or at `brake_speed` or `brake_time`.
    - "hold": go on for `time`, or until the load has travelled `angle`, whichever is first; at standstill a
      pause. A new `set_speed` needs a strategy that holds the speed.
    - "reverse": start in the other direction, out of the motion.
    - "jog": start for `time`, then a stop; `repeat` times in a row.
    - "load": change the load at rest: `torque`, `kind`, `inertia`, `friction`, of a chain those of `mass`.
    - "brake": close the brake at once, motor off, until all masses stand.

    A start and a reversal end at the set speed, or at a `time` or an `angle`; a stop, "brake" and "load" have
    ended when all masses stand, or at a `time`.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        With a sentence for each mistake, also for keys that do not belong to the step.

    Examples
    --------
    >>> DutyStep("jog", time="200 ms", repeat=3).time
    0.2
    >>> DutyStep("start", torque=5.0)
    Traceback (most recent call last):
    softstart.errors.InputError: torque = 5.0: a step "start" has no torque; it has set_speed, time, ...

    References
    ----------
    docs/reference/drive-file.md.
    """

    # fmt: off
    do: Do = parameter("duty.do", "", "kind of the step", '"start"', choices=get_args(Do), kw_only=False)
    set_speed: MaybeNumber = parameter("duty.set_speed", "rad/s",
        "speed that the load is to reach, negative backwards", '"-880 rpm"', default=None, at_output="value")
    time: MaybeNumber = parameter("duty.time", "s", "time of the step", '"2 s"', "above 0", default=None)
    angle: MaybeNumber = parameter("duty.angle", "rad", "travel of the load in the step", '"5 turn"',
        "above 0", default=None, at_output="value")
    repeat: Number = parameter("duty.repeat", "1", "number of times in a row", "3",
        "a whole number, 1 or more", default=1.0)
    by: StopBy | None = parameter("duty.by", "", "way of the stop", '"coast"', default=None,
        choices=get_args(StopBy))
    braking_torque: MaybeNumber = parameter("duty.braking_torque", "N*m", "braking torque of the motor",
        '"20 N*m"', "above 0", default=None)
    brake_speed: MaybeNumber = parameter("duty.brake_speed", "rad/s",
        "speed of the motor at which the brake is closed", '"50 rpm"', "0 or more", default=None)
    brake_time: MaybeNumber = parameter("duty.brake_time", "s",
        "time after which the brake is closed", '"0.5 s"', "0 or more", default=None)
    torque: MaybeNumber = parameter("duty.torque", "N*m", "torque of the load", '"7.16 N*m"', default=None,
        at_output="value")
    kind: LoadKind | None = parameter("duty.kind", "", "kind of the load torque", '"active"', default=None,
        choices=get_args(LoadKind))
    inertia: MaybeNumber = parameter("duty.inertia", "kg*m^2", "inertia of the load", '"0.175 kg*m^2"',
        "above 0", default=None, at_output="value")
    friction: MaybeNumber = parameter("duty.friction", "N*m",
        "Coulomb friction of the load besides its torque", '"0.7 N*m"', "0 or more", default=None,
        at_output="value")
    mass: str | None = parameter("duty.mass", "", "name of the mass of a chain whose load changes",
        '"hook"', default=None)
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """Sentences on keys that do not belong to the step, and on those that it lacks."""
        keys, given = KEYS[self.do], self.given()
        listed = f"it has {_joined(keys)}" if keys else "it has no other keys"
        for key in [one for one in given if one not in ("do", *keys)]:
            yield f'{key} = {show(given[key])}: a step "{self.do}" has no {key}; {listed}.'
        if self.set_speed == 0.0 and "set_speed" in keys:
            yield 'set_speed = 0: a set speed is not 0; use a step "stop" to stand still.'
        if self.brake_speed is not None and self.brake_time is not None:
            yield (
                f"brake_speed = {self.brake_speed!r} and brake_time = {self.brake_time!r}: both say when the "
                "brake closes; leave one out."
            )
        if self.braking_torque is not None and "by" in keys and self.by != "torque":
            by = "" if self.by is None else f', and by = "{self.by}"'
            yield (
                f'braking_torque = {self.braking_torque!r}: only a stop by = "torque" has one{by}; write '
                'by = "torque", or leave it out.'
            )
        if self.do == "hold" and self.time is None and self.angle is None:
            yield 'time is missing: a hold takes a time or an angle; write for example time = "2 s".'
        if self.do == "jog" and self.time is None:
            yield 'time is missing: a jog is a start of given time; write for example time = "200 ms".'
        if self.do == "load" and not given.keys() & set(LOAD_KEYS):
            yield f'a step "load" changes {_joined(LOAD_KEYS, "or")} of the load; give at least one.'

    @property
    def direction(self) -> float:
        """1.0 forward, -1.0 backwards, by the sign of its set speed."""
        return -1.0 if self.set_speed is not None and self.set_speed < 0.0 else 1.0


class Shift(ParameterSet, what="a shift"):
    """How often a duty is repeated.

    Parameters
    ----------
    {parameters}

    Examples
    --------
    >>> shift = Shift(cycles_per_hour=50)
    >>> shift.cycles_per_hour * shift.hours * shift.shifts_per_year
    100000.0

    References
    ----------
    docs/reference/drive-file.md.
    """

    # fmt: off
    cycles_per_hour: Number = parameter("shift.cycles_per_hour", "1", "number of cycles in an hour", "50",
        "above 0")
    hours: Number = parameter("shift.hours", "1", "number of hours of a shift", "8", "above 0", default=8.0)
    shifts_per_year: Number = parameter("shift.shifts_per_year", "1", "number of shifts in a year", "250",
        "above 0", default=250.0)
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """Sentences on more hours than a day has, and on more shifts than a year has."""
        if self.hours > 24.0:
            yield f"hours = {self.hours:g}: a shift has at most 24; raise shifts_per_year instead."
        if self.shifts_per_year > MOST_SHIFTS:
            yield (
                f"shifts_per_year = {self.shifts_per_year:g}: three shifts on each day are {MOST_SHIFTS:g}; "
                "lower it."
            )


class Duty(ParameterFile, library=library):
    """One cycle of steps, which a machine repeats.

    Parameters
    ----------
    steps : iterable of DutyStep
        The steps in their order; the machine stands before the first.
    shift : Shift, optional
        How often the cycle is repeated, for a life in shifts and years.

    Raises
    ------
    InputError
        With a sentence for each step that cannot follow those before it.

    Examples
    --------
    >>> duty = Duty([DutyStep("start", repeat=2), DutyStep("stop", by="coast"), DutyStep("hold", time=5)])
    >>> [(index, step.do) for index, step in duty.expanded()]
    [(0, 'start'), (1, 'stop'), (0, 'start'), (1, 'stop'), (2, 'hold')]
    >>> Duty([DutyStep("stop")])
    Traceback (most recent call last):
    softstart.errors.InputError: [duty] 1, do = "stop": the machine stands; a step "start" must come ...

    References
    ----------
    docs/reference/drive-file.md.
    """

    # fmt: off
    steps: Rows[DutyStep] = component(DutyStep, least=0, default=(), kw_only=False)
    shift: Shift | None = component(Shift, default=None)
    # fmt: on

    @classmethod
    def load_for(cls, machine: Machine, name: str, also: Mapping[str, object] | None = None) -> Duty:
        """As `load`, with the gear of this machine for values "... at output".

        >>> from softstart import Drive
        >>> Duty.load_for(Drive.load("crane-4amtkf"), "hoist") == Duty.load("hoist")
        True
        """
        text, where = cls.LIBRARY.find(name)
        return cls.read_for(machine, text, where, also)

    @classmethod
    def read_for(
        cls, machine: Machine | None, text: str, where: str = "", also: Mapping[str, object] | None = None
    ) -> Duty:
        """As `load_for`, from the text of a file; without a machine to see whether it is right in itself."""

        class OfMachine(Duty):
            @classmethod
            def _gear_in(cls, given: Mapping[str, object]) -> Gear | str:
                return Gear(1.0) if machine is None else machine.gear_with()

        duty = OfMachine.from_toml(text, where=where, also=also)
        return cls(duty.steps, shift=duty.shift)

    def through(self, gear: Gear) -> Self:
        """The same with the values of its steps that were given "at output" brought through this gear.

        >>> given_at_motor = Duty([DutyStep("load", torque=2.0), DutyStep("start")])
        >>> given_at_motor.through(Gear(20.0)) == given_at_motor
        True
        """
        each = gear._replace(load=None)  # a step has a load of its own
        return self.replace(steps=[step.through(each) for step in self.steps])

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        if {"motor", "shaft", "mass"} & document.keys():
            reason = "this is the file of a machine; give it as DRIVE, its [[duty]] is read with it"
            raise InputError(Wording(where).sentence("", reason))
        return super()._from_document(document, where, also)

    def contradictions(self) -> Iterator[str]:
        """Sentences on steps that cannot follow those before them."""
        if not self.steps:
            yield '[[duty]] is missing: a duty has steps; write for example [[duty]] and do = "start" below.'
        if (count := self._count()) > MOST_STEPS:
            yield f"repeat: one cycle has {count:.6g} steps, and a duty at most {MOST_STEPS}; lower repeat."
        started, direction = 0, 1.0  # number of the step that set the machine in motion, 0 at standstill
        for number, step in enumerate(self.steps, start=1):
            yield from (f"[duty] {number}, {sentence}" for sentence in _misplaced(step, started, direction))
            if step.do == "start" and step.repeat > 1.0 and self._end_of(number - 1) is None:
                yield (
                    f"[duty] {number}, repeat = {step.repeat:g}: no step stops the machine again, so nothing "
                    'can be repeated; add a step "stop", or leave repeat out.'
                )
            if step.do == "start" and not started:
                started, direction = number, step.direction
            elif step.do == "reverse" and started:
                direction = -direction
            elif step.do in ENDS:
                started = 0

    def _end_of(self, index: int) -> int | None:
        """The index of the step that ends the motion which the start at this index begins."""
        later = range(index + 1, len(self.steps))
        end = next((i for i in later if self.steps[i].do in (*ENDS, "start")), None)
        return None if end is None or self.steps[end].do == "start" else end

    def _count(self) -> float:
        """How many steps one cycle has."""
        return sum(step.repeat * (last - index + 1) for index, step, last in self._blocks())

    def _blocks(self) -> Iterator[tuple[int, DutyStep, int]]:
        """The indices of steps that are carried out together, so many times as the first of them says."""
        index = 0
        while index < len(self.steps):
            step = self.steps[index]
            end = self._end_of(index) if step.do == "start" and step.repeat > 1.0 else None
            last = index if end is None else end
            yield index, step, last
            index = last + 1

    def expanded(self) -> tuple[tuple[int, DutyStep], ...]:
        """All steps of one cycle in their order, repetitions too, each with its index in `steps`."""
        cycle = list[tuple[int, DutyStep]]()
        for index, step, last in self._blocks():
            cycle += [(i, self.steps[i]) for i in range(index, last + 1)] * int(step.repeat)
        return tuple(cycle)

    @property
    def ends_moving(self) -> bool:
        """Whether the last step leaves the machine in motion, so that the cycle cannot be repeated.

        >>> Duty([DutyStep("start")]).ends_moving
        True
        """
        moves = [step.do for step in self.steps if step.do in ("start", *ENDS)]
        return bool(moves) and moves[-1] == "start"


def _joined(words: tuple[str, ...], last: str = "and") -> str:
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _misplaced(step: DutyStep, started: int, direction: float) -> Iterator[str]:
    """Why a step cannot stand here: the machine is in motion since step `started`, or stands (0)."""
    subject = f'do = "{step.do}"'
    if started and step.do in ("start", "jog", "load"):
        what = {"start": "starts", "jog": "is jogged", "load": "changes its load"}[step.do]
        remedy = 'add a step "stop" before it' + ', or write "reverse"' * (step.do == "start")
        yield f"{subject}: the machine {what} at rest, and it runs since step {started}; {remedy}."
    if not started and step.do in (*ENDS, "reverse"):
        yield f'{subject}: the machine stands; a step "start" must come before it.'
    if step.do == "hold" and not started:
        for key in ("angle", "set_speed"):
            if (value := getattr(step, key)) is not None:
                yield f"{key} = {value!r}: the machine stands; give a time, or start it before."
    if started and step.set_speed is not None:
        same = step.direction == direction
        running = "forward" if direction > 0.0 else "backwards"
        if step.do == "reverse" and same:
            yield (
                f"set_speed = {step.set_speed!r}: the machine runs {running} already; a reversal has a set "
                "speed of the other sign."
            )
        if step.do == "hold" and not same:
            yield (
                f"set_speed = {step.set_speed!r}: the machine runs {running}; a step of the other direction "
                'is "reverse".'
            )


# ---- with a machine and a strategy ------------------------------------------------------------------------


def way_of_stop(step: DutyStep, machine: Machine, stop: str | None, can_stop: bool) -> StopBy:
    """How a step "stop" or "jog" stops: as it says, by the strategy, as configured, or as the motor can.

    >>> from softstart import Drive
    >>> way_of_stop(DutyStep("stop"), Drive.load("crane-4amtkf"), None, can_stop=False)
    'coast'
    """
    if step.by is not None:
        return step.by
    if can_stop:
        return "strategy"
    if stop is not None:
        return cast("StopBy", stop)
    return "torque" if machine.motor.minimum_torque < 0.0 else "coast"


def check_duty(
    machine: Machine,
    duty: Duty,
    stop: str | None,
    can_stop: bool,
    can_reverse: bool,
    holds_speed: bool,
    name: str,
) -> None:
    """Raise InputError with a sentence for each step that this machine or this strategy cannot do.

    `stop` is the stop of strategies that cannot stop, `name` that of the strategy, as it is shown. A strategy
    that cannot reverse is started anew in the other direction, which takes no braking torque.
    """
    if stop is not None and stop not in get_args(StopBy):
        *first, last = map(show, get_args(StopBy))
        meant = nearest(stop, get_args(StopBy)) if isinstance(stop, str) else None
        remedy = f"; did you mean {show(meant)}?" if meant else "."
        raise InputError(f"stop = {show(stop)}: the stop is {', '.join(first)} or {last}{remedy}")
    if machine.motor is None:
        raise InputError("[motor] is missing: a duty needs one; add it to the chain.")
    wrong, loaded = Mistakes(), machine
    wrong.sentences += _weak_brake(machine)
    # the second cycle begins with the load that the first one leaves
    for _ in range(1 if duty.ends_moving else 2):
        speed = math.nan  # the set speed of the present motion, with its sign
        for number, step in enumerate(duty.steps, start=1):
            before, sentences = f"[duty] {number}, ", [*_speed_mistakes(step, machine, holds_speed, name)]
            if step.do in ("start", "jog"):
                speed = step.set_speed or machine.target_speed or math.nan
            elif step.do == "reverse":
                if can_reverse and machine.motor.minimum_torque >= 0.0:
                    sentences.append(
                        f'do = "reverse": {name} slows the machine down by a torque against its motion, '
                        "which the motor has not; give a [motor] minimum_torque below 0, or stop before."
                    )
                speed = step.set_speed or -math.copysign(machine.target_speed or math.nan, speed)
            elif step.do == "hold" and step.set_speed is not None:
                speed = step.set_speed
            if step.do == "load":
                with wrong.collect(before):
                    values = {key: value for key, value in step.given().items() if key in LOAD_KEYS}
                    loaded = loaded.with_load(values, step.mass or "")
                    sentences += _weak_brake(loaded, 'do = "load": ')
            elif step.do in ("stop", "jog", "brake"):
                by = "brake" if step.do == "brake" else way_of_stop(step, machine, stop, can_stop)
                subject = f'by = "{by}"' if step.by else f'do = "{step.do}"' + f" by {by}" * (step.do != by)
                if by == "strategy" and not can_stop:
                    sentences.append(
                        f"{subject}: {name} cannot stop a machine; stop by torque, coast or brake, or use a "
                        "strategy that can stop, as speed-ramp."
                    )
                sentences += [f"{subject}: {one}" for one in _endless(step, by, loaded, speed)]
                sentences += _stop_mistakes(step, by, subject, machine)
            wrong.sentences += [before + one for one in sentences]
    wrong.sentences = list(dict.fromkeys(wrong.sentences))
    wrong.raise_if_any()


def _weak_brake(machine: Machine, subject: str = "") -> Iterator[str]:
    """That the brake cannot hold the load, which `subject` has changed."""
    pull, torque = abs(machine.overhauling_torque), machine.brake_torque
    if 0.0 < torque < pull:
        brake = f"the brake of {torque:g} N*m" if subject else "it"
        yield (
            f"{subject or f'[brake] torque = {torque!r}: '}{brake} is weaker than the load, {pull:.6g} N*m "
            "at the motor shaft besides what friction holds; take a stronger brake or a lighter load."
        )


def _stop_mistakes(step: DutyStep, by: str, subject: str, machine: Machine) -> Iterator[str]:
    """What the motor or the brake lacks for a step that stops in this way."""
    brake, torque = machine.brake_torque, -float(machine.motor.minimum_torque)
    closing = subject if by == "brake" else ""
    for key in ("brake_speed", "brake_time"):
        value = getattr(step, key)
        if not closing and value is not None and (value or key == "brake_time"):
            closing = f"{key} = {value!r}"
    if closing and brake == 0.0:
        yield f"{closing}: the machine has no brake; add [brake] torque, or stop in another way."
    elif closing and math.isinf(brake):
        yield (
            f"{closing}: without [brake] torque the brake is an ideal lock, which closes at standstill only; "
            "give the torque with which it slips."
        )
    open_at = machine.release_time
    if step.do == "jog" and math.isfinite(open_at) and (step.time or math.inf) <= open_at:
        yield (
            f"time = {step.time!r}: the jog ends before the brake is open, at {open_at:g} s; make the jog "
            "longer, or opening_delay shorter."
        )
    if by == "torque" and torque <= 0.0:
        yield (
            f"{subject}: the motor has no braking torque; give a [motor] minimum_torque below 0, as "
            '"-20 N*m", or stop by coast or brake.'
        )
    elif by == "torque" and (step.braking_torque or 0.0) > torque:
        yield (
            f"braking_torque = {step.braking_torque!r}: the motor has less, [motor] minimum_torque = "
            f"{-torque!r}; lower the one or the other."
        )


def _endless(step: DutyStep, by: str, machine: Machine, speed: float) -> Iterator[str]:
    """Why a stop by torque or by coasting never ends, out of a motion with this set speed."""
    pull = machine.overhauling_torque
    torque = 0.0 if by == "coast" else step.braking_torque or -float(machine.motor.minimum_torque)
    load = f"{abs(pull):.6g} N*m at the motor shaft besides what friction holds"
    in_motion = step.brake_time is not None or (step.brake_speed or 0.0) >= abs(speed)
    ends = step.do == "stop" and step.time is not None
    if ends or by not in ("torque", "coast") or (by == "torque" and torque <= 0.0):
        return
    if pull and machine.brake_torque == 0.0:
        yield (
            f"nothing holds the load, {load}: it runs away and the duty never ends; add [brake] torque, or "
            'kind = "reactive" for a load that is friction.'
        )
    elif pull * speed < 0.0 and not in_motion and torque <= abs(pull):
        yield (
            f"the load, {load}, drives the machine on, so that the stop never ends; stop by brake, or give a "
            "brake_time."
        )
    elif by == "coast" and not pull and not in_motion and _coasts_on(machine):
        yield "nothing brakes the machine, so that the stop never ends; stop by torque or brake."


def _coasts_on(machine: Machine) -> bool:
    """Whether a drive has neither friction nor damping to the ground; of a chain load curves may brake."""
    friction = machine.lever_rule_model.friction
    return machine.KIND == "drive" and friction == 0.0 and not any(machine.frictions)


def _speed_mistakes(step: DutyStep, machine: Machine, holds_speed: bool, name: str) -> Iterator[str]:
    """Why the machine or the strategy cannot go to the set speed of a step."""
    if step.set_speed is None:
        if step.do in ("start", "jog") and machine.target_speed is None:
            yield "set_speed is missing: the machine has no target speed; give one of the two."
        return
    speeds = (machine.target_speed, machine.motor.rated_speed)
    known = [speed for speed in speeds if speed is not None]
    if known and abs(step.set_speed) > MOST_SPEED * max(known):
        # a bare number in a file is in rad/s
        meant = abs(step.set_speed) * math.pi / 30.0 <= MOST_SPEED * max(known)
        yield (
            f"set_speed = {step.set_speed:.6g} rad/s: it is above {MOST_SPEED:g} times the rated or target "
            f"speed, {max(known):.4g} rad/s; in field weakening the motor lacks the torque assumed here"
            + (f'; did you mean "{step.set_speed:g} rpm"?' if meant else ".")
        )
    if step.do == "hold" and not holds_speed:
        yield (
            f"set_speed = {step.set_speed!r}: {name} does not hold a speed; leave it out, or use a strategy "
            "that does, as speed-ramp."
        )
