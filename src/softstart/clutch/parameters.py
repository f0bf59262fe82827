"""The parameters of a clutch: one table that files, Python keywords and sentences use."""

from __future__ import annotations

from softstart.clutch.laws import LAWS
from softstart.input.documents import Table
from softstart.input.files import Library
from softstart.input.parameters import Parameter

__all__ = ["LIBRARY", "PARAMETERS", "TABLES", "WHAT"]

WHAT = "a clutch"
LIBRARY = Library("softstart.clutch", "a clutch", "clutches")

PARAMETERS = (
    Parameter("name", "", "name of the clutch", '"my clutch"', default="unnamed clutch"),
    Parameter("source", "", "source of the numbers", '"data sheet"', default="not given"),
    Parameter(
        "inertia",
        "kg*m^2",
        "inertia IM of the clutch side",
        '"0.98 kg*m^2"',
        "above 0",
        table="clutch",
        name="clutch_inertia",
    ),
    Parameter(
        "torque",
        "N*m",
        "friction torque MM of the engaged clutch",
        '"588 N*m"',
        "above 0",
        table="clutch",
        name="clutch_torque",
    ),
    Parameter(
        "speed",
        "rad/s",
        "constant speed w0 of the driving side",
        '"230 rad/s"',
        "above 0",
        table="clutch",
        name="drive_speed",
    ),
    Parameter(
        "engagement_time",
        "s",
        "time tM in which the friction torque rises",
        '"1 s"',
        "above 0",
        table="clutch",
    ),
    Parameter(
        "lining_area",
        "m^2",
        "area of all friction faces",
        '"0.05 m^2"',
        "above 0",
        default=None,
        table="clutch",
    ),
    Parameter("stiffness", "N*m/rad", "stiffness cp of the shaft", '"49 N*m/rad"', "above 0", table="shaft"),
    Parameter(
        "damping",
        "N*m*s/rad",
        "damping of the shaft",
        '"0.5 N*m*s/rad"',
        "0 or more",
        default=0.0,
        table="shaft",
    ),
    Parameter("gap", "rad", "total angular gap", '"0.02 rad"', "0 or more", default=0.0, table="shaft"),
    Parameter(
        "inertia",
        "kg*m^2",
        "inertia Ic of the load",
        '"4.9 kg*m^2"',
        "above 0",
        table="load",
        name="load_inertia",
    ),
    Parameter(
        "torque", "N*m", "torque Mc of the load", '"196 N*m"', "0 or more", table="load", name="load_torque"
    ),
    Parameter(
        "kind",
        "",
        "kind of the load torque",
        '"active"',
        default="active",
        choices=("active", "reactive"),
        table="load",
        name="load_kind",
    ),
    Parameter(
        "kind",
        "",
        "engagement law",
        '"linear"',
        default="linear",
        choices=(*LAWS, "table"),
        table="law",
        name="law",
    ),
    Parameter(
        "time_constant", "s", "time constant of the exponential law", '"1 s"', default=1.0, table="law"
    ),
    Parameter(
        "times",
        "s",
        "instants of the table",
        "[0, 0.5, 1]",
        "0 or more",
        default=None,
        many=True,
        table="law",
        name="law_times",
    ),
    Parameter(
        "torques",
        "N*m",
        "friction torques of the table",
        "[0, 200, 588]",
        "0 or more",
        default=None,
        many=True,
        table="law",
        name="law_torques",
    ),
)

TABLES = tuple(
    Table(table, tuple(p for p in PARAMETERS if p.table == table), required=table != "law")
    for table in ("", "clutch", "shaft", "load", "law")
)
