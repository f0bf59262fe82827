"""What of a machine, a drive or a chain, the page can change: its fields, its sliders, the map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.chain.machines import Values, is_chain_text, varied
from softstart.chain.model import Chain
from softstart.controller.base import Controller
from softstart.controller.parameters import ControllerParameter, declared_parameters
from softstart.controller.tuned import Tuned
from softstart.drive import Drive
from softstart.drive.machine import Machine, TwoMasses
from softstart.errors import InputError
from softstart.page.sentences import WORDS
from softstart.quantities import Units
from softstart.start.batch import prepared
from softstart.tuning.ranges import ranges_of, tunable_parameters

STEPS = 600
DIGITS = 4
NODE_DIGITS = 6  # of the gaps and inertias of a map
SAME = 12  # digits in which two places of a map are one
GAPS, INERTIAS = 25, 17  # of the map
MAP_EVENTS = 20_000  # of one start of a map; a cell beyond stays empty
MOST_DAMPING = 0.2  # damping ratio of a shaft, by its slider: geared trains have 0.01 to 0.06
STRATEGY = "strategy."  # before the names of the parameters of the selected strategy
NAME = STRATEGY + "name"  # which is no parameter of any controller
DELTA = "\N{GREEK SMALL LETTER DELTA}"

HEAD = "Units"  # the group that stands in the head of the page
UNITS = ("deg, rpm", "rad, rad/s", "arcmin, rpm", "mm on 80 mm, rpm")
LIMITS, GEAR, BRAKE, MORE = (
    "Limits",
    "Gear",
    "Brake",
    "more parameters",
)  # groups that are folded where they are empty
# by table of a machine: its fields in their order; of a chain, a mass and a shaft take turns
FIELDS: Mapping[str, str] = {
    "": "units name",
    "motor": "starting_torque inertia torque_lag maximum_torque minimum_torque torque_rate computing_delay "
    "friction viscous_friction encoder_lines torque_noise",
    "mass": "inertia torque friction",
    "shaft": "gap stiffness damping damping_ratio contact_law permissible_torque",
    "load": "inertia torque kind friction viscous_friction",
    "start": "target_speed position brake release initial_load_speed",
    "brake": "torque closing_delay opening_delay",
    "gear": "ratio efficiency",
    "limits": "shaft_torque output_torque start_time starts_per_hour life fatigue.slope fatigue.torque "
    "fatigue.cycles",
}
SYMBOLS = {
    "motor.starting_torque": "Ms", "motor.inertia": "J1", "motor.torque_lag": "\N{GREEK SMALL LETTER TAU}",
    "mass.inertia": "J", "mass.torque": "M", "load.inertia": "J2", "load.torque": "Mc",
    "shaft.gap": DELTA, "shaft.stiffness": "c", "shaft.damping": "d",
    "shaft.damping_ratio": "\N{GREEK SMALL LETTER ZETA}",
    "start.target_speed": "\N{GREEK SMALL LETTER OMEGA}", "start.position": "\N{GREEK SMALL LETTER THETA}",
}  # fmt: skip
BELOW = {ord(str(digit)): chr(ord("\N{SUBSCRIPT ZERO}") + digit) for digit in range(10)}


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


@dataclass(frozen=True)
class FormField:
    """One field of the page: what `--set` calls it, its group, what stands before it, its unit in SI.

    `choices` are all that it takes, `words` what it offers beside numbers. `optional`: an empty field takes
    the value back. `scale` is that of its slider, if it has one, `at_output` as `Parameter` has it.
    """

    path: str
    group: str
    label: str
    symbol: str
    unit: str
    meaning: str
    example: str
    choices: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    optional: bool = False
    scale: Scale | None = None
    at_output: str = ""

    def seen(self, units: Units) -> Units:
        """The units in which this field is seen: at the output only what may be written there.

        >>> fields = parameter_fields(Drive.load("crane-4amtkf"))
        >>> from softstart.input.gear import Gear
        >>> units = Units.read("rad, at output", gear=Gear(40.0, 0.8))
        >>> for path in ("load.torque", "limits.shaft_torque", "motor.starting_torque"):
        ...     print(fields[path].seen(units).shown(50.0, "N*m"))
        1600.0
        1600.0
        50.0
        """
        return units if self.at_output == "value" else units.at_motor


def parameter_fields(machine: Machine) -> Mapping[str, FormField]:
    """The fields of a drive or chain by their paths, in their order on the page.

    >>> list(parameter_fields(Drive.load("crane-4amtkf")))[:3]
    ['units', 'name', 'motor.starting_torque']
    >>> gap = parameter_fields(Chain.load("crane-4-mass"))["shaft[2].gap"]
    >>> gap.group, gap.symbol, gap.scale
    ('pinion - wheel shaft', '\N{GREEK SMALL LETTER DELTA}\N{SUBSCRIPT TWO}', Scale(low=0.0, high=0.8, ...))
    """
    values, model, entries = machine.parameters_by_path(), machine.lever_rule_model, {}
    for place, table, k in _places(machine):
        for key in FIELDS[table].split():
            path, word = f"{place}.{key}".lstrip("."), f"{table}.{key}".lstrip(".")
            if path not in values or (k and not _has_field(place, key, values, k == machine.load_index + 1)):
                continue
            parameter, value = values[path]
            group = table.capitalize() or (HEAD if key == "units" else type(machine).__name__)
            if k:
                group = (machine.mass_names if table == "mass" else machine.shaft_names)[k - 1]
            symbol = SYMBOLS.get(word, "")
            choices, si, example = parameter.choices, parameter.unit, parameter.example
            words = UNITS if path == "units" else choices if si else ()
            entries[path] = FormField(
                path, group, parameter.label,
                f"{symbol}{k if k and symbol else ''}".translate(BELOW), si,
                f"{parameter.meaning}; write for example {', '.join([*words, example])}", example,
                () if si else choices, words, parameter.default is None and key != "gap",
                _scale(word, value, machine, model, k), parameter.at_output,
            )  # fmt: skip
    return entries


def _places(machine: Machine) -> list[tuple[str, str, int]]:
    """The tables of a machine in their order; of a chain its masses and shafts with their numbers."""
    numbers = range(1, len(machine.mass_names) + 1) if isinstance(machine, Chain) else ()
    parts = [(f"{table}[{k}]", table, k) for k in numbers for table in ("mass", "shaft")]
    plain = [
        (table, table, 0) for table in FIELDS if table not in (("mass", "shaft") if parts else ("mass",))
    ]
    return [*plain[:2], *parts, *plain[2:]]


def _has_field(place: str, key: str, values: Values, load: bool) -> bool:
    """Whether a value of a mass or shaft has a field: not what a rigid shaft lacks; damping in one way."""
    if key in ("stiffness", "damping", "damping_ratio"):
        other = "damping_ratio" if values[f"{place}.damping"][1] else "damping"
        return key != other and not math.isinf(values[f"{place}.stiffness"][1])
    return key != "contact_law" and (key != "torque" or load or bool(values[f"{place}.torque"][1]))


def _scale(word: str, value: Any, origin: Machine, model: TwoMasses, k: int) -> Scale | None:
    """The slider of a main parameter, about the machine as it was loaded; `k` numbers a part of a chain."""
    drive: Any = origin.motor
    motor, ratio = float(drive.starting_torque), 1.0
    if isinstance(origin, Chain) and k:  # speed of the part over that of the motor
        after = word.startswith("shaft") and origin.shafts[k - 1].side == "after"
        ratio = origin.speed_ratios()[k - (not after)]
    match word.split("."):
        case ["motor", "starting_torque"]:
            weakest = rounded(min(max(1.1 * model.Mc, 0.1 * motor), 0.9 * motor), 2)
            return Scale(weakest, max(float(drive.maximum_torque), motor))
        case ["motor", "torque_lag"]:
            return Scale(0.0, rounded(max(0.02, 4.0 * value), 2))
        case ["start", "target_speed"]:
            return Scale(rounded(0.2 * value), rounded(2.0 * value))
        case [_, "inertia" | "stiffness"]:
            return Scale(rounded(value / 5.0), rounded(value * 5.0), logarithmic=True)
        case ["shaft", "gap"]:
            return Scale(0.0, 4.0 * value or 0.1 / ratio)
        case ["shaft", "damping"]:
            if k:
                return Scale(0.0, rounded(5.0 * value))
            critical = 2.0 * math.sqrt(model.c * model.J1 * model.J2 / (model.J1 + model.J2))
            return Scale(0.0, rounded(max(0.3 * critical, 2.0 * value), 2))
        case ["shaft", "damping_ratio"]:
            return Scale(0.0, max(MOST_DAMPING, 2.0 * (value or 0.0)))
        case ["load" | "mass", "torque"]:  # up to nearly what the motor gives there
            return Scale(min(0.0, 2.0 * value), rounded(max(0.95 * motor / ratio, 0.95 * abs(value)), 3))
    return None


def page_parameters(controller: Controller) -> list[ControllerParameter]:
    """The parameters that the page can change: quantities, and texts with a choice.

    None of tuned gains and profiles, which come from files.

    >>> from softstart.controller import make_controller
    >>> [one.name for one in page_parameters(make_controller("ramp"))]
    ['initial', 'time', 'full_torque', 'period']
    """
    declared = {} if isinstance(controller, Tuned) else declared_parameters(controller)
    return [
        parameter for parameter in declared.values()
        if parameter.declared and (parameter.choices or parameter.unit)
    ]  # fmt: skip


def strategy_entries(
    controller: Controller, origin: Machine, label: str, own: bool = False
) -> Mapping[str, FormField]:
    """The fields of a strategy, those without a slider or choice last; sliders go as far as tuning would.

    One of the user's `own` has a name that can be changed.

    >>> from softstart.controller import make_controller
    >>> entries = strategy_entries(make_controller("s-curve"), Drive.load("crane-4amtkf"), "s-curve")
    >>> entries["strategy.rounding"].scale
    Scale(low=0.0, high=1.0, logarithmic=False)
    """
    parameters = page_parameters(controller)
    default = controller.defaults(origin.design_drive) if parameters else {}
    tunable = tunable_parameters(controller)
    scales = {}
    for search in ranges_of(controller, tunable) if parameters and tunable else ():
        low, high = (rounded(float(end)) for end in search.ends(default.get(search.name, 1.0)))
        if low < high:
            scales[search.name] = Scale(low, high, search.logarithmic and low > 0.0)
    main = {p.name for p in parameters if p.name in scales or p.choices} or {p.name for p in parameters}
    title, meaning = f"parameters of {label}", "name of the strategy; write for example slow ramp"
    name = FormField(NAME, title, "name", "", "", meaning, "slow ramp")
    return ({NAME: name} if own else {}) | {
        STRATEGY + p.name: FormField(
            STRATEGY + p.name, title if p.name in main else MORE,
            p.name.replace("_", " "), "", p.unit, f"{p.meaning}; default: {p.default_text or 'fixed'}",
            "a value, or nothing for the default", p.choices, (), True, scales.get(p.name),
        )
        for p in sorted(parameters, key=lambda p: p.name not in main)
    }  # fmt: skip


def with_typed_changes(machine: Machine, settings: Mapping[str, str]) -> Machine:
    """The machine with changes as typed, by the paths of their parameters.

    >>> with_typed_changes(Chain.load("crane-4-mass"), {"shaft[1].gap": "2 deg"}).shafts[0].gap
    0.03490...
    """
    if isinstance(machine, Drive):
        return machine.with_settings(f"{path}={text}" for path, text in settings.items())
    return Chain.from_toml(machine.to_toml(), also=settings)


def without(machine: Machine, path: str) -> Machine:
    """The machine without a value that it need not have: a limit, or what follows another parameter then.

    >>> drive = Drive.load("crane-4amtkf").with_settings(["limits.shaft_torque=70"])
    >>> print(without(drive, "limits.shaft_torque").limits.shaft_torque)
    None
    """
    assert isinstance(machine, Drive | Chain)
    own = {p.path: p.name for p in machine.PARAMETERS.values()}
    if path in own:
        return machine.replace(**{own[path]: None})
    parameter = machine.parameter_value(path)  # of a part of a chain
    assert parameter is not None
    return machine.with_values({parameter.name: None})


def machine_from(text: str, where: str = "") -> Machine:
    """The drive or the chain of a TOML text; a chain has tables [[mass]]."""
    return (Chain if is_chain_text(text) else Drive).from_toml(text, where=where)


def startable(machine: Machine) -> Machine:
    """The machine if the page can start it; InputError if nothing moves it."""
    if machine.motor is None:
        raise InputError("[motor] is missing: the page starts the chain by its motor; add it to the file.")
    if machine.target_speed is None:
        raise InputError(
            "[start] target_speed is missing: it ends the start; add it, or the rated_speed of the motor."
        )
    return machine


class Axes(NamedTuple):
    """The gaps (rad) and load inertias (kg m2) of a map, ascending."""

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]


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
        origin.with_gap_and_inertia(widest, inertia)
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
    inertia = f"J{machine.load_index + 1}".translate(BELOW)
    if len(machine.shaft_names) == 1:
        return (DELTA, inertia), (f"gap {DELTA}", inertia)
    load = machine.mass_names[machine.load_index]
    return (f"\N{N-ARY SUMMATION}{DELTA}", inertia), ("all gaps, at the motor shaft", f"inertia of {load}")


def placeless(machine: Machine, axes: Axes, origin: Machine) -> tuple[Any, ...]:
    """What a map depends on: the values of the machine at one place of it, wherever in it the machine stands.

    Not its name and its units, which change no result.

    >>> chain = Chain.load("crane-4-mass")
    >>> axes = axes_about(chain)
    >>> placeless(chain.with_gap_and_inertia(0.3, 30.0), axes, chain) == placeless(chain, axes, chain)
    True
    """
    moved = machine.with_gap_and_inertia(axes.gaps[-1], axes.inertias[0], origin).parameters_by_path()
    values = [value for parameter, value in moved.values() if parameter.name not in WORDS]
    return tuple(rounded(value, SAME) if isinstance(value, float) else value for value in values)


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
        opened = (
            machine.with_gap_and_inertia(max(gaps), inertia, origin)
            if machine.gap_and_inertia[0] == 0.0
            else machine
        )
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
    return np.array([machine.with_gap_and_inertia(gap, inertia).mean_torque for inertia in inertias])
