"""A chain: masses in a row, joined by shafts that may hold a gap and a gear; a motor on one of the masses.

Every quantity of a file is on its own shaft. `Chain.brought_to` brings them to one shaft, where gears are
gone; `Chain.at_motor_shaft` gives the same as arrays, which is what the simulation and the natural
frequencies work with.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from typing import Any, ClassVar, NamedTuple, Self, get_args

import numpy as np

from softstart.arrays import Vector
from softstart.chain.arrays import ChainArrays, arrays_at
from softstart.chain.checks import BRANCHES, mistakes_of, no_such_mass, warnings_of
from softstart.chain.elements import LIBRARY, Mass, Motor, Shaft
from softstart.chain.unreduced import Unreduced
from softstart.drive import PARAMETERS, UNKNOWN_POSITIONS, Drive, Duty, Limits, Machine, Position
from softstart.drive.checks import wrong_units
from softstart.drive.machine import TwoMasses
from softstart.drive.model import BY_PATH, has_brake
from softstart.errors import InputError
from softstart.hints import did_you_mean
from softstart.input.documents import DocumentTable, document_text
from softstart.input.gear import NO_OUTPUT
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import (
    MaybeNumber,
    Number,
    ParameterSet,
    Rows,
    component,
    like,
    parameter,
)
from softstart.input.parameters import ParameterValue, Wording
from softstart.quantities import show

# mass[2].inertia, mass[drum].inertia, or mass_2_inertia
PART = re.compile(r"(mass|shaft)(?:\[(.+)\]\.|_(\d+)_)(\w+)")
SAME = 1e-12  # within this share two gaps are one, whatever binary makes of their sum
# of a shaft, each excludes the other
INSTEAD: Mapping[str, dict[str, Any]] = {
    "damping": {"damping_ratio": None},
    "damping_ratio": {"damping": 0.0},
}
OF_A_DRIVE = re.compile(r"(^|: )\[?(limits|gear)[\].].*no such (key|table)")
OWN_LIMITS = (
    " The gears of a chain are in its shafts, and each shaft has a permissible torque of its own, on the "
    "side of its gear that it names: shaft[N].permissible_torque and shaft[N].side."
)
BRANCHING = re.compile(r"\[(branch|shaft\] \d+, (from|to|between|masses|mass|joins|ends|parent)\b)")


class Chain(ParameterFile, Machine, library=LIBRARY):
    """Masses in a row and the shafts between neighbours; shaft k joins mass k and mass k + 1.

    Each quantity is a number in SI or a string with a unit, on its own shaft.

    Parameters
    ----------
    masses : iterable of Mass, length n
        Two masses or more, in order: inertia in kg m2, load torque in N m. Those without a name are called
        "mass 1" and so on.
    shafts : iterable of Shaft, length n - 1
        Stiffness in N m/rad, gap in rad, and the gear between the two masses.
    motor : Motor, optional
        Acts on the mass it names, else on the first. None for a chain that is only analysed.
    load_mass : str, optional
        Name of the mass that is to reach `target_speed`; by default the last that can move.
    target_speed : float or str, optional
        Speed of the load, rad/s *at the motor shaft*, as in a `Drive`; by default the rated speed of the
        motor.
    position : str, optional
        Where the start begins in every gap whose shaft has no `start_position`: "mid-gap" (the default),
        "driving-flank", "opposite-flank", "hanging" (each shaft wound up by the active load behind it), or
        "unknown", all gaps alike.
    name, source : str, optional
        Name of the chain, and source of its numbers.
    assumed : str, optional
        Which values are assumed; it is printed with every output.
    units : str, optional
        Units in which results are shown, as "deg, rpm, kN m"; by default those of the values as given.
    brake_torque, closing_delay, opening_delay : float or str, optional
        Brake on the mass of the motor: torque with which it slips, N m (infinite: an ideal lock), and times
        from a command until it is closed and open, s. Any of them above 0 means that there is one.
    duty : Duty, optional
        The cycle of steps that the chain repeats.

    Raises
    ------
    InputError
        If numbers of masses and shafts do not match, a name occurs twice, or there is no such mass.

    Examples
    --------
    >>> chain = Chain([Mass(0.035), Mass(0.7)], [Shaft(368.465, gap="0.5 rad", ratio=2)], Motor(62))
    >>> chain.brought_to("motor").masses[1].inertia
    0.175

    References
    ----------
    [R].
    """

    # as a drive has it
    position_given: ClassVar[bool] = True  # it is "mid-gap" without a word
    gear: ClassVar[None] = None  # masses and shafts are given at their own shafts
    KIND: ClassVar[str] = "chain"
    LIMITS_GIVEN: ClassVar[str] = "shafts their permissible_torque"

    # fmt: off
    masses: Rows[Mass] = component(Mass, least=2, kw_only=False)
    shafts: Rows[Shaft] = component(Shaft, least=1, kw_only=False)
    motor: Motor | None = component(Motor, default=None, kw_only=False)
    load_mass: str = parameter("start.load", "", "name of the mass that is to reach the target speed",
        '"drum"', default="")
    target_speed: MaybeNumber = parameter("start.target_speed", "rad/s",
        "speed, at the motor shaft, that the load is to reach", '"880 rpm"', "above 0", default=None)
    position: Position = parameter("start.position", "", "position in all gaps at the start", '"hanging"',
        default="mid-gap", choices=get_args(Position))
    name: str = parameter("name", "", "name of the chain", '"my chain"', default="unnamed chain")
    source: str = parameter("source", "", "source of the numbers", '"data sheet"', default="")
    assumed: str = parameter("assumed", "", "list of the values that are assumed", '"all stiffnesses"',
        default="")
    units: str = like(Drive, "units")
    brake_torque: Number = like(Drive, "brake_torque")
    closing_delay: Number = like(Drive, "closing_delay")
    opening_delay: Number = like(Drive, "opening_delay")
    duty: Duty | None = component(Duty, default=None)
    # fmt: on

    def _fill(self, given: Mapping[str, object], *rest: Any) -> None:
        super()._fill(_completed(given), *rest)
        if self.brake_torque is None:  # an ideal lock, or none
            vars(self)["brake_torque"] = math.inf if self.brake == "motor" else 0.0
        if self.brake == "motor" and "position" not in vars(self)["_given"] and self.overhauling_torque:
            vars(self)["position"] = "hanging"

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterator[str]:
        if {"masses", "shafts", "load_mass"} <= values.keys():
            parts = values["masses"], values["shafts"], values.get("motor"), values["load_mass"]
            yield from (wording.before + sentence for sentence in mistakes_of(*parts))
            held = values["motor"].mass if values.get("motor") and has_brake(values) else ""
            for mass in values["masses"]:
                if mass.name == held and mass.initial_speed != 0.0:
                    reason = "the brake holds the motor, which stands still; leave it out, or [brake]"
                    yield wording.sentence(f"initial_speed = {mass.initial_speed!r}", reason)
        yield from wrong_units(values, self.PARAMETERS["units"], wording, NO_OUTPUT)

    # ---- where chains come from --------------------------------------------------------------------------

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        try:
            return super()._from_document(document, where, also)
        except InputError as error:
            branched = [BRANCHES] if any(map(BRANCHING.search, error.sentences)) else []
            sentences = [one + OWN_LIMITS * bool(OF_A_DRIVE.search(one)) for one in error.sentences]
            raise InputError([*sentences, *branched]) from None

    def to_toml(self) -> str:
        """The chain as TOML text in SI, without defaults, which `from_toml` reads back to an equal chain."""
        blocks = {path: (table, _without_defaults(table, holder)) for path, table, holder in self.blocks()}
        numbers = range(1, len(self.masses) + 1)  # masses and shafts alternate, as they are joined
        paths = ["", *(f"{kind}[{i}]" for i in numbers for kind in ("mass", "shaft")), "motor", "start"]
        return document_text(blocks[path] for path in dict.fromkeys([*paths, *blocks]) if path in blocks)

    # ---- places ------------------------------------------------------------------------------------------

    def index(self, place: str | int) -> int:
        """The index of a mass named by its name, or of the motor's mass where no mass is called "motor".

        >>> Chain.load("crane-4-mass").index("motor")
        0
        """
        if isinstance(place, int):
            if 0 <= place < len(self.masses):
                return place
            raise InputError(f"mass {place}: the chain has the masses 0 to {len(self.masses) - 1}.")
        names = [mass.name for mass in self.masses]
        if place in names:
            return names.index(place)
        if place == "motor":
            return 0 if self.motor is None else names.index(self.motor.mass)
        raise InputError(f"{show(place)}: {no_such_mass(place, names)}")

    @classmethod
    def _gear_in(cls, given: Mapping[str, object]) -> str:
        return NO_OUTPUT

    def gear_with(self, **given: object) -> str:
        """Why nothing is "at output", as `Drive.gear_with`."""
        return NO_OUTPUT

    def speed_ratios(self, reference: str | int = "motor") -> tuple[float, ...]:
        """The speed of each mass's shaft over that of the reference: `i` of [R], table 1.

        >>> Chain([Mass(1), Mass(1)], [Shaft(1, ratio=4)]).speed_ratios("mass 1")
        (1.0, 0.25)
        """
        speeds = [1.0]
        for shaft in self.shafts:
            speeds.append(speeds[-1] / shaft.ratio)
        of_reference = speeds[self.index(reference)]
        return tuple(speed / of_reference for speed in speeds)

    @property
    def motor_index(self) -> int:
        return 0 if self.motor is None else self.index(self.motor.mass)

    @property
    def load_index(self) -> int:
        return self.index(self.load_mass)

    @property
    def brake(self) -> str:
        """As of a drive: "motor" with a table [brake], which holds the motor's mass, else "none"."""
        return "motor" if self.motor is not None and has_brake(vars(self)) else "none"

    @property
    def release_time(self) -> float:
        """When the brake is open, s: `opening_delay` after the command of the start, 0 without a brake."""
        return self.opening_delay if self.brake == "motor" else 0.0

    @property
    def overhauling_torque(self) -> float:
        """With what torque the loads turn a motor without torque, N m; 0 where friction holds them.

        Gears on the way to the motor take their share.

        >>> round(Chain.load("crane-4-mass").overhauling_torque, 6)
        7.16
        """
        at = arrays_at(self, self.motor_index)  # not `at_motor_shaft`, which keeps the position
        through = at.efficiency_from_motor
        pull = float((at.active * through).sum()) + self.curve_torque
        left = abs(pull) - float((at.friction * through).sum())
        balanced = left <= SAME * float(np.abs(at.active).sum())  # as by a counterweight
        return 0.0 if balanced else math.copysign(left, pull)

    def with_load(self, values: Mapping[str, Any], mass: str = "") -> Self:
        """The chain with other load torque, kind, inertia and friction of a mass, by default the load mass.

        >>> Chain.load("crane-4-mass").with_load({"torque": 0.0}).overhauling_torque
        0.0
        """
        if mass and mass not in self.mass_names:
            raise InputError(f"mass = {show(mass)}: {no_such_mass(mass, list(self.mass_names))}")
        masses, index = list(self.masses), self.index(mass) if mass else self.load_index
        if math.isinf(masses[index].inertia):
            raise InputError(f"mass = {show(mass)}: it stays at rest, so that it has no load to change.")
        masses[index] = masses[index].replace(**values)
        return self.replace(masses=masses)

    @property
    def mass_names(self) -> tuple[str, ...]:
        return tuple(mass.name for mass in self.masses)

    @property
    def shaft_names(self) -> tuple[str, ...]:
        """Each shaft by the masses that it joins.

        >>> Chain.load("crane-4-mass").shaft_names[0]
        'rotor - pinion'
        """
        return tuple(f"{before} - {after}" for before, after in pairwise(self.mass_names))

    @property
    def local_gaps(self) -> tuple[float, ...]:
        """The gap of each shaft at that shaft itself, rad, as it was given."""
        return tuple(float(shaft.gap) for shaft in self.shafts)

    @property
    def gaps(self) -> Vector:
        """The gap of each shaft, rad at the motor shaft."""
        return self.at_motor_shaft().gap

    @property
    def mean_torque(self) -> float:
        """M12avg of the chain, N m at the motor shaft, to which its K_dyn refers.

        >>> round(Chain.load("crane-4-mass").mean_torque, 2)
        52.87
        """
        if self.motor is None:
            raise InputError("[motor] is missing: K_dyn refers to its starting torque; add it to the chain.")
        return self.at_motor_shaft().mean_torque(self.motor.starting_torque)

    @property
    def curve_torque(self) -> float:
        """What the load curves over speed brake with at standstill, N m at the motor shaft; < 0: they drive.

        >>> Chain([Mass(1, curve_speed=[0, 10], curve_torque=[-5, 0]), Mass(1)], [Shaft(9)]).curve_torque
        -5.0
        """
        curves = zip(self.masses, self.speed_ratios(self.motor_index), strict=True)
        at_rest = (
            ratio * float(np.interp(0.0, mass.curve_speed, mass.curve_torque or ()))
            for mass, ratio in curves
            if mass.curve_speed is not None
        )
        return sum(at_rest, 0.0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what the chain leaves out that decides its shaft torques.

        >>> Chain.load("tractor-like").warnings
        ()
        """
        return tuple(warnings_of(self, float(self.at_motor_shaft().Mc.sum())))

    # ---- as a drive has it: what starts and comparisons ask for -------------------------------------------

    @property
    def lever_rule_model(self) -> TwoMasses:
        """The chain as two masses: each split between motor and load by compliance (lever rule).

        >>> round(Chain.load("crane-4-mass").lever_rule_model.J2, 6)
        0.175026
        """
        at, motor = self.at_motor_shaft(), self.motor
        path = list(at.path)
        soft = np.where(at.rigid, 0.0, 1.0 / at.c)[path]
        to_load = np.zeros(at.c.size)  # how much of the compliance each shaft of the path has
        to_load[path] = soft / soft.sum() if soft.any() else 1.0 / len(path)
        share = np.concatenate([[0.0], np.cumsum(to_load)])
        share = share if at.load > at.motor or at.motor == 0 else 1.0 - share
        J = at.J if at.held is None else np.full(at.J.size, math.nan)
        drives = np.where(np.arange(at.c.size) >= at.motor, 1.0, -1.0)
        twists = [drives * one.at_motor_shaft().theta0 for one in self.positions.values()]
        return TwoMasses(
            J1=float(J @ (1.0 - share)),
            J2=float(J @ share),
            c=float(1.0 / soft.sum()) if soft.any() else math.inf,
            d=float(at.d[path] @ to_load[path] ** 2),
            gap=float(at.gap[path].sum()),
            travel=float(max(np.maximum(0.5 * at.gap - twist, 0.0)[path].sum() for twist in twists)),
            Ms=math.nan if motor is None else motor.starting_torque,
            Mc=float(at.Mc.sum()),
            active=bool(at.active.any()),
            friction=float(at.friction.sum()),
            speed=math.nan if self.target_speed is None else self.target_speed,
            ratio=1.0 / float(at.speed_ratio[at.load]),
        )

    @property
    def limits(self) -> Limits:
        """The permissible torques of its shafts, as limits of a comparison."""
        given = any(shaft.permissible_torque is not None for shaft in self.shafts)
        return Limits(used_torque=100.0 if given else None)

    @property
    def positions(self) -> Mapping[str, Self]:
        """The chain at each position at which it may start: one, or three if that is unknown."""
        if self.position != "unknown":
            return {self.position: self}
        return {one: self.replace(position=one) for one in UNKNOWN_POSITIONS}

    @property
    def two_masses(self) -> Drive:
        """The drive of two masses that stands for the chain: the modal reduction, whatever its error."""
        from softstart.vibration import reduce_chain

        return reduce_chain(self, force=True).to_drive()

    @cached_property
    def design_drive(self) -> Drive:
        """The two masses that controllers are set up for; of a chain without these an `Unreduced`."""
        try:
            return self.two_masses.design_drive
        except InputError as error:
            return Unreduced(self, error.sentences)  # type: ignore[return-value]

    @cached_property
    def elastic_period(self) -> float:
        """The period of the first natural frequency with all gaps closed, s; 0 where every joint is rigid.

        >>> round(Chain.load("crane-4-mass").elastic_period, 4)
        0.0548
        """
        from softstart.vibration import elastic_frequencies, with_gaps_closed

        arrays = self.at_motor_shaft()
        if arrays.rigid.all():
            return 0.0
        body = with_gaps_closed(arrays)
        return 2.0 * math.pi / float(elastic_frequencies(body.J, body.c)[0])

    @property
    def shaft_means(self) -> Vector:
        """The mean torque of each shaft under full starting torque, N m; NaN without a motor."""
        torque = math.nan if self.motor is None else self.motor.starting_torque
        return self.at_motor_shaft().mean_torques(torque)

    @property
    def contact_laws(self) -> tuple[str, ...]:
        """The contact law of each shaft."""
        return self.at_motor_shaft().law

    @property
    def frictions(self) -> tuple[float, float, float]:
        """Coulomb friction of the motor (none), and dampings to the ground of motor and load mass."""
        at = self.at_motor_shaft()
        return 0.0, float(at.d_ground[at.motor]), float(at.d_ground[at.load])

    @property
    def initial_motor_speed(self) -> float:
        """Speed of the motor's mass at the start, rad/s at the motor shaft."""
        return float(self.at_motor_shaft().w0[self.motor_index])

    @property
    def initial_load_speed(self) -> float:
        """Speed of the load mass at the start, rad/s at the motor shaft."""
        return float(self.at_motor_shaft().w0[self.load_index])

    @property
    def stiffnesses(self) -> Vector:
        """The stiffness of each shaft, N m/rad at the motor shaft; infinite of a rigid one."""
        return self.at_motor_shaft().c

    @property
    def dampings(self) -> Vector:
        """The damping of each shaft, N m s/rad at the motor shaft."""
        return self.at_motor_shaft().d

    @property
    def damping_ratio(self) -> float:
        """Share of the critical damping in the first natural vibration with all gaps closed.

        >>> round(Chain.load("crane-4-mass").with_damping_ratio(0.04).damping_ratio, 12)
        0.04
        """
        from softstart.vibration import natural_vibration

        first, at = natural_vibration(self), self.at_motor_shaft()
        x, twist = first.shape[1], first.torque[1] / at.c
        damping = at.d @ twist**2 + at.d_ground @ x**2
        return float(damping / (2.0 * first.Omega[1] * (at.moving_J @ x**2)))

    def with_damping_ratio(self, ratio: float) -> Self:
        """The chain with d = 2 ratio c/Omega in each elastic shaft without damping; Omega: first frequency.

        Where no shaft has a damping, `ratio` is that of the first natural vibration.
        """
        shafts = zip(self.shafts, self.dampings.tolist(), strict=True)
        rate = ratio * self.elastic_period / math.pi
        damped = [
            one if one.rigid or d > 0.0 else one.replace(damping=rate * one.stiffness, damping_ratio=None)
            for one, d in shafts
        ]
        return self.replace(shafts=tuple(damped))

    @property
    def permissible_torques(self) -> Vector:
        """What each shaft permits, N m at the motor shaft; NaN where nothing is given."""
        return self.at_motor_shaft().permissible

    @property
    def identity(self) -> dict[str, object]:
        """What a summary of a start says of the machine."""
        return {"chain": self.name, "assumed": self.assumed, "warnings": list(self.warnings)}

    def columns_of(self, states: Mapping[str, Vector]) -> dict[str, Vector]:
        """The states of a start under the headings of a table."""
        masses = [mass.name for mass in self.masses]
        columns = {"u [N*m]": states["u"]}
        for name, unit, parts in (
            ("phi", "rad", masses), ("w", "rad/s", masses), ("twist", "rad", self.shaft_names),
            ("torques", "N*m", self.shaft_names),
        ):  # fmt: skip
            values = states[name].reshape(states["u"].size, -1)
            columns |= {f"{name} {part} [{unit}]": values[:, i] for i, part in enumerate(parts)}
        return columns

    @property
    def freed(self) -> Self:
        """The chain without a mass that stays at rest, and its shaft."""
        kept = [i for i, mass in enumerate(self.masses) if not math.isinf(mass.inertia)]
        if len(kept) == len(self.masses):
            return self
        return self.replace(
            masses=tuple(self.masses[i] for i in kept),
            shafts=self.shafts[kept[0] : kept[-1]],
        )

    # ---- the chain changed ------------------------------------------------------------------------------

    @property
    def stiffness(self) -> float:
        """Stiffness of all shafts in series, N m/rad at the motor shaft; infinite where all are rigid."""
        compliance = float((1.0 / self.stiffnesses).sum())
        return 1.0 / compliance if compliance > 0.0 else math.inf

    @property
    def gap_and_inertia(self) -> tuple[float, float]:
        """All gaps together, rad at the motor shaft, and the inertia of the load mass, kg m2.

        >>> Chain.load("crane-4-mass").gap_and_inertia[1]
        69.2
        """
        return float(self.gaps.sum()), self.masses[self.load_index].inertia

    @property
    def motor_inertia_at_load(self) -> float:
        ratio = self.speed_ratios("motor")[self.load_index]
        return self.masses[self.motor_index].inertia / ratio**2

    def with_gap(self, gap: float) -> Self:
        """The chain with all gaps widened alike, so that they are `gap` together, rad at the motor shaft.

        >>> Chain.load("crane-4-mass").with_gap(1.0).shafts[1].gap
        0.4
        """
        whole = float(self.gaps.sum())
        if whole == 0.0 < gap:
            raise InputError(
                f"gap = {gap!r}: the chain has no gap that could be widened; give its shafts some."
            )
        return self.scaled(gaps=ratio_of(gap, whole))

    def with_gap_and_inertia(self, gap: float, inertia: float, origin: Self | None = None) -> Self:
        """The chain with another gap and load inertia, all gaps widened alike.

        A chain whose gaps are all closed has them as its `origin`.

        >>> Chain.load("crane-4-mass").with_gap_and_inertia(1.0, 70.0).masses[-1].inertia
        70.0
        """
        chain = self
        if not any(shaft.gap for shaft in self.shafts) and origin is not None:
            shafts = zip(self.shafts, origin.shafts, strict=True)
            chain = self.replace(shafts=tuple(one.replace(gap=first.gap) for one, first in shafts))
        chain = chain.with_gap(gap)
        return chain if inertia == self.gap_and_inertia[1] else chain.with_values({"load_inertia": inertia})

    def scaled(self, gaps: float = 1.0, load_inertia: float = 1.0) -> Self:
        """The chain with so many times its gaps, and its load mass with so many times its inertia.

        An angle in a gap keeps its share of it, one beyond a flank its overlap.

        >>> Chain.load("crane-4-mass").scaled(gaps=4.0).shafts[1].gap
        0.8
        """
        masses, load = list(self.masses), self.load_index
        masses[load] = masses[load].replace(inertia=load_inertia * masses[load].inertia)
        return self.replace(masses=tuple(masses), shafts=tuple(one.widened(gaps) for one in self.shafts))

    # ---- parameters by their keys ------------------------------------------------------------------------

    def parameter_keys(self) -> Iterator[str]:
        yield from (PARAMETERS[name].path for name in AGGREGATES)
        yield from (
            path for path in self.parameters_by_path() if path.startswith(("mass[", "shaft[", "motor."))
        )

    def parameter_value(self, key: str) -> ParameterValue | None:
        """The parameter that a key names, as in a file or in Python; None where there is none.

        Each mass and shaft has its own parameters. Beside them a chain has some of a drive: its gap is the
        sum of all gaps at the motor shaft, its stiffness that of all shafts in series, its load the load
        mass.

        >>> crane = Chain.load("crane-4-mass")
        >>> keys = ("shaft.gap", "shaft[rotor - pinion].gap", "mass[2].inertia")
        >>> [crane.parameter_value(key).name for key in keys]
        ['gap', 'shaft_1_gap', 'mass_2_inertia']
        >>> round(crane.parameter_value("gap").value, 9), crane.parameter_value("start.position").value
        (0.5, 'mid-gap')
        """
        name = BY_PATH.get(key, key)
        if (match := PART.fullmatch(key)) is not None:
            kind, place, number, word = match.groups()
            index, values = self._number(kind, place or number), self.parameters_by_path()
            path = f"{kind}[{index}].{word}"
            return ParameterValue(f"{kind}_{index}_{word}", *values[path]) if path in values else None
        if name in AGGREGATES:
            p = self.PARAMETERS["position"] if name == "start_position" else PARAMETERS[name]
            return ParameterValue(name, p, AGGREGATES[name].read(self))
        if self.motor is not None and name in self.motor.PARAMETERS and name != "mass":
            return ParameterValue(name, self.motor.PARAMETERS[name], getattr(self.motor, name))
        return None

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The chain with these values, by the keys or names of their parameters.

        >>> Chain.load("crane-4-mass").with_values({"gap": 1.0, "shaft[2].stiffness": 4e5}).shafts[2].gap
        0.02
        """
        chain, of_motor, wrong = self, {}, []
        for key, value in values.items():
            if (parameter := chain.parameter_value(key)) is None:
                wrong.append(chain.no_such(key, value))
            elif (match := PART.fullmatch(parameter.name)) is not None:
                kind, _, number, word = match.groups()
                chain = chain.with_part(kind, int(number) - 1, word, value)
            elif parameter.name in AGGREGATES:
                chain = AGGREGATES[parameter.name].changed(chain, value)
            else:
                of_motor[parameter.name] = value
        if wrong:
            raise InputError(wrong)
        if chain.motor is None or not of_motor:
            return chain
        return chain.replace(motor=chain.motor.replace(**of_motor))  # at once: one bounds the other

    def no_such(self, key: str, value: object) -> str:
        """The sentence on a key that names no parameter."""
        keys = list(self.parameter_keys())
        names = [p.name for path in keys if (p := self.parameter_value(path)) is not None]
        hint = did_you_mean(key, [*keys, *names], otherwise=f"its parameters are {', '.join(names)}.")
        return f"{key} = {show(value)}: a chain has no parameter {show(key)}; {hint}"

    def _number(self, kind: str, place: str) -> int:
        """The number of a mass or shaft, from 1, by that number or by its name; 0 where there is none."""
        names = self.mass_names if kind == "mass" else self.shaft_names
        if place in names:
            return names.index(place) + 1
        return int(place) if place.isdecimal() and int(place) <= len(names) else 0

    def with_part(self, kind: str, index: int, word: str, value: Any) -> Self:
        """The chain with another value of one mass or shaft; the gap as `Shaft.widened`."""
        parts: list[Any] = list(self.masses if kind == "mass" else self.shafts)
        if word == "gap" and parts[index].gap:
            parts[index] = parts[index].widened(ratio_of(value, parts[index].gap))
        else:
            more = INSTEAD.get(word, {}) if kind == "shaft" else {}
            parts[index] = parts[index].replace(**{word: value}, **more)
        changed: dict[str, Any] = {"masses" if kind == "mass" else "shafts": tuple(parts)}
        return self.replace(**changed)

    # ---- the chain at one shaft --------------------------------------------------------------------------

    def brought_to(self, reference: str | int = "motor") -> Self:
        """The same chain with every quantity at the shaft of one mass: all ratios are 1 then.

        With `i` the speed of a shaft over that of the reference: inertias, dampings and stiffnesses times
        `i^2`, torques times `i`, gaps, angles and speeds over `i`. Natural frequencies, energies and powers
        stay what they are. The motor's data and the target speed are at the motor's shaft before and after:
        a chain with a motor on another shaft than the reference loses it. Gears with losses stay where they
        are.

        >>> chain = Chain([Mass(1), Mass(4)], [Shaft(8, gap=0.1, ratio=2, side="after")])
        >>> there = chain.brought_to("mass 1")
        >>> there.masses[1].inertia, there.shafts[0].stiffness, there.shafts[0].gap
        (1.0, 2.0, 0.2)
        """
        at = arrays_at(self, self.index(reference))
        placed = self.position in ("mid-gap", "unknown")
        columns = zip(self.masses, at.J, at.d_ground, at.w0, at.speed_ratio.tolist(), strict=True)
        masses = [
            m.replace(
                inertia=float(J),
                damping=float(d),
                torque=m.torque * i,
                friction=m.friction * i,
                initial_speed=float(w0),
                **{
                    key: [x * (i if key == "curve_torque" else 1.0 / i) for x in vars(m)[key]]
                    for key in ("curve_speed", "curve_angle", "curve_torque")
                    if vars(m)[key] is not None
                },
            )
            for m, J, d, w0, i in columns
        ]
        rows = zip(self.shafts, at.c, at.d, at.gap, at.permissible, at.theta0, strict=True)
        shafts = [
            s.replace(
                stiffness=float(c),
                damping=float(d),
                damping_ratio=None,
                gap=float(gap),
                permissible_torque=None if math.isnan(most) else float(most),
                start_position=None if placed and s.start_position is None else float(theta0),
                ratio=1.0,
                side=s.side if s.efficiency < 1.0 else "before",
            )
            for s, c, d, gap, most, theta0 in rows
        ]
        motor_stays = at.speed_ratio[self.motor_index] == 1.0
        return self.replace(
            masses=tuple(masses),
            shafts=tuple(shafts),
            motor=self.motor if motor_stays else None,
            target_speed=self.target_speed if motor_stays else None,
            position=self.position if placed else "mid-gap",
        )

    def at_motor_shaft(self) -> ChainArrays:
        """The chain as arrays at the shaft of the motor's mass (of the first, where there is no motor).

        >>> Chain.load("crane-4-mass").at_motor_shaft().J.shape
        (4,)
        """
        return self._at_motor_shaft

    @cached_property
    def _at_motor_shaft(self) -> ChainArrays:
        return arrays_at(self, self.motor_index)


def _completed(given: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a chain with names of masses, mass of the motor, load mass and target speed."""
    masses = enumerate(given.get("masses", ()), start=1)
    named = tuple(mass if mass.name else mass.replace(name=f"mass {i}") for i, mass in masses)
    moving = [mass.name for mass in named if not math.isinf(mass.inertia)] or [
        mass.name for mass in named[:1]
    ]
    completed, motor = dict(given), given.get("motor")
    if moving:
        completed |= {"masses": named, "load_mass": given.get("load_mass") or moving[-1]}
        if motor is not None and not motor.mass:
            completed["motor"] = motor.replace(mass=moving[0])
    if motor is not None and given.get("target_speed") is None:
        completed["target_speed"] = motor.rated_speed
    return completed


def _without_defaults(table: DocumentTable, holder: ParameterSet) -> dict[str, object]:
    values, given = holder.values(), holder.given()
    return {
        p.name: values[p.name]
        for p in table.parameters
        if values[p.name] != p.default and (p.name in given or p.follows)
    }


class Aggregate(NamedTuple):
    """A quantity of the whole chain that a drive has as a parameter: how it is read, and set."""

    read: Callable[[Chain], Any]
    changed: Callable[[Any, Any], Any]


def _of_mass(place: str, word: str) -> Aggregate:
    """A quantity of the mass at the index that has this name."""
    return Aggregate(
        lambda chain: getattr(chain.masses[getattr(chain, place)], word),
        lambda chain, value: chain.with_part("mass", getattr(chain, place), word, value),
    )


def _own(word: str) -> Aggregate:
    return Aggregate(attrgetter(word), lambda chain, value: chain.replace(**{word: value}))


def _with_stiffness(chain: Chain, value: float) -> Chain:
    factor = ratio_of(value, chain.stiffness)
    shafts = (one if one.rigid else one.replace(stiffness=factor * one.stiffness) for one in chain.shafts)
    return chain.replace(shafts=tuple(shafts))


AGGREGATES: Mapping[str, Aggregate] = {
    "gap": Aggregate(lambda chain: chain.gap_and_inertia[0], Chain.with_gap),
    "stiffness": Aggregate(attrgetter("stiffness"), _with_stiffness),
    "motor_inertia": _of_mass("motor_index", "inertia"),
    "load_inertia": _of_mass("load_index", "inertia"),
    "load_torque": _of_mass("load_index", "torque"),
    "load_kind": _of_mass("load_index", "kind"),
    "target_speed": _own("target_speed"),
    "start_position": _own("position"),
}


def ratio_of(value: float, old: float) -> float:
    """By which factor a value changes: 1 where it stays within rounding, and twice is exactly twice."""
    if old == 0.0 or math.isclose(value, old, rel_tol=SAME):
        return 1.0
    return float(f"{value / old:.15g}")
