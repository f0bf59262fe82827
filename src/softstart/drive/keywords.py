"""The keyword arguments of `Drive`, as editors and type checkers see them."""

from __future__ import annotations

from typing import TypedDict

import numpy.typing as npt

from softstart.drive.parameters import ContactLaw, LoadKind

__all__ = ["DriveChanges", "DriveKeywords", "Given"]

# A number in SI, "0.5 rad", or an array or a list of either.
Given = npt.ArrayLike


class _Free(TypedDict, total=False):
    name: str
    source: str
    maximum_torque: Given | None
    minimum_torque: Given
    rated_power: Given | None
    rated_speed: Given | None
    torque_lag: Given
    torque_rate: Given
    encoder_lines: Given
    encoder_phase: Given
    torque_noise: Given
    noise_seed: Given
    computing_delay: Given
    damping: Given
    contact_law: ContactLaw
    start_position: Given
    load_kind: LoadKind
    target_speed: Given | None
    initial_load_speed: Given
    initial_motor_speed: Given


class DriveKeywords(_Free):
    """The parameters of a new drive; `target_speed` may be left out if there is a `rated_speed`."""

    motor_inertia: Given
    starting_torque: Given
    stiffness: Given
    gap: Given
    load_inertia: Given
    load_torque: Given


class DriveChanges(_Free, total=False):
    """Parameters of which any may be given."""

    motor_inertia: Given
    starting_torque: Given
    stiffness: Given
    gap: Given
    load_inertia: Given
    load_torque: Given
