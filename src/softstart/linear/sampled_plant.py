"""The drive at the sample instants: exact, with held demand, torque lag and computing delay.

In contact, while the driving flank presses, the drive is linear (`softstart.drive.control_systems`). A demand
made at t_k acts from t_k + computing_delay on, through the torque lag. Between those instants the motion
is a matrix exponential, so the sampled system is exact:

    x+ = Ad x + G1 d[k-n-1] + G0 d[k-n],   computing_delay = n h + f, 0 <= f < h,
    G0 = int_0^(h-f) e^(A s) B ds,         G1 = e^(A (h-f)) int_0^f e^(A s) B ds

The torque limits and a limited torque rate do not enter: they do not act on small changes. The load torque
is constant and does not enter either. All angles in rad, torques in N m, at the motor shaft.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart.arrays import Matrix
from softstart.drive import Drive
from softstart.linear.systems import System
from softstart.plant import start as kernel

TERMS = 18  # of the exponential's series: 2^-18/18! is below rounding


@dataclass(frozen=True, eq=False)
class Continuous:
    """Rates of change of the states under a motor torque: dx/dt = A x + B u; `rows` reads quantities off x.

    With a torque lag the motor torque is the last state and its demand the input.
    """

    A: Matrix
    B: Matrix
    rows: dict[str, Matrix]


def in_contact(drive: Drive) -> Continuous:
    """Motor, shaft and load while the flank presses: states phi1, then z, w1, w2 of `Drive.to_control`."""
    own = drive.to_control()
    A = np.zeros((4, 4))
    A[0, 2] = 1.0
    A[1:, 1:] = own.A
    B = np.vstack([[[0.0]], own.B[:, :1]])
    torque = np.hstack([[[0.0]], own.C[3:4]])
    return _with_lag(drive, A, B, {"phi1": _row(4, 0), "z": _row(4, 1), "w1": _row(4, 2), "w2": _row(4, 3),
                                   "T": torque})  # fmt: skip


def motor_alone(drive: Drive) -> Continuous:
    """The motor without the shaft: states phi1, w1."""
    A = np.array([[0.0, 1.0], [0.0, -float(drive.motor_viscous_friction / drive.J1)]])
    B = np.array([[0.0], [1.0 / float(drive.J1)]])
    nothing = np.zeros((1, 2))
    return _with_lag(drive, A, B, {"phi1": _row(2, 0), "w1": _row(2, 1), "w2": nothing, "T": nothing})


def _row(n: int, index: int) -> Matrix:
    return np.eye(n)[index : index + 1]


def _with_lag(drive: Drive, A: Matrix, B: Matrix, rows: dict[str, Matrix]) -> Continuous:
    lag = float(drive.torque_lag)
    n = A.shape[0]
    if lag <= 1e-12 * float(drive.elastic_period):  # the exact plant neglects such a lag, too
        return Continuous(A, B, rows)
    whole = np.block([[A, B], [np.zeros((1, n)), np.array([[-1.0 / lag]])]])
    rows = {name: np.hstack([row, [[0.0]]]) for name, row in rows.items()}
    rows["u"] = _row(n + 1, n)
    return Continuous(whole, np.vstack([np.zeros((n, 1)), [[1.0 / lag]]]), rows)


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
        kernel.M_MOTOR_ANGLE: rows["phi1"],
        kernel.M_MOTOR_SPEED: speed,
        kernel.M_MOTOR_TORQUE: rows["u"],
        kernel.M_SHAFT_TORQUE: rows["T"],
        kernel.M_LOAD_SPEED: rows["w2"],
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
