"""The parameters of a clutch: one table that files, Python keywords and sentences use."""

from __future__ import annotations

from typing import NamedTuple

from softstart.clutch.laws import LAWS
from softstart.input_tables import Field, Table

__all__ = ["PARAMETERS", "TABLES", "Parameter"]

WHAT = "a clutch file"


class Parameter(NamedTuple):
    """A parameter: its name in Python, its table in a file, and what it is."""

    name: str
    table: str
    field: Field


PARAMETERS = (
    Parameter("name", "", Field("name", "", "name of the clutch", '"my clutch"', default="unnamed clutch")),
    Parameter(
        "source", "", Field("source", "", "source of the numbers", '"data sheet"', default="not given")
    ),
    Parameter(
        "clutch_inertia", "clutch",
        Field("inertia", "kg*m^2", "inertia IM of the clutch side", '"0.98 kg*m^2"', "above 0"),
    ),
    Parameter(
        "clutch_torque", "clutch",
        Field("torque", "N*m", "friction torque MM of the engaged clutch", '"588 N*m"', "above 0"),
    ),
    Parameter(
        "drive_speed", "clutch",
        Field("speed", "rad/s", "constant speed w0 of the driving side", '"230 rad/s"', "above 0"),
    ),
    Parameter(
        "engagement_time", "clutch",
        Field("engagement_time", "s", "time tM in which the friction torque rises", '"1 s"', "above 0"),
    ),
    Parameter(
        "lining_area", "clutch",
        Field("lining_area", "m^2", "area of all friction faces", '"0.05 m^2"', "above 0", default=None),
    ),
    Parameter(
        "stiffness", "shaft",
        Field("stiffness", "N*m/rad", "stiffness cp of the shaft", '"49 N*m/rad"', "above 0"),
    ),
    Parameter(
        "damping", "shaft",
        Field("damping", "N*m*s/rad", "damping of the shaft", '"0.5 N*m*s/rad"', "0 or more", default=0.0),
    ),
    Parameter(
        "gap", "shaft", Field("gap", "rad", "total angular gap", '"0.02 rad"', "0 or more", default=0.0)
    ),
    Parameter(
        "load_inertia", "load",
        Field("inertia", "kg*m^2", "inertia Ic of the load", '"4.9 kg*m^2"', "above 0"),
    ),
    Parameter(
        "load_torque", "load", Field("torque", "N*m", "torque Mc of the load", '"196 N*m"', "0 or more")
    ),
    Parameter(
        "load_kind", "load",
        Field("kind", "", "kind of the load torque", '"active"', default="active",
              choices=("active", "reactive")),
    ),
    Parameter(
        "law", "law",
        Field("kind", "", "engagement law", '"linear"', default="linear", choices=(*LAWS, "table")),
    ),
    Parameter(
        "time_constant", "law",
        Field("time_constant", "s", "time constant of the exponential law", '"1 s"', default=1.0),
    ),
    Parameter(
        "law_times", "law",
        Field("times", "s", "instants of the table", "[0, 0.5, 1]", "0 or more", default=None, many=True),
    ),
    Parameter(
        "law_torques", "law",
        Field("torques", "N*m", "friction torques of the table", "[0, 200, 588]", "0 or more",
              default=None, many=True),
    ),
)  # fmt: skip

TABLES = tuple(
    Table(table, tuple(p.field for p in PARAMETERS if p.table == table), required=table != "law")
    for table in ("", "clutch", "shaft", "load", "law")
)
