"""A machine as the numbers that the kernel works on: the one place where both kinds are written."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller.base import Regulation
from softstart.drive import Drive, Machine
from softstart.drive.machine_table import DriveColumns, each_of
from softstart.errors import InputError
from softstart.kernel import records as rec
from softstart.kernel.guard import guard_limits, guard_samples
from softstart.kernel.motor import encoder_count

if TYPE_CHECKING:
    from softstart.chain.arrays import ChainArrays
    from softstart.chain.model import Chain
    from softstart.chain.periodic_torque import PeriodicTorque

LAWS: Final = {"no-pull": rec.NO_PULL, "dead-zone": rec.DEAD_ZONE, "modelica": rec.MODELICA}
LONGEST: Final = 100_000  # elastic periods of one start
MAX_EVENTS: Final = 1_000_000  # events and control instants of one start
# a load has settled under a torque strategy where it is below its target speed by this share at most, over so
# many elastic periods after the start time
SETTLED_BAND: Final = 0.001
SETTLING_PERIODS: Final = 5.0
# a start under a speed controller is given up after so many times its commanded time, and this share of the
# time limit of other starts more
PATIENT: Final = 3.0
SLOW_SHARE: Final = 0.1
ROUNDED_UP: Final = 1.0 + 1e-6  # a torque that bounds an acceleration
SAME_SPEED: Final = 1e-6  # speeds of masses joined rigidly, typed with the digits of a data sheet


@dataclass(frozen=True, eq=False)
class KernelInput:
    """What the kernel is given of each of n starts, one record a row, as `kernel.records` lays them out."""

    machines: Matrix  # (n, .): motor, encoder, limits of the start
    masses: NDArray[np.float64]  # (n, N, .)
    shafts: NDArray[np.float64]  # (n, N - 1, .)
    curves: NDArray[np.float64]  # (n, ., .): load curves
    tones: Matrix  # harmonics of exciting torques, the same for all starts

    @cached_property
    def machine(self) -> rec.MachineRecord:
        """The first row of `machines`, by names."""
        return self.machines[0].view(rec.MACHINE)[0]

    @cached_property
    def first(self) -> tuple[Vector, Matrix, Matrix, Matrix, Matrix]:
        """The first start, as `kernel.start.begin` takes it."""
        return self.machines[0], self.masses[0], self.shafts[0], self.curves[0], self.tones

    @property
    def count(self) -> int:
        """How many masses there are."""
        return int(self.masses.shape[1])

    @property
    def motor_shaft(self) -> int:
        """The index of the shaft beside the motor, on the way to the load."""
        motor, load = int(self.machine.motor), int(self.machine.load)
        return motor if load > motor or motor == 0 else motor - 1

    def take(self, which: NDArray[np.int64] | slice) -> KernelInput:
        """Some of the starts."""
        machines, masses, shafts = self.machines[which], self.masses[which], self.shafts[which]
        return KernelInput(machines, masses, shafts, self.curves[which], self.tones)

    def with_limits(
        self, time_limit: Vector | float | None = None, max_events: int | None = None
    ) -> KernelInput:
        """The same with another time limit or cap on events."""
        machines = self.machines.copy()
        columns = machines.view(rec.MACHINE)[:, 0]
        if time_limit is not None:
            columns["time_limit"] = np.minimum(time_limit, columns["longest"])
        if max_events is not None:
            columns["event_cap"] = max_events
        return replace(self, machines=machines)

    def given_up(self, torque: Vector, time: Vector) -> KernelInput:
        """The same, each given up with a larger |T| in N m, or if it cannot be at its speed by a time in s.

        It cannot if T up to that torque accelerates the load too little, dw2/dt <= (T - M)/J2; where more
        than that acts on the load, it is given up at that time. A start that is not given up is the same to
        the bit.
        """
        machines, at = self.machines.copy(), int(self.machine.load)
        columns = machines.view(rec.MACHINE)[:, 0]
        columns["give_up_torque"], columns["give_up_time"] = torque, time
        load, shafts = self.masses.view(rec.MASS)[:, at, 0], self.shafts.view(rec.SHAFT)[..., 0]
        beside = min(at, 1) + min(self.count - 1 - at, 1)
        rise = (ROUNDED_UP * beside * torque - load["Mc"] - load["active"]) / load["J"]
        more = np.any((shafts["rigid"] != 0.0) | (shafts["eta"] != 1.0), axis=1)
        known = ~more & (self.curves.shape[1] + self.tones.shape[0] == 0)
        columns["fastest_rise"] = np.where(known, np.maximum(rise, 0.0), np.inf)
        return replace(self, machines=machines)

    def regulated(self, regulations: Sequence[Regulation], given: bool) -> KernelInput:
        """The same under controllers that hold the speed, one for each start or as many in a row.

        `given`: the time limit was asked for, and stays.
        """
        machines = self.machines.copy()
        columns = machines.view(rec.MACHINE)[:, 0]
        each = np.array(regulations, dtype=np.float64)
        band, end, dwell = np.repeat(each, len(machines) // len(each), axis=0).T
        columns["regulated"] = 1.0
        columns["band_low"], columns["band_high"] = (
            (1.0 + sign * band) * columns["target"] for sign in (-1, 1)
        )
        columns["command_end"], columns["dwell"] = columns["begins_at"] + end, dwell
        if not given:  # a loop that has not settled by then keeps oscillating, or the load runs away
            latest = columns["begins_at"] + PATIENT * (end + dwell) + SLOW_SHARE * columns["time_limit"]
            columns["time_limit"] = np.minimum(latest, columns["longest"])
        return replace(self, machines=machines)

    def guarded(self, period: float) -> KernelInput:
        """The same under a controller that is sampled with this period, s; under one that is not for 0.

        Batches are not guarded: no simulated machine has a fault of its own, and looking takes up to 5 % of
        their time.
        """
        machines = self.machines.copy()
        guard_samples(machines.view(rec.MACHINE)[:, 0]["guard"], period)
        return replace(self, machines=machines)

    def watched(self) -> KernelInput:
        """The same, with notes of when a load under a torque strategy has settled."""
        machines = self.machines.copy()
        columns = machines.view(rec.MACHINE)[:, 0]
        torque = columns["regulated"] == 0.0
        columns["band_low"][torque] = (1.0 - SETTLED_BAND) * columns["target"][torque]
        columns["band_high"][torque] = math.inf
        columns["dwell"][torque] = SETTLING_PERIODS * columns["period"][torque]
        return replace(self, machines=machines)


def concatenate(inputs: Sequence[KernelInput]) -> KernelInput:
    """Starts in one call; InputError for machines that do not match."""
    if len(inputs) == 1:
        return inputs[0]
    motors = {(one.count, one.machine.motor, one.machine.load) for one in inputs}
    if len(motors) > 1:
        raise InputError(
            "chains: starts in one call have the same number of masses, and motors and loads on the same "
            "ones; sort the chains by that."
        )
    most = max(one.curves.shape[1] for one in inputs)
    curves = [np.pad(one.curves, ((0, 0), (0, most - one.curves.shape[1]), (0, 0))) for one in inputs]
    for one, padded in zip(inputs, curves, strict=True):
        padded[:, one.curves.shape[1] :, 0] = -1.0  # of no mass
    machines, masses, shafts = (
        np.concatenate([getattr(one, name) for one in inputs]) for name in ("machines", "masses", "shafts")
    )
    return KernelInput(machines, masses, shafts, np.concatenate(curves), inputs[0].tones)


def kernel_input(
    machine: Machine,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
    excitation: Mapping[str | int, PeriodicTorque] | None = None,
) -> KernelInput:
    """A machine as a row of the kernel; columns of drives as many.

    Without `time_limit` a start that never reaches its target speed is given up after a hundred times
    the duration of a stiff machine's start plus a hundred elastic periods, counted from a brake's release. No
    start lasts more than `LONGEST` elastic periods: its figures are integrals over each of them.
    """
    if isinstance(machine, Drive):
        made, stiff = _of_drive(machine)
    else:
        made, stiff = _of_chain(cast("Chain", machine), excitation or {})
    named = made.machines.view(rec.MACHINE)[:, 0]
    named["event_cap"] = max_events
    named["set_speed"] = named["target"]
    named["band_low"] = math.nan  # not watched
    named["longest"] = np.where(named["period"] > 0.0, LONGEST * named["period"], math.inf)
    longest = named["longest"]
    if time_limit is not None:
        named["time_limit"] = np.minimum(time_limit, longest)
        return made
    limit = 100.0 * (stiff + named["period"])
    limit = limit + np.where(named["release_at"] < math.inf, named["release_at"], 0.0)
    # a tenth of it is more than any start takes: then it is not too long, but does not reach its target
    ample = (limit > longest) & (0.1 * limit < longest)
    limit = np.where(ample, 0.999 * longest, np.minimum(limit, longest))
    named["time_limit"] = np.where(np.isfinite(stiff), limit, math.inf)
    return made


def zeros(shape: tuple[int, ...], masses: int, curves: int = 0) -> KernelInput:
    """Rows of zeros for so many starts."""
    count = math.prod(shape)
    return KernelInput(
        np.zeros((count, rec.N_MACHINE)),
        np.zeros((count, masses, rec.size(rec.MASS))),
        np.zeros((count, masses - 1, rec.size(rec.SHAFT))),
        np.zeros((count, curves, rec.size(rec.CURVE))),
        np.zeros((0, rec.size(rec.TONE))),
    )


def _motor(named: Any, motor: Any, column: Any = np.float64) -> None:
    """What a drive and the motor of a chain have under the same names."""
    for name, values in (
        ("rate", motor.torque_rate),
        ("u_min", motor.minimum_torque),
        ("u_max", motor.maximum_torque),
        ("encoder", encoder_count(motor.encoder_lines)),
        ("encoder_phase", motor.encoder_phase),
        ("torque_noise", motor.torque_noise),
        ("noise_seed", motor.noise_seed),
        ("dead_time", motor.computing_delay),
    ):
        named[name] = column(values)
    # a lag below 1e-12 of the elastic period changes no digit, but its rate would overflow
    lag = column(motor.torque_lag)
    named["lag"] = np.where(lag > 1e-12 * named["period"], lag, 0.0)


def _of_drive(drive: Drive) -> tuple[KernelInput, Vector]:
    """The rows of a drive or of columns of drives, and how long stiff ones take."""
    shape: tuple[int, ...] = ()
    column: Any = np.float64
    if isinstance(drive, DriveColumns):
        shape, column = drive.shape, partial(each_of, drive)
    made = zeros(shape, 2)
    named = made.machines.view(rec.MACHINE)[:, 0]
    masses, shaft = made.masses.view(rec.MASS)[..., 0], made.shafts.view(rec.SHAFT)[:, 0, 0]
    J1, J2 = column(drive.motor_inertia), column(drive.load_inertia)
    c, Mc, Ms = column(drive.stiffness), column(drive.Mc), column(drive.starting_torque)
    friction, b1, b2 = map(column, drive.frictions)
    w1, w2 = column(drive.initial_motor_speed), column(drive.initial_load_speed)
    target = column(drive.target_speed)
    named["period"] = column(drive.elastic_period)
    _motor(named, drive, column)
    named["target"], named["release_at"] = target, column(drive.release_time)
    named["opening_delay"] = delay = column(drive.opening_delay)
    named["begins_at"] = np.where(named["release_at"] == delay, delay, 0.0)  # not by torque proving
    named["load"] = 1.0
    for i, (J, ground, w0) in enumerate(((J1, b1, w1), (J2, b2, w2))):
        masses["J"][:, i], masses["ground"][:, i], masses["w0"][:, i] = J, ground, w0
    masses["friction"][:, 0] = friction
    masses["Mc"][:, 1], masses["active"][:, 1] = column(drive.reactive_torque), column(drive.active_torque)
    shaft["c"], shaft["d"], shaft["half_gap"] = c, column(drive.damping), 0.5 * column(drive.gap)
    shaft["law"], shaft["eta"] = LAWS[drive.contact_law], 1.0
    shaft["theta0"] = column(drive.theta0)
    hold = np.abs(column(drive.reactive_torque)) + np.abs(column(drive.active_torque)) + friction
    thrown = np.sqrt(c / J1) * np.abs(shaft["theta0"])
    speed = np.maximum(np.maximum(target, np.maximum(np.abs(w1), np.abs(w2))), thrown)
    guard_limits(named["guard"], named, J1, J1 + J2, hold + (b1 + b2) * target, 1.0 / c, speed)
    net = np.maximum(Ms - Mc - (friction + (b1 + b2) * target), 1e-3 * (Ms - Mc))
    return made, np.atleast_1d((J1 + J2) * (target + np.abs(w2) + np.abs(w1)) / net)


def _of_chain(chain: Chain, excitation: Mapping[str | int, PeriodicTorque]) -> tuple[KernelInput, Vector]:
    """The row of a chain, and how long a stiff one takes: infinite where that is not known."""
    arrays = chain.at_motor_shaft()
    _refuse(chain, arrays)
    count = arrays.J.size
    if count > rec.MOST_MASSES:
        raise InputError(
            f"mass: {count} masses; a start takes {rec.MOST_MASSES} at most, so join some first."
        )
    curved = [(i, mass) for i, mass in enumerate(chain.masses) if mass.curve is not None]
    made = zeros((), count, len(curved))
    named = made.machines.view(rec.MACHINE)[:, 0]
    masses, shafts = made.masses.view(rec.MASS)[0, :, 0], made.shafts.view(rec.SHAFT)[0, :, 0]
    masses["J"], masses["ground"], masses["w0"] = arrays.J, arrays.d_ground, arrays.w0
    masses["Mc"], masses["active"] = arrays.friction, arrays.active
    for curve, (i, mass) in zip(made.curves[0].view(rec.CURVE)[:, 0], curved, strict=True):
        ratio = float(arrays.speed_ratio[i])
        at_points, torques, by_angle = mass.curve  # type: ignore[misc]
        curve["mass"], curve["points"], curve["by_angle"] = i, len(at_points), by_angle
        curve["at"][: len(at_points)] = np.array(at_points) / ratio
        curve["torque"][: len(at_points)] = np.array(torques) * ratio
    welded = arrays.rigid & (arrays.gap == 0.0)  # joined rigidly, without a gap
    for k in range(count - 1):
        if welded[k]:  # one body has one speed, not two that differ by rounding
            masses["w0"][k + 1] = masses["w0"][k]
    shafts["c"] = np.where(arrays.rigid, 0.0, arrays.c)
    shafts["d"], shafts["half_gap"], shafts["rigid"] = arrays.d, 0.5 * arrays.gap, arrays.rigid
    shafts["restitution"] = np.nan_to_num(arrays.restitution)
    shafts["law"], shafts["theta0"] = [LAWS[law] for law in arrays.law], arrays.theta0
    shafts["eta"], shafts["gear"] = arrays.efficiency, arrays.gear - np.arange(count - 1)
    named["motor"], named["load"] = arrays.motor, arrays.load
    named["period"] = chain.elastic_period
    named["rate"] = math.inf
    named["target"] = math.inf if chain.target_speed is None else chain.target_speed
    tones = []
    for place, torque in excitation.items():
        i = chain.index(place)
        brought = float(arrays.speed_ratio[i])
        masses["mean"][i] += brought * torque.mean
        for omega, cosine, sine in zip(torque.frequencies, torque.cosine, torque.sine, strict=True):
            tones.append((i, omega, brought * cosine, brought * sine))
    if tones:
        made = KernelInput(
            made.machines, made.masses, made.shafts, made.curves, np.array(tones, dtype=np.float64)
        )
    motor = chain.motor
    if motor is None:
        return made, np.array([math.inf])
    _motor(named, motor)
    named["release_at"] = named["begins_at"] = chain.release_time
    named["initial_torque"] = motor.initial_torque
    heavier = 1.0 / arrays.efficiency_from_motor
    _guard_chain(made, arrays, heavier)
    left = motor.starting_torque - float((arrays.Mc * heavier).sum())
    speeds = float(named["target"][0]) + float(np.abs(arrays.w0).sum())
    inertia = float((arrays.moving_J * heavier).sum())
    if left > 0.0:
        return made, np.array([inertia * speeds / left])
    return made, np.array([inertia * _driven_by_curves(made, left, heavier, speeds)])


def _guard_chain(made: KernelInput, arrays: ChainArrays, heavier: Vector) -> None:
    """The guard of a sampled controller: all that may hold the chain, as if it did so at once."""
    named = made.machines.view(rec.MACHINE)[:, 0]
    masses = made.masses.view(rec.MASS)[0, :, 0]
    target = float(named["target"][0])
    held = np.abs(masses["Mc"]) + np.abs(masses["active"]) + np.abs(masses["mean"])
    held += np.where(masses["ground"] > 0.0, masses["ground"] * target, 0.0)
    for curve in made.curves[0].view(rec.CURVE)[:, 0]:
        held[int(curve["mass"])] += np.abs(curve["torque"]).max()
    for tone in made.tones.view(rec.TONE)[:, 0]:
        held[int(tone["mass"])] += math.hypot(tone["cosine"], tone["sine"])
    elastic = ~arrays.rigid
    stiffest = float(arrays.c[elastic].max()) if elastic.any() else 0.0
    J1 = float(arrays.J[arrays.motor])
    thrown = math.sqrt(stiffest / J1) * float(np.abs(arrays.theta0).max())
    speed = max(target, float(np.abs(arrays.w0).max()), thrown)
    compliance = float((1.0 / arrays.c[elastic]).sum())
    inertia = float((arrays.moving_J * heavier).sum())
    guard_limits(named["guard"], named, J1, inertia, float((held * heavier).sum()), compliance, speed)


def _driven_by_curves(made: KernelInput, left: float, heavier: Vector, speeds: float) -> float:
    """The integral of dw/(sum of the torques) up to a speed: infinite where load curves do not drive it on.

    `left` is what the other torques leave, N m. A curve over speed drives where it is negative; its power
    loses in gears what that of the motor does.
    """
    w = np.linspace(0.0, speeds, 1001)
    torque = np.full(w.shape, left)
    for curve in made.curves[0].view(rec.CURVE)[:, 0]:
        if not curve["by_angle"]:
            points, through = int(curve["points"]), heavier[int(curve["mass"])]
            brakes = np.interp(w, curve["at"][:points], curve["torque"][:points])
            torque -= np.where(brakes > 0.0, brakes * through, brakes / through)
    return speeds * float(np.mean(1.0 / torque)) if torque.min() > 0.0 else math.inf


def _refuse(chain: Chain, arrays: ChainArrays) -> None:
    wrong, welded = [], arrays.rigid & (arrays.gap == 0.0)
    for k, shaft in enumerate(chain.shafts):
        if shaft.efficiency != 1.0 and arrays.rigid[k]:
            wrong.append(
                f"[shaft] {k + 1}, efficiency = {shaft.efficiency}: the loss of a gear goes with the torque "
                "of a spring, and this shaft is rigid; give it a stiffness, or leave the efficiency out."
            )
        if welded[k] and not math.isclose(arrays.w0[k], arrays.w0[k + 1], rel_tol=SAME_SPEED):
            wrong.append(
                f"[shaft] {k + 1}: it is rigid, so the masses it joins start with one speed, and they have "
                f"{arrays.w0[k]:.12g} and {arrays.w0[k + 1]:.12g} rad/s at the motor shaft; give both the "
                "same initial_speed, divided by the ratio."
            )
    if wrong:
        raise InputError(wrong)
