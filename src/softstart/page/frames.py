"""What the page shows of a session, as plain data: fields, table, figures, traces, map."""

from __future__ import annotations

import math
import secrets
from base64 import b64encode
from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.controller.tuned import Tuned
from softstart.drive.plausibility import plausibility_warnings
from softstart.kernel import records as at
from softstart.page import links, machines
from softstart.page.machines import STRATEGY, Axes, Entry
from softstart.page.sentences import differences, sentence_of, written
from softstart.page.session import Reference, Session, Strategy
from softstart.quantities import Units
from softstart.start.comparison import SOFT_END
from softstart.start.run import Run
from softstart.views.numbers import unit
from softstart.views.starts import NO_STIFFNESS, position_notes

QUICK_EVENTS = 8_000  # of a start that follows the hand; longer ones are computed when the drive is at rest
QUICK = 0.010  # s, of a start that is computed at every step of a hand, even if no picture follows
LONG = (math.inf, math.inf)
TOO_LATE = 1.0  # s, of messages that waited; what is quick to compute overtakes the hand after a shorter halt
SLICE = 0.006  # s, about what is computed before the loop looks for something newer
SERVER = secrets.token_urlsafe(8)  # this process, to which a tab that is reloaded comes back, or does not
MOST_STAGES = 400  # of one gap, shaded and lit up
BUCKETS = 250  # of the whole start, each some pixels wide; each keeps the extrema of each channel
WITHIN = 1600  # points in a window of the plots: one a pixel, nearly
PER_PERIOD = 16  # points an elastic period before thinning: its crests are then within 2 % at worst
WIDEST = 32  # points of a bucket before thinning
JUMPS = 120  # up to so many spans, both sides of each joint are kept: steps of the torque stay upright

Frame = dict[str, Any]


class Screen:
    """The frames of one session; of what the browser has in `sent`, nothing is sent again."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.kept = False  # the map keeps the controller as it is set up for the drive of the moment
        self.stamp = 0.0  # the browser's clock at the last input that has been taken
        self.late = 0.0  # s, how long the last message has waited to be read
        self.window: tuple[float, float] | None = None  # s, what of the starts is seen; None for all
        self.mistakes: dict[str, str] = {}  # sentences by the field they stand beside
        self.sent: dict[str, Any] = {}  # by part of a frame
        self._costs: dict[str, tuple[float, float]] = {}  # of the last two starts of each strategy, s
        self._next = 0  # whose turn it is among the other strategies
        self._about: tuple[Any, ...] = (None,)  # what fields and axes are about
        self.follow()

    def follow(self) -> None:
        """Fields, sliders and axes are about the machine as it was loaded and the selected strategy."""
        session = self.session
        origin, label = session.origin, session.selected
        controller = session.controllers[label]
        about = origin, label, type(controller)
        if self._about[0] is origin and self._about == about:
            return
        if self._about[0] is not origin:
            self.axes, self._machine = machines.axes_about(origin), machines.parameter_fields(origin)
            self.mistakes.clear()
        self._about = about
        try:
            self._own = machines.strategy_entries(controller, origin, label)
        except Exception as error:  # a controller is anyone's code; its start has said what is wrong
            sentence_of(error)  # which is logged
            self._own = {}

    @property
    def entries(self) -> Mapping[str, Entry]:
        """All fields by their paths: those of the machine, then those of the selected strategy."""
        return {**self._machine, **self._own}

    @property
    def units(self) -> Units:
        """Those of the session."""
        return self.session.units

    @property
    def version(self) -> int:
        """That of the session."""
        return self.session.version

    def _is_new(self, part: str, what: Any) -> bool:
        """Whether the browser does not have this yet; it is sent then."""
        if self.sent.get(part) == what:
            return False
        self.sent[part] = what
        return True

    def _result(self, label: str) -> Strategy:
        found = self.session.result(label, QUICK_EVENTS)
        self._costs[label] = (self._costs.get(label, LONG)[1], found.cost)
        return found

    # frames that follow the hand -----------------------------------------------------------------------

    def glance(self) -> Frame | None:
        """The large figure alone, where one of the last two starts of the selected strategy was quick.

        None while messages wait to be read: then each start would make the others wait longer.
        """
        session = self.session
        slow = min(self._costs.get(session.selected, LONG)) > QUICK
        if slow or self.late > TOO_LATE or self._about[0] is not session.origin:
            return None
        found = self._result(session.selected)
        return {
            "stamp": self.stamp,
            "version": session.version,
            "figure": figure_view(session, found, self.units),
        }

    def first(self) -> Frame:
        """Fields, the large figure and the traces of the selected strategy."""
        self.follow()
        session, units = self.session, self.units
        found = self._result(session.selected)
        gap, inertia = session.machine.gap_and_inertia
        frame = {
            "stamp": self.stamp,
            "version": session.version,
            "mistakes": dict(self.mistakes),
            "fields": machine_fields(session, self._machine, units) | self._strategy_fields(found),
            "steps": session.steps,
            "drive": session.machine.name,
            "order": list(session.controllers),
            "shown": list(session.shown),
            "added": list(session.added),
            "changed": list(session.changed),
            "selected": session.selected,
            "figure": figure_view(session, found, units),
            "traces": {session.selected: drawn(found, units, window=self.window)},
            "rows": [row(session, found)],
            "reference": self._reference(),
            "mapped": self.axes is not None,
            "soft": session.soft is not None,
            # the map is in SI on both sides of the wire; its axis and read-out are labelled in these units
            "here": (gap, inertia),
            "angle": (units.of("rad"), units.size("rad")),
            "map_is_old": not self._map_is_right(),
        }
        for part, known in (("groups", self._machine), ("strategy", self._own)):
            groups = self._grouped(known)
            if self._is_new(part, groups):
                frame[part] = groups
                frame["filled"] = self._filled()
        return frame

    def _filled(self) -> list[str]:
        """The groups in which something is not as it was when the drive was loaded: no fold hides that."""
        now, before = self.session.machine.parameters_by_path(), self.session.origin.parameters_by_path()
        return sorted({one.group for path, one in self._machine.items() if now.get(path) != before.get(path)})

    def _grouped(self, known: Mapping[str, Entry]) -> list[Frame]:
        groups: dict[str, list[Frame]] = {}
        for one in known.values():
            groups.setdefault(one.group, []).append(described(one, self.units))
        origin = self.session.origin
        given = {machines.LIMITS: origin.limits, machines.GEAR: origin.gear, machines.MORE: False}
        folded = [title for title, there in given.items() if not there]
        return [{"title": title, "rows": rows, "folded": title in folded} for title, rows in groups.items()]

    def _strategy_fields(self, found: Strategy) -> dict[str, Frame]:
        """The values with which the selected strategy starts; marks at its defaults and at tuned values."""
        session = self.session
        controller = session.controllers[session.selected]
        told = found.run.told if found.run is not None else None
        try:
            default = controller.defaults(session.machine.design_drive if told is None else told)
        except Exception as error:  # as in `follow`
            sentence_of(error)
            return {}
        tuned = [
            (label, known.run.controller)
            for label, other in session.controllers.items()
            if isinstance(other, Tuned) and type(other.controller) is type(controller)
            and (known := session.ready(label)) is not None and known.run is not None
        ]  # fmt: skip
        shown = {}
        for path, one in self._own.items():
            name = path.removeprefix(STRATEGY)
            given = getattr(controller, name)
            value = default.get(name) if given is None else given
            marks = [("default", default.get(name)), *((of, getattr(other, name)) for of, other in tuned)]
            if value is not None and given is None and one.unit:
                text = f"{self.units.shown(float(value), one.unit):.4g}"
            else:
                text = written_value(value, one, self.units)
            shown[path] = field_view(one, text, value, marks, self.units)
            shown[path]["changed"] = given is not None and not isinstance(given, str)
        return shown

    def _reference(self) -> Frame | None:
        """What the strategies are compared with, in words and figures; its trace if that is new."""
        kept, found = self.session.bench.reference, self.session.reference()
        if kept is None or found is None:
            return None
        line = outcomes(found) | {"name": ", ".join(filter(None, reference_words(kept, self.session)))}
        if self._is_new("reference", (kept, self.window, self.units)):
            line["trace"] = drawn(found, self.units, window=self.window)
        return line

    def others(self) -> Iterator[Frame | None]:
        """Rows of the other strategies and the traces of those that are shown, a few ms at a time.

        While a hand keeps moving, each call goes on where the last one was left, so that all have their turn.
        """
        session = self.session
        labels = [label for label in session.controllers if label != session.selected]
        begun = perf_counter()
        frame: Frame = {"rows": [], "traces": {}}
        for _ in labels:
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
        session, machine = self.session, self.session.machine
        if self._is_new("bench", session.bench):
            name, link = links.keep(session)
            yield {"keep": {"server": SERVER, "bench": name, "link": link}}
        for label in session.controllers:
            if session.ready(label) is None:
                found = session.result(label)
                frame: Frame = {"rows": [row(session, found)]}
                if label == session.selected:
                    frame |= self.first()
                elif label in session.shown:
                    frame["traces"] = {label: drawn(found, self.units, False, self.window)}
                yield frame
            yield from (None for _ in session.judged(label))
        yield {
            "rows": [row(session, found) for found in session.strategies],
            "recommendation": " ".join(
                [session.recommendation().text, *([NO_STIFFNESS] if session.soft else [])]
            ),
            "plausibility_warnings": plausibility_warnings(machine),
            "assumed": [one for one in machine.assumed.split("; ") if one],
        }
        yield from self._map()

    def _map(self) -> Iterator[Frame | None]:
        session, axes = self.session, self.axes
        if axes is None or self._map_is_right():
            return
        machine, controller = session.machine, session.controllers[session.selected]
        wanted = controller, self.kept, axes, self._map_machine(axes)
        nominal = machine if self.kept else None
        cells = 4  # computed in one slice; as many as fit into it
        head = self._map_head(axes)
        away = np.abs(np.log(np.array(axes.inertias) / machine.gap_and_inertia[1]))  # nearest rows first
        self.sent.pop("map", None)  # from here on it has rows of both, if this is left half-way
        rows = np.argsort(away, kind="stable").tolist()
        for index in rows:
            k: list[float | None] = []
            while len(k) < len(axes.gaps):
                begun = perf_counter()
                part = axes.gaps[len(k) : len(k) + cells]
                k += numbers(
                    machines.k_dyn_row(
                        machine, controller, part, axes.inertias[index], nominal, session.origin
                    )
                )
                each = (perf_counter() - begun) / len(part)
                cells = min(max(int(SLICE / each), 1), len(axes.gaps))
                yield None
            if index == rows[-1]:
                self.sent["map"] = wanted
            yield {"map_row": {"index": index, "k": k}, "map": head}

    def _map_is_right(self) -> bool:
        """True if the browser has the map of this machine and strategy."""
        axes, known = self.axes, self.sent.get("map")
        if known is None or axes is None:
            return False
        same = known[0] is self.session.controllers[self.session.selected]
        return same and known[1:] == (self.kept, axes, self._map_machine(axes))

    def _map_machine(self, axes: Axes) -> Any:
        """What of the machine a map depends on: not its gap and inertia, unless the controller is kept."""
        machine = self.session.machine
        return machine if self.kept else machines.placeless(machine, axes, self.session.origin)

    def _map_head(self, axes: Axes) -> Frame:
        machine = self.session.machine
        allowed = machine.limits.shaft_torque
        inertias = (machine.gap_and_inertia[1],) * len(axes.inertias) if self.kept else axes.inertias
        symbols, labels = machines.map_words(machine)
        return {
            "gaps": list(axes.gaps),
            "inertias": list(axes.inertias),
            "strategy": self.session.selected,
            "of": str(hash(self._map_machine(axes))),
            "limit": None if allowed is None else numbers(allowed / machines.bases(machine, inertias)),
            "symbols": symbols,
            "labels": labels,
        }


def json_number(value: float) -> float | None:
    """A number that JSON can carry."""
    return float(value) if math.isfinite(value) else None


def numbers(values: Any) -> list[float | None]:
    """Numbers that JSON can carry."""
    return [json_number(value) for value in values.tolist()]


# fields -------------------------------------------------------------------------------------------------


def described(one: Entry, units: Units) -> Frame:
    """A field as the browser builds it; `text` says that it takes words alone."""
    text = not (one.unit or one.choices or one.path.startswith(STRATEGY))
    return vars(one) | {"unit": unit(units.of(one.unit)), "scale": one.scale is not None, "text": text}


def field_view(one: Entry, text: str, value: Any, marks: Any, units: Units) -> Frame:
    """What a field shows: its text, where its slider is, and marks on that, each with what it means."""
    scale = one.scale
    if scale is None:
        return {"text": text}
    return {
        "text": text,
        "position": scale.position(0.0 if value is None else float(value)),
        "marks": [
            (scale.position(float(at)), f"{of}: {written(float(at), one.unit, units)}")
            for of, at in marks
            if at is not None
        ],
    }


def written_value(value: Any, one: Entry, units: Units) -> str:
    """The text of a field; empty for a value that is not given."""
    if value is None or isinstance(value, str):
        return value or ""
    each = value if isinstance(value, tuple) else (value,)
    return "; ".join(written(float(part), one.unit, units) for part in each)


def machine_fields(session: Session, known: Mapping[str, Entry], units: Units) -> dict[str, Frame]:
    """By path what the fields of the machine show; a mark is where its value was when it was loaded."""
    now, before = session.machine.parameters_by_path(), session.origin.parameters_by_path()
    shown = {}
    for path, one in known.items():
        if path in now:
            # no damping is a damping ratio of 0
            value, first = (0.0 if one.scale and v is None else v for v in (now[path][1], before[path][1]))
            text = written_value(value, one, units)
            typed = session.typed.get((path, value), "")
            if (
                " " in text and " " in typed
            ):  # with a unit of its own: that which was typed, 36 arcmin or 0.6 deg
                text = typed
            if path == "units":
                text = text or units.text  # as the machine was given
            shown[path] = field_view(one, text, value, [("as loaded", first)], units)
    return shown


# figures ------------------------------------------------------------------------------------------------


def figure_view(session: Session, found: Strategy, units: Units) -> Frame:
    """The large figure and the numbers around it."""
    run = found.run
    facts = outcomes(found) | {
        "time_lost": json_number(session.time_lost(found)),
        "status": found.status,
        "base": json_number(float(session.machine.mean_torque)),
        "speed_unit": units.of("rad/s"),
    }
    if run is not None:
        facts |= {
            "reached": math.isfinite(run.start_time),
            "output_torque": json_number(run.peak_torque_at_output),
            "contacts": run.contacts,
            "impact_speed": json_number(units.shown(run.impact_speed, "rad/s")),
            "position": "".join(position_notes([run])),
        }
    return facts


def outcomes(found: Strategy) -> Frame:
    """What came out of a start by itself."""
    return {
        "name": found.name,
        "k_dyn": json_number(found.k_dyn),
        "start_time": json_number(found.start_time),
        "peak_torque": json_number(found.peak_torque),
    }


def row(session: Session, found: Strategy) -> Frame:
    """One line of the table; `worn`, `soft`, `settled`, `limits`, `flag` are empty until computed."""
    known = session.row(found.name)
    flags = () if known is None else known.flags
    trouble = found.trouble or ("" if math.isfinite(found.start_time) else found.status)
    return outcomes(found) | {
        "time_lost": json_number(session.time_lost(found)),
        "worn": None if known is None else json_number(known.k_dyn_worn_gap),
        "soft": json_number(known.cases[SOFT_END].k_dyn) if known and SOFT_END in known.cases else None,
        "settled": None if known is None else json_number(known.run.settled_time),
        "limits": "" if known is None else known.against_limits,
        "flag": ", ".join(flag.word for flag in flags),
        "trouble": trouble or "; ".join(flag.text for flag in flags),
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
    words = [
        f"{one.name} {'default' if value is None else value}"
        for one in (machines.page_parameters(controller) if type(other) is type(controller) else ())
        if (value := getattr(controller, one.name)) != getattr(other, one.name)
    ]
    return kept.label, *words, differences(kept.drive, session.seen)


# traces -------------------------------------------------------------------------------------------------


def drawn(
    found: Strategy, units: Units, whole: bool = True, window: tuple[float, float] | None = None
) -> Frame | None:
    """A start as the browser draws it: channels in single precision, the peak; if `whole` shafts and bodies.

    Speeds and angles are in these units; `turn` is how much of a rad/s one of the speeds is.
    """
    run = found.run
    if run is None:
        return None
    traces = traces_of(run, window)
    largest = f"T[{run.worst_shaft}]"
    channels = list(traces) if whole else ["t", largest]
    of = {"w": "rad/s", "theta": "rad"}
    rows = [units.shown(traces[name], of.get(name.partition("[")[0], "")) for name in channels]
    peak = min(int(np.searchsorted(traces["t"], run.peak_time)), traces["t"].size - 1)
    picture: Frame = {
        "channels": channels,
        "data": b64encode(np.stack(rows).astype("<f4").tobytes()).decode("ascii"),
        "peak": [run.peak_time, math.copysign(run.peak_torque, traces[largest][peak])],
        "worst": run.worst_shaft,
    }
    if whole:
        machine = run.drive
        picture |= {
            "shafts": [
                {"name": name, "gap": float(units.shown(gap, "rad")), "stages": stages_of(run, k)}
                for k, (name, gap) in enumerate(zip(machine.shaft_names, machine.gaps, strict=True))
            ],
            "bodies": machine.mass_names,
            "motor": machine.motor_index,
            "load": machine.load_index,
            "target": units.shown(machine.target_speed, "rad/s"),
            "allowed": json_number(run.permissible_torque),
            "units": {"angle": units.of("rad"), "speed": units.of("rad/s"), "turn": units.size("rad/s")},
        }
    return picture


def stages_of(run: Run, shaft: int) -> list[tuple[float, float, int]]:
    """Contacts and free flights in the gap of one shaft, the first `MOST_STAGES` of them.

    Each has a start and an end in s, and the flank that is touched: 0 while the gap is open.
    """
    spans = run.recorded.spans
    mode, side = run.recorded.of_shafts(1)[:-1, shaft], run.recorded.of_shafts(2)[:-1, shaft]
    touched = np.where(np.isin(mode, (at.OPEN, at.BEYOND)), 0, np.where(side < 0.0, -1, 1))
    first = np.flatnonzero(np.diff(touched, prepend=2))[:MOST_STAGES]
    begins = spans[first, at.S_START]
    ends = np.append(spans[first[1:], at.S_START], run.end_time)
    return list(zip(begins.tolist(), ends.tolist(), touched[first].tolist(), strict=True))


def traces_of(run: Run, window: tuple[float, float] | None = None) -> dict[str, Vector]:
    """Instants `t` of a run, s, and what is there: a few points a bucket, and every instant of `landmarks`.

    `u` and, of each shaft or body k at the motor shaft, `T[k]`, `theta[k]` and `w[k]`: torques in N m, twists
    in rad, speeds in rad/s. `window`: two instants in s between which the traces are as fine as a screen can
    show.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> traces = traces_of(run)
    >>> run.peak_time in traces["t"], round(float(abs(traces["T[0]"]).max()), 6) == round(run.peak_torque, 6)
    (True, True)
    """
    end = run.end_time
    width = int(np.clip(PER_PERIOD * end / float(run.elastic_period) / BUCKETS, 2, WIDEST))
    times = np.linspace(0.0, end, BUCKETS * width)
    if width > 2:
        times = times[thinned(np.stack(list(channels_at(run, times).values())), width)]
    if window is not None and window[0] < end:
        times = np.union1d(times, np.linspace(window[0], min(window[1], end), WITHIN))
    times = np.union1d(times, landmarks(run))
    return {"t": times, **channels_at(run, times)}


def channels_at(run: Run, times: Vector) -> dict[str, Vector]:
    """What a run has at these instants, by the names of `traces_of`."""
    states = run.at(times)
    if len(run.drive.shaft_names) == 1:
        names = {"T[0]": "T", "theta[0]": "theta", "w[0]": "w1", "w[1]": "w2"}
        return {"u": states["u"], **{name: states[own] for name, own in names.items()}}
    parts = {"T": states["T"], "theta": states["twist"], "w": states["w"]}
    each = {f"{name}[{k}]": one for name, rows in parts.items() for k, one in enumerate(rows.T)}
    return {"u": states["u"], **each}


def landmarks(run: Run) -> Vector:
    """Instants that are never thinned away: events and the instants just before, peaks of all stages, the
    peak of the run, the start time, the ends; and the joints of the motor torque while they are few.
    """
    events, joints = run.recorded.events["time"], run.recorded.spans[:, at.S_START]
    peaks = [*run.recorded.shafts["peak_time"], *(stage.peak_time for stage in run.stages)]
    if joints.size > JUMPS:
        joints = joints[:0]
    sudden = np.concatenate([events, joints])
    others = [run.peak_time, run.start_time, 0.0, run.end_time]
    found = np.concatenate([sudden, np.nextafter(sudden, 0.0), peaks, others])
    return np.unique(found[~np.isnan(found)].clip(0.0, run.end_time))


def thinned(rows: Vector, width: int) -> NDArray[np.intp]:
    """Which columns to keep so that each bucket of this width keeps the least and largest value of each row.

    >>> thinned(np.array([[0.0, 1.0, 9.0, 1.0, 0.0, -3.0, 0.0, 1.0]]), 4)
    array([0, 2, 5, 7])
    """
    boxes = rows.reshape(rows.shape[0], -1, width)
    starts = np.arange(0, rows.shape[1], width)
    return np.unique([boxes.argmin(axis=2) + starts, boxes.argmax(axis=2) + starts])
