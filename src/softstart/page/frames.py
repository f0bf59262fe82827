"""What the page shows of a session, as plain data: fields, table, figures, traces, map."""

from __future__ import annotations

import math
import secrets
from base64 import b64encode
from collections.abc import Iterator, Mapping
from dataclasses import Field
from dataclasses import fields as fields_of
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.chain.machines import Machine
from softstart.controller.base import Controller
from softstart.controller.tuned import Tuned
from softstart.drive import Drive
from softstart.drive.doubts import doubts
from softstart.kernel import records as at
from softstart.page import links
from softstart.page.live import Frame
from softstart.page.machines import (
    HEAD,
    LIMITS,
    Axes,
    Entry,
    Scale,
    axes_about,
    bases,
    entries,
    k_dyn_row,
    map_words,
    placeless,
    scales_about,
    scales_of,
)
from softstart.page.sentences import differences, sentence_of, written
from softstart.page.session import Bench, Reference, Session, Strategy
from softstart.quantities import Units
from softstart.start.run import Run
from softstart.views.numbers import unit, units_of
from softstart.views.starts import position_notes

QUICK_EVENTS = 8_000  # of a start that follows the hand; longer ones are computed when the drive is at rest
QUICK = 0.010  # s, of a start that is computed at every step of a hand, even if no picture follows
LONG = (math.inf, math.inf)
TOO_LATE = 1.0  # s, of messages that waited; what is quick to compute overtakes the hand after a shorter halt
SLICE = 0.006  # s, about what is computed before the loop looks for something newer
SERVER = secrets.token_urlsafe(8)  # this process, to which a tab that is loaded anew comes back, or does not
CHANNELS = ("T", "u", "w1", "w2", "theta")
MOST_STAGES = 400  # of one gap, shaded and lit up
BUCKETS = 320  # about one for three pixels of the widest plot; each keeps the extrema of each channel
WITHIN = 1600  # points in a window of the plots: one a pixel, nearly
PER_PERIOD = 16  # points an elastic period before thinning: its crests are then within 2 % at worst
COARSEST, FINEST = 500, 8000
JUMPS = 120  # up to so many spans, both sides of each joint are kept: steps of the torque stay upright
STRATEGY = "strategy."  # before the names of the parameters of the selected strategy


class Screen:
    """The frames of one session; keeps what the browser has already, so that nothing is sent twice."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.entries = entries(session.origin)
        self.scales = scales_about(session.origin)
        self.axes = axes_about(session.origin)
        self.kept = False  # the map keeps the controller as it is set up for the drive of the moment
        self.stamp = 0.0  # the browser's clock at the last input that has been taken
        self.late = 0.0  # s, how long the last message has waited to be read
        self.window: tuple[float, float] | None = None  # s, what of the starts is seen; None for all
        self.mistakes: dict[str, str] = {}  # sentences by the field they stand beside
        self._costs: dict[str, tuple[float, float]] = {}  # of the last two starts of each strategy, s
        self._origin = session.origin
        self._next = 0  # whose turn it is among the other strategies
        self._map_of: tuple[Machine, Controller, bool, Axes] | None = None  # of what the browser has all rows
        self._bench_kept: Bench | None = None  # by its tab
        self.strategy_scales: Mapping[str, Scale] = {}  # sliders of the selected strategy
        self._strategy_of: tuple[object, ...] = ()  # what these and the rows in the browser are for
        self._groups_of: tuple[object, ...] = ()  # the fields that the browser has
        self._reference_of: tuple[object, ...] = ()  # the reference that the browser has, and its window

    @property
    def units(self) -> Units:
        """The units of the machine, else those in which it was loaded: a gap of 0 has none of its own."""
        own, loaded = units_of(self.session.machine), units_of(self.session.origin)
        speed = own.speed if own.speed != Units().speed else loaded.speed
        if self.session.machine.units or own.angle != Units().angle:
            return own._replace(speed=own.speed if self.session.machine.units else speed)
        return loaded._replace(speed=speed)

    @property
    def version(self) -> int:
        """That of the session."""
        return self.session.version

    def follow_origin(self) -> bool:
        """Set sliders and map anew when another drive was loaded; True if so."""
        if self._origin is self.session.origin:
            return False
        self._origin = self.session.origin
        self.entries = entries(self._origin)
        self.scales = scales_about(self._origin)
        self.axes = axes_about(self._origin)
        self._map_of = None
        self.mistakes.clear()
        return True

    def forget(self) -> None:
        """The browser has lost what it had: send the map again."""
        self._map_of = None
        self._strategy_of = self._reference_of = self._groups_of = ()
        self._bench_kept = None

    def glance(self) -> Frame | None:
        """The large figure alone, where one of the last two starts of the selected strategy was quick.

        None while messages wait to be read: then each start would make the others wait longer.
        """
        session = self.session
        if self.late > TOO_LATE:
            return None
        if self._origin is not session.origin or min(self._costs.get(session.selected, LONG)) > QUICK:
            return None
        found = self._result(session.selected)
        figures = figure(session, found, self.units)
        return {"stamp": self.stamp, "version": session.version, "figure": figures}

    def _result(self, label: str) -> Strategy:
        found = self.session.result(label, QUICK_EVENTS)
        self._costs[label] = (self._costs.get(label, LONG)[1], found.cost)
        return found

    def _groups(self) -> Frame:
        """The fields of the machine in their groups, if the browser has others."""
        wanted = (
            bool(self._origin.limits),
            self.units,
            *((path, one.group, one.label, path in self.scales) for path, one in self.entries.items()),
        )
        if self._groups_of == wanted:
            return {}
        self._groups_of = wanted
        found: dict[str, list[Frame]] = {}
        for path, one in self.entries.items():
            found.setdefault(one.group, []).append(_field(one, path in self.scales, self.units))
        folded = "" if self._origin.limits else LIMITS
        return {
            "groups": [
                {"title": title, "rows": rows, "folded": title == folded, "head": title == HEAD}
                for title, rows in found.items()
            ]
        }

    # parameters of the selected strategy ---------------------------------------------------------------

    def strategy_paths(self) -> frozenset[str]:
        """The fields of the selected strategy: none for tuned gains and profiles, which come from files."""
        controller = self.session.controllers[self.session.selected]
        return frozenset(STRATEGY + one.name for one in parameters_of(controller))

    def si(self, path: str) -> str:
        """The SI unit of a field; empty where it has none."""
        if path in self.entries:
            return self.entries[path].parameter.unit
        own = parameters_of(self.session.controllers[self.session.selected])
        return next((str(one.metadata["unit"]) for one in own if STRATEGY + one.name == path), "")

    def _strategy_rows(self) -> Frame:
        """The fields of the selected strategy, if the browser has others."""
        session = self.session
        controller = session.controllers[session.selected]
        wanted = (session.selected, type(controller), self._origin, self.units)
        if self._strategy_of == wanted:
            return {}
        self._strategy_of = wanted
        return {
            "strategy": {
                "name": session.selected,
                "rows": [self._row(one) for one in parameters_of(controller)],
            }
        }

    def _row(self, one: Field[Any]) -> dict[str, Any]:
        about = one.metadata
        return {
            "path": STRATEGY + one.name,
            "symbol": "",
            "label": one.name.replace("_", " "),
            "meaning": f"{about['meaning']}; default: {about['default'] or 'fixed'}",
            "unit": unit(self.units.of(about["unit"])),
            "slider": one.name in self.strategy_scales,
            "choices": list(about["choices"]),
            "words": False,
            "suggestions": [],
        }

    def _strategy_fields(self, found: Strategy) -> dict[str, list[Any]]:
        """Values of the selected strategy's parameters on the drive of the moment, as `fields` has them."""
        session = self.session
        controller = session.controllers[session.selected]
        units = {one.name: one.metadata["unit"] for one in parameters_of(controller)}
        try:
            if self._strategy_of[:3] != (session.selected, type(controller), self._origin):
                self.strategy_scales = scales_of(controller, self._origin)
            default = controller.defaults(_told(session, found))
        except Exception as error:  # a controller is anyone's code; its start has said what is wrong
            sentence_of(error)  # which is logged
            return {}
        tuned = [
            (label, known.run.controller)
            for label, other in session.controllers.items()
            if isinstance(other, Tuned) and type(other.controller) is type(controller)
            and (known := session.ready(label)) is not None and known.run is not None
        ]  # fmt: skip
        shown: dict[str, list[Any]] = {}
        for name, si in units.items():
            given = getattr(controller, name)
            value = default.get(name) if given is None else given
            if isinstance(value, str):
                shown[STRATEGY + name] = [value, None, "", []]
                continue
            number = math.nan if value is None else float(value)
            scale = self.strategy_scales.get(name)
            marks = []
            if scale is not None:
                values = [("default", float(default[name]))]
                values += [(label, float(at)) for label, other in tuned
                           if (at := getattr(other, name, None)) is not None]  # fmt: skip
                marks = [
                    [scale.position(value), f"{of}: {self.units.shown(value, si):.4g}"]
                    for of, value in values
                ]
            text = f"{self.units.shown(number, si):.4g}" if given is None else written(number, si, self.units)
            text = "" if math.isnan(number) else text
            position = scale.position(number) if scale is not None else None
            shown[STRATEGY + name] = [text, position, "" if given is None else "changed", marks]
        return shown

    # frames that follow the hand -----------------------------------------------------------------------

    def first(self) -> Frame:
        """Fields, the large figure and the traces of the selected strategy."""
        other = self.follow_origin()
        session = self.session
        found = self._result(session.selected)
        return {
            "other": other,
            "stamp": self.stamp,
            "version": session.version,
            "mistakes": dict(self.mistakes),
            "fields": fields(session.machine, session.origin, self.entries, self.scales, self.units)
            | self._strategy_fields(found),
            **self._groups(),
            **self._strategy_rows(),
            "steps": session.steps,
            "drive": session.machine.name,
            "order": list(session.controllers),
            "shown": list(session.shown),
            "added": list(session.added),
            "changed": list(session.changed),
            "selected": session.selected,
            "figure": figure(session, found, self.units),
            "traces": {session.selected: drawn(found, self.units, window=self.window)},
            "rows": [row(session, found)],
            "reference": self._reference(),
            "mapped": self.axes is not None,
            "here": self._here(),
            "map_is_old": not self._map_is_right(),
        }

    def _reference(self) -> Frame | None:
        """What the strategies are compared with, in words and figures; its trace if that is new."""
        kept, found = self.session.bench.reference, self.session.reference()
        if kept is None or found is None:
            return None
        line = outcomes(found) | {"name": ", ".join(filter(None, reference_words(kept, self.session)))}
        if self._reference_of != (kept, self.window, self.units):
            self._reference_of = kept, self.window, self.units
            line["trace"] = drawn(found, self.units, window=self.window)
        return line

    def _here(self) -> tuple[float, float]:
        gap, inertia = self.session.machine.gap_and_inertia
        return self.units.shown(gap, "rad"), inertia

    def others(self) -> Iterator[Frame | None]:
        """Rows of the other strategies and the traces of those that are shown, a few ms at a time.

        While a hand keeps moving, each call goes on where the last one was left, so that all have their turn.
        """
        session = self.session
        labels = [label for label in session.controllers if label != session.selected]
        begun = perf_counter()
        frame: Frame = {"rows": [], "traces": {}}
        for _ in range(len(labels)):
            label = labels[self._next % len(labels)]
            self._next += 1
            found = self._result(label)
            frame["rows"].append(row(session, found))
            if label in session.shown:
                frame["traces"][label] = drawn(found, self.units, False, self.window)
            if perf_counter() - begun > SLICE:
                yield frame
                begun, frame = perf_counter(), {"rows": [], "traces": {}}
        if frame["rows"]:
            yield frame

    # when the drive is at rest -------------------------------------------------------------------------

    def at_rest(self) -> Iterator[Frame | None]:
        """The drive, for the tab to keep; long starts, changed drives, what is recommended, then the map."""
        session = self.session
        if self._bench_kept is not session.bench:
            self._bench_kept = session.bench
            name, link = links.keep(session)
            yield {"keep": {"server": SERVER, "bench": name, "link": link}}
        for label in session.controllers:
            if session.ready(label) is None:
                found = session.result(label)
                frame: Frame = {"rows": [row(session, found)]}
                if label == session.selected:
                    frame |= self.first() | {"at_rest": True}
                elif label in session.shown:
                    frame["traces"] = {label: drawn(found, self.units, False, self.window)}
                yield frame
            yield from (None for _ in session.judged(label))
        rows = [row(session, found) for found in session.strategies]
        machine = session.machine
        remarks = {"doubts": doubts(machine), "assumed": [one for one in machine.assumed.split("; ") if one]}
        yield {"rows": rows, "recommendation": session.recommendation().text, "remarks": remarks}
        yield from self._map()

    def _map(self) -> Iterator[Frame | None]:
        session, axes = self.session, self.axes
        if axes is None or self._map_is_right():
            return
        machine, controller = session.machine, session.controllers[session.selected]
        wanted = self._map_machine(axes), controller, self.kept, axes
        nominal = machine if self.kept else None
        cells = 4  # computed in one slice; as many as fit into it
        head = self._map_head(axes)
        order = from_middle(len(axes.inertias), axes.nearest(*machine.gap_and_inertia)[1])
        self._map_of = None  # from here on it has rows of both, if this is left half-way
        for index in order:
            k: list[float | None] = []
            while len(k) < len(axes.gaps):
                begun = perf_counter()
                part = axes.gaps[len(k) : len(k) + cells]
                row = k_dyn_row(machine, controller, part, axes.inertias[index], nominal, session.origin)
                k += numbers(row)
                each = (perf_counter() - begun) / len(part)
                cells = min(max(int(SLICE / each), 1), len(axes.gaps))
                yield None
            if index == order[-1]:
                self._map_of = wanted
            yield {"map_row": {"index": index, "k": k}, "map": head}

    def _map_is_right(self) -> bool:
        """True if the browser has the map of this machine and strategy."""
        if self._map_of is None or self.axes is None:
            return False
        machine, controller, kept, axes = self._map_of
        same = controller is self.session.controllers[self.session.selected]
        return same and kept == self.kept and axes == self.axes and machine == self._map_machine(axes)

    def _map_machine(self, axes: Axes) -> Machine:
        """What of the machine a map depends on: not its gap and inertia, unless the controller is kept."""
        machine = self.session.machine
        return machine if self.kept else placeless(machine, axes, self.session.origin)

    def _map_head(self, axes: Axes) -> dict[str, Any]:
        session = self.session
        machine = session.machine
        allowed = machine.limits.shaft_torque
        inertias = (machine.gap_and_inertia[1],) * len(axes.inertias) if self.kept else axes.inertias
        symbols, labels = map_words(machine)
        return {
            "gaps": [self.units.shown(gap, "rad") for gap in axes.gaps],
            "unit": self.units.of("rad"),
            "inertias": list(axes.inertias),
            "strategy": session.selected,
            "kept": self.kept,
            "of": str(hash(self._map_machine(axes))),
            "limit": None if allowed is None else numbers(allowed / bases(machine, inertias)),
            "symbols": symbols,
            "labels": labels,
        }


def _told(session: Session, found: Strategy) -> Drive:
    """The drive for which the strategy is set up."""
    own = found.run.told if found.run is not None else None
    return session.machine.design_drive if own is None else own


def parameters_of(controller: Controller) -> list[Field[Any]]:
    """The parameters that the page can change: quantities, and texts with a choice.

    >>> from softstart.controller import make_controller
    >>> [one.name for one in parameters_of(make_controller("ramp"))]
    ['initial', 'time', 'full_torque', 'period']
    """
    if isinstance(controller, Tuned):
        return []
    return [
        one
        for one in fields_of(controller)
        if one.metadata.get("choices") or one.metadata.get("kind") == "quantity"
    ]


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


def _field(one: Entry, slider: bool, units: Units) -> dict[str, Any]:
    """A field as the browser builds it."""
    parameter = one.parameter
    words = one.suggestions or (parameter.choices if parameter.unit else ())
    return {
        "path": one.path,
        "symbol": one.symbol,
        "label": one.label,
        "meaning": f"{parameter.meaning}; write for example {', '.join([*words, parameter.example])}",
        "unit": unit(units.of(parameter.unit)),
        "slider": slider,
        "choices": [] if parameter.unit else list(parameter.choices),
        "suggestions": list(words),
        "words": not parameter.unit and not parameter.choices,
    }


def fields(
    machine: Machine,
    origin: Machine,
    shown_entries: Mapping[str, Entry],
    scales: Mapping[str, Scale],
    units: Units,
) -> dict[str, list[Any]]:
    """By path: text of the field, position of the slider or None, the value in another unit, and marks.

    A mark is a position on the slider and what it means.
    """
    shown: dict[str, list[Any]] = {}
    now, before = machine.by_path(), origin.by_path()
    for path, one in shown_entries.items():
        scale, si = scales.get(path), one.parameter.unit
        none = None if scale is None else 0.0  # no damping is a damping ratio of 0
        both: list[Any] = [none if each[path][1] is None else each[path][1] for each in (now, before)]
        value, first = both
        if value is None:
            continue
        if isinstance(value, tuple):
            shown[path] = ["; ".join(written(part, si, units) for part in value), None, ""]
            continue
        if path == "units" and not value:
            value = f"{units.angle}, {units.speed}"  # as the machine was given
        text = value if isinstance(value, str) else written(float(value), si, units)
        position = scale.position(float(value)) if scale else None
        loaded = scale and f"as loaded: {written(float(first), si, units)}"
        marks = [[scale.position(float(first)), loaded]] if scale else []
        shown[path] = [text, position, otherwise(si, value, units), marks]
    return shown


def otherwise(si: str, value: Any, units: Units) -> str:
    """An angle in degrees, a speed in revolutions a minute; in SI what is shown in another unit.

    >>> [otherwise("rad", 0.5, one) for one in (Units(), Units("deg"))], otherwise("rad/s", 92.15, Units())
    (['28.6\N{DEGREE SIGN}', '0.5 rad'], '880 rpm')
    """
    if isinstance(value, str):
        return ""
    if units.of(si) != si or " " in written(value, si, units):
        return f"{value:.4g} {unit(si)}"
    if si == "rad":
        return f"{math.degrees(value):.3g}\N{DEGREE SIGN}"
    if si == "rad/s":
        return f"{value * 30.0 / math.pi:.4g} rpm"
    if si == "s":
        return f"{1e3 * value:.3g} ms"
    return ""


def figure(session: Session, found: Strategy, units: Units) -> dict[str, Any]:
    """The large figure and the numbers around it."""
    run = found.run
    facts = judged(session, found) | {
        "status": found.status,
        "base": number(float(session.machine.mean_torque)),
    }
    if run is not None:
        facts |= {
            "reached": math.isfinite(run.start_time),
            "peak_time": number(run.peak_time),
            "output_torque": number(run.peak_torque * (getattr(run.drive, "gear_ratio", None) or math.nan)),
            "contacts": run.contacts,
            "impact_speed": number(units.shown(getattr(run, "impact_speed", math.nan), "rad/s")),
            "speed_unit": units.of("rad/s"),
            "end_time": number(run.end_time),
            "position": "".join(position_notes([run])),
        }
    return facts


def row(session: Session, found: Strategy) -> dict[str, Any]:
    """One line of the table; `worn`, `settled`, `limits` and `flag` are left out until they are known."""
    line = judged(session, found)
    line["trouble"] = found.trouble or ("" if math.isfinite(found.start_time) else found.status)
    worn = session.worn_ready(found.name)
    if worn is not None:
        line["worn"] = number(worn)
    known = session.judged_ready(found.name)
    if known is not None:
        line["settled"] = number(known.run.settled_time)
        line["flag"] = ", ".join(flag.word for flag in known.flags)
        line["limits"] = known.against_limits
        line["trouble"] = line["trouble"] or "; ".join(flag.text for flag in known.flags)
    return line


def judged(session: Session, found: Strategy) -> dict[str, Any]:
    """What a strategy is judged by."""
    lost = number(session.time_lost(found.name)) if found.run is not None else None
    return outcomes(found) | {"time_lost": lost}


def outcomes(found: Strategy) -> dict[str, Any]:
    """What came out of a start by itself."""
    return {
        "name": found.name,
        "k_dyn": number(found.k_dyn),
        "start_time": number(found.start_time),
        "peak_torque": number(found.peak_torque),
    }


def reference_words(kept: Reference, session: Session) -> tuple[str, ...]:
    """A reference's strategy, and what of it and of its drive is not as it is now.

    >>> session = Session()
    >>> session.select("ramp")
    >>> session.keep_reference()
    >>> session.set("gap", 1.0)
    >>> session.set_parameter("time", "200 ms")
    >>> reference_words(session.bench.reference, session)
    ('ramp', 'time default', 'shaft.gap 0.5 rad')
    """
    controller, other = kept.controller, session.controllers.get(kept.label)
    own = [
        f"{one.name} {'default' if value is None else value}"
        for one in (parameters_of(controller) if type(other) is type(controller) else ())
        if (value := getattr(controller, one.name)) != getattr(other, one.name)
    ]
    return kept.label, *own, differences(kept.drive, session.machine)


def drawn(
    found: Strategy, units: Units, whole: bool = True, window: tuple[float, float] | None = None
) -> dict[str, Any] | None:
    """Traces as the browser draws them: packed channels, the peak; if `whole` all channels and the parts.

    Speeds and angles are in these units; `turn` is how much of a rad/s one of the speeds is.
    """
    run = found.run
    if run is None:
        return None
    traces = traces_of(run, window=window)
    channels = list(traces) if whole else ["t", "T"]
    of = {"w": "rad/s", "theta": "rad"}  # by the letters of a channel
    rows = np.stack(
        [units.shown(traces[name], of.get(name.rstrip("0123456789[]"), "")) for name in channels]
    ).astype("<f4")
    peak = min(int(np.searchsorted(traces["t"], run.peak_time)), traces["t"].size - 1)
    picture: dict[str, Any] = {
        "channels": channels,
        "data": b64encode(rows.tobytes()).decode("ascii"),
        "peak": [run.peak_time, math.copysign(run.peak_torque, traces["T"][peak])],
    }
    if whole:
        machine = run.drive
        parts = parts_of(run)
        for one in (parts, *parts["shafts"]):
            one["gap"] = units.shown(one["gap"], "rad")
        picture |= parts | {
            "target": units.shown(machine.target_speed, "rad/s"),
            "allowed": machine.limits.shaft_torque,
            "units": {"angle": units.of("rad"), "speed": units.of("rad/s"), "turn": units.size("rad/s")},
        }
    return picture


def parts_of(run: Run) -> dict[str, Any]:
    """The bodies and the shafts between them, each with its channels; stages of each shaft, and of all gaps.

    A stage is a start and an end in s, and the flank that is touched: 0 while the gap is open.
    """
    machine = run.drive
    each = [stages_of(run, k) for k in range(len(machine.shaft_names))]
    names, motor, load = machine.mass_names, machine.motor_index, machine.load_index
    shafts = [
        {"name": name, "gap": float(gap), "T": f"T[{k}]", "theta": f"theta[{k}]", "stages": stages}
        for k, (name, gap, stages) in enumerate(zip(machine.shaft_names, machine.gaps, each, strict=True))
    ]
    bodies = [{"name": name, "w": f"w[{k}]"} for k, name in enumerate(names)]
    stages = open_somewhere([stages for stages, gap in zip(each, machine.gaps, strict=True) if gap > 0.0])
    if len(shafts) == 1:
        shafts[0] |= {"name": "", "T": "T", "theta": "theta"}
        bodies[motor] = {"name": "J\N{SUBSCRIPT ONE}", "w": "w1"}
        bodies[load] = {"name": "J\N{SUBSCRIPT TWO}", "w": "w2"}
        stages = each[0]
    return {
        "shafts": shafts,
        "bodies": bodies,
        "motor": motor,
        "worst": shafts[run.worst_shaft]["name"],
        "stages": stages,
        "gap": float(machine.gaps.sum()),
    }


def stages_of(run: Run, shaft: int) -> list[tuple[float, float, int]]:
    """Contacts and free flights in the gap of one shaft, the first `MOST_STAGES` of them."""
    spans = run.recorded.spans
    mode, side = run.recorded.of_shafts(1)[:-1, shaft], run.recorded.of_shafts(2)[:-1, shaft]
    touched = np.where(np.isin(mode, (at.OPEN, at.BEYOND)), 0, np.where(side < 0.0, -1, 1))
    first = np.flatnonzero(np.diff(touched, prepend=2))[:MOST_STAGES]
    begins = spans[first, at.S_START]
    ends = np.append(spans[first[1:], at.S_START], run.end_time)
    return list(zip(begins.tolist(), ends.tolist(), touched[first].tolist(), strict=True))


def open_somewhere(each: list[list[tuple[float, float, int]]]) -> list[tuple[float, float, int]]:
    """Stages of several gaps as one: 0 as long as any of them is open, else 1.

    >>> open_somewhere([[(0.0, 2.0, 0), (2.0, 9.0, 1)], [(0.0, 1.0, -1), (1.0, 3.0, 0), (3.0, 9.0, 1)]])
    [(0.0, 3.0, 0), (3.0, 9.0, 1)]
    """
    spans = sorted((start, end) for stages in each for start, end, side in stages if side == 0)
    joined: list[list[float]] = []
    for start, end in spans:
        if joined and start <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        elif end > start:
            joined.append([start, end])
    end = max((stages[-1][1] for stages in each), default=0.0)
    found: list[tuple[float, float, int]] = []
    for start, stop in joined:
        if start > (found[-1][1] if found else 0.0):
            found.append((found[-1][1] if found else 0.0, start, 1))
        found.append((start, stop, 0))
    if end > (found[-1][1] if found else 0.0):
        found.append((found[-1][1] if found else 0.0, end, 1))
    return found[:MOST_STAGES]


def traces_of(
    run: Run, buckets: int = BUCKETS, window: tuple[float, float] | None = None
) -> dict[str, Vector]:
    """Instants `t` of a run, s, and what is there: a few points a bucket, and every instant of `landmarks`.

    Torques in N m, speeds in rad/s and twists in rad: `T`, `u`, `w1`, `w2`, `theta`, of a chain those of the
    shaft with the largest torque, of motor and load mass, and `T[k]`, `theta[k]`, `w[k]` of each part, all at
    the motor shaft. `window`: two instants in s between which the traces are as fine as a screen can show.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> traces = traces_of(run)
    >>> run.peak_time in traces["t"], round(float(abs(traces["T"]).max()), 6) == round(run.peak_torque, 6)
    (True, True)
    """
    fixed = landmarks(run)
    periods = run.end_time / float(run.elastic_period)
    count = int(min(max(COARSEST, PER_PERIOD * periods), FINEST))
    times = np.union1d(np.linspace(0.0, run.end_time, count), fixed)
    states = channels_at(run, times)
    if times.size > 2 * COARSEST:
        keep = thinned(np.stack(list(states.values())), buckets)
        keep[np.searchsorted(times, fixed)] = True
        times = times[keep]
        states = {name: values[keep] for name, values in states.items()}
    if window is not None and window[0] < run.end_time:
        seen = np.linspace(window[0], min(window[1], run.end_time), WITHIN)
        times = np.union1d(times[(times < window[0]) | (times > window[1])], np.union1d(seen, fixed))
        states = channels_at(run, times)
    return {"t": times, **states}


def channels_at(run: Run, times: Vector) -> dict[str, Vector]:
    """What a run has at these instants, by the names of `traces_of`."""
    states = run.at(times)
    if len(run.drive.shaft_names) == 1:
        return {name: states[name] for name in CHANNELS}
    parts = {"T": states["T"].T, "theta": states["twist"].T, "w": states["w"].T}
    own = {"T": parts["T"][run.worst_shaft], "u": states["u"], "theta": parts["theta"][run.worst_shaft]}
    own |= {"w1": states["w1"], "w2": states["w2"]}
    return own | {f"{name}[{k}]": row for name, rows in parts.items() for k, row in enumerate(rows)}


def landmarks(run: Run) -> Vector:
    """Instants that are never thinned away: events and the instants just before, peaks of all stages, the
    peak of the run, the start time, the ends; and the joints of the motor torque while they are few.
    """
    events, joints = run.recorded.events["time"], run.recorded.spans[:, at.S_START]
    peaks = [*run.peak_times, *(stage.peak_time for stage in run.stages)]
    if joints.size > JUMPS:
        joints = joints[:0]
    sudden = np.concatenate([events, joints])
    others = [run.peak_time, run.start_time, 0.0, run.end_time]
    found = np.concatenate([sudden, np.nextafter(sudden, 0.0), peaks, others])
    return np.unique(found[~np.isnan(found)].clip(0.0, run.end_time))


def thinned(rows: Vector, buckets: int) -> NDArray[np.bool_]:
    """Which columns to keep so that each bucket keeps the least and the largest value of each row.

    >>> thinned(np.array([[0.0, 1.0, 9.0, 1.0, 0.0, -3.0, 0.0, 1.0]]), 2).tolist()
    [True, False, True, False, False, True, False, True]
    """
    size = rows.shape[1]
    width = max(1, math.ceil(size / buckets))
    whole = size // width * width
    keep = np.zeros(size, dtype=np.bool_)
    keep[[0, -1]] = True
    starts = np.arange(0, whole, width)
    boxes = rows[:, :whole].reshape(rows.shape[0], -1, width)
    for found in (boxes.argmin(axis=2), boxes.argmax(axis=2)):
        keep[(found + starts).ravel()] = True
    if whole < size:
        rest = rows[:, whole:]
        keep[whole + rest.argmin(axis=1)] = True
        keep[whole + rest.argmax(axis=1)] = True
    return keep
