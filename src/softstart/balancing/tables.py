"""The tables of an engine file: which keys there are, in which units, and what they mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softstart.errors import InputError
from softstart.input.documents import Table
from softstart.input.files import Library
from softstart.input.parameters import Parameter
from softstart.quantities import nearest, show

LIBRARY = Library("softstart.balancing", "an engine", "engines")

TOP = Table(
    "",
    (
        Parameter("name", "", "name of the engine", '"my engine"', default="unnamed engine"),
        Parameter("source", "", "source of the numbers", '"data sheet"', default=""),
        Parameter(
            "assumed", "", "keys whose values are assumed, with commas between",
            '"cylinders.rod_length, masses.*"', default="",
        ),
    ),
)  # fmt: skip

CYLINDERS = Table(
    "cylinders",
    (
        Parameter("bore", "m", "bore", '"82 mm"', "above 0"),
        Parameter("stroke", "m", "stroke", '"71 mm"', "above 0"),
        Parameter("rod_length", "m", "length of the connecting rod", '"121 mm"', "above 0"),
        Parameter(
            "spacing", "m", "distance between neighbouring cylinders", '"89 mm"', "0 or more", default=0.0,
        ),
        Parameter(
            "firing_angles", "rad", "crank angles of the firing dead centres, cylinder by cylinder",
            '["0 deg", "360 deg"]', default=None, many=True,
        ),
        Parameter(
            "firing_order", "1", "order in which the cylinders fire, evenly over two turns", "[1, 3, 4, 2]",
            default=None, many=True,
        ),
    ),
)  # fmt: skip

MASSES = Table(
    "masses",
    (
        Parameter("reciprocating", "kg", "reciprocating mass of one cylinder", '"0.68 kg"', "above 0"),
        Parameter(
            "rotating", "kg", "rotating mass of one throw, at the crank pin", '"0.5 kg"', "0 or more",
            default=0.0,
        ),
        Parameter(
            "inertia", "kg*m^2", "inertia of crank and flywheel", '"0.12 kg*m^2"', "above 0", default=None,
        ),
    ),
)  # fmt: skip

COUNTERWEIGHTS = Table(
    "counterweights",
    (
        Parameter(
            "reciprocating_share", "1", "share of the reciprocating masses balanced on the crank", "0.5",
            "from 0 to 1", default=0.0,
        ),
        Parameter(
            "rotating_share", "1", "share of the rotating masses balanced on the crank", "1", "from 0 to 1",
            default=1.0,
        ),
    ),
)  # fmt: skip

CYCLE = Table(
    "cycle",
    (
        Parameter("compression_ratio", "1", "compression ratio", "9.9", "above 0"),
        Parameter(
            "mean_indicated_pressure", "Pa", "mean indicated pressure at full load, one or one a speed",
            '"10 bar"', "above 0", many=True,
        ),
        Parameter(
            "speeds", "rad/s", "speeds of these pressures", '["1000 rpm", "5600 rpm"]', "above 0",
            default=None, many=True,
        ),
        Parameter(
            "intake_pressure", "Pa", "pressure during intake at full load", '"0.9 bar"', "above 0",
            default=0.9e5,
        ),
        Parameter(
            "idle_pressure", "Pa", "pressure during intake at load 0", '"0.3 bar"', "above 0", default=0.3e5,
        ),
        Parameter("exhaust_pressure", "Pa", "pressure during exhaust", '"1.1 bar"', "above 0", default=1.1e5),
        Parameter(
            "crankcase_pressure", "Pa", "pressure below the pistons", '"1 bar"', "above 0", default=1e5,
        ),
        Parameter(
            "compression_exponent", "1", "polytropic exponent of the compression", "1.32", default=1.32,
        ),
        Parameter("expansion_exponent", "1", "polytropic exponent of the expansion", "1.27", default=1.27),
        Parameter(
            "combustion_start", "rad", "crank angle before dead centre at which combustion begins",
            '"15 deg"', "0 or more", default=0.2617993877991494,
        ),
        Parameter(
            "combustion_duration", "rad", "duration of the combustion", '"55 deg"', "above 0",
            default=0.9599310885968813,
        ),
        Parameter("vibe_exponent", "1", "shape exponent m of Vibe's law", "2", "above 0", default=2.0),
        Parameter(
            "exhaust_opening", "rad", "crank angle after dead centre at which the exhaust opens",
            '"130 deg"', "above 0", default=2.2689280275926285,
        ),
        Parameter(
            "blowdown", "rad", "duration of the fall to the exhaust pressure", '"70 deg"', "0 or more",
            default=1.2217304763960306,
        ),
    ),
    required=False,
)  # fmt: skip

INDICATOR = Table(
    "indicator",
    (
        Parameter("file", "", "CSV file of crank angle and pressure", '"indicator.csv"'),
        Parameter(
            "crankcase_pressure", "Pa", "pressure below the pistons", '"1 bar"', "above 0", default=1e5,
        ),
    ),
    required=False,
)  # fmt: skip

OPERATION = Table(
    "operation",
    (
        Parameter("lowest_speed", "rad/s", "lowest speed", '"850 rpm"', "above 0"),
        Parameter("highest_speed", "rad/s", "highest speed", '"5600 rpm"', "above 0"),
        Parameter("load", "1", "load", "1", "from 0 to 1", default=1.0),
    ),
)  # fmt: skip

BALANCER = Table(
    "balancer",
    (
        Parameter("tuning_speed", "rad/s", "tuning speed", '"4500 rpm"', "above 0"),
        Parameter("spacing", "m", "distance between the two shafts", '"160 mm"', "0 or more", default=0.0),
    ),
    required=False,
)  # fmt: skip

SHAFT = Table(
    "shaft",
    (
        Parameter("imbalance", "kg*m", "imbalance, mass times radius", '"0.02 kg*m"', "above 0"),
        Parameter("ratio", "1", "speed over that of the crank, negative if opposite", "-1"),
        Parameter("phase", "rad", "angle of its mass at crank angle 0", '"180 deg"', default=0.0),
        Parameter("height", "m", "height of the shaft above the crank", '"30 mm"', default=0.0),
        Parameter("offset", "m", "sideways offset of the shaft from the crank", '"80 mm"', default=0.0),
        Parameter("along", "m", "place of its mass along the crank, from the middle", '"0 mm"', default=0.0),
    ),
    many=True,
)  # fmt: skip

TABLES = (TOP, CYLINDERS, MASSES, COUNTERWEIGHTS, CYCLE, INDICATOR, OPERATION, BALANCER, SHAFT)


def assumed_keys(text: str, changed: Mapping[str, object], found: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys named in a text as "masses.*, cycle.speeds", but those `changed` by the user.

    A star stands for all keys of a table that are there in `found`.

    >>> assumed_keys("masses.*", {"masses.rotating": 1}, {"masses": {"reciprocating": 1, "rotating": 2}})
    ('masses.reciprocating',)
    >>> assumed_keys("mases.*", {}, {})
    Traceback (most recent call last):
    softstart.errors.InputError: assumed = "mases.*": an engine file has no such key; did you mean masses.*?
    """
    known = [p.path for table in TABLES for p in table.parameters if table.name]
    stars = [f"{table.name}.*" for table in TABLES if table.name]
    named: dict[str, None] = {}
    wrong = []
    for name in (one.strip() for one in text.split(",")):
        if not name:
            continue
        if name in stars:
            values = found.get(name[:-2])
            here = values if isinstance(values, Mapping) else {}
            named |= {f"{name[:-1]}{key}": None for key, value in here.items() if value is not None}
        elif name in known:
            named[name] = None
        else:
            meant = nearest(name, [*stars, *known])
            hint = f"did you mean {meant}?" if meant else "write masses.rotating, or masses.* for all."
            wrong.append(f"assumed = {show(name)}: an engine file has no such key; {hint}")
    if wrong:
        raise InputError(wrong)
    return tuple(name for name in named if name not in changed)
