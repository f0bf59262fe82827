"""Traces thinned for a screen: no located peak, event or extremum is lost on the way."""

from __future__ import annotations

import math
from base64 import b64encode
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.plant import layout as at
from softstart.start.run import Run

Vector = NDArray[np.float64]

CHANNELS = ("T", "u", "w1", "w2", "theta")
BUCKETS = 320  # about one for three pixels of the widest plot; each keeps the extrema of each channel
PER_PERIOD = 16  # points an elastic period before thinning: its crests are then within 2 % at worst
COARSEST, FINEST = 500, 8000
JUMPS = 120  # up to so many spans, both sides of each joint are kept: steps of the torque stay upright


@dataclass(frozen=True, eq=False)
class Traces:
    """Instants in s and the channels there: torques in N m, speeds in rad/s, twist in rad."""

    t: Vector
    T: Vector
    u: Vector
    w1: Vector
    w2: Vector
    theta: Vector

    def packed(self, *names: str) -> str:
        """Rows of the named channels as single-precision numbers, one after the other, in base 64."""
        rows = np.stack([getattr(self, name) for name in names]).astype("<f4")
        return b64encode(rows.tobytes()).decode("ascii")


def traces_of(run: Run, buckets: int = BUCKETS) -> Traces:
    """The traces of a run with a few points a bucket, and every instant of `landmarks`.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> traces = traces_of(run)
    >>> run.peak_time in traces.t, round(float(abs(traces.T).max()), 6) == round(run.peak_torque, 6)
    (True, True)
    """
    fixed = landmarks(run)
    periods = run.end_time / float(run.drive.elastic_period)
    count = int(min(max(COARSEST, PER_PERIOD * periods), FINEST))
    times = np.union1d(np.linspace(0.0, run.end_time, count), fixed)
    states = run.at(times)
    if times.size > 2 * COARSEST:
        keep = thinned(np.stack([states[name] for name in CHANNELS]), buckets)
        keep[np.searchsorted(times, fixed)] = True
        times = times[keep]
        states = {name: values[keep] for name, values in states.items()}
    return Traces(times, *(states[name] for name in CHANNELS))


def landmarks(run: Run) -> Vector:
    """Instants that are never thinned away: events and the instants just before, peaks of all stages, the
    peak of the run, the start time, the ends; and the joints of the motor torque while they are few.
    """
    events = run.event_rows[:, at.E_TIME]
    joints = run.segments[:, at.S_START]
    if joints.size > JUMPS:
        joints = joints[:0]
    sudden = np.concatenate([events, joints])
    others = [run.peak_time, run.start_time, 0.0, run.end_time]
    peaks = run.stage_rows[:, at.G_PEAK_TIME]
    found = np.concatenate([sudden, np.nextafter(sudden, 0.0), peaks, others])
    return np.unique(found[~np.isnan(found)].clip(0.0, run.end_time))


def thinned(rows: Vector, buckets: int) -> NDArray[np.bool_]:
    """Which columns to keep so that each bucket keeps the least and the largest value of each row.

    >>> thinned(np.array([[0.0, 1.0, 9.0, 1.0, 0.0, -3.0, 0.0, 1.0]]), 2).tolist()
    [True, False, True, False, False, True, False, True]
    """
    size = rows.shape[1]
    width = max(1, math.ceil(size / buckets))
    whole = size // width * width
    keep = np.zeros(size, dtype=np.bool_)
    keep[[0, -1]] = True
    starts = np.arange(0, whole, width)
    boxes = rows[:, :whole].reshape(rows.shape[0], -1, width)
    for found in (boxes.argmin(axis=2), boxes.argmax(axis=2)):
        keep[(found + starts).ravel()] = True
    if whole < size:
        rest = rows[:, whole:]
        keep[whole + rest.argmin(axis=1)] = True
        keep[whole + rest.argmax(axis=1)] = True
    return keep
