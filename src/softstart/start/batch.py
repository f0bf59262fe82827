"""Many starts in one call, with labelled results."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart import formulas
from softstart.controller.base import CompiledController, Controller, Sensor, SetUp, rows_of
from softstart.drive import PARAMETERS, UNKNOWN_POSITIONS, Drive, Limits
from softstart.errors import InputError
from softstart.late import late
from softstart.plant import exchange
from softstart.plant import layout as at
from softstart.plant import start as kernel
from softstart.plant.vector import plant_vector
from softstart.start import metrics
from softstart.start.engine import MAX_EVENTS, Recorder, run_one, watched
from softstart.start.status import status_of

if TYPE_CHECKING:
    import xarray
else:
    xarray = late("xarray")

Figures = dict[str, tuple[Any, str, str]]  # name -> values, unit, meaning

PATIENCE = 0.2  # s
FIRST_TURN = 32  # starts

# name in the results, column of the kernel's notes, unit, meaning
_COLUMNS = (
    ("start_time", at.START_TIME, "s", "first instant at which the load has its target speed"),
    ("peak_time", at.PEAK_TIME, "s", "when |T| is largest"),
    ("first_contact", at.FIRST_CONTACT, "s", "instant of the first contact"),
    ("stage_2_end", at.STAGE_2_END, "s", "end of the first contact"),
    ("impact_speed", at.IMPACT_SPEED, "rad/s", "speed at which the flanks first meet"),
    ("torque_at_contact", at.CONTACT_TORQUE, "N*m", "motor torque at the first contact"),
    ("contacts", at.CONTACTS, "1", "how often the gap closed"),
    ("gap_events", at.GAP_EVENTS, "1", "closings and openings of the gap"),
    ("end_time", at.TIME, "s", "end of the run"),
    ("torque_excess", at.EXCESS, "N*m", "largest excess of the demand over the torque limits"),
    ("torque_excess_time", at.EXCESS_TIME, "s", "how long the demand lay beyond the torque limits"),
)


def simulate_many(
    drives: Drive | Sequence[Drive],
    controller: Controller,
    until: float | None,
    fitted_to: Drive | None,
    base: Drive | None,
    time_limit: float | None,
    max_events: int,
) -> xarray.Dataset:
    """`simulate` for a Drive with array fields or a list of Drives; see there.

    The dimension is `start` for a list and for one-dimensional fields, `axis_0`, `axis_1`, ... otherwise;
    the fields that differ become coordinates. Starts that could not be finished have status sentences of
    their own and NaN in every figure.
    """
    if isinstance(drives, Drive):
        results = array_starts(drives, controller, until, fitted_to, time_limit, max_events)
        return _label(drives, results, until, base or drives)
    listed = list(drives) if isinstance(drives, Sequence) else []
    if not listed or not all(isinstance(drive, Drive) and drive.shape == () for drive in listed):
        raise InputError("drive: give one Drive, a Drive with array fields, or a list of Drives, not empty.")
    rows = [array_starts(drive, controller, until, fitted_to, time_limit, max_events) for drive in listed]
    return _label_list(listed, np.concatenate(rows), until, base)


def array_starts(
    drive: Drive,
    controller: Controller | Iterable[SetUp],
    until: float | None = None,
    fitted_to: Drive | None = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
) -> at.Matrix:
    """The kernel's notes of all starts of a batch: one row a start, last index of the drive fastest.

    The columns are those of `x` in `softstart.plant.layout`; `figures` turns them into labelled figures. The
    controller is set up for each start, or once for a single `fitted_to`; set-ups that are given serve all
    starts, one each, or as many in a row. Unlike `simulate`, nothing is checked.

    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf")
    >>> notes = array_starts(crane.replace(gap=[0.5, 2.0]), make_controller("direct"))
    >>> notes[:, at.PEAK].round(2).tolist()
    [164.81, 257.18]
    """
    whole = fitted_to or drive.design_drive
    ready = rows_of(controller.set_ups(whole) if isinstance(controller, Controller) else controller)
    notes = [
        _starts(ready, plant_vector(one, time_limit, max_events), until) for one in drive.positions.values()
    ]
    return worst_of(notes) if len(notes) > 1 else notes[0]


def worst_of(notes: Sequence[at.Matrix]) -> at.Matrix:
    """Of the same starts from several positions the worst, figure by figure.

    They are the notes of the position with the largest |T|, or of one whose start could not be finished, with
    the latest start time, the hardest impact, and the largest |T| of a first contact.
    """
    every, rows = np.stack(notes), np.arange(notes[0].shape[0])
    broken = np.array(
        [[not status_of(int(s), True, False).finished for s in one[:, at.STATUS]] for one in every]
    )
    broken |= every[:, :, at.HELD] == 1.0
    which = np.argmax(np.where(broken, np.inf, np.abs(every[:, :, at.PEAK])), axis=0)
    worst: at.Matrix = every[which, rows]
    worst[:, at.POSITION] = which + 1.0
    worst[:, at.START_TIME] = np.max(every[:, :, at.START_TIME], axis=0)
    worst[:, at.IMPACT_SPEED] = np.fmax.reduce(every[:, :, at.IMPACT_SPEED], axis=0)
    first = np.where(np.isnan(every[:, :, at.STAGE_2_END]), -1.0, np.abs(every[:, :, at.FIRST_PEAK]))
    hardest = every[np.argmax(first, axis=0), rows]
    for column in (at.EXCESS, at.EXCESS_TIME):
        worst[:, column] = np.max(every[:, :, column], axis=0)
    for column in (at.FIRST_PEAK, at.STAGE_2_END):
        worst[:, column] = hardest[:, column]
    return worst


def _starts(
    ready: tuple[CompiledController, at.Matrix] | list[SetUp], p: at.Matrix, until: float | None
) -> at.Matrix:
    """The kernel's notes, one row a start."""
    end = math.inf if until is None else float(until)
    results = np.empty((p.shape[0], at.N_X))
    if isinstance(ready, list):
        for i, (row, one) in enumerate(zip(results, p, strict=True)):
            controller, own = ready[i * len(ready) // len(results)]
            recorder = Recorder(one, int(controller.sensors), recording=False)
            recorder.x[at.STATUS] = run_one(controller, own, recorder, end)
            row[:] = recorder.x
        return results
    made, numbers = ready
    if len(numbers) > 1:
        numbers = np.repeat(numbers, len(results) // len(numbers), axis=0)
    size = made.state_size
    for part in _parts(p.shape[0]):
        with watched(made):
            kernel.run_many(
                type(made).kernel, p[part], numbers[part] if len(numbers) > 1 else numbers,
                int(made.sensors), bool(made.sensors & Sensor.STAGE), np.array([end]),
                results[part], np.zeros(at.N_X), np.zeros(at.N_M), np.zeros(exchange.N_MEASURED),
                np.zeros(size), np.zeros(exchange.NEW_STATE + size), np.zeros(at.N_P),
                np.zeros(numbers.shape[1]), np.zeros((0, 0)),
            )  # fmt: skip
    return results


def _parts(count: int) -> Iterator[slice]:
    """Starts in turns of about PATIENCE: the kernel hears no Ctrl-C, which is taken between two turns."""
    done, room = 0, FIRST_TURN
    while done < count:
        began = time.perf_counter()
        yield slice(done, min(done + room, count))
        done += room
        share = PATIENCE / max(time.perf_counter() - began, 1e-9)
        room = max(1, int(room * min(share, 4.0)))


def figures(
    results: at.Matrix, base: Any, until: float | None = None, limits: Limits | None = None
) -> Figures:
    """The figures of `array_starts` as name -> (values, unit, meaning).

    `base` is the mean torque M12avg_base that K_dyn refers to, in N m, one number or one a start; `limits`
    likewise, whose life is not checked. Starts that could not be finished have NaN.
    """
    reached = ~np.isnan(results[:, at.START_TIME])
    held = results[:, at.HELD] == 1.0
    codes = 4 * results[:, at.STATUS].astype(np.int64) + 2 * held + reached
    ended, which = np.unique(codes, return_inverse=True)
    kinds = [status_of(c // 4, bool(c % 2), until is not None, bool(c & 2)) for c in ended.tolist()]
    good = np.array([kind.finished for kind in kinds])[which]

    def kept(values: Any) -> Any:
        return np.where(good, values, np.nan)

    peak = np.abs(results[:, at.PEAK])
    first = np.where(np.isnan(results[:, at.STAGE_2_END]), np.nan, np.abs(results[:, at.FIRST_PEAK]))
    k_dyn = formulas.dynamic_coefficient(np.where(good, peak, 0.0), base)
    k_first = formulas.dynamic_coefficient(np.where(good & ~np.isnan(first), first, 0.0), base)
    found: Figures = {
        "k_dyn": (kept(k_dyn), "1", "dynamic coefficient of the whole run, [G](16)"),
        "k_dyn_first_contact": (
            np.where(np.isnan(kept(first)), np.nan, k_first),
            "1",
            "dynamic coefficient of stage 2, [G](17), (18)",
        ),
        "peak_torque": (kept(peak), "N*m", "largest |T| of the run"),
    }
    for name, column, unit, meaning in _COLUMNS:
        found[name] = (kept(results[:, column]), unit, meaning)
    if not np.all(np.isnan(results[:, at.RELEASE_TIME])):
        found["release_time"] = (kept(results[:, at.RELEASE_TIME]), "s", "when the brake was released")
    if np.any(results[:, at.POSITION]):
        names = np.array(["", *UNKNOWN_POSITIONS])[results[:, at.POSITION].astype(np.int64)]
        found["position"] = (names, "", "position with the largest |T|, of those that are possible")
    if limits is not None:
        found |= margins(found, limits)
    found["status"] = (np.array([kind.name for kind in kinds])[which], "", "how the start ended")
    return found


def has_margin(limits: Limits) -> bool:
    """Whether there is a limit of torque or time, whose margin each start tells."""
    return any(one is not None for one in (limits.shaft_torque, limits.start_time, limits.used_torque))


def margins(found: Figures, limits: Limits) -> Figures:
    """Of starts with these figures what is left of the limits of torque and time; nothing without limits."""
    if not has_margin(limits):
        return {}
    judged = ("peak_torque", "used_torque", "start_time")
    timed: dict[str, Any] = {name: found[name][0] for name in judged if name in found}
    margin = np.where(np.isnan(timed["start_time"]), np.nan, limits.margin(timed))
    return {
        "margin": (margin, "1", "least share left of the limits of shaft torque and start time"),
        "keeps_limits": ((margin >= 0.0) * 1.0, "1", "1 where these limits are kept, else 0"),
    }


def _label(drive: Drive, results: at.Matrix, until: float | None, base: Drive) -> xarray.Dataset:
    shape = drive.shape
    dims = ("start",) if len(shape) == 1 else tuple(f"axis_{i}" for i in range(len(shape)))
    per_start = np.broadcast_to(metrics.base_torque(base), shape).reshape(-1)
    data = {
        name: (dims, values.reshape(shape), {"units": unit, "long_name": meaning})
        for name, (values, unit, meaning) in figures(results, per_start, until, limits_of_each(drive)).items()
    }
    coordinates = {
        name: (dims, np.broadcast_to(values, shape).copy())
        for name in PARAMETERS
        if isinstance(values := getattr(drive, name), np.ndarray)
    }
    return xarray.Dataset(data, coords=coordinates)


def limits_of_each(drive: Drive) -> Limits:
    """The limits of a drive with array fields; those that differ, in the order of the starts."""

    def flat(most: Any) -> Any:
        return np.broadcast_to(most, drive.shape).ravel() if isinstance(most, np.ndarray) else most

    limits = drive.limits
    return replace(limits, shaft_torque=flat(limits.shaft_torque), start_time=flat(limits.start_time))


def _limits_of_list(drives: list[Drive]) -> Limits:
    """Those of each drive; a drive without one may have any figure."""

    def each(name: str) -> Any:
        own = [getattr(drive.limits, name) for drive in drives]
        return None if all(one is None for one in own) else np.array([one or math.inf for one in own])

    return Limits(each("shaft_torque"), each("start_time"))


def _label_list(
    drives: list[Drive], results: at.Matrix, until: float | None, base: Drive | None
) -> xarray.Dataset:
    per_start = np.array([metrics.base_torque(base or drive) for drive in drives])
    found = figures(results, per_start, until, _limits_of_list(drives))
    data = {
        name: (("start",), values, {"units": unit, "long_name": meaning})
        for name, (values, unit, meaning) in found.items()
    }
    coordinates: dict[str, Any] = {"drive": (("start",), [drive.name for drive in drives])}
    for name in PARAMETERS:
        values = [getattr(drive, name) for drive in drives]
        if name != "name" and not PARAMETERS[name].many and any(value != values[0] for value in values):
            coordinates[name] = (("start",), values)
    return xarray.Dataset(data, coords=coordinates)
