"""The kernel driven from Python: scratch, growing records, compiled and plain controllers."""

from __future__ import annotations

import math
import traceback

import numpy as np

from softstart.controller.base import CompiledController, Controller, Measured, PlainController, Sensor
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.plant import layout as at
from softstart.plant import start as kernel

FIRST_ROWS = 256


class Book:
    """Scratch and growing records of one start."""

    def __init__(self, sees: int, recording: bool = True) -> None:
        self.sees = sees
        rows = FIRST_ROWS if recording else 0
        self.x = np.zeros(at.N_X)
        self.m = np.zeros(at.N_M)
        self.measured = np.zeros(kernel.N_MEASURED)
        self.segments = np.zeros((rows, at.N_SEGMENT))
        self.events = np.zeros((rows, at.N_EVENT))
        self.stages = np.zeros((rows, at.N_STAGE))

    def grow(self) -> None:
        """Twice the room for whatever is nearly full."""
        for name, count in (("segments", at.N_SEGMENTS), ("events", at.N_EVENTS), ("stages", at.N_STAGES)):
            rows = getattr(self, name)
            if self.x[count] + 8 >= rows.shape[0]:
                setattr(self, name, np.concatenate([rows, np.zeros_like(rows)]))

    def rows(self) -> tuple[at.Matrix, at.Matrix, at.Matrix]:
        """The records that are filled."""
        return (
            self.segments[: int(self.x[at.N_SEGMENTS])].copy(),
            self.events[: int(self.x[at.N_EVENTS])].copy(),
            self.stages[: int(self.x[at.N_STAGES])].copy(),
        )


def run_one(controller: Controller, drive: Drive, p: at.Vector, book: Book, until: float | None) -> int:
    """A start from its beginning to `until`; `drive` is the one the (fitted) controller is set up for."""
    end = math.inf if until is None else float(until)
    if isinstance(controller, CompiledController):
        return run_compiled(controller, drive, p, book, end)
    return run_plain(controller, p, book, end)


def run_compiled(controller: CompiledController, drive: Drive, p: at.Vector, book: Book, end: float) -> int:
    """A compiled controller: the loop itself runs in the kernel."""
    kernel.begin(p, book.x, end, book.events)
    book.x[at.ASK_ON_GAP] = 1.0 if controller.sensors & Sensor.STAGE else 0.0
    numbers = np.array(
        controller.vector(drive), dtype=np.float64
    ).ravel()  # a copy: the kernel takes no read-only ones
    size = controller.state_size
    state, command = np.zeros(size), np.zeros(kernel.NEW_STATE + size)
    step = type(controller).kernel
    while True:
        reason: int = kernel.run(
            step, p, numbers, book.sees, book.x, book.m, book.measured, state, command,
            book.segments, book.events, book.stages,
        )  # fmt: skip
        if reason != at.BUFFER_FULL:
            return reason
        book.grow()


def run_plain(controller: Controller, p: at.Vector, book: Book, end: float) -> int:
    """A plain Python controller through the same kernel, one control instant at a time."""
    if not isinstance(controller, PlainController):
        raise InputError(
            f"controller = {type(controller).__name__}: derive it from PlainController or CompiledController."
        )
    kernel.begin(p, book.x, end, book.events)
    book.x[at.ASK_ON_GAP] = 1.0 if controller.sensors & Sensor.STAGE else 0.0
    state = tuple(controller.initial_state)
    while True:
        reason: int = kernel.advance(p, book.x, book.m, book.segments, book.events, book.stages)
        if reason == at.BUFFER_FULL:
            book.grow()
        elif reason == at.ASK:
            kernel.measure(p, book.x, book.sees, book.measured)
            torque, ask_again, state, slope = answer_of(controller, book.measured, state, book.x[at.TIME])
            taken: int = kernel.obey(p, book.x, book.m, torque, ask_again, slope)
            if taken != at.ASK:
                return taken
        else:
            return reason


def answer_of(
    controller: PlainController, measured: at.Vector, state: tuple[float, ...], time: float
) -> tuple[float, float, tuple[float, ...], float]:
    """What a plain controller answers at `time`: torque, when to ask again, its state, slope."""
    try:
        answer = controller.step(Measured(*measured.tolist()), state)
    except (Exception, SystemExit) as error:  # the user's own code may fail in any way
        place = traceback.extract_tb(error.__traceback__)[-1]
        raise SimulationError(
            f"The start was given up: the controller {type(controller).__name__} failed at "
            f"t = {time:.6g} s in {place.filename}, line {place.lineno} ({type(error).__name__}: {error})."
        ) from error
    try:
        slope = float(answer[3]) if len(answer) > 3 else 0.0
        return float(answer[0]), float(answer[1]), tuple(answer[2]), slope
    except (TypeError, IndexError, ValueError):
        raise InputError(
            f"controller {type(controller).__name__}: its step answered {answer!r}; "
            "answer with Command(torque, ask_again, state, slope)."
        ) from None
