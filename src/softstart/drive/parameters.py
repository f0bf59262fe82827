"""The parameters of a drive: one table that files, sentences, documentation and the command line all use."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, get_args

from softstart.input.files import Library

__all__ = ["PARAMETERS", "TABLES", "ContactLaw", "LoadKind", "Parameter", "library"]

LoadKind = Literal["active", "reactive"]
ContactLaw = Literal["no-pull", "dead-zone", "modelica"]

Limit = Literal["any", "above 0", "0 or more", "0 or less", "from 0 to 1", "a whole number, 0 or more"]


class Parameter(NamedTuple):
    """One parameter: its name in Python, where it stands in a file, and what it means.

    `unit` is the SI unit, empty for text. `default` is a value, or None where there is none; a parameter with
    `follows` takes the value of that other parameter. `example` is what to type. `choices` is empty where any
    text or number goes. `infinite` lets infinity through.
    """

    name: str
    table: str
    key: str
    symbol: str
    unit: str
    meaning: str
    example: str
    limit: Limit = "any"
    default: float | str | None = None
    required: bool = False
    follows: str = ""
    choices: tuple[str, ...] = ()
    infinite: bool = False

    @property
    def path(self) -> str:
        """How the parameter is called with `--set`: `load.inertia`.

        >>> PARAMETERS["load_inertia"].path, PARAMETERS["source"].path
        ('load.inertia', 'source')
        """
        return f"{self.table}.{self.key}" if self.table else self.key

    @property
    def place(self) -> str:
        """How the parameter is called in a sentence about a file: `[load] inertia`."""
        return f"[{self.table}] {self.key}" if self.table else self.key


_TABLE = (
    Parameter("name", "", "name", "", "", "name of the drive", '"my drive"', default="unnamed drive"),
    Parameter("source", "", "source", "", "", "source of the numbers", '"data sheet"', default=""),
    Parameter(
        "motor_inertia", "motor", "inertia", "J1", "kg*m^2", "inertia of the motor",
        '"0.035 kg*m^2"', "above 0", required=True,
    ),
    Parameter(
        "starting_torque", "motor", "starting_torque", "Ms", "N*m", "starting torque of the motor",
        '"62 N*m"', "above 0", required=True,
    ),
    Parameter(
        "maximum_torque", "motor", "maximum_torque", "", "N*m", "largest torque of the motor",
        '"64 N*m"', "above 0", follows="starting_torque",
    ),
    Parameter(
        "minimum_torque", "motor", "minimum_torque", "", "N*m", "smallest (braking) torque of the motor",
        '"-20 N*m"', "0 or less", default=0.0,
    ),
    Parameter(
        "rated_power", "motor", "rated_power", "", "W", "rated power of the motor", '"2.2 kW"', "above 0"
    ),
    Parameter(
        "rated_speed", "motor", "rated_speed", "", "rad/s", "rated speed of the motor", '"880 rpm"', "above 0"
    ),
    Parameter(
        "torque_lag", "motor", "torque_lag", "", "s", "time constant of the torque behind its demand",
        '"2 ms"', "0 or more", default=0.0,
    ),
    Parameter(
        "torque_rate", "motor", "torque_rate", "", "N*m/s", "largest rate of the torque demand",
        '"500 N*m/s"', "above 0", default=math.inf, infinite=True,
    ),
    Parameter(
        "encoder_lines", "motor", "encoder_lines", "", "1",
        "number of encoder lines (four counts each; 0 for an ideal encoder)",
        "4096", "a whole number, 0 or more", default=4096.0,
    ),
    Parameter(
        "encoder_phase", "motor", "encoder_phase", "", "1",
        "where between two edges of the encoder the start lies, as a share of a count",
        "0.5", "from 0 to 1", default=0.0,
    ),
    Parameter(
        "torque_noise", "motor", "torque_noise", "", "N*m",
        "standard deviation of the noise on the measured motor torque, in each sample",
        '"0.2 N*m"', "0 or more", default=0.0,
    ),
    Parameter(
        "noise_seed", "motor", "noise_seed", "", "1",
        "number of the noise: the same number gives the same noise",
        "1", "a whole number, 0 or more", default=0.0,
    ),
    Parameter(
        "computing_delay", "motor", "computing_delay", "", "s",
        "dead time between what a controller measures and the torque demand that follows from it",
        '"1 ms"', "0 or more", default=0.0,
    ),
    Parameter(
        "stiffness", "shaft", "stiffness", "c", "N*m/rad", "stiffness of the shaft",
        '"368 N*m/rad"', "above 0", required=True,
    ),
    Parameter(
        "damping", "shaft", "damping", "d", "N*m*s/rad", "damping of the shaft",
        '"1.5 N*m*s/rad"', "0 or more", default=0.0,
    ),
    Parameter(
        "gap", "shaft", "gap", "gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", required=True
    ),
    Parameter(
        "contact_law", "shaft", "contact_law", "", "", "law of the shaft torque in contact",
        '"no-pull"', default="no-pull", choices=get_args(ContactLaw),
    ),
    Parameter(
        "start_position", "shaft", "start_position", "theta", "rad",
        "twist phi1 - phi2 at the start (0 is mid-gap)", '"-0.25 rad"', default=0.0,
    ),
    Parameter(
        "load_inertia", "load", "inertia", "J2", "kg*m^2", "inertia of the load at the motor shaft",
        '"0.175 kg*m^2"', "above 0", required=True,
    ),
    Parameter(
        "load_torque", "load", "torque", "Mc", "N*m", "torque of the load at the motor shaft",
        '"7.16 N*m"', required=True,
    ),
    Parameter(
        "load_kind", "load", "kind", "", "", "kind of the load torque",
        '"active"', default="active", choices=get_args(LoadKind),
    ),
    Parameter(
        "target_speed", "start", "target_speed", "", "rad/s", "speed that the load is to reach",
        '"880 rpm"', "above 0", follows="rated_speed",
    ),
    Parameter(
        "initial_load_speed", "start", "initial_load_speed", "", "rad/s", "speed of the load at the start",
        '"0 rad/s"', default=0.0,
    ),
    Parameter(
        "initial_motor_speed", "start", "initial_motor_speed", "", "rad/s", "speed of the motor at the start",
        '"0 rad/s"', default=0.0,
    ),
)  # fmt: skip

library = Library("softstart.drive", "a drive", "drives")

PARAMETERS: Mapping[str, Parameter] = MappingProxyType({p.name: p for p in _TABLE})
TABLES: tuple[str, ...] = tuple(dict.fromkeys(p.table for p in _TABLE if p.table))
