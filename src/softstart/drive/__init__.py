"""The parameters of a drive, from Python, from TOML files, and from the shipped library.

>>> from softstart.drive import Drive
>>> Drive.load("crane-4amtkf").name
'Crane travel drive 4AMTKF(H)112L6'
"""

from __future__ import annotations

from softstart.drive.checks import FRICTIONS
from softstart.drive.data_sheet import DataSheet
from softstart.drive.duty import Duty, DutyStep, Shift
from softstart.drive.limits import INFORMATIVE_TABLES, Limit, Limits, SNCurve
from softstart.drive.machine import LoadKind, Machine
from softstart.drive.model import (
    PARAMETERS,
    TABLES,
    UNKNOWN_POSITIONS,
    ContactLaw,
    Drive,
    Position,
    library,
)  # fmt: skip

__all__ = [
    "FRICTIONS",
    "INFORMATIVE_TABLES",
    "PARAMETERS",
    "TABLES",
    "UNKNOWN_POSITIONS",
    "ContactLaw",
    "DataSheet",
    "Drive",
    "Duty",
    "DutyStep",
    "Limit",
    "Limits",
    "LoadKind",
    "Machine",
    "Position",
    "SNCurve",
    "Shift",
    "library",
]  # fmt: skip
