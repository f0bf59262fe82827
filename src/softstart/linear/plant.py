"""The drive or chain in contact, as a linear system at the sample instants: exact, with lag and dead time.

While the flanks of all gaps press, the machine is linear. A demand made at t_k acts from t_k + delay on,
through the torque lag. Between those instants the motion is a matrix exponential, so the sampled system is
exact:

    x+ = e^(A h) x + e^(A (h-f)) G(f) d[k-n-1] + G(h-f) d[k-n],   delay = n h + f, 0 <= f < h,
    G(t) = int_0^t e^(A s) B ds

Torque limits, a limited torque rate and a constant load torque do not act on small changes. All angles in
rad, torques in N m, at the motor shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.kernel import motor as exchange
from softstart.kernel import records as rec
from softstart.linear.systems import System
from softstart.start.kernel_input import KernelInput, kernel_input


@dataclass(frozen=True, eq=False)
class Plant:
    """dx/dt = A x + B u; `rows` reads phi1, w1, phi2, w2, the torque T beside the motor, and u behind a lag.

    States: the angle of the motor, the twists of the springs, the speeds of the bodies (finite `inertias`),
    and with a torque lag the motor torque, whose demand is then the input. `masses` reads `angle`, `w` of
    each mass and `theta` of each shaft off x.
    """

    A: Matrix
    B: Matrix
    rows: dict[str, Matrix]
    masses: dict[str, Matrix]
    inertias: Vector


class PlantScales(NamedTuple):
    """Sizes of torques, N m, and twists, rad; frequency, rad/s, and period, s, of the first vibration.

    `speed`, rad/s, is that of a vibration with the windup as amplitude.
    """

    base: float
    windup: float
    Omega: float
    period: float
    speed: float


def at_one_position(machine: Machine) -> Machine:
    """The machine at one of its positions: the loop in contact is the same from anywhere."""
    positions = list(machine.positions.values())
    return positions[len(positions) // 2]


def plant_scales(machine: Machine) -> PlantScales:
    """The sizes of a machine with all gaps closed."""
    kernel = kernel_input(at_one_position(machine))
    base, period = float(machine.mean_torque), float(kernel.machine.period)
    if not period > 0.0:
        raise InputError(f"{machine.name}: all its shafts are rigid; a loop needs an elastic one.")
    c = kernel.shafts.view(rec.SHAFT)[0, :, 0]["c"]
    windup, Omega = base * float((1.0 / c[c > 0.0]).sum()), 2.0 * math.pi / period
    return PlantScales(base, windup, Omega, period, Omega * windup)


def _motor_side(kernel: KernelInput) -> slice:
    """The masses that turn with the motor while all gaps are open."""
    half = kernel.shafts.view(rec.SHAFT)[0, :, 0]["half_gap"]
    motor, open_ = int(kernel.machine.motor), np.flatnonzero(half)
    first = max((int(k) + 1 for k in open_ if k < motor), default=0)
    return slice(first, min((int(k) + 1 for k in open_ if k >= motor), default=kernel.count))


def contact_plant(
    machine: Machine, inclines: Vector | None = None, *, share: float = 1.0, gaps_open: bool = False
) -> Plant:
    """The machine while all flanks press, or the motor with what turns with it while all gaps are open.

    Masses that are joined rigidly are one body; gears with losses pass power on from the motor to the load.
    `inclines` are those of the load curves of its masses at an instant: there a curve is a spring or a damper
    to the ground. `share` multiplies stiffness and damping of the shafts, as the describing function does.
    """
    kernel = kernel_input(at_one_position(machine))
    kept = _motor_side(kernel) if gaps_open else slice(0, kernel.count)
    motor, load = int(kernel.machine.motor) - kept.start, int(kernel.machine.load) - kept.start
    mass = kernel.masses.view(rec.MASS)[0, kept, 0]
    shaft = kernel.shafts.view(rec.SHAFT)[0, kept.start : kept.stop - 1, 0]
    rigid = shaft["rigid"] != 0.0
    if rigid[max(motor - 1, 0) : motor + 1].any():
        raise InputError(
            f"{machine.name}: a shaft beside the motor is rigid, and the loop is that of its spring; give it "
            "a stiffness, or make one mass of the two."
        )
    body = np.concatenate([[0], np.cumsum(~rigid)]).astype(int)  # of each mass
    inertia = np.bincount(body, mass["J"]).astype(np.float64)
    first = 1 + int((~rigid).sum())  # of the speeds
    unit = np.eye(first + inertia.size)
    w = unit[first + body]  # rows that read the speeds of the masses off the states
    twist = np.zeros((rigid.size, unit.shape[0]))
    twist[~rigid] = unit[1:first]
    angle = np.vstack([np.zeros((1, unit.shape[0])), -np.cumsum(twist, axis=0)])
    angle += unit[0] - angle[motor]
    c, d = (np.where(rigid, 0.0, share * shaft[key])[:, None] for key in ("c", "d"))
    T = c * twist + d * (w[:-1] - w[1:])
    # the gear of a shaft takes its share behind the spring, or before it
    driven = motor <= np.arange(rigid.size)
    behind = shaft["gear"][:, None] != 0.0
    passed_on = np.where(behind[:, 0] == driven, shaft["eta"], 1.0 / shaft["eta"])[:, None]
    torque = -mass["ground"][:, None] * w  # on each mass
    torque[:-1] -= np.where(behind, 1.0, passed_on) * T
    torque[1:] += np.where(behind, passed_on, 1.0) * T
    for curve in kernel.curves[0].view(rec.CURVE)[:, 0]:
        i = int(curve.mass) - kept.start
        if inclines is not None and 0 <= i < body.size:
            torque[i] -= inclines[int(curve.mass)] * (angle[i] if curve.by_angle else w[i])
    A, B = np.zeros_like(unit), np.zeros((unit.shape[0], 1))
    A[0], A[1:first] = w[motor], (w[:-1] - w[1:])[~rigid]
    np.add.at(A, first + body, torque)
    A[first:] /= inertia[:, None]
    B[first + body[motor]] = 1.0 / inertia[body[motor]]
    beside, none = kernel.motor_shaft - kept.start, np.zeros(unit.shape[0])
    phi2, w2 = (angle[load], w[load]) if 0 <= load < body.size else (none, none)
    rows = {
        "phi1": unit[0], "w1": w[motor], "phi2": phi2, "w2": w2,
        "T": (1.0 if driven[beside] else -1.0) * T[beside] if 0 <= beside < rigid.size else none,
    }  # fmt: skip
    lag = float(kernel.machine.lag)
    if lag > 0.0:
        n = unit.shape[0]
        A = np.block([[A, B], [np.zeros((1, n)), np.full((1, 1), -1.0 / lag)]])
        B = np.vstack([np.zeros((n, 1)), [[1.0 / lag]]])
        rows = {name: np.append(row, 0.0) for name, row in rows.items()} | {"u": np.eye(n + 1)[n]}
    return Plant(A, B, rows, {"angle": angle, "w": w, "theta": twist}, inertia)


class SampledPlant(NamedTuple):
    """From a demand to the measured quantities just before each new one, and the row that reads the torque T.

    States: those of `Plant`, then the last demands, the latest first, then the last angle if the speed is a
    difference of angles.
    """

    system: System
    torque: Vector


def sampled(
    plant: Plant, period: float, delay: float, inputs: tuple[int, ...], differencing: bool
) -> SampledPlant:
    """The plant sampled every `period` s, each demand acting `delay` s after its sample.

    `inputs` are indices of what is measured.
    """
    whole, fraction = divmod(delay, period)
    if fraction > period * (1.0 - 1e-9):  # rounding of a whole number of samples
        whole, fraction = whole + 1.0, 0.0
    n, late = plant.A.shape[0], int(whole)
    (early, early_held), (rest, rest_held) = _held(plant, fraction), _held(plant, period - fraction)
    waiting = late + 1  # the demands kept: d[k-1] to d[k-1-late]
    size = n + waiting + differencing
    A, B = np.zeros((size, size)), np.zeros((size, 1))
    A[:n, :n] = rest @ early
    A[:n, n + late] = rest @ early_held
    if late == 0:
        B[:n, 0] = rest_held
    else:
        A[:n, n + late - 1] += rest_held
    A[n + 1 : n + waiting, n : n + late] = np.eye(late)
    B[n] = 1.0
    rows = {name: np.append(row, np.zeros(size - n)) for name, row in plant.rows.items()}
    unit = np.eye(size)
    speed = rows["w1"]
    if differencing:
        A[-1] = rows["phi1"]
        speed = (rows["phi1"] - unit[-1]) / period
    quantities = {
        exchange.M_MOTOR_ANGLE: rows["phi1"],
        exchange.M_MOTOR_SPEED: speed,
        # without a lag the torque just before a sample is the demand that acts
        exchange.M_MOTOR_TORQUE: rows.get("u", unit[n + late]),
        exchange.M_SHAFT_TORQUE: rows["T"],
        exchange.M_LOAD_SPEED: rows["w2"],
    }
    C = np.array([quantities[index] for index in inputs])
    return SampledPlant(System(A, B, C, np.zeros((len(inputs), 1))), rows["T"])


def _held(plant: Plant, time: float) -> tuple[Matrix, Vector]:
    """e^(A t), int_0^t e^(A s) B ds, by one exponential (C. Van Loan 1978, doi:10.1109/TAC.1978.1101743)."""
    from scipy import linalg

    n = plant.A.shape[0]
    both = linalg.expm(time * np.vstack([np.hstack([plant.A, plant.B]), np.zeros((1, n + 1))]))
    return both[:n, :n], both[:n, n]
