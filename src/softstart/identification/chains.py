"""A chain with one dominant gap, identified through its reduction to two masses, and the error of that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from softstart.chain.model import Chain
from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.identification.logs import TURN, Log
from softstart.identification.model import knots_of, unlimited
from softstart.profile import TorqueProfile
from softstart.start.simulation import simulate
from softstart.vibration import reduce_chain

DOMINANT: Final = 0.5  # of all gaps, at the motor shaft


def reduced_drive(machine: Any) -> Drive:
    """The drive of two masses that stands for a machine; refused where no gap is the larger part of all.

    >>> reduced_drive(Chain.load("crane-4-mass"))
    Traceback (most recent call last):
    softstart.errors.InputError: drive = Crane travel drive as a chain of four masses: its widest gap is 40 %
    of all; ...
    """
    gaps = machine.gaps
    whole = float(gaps.sum())
    if whole > 0.0 and float(gaps.max()) <= DOMINANT * whole:
        raise InputError(
            f"drive = {machine.name}: its widest gap is {100.0 * float(gaps.max()) / whole:.0f} % of all; "
            "a log of the motor is explained by two masses and one gap only where one gap is the larger part."
        )
    drive: Drive = machine.two_masses
    return drive


def chain_log(chain: Chain, log: Log, lines: float) -> Log:
    """What the motor of the whole chain does under the torque of a log, counted by an encoder, without noise.

    It starts in mid-gap where its position is unknown.
    """
    one = chain.positions.get("mid-gap", next(iter(chain.positions.values())))
    if one.motor is None:
        raise InputError("[motor] is missing: a drive needs its starting torque; add it to the chain.")
    one = replace(one, motor=replace(one.motor, **unlimited(log)))
    times = log.time - log.time[0]
    knots, owners = knots_of(log)
    profile = TorqueProfile(knots, log.torque[owners])
    run = simulate(one, make_controller("profile", {"profile": profile}), until=float(times[-1]))
    states = run.at(times)
    angle = states["phi"][:, one.motor_index] - states["phi"][0, one.motor_index]
    if log.kind == "speed":
        return Log(
            times, log.torque, speed=states["w"][:, one.motor_index], torque_is=log.torque_is, name="chain"
        )
    if lines:
        count = TURN / (4.0 * lines)
        angle = np.floor(angle / count + 0.3) * count
    return Log(times, log.torque, angle=angle, torque_is=log.torque_is, name="chain")


def reduction_notes(chain: Any, drive: Drive, log: Log, told: Callable[[Log], dict[str, float]]) -> list[str]:
    """What the reduction of more than two masses leaves out, and how far it moves each value.

    The second follows from a fit of two masses to the start of the whole chain, as it was given, under the
    torque of the log: what that has `told` beside what the reduction says.
    """
    if len(chain.mass_names) <= 2:
        return []
    found = reduce_chain(chain, force=True)
    first, *rest = (found.vibration.Omega[1:] / TURN).tolist()
    period = float(np.median(np.diff(log.time)))
    may = "may show it" if rest[0] * period < 0.5 else "cannot show it"
    said = (
        f"{chain.name} has {len(chain.masses)} masses; what was found are the two that stand for it, with "
        f"its first natural frequency, {first:.4g} Hz. Those from {rest[0]:.4g} Hz on are left out (a log "
        f"with {period:.3g} s between samples {may}). "
    )
    try:
        found_of_chain = told(chain_log(chain, log, float(drive.encoder_lines)))
    except (InputError, SimulationError) as error:
        return [f"{said}How far that moves the values could not be predicted: {error}"]
    moved = [
        f"{name} {100.0 * (value / given - 1.0):+.2g} %"
        for name, value in found_of_chain.items()
        if (given := float(getattr(drive, name, 0.0)))
    ]
    return [
        f"{said}That moves the values, by a fit of two masses to the start of the whole chain, as it was "
        f"given, under this torque: {', '.join(moved)}. The intervals do not hold this error."
    ]
