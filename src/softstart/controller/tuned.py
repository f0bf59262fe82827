"""Tuned gains: controllers with one robust set or with a schedule over gap and load inertia, and their files.

Both are TOML files, read back to the last bit.
"""

from __future__ import annotations

import csv
import io
import math
import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal, NamedTuple, cast, get_args

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.controller.base import CompiledController, Controller, Effort, Sensor, SetUp, label_of
from softstart.controller.parameters import declared_parameters
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.documents import literal, parsed
from softstart.input.files import ABSENT, read_text
from softstart.input.parameters import Wording
from softstart.quantities import RefusedError

Scale = Literal["linear", "logarithmic"]

ROBUST, SCHEDULE, SETTINGS = "robust set", "gain schedule", "settings"
AXES = ("gap", "load_inertia")


def is_gain_file(name: str) -> bool:
    """Whether the name of a controller is that of a file of tuned gains."""
    return name.lower().endswith(".toml")


class Gain(NamedTuple):
    """A parameter over the grid: a value for each gap (rows) and load inertia (columns)."""

    scale: Scale
    values: NDArray[np.float64]


class RobustFile(NamedTuple):
    """A robust set: a controller, its parameters, the drive they are fitted to, and the cells it is for.

    The cells are all pairs of `gaps` (rad) and `load_inertias` (kg m2); none in a file that does not say so.
    """

    controller: str
    parameters: dict[str, object]
    drive: Drive
    gaps: tuple[float, ...] = ()
    load_inertias: tuple[float, ...] = ()


class ScheduleFile(NamedTuple):
    """A schedule: a controller, its gains over gaps (rad) and load inertias (kg m2), fixed parameters."""

    controller: str
    gaps: tuple[float, ...]
    load_inertias: tuple[float, ...]
    gains: dict[str, Gain]
    fixed: dict[str, object]


class SettingsFile(NamedTuple):
    """A controller with parameters of its own, set up for whatever drive it starts."""

    controller: str
    parameters: dict[str, object]


GainFile = RobustFile | ScheduleFile | SettingsFile

# ---- controllers ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Tuned(Controller):
    """Another controller with tuned gains; `label` distinguishes it from that one in tables."""

    label: str
    controller: Controller

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", display_name(self.controller, self.label))

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the controller with these gains."""
        return self.controller.sensors

    @property
    def effort(self) -> Effort | None:  # type: ignore[override]
        """That of the controller with these gains."""
        return self.controller.effort

    def _called(self, controller: Controller) -> Controller:
        """The controller, under the name of these gains."""
        ready = replace(controller)
        object.__setattr__(ready, "name", self.name)
        return ready


@dataclass(frozen=True, eq=False)
class RobustGains(Tuned):
    """One set of gains for all: the controller as it was set up for the nominal drive, whatever drive starts.

    `gaps` (rad) and `load_inertias` (kg m2) are those that it was tuned for, where that is known.

    >>> from softstart import simulate
    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf")
    >>> gains = RobustGains("robust", make_controller("ramp", {"time": 0.12}), crane)
    >>> worn = crane.replace(gap=2)
    >>> run = simulate(worn, gains)
    >>> run.controller.name, run.k_dyn == simulate(worn, gains.controller, fitted_to=crane).k_dyn
    ('ramp (robust)', True)
    """

    nominal: Drive
    gaps: tuple[float, ...] = ()
    load_inertias: tuple[float, ...] = ()

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller set up for the nominal drive, and that drive."""
        ready, drive_of_gains = self.controller.set_up(self.nominal)
        return self._called(ready), drive_of_gains

    def set_ups(self, drives: object) -> Iterator[SetUp]:
        """One for all drives."""
        yield self.set_up(self.nominal)

    @property
    def parameters(self) -> dict[str, object]:
        """Those of the controller as it is set up."""
        return self.controller.set_up(self.nominal)[0].parameters


@dataclass(frozen=True, eq=False)
class Settings(Tuned):
    """A controller with parameters of its own, under a name that distinguishes it from the defaults."""

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller set up for the drive."""
        ready, drive_of_gains = self.controller.set_up(drive)
        return self._called(ready), drive_of_gains

    @property
    def parameters(self) -> dict[str, object]:
        """Those of the controller."""
        return self.controller.parameters


@dataclass(frozen=True, eq=False)
class GainSchedule(Tuned):
    """Gains over a grid of gaps and load inertias, taken for the gap and load inertia that a drive declares.

    Between the nodes the gains are bilinear in gap and load inertia, in their logarithm where their scale is
    logarithmic; at a node they are those of the node to the bit. Outside the grid the nearest value on its
    edge is taken: nothing is extrapolated. All other parameters follow the drive, as they do without tuning.

    `gains` holds name, scale and values (a row per gap, a column per load inertia).

    >>> from softstart.controller import make_controller
    >>> gains = (("time", "linear", np.array([[0.1], [0.2]])),)
    >>> schedule = GainSchedule("schedule", make_controller("ramp"), (0.5, 1.0), (0.175,), gains)
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(schedule.set_up(crane.replace(gap=gap))[0].time, 9) for gap in (0.1, 0.5, 0.75, 9)]
    [0.1, 0.1, 0.15, 0.2]
    """

    gaps: tuple[float, ...]
    load_inertias: tuple[float, ...]
    gains: tuple[tuple[str, Scale, Vector], ...]

    def gains_at(self, gap: float, load_inertia: float) -> dict[str, float]:
        """The gains for a gap in rad and a load inertia in kg m2."""
        row, below, across = _place(self.gaps, gap)
        column, right, along = _place(self.load_inertias, load_inertia)
        gains = {}
        for name, scale, values in self.gains:
            near = _mixed(values[row, column], values[row, right], along, scale)
            far = _mixed(values[below, column], values[below, right], along, scale)
            gains[name] = float(_mixed(near, far, across, scale))
        return gains

    def set_up(self, drive: Drive) -> tuple[Controller, Drive]:
        """The controller with the gains for the drive's gap and load inertia, set up for the drive."""
        gains = self.gains_at(drive.gap, drive.load_inertia)
        ready, drive_of_gains = replace(self.controller, **gains).set_up(drive)
        return self._called(ready), drive_of_gains

    @property
    def parameters(self) -> dict[str, object]:
        """Grid and gains."""
        grid = {"gaps": list(self.gaps), "load_inertias": list(self.load_inertias)}
        return grid | {name: values.tolist() for name, _, values in self.gains}


def _place(nodes: tuple[float, ...], value: float) -> tuple[int, int, float]:
    """The nodes beside a value, and the way to the second as a share of the step; clamped to the grid."""
    inside = min(max(value, nodes[0]), nodes[-1])
    below = min(bisect_right(nodes, inside) - 1, max(len(nodes) - 2, 0))
    above = min(below + 1, len(nodes) - 1)
    step = nodes[above] - nodes[below]
    return below, above, (inside - nodes[below]) / step if step > 0.0 else 0.0


def _mixed(first: float, second: float, share: float, scale: Scale) -> float:
    """Between two values; at share 0 and 1 the values themselves, to the bit."""
    if share == 0.0 or first == second:
        return first
    if share == 1.0:
        return second
    if scale == "logarithmic":
        return math.exp((1.0 - share) * math.log(first) + share * math.log(second))
    return (1.0 - share) * first + share * second


def display_name(controller: Controller, label: str) -> str:
    """The name of tuned gains in tables."""
    return f"{label_of(controller)} ({label})"


def scheduled(saved: ScheduleFile, label: str, controller: Controller) -> GainSchedule:
    """The controller with a schedule."""
    known = [f.name for f in fields(controller)]
    unknown = [name for name in saved.gains if name not in known]
    if unknown:
        raise InputError(
            f"gains {', '.join(unknown)}: the controller {controller.name} has no such parameter; "
            f"it has {', '.join(known) or 'none'}."
        )
    gains = tuple((name, gain.scale, gain.values) for name, gain in saved.gains.items())
    schedule = GainSchedule(label, controller, saved.gaps, saved.load_inertias, gains)
    for gap in saved.gaps:  # the gains of each node are ones that the controller takes
        for inertia in saved.load_inertias:
            replace(controller, **schedule.gains_at(gap, inertia))
    return schedule


def derived_from_nominal(tuned: RobustGains, given: Controller, drives: Iterable[Drive]) -> dict[str, object]:
    """Values that tuned gains derive from the nominal drive, the controller `given` otherwise from others.

    By name, in SI units: parameters that are not given to it, then numbers that its step has beside all
    parameters. With the gains alone, set up for one of these drives, it is thus another controller.

    >>> from softstart.controller import make_controller
    >>> crane, given = Drive.load("crane-4amtkf"), make_controller("reduced-two-stage", {"torque": 15.5})
    >>> tuned = RobustGains("robust", given.fitted(crane), crane)
    >>> derived = derived_from_nominal(tuned, given, [crane.replace(gap=1)])
    >>> {name: round(value, 4) for name, value in derived.items()}
    {'wait': 0.0164}
    """
    ready, nominal = tuned.controller.set_up(tuned.nominal)
    exact = given.set_up(nominal)[0].parameters

    def numbers(drive: Drive) -> dict[str, float]:
        return ready.named_numbers(drive) if isinstance(ready, CompiledController) else {}

    names, here = dict[str, None](), numbers(nominal)
    for drive in drives:
        own, there = given.set_up(drive)[0].parameters, numbers(drive)
        names |= {name: None for name, value in exact.items() if own[name] != value}
        names |= {name: None for name, value in here.items() if there[name] != value}
    known = {**ready.parameters, **here}
    return {name: known[name] for name in sorted(names, key=list(known).index)}


# ---- reading --------------------------------------------------------------------------------------------


def read_gain_file(path: Path) -> GainFile:
    """Tuned gains from a file. Raises InputError in sentences that name file, key and remedy."""
    try:
        text = read_text(path)
    except RefusedError as refusal:
        remedy = "; softstart tune --out DIR writes robust.toml and schedule.toml"
        raise refused_file(path, refusal.reason + (remedy if refusal.reason == ABSENT else "")) from None
    return read_gains(text, path)


def read_gains(text: str, path: Path) -> GainFile:
    """Tuned gains, or settings, from the text of the file `path`."""
    document = parsed(text, Wording(f'controller = "{path}"', style="toml"), "a gain")
    kind = document.get("kind")
    if kind == ROBUST:
        return _read_robust(document, path)
    if kind == SCHEDULE:
        return _read_schedule(document, path)
    if kind == SETTINGS:
        return SettingsFile(_name(document, path), dict(_section(document, "parameters", path)))
    raise refused_file(
        path,
        "this file holds no tuned gains; give one that softstart tune has written, or play a torque profile "
        "with --controller profile --param file=PATH",
    )


def refused_file(path: Path, reason: str) -> InputError:
    """The error for a file of gains."""
    return InputError(f'controller = "{path}": {reason}.')


def _name(document: Mapping[str, object], path: Path) -> str:
    name = document.get("controller")
    if not isinstance(name, str) or not name:
        raise refused_file(
            path, 'the key controller is missing; write the controller\'s name, as controller = "ramp"'
        )
    return name


def _section(document: Mapping[str, object], key: str, path: Path, needed: bool = True) -> dict[str, object]:
    section = document.get(key, None if needed else {})
    if not isinstance(section, dict):
        raise refused_file(path, f"the table [{key}] is missing; write the file again with softstart tune")
    return section


def _read_robust(document: Mapping[str, object], path: Path) -> RobustFile:
    name = _name(document, path)
    parameters = _section(document, "parameters", path)
    tables = _section(document, "drive", path)
    drive = Drive.from_tables(tables, where=f'controller = "{path}", [drive]')
    about = _section(document, "about", path, needed=False)
    cells = (_axis(about[key], key, path) if key in about else () for key in ("gaps", "load_inertias"))
    return RobustFile(name, dict(parameters), drive, *cells)


def _read_schedule(document: Mapping[str, object], path: Path) -> ScheduleFile:
    name = _name(document, path)
    gaps = _axis(document.get("gaps"), "gaps", path)
    inertias = _axis(document.get("load_inertias"), "load_inertias", path)
    gains: dict[str, Gain] = {}
    for key, table in _section(document, "gains", path).items():
        scale = table.get("scale") if isinstance(table, dict) else None
        values = table.get("values") if isinstance(table, dict) else None
        shape = (len(gaps), len(inertias))
        gains[key] = Gain(_scale(scale, key, path), _values(values, shape, key, path))
    fixed = _section(document, "fixed", path, needed=False)
    return ScheduleFile(name, gaps, inertias, _positive(gains, path), dict(fixed))


def _axis(values: object, name: str, path: Path) -> tuple[float, ...]:
    numbers = _array(values)
    good = numbers.ndim == 1 and numbers.size > 0 and bool(np.all(np.isfinite(numbers)))
    if not good or bool(np.any(np.diff(numbers) <= 0.0)) or numbers[0] < 0.0:
        raise refused_file(path, f"{name} = {values}: give a list of numbers that rise, 0 or more")
    return tuple(numbers.tolist())


def _array(values: object) -> Vector:
    """The values as an array; an empty one for what is no table of numbers."""
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)


def _scale(scale: object, name: str, path: Path) -> Scale:
    if scale in get_args(Scale):
        return cast(Scale, scale)
    raise refused_file(path, f'[gains.{name}] scale = {scale!r}: write "linear" or "logarithmic"')


def _values(values: object, shape: tuple[int, int], name: str, path: Path) -> NDArray[np.float64]:
    table = _array(values)
    if table.shape != shape or not np.all(np.isfinite(table)):
        raise refused_file(
            path,
            f"[gains.{name}] values: give {shape[0]} rows, one a gap, of {shape[1]} numbers, one an inertia",
        )
    return table


def _positive(gains: dict[str, Gain], path: Path) -> dict[str, Gain]:
    for name, gain in gains.items():
        if gain.scale == "logarithmic" and not np.all(gain.values > 0.0):
            raise refused_file(path, f'the gain {name} is 0 or less in a cell; its scale must be "linear"')
    if not gains:
        raise refused_file(path, "it has no gains; write the file again with softstart tune")
    return gains


DERIVED = (
    "# derived from the drive below, in SI units: the gains alone, set up for another drive, derive others;\n"
    "# this file is the same controller for every drive: --controller FILE, in an export --gains FILE"
)

# ---- writing --------------------------------------------------------------------------------------------


def meanings_of(controller: Controller) -> dict[str, str]:
    """What each parameter of a controller is, with its unit, as a comment.

    >>> from softstart.controller import make_controller
    >>> meanings_of(make_controller("ramp"))["time"]
    's: duration of the rise'
    """
    declared = {name: one for name, one in declared_parameters(controller).items() if one.declared}
    units = {name: f"{one.unit}: " if one.unit not in ("", "1") else "" for name, one in declared.items()}
    return {name: units[name] + one.meaning for name, one in declared.items()}


def robust_text(
    saved: RobustFile,
    about: Mapping[str, object] | None = None,
    meanings: Mapping[str, str] | None = None,
    derived: Mapping[str, object] | None = None,
) -> str:
    """The TOML text of a robust set; of `about`, which says where it comes from, only the cells are read.

    Not read are `meanings`, nor `derived`, what it takes from its drive (`derived_from_nominal`).

    >>> from pathlib import Path
    >>> saved = RobustFile("ramp", {"time": 0.12}, Drive.load("crane-4amtkf"))
    >>> read_gains(robust_text(saved), Path("robust.toml")) == saved
    True
    """
    blocks = [
        f"# softstart simulate DRIVE --controller FILE plays it\nkind = {literal(ROBUST)}\n"
        f"controller = {literal(saved.controller)}",
        _table("parameters", saved.parameters, meanings),
        *([_table("about", about)] if about else []),
        *([f"{DERIVED}\n{_table('about.derived', derived)}"] if derived else []),
        _nested(saved.drive),
    ]
    return "\n\n".join(blocks) + "\n"


def schedule_text(
    saved: ScheduleFile, about: Mapping[str, object] | None = None, meanings: Mapping[str, str] | None = None
) -> str:
    """The TOML text of a schedule; `about` says where it comes from and is not read, nor are `meanings`."""
    said = meanings or {}
    blocks = [
        "# softstart simulate DRIVE --controller FILE plays it, with the gap and load inertia that DRIVE "
        f"declares\nkind = {literal(SCHEDULE)}\ncontroller = {literal(saved.controller)}\n"
        f"gaps = {literal(saved.gaps)}  # rad, the rows of each table of values\n"
        f"load_inertias = {literal(saved.load_inertias)}  # kg*m^2, its columns",
        *([_table("fixed", saved.fixed, said)] if saved.fixed else []),
    ]
    for name, gain in saved.gains.items():
        rows = "".join(f"    {literal(row)},\n" for row in gain.values)
        what = f"  # {said[name]}" if name in said else ""
        blocks.append(f"[gains.{name}]{what}\nscale = {literal(gain.scale)}\nvalues = [\n{rows}]")
    if about:
        blocks.append(_table("about", about))
    return "\n\n".join(blocks) + "\n"


def strategy_text(controller: Controller) -> str:
    """The TOML text of a controller: of tuned gains theirs, of any other its settings.

    >>> from pathlib import Path
    >>> from softstart.controller import make_controller
    >>> read_gains(strategy_text(make_controller("ramp", {"time": "120 ms"})), Path("mine.toml"))
    SettingsFile(controller='ramp', parameters={'time': 0.12})
    """
    base = controller.controller if isinstance(controller, Tuned) else controller
    name = type(base).name or label_of(base)
    values = {one.name: getattr(base, one.name) for one in fields(base)}
    given: dict[str, object] = {
        key: value for key, value in values.items() if isinstance(value, str | int | float)
    }
    if isinstance(controller, RobustGains):
        cells = (
            {"gaps": controller.gaps, "load_inertias": controller.load_inertias} if controller.gaps else None
        )
        return robust_text(RobustFile(name, given, controller.nominal), cells, meanings_of(base))
    if isinstance(controller, GainSchedule):
        gains = {gain: Gain(scale, values) for gain, scale, values in controller.gains}
        fixed = {key: value for key, value in given.items() if key not in gains}
        grid = ScheduleFile(name, controller.gaps, controller.load_inertias, gains, fixed)
        return schedule_text(grid, None, meanings_of(base))
    head = f"kind = {literal(SETTINGS)}\ncontroller = {literal(name)}"
    return "\n\n".join([head, _table("parameters", given, meanings_of(base))]) + "\n"


def schedule_csv(saved: ScheduleFile, columns: Mapping[str, NDArray[np.float64]] | None = None) -> str:
    """A schedule as a table, one row per cell; `columns` are further figures of the cells."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*AXES, *saved.gains, *(columns or {})])
    for i, gap in enumerate(saved.gaps):
        for j, inertia in enumerate(saved.load_inertias):
            exact = gap, inertia, *(gain.values[i, j] for gain in saved.gains.values())
            figures = (table[i, j].item() for table in (columns or {}).values())
            writer.writerow([*map(float, exact), *map(_figure, figures)])
    return stream.getvalue()


def _figure(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(f"{value:.6g}"))
    return str(value)


def _table(name: str, values: Mapping[str, object], meanings: Mapping[str, str] | None = None) -> str:
    said = {key: f"  # {what}" for key, what in (meanings or {}).items()}
    lines = [
        f"{key} = {literal(value)}{said.get(key, '')}" for key, value in values.items() if value is not None
    ]
    return "\n".join([f"[{name}]", *lines])


def _nested(drive: Drive) -> str:
    """The drive's own file, below the table [drive]."""
    lines = drive.to_toml().splitlines()
    nested = [re.sub(r"^\[+", r"\g<0>drive.", line) for line in lines]
    return "\n".join(["[drive]", *nested])
