"""Numbers and text as people and programs read them: decimals, units, dashes, JSON. Imports nothing heavy.

A terminal and files have ASCII alone; `printed`, `fixed`, `digits` and `percent` are for report and page.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from softstart.drive import Machine
from softstart.input.parameters import Parameter
from softstart.quantities import RefusedError, Units, seen_from

NOTHING, DASH = "-", "\N{EN DASH}"  # for a missing value
IN_SI = Units()
MISSING = ("", "nan", "None")  # texts of values that are not there
RPM = 30.0 / math.pi  # of one rad/s
LONGEST_NAME = 60  # characters of a name in a sentence
UNITS = {"kg*m^2": "kg m\N{SUPERSCRIPT TWO}", "1": ""}  # as report and page print them
MINUS = re.compile(r"(?<!\w)-(?=[\d.]|inf\b)|(?<=\de)-(?=\d)")  # a sign, not the hyphen of a name
UNIT_BEHIND = (  # a heading
    r"(?<!,) (?=(k?N m|lbf ft|N m s|kg m2|rad|rad/s|rpm|s|ms|Hz|J|%|deg|arcmin|mm|N|kN)$)"
)


class Column(NamedTuple):
    """A column: its heading (may hold line breaks), and whether its cells are numbers, set to the right."""

    heading: str
    number: bool = True

    @property
    def in_a_line(self) -> str:
        r"""The heading without line breaks, and with a comma before its unit.

        >>> Column("peak\nN m").in_a_line, Column("start\ntime s").in_a_line, Column("K_dyn").in_a_line
        ('peak, N m', 'start time, s', 'K_dyn')
        """
        return re.sub(UNIT_BEHIND, ", ", self.heading.replace("-\n", "").replace("\n", " "))

    def width(self, cells: Sequence[str]) -> int:
        """Letters that the column needs."""
        return max(len(line) for text in (self.heading, *cells) for line in text.split("\n"))


class DataColumn(NamedTuple):
    """A column as a view declares it: its heading, and the value of a row.

    A number has so many `decimals`, or is written by `text`, or all of the column have as many decimals as
    the largest one has with `digits` significant ones. An `optional` column is left out where no row has a
    value. With `si`, the unit of the values in SI, with which the heading ends, it is shown in other units.
    """

    heading: str
    of: Callable[[Any], Any]
    decimals: int | None = None
    digits: int = 4
    text: Callable[[float], str] | None = None
    optional: bool = False
    si: str = ""

    def seen(self, units: Units) -> DataColumn:
        r"""The column in these units.

        >>> DataColumn("peak\nN m", lambda row: 1500.0, si="N*m").seen(Units(torque="kN*m")).heading
        'peak\nkN m'
        """
        if not self.si:
            return self
        heading = self.heading.removesuffix(Units().label(self.si)) + units.label(self.si)
        decimals = self.decimals if units.of(self.si) == self.si else None

        def of(row: Any) -> Any:
            value = self.of(row)
            return None if value is None else units.shown(value, self.si)

        return self._replace(heading=heading, of=of, decimals=decimals)

    def is_shown(self, rows: Iterable[object]) -> bool:
        """Whether there is anything to show."""
        return not self.optional or any(str(self.of(row)) not in MISSING for row in rows)

    def cells(self, rows: Iterable[object]) -> list[str]:
        """The cells of these rows."""
        values = list(map(self.of, rows))
        if self.text is not None:
            return list(map(self.text, values))
        if any(isinstance(value, str) for value in values):
            return values
        if self.decimals is None:
            return column_of(values, self.digits)
        return [number(value, self.decimals) for value in values]


class TextTable(NamedTuple):
    """A titled table of text cells; rows numbered in `bold` stand out, a terminal shows the first `most`.

    The first `keys` columns name a row; if it is not said, those that hold text.
    """

    title: str
    columns: list[Column]
    rows: Sequence[Sequence[str]]
    bold: Sequence[int] = ()
    most: int | None = None
    keys: int | None = None

    @classmethod
    def of(
        cls, title: str, cells: Mapping[str, Sequence[str]], texts: Sequence[str] = (), **options: Any
    ) -> TextTable:
        """From the cells below each heading; columns named in `texts` hold text, the others numbers."""
        columns = [Column(heading, heading not in texts) for heading in cells]
        return cls(title, columns, [list(row) for row in zip(*cells.values(), strict=True)], **options)

    @classmethod
    def of_data(
        cls, title: str, columns: Sequence[DataColumn], rows: Sequence[object], units: Units = IN_SI,
        **options: Any,
    ) -> TextTable:  # fmt: skip
        """From declared columns, in these units; numbers to the right, texts to the left.

        >>> columns = DataColumn("name", str), DataColumn("K_dyn", float, 2)
        >>> TextTable.of_data("", columns, ["1", "2.5"]).rows
        [['1', '1.00'], ['2.5', '2.50']]
        """
        columns = [column.seen(units) for column in columns if column.is_shown(rows)]
        if any(units.is_at_output(column.si) for column in columns):
            title = titled(title, units)
        texts = [c.heading for c in columns if not c.text and any(isinstance(c.of(r), str) for r in rows)]
        return cls.of(title, {c.heading: c.cells(rows) for c in columns}, texts, **options)

    @classmethod
    def of_rows(
        cls, title: str, texts: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[str]]
    ) -> TextTable:
        """From rows; the headings of the first columns, which hold text, and of the others, numbers."""
        return cls(title, [*(Column(one, False) for one in texts), *map(Column, numbers)], rows)

    @classmethod
    def of_texts(cls, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> TextTable:
        """Rows of text, without a title."""
        return cls.of_rows("", headings, (), rows)


def number(value: float | None, decimals: int) -> str:
    """A number with so many decimals; a dash for a missing value.

    >>> number(0.01661, 4), number(float("nan"), 4), number(-0.00001, 3)
    ('0.0166', '-', '0.000')
    """
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if not text.strip("-0.") else text


def column_of(values: Sequence[float | None], digits: int = 4) -> list[str]:
    """Numbers of one column: as many decimals for all, `digits` significant ones in the largest.

    A cell that would be left with less than two significant digits has three of its own; what is a millionth
    of the largest, and below 1e-7, is rounding and 0.

    >>> column_of([0.36774, 0.0166, float("nan")]), column_of([164.83, 62.0]), column_of([2e-7, 1e-9])
    (['0.3677', '0.0166', '-'], ['164.8', '62.0'], ['2.000e-07', '1.000e-09'])
    >>> column_of([251.3, 0.01984, 0.02213, 3e-17])
    ['251.3', '0.0198', '0.0221', '0.0']
    """
    finite = [abs(v) for v in values if v is not None and math.isfinite(v) and v != 0.0]
    if not finite:
        return [number(v, 0) for v in values]
    largest = max(finite)
    order = math.floor(math.log10(largest))
    if not -4 <= order <= 6:
        return [NOTHING if v is None or math.isnan(v) else f"{v:.{digits - 1}e}" for v in values]
    noise = min(1e-6 * largest, 1e-7)
    return [_cell(v, max(0, digits - 1 - order), noise) for v in values]


def _cell(value: float | None, decimals: int, noise: float) -> str:
    if value is None or not noise < abs(value) < 10.0 ** (1 - decimals):
        return number(value, decimals)
    own = math.floor(math.log10(abs(value)))
    return number(value, max(decimals, 2 - own)) if own >= -4 else f"{value:.2e}"


def short(value: float) -> str:
    """One number for a line of text, at most six digits.

    >>> short(368.465), short(0.175), short(92.15338450), short(math.nan)
    ('368.465', '0.175', '92.1534', '-')
    """
    return NOTHING if math.isnan(value) else f"{value:.6g}"


def plural(count: int, noun: str) -> str:
    """A count and its noun.

    >>> plural(1, "start"), plural(2000, "start"), plural(0, "gap"), plural(3, "duty")
    ('1 start', '2,000 starts', '0 gaps', '3 duties')
    """
    return f"{count:,} {noun if count == 1 else plural_of(noun)}"


def plural_of(noun: str) -> str:
    """The noun of several things.

    >>> plural_of("start"), plural_of("strategy")
    ('starts', 'strategies')
    """
    return f"{noun.removesuffix('y')}ies" if noun.endswith(("ty", "gy")) else f"{noun}s"


def with_unit(value: float, unit: str) -> str:
    """A number and its unit; a dash for a missing value.

    >>> with_unit(0.1751, "s"), with_unit(math.nan, "s")
    ('0.1751 s', '-')
    """
    return NOTHING if math.isnan(value) else f"{short(value)} {unit}".rstrip()


def label(name: str, unit: str = "", between: str = ", ") -> str:
    r"""A figure or a parameter in words, with its unit, as axes and headings name it.

    >>> label("k_dyn_first_contact"), label("load_inertia J2", "kg*m^2"), label("controller_time", "s", "\n")
    ('K_dyn first contact', 'load inertia J2, kg m2', 'time\ns')
    """
    words = name.removeprefix("controller_").replace("_", " ").replace("k dyn", "K_dyn")
    return words if unit in ("", "1") else f"{words}{between}{unit.replace('*', ' ').replace('^', '')}"


def printed(text: str) -> str:
    """A cell as report and page print it: a true minus sign, an en dash for a missing value.

    >>> printed("-1.5e-05"), printed("-"), printed("s-curve")
    ('\N{MINUS SIGN}1.5e\N{MINUS SIGN}05', '\N{EN DASH}', 's-curve')
    """
    return DASH if text == NOTHING else re.sub(r"\binf\b", "infinite", MINUS.sub("\N{MINUS SIGN}", text))


def fixed(value: float | None, decimals: int) -> str:
    """A number with so many decimals, for report and page.

    >>> fixed(0.98123, 3), fixed(float("nan"), 3), fixed(-1.5, 1)
    ('0.981', '\N{EN DASH}', '\N{MINUS SIGN}1.5')
    """
    return printed(number(value, decimals))


def digits(value: float | None, count: int = 4) -> str:
    """A number with so many significant digits, without an exponent where that can be read.

    >>> digits(0.0165988), digits(164.81), digits(2.6e-5), digits(368.465, 6)
    ('0.01660', '164.8', '2.600e\N{MINUS SIGN}05', '368.465')
    """
    return printed(column_of([value], count)[0])


def percent(share: float, decimals: int = 1) -> str:
    """A share in per cent.

    >>> percent(0.0772)
    '7.7\N{NO-BREAK SPACE}%'
    """
    return f"{fixed(100.0 * share, decimals)}\N{NO-BREAK SPACE}%"


def seen(value: float, si: str, units: Units) -> str:
    """A value in SI at the motor shaft as it is seen, with its unit; a dash for a missing value.

    >>> seen(1600.0, "N*m", Units(torque="kN*m")), seen(math.nan, "rad", Units())
    ('1.6 kN m', '-')
    """
    return with_unit(float(units.shown(value, si)), units.label(si))


def titled(title: str, units: Units) -> str:
    """A title that says at which shaft, where it is not that of the motor.

    >>> titled("Stages", Units())
    'Stages'
    """
    return f"{title}{units.at}" if title else units.at.removeprefix(", ").capitalize()


def unit(written: str) -> str:
    """A unit as report and page print it.

    >>> unit("N*m"), unit("rad/s")
    ('N m', 'rad/s')
    """
    return UNITS.get(written, written.replace("*", " "))


def units_of(machine: Machine, given: Machine | None = None) -> Units:
    """The units and the shaft in which a machine is seen: those that it names, else as it has its values.

    `given`: the machine of whose values these are, if it is another one.

    >>> from softstart import Drive
    >>> units_of(Drive.load("hoist-15kw")).text, units_of(Drive.load("servo-axis-small")).angle
    ('deg, rpm', ...)
    >>> crane = Drive.load("crane-4amtkf").replace(gear_ratio=38.0, units="kN m, at output")
    >>> units_of(crane).shown(50.0, "N*m")
    1.9
    >>> units_of(crane.replace(gap="9 arcmin at output")).angle  # at the motor shaft 5.7 deg
    'arcmin'
    """
    given = given or machine
    speeds = () if given.target_speed is None else (float(given.target_speed),)
    return _read(machine.units, given.local_gaps, speeds, machine.gear or machine.gear_with())


def units_for(machine: Machine, parameter: Parameter) -> Units:
    """The units of a parameter of a machine; what is at the output in the file is there already."""
    units = units_of(machine)
    return units.at_motor if parameter.at_output == "here" else units


def seen_at(machine: Any, shaft: str) -> Any:
    """The machine as it is seen at the "motor" or the "output" shaft, in its units.

    Raises `RefusedError`, the reason, where it has no output.

    >>> from softstart import Drive
    >>> seen_at(Drive.load("hoist-15kw").replace(gear_ratio=45.0, units="deg"), "output").units
    'deg, at output'
    """
    gear = machine.gear or machine.gear_with()
    if shaft == "output" and isinstance(gear, str):
        raise RefusedError(gear)
    return machine.replace(units=seen_from(machine.units, shaft == "output"))


_read = lru_cache(maxsize=64)(Units.read)  # the page asks some forty times a frame


def at_output(machine: Machine, value: float, unit: str = "N*m") -> str:
    """A value of the motor shaft at the output of the gear, see `Drive.gear`; "" where it has none there.

    The `unit` is that of the value in SI; it is shown in the units of the machine.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf").replace(gear_ratio=38.0, gear_efficiency=0.95)
    >>> at_output(crane, 169.7), at_output(crane, 290.0 / 38.0**2 / 0.95, "kg*m^2")
    ('6126', '290.0')
    """
    gear = machine.gear
    if gear is None or gear.factor(unit) is None:
        return ""
    return digits(float(units_of(machine)._replace(gear=gear).shown(value, unit)))


def gear_in_words(machine: Machine) -> str:
    """How values are brought to the output of the gear of a machine, in a sentence; "" without one.

    >>> from softstart import Drive
    >>> gear_in_words(Drive.load("crane-4amtkf").replace(gear_ratio=38.0, gear_efficiency=0.95))
    'At the output: torques, those of limits too, times i eta; inertias, stiffness and damping times ...'
    """
    if (gear := machine.gear) is None:
        return ""
    torques = "i/eta, as the load drives the motor" if gear.load < 0.0 else "i eta"
    return (
        f"At the output: torques, those of limits too, times {torques}; inertias, stiffness and damping "
        f"times i^2 eta; angles and speeds over i; i = {short(float(gear.ratio))}, "
        f"eta = {short(float(gear.efficiency))}."
    )


def decimals_of(step: float) -> int:
    """Decimals that show every multiple of a step.

    >>> decimals_of(0.5), decimals_of(0.01), decimals_of(1.0), decimals_of(0.125)
    (1, 2, 0, 3)
    """
    for count in range(9):
        if abs(step * 10**count - round(step * 10**count)) < 1e-9 * max(1.0, step * 10**count):
            return count
    return 9


def printable(text: str) -> str:
    r"""The text without control characters, which could steer the terminal.

    >>> printable("a\x1b[31mb")
    'a [31mb'
    """
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def cut(text: str, most: int = LONGEST_NAME) -> str:
    """A text of at most so many characters.

    >>> cut("Crane", 5), cut("Crane drive", 5)
    ('Crane', 'Cran\N{HORIZONTAL ELLIPSIS}')
    """
    return text if len(text) <= most else text[: most - 1] + "\N{HORIZONTAL ELLIPSIS}"


def json_ready(value: object) -> Any:
    """Results as JSON has them: NaN and infinity become null, numpy's numbers and arrays plain ones.

    >>> json_ready({"k_dyn": float("nan"), "stages": (1, 2)})
    {'k_dyn': None, 'stages': [1, 2]}
    """
    if isinstance(value, Mapping):
        return {str(key): json_ready(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(one) for one in value]
    if hasattr(value, "tolist"):
        return json_ready(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    return str(value)
