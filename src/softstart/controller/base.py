"""What a controller is: state in, state out.

A controller is asked at certain instants. It is given what a drive can measure and its own state;
it answers with a torque demand, the instant at which it wants to be asked next, and its new state.
It keeps nothing in itself, so a start can be replayed, and a hundred thousand starts run at once.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum, IntFlag
from itertools import repeat
from numbers import Real
from types import UnionType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller.parameters import ParameterValues, declared_parameters
from softstart.drive import Drive
from softstart.drive.machine import Machine
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError
from softstart.kernel.records import SEES_LOAD_SPEED, SEES_SHAFT_TORQUE, SEES_STAGE, Measured
from softstart.quantities import show


class Sensor(IntFlag):
    """What a controller may see beyond time, encoder and motor torque; it must declare it.

    Attributes
    ----------
    NONE : nothing more.
    STAGE : number of the stage, and to be asked at each closing and opening of the gap.
    SHAFT_TORQUE : torque of the shaft.
    LOAD_SPEED : speed of the load.

    Examples
    --------
    >>> Sensor.STAGE | Sensor.LOAD_SPEED
    <Sensor.STAGE|LOAD_SPEED: 5>
    """

    NONE = 0
    STAGE = SEES_STAGE
    SHAFT_TORQUE = SEES_SHAFT_TORQUE
    LOAD_SPEED = SEES_LOAD_SPEED


class Effort(Enum):
    """What it takes to build a strategy, the least first; the simplest that is good enough is recommended.

    Attributes
    ----------
    CONTACTOR : any contactor does it.
    RAMPS : any inverter or soft starter with torque ramps.
    SPEED : any inverter with closed-loop speed control: speed ramp, gains, torque limit.
    STEPS : an inverter with torque steps, and the motor's speed to time them by.
    CODE : code of the user in the inverter, that measures speed and current at most. The default.
    ENCODER : the same with an encoder on the motor and a model of the drive.
    SENSOR : a sensor beyond these, which drives do not have; the default where there are `sensors`.

    Examples
    --------
    >>> Effort.RAMPS.meaning, Effort.RAMPS.order < Effort.CODE.order
    ('an inverter with torque ramps', True)
    """

    meaning: str  # what is needed, in words

    CONTACTOR = "contactor", "a contactor"
    RAMPS = "ramps", "an inverter with torque ramps"
    SPEED = "speed", "an inverter with closed-loop speed control"
    STEPS = "steps", "an inverter with torque steps"
    CODE = "code", "code of your own in the inverter"
    ENCODER = "encoder", "code of your own in the inverter, and an encoder"
    SENSOR = "sensor", "a sensor that drives do not have"

    def __new__(cls, value: str, meaning: str) -> Effort:
        """The value is the name in files; the meaning stands in tables."""
        member = object.__new__(cls)
        member._value_, member.meaning = value, meaning
        return member

    @property
    def order(self) -> int:
        """Its place, 0 for the least effort."""
        return list(Effort).index(self)


SAME_SAMPLE = 1e-6  # of a period
NEVER = -math.inf  # as `ask_again`: not at gap events either, the torque stays as it is


class Command(NamedTuple):
    """A controller's answer.

    The demand is `torque` now and changes at `slope` until the controller is asked again.

    Parameters
    ----------
    torque : torque demand, N m.
    ask_again : when to be asked again, s, an instant later than now. By default at the next sample, where the
        controller has a parameter `period`, else not again. Infinity is not again: then a controller that
        sees the stage is still asked at each gap event, unless it says NEVER.
    state : the new state, handed to the next step; by default the state stays.
    slope : rate of the demand, N m/s. It needs an `ask_again`, where its line ends. Where
        the demand is beyond the torque limits of the drive, it is cut off at them.

    Raises
    ------
    SimulationError
        From `simulate`, not here: if `torque` is NaN, `ask_again` is not later than now, or a `slope` other
        than 0 has no `ask_again`.

    Examples
    --------
    >>> Command(62.0, ask_again=0.1).torque
    62.0
    """

    torque: float
    ask_again: float | None = None
    state: tuple[float, ...] | None = None
    slope: float = 0.0


WholeReply = tuple[float, float, tuple[float, ...], float]  # the fields of a Command, none left out


class Regulation(NamedTuple):
    """How a start ends under a controller that holds the speed: what `Controller.regulation` returns.

    Parameters
    ----------
    band : share of the target speed within which the load has settled, on both sides.
    command_end : when the ramp of the commanded speed has ended, s.
    dwell : for how long the load must stay in the band after that, s; then the start ends.
    """

    band: float
    command_end: float
    dwell: float


# what a class says of itself: its type, and how it is written
DECLARED: dict[str, tuple[type | UnionType, str]] = {
    **dict.fromkeys(("name", "summary", "source"), (str, "a text in quotes")),
    "sensors": (Sensor, "Sensor.STAGE, Sensor.SHAFT_TORQUE, Sensor.LOAD_SPEED or a sum of these by |"),
    "effort": (Effort | None, "one of Effort, as Effort.RAMPS"),
    **dict.fromkeys(
        ("needs", "settings"), (tuple, 'names of parameters with commas after them, as ("time",)')
    ),
    **dict.fromkeys(("saturates", "can_stop", "can_reverse"), (bool, "True or False")),
    "time_parameter": (str, "the name of a parameter in quotes"),
}


@dataclass(frozen=True)
class Controller:
    """A strategy for the start. Subclass `PlainController` or `CompiledController`.

    A subclass is a frozen dataclass; its fields are its parameters.

    Attributes
    ----------
    name : under which it is found.
    summary : one line, what it does.
    source : where it comes from.
    sensors : what it may see beyond time, encoder and motor torque.
    effort : what it takes to build it; by default code of one's own, or the sensors that it sees.
    needs : parameters of which one must be given, as no drive implies it.
    saturates : whether it relies on the torque limits of the drive to cut off its demand, as a feedback may.
        Then tables do not mention a demand beyond them; `Run.clipped` has it always.
    can_stop, can_reverse : whether it follows a command to stop, and one to run the other way.
    time_parameter : the parameter that sets how long a start takes, which comparisons at equal time vary; by
        default there is none.
    settings : at most two more parameters that are set with it for the limits of a drive.

    Examples
    --------
    >>> from softstart.controller import make_controller
    >>> ramp = make_controller("ramp", {"time": "120 ms"})
    >>> ramp.parameters["time"], ramp.fitted(Drive.load("crane-4amtkf")).parameters["full_torque"]
    (0.12, 62.0)
    """

    name: ClassVar[str] = ""
    summary: ClassVar[str] = ""
    source: ClassVar[str] = ""
    sensors: ClassVar[Sensor] = Sensor.NONE
    effort: ClassVar[Effort | None] = None
    needs: ClassVar[tuple[str, ...]] = ()
    saturates: ClassVar[bool] = False
    can_stop: ClassVar[bool] = False
    can_reverse: ClassVar[bool] = False
    time_parameter: ClassVar[str] = ""
    settings: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        wrong = [
            f"{type(self).__name__}: {name} = {value!r}: declare it in the class as {form}."
            for name, (kind, form) in DECLARED.items()
            if not isinstance(value := getattr(self, name), kind)
        ]
        for name, declaration in declared_parameters(self).items():
            if declaration.declared and (value := getattr(self, name)) is not None:
                try:
                    if (read := declaration.read(value)) is not value:
                        object.__setattr__(self, name, read)
                except InputError as error:
                    wrong += error.sentences
        if wrong:
            raise InputError(wrong)

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """Values of the parameters that were not given, derived from the drive (never from the answer)."""
        values, declared = ParameterValues(self, drive), declared_parameters(self)
        return {name: values.derived(one) for name, one in declared.items() if one.declared}

    def fitted(self, drive: Drive) -> Self:
        """The same controller with every parameter a number."""
        missing = [f.name for f in fields(self) if getattr(self, f.name) is None]
        if not missing:
            return self
        derived = self.defaults(drive.design_drive)
        fitted = replace(self, **{name: derived[name] for name in missing if name in derived})
        if "name" in vars(self):  # one of its own, as an optimum has in tables
            object.__setattr__(fitted, "name", self.name)
        return fitted

    def regulation(self, drive: Drive) -> Regulation | None:
        """How the start ends if the strategy holds the speed; called on a fitted controller.

        None, the default, is a torque strategy: the start ends at the first passage of the target speed.
        """
        return None

    def doubts(self, drive: Drive) -> list[str]:
        """What an engineer should know of these settings, a sentence each; called on a fitted controller."""
        return []

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller with every parameter a number, and the drive whose numbers it works with.

        That is `fitted(drive)` and the same drive; gains that were tuned for another drive bring that one.
        Raises InputError for a parameter that is an array: `set_ups` takes those.
        """
        if arrays := self._arrays():
            name, values = next(iter(arrays.items()))
            raise InputError(
                f"{name} = {show(values)}: this is a list, and one start has a single value; give that, or "
                "`machine_table` with as many machines, or vary it in a sweep."
            )
        drive = drive.design_drive
        return self.fitted(drive), drive

    def _arrays(self) -> dict[str, NDArray[np.float64]]:
        """The parameters that are arrays: one value for each of many starts."""
        return {
            name: value
            for name, declaration in declared_parameters(self).items()
            if isinstance(value := getattr(self, name), np.ndarray) and declaration.kind == "quantity"
        }

    def set_ups(self, drives: Machine | MachineTable | Sequence[Machine]) -> Iterator[SetUp]:
        """`set_up` for each machine of records or a list, last index fastest, or for a single one.

        The only place where a controller meets arrays: its parameters may be some, as many as machines, or of
        any length for a single one.

        >>> from softstart.controller import make_controller
        >>> crane = Drive.load("crane-4amtkf")
        >>> batch = make_controller("ramp", {"initial": [1.0, 2.0]}).set_ups(crane)
        >>> [(ready.parameters["initial"], own == crane) for ready, own in batch]
        [(1.0, True), (2.0, True)]
        """
        arrays = self._arrays()
        machines: Iterable[Machine]
        if isinstance(drives, MachineTable):
            machines, shape = drives.elements(), drives.shape
        elif isinstance(drives, Sequence):
            machines, shape = drives, (len(drives),)
        else:
            shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
            machines = repeat(drives) if arrays else (drives,)
        each = (machine.design_drive for machine in machines)
        if not arrays:
            yield from map(self.set_up, each)
            return
        columns = (np.broadcast_to(values, shape).ravel().tolist() for values in arrays.values())
        for row, drive in zip(zip(*columns, strict=True), each, strict=False):
            yield replace(self, **dict(zip(arrays, row, strict=True))).set_up(drive)

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameter names and values."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


Numbers = dict[str, Any]  # of a step, by name; those of a record within its record are a dict again
SetUp = tuple[Controller, Drive]  # a controller with every parameter a number, the drive of its numbers


@dataclass(frozen=True)
class PlainController(Controller, ABC):
    """A controller in plain Python: needs no numba, is slower. A subclass defines `step`.

    Attributes
    ----------
    initial_state : the state handed to the first step.

    Examples
    --------
    >>> class Half(PlainController):
    ...     name = "half"
    ...     def step(self, measured, state):
    ...         return Command(31.0 if measured.time < 0.1 else 62.0, measured.time + 0.001)
    """

    initial_state: ClassVar[tuple[float, ...]] = ()

    @abstractmethod
    def step(self, measured: Measured, state: tuple[float, ...]) -> Command | float:
        """One control instant.

        Parameters
        ----------
        measured : what is measured now.
        state : what the last answer returned, `initial_state` at first.

        Returns
        -------
        The answer; of a controller with a `period` a torque alone is `Command(torque)`.
        """


def reply_of(controller: PlainController, measured: Measured, state: tuple[float, ...]) -> WholeReply:
    """What the step of a controller answers, with the next instant and the new state filled in.

    >>> class Constant(PlainController):
    ...     period = 0.001
    ...     def step(self, measured, state):
    ...         return 62.0
    >>> reply_of(Constant(), Measured(0.002, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan), (1.0,))
    (62.0, 0.003, (1.0,), 0.0)
    """
    reply = controller.step(measured, state)
    if isinstance(reply, Real) and getattr(controller, "period", None):
        reply = Command(float(reply))
    try:
        torque, instant, kept, slope = Command(*reply)  # type: ignore[misc]  # may be any tuple
        after = _next_sample(controller, measured.time) if instant is None else float(instant)
        return float(torque), after, state if kept is None else tuple(kept), float(slope)
    except (TypeError, ValueError):
        raise InputError(
            f"controller {type(controller).__name__}: its step returned {reply!r}; return Command(torque, "
            "ask_again, state, slope), or, of a controller with a `period`, the torque alone."
        ) from None


def _next_sample(controller: PlainController, time: float) -> float:
    """The next multiple of the `period`; infinite for a controller without one."""
    period = getattr(controller, "period", None) or math.inf
    # counted, so that rounding does not add up; SAME_SAMPLE: time is a rounding below its sample
    return (math.floor(time / period + SAME_SAMPLE) + 1.0) * period


def period_of(controller: Controller) -> float:
    """The sample period of a controller that is set up, s; 0 of one that is not sampled."""
    period = getattr(controller, "period", None)
    return max(float(period), 0.0) if isinstance(period, Real) else 0.0


def label_of(controller: Controller | type[Controller]) -> str:
    """The name under which a controller stands in tables: its own, or that of its class."""
    return controller.name or getattr(controller, "__name__", type(controller).__name__)


def effort_of(controller: Controller) -> Effort:
    """What it takes to build a strategy.

    >>> class Own(PlainController):
    ...     def step(self, measured, state):
    ...         return Command(20.0)
    >>> effort_of(Own())
    <Effort.CODE: 'code'>
    """
    return controller.effort or (Effort.SENSOR if controller.sensors else Effort.CODE)


@dataclass(frozen=True)
class CompiledController(Controller):
    """A controller whose step is compiled: `kernel(parameters, measured, state, command)`.

    All four are float64 vectors: `parameters` is `vector(drive)`, `measured` holds the fields of
    `Measured` in order, `state` the last state (zeros at first), and `command` receives torque, ask_again,
    slope and the new state. See `softstart.controller.compiled_step`.

    Attributes
    ----------
    kernel : the step, compiled by `compiled_step` with the records of its parameters and its state.
    record, state_size : these records: the names of the numbers that the step is given, and how many numbers
        its state has. A class without a record defines `vector`.

    Examples
    --------
    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf")
    >>> make_controller("direct").fitted(crane).vector(crane).tolist()
    [62.0]
    """

    kernel: ClassVar[Any]
    state_size: ClassVar[int] = 0
    record: ClassVar[np.dtype[np.void]] = np.dtype([])

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if records := getattr(vars(cls).get("kernel"), "records", None):
            cls.record, cls.state_size = records

    @classmethod
    def compiled_kernel(cls) -> Any:
        """The step, compiled here if it has not been; InputError where its code cannot be compiled."""
        if not hasattr(cls, "kernel"):
            raise InputError(f"{cls.__name__}: kernel is missing: declare it in the class as the step.")
        try:
            getattr(cls.kernel, "dispatcher", None)  # compiles
        except KeyError as error:  # what numba says of a name that a record lacks
            reason = f"no record of the step has a field {error}"
        except NumbaError as error:
            # the first line and what follows "During" name stages of numba's work, not of the step
            text = re.split("During:|There are", str(error).partition("\n")[2])[0]
            reason = " ".join(text.split()) or str(error)
        else:
            return cls.kernel
        raise InputError(f"{cls.__name__}: the step cannot be compiled: {reason}.")

    def vector(self, drive: Drive) -> Vector:
        """The numbers the kernel needs; called on a fitted controller.

        Returns
        -------
        Shape (n,), in SI units: what `record` names. Each is looked up in `numbers`, then among the
        parameters of the controller, then in the drive, as `J1`.
        """
        return np.array([*self._in_order(self.record, self.numbers(drive), drive)], dtype=np.float64)

    def numbers(self, drive: Drive) -> Numbers:
        """What the kernel needs beside parameters and drive, by name; called on a fitted controller."""
        return {}

    def named_numbers(self, drive: Drive) -> dict[str, float]:
        """The numbers of `vector` by name; those of a record within the record as `record.name`.

        >>> from softstart.controller import make_controller
        >>> crane = Drive.load("crane-4amtkf")
        >>> numbers = make_controller("reduced-two-stage").fitted(crane).named_numbers(crane)
        >>> {name: round(number, 4) for name, number in numbers.items()}
        {'torque': 15.386, 'full_torque': 62.0, 'wait': 0.0164}
        """
        return dict(zip(_names(self.record), self.vector(drive).tolist(), strict=True))

    def _in_order(self, record: np.dtype[np.void], numbers: Numbers, drive: Drive) -> Iterator[float]:
        for name in record.names or ():
            source = self if hasattr(self, name) else drive
            try:
                value = numbers[name] if name in numbers else getattr(source, name)
            except AttributeError:
                raise InputError(
                    f"{type(self).__name__}: its step takes {name}, which is neither a parameter nor a value "
                    "of the drive; declare it with `parameter`, or return it from `numbers`."
                ) from None
            if isinstance(value, dict):  # a record within the record
                yield from self._in_order(record[name], value, drive)
            else:
                yield value


def _names(record: np.dtype[np.void], before: str = "") -> Iterator[str]:
    """The names of the numbers of a record, in order."""
    for name in record.names or ():
        within = record[name].names is not None
        yield from _names(record[name], f"{before}{name}.") if within else (before + name,)


class ReadyControllers(NamedTuple):
    """Set-ups as the kernel needs them: of a compiled controller its numbers, else as they are."""

    compiled: CompiledController | None
    numbers: Matrix
    plain: list[SetUp]
    regulations: list[Regulation]  # of each set-up; empty under torque strategies

    @classmethod
    def of(cls, set_ups: Iterable[SetUp]) -> ReadyControllers:
        """Those of the same controller."""
        plain, rows, regulations = list[SetUp](), list[Vector](), list[Regulation]()
        compiled = None
        for controller, drive in set_ups:
            if isinstance(controller, CompiledController):
                compiled = controller
                rows.append(controller.vector(drive))
            else:
                plain.append((controller, drive))
            if regulation := controller.regulation(drive):
                regulations.append(regulation)
        return cls(compiled, np.array(rows, dtype=np.float64), plain, regulations)
