"""One start under a compiled or a plain controller, from one control instant to the next."""

from __future__ import annotations

import math
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.controller.base import (
    CompiledController,
    Controller,
    PlainController,
    Sensor,
    WholeReply,
    label_of,
    reply_of,
)
from softstart.errors import InputError, SimulationError
from softstart.kernel import records as rec
from softstart.kernel.motor import M_TIME, NEW_STATE
from softstart.kernel.records import Measured
from softstart.quantities import time_above_0
from softstart.start.status import Status, status_of
from softstart.start.trajectory import StartRecorder

SILENCE = 60.0  # s after which a controller that has not returned is named
_computing: dict[int, tuple[float, str]] = {}  # of each thread: since when which controller computes
_watchers = [threading.Thread()]  # one, which looks at them as long as the process lives; not yet started
_starting = threading.Lock()


class watched:  # noqa: N801  a context manager, used like a function
    """Name on stderr, once, a controller that has not returned for `SILENCE`; nothing is stopped.

    A thread does it: the main one may be in the compiled step itself, which hears no signal.
    """

    __slots__ = ("name",)

    def __init__(self, controller: Controller) -> None:
        self.name = label_of(controller)

    def __enter__(self) -> None:
        _computing[threading.get_ident()] = time.monotonic(), self.name
        if not _watchers[0].is_alive():  # at the first time, and in a forked process
            with _starting:
                if not _watchers[0].is_alive():
                    _watchers[0] = threading.Thread(target=_watch, name="softstart-watch", daemon=True)
                    _watchers[0].start()

    def __exit__(self, *_: object) -> None:
        _computing.pop(threading.get_ident(), None)


def _watch() -> None:
    """Look at the controllers that compute."""
    named: set[tuple[float, str]] = set()
    while True:
        time.sleep(0.1 if SILENCE < 1.0 else 0.5)
        for began, name in set(_computing.values()) - named:
            if time.monotonic() - began >= SILENCE:
                named.add((began, name))
                sentence = f"Controller {name} has been in step() for {SILENCE:g} s. Press Ctrl-C to abort."
                print(sentence, file=sys.stderr, flush=True)


def run_one(
    controller: Controller | None,
    drive: Any,
    recorder: StartRecorder,
    until: float | None,
    changes: Sequence[tuple[Any, int, Any]] = (),
) -> int:
    """A start from its beginning to `until`; returns why it ended. Without a controller the motor is off.

    `drive` is the one for which the (fitted) controller is set up; `changes` of command are (s, run, rad/s).
    """
    end = math.inf if until is None else float(until)
    on_gap = controller is not None and bool(controller.sensors & Sensor.STAGE)
    recorder.begin(changes[0][0] if changes else end, on_gap)
    if controller is None:
        recorder.state.ask_at = math.inf
    segment = segment_of(controller, drive, recorder)
    reason = segment()
    ends = [*(at for at, *_ in changes[1:]), end]
    for (_, run, set_speed), following in zip(changes, ends, strict=False):
        if reason != rec.ENDED:
            break
        now = recorder.state
        now.run, now.set_speed, now.command_since, now.t_end = run, set_speed, now.time, following
        reason = segment()
    recorder.state.status = reason
    return reason


def segment_of(controller: Controller | None, drive: Any, recorder: StartRecorder) -> Callable[[], int]:
    """A function that goes on to the end that is set in the recorder, and returns why it came back."""
    if isinstance(controller, CompiledController):
        numbers = np.array(controller.vector(drive), dtype=np.float64).ravel()  # writable, for the kernel
        memory = np.zeros(controller.state_size)
        command = np.zeros(NEW_STATE + controller.state_size)
        step = controller.compiled_kernel()

        def compiled() -> int:
            with watched(controller):
                while (reason := recorder.run(step, numbers, memory, command)) == rec.BUFFER_FULL:
                    recorder.grow()
            return reason

        return compiled
    if controller is not None and not isinstance(controller, PlainController):
        raise InputError(
            f"controller = {type(controller).__name__}: derive it from PlainController or CompiledController."
        )
    state = tuple(controller.initial_state) if controller else ()

    def plain() -> int:
        nonlocal state
        while True:
            reason = recorder.advance()
            if reason == rec.BUFFER_FULL:
                recorder.grow()
            elif reason == rec.ASK and controller:
                torque, ask_again, slope = 0.0, math.inf, 0.0
                if recorder.measure() == rec.NO_FAULT:
                    torque, ask_again, state, slope = plain_answer(controller, recorder.measured, state)
                reason = recorder.answer(torque, ask_again, slope)
            if reason not in (rec.ASK, rec.BUFFER_FULL):
                return reason

    return plain


def plain_answer(controller: PlainController, measured: Vector, state: tuple[float, ...]) -> WholeReply:
    """What a plain controller answers; SimulationError where its code fails."""
    try:
        with watched(controller):
            return reply_of(controller, Measured(*measured.tolist()), state)
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # the user's own code may fail in any way
        place = traceback.extract_tb(error.__traceback__)[-1]
        raise SimulationError(
            f"The start was given up: the controller {type(controller).__name__} failed at "
            f"t = {measured[M_TIME]:.6g} s in {place.filename}, line {place.lineno} "
            f"({type(error).__name__}: {error})."
        ) from error


def check_limits(
    until: object, time_limit: object, max_events: object, machine: str
) -> tuple[float | None, float | None, int]:
    """The end, the time limit and the cap on events of a start of a `machine` (drive or chain)."""
    end = None if until is None else time_above_0(until, "until", "; leave it out to run to the start time")
    default = f"; leave it out for a hundred times a stiff {machine}'s start"
    latest = None if time_limit is None else time_above_0(time_limit, "time_limit", default)
    if isinstance(max_events, bool) or not isinstance(max_events, Integral) or max_events < 1:
        raise InputError(f"max_events = {max_events}: the cap on events is a whole number of 1 or more.")
    return end, latest, int(max_events)


def ended(notes: rec.ResultRecord, reason: int, until: float | None, max_events: int, start: str) -> Status:
    """How a start ended; raises SimulationError, which names the `start`, if it could not be finished."""
    status = status_of(reason, notes.reached == 1.0, until is not None, notes.braked == 1.0)
    if status.finished:
        return Status.FAULT if notes.fault != rec.NO_FAULT else status
    remedy = ""
    if status is Status.TOO_MANY_EVENTS:
        remedy = f" That is {max_events:,}: end the run earlier, sample less often, or allow more."
    raise SimulationError(
        f"{status.value}{remedy} {start}, t = {notes.time:.6g} s, {int(notes.events)} events."
    )
