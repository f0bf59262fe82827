"""What of a machine, a drive or a chain, the page can change: its fields, its sliders, the map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.elements import Shaft
from softstart.chain.machines import Machine, varied
from softstart.chain.model import Chain, is_chain_text
from softstart.controller.base import Controller
from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError
from softstart.input.parameters import Parameter
from softstart.start.batch import prepared
from softstart.tuning.ranges import ranges_of, tunable

STEPS = 600
DIGITS = 4
NODE_DIGITS = 6  # of the gaps and inertias of a map
SAME = 12  # digits in which two places of a map are one
GAPS, INERTIAS = 25, 17  # of the map
MAP_EVENTS = 20_000  # of one start of a map; a cell beyond stays empty
ZETA = "\N{GREEK SMALL LETTER ZETA}"
MOST_DAMPING = 0.2  # damping ratio of a shaft, by its slider: geared trains have 0.01 to 0.06

HEAD = "Units"  # the group that stands in the head of the page
UNITS = ("deg, rpm", "rad, rad/s", "arcmin, rpm", "mm on 80 mm, rpm")
LIMITS = "Limits"  # the group that is folded where there are none

# by group: names of the parameters of a drive, and what stands before the field
GROUPS: Mapping[str, tuple[tuple[str, str], ...]] = {
    HEAD: (("units", "units"),),
    "Drive": (("name", "name"),),
    "Motor": (
        ("starting_torque", "starting torque"),
        ("motor_inertia", "inertia"),
        ("torque_lag", "torque lag"),
        ("maximum_torque", "largest torque"),
        ("minimum_torque", "braking torque"),
        ("torque_rate", "torque rate"),
        ("computing_delay", "dead time"),
        ("motor_friction", "friction"),
        ("motor_viscous_friction", "viscous friction"),
        ("encoder_lines", "encoder lines"),
        ("torque_noise", "torque noise"),
    ),
    "Shaft": (
        ("gap", "total gap"),
        ("stiffness", "stiffness"),
        ("damping", "damping"),
        ("contact_law", "contact law"),
    ),
    "Load": (
        ("load_inertia", "inertia"),
        ("load_torque", "torque"),
        ("load_kind", "kind"),
        ("load_viscous_friction", "viscous friction"),
    ),
    "Start": (
        ("target_speed", "target speed"),
        ("start_position", "position"),
        ("brake", "brake"),
        ("release", "release"),
        ("initial_load_speed", "speed before"),
    ),
    LIMITS: (
        ("permissible_torque", "shaft torque"),
        ("permissible_start_time", "start time"),
        ("starts_per_hour", "starts per hour"),
        ("required_life", "life"),
        ("fatigue_slope", "slope of S-N"),
        ("fatigue_torque", "S-N torque"),
        ("fatigue_cycles", "S-N cycles"),
    ),
}  # fmt: skip
SYMBOLS = {
    "starting_torque": "Ms",
    "motor_inertia": "J\N{SUBSCRIPT ONE}",
    "torque_lag": "\N{GREEK SMALL LETTER TAU}",
    "gap": "\N{GREEK SMALL LETTER DELTA}",
    "stiffness": "c",
    "damping": "d",
    "start_position": "\N{GREEK SMALL LETTER THETA}",
    "load_inertia": "J\N{SUBSCRIPT TWO}",
    "load_torque": "Mc",
    "target_speed": "\N{GREEK SMALL LETTER OMEGA}",
}


@dataclass(frozen=True)
class Entry:
    """One field of the page: what `--set` calls it, its parameter, its group, and what stands before it."""

    path: str
    parameter: Parameter
    group: str
    label: str
    symbol: str

    @property
    def suggestions(self) -> tuple[str, ...]:
        """Texts that a field of words offers."""
        return UNITS if self.path == "units" else ()


def entries(machine: Machine) -> Mapping[str, Entry]:
    """The fields of a machine by their paths, in their order on the page.

    >>> list(entries(Drive.load("crane-4amtkf")))[:3]
    ['units', 'name', 'motor.starting_torque']
    >>> entries(Chain.load("crane-4-mass"))["shaft[2].gap"].group
    'pinion - wheel shaft'
    """
    known = machine.by_path()
    rows = _rows_of_chain(machine) if isinstance(machine, Chain) else _rows_of_drive()
    made = (Entry(path, known[path][0], *words) for path, *words in rows if path in known)
    return MappingProxyType({one.path: one for one in made})


def _rows_of_drive() -> Iterator[tuple[str, str, str, str]]:
    """Path, group, label and symbol of each field of a drive."""
    for group, rows in GROUPS.items():
        for name, label in rows:
            yield PARAMETERS[name].path, group, label, SYMBOLS.get(name, "")


def _rows_of_chain(chain: Chain) -> Iterator[tuple[str, str, str, str]]:
    """The same of a chain: its motor, then masses and shafts in their order."""
    yield "units", HEAD, "units", ""
    yield "name", "Chain", "name", ""
    for name, label in GROUPS["Motor"]:
        yield f"motor.{name}", "Motor", label, SYMBOLS.get(name, "")
    for i, mass in enumerate(chain.masses):
        yield f"mass[{i + 1}].inertia", mass.name, "inertia", f"J{_below(i)}"
        if mass.torque or i == chain.load_index:
            yield f"mass[{i + 1}].torque", mass.name, "load torque", f"M{_below(i)}"
        if i < len(chain.shafts):
            yield from _rows_of_shaft(chain.shafts[i], i, chain.shaft_names[i])
    for name, label in (("target_speed", "target speed"), ("position", "position")):
        yield f"start.{name}", "Start", label, SYMBOLS.get(name, "")


def _rows_of_shaft(shaft: Shaft, index: int, group: str) -> Iterator[tuple[str, str, str, str]]:
    where = f"shaft[{index + 1}]"
    yield f"{where}.gap", group, "total gap", f"{SYMBOLS['gap']}{_below(index)}"
    if not shaft.rigid:
        yield f"{where}.stiffness", group, "stiffness", f"c{_below(index)}"
        if shaft.damping > 0.0:
            yield f"{where}.damping", group, "damping", f"d{_below(index)}"
        else:
            yield f"{where}.damping_ratio", group, "damping ratio", f"{ZETA}{_below(index)}"
    yield f"{where}.permissible_torque", group, "permissible", ""


def _below(index: int) -> str:
    """The number of a mass or shaft as a subscript."""
    return "".join(chr(ord("\N{SUBSCRIPT ZERO}") + int(digit)) for digit in str(index + 1))


def changed(machine: Machine, settings: Mapping[str, str]) -> Machine:
    """The machine with changes as typed, by the paths of their parameters.

    >>> changed(Chain.load("crane-4-mass"), {"shaft[1].gap": "2 deg"}).shafts[0].gap
    0.03490...
    """
    if isinstance(machine, Chain):
        return Chain.from_toml(machine.to_toml(), also=settings)
    return machine.with_settings(f"{path}={text}" for path, text in settings.items())


def without(machine: Machine, path: str) -> Machine:
    """The machine without a value that it need not have: a limit, or what follows another parameter then.

    >>> drive = Drive.load("crane-4amtkf").with_settings(["limits.shaft_torque=70"])
    >>> print(without(drive, "limits.shaft_torque").limits.shaft_torque)
    None
    """
    knob = machine.knob(path)
    assert knob is not None
    return machine.with_values({knob.name: None})


def machine_from(text: str, where: str = "") -> Machine:
    """The drive or the chain of a TOML text; a chain has tables [[mass]]."""
    return (Chain if is_chain_text(text) else Drive).from_toml(text, where=where)


def single(machine: Machine) -> Machine:
    """The machine if the page can start it; InputError if nothing moves it."""
    if machine.motor is None:
        raise InputError("[motor] is missing: the page starts the chain by its motor; add it to the file.")
    if machine.target_speed is None:
        raise InputError(
            "[start] target_speed is missing: it ends the start; add it, or the rated_speed of the motor."
        )
    return machine


def rounded(value: float, digits: int = DIGITS) -> float:
    """A value with so many significant digits, so that the field shows what is computed with.

    >>> rounded(0.123456), rounded(0.0)
    (0.1235, 0.0)
    """
    return float(f"{value:.{digits}g}")


@dataclass(frozen=True)
class Scale:
    """A slider from `low` to `high`, even in the value or in its logarithm.

    >>> scale = Scale(0.0, 2.0)
    >>> scale.value(150), scale.position(0.5)
    (0.5, 150)
    """

    low: float
    high: float
    logarithmic: bool = False

    def value(self, position: float) -> float:
        """The value at a position from 0 to STEPS."""
        share = min(max(position / STEPS, 0.0), 1.0)
        if share in (0.0, 1.0):
            return self.high if share else self.low
        if self.logarithmic:
            return rounded(self.low * (self.high / self.low) ** share)
        return rounded(self.low + (self.high - self.low) * share)

    def position(self, value: float) -> int:
        """The position nearest to a value; beyond the ends it is the end."""
        if self.logarithmic:
            share = math.log(value / self.low) / math.log(self.high / self.low) if value > 0.0 else 0.0
        else:
            share = (value - self.low) / (self.high - self.low)
        return round(STEPS * min(max(share, 0.0), 1.0))


def scales_about(origin: Machine) -> Mapping[str, Scale]:
    """The sliders of the main parameters, about the machine as it was loaded; by path of the parameter.

    >>> scales_about(Drive.load("crane-4amtkf"))["shaft.gap"]
    Scale(low=0.0, high=2.0, logarithmic=False)
    >>> scales_about(Chain.load("crane-4-mass"))["shaft[1].gap"]
    Scale(low=0.0, high=0.4, logarithmic=False)
    """
    motor: Any = origin.motor
    Ms, highest, target = (
        float(motor.starting_torque),
        float(motor.maximum_torque),
        float(origin.target_speed or 1.0),
    )
    weakest = rounded(min(max(1.1 * origin.lumped.Mc, 0.1 * Ms), 0.9 * Ms), 2)
    found = {
        "motor.starting_torque": Scale(weakest, max(highest, Ms)),
        "motor.torque_lag": Scale(0.0, rounded(max(0.02, 4.0 * float(motor.torque_lag)), 2)),
        "start.target_speed": Scale(rounded(0.2 * target), rounded(2.0 * target)),
    }
    if isinstance(origin, Chain):
        ratios = origin.speed_ratios()
        for i, mass in enumerate(origin.masses):
            found[f"mass[{i + 1}].inertia"] = _about(mass.inertia)
        load = origin.load_index
        found[f"mass[{load + 1}].torque"] = _torques(origin.masses[load].torque, Ms / ratios[load])
        for i, shaft in enumerate(origin.shafts, 1):
            at = ratios[i - 1 if shaft.side == "before" else i]
            found[f"shaft[{i}].gap"] = _gaps(shaft.gap, 0.1 / at)
            if not shaft.rigid:
                found[f"shaft[{i}].stiffness"] = _about(shaft.stiffness)
                if shaft.damping > 0.0:
                    found[f"shaft[{i}].damping"] = Scale(0.0, rounded(5.0 * shaft.damping))
                else:
                    most = max(MOST_DAMPING, 2.0 * (shaft.damping_ratio or 0.0))
                    found[f"shaft[{i}].damping_ratio"] = Scale(0.0, most)
        return MappingProxyType(found)
    J1, J2, c, d = float(origin.J1), float(origin.J2), float(origin.c), float(origin.d)
    critical = 2.0 * math.sqrt(c * J1 * J2 / (J1 + J2))
    return MappingProxyType(
        found
        | {
            "motor.inertia": _about(J1),
            "shaft.stiffness": _about(c),
            "shaft.damping": Scale(0.0, rounded(max(0.3 * critical, 2.0 * d), 2)),
            "shaft.gap": _gaps(float(origin.gap), 0.1),
            "load.inertia": _about(J2),
            "load.torque": _torques(float(origin.Mc), Ms),
        }
    )


def _about(value: float) -> Scale:
    return Scale(rounded(value / 5.0), rounded(value * 5.0), logarithmic=True)


def _gaps(gap: float, otherwise: float) -> Scale:
    return Scale(0.0, 4.0 * gap if gap > 0.0 else otherwise)


def _torques(torque: float, motor: float) -> Scale:
    """Load torques up to nearly what the motor gives there."""
    return Scale(min(0.0, 2.0 * torque), rounded(max(0.95 * motor, 0.95 * abs(torque)), 3))


def scales_of(controller: Controller, origin: Machine) -> Mapping[str, Scale]:
    """Sliders of a strategy's parameters, as far as tuning would go, about the drive as it was loaded.

    >>> from softstart.controller import make_controller
    >>> scales_of(make_controller("s-curve"), Drive.load("crane-4amtkf"))["rounding"]
    Scale(low=0.0, high=1.0, logarithmic=False)
    """
    found = {}
    default = controller.defaults(origin.design_drive)
    names = tunable(controller)
    for one in ranges_of(controller, names) if names else ():
        low, high = (rounded(float(end)) for end in one.ends(default.get(one.name, 1.0)))
        if low < high:
            found[one.name] = Scale(low, high, one.logarithmic and low > 0.0)
    return MappingProxyType(found)


@dataclass(frozen=True)
class Axes:
    """The gaps (rad) and load inertias (kg m2) of a map, ascending."""

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]

    def nearest(self, gap: float, inertia: float) -> tuple[int, int]:
        """Indices of the cell in which a drive lies: the gap's scale is even, the inertia's logarithmic."""
        column = int(np.argmin(np.abs(np.array(self.gaps) - gap)))
        row = int(np.argmin(np.abs(np.log(np.array(self.inertias) / inertia))))
        return column, row


def axes_about(origin: Machine, gaps: int = GAPS, inertias: int = INERTIAS) -> Axes | None:
    """Gaps up to four times that of the machine as loaded, inertias from a fifth to five times its own.

    Of a chain: the sum of its gaps at the motor shaft, all widened alike, and the inertia of its load mass.
    None where no gap can be widened.

    >>> axes = axes_about(Drive.load("crane-4amtkf"), 5, 3)
    >>> axes.gaps, axes.inertias
    ((0.0, 0.5, 1.0, 1.5, 2.0), (0.035, 0.175, 0.875))
    """
    gap, inertia = origin.gap_and_inertia
    widest = 4.0 * gap if gap > 0.0 else 0.1
    try:
        origin.moved(widest, inertia)
    except InputError:
        return None
    return Axes(
        tuple(rounded(v, NODE_DIGITS) for v in np.linspace(0.0, widest, gaps)),
        tuple(rounded(v, NODE_DIGITS) for v in np.geomspace(inertia / 5.0, inertia * 5.0, inertias)),
    )


def map_words(machine: Machine) -> tuple[tuple[str, str], tuple[str, str]]:
    """Symbols and names of the two axes of a map, gap and load inertia.

    >>> map_words(Chain.load("crane-4-mass"))[1]
    ('all gaps, at the motor shaft', 'inertia of crane')
    """
    gap = SYMBOLS["gap"]
    if len(machine.shaft_names) > 1:
        symbols = f"\N{N-ARY SUMMATION}{gap}", f"J{_below(machine.load_index)}"
        return symbols, (
            "all gaps, at the motor shaft",
            f"inertia of {machine.mass_names[machine.load_index]}",
        )
    return (gap, SYMBOLS["load_inertia"]), (f"gap {gap}", SYMBOLS["load_inertia"])


def placeless(machine: Machine, axes: Axes, origin: Machine) -> Machine:
    """What a map depends on: the machine at one place of it, wherever in the map it stands.

    >>> chain = Chain.load("crane-4-mass")
    >>> axes = axes_about(chain)
    >>> placeless(chain.moved(0.3, 30.0), axes, chain) == placeless(chain, axes, chain)
    True
    """
    there = machine.moved(axes.gaps[-1], axes.inertias[0], origin)
    if not isinstance(there, Chain):
        return there
    load = there.load_index
    masses = (
        one.replace(inertia=rounded(one.inertia, SAME)) if i == load else one
        for i, one in enumerate(there.masses)
    )
    shafts = (one.replace(gap=rounded(one.gap, SAME)) for one in there.shafts)
    return replace(there, masses=tuple(masses), shafts=tuple(shafts))


def k_dyn_row(
    machine: Machine,
    controller: Controller,
    gaps: tuple[float, ...],
    inertia: float,
    nominal: Machine | None = None,
    origin: Machine | None = None,
) -> Vector:
    """K_dyn at one load inertia over the gaps; NaN where a start fails or is refused.

    The controller is set up for each machine, or for `nominal`, to whose mean torque K_dyn then refers. These
    are the figures of `softstart.simulate`, to the bit.
    """
    try:
        opened = machine.moved(max(gaps), inertia, origin) if machine.gap_and_inertia[0] == 0.0 else machine
        machines = varied(opened, {"gap": list(gaps), "load_inertia": inertia})
        starts, set_ups = prepared(machines, None, MAP_EVENTS), controller.set_ups(nominal or machines)
        k: Vector = starts.figures(set_ups, (nominal or machines).mean_torque)["k_dyn"][0]
        return k
    except InputError:
        if len(gaps) == 1:
            return np.array([math.nan])
    return np.concatenate([k_dyn_row(machine, controller, (gap,), inertia, nominal, origin) for gap in gaps])


def bases(machine: Machine, inertias: tuple[float, ...]) -> Vector:
    """The mean torques to which K_dyn refers along the inertias of a map, N m."""
    gap = machine.gap_and_inertia[0]
    return np.array([machine.moved(gap, inertia).mean_torque for inertia in inertias])
