"""The tables of a chain file: which keys there are, in which units, and what they mean."""

from __future__ import annotations

from typing import get_args

from softstart.drive import PARAMETERS
from softstart.drive.parameters import ContactLaw, LoadKind
from softstart.input_tables import Field, Table

__all__ = ["MASS", "MOTOR", "SHAFT", "START", "TABLES", "TOP"]

TOP = Table(
    "",
    (
        Field("name", "", "name of the chain", '"my chain"', default="unnamed chain"),
        Field("source", "", "source of the numbers", '"data sheet"', default=""),
        Field("assumed", "", "list of the values that are assumed", '"all stiffnesses"', default=""),
    ),
)

MASS = Table(
    "mass",
    (
        Field("name", "", "name of the mass", '"drum"', default=""),
        Field("inertia", "kg*m^2", "inertia on its own shaft", '"0.035 kg*m^2"', "above 0"),
        Field("damping", "N*m*s/rad", "damping to the ground", '"0.01 N*m*s/rad"', "0 or more", default=0.0),
        Field("torque", "N*m", "load torque on its own shaft", '"7.16 N*m"', default=0.0),
        Field(
            "kind", "", "kind of the load torque", '"active"', default="active", choices=get_args(LoadKind)
        ),
        Field("initial_speed", "rad/s", "speed at the start", '"0 rad/s"', default=0.0),
    ),
    many=True,
    least=2,
)

SHAFT = Table(
    "shaft",
    (
        Field(
            "stiffness", "N*m/rad", "stiffness", '"368 N*m/rad"', "above 0", default=None, infinite=True
        ),
        Field("damping", "N*m*s/rad", "damping", '"1.5 N*m*s/rad"', "0 or more", default=0.0),
        Field("gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", default=None),
        Field("backlash", "m", "backlash on the pitch circle", '"0.2 mm"', "0 or more", default=None),
        Field("diameter", "m", "pitch diameter", '"185 mm"', "above 0", default=None),
        Field("ratio", "1", "gear ratio, speed before over speed after", "3", "above 0", default=1.0),
        Field(
            "side", "", "side of the gear on which shaft and gap lie", '"before"',
            default="before", choices=("before", "after"),
        ),
        Field("efficiency", "1", "efficiency of the gear", "0.97", "from 0 to 1", default=1.0),
        Field("restitution", "1", "restitution of a rigid gap", "0.8", "from 0 to 1", default=None),
        Field(
            "contact_law", "", "law of the torque in contact", '"no-pull"',
            default="no-pull", choices=get_args(ContactLaw),
        ),
        Field("start_position", "rad", "twist at the start (0 is mid-gap)", '"0 rad"', default=0.0),
    ),
    many=True,
    least=1,
)  # fmt: skip

_OF_A_DRIVE = tuple(
    Field(p.key, p.unit, p.meaning, p.example, p.limit, p.default, p.choices, infinite=p.infinite)
    for p in PARAMETERS.values()
    if p.table == "motor" and p.key not in ("inertia", "starting_torque")
)

MOTOR = Table(
    "motor",
    (
        Field("mass", "", "name of the mass on which the motor acts", '"rotor"', default=""),
        Field("starting_torque", "N*m", "starting torque of the motor", '"62 N*m"', "above 0"),
        *_OF_A_DRIVE,
    ),
    required=False,
)

START = Table(
    "start",
    (
        Field("load", "", "name of the mass that is to reach the target speed", '"drum"', default=""),
        Field(
            "target_speed", "rad/s", "speed, at the motor shaft, that the load is to reach", '"880 rpm"',
            "above 0", default=None,
        ),
    ),
    required=False,
)  # fmt: skip

TABLES = (TOP, MASS, SHAFT, MOTOR, START)
