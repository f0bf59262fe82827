"""Many starts in one call, on several cores: the same bits as one start at a time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart import formulas
from softstart.arrays import Matrix, Vector
from softstart.controller.base import CompiledController, Controller, Sensor, SetUp, numbers_of
from softstart.drive import PARAMETERS, UNKNOWN_POSITIONS, Drive, Limits
from softstart.drive.records import Records, each_of
from softstart.kernel import records as at
from softstart.kernel import start as kernel
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.parallel import Pool, checked_workers
from softstart.start.engine import run_one, watched
from softstart.start.recorded import StartRecorder
from softstart.start.rows import MAX_EVENTS, Rows, blank, joined, kernel_input
from softstart.start.status import status_of

if TYPE_CHECKING:
    import xarray

Figures = dict[str, tuple[Any, str, str]]  # name -> values, unit, meaning
Which = NDArray[np.int64]

PATIENCE = 0.2  # s
FIRST_TURN = 32  # starts

# name in the results, name in the kernel's notes, unit, meaning
_COLUMNS = (
    ("start_time", "start_time", "s", "first instant at which the load has its target speed"),
    ("first_contact", "first_contact", "s", "instant of the first contact"),
    ("stage_2_end", "stage_2_end", "s", "end of the first contact"),
    ("impact_speed", "impact_speed", "rad/s", "speed at which the flanks first meet"),
    ("torque_at_contact", "contact_torque", "N*m", "motor torque at the first contact"),
    ("contacts", "contacts", "1", "how often the gap closed"),
    ("gap_events", "gap_events", "1", "closings and openings of the gap"),
    ("end_time", "time", "s", "end of the run"),
    ("torque_excess", "excess", "N*m", "largest excess of the demand over the torque limits"),
    ("torque_excess_time", "excess_time", "s", "how long the demand lay beyond the torque limits"),
)
_LATEST = ("start_time", "excess", "excess_time")  # of several positions the largest counts


@dataclass(frozen=True, eq=False)
class StartResults:
    """What the kernel notes of many starts: a row for each, of each shaft a column."""

    starts: NDArray[np.void]
    shafts: NDArray[np.void]

    def __getitem__(self, name: str) -> Vector:
        """A column of what is noted of the start."""
        column: Vector = self.starts[name]
        return column

    @property
    def peaks(self) -> Matrix:
        """Largest |T| of each shaft, N m."""
        peaks: Matrix = np.abs(self.shafts["peak"])
        return peaks

    @property
    def finished(self) -> NDArray[np.bool_]:
        """Which starts went to their end."""
        kinds, which = np.unique(self["status"], return_inverse=True)
        return np.array([status_of(int(one), True, False).finished for one in kinds], dtype=bool)[which]


def worst_position(notes: Sequence[StartResults]) -> StartResults:
    """Of the same starts from several positions the worst, figure by figure, as a `Run` has them.

    They are the notes of the position with the largest |T|, or of one whose start could not be finished, with
    the latest start time, the largest excess of the demand, the hardest impact, and of each shaft the largest
    |T| with its instant, the largest impulse, and the largest |T| of a first contact (NaN without one).
    """
    starts, shafts = np.stack([one.starts for one in notes]), np.stack([one.shafts for one in notes])
    rows = np.arange(starts.shape[1])
    broken = np.stack([~one.finished for one in notes]) | (starts["braked"] == 1.0)
    which = np.argmax(np.where(broken, np.inf, np.abs(shafts["peak"]).max(axis=2)), axis=0)
    worst = StartResults(starts[which, rows], shafts[which, rows])
    worst.starts["position"] = which + 1.0
    for name in _LATEST:
        worst.starts[name] = np.max(starts[name], axis=0)
    worst.starts["impact_speed"] = np.fmax.reduce(starts["impact_speed"], axis=0)
    first = np.where(np.isnan(starts["stage_2_end"])[..., None], np.nan, np.abs(shafts["first_peak"]))
    worst.shafts["first_peak"] = np.fmax.reduce(first, axis=0)
    worst.shafts["impulse"] = shafts["impulse"].max(axis=0)
    place = np.abs(shafts["peak"]).argmax(axis=0)[None]
    for name in ("peak", "peak_time"):
        worst.shafts[name] = np.take_along_axis(shafts[name], place, axis=0)[0]
    return worst


Ready = tuple[CompiledController, Matrix] | list[SetUp]


def run_set_ups(rows: Rows, ready: Ready, until: float | None, workers: int = 1) -> StartResults:
    """The kernel's notes of starts; set-ups, by `numbers_of`, serve all, one each, or as many in a row."""
    count = rows.machines.shape[0]
    if isinstance(ready, tuple):
        made, numbers = ready
        if len(numbers) > 1:
            numbers = np.repeat(numbers, count // len(numbers), axis=0)
        return start_results(rows, made, numbers, until, workers)
    notes = np.zeros((count, at.N_NOTES))
    shafts = np.zeros((count, rows.count - 1), at.SHAFT_NOTES)
    for i in range(count):
        controller, own = ready[i * len(ready) // count]
        recorder = StartRecorder(rows.taken(slice(i, i + 1)), int(controller.sensors), room=0)
        run_one(controller, own, recorder, until)
        notes[i] = recorder.work[: at.N_NOTES]
        for name in at.SHAFT_NOTES.names:
            shafts[name][i] = recorder.state[name][: rows.count - 1]
    return StartResults(notes.view(at.NOTES)[:, 0], shafts)


def start_results(
    rows: Rows, controller: Any, numbers: Matrix, until: float | None = None, workers: int = 1
) -> StartResults:
    """The kernel's notes of starts under a compiled controller: numbers a row each, or one for all."""
    count = rows.machines.shape[0]
    notes = np.zeros((count, at.N_NOTES))
    of_shafts = np.zeros((count, rows.count - 1, at.size(at.SHAFT_NOTES)))
    step, sees, size = type(controller).kernel, int(controller.sensors), controller.state_size
    end = math.inf if until is None else float(until)

    def run(part: slice) -> None:
        with watched(controller):
            kernel.run_many(
                step, np.ascontiguousarray(numbers[part]) if numbers.shape[0] > 1 else numbers, sees,
                bool(sees & Sensor.STAGE), end, rows.machines[part], rows.masses[part], rows.shafts[part],
                rows.curves[part], notes[part], of_shafts[part], np.zeros(at.N_WORK), np.zeros(N_MEASURED),
                np.zeros(size), np.zeros(NEW_STATE + size),
            )  # fmt: skip

    if workers == 1 or count <= FIRST_TURN:
        for part in _parts(count):
            run(part)
    else:
        parts = [slice(i, i + FIRST_TURN) for i in range(0, count, FIRST_TURN)]
        with Pool(min(workers, len(parts)), threads=True) as pool:
            for _ in pool.results(run, iter(parts)):
                pass
    return StartResults(notes.view(at.NOTES)[:, 0], of_shafts.view(at.SHAFT_NOTES)[..., 0])


def _parts(count: int) -> Iterator[slice]:
    """Starts in turns of about PATIENCE: the kernel hears no Ctrl-C, which is taken between two turns."""
    done, room = 0, FIRST_TURN
    while done < count:
        began = time.perf_counter()
        yield slice(done, min(done + room, count))
        done += room
        share = PATIENCE / max(time.perf_counter() - began, 1e-9)
        room = max(1, int(room * min(share, 4.0)))


@dataclass(frozen=True, eq=False)
class Batch:
    """Machines as rows of the kernel, written once for many calls: a row for each position of each.

    `places` has the rows of each machine, a row for each of its `positions` (the last one again where another
    machine has more); `permissible` has the torques of its shafts, `limits` its limits as arrays.
    """

    shaft_names: tuple[str, ...]
    places: NDArray[np.int64]
    positions: Which
    rows: Rows
    permissible: Matrix
    limits: Limits

    def notes(
        self,
        set_ups: Iterable[SetUp],
        which: Which | slice = slice(None),
        *,
        until: float | None = None,
        time_limit: float | None = None,
        workers: int = 1,
    ) -> StartResults:
        """The kernel's notes of machines `which[i]` in place i, of several positions the worst; or of all.

        The set-ups of the controller serve all places, one each, or as many in a row.
        """
        ready, sizes = numbers_of(set_ups), self.positions[which]
        # all of a million starts are not copied
        alone = isinstance(which, slice) and len(self.places) == 1
        each = [slice(None)] if alone else self.places[: int(sizes.max(initial=1)), which]
        taken = (self.rows.taken(rows).limited(time_limit) for rows in each)
        notes = [run_set_ups(rows, ready, until, workers) for rows in taken]
        if len(notes) == 1:
            return notes[0]
        worst = worst_position(notes)
        worst.starts["position"][sizes == 1] = 0.0
        return worst

    def figures(
        self,
        set_ups: Iterable[SetUp],
        base: Any,
        which: Which | slice = slice(None),
        *,
        until: float | None = None,
        time_limit: float | None = None,
        workers: int = 1,
    ) -> Figures:
        """Figures by name of the same starts. `base` is M12avg in N m, one or one a start."""
        notes = self.notes(set_ups, which, until=until, time_limit=time_limit, workers=workers)
        return self.read(notes, base, which, until)

    def read(
        self, notes: StartResults, base: Any, which: Which | slice = slice(None), until: float | None = None
    ) -> Figures:
        """The figures in the kernel's notes."""
        found, names = figures(notes, base, until), self.shaft_names
        means = np.broadcast_to(np.asarray(base, dtype=np.float64), notes.starts.shape)
        status = found.pop("status")
        if len(names) > 1:
            largest = np.where(np.isnan(found["k_dyn"][0])[:, None], np.nan, notes.peaks)
            for k, place in enumerate(names):
                found[f"k_dyn_{k + 1}"] = (largest[:, k] / means, "1", f"K_dyn of {place}")
            for k, place in enumerate(names):
                found[f"peak_torque_{k + 1}"] = (largest[:, k], "N*m", f"largest |T| of {place}")
            used = 100.0 * np.nan_to_num(largest / self.permissible[which]).max(axis=1)
            meaning = "largest |T| over what its shaft permits"
            found["used_torque"] = (np.where(np.isnan(found["k_dyn"][0]), np.nan, used), "%", meaning)
        every: Any = (self.limits.shaft_torque, self.limits.start_time)
        torque, time_limit = (None if most is None else most[which] for most in every)
        limits = replace(self.limits, shaft_torque=torque, start_time=time_limit)
        return {**found, **limit_margins(found, limits), "status": status}


def figure_columns(shaft_names: tuple[str, ...]) -> Figures:
    """The names of all figures, with units and meanings, of starts of machines with these shafts."""
    count, zero = len(shaft_names), np.zeros(1, dtype=np.int64)
    notes = StartResults(np.zeros(1, at.NOTES), np.zeros((1, count), at.SHAFT_NOTES))
    notes.starts["release_time"] = math.nan
    limits: Any = Limits(shaft_torque=np.ones(1), used_torque=1.0)  # type: ignore[arg-type]
    rows, permissible = blank((), count + 1), np.ones((1, count))
    return Batch(shaft_names, zero[None], zero + 1, rows, permissible, limits).read(notes, 1.0)


def prepared(
    machines: Records | Sequence[Any], time_limit: float | None = None, max_events: int = MAX_EVENTS
) -> Batch:
    """Machines that go through one call of the kernel; InputError for machines that do not match.

    >>> from softstart.controller import make_controller
    >>> crane, direct = Drive.load("crane-4amtkf"), make_controller("direct")
    >>> batch = prepared([crane, crane.replace(gap=2.0)])
    >>> batch.notes([direct.set_up(crane)]).peaks.round(2).tolist()
    [[164.81], [257.18]]
    """
    parts = machines.parts if isinstance(machines, Records) else tuple(machines)
    each = [list(part.positions.values()) for part in parts]
    rows = [[kernel_input(one, time_limit, max_events) for one in several] for several in each]
    counts = [len(several[0].machines) for several in rows]
    positions = np.repeat([len(several) for several in rows], counts)
    begins = np.cumsum([0, *(len(several) * count for several, count in zip(rows, counts, strict=True))])
    places = np.empty((int(positions.max()), positions.size), dtype=np.int64)
    first = np.repeat(begins[:-1], counts) + np.concatenate([np.arange(count) for count in counts])
    for k, place in enumerate(places):
        place[:] = first + np.minimum(k, positions - 1) * np.repeat(counts, counts)
    return Batch(
        parts[0].shaft_names, places, positions, joined([row for several in rows for row in several]),
        np.concatenate([np.atleast_2d(part.permissible_torques) for part in parts]), _limits_of(parts),
    )  # fmt: skip


def _limits_of(parts: Sequence[Any]) -> Limits:
    """The limits of each machine; one without a limit may have any figure."""
    limits = [part.limits for part in parts]

    def every(name: str) -> Any:
        own = [getattr(one, name) for one in limits]
        if all(one is None for one in own):
            return None
        return np.concatenate(
            [each_of(part, math.inf if one is None else one) for part, one in zip(parts, own, strict=True)]
        )

    return Limits(every("shaft_torque"), every("start_time"), used_torque=limits[0].used_torque)


def figures(notes: StartResults, base: Any, until: float | None = None) -> Figures:
    """The figures of many starts as name -> (values, unit, meaning).

    `base` is the mean torque M12avg_base that K_dyn refers to, in N m, one number or one a start. Starts that
    could not be finished have NaN.
    """
    reached = ~np.isnan(notes["start_time"])
    held = notes["braked"] == 1.0
    codes = 4 * notes["status"].astype(np.int64) + 2 * held + reached
    ended, which = np.unique(codes, return_inverse=True)
    kinds = [status_of(c // 4, bool(c % 2), until is not None, bool(c & 2)) for c in ended.tolist()]
    good = np.array([kind.finished for kind in kinds])[which]

    def kept(values: Any) -> Any:
        return np.where(good, values, np.nan)

    rows, worst = np.arange(good.size), notes.peaks.argmax(axis=1)
    peak = notes.peaks[rows, worst]
    first = np.abs(notes.shafts["first_peak"]).max(axis=1)
    # of several positions `worst_position` has left out those without a stage 2
    first = np.where(np.isnan(notes["stage_2_end"]) & (notes["position"] == 0.0), np.nan, first)
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
        "peak_time": (kept(notes.shafts["peak_time"][rows, worst]), "s", "when |T| is largest"),
    }
    for name, column, unit, meaning in _COLUMNS:
        found[name] = (kept(notes[column]), unit, meaning)
    if not np.all(np.isnan(notes["release_time"])):
        found["release_time"] = (kept(notes["release_time"]), "s", "when the brake was released")
    if np.any(notes["position"]):
        names = np.array(["", *UNKNOWN_POSITIONS])[notes["position"].astype(np.int64)]
        found["position"] = (names, "", "position with the largest |T|, of those that are possible")
    found["status"] = (np.array([kind.name for kind in kinds])[which], "", "how the start ended")
    return found


def has_margin(limits: Limits) -> bool:
    """Whether there is a limit of torque or time, whose margin each start tells."""
    return any(one is not None for one in (limits.shaft_torque, limits.start_time, limits.used_torque))


def limit_margins(found: Figures, limits: Limits) -> Figures:
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


def simulate_many(
    machines: Records | Sequence[Any],
    controller: Controller,
    until: float | None,
    fitted_to: Any,
    base: Any,
    time_limit: float | None,
    max_events: int,
    workers: int | None = None,
) -> xarray.Dataset:
    """`simulate` for records or a list of machines; see there.

    The dimension is `start` for a list and for one-dimensional fields, `axis_0`, `axis_1`, ... otherwise;
    the fields that differ become coordinates. Machines with several shafts have `k_dyns` and `peak_torques`
    too, with the dimension `shaft`.
    """
    batch = prepared(machines, time_limit, max_events)
    if isinstance(machines, Records):
        shape, means = machines.shape, machines.mean_torque
        dims = ("start",) if len(shape) == 1 else tuple(f"axis_{i}" for i in range(len(shape)))
        coordinates: dict[str, Any] = {name: (dims, one.copy()) for name, one in machines.fields.items()}
        figure_columns = {machines.parts[0].shaft_names}
    else:
        shape, dims = (len(machines),), ("start",)
        means = np.array([one.mean_torque for one in machines], dtype=np.float64)
        coordinates = {"drive": (dims, [one.name for one in machines])}
        coordinates |= {name: (dims, values) for name, values in _different(machines)}
        figure_columns = {one.shaft_names for one in machines}
    found = batch.figures(
        controller.set_ups(fitted_to or machines), means if base is None else base.mean_torque,
        until=until, workers=workers or checked_workers(None),
    )  # fmt: skip
    data: dict[str, Any] = {
        name: (dims, one[0].reshape(shape), *one[1:])
        for name, one in found.items()
        if name.rstrip("0123456789")[-1] != "_"
    }
    if (count := len(batch.shaft_names)) > 1:
        for one, many in (("k_dyn", "k_dyns"), ("peak_torque", "peak_torques")):
            columns = [found[f"{one}_{k + 1}"] for k in range(count)]
            values = np.stack([column[0].reshape(shape) for column in columns], axis=-1)
            data[many] = ((*dims, "shaft"), values, columns[0][1], f"{found[one][2]}, of each shaft")
        if len(figure_columns) == 1:
            coordinates["shaft"] = (("shaft",), list(batch.shaft_names))
    return _dataset(data, coordinates)


def _different(machines: Sequence[Any]) -> Iterator[tuple[str, list[Any]]]:
    """The parameters in which drives of a list differ; of chains they are not known by name."""
    for name in PARAMETERS if all(isinstance(one, Drive) for one in machines) else ():
        given = [getattr(one, name) for one in machines]
        if name != "name" and not PARAMETERS[name].many and any(value != given[0] for value in given):
            yield name, given


def _dataset(data: Mapping[str, Any], coordinates: Mapping[str, Any]) -> xarray.Dataset:
    import xarray

    return xarray.Dataset(
        {name: (dims, values, {"units": unit, "long_name": meaning})
         for name, (dims, values, unit, meaning) in data.items()},
        coords=coordinates,
    )  # fmt: skip
