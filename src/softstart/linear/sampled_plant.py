"""The drive or chain at the sample instants: exact, with held demand, torque lag and computing delay.

In contact, while the flanks of all gaps press, the machine is linear (`softstart.drive.control_systems`). A
demand made at t_k acts from t_k + computing_delay on, through the torque lag. Between those instants the
motion is a matrix exponential, so the sampled system is exact:

    x+ = Ad x + G1 d[k-n-1] + G0 d[k-n],   computing_delay = n h + f, 0 <= f < h,
    G0 = int_0^(h-f) e^(A s) B ds,         G1 = e^(A (h-f)) int_0^f e^(A s) B ds

The torque limits and a limited torque rate do not enter: they do not act on small changes. A constant load
torque does not enter either. All angles in rad, torques in N m, at the motor shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.chain.machines import Machine
from softstart.errors import InputError
from softstart.kernel import motor as exchange
from softstart.kernel import records as at
from softstart.linear.systems import System
from softstart.start.rows import Rows, rows_of

TERMS = 18  # of the exponential's series: 2^-18/18! is below rounding


@dataclass(frozen=True, eq=False)
class Continuous:
    """Rates of change of the states under a motor torque: dx/dt = A x + B u; `rows` reads quantities off x.

    With a torque lag the motor torque is the last state and its demand the input. The first states are so
    many `angles`, then so many `speeds`.
    """

    A: Matrix
    B: Matrix
    rows: dict[str, Matrix]
    angles: int
    speeds: int


@dataclass(frozen=True)
class Sizes:
    """Sizes of torques and angles of a machine, N m and rad; its first frequency, rad/s, and period, s."""

    base: float
    windup: float
    Omega: float
    period: float

    @property
    def speed(self) -> float:
        """Of an elastic vibration with the windup as amplitude, rad/s."""
        return self.Omega * self.windup


def single(machine: Machine) -> Any:
    """The machine at one of its positions: the loop in contact is the same from anywhere."""
    positions = list(machine.positions.values())
    return positions[len(positions) // 2]


def sizes_of(machine: Machine) -> Sizes:
    """The sizes of a machine with all gaps closed."""
    rows = rows_of(single(machine))
    base, period = float(machine.mean_torque), float(rows.machine.period)
    if not period > 0.0:
        raise InputError(f"{machine.name}: all its shafts are rigid; a loop needs an elastic one.")
    c = rows.shafts.view(at.SHAFT)[0, :, 0]["c"]
    return Sizes(base, base * float((1.0 / c[c > 0.0]).sum()), 2.0 * np.pi / period, period)


def in_contact(machine: Machine, inclines: Vector | None = None) -> Continuous:
    """The machine while all flanks press: the angle of the motor, the twists of springs, speeds of bodies.

    Masses that are joined rigidly are one body; gears with losses pass power on from the motor to the load.
    `inclines` are those of the load curves of its masses at an instant: there a curve is a spring or a damper
    to the ground.
    """
    rows = rows_of(single(machine))
    return _between(machine.name, rows, range(rows.count), inclines)


def motor_side(machine: Machine, inclines: Vector | None = None) -> Continuous:
    """The masses that turn with the motor while all gaps are open; `inclines` as in `in_contact`."""
    rows = rows_of(single(machine))
    half = rows.shafts.view(at.SHAFT)[0, :, 0]["half"]
    first = last = int(rows.machine.motor)
    while first > 0 and half[first - 1] == 0.0:
        first -= 1
    while last < half.size and half[last] == 0.0:
        last += 1
    return _between(machine.name, rows, range(first, last + 1), inclines)


def motor_alone(machine: Machine) -> Continuous:
    """The motor without the shaft: states phi1, w1."""
    rows = rows_of(single(machine))
    motor = int(rows.machine.motor)
    return _between(machine.name, rows, range(motor, motor + 1), None)


def _between(name: str, given: Rows, masses: range, inclines: Vector | None) -> Continuous:
    """Neighbouring masses with all gaps closed, as if there were no others."""
    motor, load = int(given.machine.motor), int(given.machine.load)
    mass, shaft = given.masses.view(at.MASS)[0, :, 0], given.shafts.view(at.SHAFT)[0, :, 0]
    rigid = shaft["rigid"] != 0.0
    joints = range(masses.start, masses.stop - 1)
    if any(rigid[k] for k in joints if k in (motor - 1, motor)):
        raise InputError(
            f"{name}: a shaft beside the motor is rigid, and the loop is that of its spring; give it a "
            "stiffness, or make one mass of the two."
        )
    body = {masses.start: 0}  # of each mass
    for k in joints:
        body[k + 1] = body[k] + (not rigid[k])
    springs = [k for k in joints if not rigid[k]]
    angles = speeds = 1 + len(springs)
    n = angles + speeds
    J = np.zeros(speeds)
    A, B = np.zeros((n, n)), np.zeros((n, 1))
    speed = {i: angles + body[i] for i in masses}
    for i in masses:
        J[body[i]] += mass["J"][i]
    for i in masses:
        A[speed[i], speed[i]] -= mass["ground"][i] / J[body[i]]
    A[0, speed[motor]] = 1.0
    B[speed[motor], 0] = 1.0 / J[body[motor]]
    rows = {"phi1": _row(n, 0), "w1": _row(n, speed[motor]), "z": np.zeros((1, n))}
    rows["w2"] = _row(n, speed[load]) if load in masses else np.zeros((1, n))
    rows["T"] = np.zeros((1, n))
    for place, k in enumerate(springs, start=1):
        torque = np.zeros((1, n))
        torque[0, place] = shaft["c"][k]
        torque[0, speed[k]] += shaft["d"][k]
        torque[0, speed[k + 1]] -= shaft["d"][k]
        before, after = _shares(shaft["eta"][k], bool(shaft["gear"][k]), motor <= k)
        A[place, speed[k]], A[place, speed[k + 1]] = 1.0, -1.0
        A[speed[k]] -= before * torque[0] / J[body[k]]
        A[speed[k + 1]] += after * torque[0] / J[body[k + 1]]
        rows[f"theta {k}"] = _row(n, place)
        if k == given.motor_shaft:
            sign = 1.0 if motor <= k else -1.0
            rows["T"], rows["z"] = sign * torque, sign * rows[f"theta {k}"]
    rows |= {f"w {i}": _row(n, speed[i]) for i in masses}
    for curve in given.curves[0].view(at.CURVE)[:, 0]:
        i = int(curve.mass)
        if inclines is not None and i in masses:
            twisted = [rows.get(f"theta {k}", 0.0) for k in range(*sorted((motor, i)))]
            angle = rows["phi1"] - math.copysign(1.0, i - motor) * sum(twisted)
            follows = angle if curve.by_angle else rows[f"w {i}"]
            A[speed[i]] -= inclines[i] / J[body[i]] * follows[0]
    return _with_lag(float(given.machine.lag), A, B, rows, angles)


def _shares(eta: float, at_after: bool, driven: bool) -> tuple[float, float]:
    """The shares of a shaft's torque that act on the masses before and after: its gear takes the rest."""
    loss = eta if at_after == driven else 1.0 / eta  # behind the spring, or before it
    return (1.0, loss) if at_after else (loss, 1.0)


def _row(n: int, index: int) -> Matrix:
    return np.eye(n)[index : index + 1]


def _with_lag(lag: float, A: Matrix, B: Matrix, rows: dict[str, Matrix], angles: int) -> Continuous:
    n = A.shape[0]
    if lag == 0.0:
        return Continuous(A, B, rows, angles, n - angles)
    whole = np.block([[A, B], [np.zeros((1, n)), np.array([[-1.0 / lag]])]])
    rows = {name: np.hstack([row, [[0.0]]]) for name, row in rows.items()}
    rows["u"] = _row(n + 1, n)
    return Continuous(whole, np.vstack([np.zeros((n, 1)), [[1.0 / lag]]]), rows, angles, n - angles)


@dataclass(frozen=True, eq=False)
class SampledPlant:
    """The plant from demand to measured quantities, at the sample instants, just before each new demand.

    States: those of `Continuous`, then the last demands, the latest first, then the last angle if the speed
    is a difference of angles. `rows` reads w1, z, T, ... off the states.
    """

    system: System
    rows: dict[str, Matrix]
    period: float


def sampled(
    plant: Continuous, period: float, delay: float, inputs: tuple[int, ...], differencing: bool
) -> SampledPlant:
    """The plant sampled every `period` s, each demand acting `delay` s after its sample."""
    n = plant.A.shape[0]
    whole, fraction = divmod(delay, period)
    if fraction > period * (1.0 - 1e-9):  # rounding of a whole number of samples
        whole, fraction = whole + 1.0, 0.0
    late = int(whole)
    transition, _ = _held(plant, period)
    rest, direct = _held(plant, period - fraction)
    _, early = _held(plant, fraction)
    waiting = late + 1  # the demands kept: d[k-1] to d[k-1-late]
    size = n + waiting + differencing
    A, B = np.zeros((size, size)), np.zeros((size, 1))
    A[:n, :n] = transition
    A[:n, n + late : n + late + 1] += rest @ early
    if late == 0:
        B[:n] = direct
    else:
        A[:n, n + late - 1 : n + late] += direct
    for index in range(1, waiting):
        A[n + index, n + index - 1] = 1.0
    B[n] = 1.0
    rows = {name: np.hstack([row, np.zeros((1, size - n))]) for name, row in plant.rows.items()}
    if "u" not in rows:  # without a lag the torque just before a sample is the demand that acts
        rows["u"] = _row(size, n + late)
    speed = rows["w1"]
    if differencing:
        A[-1:] = rows["phi1"]
        speed = (rows["phi1"] - _row(size, size - 1)) / period
    quantities = {
        exchange.M_MOTOR_ANGLE: rows["phi1"],
        exchange.M_MOTOR_SPEED: speed,
        exchange.M_MOTOR_TORQUE: rows["u"],
        exchange.M_SHAFT_TORQUE: rows["T"],
        exchange.M_LOAD_SPEED: rows["w2"],
    }
    C = np.vstack([quantities[index] for index in inputs])
    return SampledPlant(System(A, B, C, np.zeros((C.shape[0], 1))), rows, period)


def _held(plant: Continuous, time: float) -> tuple[Matrix, Matrix]:
    """e^(A t), int_0^t e^(A s) B ds, by one exponential (C. Van Loan 1978, doi:10.1109/TAC.1978.1101743)."""
    n = plant.A.shape[0]
    block = np.zeros((n + 1, n + 1))
    block[:n, :n] = plant.A * time
    block[:n, n:] = plant.B * time
    both = exponential(block)
    return both[:n, :n], both[:n, n:]


def exponential(matrix: Matrix) -> Matrix:
    """e^matrix by its series and repeated squaring.

    `scipy.linalg.expm` gives the same, but starts threads of its BLAS for every 6 x 6 matrix, which on a busy
    machine costs a hundred times the arithmetic.

    >>> exponential(np.array([[0.0, 1.0], [0.0, 0.0]])).tolist()
    [[1.0, 1.0], [0.0, 1.0]]
    """
    norm = float(np.abs(matrix).sum(axis=0).max())
    halvings = max(0, int(np.ceil(np.log2(norm))) + 1) if norm > 0.0 else 0
    small = matrix / 2.0**halvings
    term = np.eye(matrix.shape[0])
    total = term.copy()
    for k in range(1, TERMS + 1):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
