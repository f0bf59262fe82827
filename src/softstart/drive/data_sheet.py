"""`DataSheet`: a machine as plates, catalogues and drawings give it, each number at its own part."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any, Self

from softstart.drive.data_sheet_checks import contradictions
from softstart.drive.data_sheet_file import Entry, drive_entries, drive_text
from softstart.drive.data_sheet_mechanics import (
    MotorSide,
    load_speed,
    mean_acceleration,
    motor_side,
    slope_sine,
)
from softstart.drive.data_sheet_values import SheetValues
from softstart.drive.data_sheet_words import USUAL, converted, usual_rotor
from softstart.drive.model import OTHER_DOCUMENTS, Drive
from softstart.drive.plausibility import motion_warnings, plausibility_warnings
from softstart.errors import InputError
from softstart.input.documents import document_text
from softstart.input.files import file_text
from softstart.input.parameters import Mistake, Parameter, Wording, bare, read_value
from softstart.quantities import RefusedError

_IN_SI = re.compile(r" or as a bare number in \S+(?=[.;])")  # refused, or in another unit
# how an assumption begins, and the parameters of the drive that, where they are set themselves, leave nothing
# of it; a drive keeps what is assumed as text alone, in its file too
FORCES = {"load_torque", "load_friction"}
SETTLED_BY = {
    "starting torque ": {"starting_torque"}, "efficiency ": {"stiffness", "load_inertia", *FORCES},
    "no backlash": {"gap"}, "rigid rope": {"stiffness"}, "rope ": {"stiffness"}, "resistance ": FORCES,
    "damping ratio ": {"damping"}, "elastic frequency ": {"stiffness"},
}  # fmt: skip


def still_assumed(drive: Drive, settled: Iterable[str]) -> str:
    """What is assumed of a drive from a data sheet, less what these parameters, set themselves, settle.

    >>> crane = Drive.load("crane-4amtkf").replace(assumed="no backlash; damping ratio 0.02")
    >>> still_assumed(crane, ["gap"])
    'damping ratio 0.02'
    """
    settled = {*settled, *([] if drive.load_friction else ["load_friction"])}
    return "; ".join(
        text for text in drive.assumed.split("; ")
        if not any(text.startswith(begin) and names <= settled for begin, names in SETTLED_BY.items())
    )  # fmt: skip


class DataSheet(SheetValues):
    """A machine as plates, catalogues and drawings give it; `drive` is what follows for the motor shaft.

    It is an input; a `reporting.ParameterSheet` is a result, a `views.sheet.Sheet` what is shown of one.

    With the ratio i and the efficiency eta of the gears, an inertia J, a stiffness c and a torque M behind
    them are J/(i^2 eta), c/(i^2 eta) and M/(i eta) at the motor shaft, a backlash i times as wide.
    Stiffnesses in series add by their reciprocals, backlashes directly. A mass m on a radius r is m r^2; a
    rope that is reeved n times makes the radius r/n. A steel shaft of diameter D and length L has
    c = G pi D^4/(32 L), G = 79.3e9 N/m^2. One fall of a rope of diameter d and length L has k = E 0.46 d^2/L;
    n falls on the radius r/n store k n (r/n)^2 angle^2/2, so that they have c = k r^2/n at the drum. Several
    motors share load and rope; shaft and gears are one motor's own. A ratio may be written "38:1" or "4/2".

    In a file and in `from_settings` a bare number is refused where people seldom mean SI (`USUAL`): speed,
    power, backlash, plays, diameters, lag. As an argument every number is in SI. An efficiency of 10 to 100
    is read as per cent. `assumed` lists what nobody gave and is filled in.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        If any value is wrong or missing; with one sentence for each.

    References
    ----------
    Metallic cross-section of a rope: EN 12385-4, class 6x36 with steel core, C = 0.46.

    Examples
    --------
    >>> sheet = DataSheet(
    ...     machine="hoist", rated_power="15 kW", rated_speed="970 rpm", motor_inertia=0.17, ratio=45,
    ...     mass="6300 kg", radius="0.2 m", reeving=4, gear_stiffness="2 kN*m/arcmin", backlash="7 arcmin",
    ... )
    >>> drive = sheet.drive
    >>> round(drive.Mc, 1), round(drive.gap, 4), drive.start_position
    (72.3, 0.0916, 'hanging')
    >>> drive.assumed
    'starting torque 1.5 times the rated torque; efficiency 0.95; rigid rope; damping ratio 0.02'
    """

    # making one -------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """The TOML file at this path; `also` holds changes by path, as {"load.mass": "5000 kg"}."""
        return cls.from_toml(file_text(path, cls.WHAT), where=os.fspath(path), also=also)

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        if "start" in document and not cls.describes(document):
            reason = "this is the file of a drive already; softstart compare takes it"
            raise InputError(Wording(where).sentence("", reason))
        if extra := [name for name in ("[brake]", "[[duty]]", "[shift]") if name.strip("[]") in document]:
            reason = 'a data sheet has none; add it to the drive file that "softstart init" writes from it'
            raise InputError(Wording(where).sentence(" and ".join(extra), reason))
        return super()._from_document(document, where, also)

    @classmethod
    def from_settings(cls, settings: Mapping[str, object]) -> Self:
        """A data sheet from values by path, as {"motor.rated_power": "3 kW", "gear.ratio": 31.5}."""
        return cls._from_document({}, "", settings)

    @classmethod
    def describes(cls, document: Mapping[str, Any]) -> bool:
        """Whether TOML tables are those of a data sheet, not of a drive: by a key or table no drive has.

        >>> DataSheet.describes({"load": {"machine": "hoist"}}), DataSheet.describes({"load": {"torque": 7}})
        (True, False)
        """
        sheet_paths = {p.path for p in cls.PARAMETERS.values()} - {p.path for p in Drive.PARAMETERS.values()}
        tables = {name: keys for name, keys in document.items() if isinstance(keys, dict)}
        of_drive = {"stiffness", "gap"} & tables.get("shaft", {}).keys()
        keys_of_a_sheet = any(f"{name}.{key}" in sheet_paths for name, keys in tables.items() for key in keys)
        return not of_drive and (keys_of_a_sheet or bool({"coupling", "output", "rope"} & document.keys()))

    def to_toml(self) -> str:
        """The data sheet as a file that `load` reads.

        >>> sheet = DataSheet(machine="rotor", rated_power=1e3, rated_speed=150, motor_inertia=0.01,
        ...     output_inertia=0.1, coupling_stiffness=900)
        >>> DataSheet.from_toml(sheet.to_toml()) == sheet
        True
        """
        units = {name: f" {self.PARAMETERS[name].unit}" for name in USUAL}
        given = {
            name: f"{value!r}{units[name]}" if name in units else value
            for name, value in self.given().items()
        }
        return document_text((table, given) for table in self.TABLES)

    def _fill(
        self, given: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake], *known: Any
    ) -> None:
        """As any parameters; in a file or setting without the bare numbers that may be in another unit."""
        share = bare(given.get("efficiency"))
        per_cent = share and 10.0 <= float(share) <= 100.0
        vars(self)["_read"] = {"read": f"efficiency {share} is {share} %"} if per_cent else {}
        read, mistakes, of = dict(given), list(mistakes), self.PARAMETERS
        for name, value in given.items():
            try:
                read[name] = converted(name, value)
            except RefusedError as refusal:
                read[name] = 1.0  # for what else is wrong
                mistakes.append(Mistake(wording.refused(of[name], value, refusal)))
        given = read | ({"efficiency": f"{share} %"} if per_cent else {})
        try:
            super()._fill(given, wording, mistakes, *known)
        except InputError as error:
            if wording.style != "toml":
                raise
            missing, usual = f"{of['motor_inertia'].place} is missing", _rotor(of, given)
            raise InputError(
                _IN_SI.sub("", one) + usual * (missing in one) for one in error.sentences
            ) from None

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterator[str]:
        given, of = vars(self)["_given"], self.PARAMETERS
        by_ratio = "starting_torque" not in given or "maximum_ratio" in given
        if by_ratio and not {"rated_power", "rated_torque"} & given:
            other = wording.label(of["rated_torque"])
            yield wording.missing(of["rated_power"], f", or {other} in its place").sentence

    def contradictions(self) -> Iterator[str]:
        return contradictions(self)

    # at the motor shaft -----------------------------------------------------------------------------------

    @cached_property
    def _motor_side(self) -> MotorSide:
        return motor_side(self)

    @cached_property
    def _entries(self) -> dict[str, Entry]:
        return drive_entries(self, self._motor_side, self.motion)

    @property
    def speed(self) -> float:
        """Speed of the load at the rated speed of the motor: m/s, of a rotor rad/s."""
        return load_speed(self)

    @property
    def acceleration(self) -> float:
        """Mean acceleration of the load under the starting torque, m/s2, of a rotor rad/s2."""
        return mean_acceleration(self, self._motor_side)

    @property
    def motion(self) -> str:
        """Speed and acceleration of the load, as they are said.

        >>> DataSheet(machine="travel", rated_power="3 kW", rated_speed="1410 rpm", motor_inertia=0.0062,
        ...     starting_ratio=2.2, ratio=38.1, mass="6.5 t", diameter="315 mm", gear_stiffness=35e3).motion
        'load 36.62 m/min, accelerated by 1.426 m/s^2 on average'
        """
        if self.machine == "rotor":
            speed, unit = f"{self.speed * 30.0 / math.pi:.4g} rpm", "rad/s^2"
        else:
            speed, unit = f"{60.0 * self.speed:.4g} m/min", "m/s^2"
        return f"load {speed}, accelerated by {self.acceleration:.4g} {unit} on average"

    @property
    def motion_warnings(self) -> list[str]:
        """What can hardly be of the motion of the load, which a drive does not know."""
        if self.machine == "rotor":
            return []
        sine = slope_sine(self)
        return list(motion_warnings(self.machine, self.speed, self.acceleration, sine, self.balanced))

    @property
    def plausibility_warnings(self) -> list[str]:
        """What is possible and hardly ever true, of the drive and of the motion of its load."""
        return [*plausibility_warnings(self.drive), *self.motion_warnings]

    def drive_toml(self) -> str:
        """The drive file: each number where it is known, with what it is from in a comment.

        That of a part behind the gear is "at output" there, which `Drive` brings to the motor shaft. What is
        computed has five or six digits, what is typed all.
        """
        return drive_text(self._entries)

    @cached_property
    def drive(self) -> Drive:
        """The drive that follows, exactly; the numbers of `drive_toml` may have fewer digits.

        Where no stiffness is known it is that at the stiff end of what is usual, with a soft end.

        >>> sheet = DataSheet(machine="rotor", rated_power=1e3, rated_speed=150, motor_inertia=0.01,
        ...     output_inertia=0.1)
        >>> [round(one.Omega / (2 * math.pi), 9) for one in (sheet.drive, sheet.drive.soft)]
        [30.0, 3.0]
        """
        values = {name: one.value for name, one in self._entries.items()}
        try:
            return Drive._made(values, Wording("the drive that follows", style="toml"), [])
        except InputError as error:
            cause = " Is [gear] ratio inverted (turns of the motor for one of the output), or a power in W?"
            if "ratio" not in self.given():
                cause = " Is [gear] ratio missing, or a power in W?"
            raise InputError([one + cause * ("cannot move" in one) for one in error.sentences]) from None


def _rotor(of: Mapping[str, Parameter], given: Mapping[str, object]) -> str:
    """What is usual for a rotor whose inertia nobody knows; "" where its rated torque is not known either."""
    with suppress(RefusedError, KeyError):
        if "rated_torque" in given:
            return usual_rotor(read_value(of["rated_torque"], given["rated_torque"]))
        power, speed = (read_value(of[name], given[name]) for name in ("rated_power", "rated_speed"))
        return usual_rotor(power / speed)
    return ""


OTHER_DOCUMENTS.append(
    (DataSheet.describes, lambda tables, where: DataSheet._from_document(tables, where).drive)
)
