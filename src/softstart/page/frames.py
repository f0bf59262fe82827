"""What the page shows of a bench, as plain data: fields, table, figures, traces, map."""

from __future__ import annotations

import math
import secrets
from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import Any

from softstart.controller.base import Controller
from softstart.drive import PARAMETERS, Drive
from softstart.page.bench import Bench, Strategy
from softstart.page.live import Frame
from softstart.page.map import Axes, axes_about, k_dyn_row
from softstart.page.scales import Scale, scales_about
from softstart.page.traces import traces_of
from softstart.start import metrics

QUICK_EVENTS = 8_000  # of a start that follows the hand; longer ones are computed when the drive is at rest
QUICK = 0.010  # s, of a start that is computed at every step of a hand, even if no picture follows
LONG = (math.inf, math.inf)
TOO_LATE = 0.3  # s
SLICE = 0.006  # s, about what is computed before the loop looks for something newer
SERVER = secrets.token_urlsafe(8)  # this process, to which a tab that is loaded anew comes back, or does not
PACKED = ("t", "T", "u", "w1", "w2", "theta")


class Screen:
    """The frames of one bench; keeps what the browser has already, so that nothing is sent twice."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.scales = scales_about(bench.origin)
        self.axes = axes_about(bench.origin)
        self.kept = False  # the map keeps the controller as it is set up for the drive of the moment
        self.stamp = 0.0  # the browser's clock at the last input that has been taken
        self.late = 0.0  # s, how long the last message has waited to be read
        self.mistakes: dict[str, str] = {}  # sentences by the field they stand beside
        self._costs: dict[str, tuple[float, float]] = {}  # of the last two starts of each strategy, s
        self._origin = bench.origin
        self._next = 0  # whose turn it is among the other strategies
        self._map_of: tuple[Drive, Controller, bool, Axes] | None = None  # of what the browser has all rows
        self._map_seen = False  # it has some rows, of whatever
        self._drive_kept: Drive | None = None  # by its tab

    @property
    def version(self) -> int:
        """That of the bench."""
        return self.bench.version

    def follow_origin(self) -> bool:
        """Set sliders and map anew when another drive was loaded; True if so."""
        if self._origin is self.bench.origin:
            return False
        self._origin = self.bench.origin
        self.scales = scales_about(self._origin)
        self.axes = axes_about(self._origin)
        self._map_of = None
        self.mistakes.clear()
        return True

    def forget(self) -> None:
        """The browser has lost what it had: send the map again."""
        self._map_of = None
        self._map_seen = False

    def glance(self) -> Frame | None:
        """The large figure alone, where one of the last two starts of the selected strategy was quick.

        None while messages wait to be read: then each start would make the others wait longer.
        """
        bench = self.bench
        if self.late > TOO_LATE:
            return None
        if self._origin is not bench.origin or min(self._costs.get(bench.selected, LONG)) > QUICK:
            return None
        found = self._result(bench.selected)
        return {"stamp": self.stamp, "version": bench.version, "figure": figure(bench, found)}

    def _result(self, label: str) -> Strategy:
        found = self.bench.result(label, QUICK_EVENTS)
        self._costs[label] = (self._costs.get(label, LONG)[1], found.cost)
        return found

    # frames that follow the hand -----------------------------------------------------------------------

    def first(self) -> Frame:
        """Fields, the large figure and the traces of the selected strategy."""
        self.follow_origin()
        bench = self.bench
        found = self._result(bench.selected)
        return {
            "stamp": self.stamp,
            "version": bench.version,
            "mistakes": dict(self.mistakes),
            "fields": fields(bench.drive, self.scales),
            "drive": bench.drive.name,
            "order": list(bench.controllers),
            "shown": list(bench.shown),
            "added": list(bench.added),
            "selected": bench.selected,
            "figure": figure(bench, found),
            "traces": {bench.selected: drawn(found)},
            "rows": [row(bench, found)],
            "here": here(bench.drive),
            "map_is_old": self._map_seen and not self._map_is_right(),
        }

    def others(self) -> Iterator[Frame | None]:
        """Rows of the other strategies and the traces of those that are shown, a few ms at a time.

        While a hand keeps moving, each call goes on where the last one was left, so that all have their turn.
        """
        bench = self.bench
        labels = [label for label in bench.controllers if label != bench.selected]
        begun = perf_counter()
        frame: Frame = {"rows": [], "traces": {}}
        for _ in range(len(labels)):
            label = labels[self._next % len(labels)]
            self._next += 1
            found = self._result(label)
            frame["rows"].append(row(bench, found))
            if label in bench.shown:
                frame["traces"][label] = drawn(found, ("t", "T"))
            if perf_counter() - begun > SLICE:
                yield frame
                begun, frame = perf_counter(), {"rows": [], "traces": {}}
        if frame["rows"]:
            yield frame

    # when the drive is at rest -------------------------------------------------------------------------

    def at_rest(self) -> Iterator[Frame | None]:
        """The drive, for the tab to keep; long starts, K_dyn with a worn gap, then the map."""
        bench = self.bench
        if self._drive_kept is not bench.drive:
            self._drive_kept = bench.drive
            yield {"keep": {"server": SERVER, "drive": bench.drive.to_toml()}}
        for label in bench.controllers:
            if bench.ready(label) is None:
                found = bench.result(label)
                frame: Frame = {"rows": [row(bench, found)]}
                if label == bench.selected:
                    frame |= self.first() | {"at_rest": True}
                elif label in bench.shown:
                    frame["traces"] = {label: drawn(found, ("t", "T"))}
                yield frame
            bench.worn(label)
            yield None
        yield {"rows": [row(bench, found) for found in bench.strategies]}
        yield from self._map()

    def _map(self) -> Iterator[Frame | None]:
        bench, axes = self.bench, self.axes
        if self._map_is_right():
            return
        drive, controller = bench.drive, bench.controllers[bench.selected]
        wanted = self._map_drive(), controller, self.kept, axes
        nominal = drive if self.kept else None
        cells = 4  # computed in one slice; as many as fit into it
        order = from_middle(len(axes.inertias), axes.nearest(*here(drive))[1])
        self._map_of, self._map_seen = (
            None,
            True,
        )  # from here on it has rows of both, if this is left half-way
        for index in order:
            k: list[float | None] = []
            while len(k) < len(axes.gaps):
                begun = perf_counter()
                part = axes.gaps[len(k) : len(k) + cells]
                k += numbers(k_dyn_row(drive, controller, part, axes.inertias[index], nominal))
                each = (perf_counter() - begun) / len(part)
                cells = min(max(int(SLICE / each), 1), len(axes.gaps))
                yield None
            if index == order[-1]:
                self._map_of = wanted
            yield {"map_row": {"index": index, "k": k}, "map": self._map_head()}

    def _map_is_right(self) -> bool:
        """True if the browser has the map of this drive and strategy."""
        if self._map_of is None:
            return False
        drive, controller, kept, axes = self._map_of
        same = controller is self.bench.controllers[self.bench.selected]
        return same and kept == self.kept and axes == self.axes and drive == self._map_drive()

    def _map_drive(self) -> Drive:
        """What of the drive a map depends on: not its gap and inertia, unless the controller is kept."""
        drive, axes = self.bench.drive, self.axes
        return drive if self.kept else drive.replace(gap=axes.gaps[0], load_inertia=axes.inertias[0])

    def _map_head(self) -> dict[str, Any]:
        return {
            "gaps": list(self.axes.gaps),
            "inertias": list(self.axes.inertias),
            "strategy": self.bench.selected,
            "kept": self.kept,
        }


def from_middle(count: int, middle: int) -> list[int]:
    """0 to count - 1, those near the middle first.

    >>> from_middle(5, 3)
    [3, 2, 4, 1, 0]
    """
    return sorted(range(count), key=lambda index: (abs(index - middle), index))


def number(value: float) -> float | None:
    """A number that JSON can carry."""
    return float(value) if math.isfinite(value) else None


def numbers(values: Any) -> list[float | None]:
    """Numbers that JSON can carry."""
    return [number(value) for value in values.tolist()]


def fields(drive: Drive, scales: Mapping[str, Scale]) -> dict[str, list[Any]]:
    """By parameter: text of the field, position of the slider or None, and the value told otherwise."""
    shown: dict[str, list[Any]] = {}
    for name, parameter in PARAMETERS.items():
        value = getattr(drive, name)
        if name == "source" or value is None:
            continue
        text = value if isinstance(value, str) else written(float(value))
        scale = scales.get(name)
        position = scale.position(float(value)) if scale else None
        shown[parameter.path] = [text, position, otherwise(parameter.unit, value)]
    return shown


def written(value: float) -> str:
    """A value as the field shows it: six digits, or all where six would be another value of a slider.

    >>> written(0.0698131700797732), written(880.0), written(0.1235)
    ('0.0698132', '880', '0.1235')
    """
    return f"{value:.6g}"


def otherwise(unit: str, value: Any) -> str:
    """An angle in degrees, a speed in revolutions a minute, for those who think in them.

    >>> otherwise("rad", 0.5), otherwise("rad/s", 92.15)
    ('28.6\N{DEGREE SIGN}', '880 rpm')
    """
    if unit == "rad":
        return f"{math.degrees(value):.3g}\N{DEGREE SIGN}"
    if unit == "rad/s":
        return f"{value * 30.0 / math.pi:.4g} rpm"
    if unit == "s":
        return f"{1e3 * value:.3g} ms"
    return ""


def figure(bench: Bench, found: Strategy) -> dict[str, Any]:
    """The large figure and what stands about it."""
    run = found.run
    facts: dict[str, Any] = {
        "name": found.name,
        "status": found.status,
        "base": number(float(metrics.base_torque(bench.drive))),
        "k_dyn": number(found.k_dyn),
        "start_time": number(found.start_time),
        "peak_torque": number(found.peak_torque),
        "time_lost": number(bench.time_lost(found.name)) if run is not None else None,
    }
    if run is not None:
        facts |= {
            "reached": math.isfinite(run.start_time),
            "peak_time": number(run.peak_time),
            "contacts": run.contacts,
            "impact_speed": number(run.impact_speed),
            "end_time": number(run.end_time),
        }
    return facts


def row(bench: Bench, found: Strategy) -> dict[str, Any]:
    """One line of the table; `worn` is left out while it is not computed."""
    label = found.name
    line: dict[str, Any] = {
        "name": label,
        "k_dyn": number(found.k_dyn),
        "peak_torque": number(found.peak_torque),
        "start_time": number(found.start_time),
        "time_lost": number(bench.time_lost(label)) if found.run is not None else None,
        "trouble": found.trouble or ("" if math.isfinite(found.start_time) else found.status),
    }
    worn = bench.worn_ready(label)
    if worn is not None:
        line["worn"] = number(worn)
    return line


def drawn(found: Strategy, channels: tuple[str, ...] = PACKED) -> dict[str, Any] | None:
    """Traces as the browser draws them: packed channels, stages and the located peak."""
    run = found.run
    if run is None:
        return None
    picture: dict[str, Any] = {"rows": len(channels), "data": traces_of(run).packed(*channels)}
    if "u" in channels:
        stages = [(s.start, s.end, s.side) for s in run.stages[:400] if s.duration > 0.0]
        largest = max(run.stages, key=lambda stage: abs(stage.peak_torque), default=None)
        picture |= {
            "stages": stages,
            "peak": [run.peak_time, largest.peak_torque if largest else 0.0],
            "gap": float(run.drive.gap),
            "target": float(run.drive.target_speed),
        }
    return picture


def here(drive: Drive) -> tuple[float, float]:
    """Where the drive stands in the map: gap and load inertia."""
    return float(drive.gap), float(drive.load_inertia)
