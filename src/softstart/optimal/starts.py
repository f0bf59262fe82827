"""Open-loop starts of a machine, run exactly, with their exact sensitivities to the knots of the demand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline

from softstart.arrays import Indices, Matrix, Vector
from softstart.controller import controller_class
from softstart.drive.machine import Machine
from softstart.kernel import records as rec
from softstart.profile import TorqueProfile
from softstart.start.engine import ended, run_one
from softstart.start.kernel_input import MAX_EVENTS, KernelInput, kernel_input
from softstart.start.trajectory import StartRecorder, Trajectory

Rows = NDArray[np.float64]  # for each instant a matrix


@dataclass(frozen=True, eq=False)
class DemandRun:
    """A start under a demand, from 0 to its end."""

    profile: TorqueProfile
    trajectory: Trajectory
    weights: Matrix | float = 1.0  # torques at the knots, N m, for a unit of each unknown of the demand

    @property
    def peak(self) -> float:
        """Largest |T| of all shafts, N m, located."""
        return float(np.abs(self.trajectory.shafts["peak"]).max())

    def instants(self, step: float) -> Vector:
        """Both sides of every joint of spans and instants in between, no further apart than `step`, s."""
        start, end = self.trajectory.spans[:, [rec.S_START, rec.S_END]].T
        count = np.cumsum(np.append(0.0, np.ceil((end - start) / step).clip(1.0)))
        inside = np.interp(np.arange(count[-1]), count, np.append(start, end[-1]))
        before = end - 1e-9 * (end - start)  # a step of the torque has two sides
        return np.unique(np.concatenate([inside, before, end[-1:]]))

    def with_peaks(self, times: Vector) -> Vector:
        """Rising instants, and between them where |T| of a shaft has a maximum: exactly the largest one."""
        T = np.abs(self.trajectory.at(times)["T"])
        left, here, right = T[:-2], T[1:-1], T[2:]
        j, k = np.nonzero((here >= left) & (here >= right) & (here > 0.0))
        a, b = times[j + 1] - times[j], times[j + 2] - times[j + 1]
        rise, fall = (here - left)[j, k], (here - right)[j, k]
        curved = rise * b + fall * a
        inside = curved > 0.0
        shift = 0.5 * (rise * b * b - fall * a * a)[inside] / curved[inside]  # vertex of the parabola
        vertices = times[j + 1][inside] + shift
        return np.unique(np.concatenate([times, vertices, self.trajectory.shafts["peak_time"]]))

    def quadrature(self, until: float) -> tuple[Vector, Vector]:
        """Instants and weights, s, of an integral over the start up to `until`: Gauss in each span."""
        start, end = np.minimum(self.trajectory.spans[:, [rec.S_START, rec.S_END]].T, until)
        nodes, weights = np.polynomial.legendre.leggauss(5)
        half = 0.5 * (end - start)[:, None]
        inside = half[:, 0] > 0.0
        times = start[:, None] + half * (nodes + 1.0)
        return times[inside].ravel(), (half * weights)[inside].ravel()

    def by_demand(self, times: ArrayLike, marks: ArrayLike) -> tuple[Rows, Rows]:
        """How the start answers to the unknowns x of the demand: dT_k(times[j])/dx_q as [j, k, q], and

        the derivatives of twists, speeds and realised torque at `marks` as [j, part, q]; both rise.
        """
        by = self.weights
        torques, states = self.trajectory.sensitivities(self.profile.time, times, marks)
        return (torques * by, states * by) if isinstance(by, float) else (torques @ by, states @ by)

    @cached_property
    def contacts(self) -> tuple[Vector, Indices, Vector]:
        """When gaps close, s, of which shafts, and how fast, rad/s; without soft ones, which move too far."""
        trajectory = self.trajectory
        events = trajectory.events[trajectory.events["kind"] == rec.CLOSED]
        events = events[(events["time"] > 0.0) & (events["time"] < trajectory.spans[-1, rec.S_END])]
        shafts = events["place"].astype(int)
        when = trajectory.at(events["time"])["w"]
        v = when[np.arange(shafts.size), shafts] - when[np.arange(shafts.size), shafts + 1]
        hard = np.abs(v) > 1e-4 * float(np.abs(when).max(initial=0.0))
        begin, kept = np.unique(np.ascontiguousarray(events["time"][hard]), return_index=True)
        return begin, shafts[hard][kept], v[hard][kept]

    def along_contacts(self, times: Vector, states: Rows) -> tuple[Matrix, Matrix]:
        """How instants move that keep their place between the contacts, and dT_k/dt there.

        A contact of shaft k at t_c, theta_k(t_c) on its flank, moves by dt_c/dx = -(dtheta_k/dx)/theta_k', by
        the derivatives of the states at `contacts`; in between the shift is interpolated, and it is none at
        both ends. Shapes (j, q) per unknown and (j, k).
        """
        begin, shafts, v = self.contacts
        moved = np.zeros((times.size, states.shape[2]))
        if begin.size and times.size:
            shift = -states[np.arange(shafts.size), shafts] / v[:, None]
            none, end = np.zeros((1, moved.shape[1])), self.trajectory.spans[-1, rec.S_END]
            knots = np.concatenate([[0.0], begin, [end]])
            moved = make_interp_spline(knots, np.concatenate([none, shift, none]), k=1)(times)
        inside = self.trajectory.index(times)
        step = 1e-6 * float(self.profile.time[-1])
        after, before = (self.trajectory.at(times + sign * step, inside)["T"] for sign in (1.0, -1.0))
        return moved, (after - before) / (2.0 * step)


class DemandSimulator:
    """Runs demands on one machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.rows, masses, shafts = parts(machine)
        self._room = 1024
        record = self.rows.machine
        self.period, self.target = float(record.period), float(record.target)
        self.motor, self.load, self.joints = int(record.motor), int(record.load), shafts.size
        self.J, self.c, self.d = masses["J"], shafts["c"], shafts["d"]
        self.half_gap = shafts["half_gap"]
        fastest = math.sqrt(float((self.c * (1.0 / self.J[:-1] + 1.0 / self.J[1:])).max()))
        self.fastest = 2.0 * math.pi / fastest
        self._loads = float((masses["Mc"] + masses["active"]).sum())

    def _run(self, profile: TorqueProfile, until: float, room: int) -> tuple[StartRecorder, int]:
        made: Any = controller_class("profile")(profile=profile)  # type: ignore[call-arg]
        recorder = StartRecorder(self.rows, int(made.sensors), room)
        return recorder, run_one(made, self.machine, recorder, until)

    def play(self, profile: TorqueProfile, until: float, weights: Matrix | float = 1.0) -> DemandRun:
        """The start from 0 to `until` in s; SimulationError if it cannot be finished."""
        recorder, reason = self._run(profile, until, self._room)
        ended(recorder.state, reason, until, MAX_EVENTS, self.machine.name)
        self._room = max(self._room, recorder.spans.shape[0])
        return DemandRun(profile, recorder.finished(), weights)

    def figures(self, profile: TorqueProfile, until: float) -> tuple[float, float, float]:
        """Largest |T| of all shafts until then, N m; start time, s (inf if none); load speed then, rad/s."""
        state = self._run(profile, until, 0)[0].state
        time = float(state.start_time)
        peak, speed = float(np.abs(state.peak).max()), float(state.final_speed)
        return peak, math.inf if math.isnan(time) else time, speed

    def first_contact(self, profile: TorqueProfile, until: float) -> float:
        """When a gap first closes, s; infinite if none does until then."""
        time = float(self._run(profile, until, 0)[0].state.first_contact)
        return math.inf if math.isnan(time) else time

    def mean_torque(self, time: float) -> float:
        """The torque that brings all masses as one to the target speed in this time, N m."""
        return float(self.J[np.isfinite(self.J)].sum()) * self.target / time + self._loads

    def twisting(self, closed: Vector, states: Matrix) -> Matrix:
        """What the torques of closed shafts get from changes of twists and speeds, rows as in a state."""
        by_twist = self.c[:, None] * states[: self.joints]
        by_speed = -self.d[:, None] * np.diff(states[self.joints : -1], axis=0)
        found: Matrix = closed[:, None] * (by_twist + by_speed)
        return found


def parts(machine: Machine) -> tuple[KernelInput, Any, Any]:
    """A machine as rows of the kernel, and its masses and shafts by names."""
    rows = kernel_input(machine)
    return rows, rows.masses[0].view(rec.MASS)[:, 0], rows.shafts[0].view(rec.SHAFT)[:, 0]


def steady_shaft_torques(rows: KernelInput) -> Vector:
    """The torques of the shafts of a machine while all masses turn at its target speed, N m.

    >>> from softstart import Drive
    >>> steady_shaft_torques(kernel_input(Drive.load("crane-4amtkf"))).tolist()
    [7.16]
    """
    masses, motor = rows.masses[0].view(rec.MASS)[:, 0], int(rows.machine.motor)
    steady: Vector = masses["Mc"] + masses["active"] + masses["mean"]
    loads = steady + masses["friction"] + masses["ground"] * float(rows.machine.target)
    behind = np.cumsum(loads[::-1])[::-1][1:]
    return np.where(np.arange(behind.size) < motor, -np.cumsum(loads)[:-1], behind)


def wanted(torques: Vector, base: float, motor: int) -> Vector:
    """What a steady start ends with: where a shaft carries nothing its flanks press by a little.

    At no torque at all the gap would be open, and how it got so is no longer seen.
    """
    touch = 5e-4 * base
    driving = np.where(np.arange(torques.size) >= motor, touch, -touch)
    return np.where(np.abs(torques) < touch, driving, torques)
