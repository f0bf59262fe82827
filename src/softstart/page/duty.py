"""The duty of a page: steps as a user arranges them, also those that cannot follow one another yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

from softstart.chain.model import Chain
from softstart.drive import Drive
from softstart.drive.duty import KEYS, Do, Duty, DutyStep, Shift
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.input.gear import Gear
from softstart.page.machines import FormField, rounded

PATH = "duty"  # before the paths of all its fields: duty[2].time, duty.stop, duty.shift.hours
DEFAULT = "default"  # of a choice that is not made
STOPS = ("strategy", "torque", "coast", "brake")
MOST_STEPS = 40
DIGITS = 3  # of a time that is set by hand
SHORTEST = 0.001  # s, of such a time
# what the page says about a step of each kind; `DutyStep` says more
KINDS: Mapping[str, str] = {
    "start": "start from rest by the strategy",
    "hold": "go on at speed, or pause at standstill",
    "stop": "stop until all masses stand",
    "reverse": "start in the other direction, out of the motion",
    "jog": "start of a given time and stop",
    "load": "change the load at rest",
    "brake": "close the brake at once, motor off",
}


@dataclass(frozen=True)
class DutyPlan:
    """Steps, how often they are repeated, and how steps stop that do not say it: "" by default.

    Each step is right in itself; `duty` says whether they can follow one another.

    >>> plan = DutyPlan().added(1, "reverse", Drive.load("crane-4amtkf"))
    >>> [step.do for step in plan.steps]
    ['start', 'reverse', 'hold', 'stop']
    >>> plan.moved(1, 3).changed("duty[2].time", "250 ms").steps[1].time
    0.25
    >>> plan.moved(1, 3).duty
    Traceback (most recent call last):
    softstart.errors.InputError: [duty] 4, do = "reverse": the machine stands; ...
    """

    steps: tuple[DutyStep, ...] = (DutyStep("start"), DutyStep("hold", time=1.0), DutyStep("stop"))
    shift: Shift | None = None
    stop: str = ""

    @property
    def duty(self) -> Duty:
        """The duty; InputError where steps cannot follow one another."""
        return Duty(self.steps, shift=self.shift)

    def added(self, index: int, do: str, machine: Machine) -> DutyPlan:
        """With a new step at this place."""
        if do not in KINDS:
            raise InputError(f'do = "{do[:20]}": the steps are {", ".join(KINDS)}.')
        if len(self.steps) >= MOST_STEPS:
            raise InputError(f"There are {MOST_STEPS} steps already; remove one first.")
        values: dict[str, Any] = {"hold": {"time": 1.0}, "jog": {"time": 0.2}}.get(do, {})
        if do == "load":
            load: Any = machine.masses[machine.load_index] if isinstance(machine, Chain) else machine
            values = {"torque": float(load.torque if isinstance(machine, Chain) else load.load_torque)}
        step = DutyStep(cast(Do, do), **values)
        index = min(max(index, 0), len(self.steps))
        return replace(self, steps=(*self.steps[:index], step, *self.steps[index:]))

    def removed(self, index: int) -> DutyPlan:
        """Without a step; the last one stays."""
        self._check(index)
        if len(self.steps) == 1:
            raise InputError("This is the last step; add another one first.")
        return replace(self, steps=(*self.steps[:index], *self.steps[index + 1 :]))

    def moved(self, index: int, to: int) -> DutyPlan:
        """With a step at another place."""
        self._check(index)
        steps = list(self.steps)
        steps.insert(min(max(to, 0), len(steps)), steps.pop(index))
        return replace(self, steps=tuple(steps))

    def through(self, gear: Gear | None) -> DutyPlan:
        """With the values that were given "at output" brought there through this gear, if there is one."""
        if gear is None:
            return self
        return replace(self, steps=tuple(step.through(gear._replace(load=None)) for step in self.steps))

    def timed(self, index: int, seconds: float) -> DutyPlan:
        """With another time of a step, as it is set by hand."""
        self._check(index)
        return self.changed(f"{PATH}[{index + 1}].time", max(rounded(seconds, DIGITS), SHORTEST))

    def changed(self, path: str, value: str | float | None) -> DutyPlan:
        """With another value of a field, an SI number or a text with a unit; None for what it is by default.

        >>> print(DutyPlan().changed("duty.shift.cycles_per_hour", "50").shift)
        Shift(cycles_per_hour=50.0)
        """
        place, _, key = path.rpartition(".")
        value = None if value == DEFAULT else value
        if path == f"{PATH}.stop":
            if value not in (None, *STOPS):
                near = nearest(str(value), STOPS)
                hint = f"did you mean {near}?" if near else f"the ways are {', '.join(STOPS)}."
                raise InputError(f'stop = "{value}": {hint}')
            return replace(self, stop=str(value or ""))
        if place == f"{PATH}.shift":
            if value is None and (key == "cycles_per_hour" or self.shift is None):
                return replace(self, shift=None)
            given = {} if self.shift is None else self.shift.given()
            given = {name: one for name, one in given.items() if name != key}
            shift = Shift(**given | ({} if value is None else {key: value}))
            return replace(self, shift=shift)
        index = int(place[len(PATH) + 1 : -1]) - 1
        self._check(index)
        default = DutyStep.PARAMETERS[key].default if value is None else value
        changes: dict[str, object] = {key: default}
        # of two that exclude one another the one that is given stays
        for one, other in (("time", "angle"), ("brake_speed", "brake_time")):
            for this, that in ((one, other), (other, one)):
                if key == this and value is not None:
                    changes[that] = None
        step = self.steps[index]
        step = step.replace(**{name: new for name, new in changes.items() if name in KEYS[step.do]})
        return replace(self, steps=(*self.steps[:index], step, *self.steps[index + 1 :]))

    def _check(self, index: int) -> None:
        if not 0 <= index < len(self.steps):
            raise InputError(f"Step {index + 1}: there are {len(self.steps)} steps.")


def fields_of(plan: DutyPlan, index: int) -> dict[str, FormField]:
    """The fields of one step by their paths, then those of the whole.

    >>> [field.path for field in fields_of(DutyPlan(), 1).values()][:3]
    ['duty[2].time', 'duty[2].angle', 'duty[2].set_speed']
    """
    step, entries = plan.steps[index], list[FormField]()
    group = f"step {index + 1}: {step.do}"
    for key in KEYS[step.do]:
        p = DutyStep.PARAMETERS[key]
        choices = (DEFAULT, *p.choices) if p.choices else ()
        entries.append(
            FormField(
                f"{PATH}[{index + 1}].{key}", group, p.label, "", "" if choices else p.unit,
                f"{p.meaning}; write for example {p.example}", p.example, choices, (), True,
            )
        )  # fmt: skip
    stop = "how steps stop that do not say it"
    entries.append(
        FormField(f"{PATH}.stop", "duty", "stop by", "", "", stop, "", (DEFAULT, *STOPS), (), True)
    )
    for key, p in Shift.PARAMETERS.items():
        about = f"{p.meaning}; write for example {p.example}"
        label = p.label.replace(" per ", "/")
        entries.append(
            FormField(f"{PATH}.shift.{key}", "duty", label, "", p.unit, about, p.example, (), (), True)
        )
    return {entry.path: entry for entry in entries}


def values_of(plan: DutyPlan, entries: Mapping[str, FormField]) -> dict[str, Any]:
    """What the fields hold; None for what is not given."""
    values: dict[str, Any] = {}
    for path, entry in entries.items():
        place, _, key = path.rpartition(".")
        if path == f"{PATH}.stop":
            values[path] = plan.stop or None
        elif place == f"{PATH}.shift":
            values[path] = None if plan.shift is None else getattr(plan.shift, key)
        else:
            step = plan.steps[int(place[len(PATH) + 1 : -1]) - 1]
            values[path] = step.given().get(key)
        if values[path] is None and entry.choices:
            values[path] = DEFAULT
    return values


def plan_of(machine: Machine) -> tuple[Machine, DutyPlan | None]:
    """A machine without its duty, and that."""
    duty = machine.duty
    if duty is None:
        return machine, None
    return with_duty(machine, None), DutyPlan(duty.steps, duty.shift)


def with_duty(machine: Machine, duty: Duty | None) -> Machine:
    """A machine with another duty."""
    assert isinstance(machine, Drive | Chain)
    return machine.replace(duty=duty)


def packed_plan(plan: DutyPlan | None) -> Any:
    """A plan as JSON can carry it; `unpacked_plan` reads it."""
    if plan is None:
        return None
    shift = None if plan.shift is None else plan.shift.given()
    return {"steps": [step.given() for step in plan.steps], "shift": shift, "stop": plan.stop}


def unpacked_plan(content: Any) -> DutyPlan | None:
    """The plan that `packed_plan` has packed; KeyError, TypeError or ValueError for anything else.

    >>> unpacked_plan(packed_plan(DutyPlan())) == DutyPlan()
    True
    """
    if content is None:
        return None
    try:
        steps = tuple(DutyStep(**given) for given in content["steps"][:MOST_STEPS])
        shift = None if content["shift"] is None else Shift(**content["shift"])
    except InputError as error:
        raise ValueError from error
    if not steps or content["stop"] not in ("", *STOPS):
        raise ValueError
    return DutyPlan(steps, shift, content["stop"])
