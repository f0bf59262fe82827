"""What the kernel notes of many starts, as it is computed on several cores, and the figures in it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart import formulas
from softstart.arrays import Matrix, Vector
from softstart.controller.base import CompiledController, ReadyControllers, Sensor
from softstart.drive import UNKNOWN_POSITIONS, Limits
from softstart.kernel import records as rec
from softstart.kernel import start as kernel
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.parallel import Pool
from softstart.start.engine import run_one, watched
from softstart.start.kernel_input import KernelInput
from softstart.start.status import status_of
from softstart.start.trajectory import StartRecorder

Figures = dict[str, tuple[Any, str, str]]  # name -> values, unit, meaning

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
_SETTLED = ("settled_time", "settled", "s", "instant from which on the load keeps its speed")
# where the kernel notes them
_REGULATED = (_SETTLED, ("overshoot", "overshoot", "1", "share of the target by which the load exceeds it"))
# of several positions the largest counts
_LATEST = ("start_time", "settled", "overshoot", "excess", "excess_time")


@dataclass(frozen=True, eq=False)
class StartResults:
    """What the kernel notes of many starts: a row for each, of each shaft a column."""

    starts: NDArray[np.void]
    shafts: NDArray[np.void]

    def __getitem__(self, name: str) -> Vector:
        """A column of what is noted of the start."""
        return self.starts[name]

    @property
    def peaks(self) -> Matrix:
        """Largest |T| of each shaft, N m."""
        peaks: Matrix = np.abs(self.shafts["peak"])
        return peaks

    @property
    def finished(self) -> NDArray[np.bool_]:
        """Which starts went to their end."""
        reasons, which = np.unique(self["status"], return_inverse=True)
        finished = [status_of(int(reason), True, False).finished for reason in reasons]
        return np.array(finished, dtype=bool)[which]


def worst_position(results: Sequence[StartResults]) -> StartResults:
    """Of the same starts from several positions the worst, figure by figure, as a `Run` has them.

    They are those from the position with the largest |T|, or of one whose start could not be finished, with
    the latest start time, the largest excess of the demand, the hardest impact, and of each shaft the largest
    |T| with its instant, the largest impulse, and the largest |T| of a first contact (NaN without one).
    """
    starts, shafts = (np.stack([getattr(one, name) for one in results]) for name in ("starts", "shafts"))
    rows = np.arange(starts.shape[1])
    broken = np.stack([~one.finished for one in results]) | (starts["braked"] == 1.0)
    which = np.argmax(np.where(broken, np.inf, np.abs(shafts["peak"]).max(axis=2)), axis=0)
    worst = StartResults(starts[which, rows], shafts[which, rows])
    worst.starts["position"] = which + 1.0
    for name in _LATEST:
        worst.starts[name] = np.max(starts[name], axis=0)
    worst.starts["reached"] = np.min(starts["reached"], axis=0)
    worst.starts["impact_speed"] = np.fmax.reduce(starts["impact_speed"], axis=0)
    first = np.where(np.isnan(starts["stage_2_end"])[..., None], np.nan, np.abs(shafts["first_peak"]))
    worst.shafts["first_peak"] = np.fmax.reduce(first, axis=0)
    worst.shafts["impulse"] = shafts["impulse"].max(axis=0)
    place = np.abs(shafts["peak"]).argmax(axis=0)[None]
    for name in ("peak", "peak_time"):
        worst.shafts[name] = np.take_along_axis(shafts[name], place, axis=0)[0]
    return worst


def run_set_ups(
    starts: KernelInput, ready: ReadyControllers, until: float | None, workers: int = 1
) -> StartResults:
    """The results of starts; set-ups serve all, one each, or as many in a row."""
    count = starts.machines.shape[0]
    if ready.compiled is not None:
        numbers = ready.numbers
        if len(numbers) > 1:
            numbers = np.repeat(numbers, count // len(numbers), axis=0)
        return run_compiled(starts, ready.compiled, numbers, until, workers)
    notes = np.zeros((count, rec.N_NOTES))
    shafts = np.zeros((count, starts.count - 1), rec.SHAFT_NOTES)
    for i in range(count):
        plain, drive = ready.plain[i * len(ready.plain) // count]
        recorder = StartRecorder(starts.take(slice(i, i + 1)), int(plain.sensors), room=0)
        reason = run_one(plain, drive, recorder, until)
        notes[i], shafts[i] = recorder.work[: rec.N_NOTES], recorder.of_shafts
        now = recorder.state
        end = float(now.start_time + now.dwell)
        judged = not math.isnan(now.band_low) and now.regulated == 0.0 and reason == rec.ENDED
        if judged and end > now.time and run_one(plain, drive, recorder, end) == rec.ENDED:  # as `run_many`
            notes[i : i + 1].view(rec.NOTES)["settled"] = recorder.state.settled
    return StartResults(notes.view(rec.NOTES)[:, 0], shafts)


def run_compiled(
    starts: KernelInput,
    controller: CompiledController,
    numbers: Matrix,
    until: float | None = None,
    workers: int = 1,
) -> StartResults:
    """The same under a compiled controller: `numbers` has a row for each start, or one for all."""
    count = starts.machines.shape[0]
    notes = np.zeros((count, rec.N_NOTES))
    of_shafts = np.zeros((count, starts.count - 1, rec.size(rec.SHAFT_NOTES)))
    step, sees, size = controller.compiled_kernel(), int(controller.sensors), controller.state_size
    end = math.inf if until is None else float(until)

    def run(part: slice) -> None:
        with watched(controller):
            kernel.run_many(
                step, np.ascontiguousarray(numbers[part]) if numbers.shape[0] > 1 else numbers, sees,
                bool(sees & Sensor.STAGE), end, starts.machines[part], starts.masses[part],
                starts.shafts[part], starts.curves[part], notes[part], of_shafts[part],
                np.zeros(rec.N_WORK), np.zeros(N_MEASURED), np.zeros(size), np.zeros(NEW_STATE + size),
            )  # fmt: skip

    if workers == 1 or count <= FIRST_TURN:
        for part in _parts(count):
            run(part)
    else:
        parts = [slice(i, i + FIRST_TURN) for i in range(0, count, FIRST_TURN)]
        with Pool(min(workers, len(parts)), threads=True) as pool:
            for _ in pool.results(run, iter(parts)):
                pass
    return StartResults(notes.view(rec.NOTES)[:, 0], of_shafts.view(rec.SHAFT_NOTES)[..., 0])


def _parts(count: int) -> Iterator[slice]:
    """Starts in turns of about PATIENCE: the kernel hears no Ctrl-C, which is taken between two turns."""
    done, room = 0, FIRST_TURN
    while done < count:
        began = time.perf_counter()
        yield slice(done, min(done + room, count))
        done += room
        share = PATIENCE / max(time.perf_counter() - began, 1e-9)
        room = max(1, int(room * min(share, 4.0)))


def figures(results: StartResults, base: Vector | float, until: float | None = None) -> Figures:
    """The figures of many starts as name -> (values, unit, meaning).

    `base` is the mean torque M12avg_base that K_dyn refers to, in N m, one number or one a start. Starts that
    could not be finished have NaN.
    """
    codes = 4 * results["status"].astype(np.int64) + 2 * (results["braked"] == 1.0)
    reasons, which = np.unique(codes + (results["reached"] == 1.0), return_inverse=True)
    kinds = [status_of(c // 4, bool(c % 2), until is not None, bool(c & 2)) for c in reasons.tolist()]
    finished = np.array([kind.finished for kind in kinds])[which]

    def valid(values: Vector | float) -> Vector:
        return np.where(finished, values, np.nan)

    starts, worst = np.arange(finished.size), results.peaks.argmax(axis=1)
    peak = results.peaks[starts, worst]
    first = np.abs(results.shafts["first_peak"]).max(axis=1)
    # of several positions `worst_position` has left out those without a stage 2
    first = np.where(np.isnan(results["stage_2_end"]) & (results["position"] == 0.0), np.nan, first)
    k_dyn = formulas.dynamic_coefficient(np.where(finished, peak, 0.0), base)
    k_first = formulas.dynamic_coefficient(np.where(finished & ~np.isnan(first), first, 0.0), base)
    k_first = np.where(np.isnan(valid(first)), np.nan, k_first)
    values: Figures = {
        "k_dyn": (valid(k_dyn), "1", "dynamic coefficient of the whole run, [G](16)"),
        "k_dyn_first_contact": (k_first, "1", "dynamic coefficient of stage 2, [G](17), (18)"),
        "peak_torque": (valid(peak), "N*m", "largest |T| of the run"),
        "peak_time": (valid(results.shafts["peak_time"][starts, worst]), "s", "when |T| is largest"),
    }
    for name, column, unit, meaning in _COLUMNS:
        values[name] = (valid(results[column]), unit, meaning)
    for name, column, unit, meaning in _REGULATED:
        if not np.all(np.isnan(results[column])):
            values[name] = (valid(results[column]), unit, meaning)
    if not np.all(np.isnan(results["release_time"])):
        values["release_time"] = (valid(results["release_time"]), "s", "when the brake was released")
    if np.any(results["position"]):
        names = np.array(["", *UNKNOWN_POSITIONS])[results["position"].astype(np.int64)]
        values["position"] = (names, "", "position with the largest |T|, of those that are possible")
    values["status"] = (np.array([kind.name for kind in kinds])[which], "", "how the start ended")
    return values


def limited_time(values: Figures) -> Vector:
    """What a limit on the start time bounds in each start, s, as `Run.limited_time`."""
    start_time: Vector = values["start_time"][0]
    if "overshoot" not in values:  # of torque strategies
        return start_time
    settled = values["settled_time"][0] if "settled_time" in values else np.full(start_time.shape, np.nan)
    return np.where(np.isnan(values["overshoot"][0]), start_time, settled)


def has_margin(limits: Limits) -> bool:
    """Whether there is a limit of torque or time, of which each start has a margin."""
    return any(limit is not None for limit in (limits.shaft_torque, limits.start_time, limits.used_torque))


def limit_margins(values: Figures, limits: Limits) -> Figures:
    """What is left of the limits of torque and time in starts with these figures; nothing without limits."""
    if not has_margin(limits):
        return {}
    limited: dict[str, Vector] = {"start_time": limited_time(values)}
    limited |= {name: values[name][0] for name in ("peak_torque", "used_torque") if name in values}
    margin = np.where(np.isnan(limited["start_time"]), np.nan, limits.margin(limited))
    return {
        "margin": (margin, "1", "smallest remaining share of the limits of shaft torque and start time"),
        "keeps_limits": ((margin >= 0.0) * 1.0, "1", "1 where these limits are kept, else 0"),
    }
