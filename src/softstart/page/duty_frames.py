"""What the page shows of a duty: a block for each step, its figures, and the trace of all steps."""

from __future__ import annotations

import math
import re
from base64 import b64encode
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError
from softstart.page.duty import KINDS
from softstart.quantities import Units
from softstart.views.drawing import strategy_colours
from softstart.views.duties import against_limits, headline, how_of, life_conclusion, life_or_reason
from softstart.views.numbers import unit

if TYPE_CHECKING:
    from softstart.page.session import DutyResult, Inputs
    from softstart.start.duty import DutyRun, StepRun

PLACE = re.compile(r"\b[Ss]tep (\d+)")  # of a step, in a sentence
POINTS, FEWEST = 1_400, 50  # buckets of all steps together, and of one
PER_BUCKET = 16  # instants of a bucket, of which it keeps the extrema of each channel
NOISE = 1e-9  # of the mean torque: rounding
USUAL = 1.0  # s, of a step that was not carried out

Frame = dict[str, Any]


def json_number(value: float) -> float | None:
    """A number that JSON can carry."""
    return float(value) if math.isfinite(value) else None


def duty_view(inputs: Inputs, result: DutyResult | None, step: int) -> Frame:
    """The strip of steps with the figures of each, and their trace; `result` is None until it is computed."""
    plan, units = inputs.plan, inputs.units
    view: Frame = {
        "kinds": dict(KINDS),
        "selected": step,
        "steps": [{"do": one.do, "repeat": one.repeat, "length": one.time or USUAL} for one in plan.steps],
        "waits": result is None,
        "trouble": "" if result is None else result.trouble,
        "strategy": inputs.selected,
        "colours": strategy_colours(list(inputs.controllers))[inputs.selected],
        "units": {"angle": units.of("rad"), "speed": units.of("rad/s"), "torque": unit(units.of("N*m"))},
        "at": units.at,
        "trace": None,
        "toml": "",
    }
    with suppress(InputError):  # `trouble` says so
        view["toml"] = plan.duty.to_toml()
    run = None if result is None else result.run
    if run is None:
        wrong = PLACE.search(view["trouble"])
        return view | {"wrong": int(wrong[1]) - 1 if wrong else None}
    rows, (life, reason) = zip(view["steps"], run.rows, strict=True), life_or_reason(run, None)
    shares = None if life is None else 100.0 * life.worst.shares
    return view | {
        "steps": [line | step_figures(run, row, units, shares) for line, row in rows],
        "notes": [headline(run, life), f"No life: {reason}" if life is None else life_conclusion(run, life)],
        "wrong": None,
        "worst": run.worst.number - 1,
        "k_dyn": json_number(run.k_dyn),
        "peak_torque": json_number(float(units.shown(run.worst.peak_torque, "N*m"))),
        "base": json_number(float(units.shown(run.base_torque, "N*m"))),
        "cycle_time": json_number(run.cycle_time),
        "cycles": run.cycles,
        "repeated": run.repeated,
        "stop": run.stop,
        "trace": trace_of(run, units),
    }


def step_figures(run: DutyRun, row: StepRun, units: Units, shares: Vector | None) -> Frame:
    """The figures of one step, as it was carried out with the largest torque; `shares` of the damage, %."""
    margins = run.margins_of(row)
    none = NOISE * run.base_torque
    largest, smallest = (
        0.0 if abs(T) < none else float(units.shown(T, "N*m"))
        for T in (row.largest.max(), row.smallest.min())
    )
    return {
        "length": row.end - row.begin,
        "how": how_of(run, row),
        "k_dyn": json_number(run.k_dyn_of(row)),
        "largest": json_number(largest),
        "smallest": json_number(smallest),
        "contacts": row.contacts,
        "impact_energy": json_number(float(row.impact_energy.sum())),
        "time": json_number(row.time),
        "start_time": json_number(row.start_time),
        "angle": json_number(float(units.shown(row.angle, "rad"))),
        "damage": None if shares is None else json_number(float(shares[row.number - 1])),
        "limits": against_limits(margins),
        "kept": all(margin.kept for margin in margins),
    }


# the trace ----------------------------------------------------------------------------------------------


def trace_of(run: DutyRun, units: Units) -> Frame:
    """The steps one after the other, each as it was carried out with the largest torque.

    `t` is in s from the begin of each step; `ends` says where in the channels each step ends. Torques and
    speeds in the units of the page and at its shaft, in single precision.
    """
    shaft = int(run.worst.peak_torques.argmax())
    machine = run.drive
    buckets = max(POINTS // len(run.rows), FEWEST)
    parts = [step_trace(run, row, buckets) for row in run.rows]
    data = np.concatenate(parts, axis=1)
    masses = len(machine.mass_names)
    data[2 : 2 + masses] = units.shown(data[2 : 2 + masses], "rad/s")
    for torques in (data[1:2], data[2 + masses :]):
        torques[:] = units.shown(torques, "N*m")
    names = ["t", "u", *(f"w[{k}]" for k in range(masses)), *(f"T[{k}]" for k in range(masses - 1))]
    allowed = units.shown(machine.permissible_torques, "N*m")
    number, peak = peak_of(run.worst, shaft)
    return {
        "channels": names,
        "data": b64encode(data.astype("<f4").tobytes()).decode("ascii"),
        "ends": np.cumsum([part.shape[1] for part in parts]).tolist(),
        "worst": shaft,
        "motor": int(machine.motor_index),
        "load": int(machine.load_index),
        "shafts": list(machine.shaft_names),
        "allowed": json_number(float(allowed[shaft])),
        "peak": (number, float(units.shown(peak, "N*m"))),
    }


def step_trace(run: DutyRun, row: StepRun, buckets: int) -> Matrix:
    """Instants from the begin of a step, s, and there u, speeds of masses and torques of shafts: a row each.

    Every bucket keeps its extrema, and every located peak is there.
    """
    end = float(np.nextafter(row.end, 0.0))
    times = np.linspace(row.begin, end, buckets * PER_BUCKET)
    sampled = _channels(run, row, times)
    boxes = sampled.reshape(len(sampled), buckets, PER_BUCKET)
    first = np.arange(0, times.size, PER_BUCKET)
    kept = np.union1d(boxes.argmin(axis=2) + first, boxes.argmax(axis=2) + first)
    times = np.unique(np.concatenate([times[kept], _landmarks(row).clip(row.begin, end)]))
    return np.concatenate([[times - row.begin], _channels(run, row, times)])


def _landmarks(row: StepRun) -> Vector:
    """Begins and ends of phases, the instants of the largest torques, and both sides of events."""
    found = [np.array([row.begin, row.end])]
    for phase in row.phases:
        sudden = phase.trajectory.events["time"] + phase.time
        around = np.array([phase.begin, np.nextafter(phase.begin, 0.0)])
        peaks = phase.trajectory.shafts["peak_time"] + phase.time
        found += [sudden, np.nextafter(sudden, 0.0), around, peaks]
    times = np.concatenate(found)
    return times[(times >= row.begin) & (times <= row.end)]


def _channels(run: DutyRun, row: StepRun, times: Vector) -> Matrix:
    states = run.at(times)
    return np.concatenate([[states["u"]], states["w"].T, states["T"].T])


def peak_of(row: StepRun, shaft: int) -> tuple[int, float]:
    """The step with the largest torque, and that torque with its sign."""
    torque = row.largest[shaft] if row.largest[shaft] >= -row.smallest[shaft] else row.smallest[shaft]
    return row.number - 1, float(torque)
