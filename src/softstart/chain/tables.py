"""The tables of a chain file: which keys there are, in which units, and what they mean."""

from __future__ import annotations

from typing import get_args

from softstart.drive import PARAMETERS, ContactLaw, LoadKind
from softstart.input.documents import Table
from softstart.input.files import Library
from softstart.input.parameters import Parameter

__all__ = ["LIBRARY", "MASS", "MOTOR", "SHAFT", "START", "TABLES", "TOP"]

LIBRARY = Library("softstart.chain", "a chain", "chains")

TOP = Table(
    "",
    (
        Parameter("name", "", "name of the chain", '"my chain"', default="unnamed chain"),
        Parameter("source", "", "source of the numbers", '"data sheet"', default=""),
        Parameter("assumed", "", "list of the values that are assumed", '"all stiffnesses"', default=""),
    ),
)

MASS = Table(
    "mass",
    (
        Parameter("name", "", "name of the mass", '"drum"', default=""),
        Parameter("inertia", "kg*m^2", "inertia on its own shaft", '"0.035 kg*m^2"', "above 0"),
        Parameter(
            "damping", "N*m*s/rad", "damping to the ground", '"0.01 N*m*s/rad"', "0 or more", default=0.0
        ),
        Parameter("torque", "N*m", "load torque on its own shaft", '"7.16 N*m"', default=0.0),
        Parameter(
            "kind", "", "kind of the load torque", '"active"', default="active", choices=get_args(LoadKind)
        ),
        Parameter("initial_speed", "rad/s", "speed at the start", '"0 rad/s"', default=0.0),
    ),
    many=True,
    least=2,
)

SHAFT = Table(
    "shaft",
    (
        Parameter(
            "stiffness", "N*m/rad", "stiffness", '"368 N*m/rad"', "above 0", default=None, infinite=True
        ),
        Parameter("damping", "N*m*s/rad", "damping", '"1.5 N*m*s/rad"', "0 or more", default=0.0),
        Parameter("gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", default=None),
        Parameter("backlash", "m", "backlash on the pitch circle", '"0.2 mm"', "0 or more", default=None),
        Parameter("diameter", "m", "pitch diameter", '"185 mm"', "above 0", default=None),
        Parameter("ratio", "1", "gear ratio, speed before over speed after", "3", "above 0", default=1.0),
        Parameter(
            "side",
            "",
            "side of the gear on which shaft and gap lie",
            '"before"',
            default="before",
            choices=("before", "after"),
        ),
        Parameter("efficiency", "1", "efficiency of the gear", "0.97", "from 0 to 1", default=1.0),
        Parameter("restitution", "1", "restitution of a rigid gap", "0.8", "from 0 to 1", default=None),
        Parameter(
            "contact_law",
            "",
            "law of the torque in contact",
            '"no-pull"',
            default="no-pull",
            choices=get_args(ContactLaw),
        ),
        Parameter("start_position", "rad", "twist at the start (0 is mid-gap)", '"0 rad"', default=0.0),
    ),
    many=True,
    least=1,
)

_OF_A_DRIVE = tuple(
    Parameter(p.key, p.unit, p.meaning, p.example, p.limit, p.default, p.choices, infinite=p.infinite)
    for p in PARAMETERS.values()
    if p.table == "motor" and p.key not in ("inertia", "starting_torque")
)

MOTOR = Table(
    "motor",
    (
        Parameter("mass", "", "name of the mass on which the motor acts", '"rotor"', default=""),
        Parameter("starting_torque", "N*m", "starting torque of the motor", '"62 N*m"', "above 0"),
        *_OF_A_DRIVE,
    ),
    required=False,
)

START = Table(
    "start",
    (
        Parameter("load", "", "name of the mass that is to reach the target speed", '"drum"', default=""),
        Parameter(
            "target_speed",
            "rad/s",
            "speed, at the motor shaft, that the load is to reach",
            '"880 rpm"',
            "above 0",
            default=None,
        ),
    ),
    required=False,
)

TABLES = (TOP, MASS, SHAFT, MOTOR, START)
