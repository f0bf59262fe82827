"""What a chain is made of: masses, shafts with gaps and gears, the motor; and the tables of its file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, Literal, Protocol, Self, get_args

from softstart.drive import ContactLaw, Drive, LoadKind
from softstart.input.files import Library
from softstart.input.parameter_set import (
    MaybeNumber,
    MaybeSeries,
    Number,
    ParameterSet,
    like,
    parameter,
)

Quantity = float | str  # a number in SI, or a string with a unit
Side = Literal["before", "after"]

LIBRARY = Library("softstart.chain", "a chain", "chains")
MOST_POINTS = 16  # of a load curve


class Mass(ParameterSet, what="a mass"):
    """A rigid mass: everything in SI, on its own shaft.

    `torque` is the load torque, positive where it brakes a forward motion; `kind` "active" acts always,
    "reactive" opposes motion and holds the mass at rest up to its size, as the `friction` does that acts
    besides. `damping` is that to the ground.

    A mass at the end of a chain with an `inertia` of infinity stays at rest: ground, or what a brake holds.
    `curve_torque` is a load torque that acts besides, always: at the speeds `curve_speed` of the mass, or at
    its angles `curve_angle` (0 where the load mass begins), linear in between, constant beyond them.

    Attributes
    ----------
    inertia, initial_speed : kg m^2 and rad/s.
    torque, friction, curve_torque : load torques, N m.

    Examples
    --------
    >>> Mass("350 kg*cm^2", name="rotor").inertia
    0.035
    >>> fan = Mass(2.0, curve_speed=["0 rpm", "500 rpm", "1000 rpm"], curve_torque=[0.0, 10.0, 40.0])
    """

    # fmt: off
    name: str = parameter("mass.name", "", "name of the mass", '"drum"', default="")
    inertia: Number = parameter("mass.inertia", "kg*m^2", "inertia on its own shaft", '"0.035 kg*m^2"',
        "above 0", infinite=True, kw_only=False)
    damping: Number = parameter("mass.damping", "N*m*s/rad", "damping to the ground", '"0.01 N*m*s/rad"',
        "0 or more", default=0.0)
    torque: Number = parameter("mass.torque", "N*m", "load torque on its own shaft", '"7.16 N*m"',
        default=0.0, label="load torque")
    kind: LoadKind = parameter("mass.kind", "", "kind of the load torque", '"active"', default="active",
        choices=get_args(LoadKind))
    friction: Number = parameter("mass.friction", "N*m",
        "Coulomb friction besides its torque", '"0.7 N*m"', "0 or more", default=0.0)
    initial_speed: Number = parameter("mass.initial_speed", "rad/s", "speed at the start", '"0 rad/s"',
        default=0.0)
    curve_speed: MaybeSeries = parameter("mass.curve_speed", "rad/s", "rising speeds of its load curve",
        "[0, 50, 100]", default=None, many=True)
    curve_angle: MaybeSeries = parameter("mass.curve_angle", "rad", "rising angles of its load curve",
        "[0, 1.5, 3]", default=None, many=True)
    curve_torque: MaybeSeries = parameter("mass.curve_torque", "N*m",
        "load torques at these speeds or angles", "[0, 10, 40]", default=None, many=True)
    # fmt: on

    def contradictions(self) -> Iterable[str]:
        """Sentences on values that contradict one another."""
        if self.kind == "reactive" and self.torque < 0.0:
            yield (
                f"torque = {self.torque!r}: a reactive load torque is friction and must be 0 or more; write "
                'its size, or kind "active".'
            )
        if math.isinf(self.inertia) and self.initial_speed != 0.0:
            yield f"initial_speed = {self.initial_speed!r}: a mass of infinite inertia stays at rest."
        given = [one for one in (self.curve_speed, self.curve_angle) if one is not None]
        if not given and self.curve_torque is None:
            return
        if len(given) != 1 or self.curve_torque is None:
            yield "curve_torque: a load curve has torques and, at as many points, speeds or angles."
        elif len(given[0]) != len(self.curve_torque) or not 2 <= len(given[0]) <= MOST_POINTS:
            yield (
                f"curve_torque: {len(self.curve_torque)} torques at {len(given[0])} points; give as many of "
                f"both, 2 to {MOST_POINTS}."
            )
        elif any(b <= a for a, b in pairwise(given[0])):
            yield "curve_speed, curve_angle: the points of a load curve rise; order them."

    @property
    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...], bool] | None:
        """Its load curve: speeds or angles, torques there, and whether it is by angle; None without one."""
        at = self.curve_speed or self.curve_angle
        if at is None or self.curve_torque is None:
            return None
        return at, self.curve_torque, self.curve_angle is not None


class Shaft(ParameterSet, what="a shaft"):
    """What joins two neighbouring masses: a spring with a damper, a gap, then a gear.

    `ratio` is the speed of the mass before over that of the mass after (3 for a reduction of three to one).
    Stiffness, damping, gap, permissible torque and start position are measured on the `side` of the gear that
    is named: "before" it, at the speed of the mass before (the default), or "after" it. The damping may be
    given as a ratio zeta, d = 2 zeta sqrt(c J) with J = J1 J2/(J1 + J2) of the two masses that it joins. A
    `stiffness` of infinity is a rigid joint: with a gap the masses meet in impacts of the `restitution`,
    without one they move as one mass. The gap may be given as `backlash` on a pitch `diameter`,
    `gap = 2 backlash/diameter` [R]. `efficiency` is the share of the power that leaves the gear, whichever
    way it flows: of the torque T of the shaft, brought to the other side, eta T acts there while the shaft
    drives, and T/eta while it is driven. At rest the gear holds whatever lies between.

    Attributes
    ----------
    stiffness, damping, gap : N m/rad, N m s/rad and rad, at the `side` of the gear.

    Examples
    --------
    >>> Shaft("2 kN*m/rad", backlash="0.2 mm", diameter="185 mm").gap
    0.002162...
    >>> Shaft(gap="1 deg", restitution=0.9).rigid
    True
    """

    # fmt: off
    stiffness: Number = parameter("shaft.stiffness", "N*m/rad", "stiffness", '"368 N*m/rad"', "above 0",
        default=None, infinite=True, kw_only=False,
        at_output="side")
    damping: Number = parameter("shaft.damping", "N*m*s/rad", "damping", '"1.5 N*m*s/rad"', "0 or more",
        default=0.0,
        at_output="side")
    damping_ratio: MaybeNumber = parameter("shaft.damping_ratio", "1",
        "damping ratio of its two masses alone, instead of `damping`", "0.02", "0 or more", default=None)
    gap: Number = parameter("shaft.gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", default=None,
        label="total gap", at_output="side")
    backlash: MaybeNumber = parameter("shaft.backlash", "m", "backlash on the pitch circle", '"0.2 mm"',
        "0 or more", default=None)
    diameter: MaybeNumber = parameter("shaft.diameter", "m", "pitch diameter", '"185 mm"', "above 0",
        default=None)
    ratio: Number = parameter("shaft.ratio", "1", "gear ratio, speed before over speed after", "3", "above 0",
        default=1.0)
    side: Side = parameter("shaft.side", "", "side of the gear on which shaft and gap lie", '"before"',
        default="before", choices=get_args(Side))
    efficiency: Number = parameter("shaft.efficiency", "1", "efficiency of the gear", "0.97",
        "above 0 and at most 1", default=1.0)
    restitution: MaybeNumber = parameter("shaft.restitution", "1", "restitution of a rigid gap", "0.8",
        "from 0 to 1", default=None)
    contact_law: ContactLaw = parameter("shaft.contact_law", "", "law of the torque in contact", '"no-pull"',
        default="no-pull", choices=get_args(ContactLaw))
    permissible_torque: MaybeNumber = parameter("shaft.permissible_torque", "N*m",
        "permissible peak torque of shaft, coupling or gear", '"800 N*m"', "above 0", default=None,
        label="permissible", at_output="side")
    start_position: MaybeNumber = parameter("shaft.start_position", "rad",
        "twist at the start (0 is mid-gap); else by `start.position`", '"0 rad"', default=None,
        at_output="side")
    # fmt: on

    def contradictions(self) -> Iterable[str]:
        """Sentences on values that contradict one another."""
        gap, backlash, diameter = (vars(self)[key] for key in ("gap", "backlash", "diameter"))
        wrong = []
        if backlash is not None and gap is not None:
            wrong.append(f"gap = {gap!r} and backlash = {backlash!r}: both give the gap; leave one out.")
        if (backlash is None) != (diameter is None):
            missing = "diameter" if diameter is None else "backlash"
            wrong.append(
                f"{missing} is missing: a backlash is on a pitch diameter; give both, or the gap as an angle."
            )
        if self.damping > 0.0 and self.damping_ratio is not None:
            wrong.append(
                f"damping = {self.damping!r} and damping_ratio = {self.damping_ratio!r}: both give the "
                "damping; leave one out."
            )
        if wrong:
            return wrong
        if backlash is not None:
            self._derive(gap=2.0 * backlash / diameter, backlash=None, diameter=None)
        elif gap is None:
            self._derive(gap=0.0)
        return list(self._joint_mistakes())

    def _joint_mistakes(self) -> Iterator[str]:
        """What a spring and a rigid joint have."""
        stiffness, restitution, gap = vars(self)["stiffness"], self.restitution, self.gap
        if stiffness is None:
            self._derive(stiffness=math.inf)
        if stiffness is None and restitution is None:
            yield (
                'stiffness is missing: write for example stiffness = "368 N*m/rad"; a gap without a spring '
                'has a restitution, a rigid joint stiffness = "inf".'
            )
        elif not self.rigid:
            if restitution is not None:
                yield (
                    f"restitution = {restitution!r}: a gap that closes on a spring has no impact; leave out "
                    "the restitution or the stiffness."
                )
        else:
            if gap > 0.0 and restitution is None:
                yield "restitution is missing: a rigid gap needs one, from 0 (no rebound) to 1 (elastic)."
            for key in ("damping", "damping_ratio"):
                if vars(self)[key]:
                    yield f"{key} = {vars(self)[key]!r}: a rigid joint has no damping; leave it out."
            if abs(self.start_position or 0.0) > 0.5 * gap:
                yield (
                    f"start_position = {self.start_position!r}: a rigid gap of {gap!r} rad lets the twist "
                    f"lie between {-0.5 * gap!r} and {0.5 * gap!r}."
                )

    @property
    def rigid(self) -> bool:
        """Whether there is no spring in it."""
        return math.isinf(self.stiffness)

    def widened(self, factor: float) -> Self:
        """The shaft with so many times its gap; an angle keeps its share of it, one beyond its overlap.

        >>> Shaft(100.0, gap=0.2, start_position=0.05).widened(2.0).start_position
        0.1
        """
        theta, half = self.start_position, 0.5 * self.gap
        if theta is not None:
            inside = max(-half, min(theta, half))
            theta = factor * inside + (theta - inside)
        return self.replace(gap=factor * self.gap, backlash=None, diameter=None, start_position=theta)


class Motor(ParameterSet, what="a motor"):
    """The motor's torque as a `Drive` has it, at the shaft of the mass on which it acts ("": the first).

    Attributes
    ----------
    starting_torque, maximum_torque, minimum_torque : N m.

    Examples
    --------
    >>> Motor(62, torque_lag="2 ms").maximum_torque
    62.0
    """

    # fmt: off
    mass: str = parameter("motor.mass", "", "name of the mass on which the motor acts", '"rotor"', default="")
    starting_torque: Number = parameter("motor.starting_torque", "N*m", "starting torque of the motor",
        '"62 N*m"', "above 0", kw_only=False)
    maximum_torque: Number = like(Drive, "maximum_torque")
    minimum_torque: Number = like(Drive, "minimum_torque")
    rated_power: MaybeNumber = like(Drive, "rated_power")
    rated_speed: MaybeNumber = like(Drive, "rated_speed")
    rated_torque: MaybeNumber = like(Drive, "rated_torque")
    torque_lag: Number = like(Drive, "torque_lag")
    torque_rate: Number = like(Drive, "torque_rate")
    initial_torque: Number = parameter("motor.initial_torque", "N*m",
        "torque at t = 0, from which lag and rate limit begin", '"10 N*m"', default=0.0)
    encoder_lines: Number = like(Drive, "encoder_lines")
    encoder_phase: Number = like(Drive, "encoder_phase")
    torque_noise: Number = like(Drive, "torque_noise")
    noise_seed: Number = like(Drive, "noise_seed")
    computing_delay: Number = like(Drive, "computing_delay")
    # fmt: on

    def contradictions(self) -> Iterable[str]:
        """Sentences on values that contradict one another."""
        if self.maximum_torque < self.starting_torque:
            yield (
                f"maximum_torque = {self.maximum_torque!r}: it must be at least the starting torque, "
                f"{self.starting_torque!r} N*m."
            )
        if not self.minimum_torque <= self.initial_torque <= self.maximum_torque:
            yield (
                f"initial_torque = {self.initial_torque!r}: it must lie between minimum_torque and "
                "maximum_torque."
            )
        if self.initial_torque and not (self.torque_lag > 0.0 or self.torque_rate < math.inf):
            yield (
                f"initial_torque = {self.initial_torque!r}: without torque_lag and torque_rate the torque is "
                "the demand from the start; leave it out."
            )

    def keywords(self) -> dict[str, Any]:
        """The motor as keywords of `Drive`, which begins without torque."""
        return {key: v for key, v in self.values().items() if key in Drive.PARAMETERS and v is not None}


class ChainParts(Protocol):
    """What a `Chain` is made of, for functions on which it depends itself."""

    @property
    def masses(self) -> tuple[Mass, ...]: ...
    @property
    def shafts(self) -> tuple[Shaft, ...]: ...
    @property
    def motor(self) -> Motor | None: ...
    @property
    def position(self) -> str: ...
    @property
    def motor_index(self) -> int: ...
    @property
    def load_index(self) -> int: ...
    def speed_ratios(self, reference: int) -> tuple[float, ...]: ...
