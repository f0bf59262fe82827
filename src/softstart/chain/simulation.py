"""Starts of whole chains: `simulate_chain` under a controller, `verify_on_chain` beside the reduced drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np

from softstart.balancing.periodic_torque import PeriodicTorque
from softstart.chain import kernel_layout as at
from softstart.chain import kernel_start as kernel
from softstart.chain.kernel_input import Numbers, numbers
from softstart.chain.model import Chain
from softstart.chain.reduction import reduce_chain
from softstart.chain.run import ChainRun
from softstart.controller.base import CompiledController, Controller, PlainController, Sensor
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.plant import layout as plant
from softstart.plant import start as sensing
from softstart.start import metrics
from softstart.start.engine import answer_of
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.start.status import Status, status_of

MAX_EVENTS = 1_000_000
FIRST_ROWS = 256


def simulate_chain(
    chain: Chain | str,
    controller: str | Controller | None,
    until: float | None = None,
    *,
    fitted_to: Drive | None = None,
    parameters: Mapping[str, object] | None = None,
    base: Drive | None = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
    excitation: Mapping[str | int, PeriodicTorque] | None = None,
) -> ChainRun:
    """Simulate the start of a chain under a controller, exactly.

    Between two events the chain is linear: its Taylor series are summed to the last digit, and events are
    certified first roots of them. A shaft without a gap is a spring that pulls too. A gear with losses passes
    on its share of the torque in the direction of the power, and holds its mass at rest in between
    (`softstart.chain.kernel_gears`). Rigid gaps close by impacts, angular momentum kept; those that pile up
    are followed to their known end, when the flanks press.

    Parameters
    ----------
    chain : a Chain, or the name or file of one.
    controller : a name, `path/to/file.py:ClassName`, or a Controller object; None leaves the motor off.
    until : end of the run in s; by default one elastic period after the load mass has its target speed.
    fitted_to : the drive from which the controller's own defaults are derived: by default the modal reduction
        of the chain to two masses, whatever its error.
    parameters : parameters of a controller given by name.
    base : the drive whose mean torque K_dyn refers to, if not that one.
    time_limit : s, after which a start that has not reached its target speed is given up as not reached.
    max_events : cap on the events and on the control instants; going over it is an error, not a result.
    excitation : periodic torques by the names (or indices) of the masses on which they act, each at the speed
        of its own shaft.

    Raises InputError for bad input and SimulationError for a start that cannot be finished.

    >>> run = simulate_chain("crane-4-mass", "direct")
    >>> round(run.k_dyn, 3), round(run.start_time, 4)
    (6.299, 0.3708)
    """
    if isinstance(chain, str):
        chain = Chain.load(chain)
    until = _time("until", until, "leave it out to run to the start time")
    time_limit = _time("time_limit", time_limit, "leave it out for a hundred times a stiff chain's start")
    if isinstance(max_events, bool) or not isinstance(max_events, Integral) or max_events < 1:
        raise InputError(f"max_events = {max_events}: the cap on events is a whole number of 1 or more.")
    for name, other in (("fitted_to", fitted_to), ("base", base)):
        if other is not None and not (isinstance(other, Drive) and other.shape == ()):
            raise InputError(f"{name} = {other!r}: give a single Drive.")
    given = numbers(chain, excitation, time_limit, int(max_events))
    _check_end(chain, controller, until, given)
    fitted = None
    book = _Book(given)
    end = math.inf if until is None else until
    if controller is None:
        kernel.begin(book.x, book.m, given.place, given.masses, given.shafts, book.mass, book.shaft, end)
        book.x[plant.ASK_AT] = math.inf
        reason = _go_on(given, book)
    else:
        made = make_controller(controller, parameters)
        fitted_to = fitted_to or drive_of(chain)
        fitted, own = made.set_up(fitted_to)
        reason = _run(fitted, own, given, book, end)
    status = status_of(reason, not math.isnan(book.x[plant.START_TIME]), until is not None)
    if not status.finished:
        remedy = ""
        if status is Status.TOO_MANY_EVENTS:
            remedy = f" That is {max_events:,}: end the run earlier, sample less often, or allow more."
        raise SimulationError(
            f"{status.value}{remedy} Chain {chain.name}, t = {book.x[plant.TIME]:.6g} s, "
            f"{int(book.x[plant.EVENTS])} events."
        )
    return ChainRun(
        chain, fitted, base or fitted_to, status, given, book.x.copy(), book.mass.copy(), book.shaft.copy(),
        book.segments[: int(book.x[plant.N_SEGMENTS])].copy(),
        book.events[: int(book.x[plant.N_EVENTS])].copy(),
    )  # fmt: skip


def drive_of(chain: Chain) -> Drive:
    """The two-mass drive for which a controller is set up where none is named: the modal reduction."""
    try:
        return reduce_chain(chain, 2, method="modal", force=True).to_drive()
    except InputError as error:
        sentences = [*error.sentences, "Name the drive for which the controller is set up (fitted_to)."]
        raise InputError(sentences) from None


class _Book:
    """State, scratch and growing records of one start."""

    def __init__(self, given: Numbers) -> None:
        self.x, self.m, self.mass, self.shaft, self.series, self.lines = given.scratch()
        self.segments = np.zeros((FIRST_ROWS, at.row_width(given.count)))
        self.events = np.zeros((FIRST_ROWS + 4 * given.count, at.N_EVENT))

    def grow(self) -> None:
        """Twice the room for whatever is nearly full."""
        if self.x[plant.N_SEGMENTS] >= self.segments.shape[0]:
            self.segments = np.concatenate([self.segments, np.zeros_like(self.segments)])
        else:
            self.events = np.concatenate([self.events, np.zeros_like(self.events)])


def _go_on(given: Numbers, book: _Book) -> int:
    """To the next control instant or to the end."""
    while True:
        reason: int = kernel.advance(
            given.p, book.x, book.m, given.place, given.masses, given.shafts, given.tones, book.mass,
            book.shaft, book.series, book.lines, book.segments, book.events,
        )  # fmt: skip
        if reason != plant.BUFFER_FULL:
            return reason
        book.grow()


def _run(controller: Controller, drive: Drive, given: Numbers, book: _Book, until: float) -> int:
    x, m = book.x, book.m
    kernel.begin(x, m, given.place, given.masses, given.shafts, book.mass, book.shaft, until)
    x[plant.ASK_ON_GAP] = 1.0 if controller.sensors & Sensor.STAGE else 0.0
    sees = int(controller.sensors)
    measured = np.zeros(sensing.N_MEASURED)
    if isinstance(controller, CompiledController):
        own = np.array(controller.vector(drive), dtype=np.float64).ravel()
        size = controller.state_size
        command = np.zeros(sensing.NEW_STATE + size)
        of_controller = np.zeros(size)
        while True:
            reason: int = kernel.run(
                type(controller).kernel, given.p, own, sees, x, m, measured, of_controller, command,
                given.place, given.masses, given.shafts, given.tones, book.mass, book.shaft, book.series,
                book.lines, book.segments, book.events,
            )  # fmt: skip
            if reason != plant.BUFFER_FULL:
                return reason
            book.grow()
    if not isinstance(controller, PlainController):
        raise InputError(
            f"controller = {type(controller).__name__}: derive it from PlainController or CompiledController."
        )
    state = tuple(controller.initial_state)
    while True:
        reason = _go_on(given, book)
        if reason != plant.ASK:
            return reason
        kernel.look(
            given.p, x, m, sees, given.place, given.masses, given.shafts, given.tones, book.mass, book.shaft,
            book.series, book.lines, measured,
        )  # fmt: skip
        torque, ask_again, state, slope = answer_of(controller, measured, state, x[plant.TIME])
        taken: int = sensing.obey(given.p, x, m, torque, ask_again, slope)
        if taken != plant.ASK:
            return taken


def _check_end(chain: Chain, controller: object, until: float | None, given: Numbers) -> None:
    """A run needs an end."""
    if controller is not None and chain.motor is None:
        raise InputError(
            "[motor] is missing: a controller needs one; add it to the chain, or give None as the controller."
        )
    if until is not None or given.p[plant.TIME_LIMIT] < math.inf:
        return
    if controller is None or chain.target_speed is None:
        raise InputError(
            "until is missing: without motor and target speed nothing else ends the run; give it in s."
        )
    arrays = chain.at_motor_shaft()
    load = float((arrays.Mc / arrays.efficiency_from_motor).sum())
    lossy = " and through its gears" if (arrays.efficiency < 1.0).any() else ""
    raise InputError(
        f"starting_torque: it is not above the load torques, {load:.6g} N*m at the motor "
        f"shaft{lossy}, so the load may never reach its target speed; give until or time_limit."
    )


def _time(name: str, value: object, remedy: str) -> float | None:
    """A time above 0 s, or None."""
    if value is None:
        return None
    if isinstance(value, Real) and not isinstance(value, bool) and 0.0 < float(value) < math.inf:
        return float(value)
    raise InputError(f"{name} = {value}: give a time above 0 s as a number; {remedy}.")


@dataclass(frozen=True, eq=False)
class Verification:
    """A controller set up for the drive, on drive and chain; K_dyn over the drive's mean torque."""

    drive: Run
    chain: ChainRun

    @property
    def name(self) -> str:
        """Name of the controller."""
        return self.drive.controller.name or type(self.drive.controller).__name__

    @property
    def worst_shaft(self) -> int:
        """The index of the shaft between motor and load with the largest torque at the motor shaft."""
        arrays = self.chain.chain.at_motor_shaft()
        first, last = sorted((arrays.motor, arrays.load))
        if first == last:
            first, last = 0, arrays.J.size - 1
        return first + int(self.chain.peak_torques[first:last].argmax())

    @property
    def worst_place(self) -> str:
        """Between which masses it is."""
        masses = self.chain.chain.masses
        return f"{masses[self.worst_shaft].name} - {masses[self.worst_shaft + 1].name}"

    @property
    def worst_k_dyn(self) -> float:
        """Its largest torque over the mean torque of the drive."""
        return float(metrics.k_dyn(float(self.chain.peak_torques[self.worst_shaft]), self.drive.drive))

    @property
    def error(self) -> float:
        """How far the K_dyn of the drive is from that of the chain's shaft beside the motor, as a share."""
        return self.drive.k_dyn / self.chain.k_dyn - 1.0

    def summary(self) -> dict[str, Any]:
        """Both side by side, as plain data."""
        return {
            "controller": self.name,
            "k_dyn": self.drive.k_dyn,
            "peak_torque": self.drive.peak_torque,
            "start_time": self.drive.start_time,
            "chain_k_dyn": self.chain.k_dyn,
            "chain_peak_torque": self.chain.peak_torque,
            "chain_start_time": self.chain.start_time,
            "k_dyn_error": self.error,
            "worst_k_dyn": self.worst_k_dyn,
            "worst_shaft": self.worst_place,
            "gear_losses": self.chain.energy.gears,
            "chain": self.chain.summary(),
        }


def verify_on_chain(
    chain: Chain | str,
    drive: Drive,
    controller: str | Controller,
    until: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Verification:
    """Run a controller that is set up for `drive` on that drive and on the chain it stands for.

    >>> from softstart.chain import Chain, reduce_chain
    >>> chain = Chain.load("crane-4-mass")
    >>> found = verify_on_chain(chain, reduce_chain(chain, to=2).to_drive(), "s-curve")
    >>> found.worst_place, found.chain.k_dyn > found.drive.k_dyn
    ('rotor - pinion', True)
    """
    if drive.shape != ():
        raise InputError(f"{drive.name}: a batch of shape {drive.shape}; give a single drive.")
    made = make_controller(controller, parameters)
    whole = simulate_chain(chain, made, until, fitted_to=drive, base=drive)
    return Verification(simulate(drive, made, until), whole)
