"""What a chain is made of: masses, shafts with gaps and gears, the motor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from softstart.chain.tables import MASS, MOTOR, SHAFT
from softstart.drive import ContactLaw, LoadKind
from softstart.errors import InputError
from softstart.input.documents import read_table

__all__ = ["Mass", "Motor", "Quantity", "Shaft", "Side", "gap_of", "mass_mistakes", "shaft_mistakes"]

Quantity = float | str  # a number in SI, or a string with a unit
Side = Literal["before", "after"]


@dataclass(frozen=True, init=False)
class Mass:
    """A rigid mass: everything in SI, on its own shaft.

    `torque` is the load torque, positive where it brakes a forward motion; `kind` "active" acts always,
    "reactive" opposes motion and holds the mass at rest up to its size. `damping` is that to the ground.

    >>> Mass("350 kg*cm^2", name="rotor").inertia
    0.035
    """

    name: str
    inertia: float
    damping: float
    torque: float
    kind: LoadKind
    initial_speed: float

    def __init__(
        self,
        inertia: Quantity,
        *,
        name: str = "",
        damping: Quantity = 0.0,
        torque: Quantity = 0.0,
        kind: LoadKind = "active",
        initial_speed: Quantity = 0.0,
    ) -> None:
        given = {"inertia": inertia, "damping": damping, "torque": torque, "kind": kind}
        given |= {"initial_speed": initial_speed} | ({"name": name} if name else {})
        values = read_table(given, MASS)
        wrong = mass_mistakes(values)
        if wrong:
            raise InputError(wrong)
        _fill(self, values)


@dataclass(frozen=True, init=False)
class Shaft:
    """What joins two neighbouring masses: a spring with a damper, a gap, then a gear.

    `ratio` is the speed of the mass before over that of the mass after (3 for a reduction of three to one).
    Stiffness, damping, gap and start position are measured on the `side` of the gear that is named: "before"
    it, at the speed of the mass before (the default), or "after" it. A `stiffness` of infinity is a rigid
    joint: with a gap the masses meet in impacts of the `restitution`, without one they move as one mass. The
    gap may be given as `backlash` on a pitch `diameter`, `gap = 2 backlash/diameter` [R]. `efficiency` is
    the share of the power that leaves the gear, whichever way it flows: of the torque T of the shaft, brought
    to the other side, eta T acts there while the shaft drives, and T/eta while it is driven. At rest the gear
    holds whatever lies between.

    >>> Shaft("2 kN*m/rad", backlash="0.2 mm", diameter="185 mm").gap
    0.002162...
    >>> Shaft(gap="1 deg", restitution=0.9).rigid
    True
    """

    stiffness: float
    damping: float
    gap: float
    ratio: float
    side: Side
    efficiency: float
    restitution: float | None
    contact_law: ContactLaw
    start_position: float

    def __init__(
        self,
        stiffness: Quantity | None = None,
        *,
        damping: Quantity = 0.0,
        gap: Quantity | None = None,
        backlash: Quantity | None = None,
        diameter: Quantity | None = None,
        ratio: Quantity = 1.0,
        side: Side = "before",
        efficiency: Quantity = 1.0,
        restitution: Quantity | None = None,
        contact_law: ContactLaw = "no-pull",
        start_position: Quantity = 0.0,
    ) -> None:
        given: dict[str, object] = {
            "stiffness": stiffness,
            "damping": damping,
            "gap": gap,
            "backlash": backlash,
            "diameter": diameter,
            "ratio": ratio,
            "side": side,
            "efficiency": efficiency,
            "restitution": restitution,
            "contact_law": contact_law,
            "start_position": start_position,
        }
        values = read_table({key: value for key, value in given.items() if value is not None}, SHAFT)
        wrong = shaft_mistakes(values)
        if wrong:
            raise InputError(wrong)
        stiff = math.inf if values["stiffness"] is None else values["stiffness"]
        _fill(self, values | {"stiffness": stiff, "gap": gap_of(values)})

    @property
    def rigid(self) -> bool:
        """Whether there is no spring in it."""
        return math.isinf(self.stiffness)


@dataclass(frozen=True, init=False)
class Motor:
    """The motor's torque as a `Drive` has it, at the shaft of the mass on which it acts ("": the first).

    >>> Motor(62, torque_lag="2 ms").maximum_torque
    62.0
    """

    mass: str
    starting_torque: float
    maximum_torque: float
    minimum_torque: float
    rated_power: float | None
    rated_speed: float | None
    torque_lag: float
    torque_rate: float
    encoder_lines: float
    encoder_phase: float
    torque_noise: float
    noise_seed: float
    computing_delay: float

    def __init__(
        self,
        starting_torque: Quantity,
        *,
        mass: str = "",
        maximum_torque: Quantity | None = None,
        minimum_torque: Quantity = 0.0,
        rated_power: Quantity | None = None,
        rated_speed: Quantity | None = None,
        torque_lag: Quantity = 0.0,
        torque_rate: Quantity = math.inf,
        encoder_lines: Quantity = 4096.0,
        encoder_phase: Quantity = 0.0,
        torque_noise: Quantity = 0.0,
        noise_seed: Quantity = 0.0,
        computing_delay: Quantity = 0.0,
    ) -> None:
        given: dict[str, object] = {
            "starting_torque": starting_torque,
            "maximum_torque": maximum_torque,
            "minimum_torque": minimum_torque,
            "rated_power": rated_power,
            "rated_speed": rated_speed,
            "torque_lag": torque_lag,
            "torque_rate": torque_rate,
            "encoder_lines": encoder_lines,
            "encoder_phase": encoder_phase,
            "torque_noise": torque_noise,
            "noise_seed": noise_seed,
            "computing_delay": computing_delay,
        }
        given |= {"mass": mass} if mass else {}
        values = read_table({key: value for key, value in given.items() if value is not None}, MOTOR)
        wrong = motor_mistakes(values)
        if wrong:
            raise InputError(wrong)
        _fill(self, values | {"maximum_torque": values["maximum_torque"] or values["starting_torque"]})

    def keywords(self) -> dict[str, float]:
        """The motor as keywords of `Drive`."""
        kept = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "mass"}
        return {key: value for key, value in kept.items() if value is not None}


def gap_of(values: Mapping[str, Any]) -> float:
    """The total angular gap in rad that the values of a shaft mean: given, or `2 backlash/diameter`."""
    if values["backlash"] is not None:
        return float(2.0 * values["backlash"] / values["diameter"])
    return float(values["gap"] or 0.0)


def shaft_mistakes(values: Mapping[str, Any]) -> list[str]:
    """What the values of a shaft, each right in itself, say against one another."""
    wrong = []
    backlash, diameter = values["backlash"], values["diameter"]
    if backlash is not None and values["gap"] is not None:
        wrong.append(
            f"gap = {values['gap']!r} and backlash = {backlash!r}: both give the gap; leave one out."
        )
    if (backlash is None) != (diameter is None):
        missing = "diameter" if diameter is None else "backlash"
        wrong.append(
            f"{missing} is missing: a backlash is on a pitch diameter; give both, or the gap as an angle."
        )
    if values["efficiency"] == 0.0:
        wrong.append("efficiency = 0: the efficiency of the gear must be above 0.")
    if wrong:
        return wrong
    stiffness, restitution, gap = values["stiffness"], values["restitution"], gap_of(values)
    if stiffness is None and restitution is None:
        return [
            'stiffness is missing: write for example stiffness = "368 N*m/rad"; a gap without a spring has '
            'a restitution, a rigid joint stiffness = "inf".'
        ]
    if stiffness is not None and not math.isinf(stiffness):
        if restitution is not None:
            wrong.append(
                f"restitution = {restitution!r}: a gap that closes on a spring has no impact; leave out the "
                "restitution or the stiffness."
            )
        return wrong
    if gap > 0.0 and restitution is None:
        wrong.append("restitution is missing: a rigid gap needs one, from 0 (no rebound) to 1 (elastic).")
    if values["damping"] > 0.0:
        wrong.append(f"damping = {values['damping']!r}: a rigid joint has no damping; leave it out.")
    if abs(values["start_position"]) > 0.5 * gap:
        wrong.append(
            f"start_position = {values['start_position']!r}: a rigid gap of {gap!r} rad lets the twist lie "
            f"between {-0.5 * gap!r} and {0.5 * gap!r}."
        )
    return wrong


def mass_mistakes(values: Mapping[str, Any]) -> list[str]:
    """What the values of a mass, each right in itself, say against one another."""
    if values["kind"] == "reactive" and values["torque"] < 0.0:
        return [
            f"torque = {values['torque']!r}: a reactive load torque is friction and must be 0 or more; write "
            'its size, or kind "active".'
        ]
    return []


def motor_mistakes(values: Mapping[str, Any]) -> list[str]:
    """What the values of a motor, each right in itself, say against one another."""
    largest, start = values["maximum_torque"], values["starting_torque"]
    if largest is not None and largest < start:
        return [f"maximum_torque = {largest!r}: it must be at least the starting torque, {start!r} N*m."]
    return []


def _fill(one: Mass | Shaft | Motor, values: Mapping[str, object]) -> None:
    """Put values into a frozen object; keys without a field are left out."""
    for field in fields(one):
        object.__setattr__(one, field.name, values[field.name])
