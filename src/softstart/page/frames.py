"""What the page shows of a session, as plain data: fields, table, figures, traces, map."""

from __future__ import annotations

import math
import secrets
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.controller.tuned import Tuned
from softstart.drive import Machine
from softstart.drive.plausibility import plausibility_warnings
from softstart.kernel import records as rec
from softstart.page import links, machines
from softstart.page.duty import fields_of, values_of
from softstart.page.duty_frames import duty_view, json_number
from softstart.page.machines import NAME, STRATEGY, Axes, FormField
from softstart.page.sentences import (
    Value,
    differences,
    field_labels,
    in_words,
    page_sentence,
    sentence_of,
    written,
)
from softstart.page.session import LONGEST_DUTY, EqualTime, Inputs, Reference, Session, Strategy
from softstart.quantities import Units, seen_from
from softstart.start.comparison import SOFT_END
from softstart.start.run import Run
from softstart.views.drawing import strategy_colours
from softstart.views.numbers import unit
from softstart.views.starts import no_stiffness, position_notes

AS_SET_HERE = "Strategies count as they are set here; Checks sets them for the limits and adds them."
QUICK_EVENTS = 8_000  # of a start while a slider is dragged; longer ones are computed after it
QUICK = 0.010  # s, of a start that is computed at every step of a slider, even if no frame follows
LONG = (math.inf, math.inf)
TOO_LATE = 1.0  # s, of messages that waited; what is quick to compute catches up after a shorter halt
LIVE_DUTY = 0.3  # s of processor time, of a duty that is computed at each change; a longer one is at rest
SLICE = 0.006  # s, about what is computed before the loop looks for something newer
SERVER = secrets.token_urlsafe(8)  # this process, to which a tab that is reloaded comes back, or does not
MOST_STAGES = 400  # of one gap, shaded and lit up
BUCKETS = 250  # of the whole start, each some pixels wide; each keeps the extrema of each channel
WITHIN = 1600  # points in a window of the plots: one a pixel, nearly
PER_PERIOD = 16  # points an elastic period before thinning: its crests are then within 2 % at worst
WIDEST = 32  # points of a bucket before thinning
JUMPS = 120  # up to so many spans, both sides of each joint are kept: steps of the torque stay upright

Frame = dict[str, Any]
Mark = tuple[str, Any]  # on a slider: what it means, and its value


class FrameBuilder:
    """The frames of one session; of what the browser has in `sent`, nothing is sent again."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.fixed = False  # the controller of the map is set up once, for the machine as it is now
        self.stamp = 0.0  # the browser's clock at the last input that has been taken
        self.late = 0.0  # s, how long the last message has waited to be read
        self.window: tuple[float, float] | None = None  # s, visible part of the starts; None for all
        self.duty_shown = False  # whether the duty is in sight: it is computed then
        self.duty_step = 0  # the step that is selected
        self.mistakes: dict[str, str] = {}  # sentences by the field that they stand next to
        self.sent: dict[str, Any] = {}  # by part of a frame
        self._costs: dict[str, tuple[float, float]] = {}  # of the last two starts of each strategy, s
        self._next = 0  # whose turn it is among the other strategies
        self._origin: Machine | None = None
        self._fields_of: tuple[Any, ...] = ()
        self.follow()

    def follow(self) -> None:
        """Set fields, sliders and axes to the machine as it was loaded and the selected strategy."""
        inputs = self.session.inputs
        origin, label = inputs.origin, inputs.selected
        controller = inputs.controllers[label]
        self.duty_step = min(self.duty_step, len(inputs.plan.steps) - 1)
        self._duty = fields_of(inputs.plan, self.duty_step)
        if self._origin is not origin:
            self.axes, self._machine = machines.axes_about(origin), machines.parameter_fields(origin)
            empty = {
                machines.LIMITS: not origin.limits, machines.GEAR: not origin.gear,
                machines.BRAKE: origin.brake_torque == 0.0, machines.MORE: True,
            }  # fmt: skip
            self._folded = tuple(title for title, folded in empty.items() if folded)
            self.mistakes.clear()
        elif self._fields_of == (label, type(controller)):
            return
        self._origin, self._fields_of = origin, (label, type(controller))
        try:
            own = label in self.session.added
            self._strategy = machines.strategy_entries(controller, origin, label, own)
        except Exception as error:  # a controller is anyone's code; its start has said what is wrong
            sentence_of(error)  # which is logged
            self._strategy = {}

    @property
    def entries(self) -> Mapping[str, FormField]:
        """All fields by their paths: of the machine, the selected strategy, and the selected step."""
        return {**self._machine, **self._strategy, **self._duty}

    def _is_new(self, part: str, content: object) -> bool:
        """Whether the browser does not have this yet; it is sent then."""
        if self.sent.get(part) == content:
            return False
        self.sent[part] = content
        return True

    def _result(self, label: str) -> Strategy:
        result = self.session.result(label, QUICK_EVENTS)
        self._costs[label] = (self._costs.get(label, LONG)[1], result.cost)
        return result

    # while a slider is dragged -------------------------------------------------------------------------

    def quick_frame(self) -> Frame | None:
        """The large figure alone, where one of the last two starts of the selected strategy was quick.

        None while messages wait to be read: then each start would make the others wait longer.
        """
        session, label = self.session, self.session.inputs.selected
        slow = min(self._costs.get(label, LONG)) > QUICK
        if slow or self.late > TOO_LATE or self._origin is not session.inputs.origin:
            return None
        figure = figure_view(session, self._result(label))
        return {"stamp": self.stamp, "version": session.version, "figure": figure}

    def main_frame(self) -> Frame:
        """Fields, the large figure and the traces of the selected strategy."""
        self.follow()
        session, inputs, units = self.session, self.session.inputs, self.session.inputs.units
        result = self._result(inputs.selected)
        frame = {
            "stamp": self.stamp,
            "version": session.version,
            "mistakes": dict(self.mistakes),
            "fields": machine_fields(session, self._machine)
            | self._strategy_fields(result)
            | self._duty_fields(),
            "steps": session.steps,
            "drive": inputs.machine.name,
            "order": list(inputs.controllers),
            "shown": list(inputs.drawn),
            "added": list(session.added),
            "changed": list(session.changed),
            "selected": inputs.selected,
            "figure": figure_view(session, result),
            "traces": {inputs.selected: drawn(result, units, window=self.window)},
            "rows": [row(session, result)],
            "reference": self._reference(),
            "mapped": self.axes is not None,
            "soft": inputs.soft_drive is not None,
            "at_time": inputs.at_time,
            "duty_step": self.duty_step,
            # the map is in SI on both sides of the wire; its axis and read-out are labelled in these units
            "here": inputs.machine.gap_and_inertia,
            "angle": (units.of("rad"), 1.0 / units.shown(1.0, "rad")),
            "inertia": 1.0 / units.shown(1.0, "kg*m^2"),
            "torque": unit(units.of("N*m")),
            "at": units.at,
            "no_output": in_words(gear, field_labels(inputs.machine))
            if isinstance(gear := inputs.machine.gear or inputs.machine.gear_with(), str)
            else "",
            "map_is_old": not self._map_is_right(),
        }
        if self._is_new("colours", colours := strategy_colours(list(inputs.controllers))):
            frame["colours"] = colours
        parts = (("groups", self._machine), ("strategy", self._strategy), ("duty_fields", self._duty))
        for part, entries in parts:
            if self._is_new(part, (entries, units, self._folded)):
                frame[part] = self._grouped(entries)
                frame["filled"] = self._filled()
        return frame

    def _filled(self) -> list[str]:
        """Groups with a value that is not as it was when the machine was loaded: these are unfolded."""
        inputs = self.session.inputs
        now, before = inputs.machine.parameters_by_path(), inputs.origin.parameters_by_path()
        groups = {entry.group for path, entry in self._machine.items() if now.get(path) != before.get(path)}
        return sorted(groups)

    def _grouped(self, entries: Mapping[str, FormField]) -> list[Frame]:
        groups: dict[str, list[Frame]] = {}
        for entry in entries.values():
            groups.setdefault(entry.group, []).append(described(entry, self.session.inputs.units))
        return [
            {"title": title, "rows": rows, "folded": title in self._folded} for title, rows in groups.items()
        ]

    def _strategy_fields(self, result: Strategy) -> dict[str, Frame]:
        """The values with which the selected strategy starts; marks at its defaults and at tuned values."""
        session, inputs, units = self.session, self.session.inputs, self.session.inputs.units
        controller = inputs.controllers[inputs.selected]
        fields: dict[str, Frame] = {NAME: {"text": inputs.selected}} if NAME in self._strategy else {}
        fitted = None if result.run is None else result.run.design_drive
        try:
            default = controller.defaults(inputs.machine.design_drive if fitted is None else fitted)
        except Exception as error:  # as in `follow`
            sentence_of(error)
            return fields
        tuned = [
            (label, known.run.controller)
            for label, other in inputs.controllers.items()
            if isinstance(other, Tuned) and type(other.controller) is type(controller)
            and (known := session.ready(label)) is not None and known.run is not None
        ]  # fmt: skip
        for path, entry in self._strategy.items():
            if path == NAME:
                continue
            name = path.removeprefix(STRATEGY)
            setting = getattr(controller, name)
            value = default.get(name) if setting is None else setting
            marks = [("default", default.get(name)), *((of, getattr(gains, name)) for of, gains in tuned)]
            if value is not None and setting is None and entry.unit:
                text = f"{entry.seen(units).shown(float(value), entry.unit):.4g}"
            else:
                text = written_value(value, entry, units)
            fields[path] = field_view(entry, text, value, marks, units)
            fields[path]["changed"] = setting is not None and not isinstance(setting, str)
        return fields

    def _duty_fields(self) -> dict[str, Frame]:
        """What the fields of the selected step and of the whole duty show."""
        values, units = values_of(self.session.inputs.plan, self._duty), self.session.inputs.units
        return {
            path: {"text": written_value(value, self._duty[path], units)} for path, value in values.items()
        }

    def _duty_frame(self, seconds: float) -> Frame | None:
        """The duty under the selected strategy, if it is in sight and new, and takes no more than that."""
        session, inputs = self.session, self.session.inputs
        if not self.duty_shown:
            return None
        result = session.duty_result(seconds)
        content = inputs.machine, inputs.controllers[inputs.selected], inputs.plan, inputs.units
        if not self._is_new("duty", (*content, self.duty_step, result.given_up)):
            return None
        waits = result.given_up and seconds < LONGEST_DUTY
        return {"duty": duty_view(inputs, None if waits else result, self.duty_step)}

    def _reference(self) -> Frame | None:
        """What the strategies are compared with, in words and figures; its trace if that is new."""
        inputs, result = self.session.inputs, self.session.reference()
        if inputs.reference is None or result is None:
            return None
        line = outcomes(result, inputs.units) | {
            "name": ", ".join(filter(None, reference_words(inputs.reference, inputs)))
        }
        if self._is_new("reference", (inputs.reference, self.window, inputs.units)):
            line["trace"] = drawn(result, inputs.units, window=self.window)
        return line

    def other_frames(self) -> Iterator[Frame | None]:
        """Rows of the other strategies and the traces of those that are drawn, a few ms at a time.

        While a slider is dragged, each call goes on where the last one was left, so that all have their turn.
        """
        session, inputs = self.session, self.session.inputs
        if (duty := self._duty_frame(LIVE_DUTY)) is not None:
            yield duty
        labels = [label for label in inputs.controllers if label != inputs.selected]
        visible = inputs.drawn
        begun = perf_counter()
        frame: Frame = {"rows": [], "traces": {}}
        for _ in labels:
            label = labels[self._next % len(labels)]
            self._next += 1
            result = self._result(label)
            frame["rows"].append(row(session, result))
            if label in visible:
                frame["traces"][label] = drawn(result, inputs.units, False, self.window)
            if perf_counter() - begun > SLICE:
                yield frame
                begun, frame = perf_counter(), {"rows": [], "traces": {}}
        if frame["rows"]:
            yield frame

    # when nothing is dragged ---------------------------------------------------------------------------

    def idle_frames(self) -> Iterator[Frame | None]:
        """The inputs, for the tab to keep; long starts, changed drives, the recommendation, then the map."""
        session, inputs = self.session, self.session.inputs
        if self._is_new("inputs", inputs):
            name, link = links.store(session)
            yield {"keep": {"server": SERVER, "name": name, "link": link}}
        if (duty := self._duty_frame(LONGEST_DUTY)) is not None:
            yield duty
        for label in inputs.controllers:
            if session.ready(label) is None:
                result = session.result(label)
                frame: Frame = {"rows": [row(session, result)]}
                if label == inputs.selected:
                    frame |= self.main_frame()
                elif label in inputs.drawn:
                    frame["traces"] = {label: drawn(result, inputs.units, False, self.window)}
                yield frame
            yield from session.compute_row(label)
            yield from session.compute_at_equal_time(label)
            if inputs.at_time:
                yield {"rows": [row(session, session.result(label))]}
        recommendation = session.recommendation()
        session.follow(recommendation)
        text = page_sentence(recommendation.text)
        advice = [text]
        if (soft := inputs.soft_drive) is not None:
            advice.append(no_stiffness(inputs.machine, soft))
        if inputs.machine.limits:
            advice.append(AS_SET_HERE)
        if at_equal_time := session.lowest_at_equal_time():
            advice.append(at_equal_time)
        yield {
            "rows": [row(session, result) for result in session.strategies],
            "recommendation": " ".join(advice),
            "recommended": recommended.name if (recommended := recommendation.recommended) else "",
            "plausibility_warnings": [
                in_words(one, field_labels(inputs.machine)) for one in plausibility_warnings(inputs.machine)
            ],
            "assumed": [text for text in inputs.machine.assumed.split("; ") if text],
        }
        if self.duty_shown:
            for label in inputs.controllers:
                session.compute_duty(label)
                yield {"rows": [row(session, session.result(label))]}
        yield from self._map()

    def _map(self) -> Iterator[Frame | None]:
        inputs, axes = self.session.inputs, self.axes
        if axes is None or self._map_is_right():
            return
        machine, controller = inputs.machine, inputs.controllers[inputs.selected]
        content = controller, self.fixed, axes, self._map_machine(axes)
        nominal = machine if self.fixed else None
        cells = 4  # computed in one slice; as many as fit into it
        head = self._map_head(axes)
        away = np.abs(np.log(np.array(axes.inertias) / machine.gap_and_inertia[1]))  # nearest rows first
        self.sent.pop("map", None)  # from here on it has rows of both, if this is left half-way
        rows = np.argsort(away, kind="stable").tolist()
        for index in rows:
            k: list[float | None] = []
            while len(k) < len(axes.gaps):
                begun = perf_counter()
                gaps, inertia = axes.gaps[len(k) : len(k) + cells], axes.inertias[index]
                k += numbers(machines.k_dyn_row(machine, controller, gaps, inertia, nominal, inputs.origin))
                each = (perf_counter() - begun) / len(gaps)
                cells = min(max(int(SLICE / each), 1), len(axes.gaps))
                yield None
            if index == rows[-1]:
                self.sent["map"] = content
            yield {"map_row": {"index": index, "k": k}, "map": head}

    def _map_is_right(self) -> bool:
        """True if the browser has the map of this machine and strategy."""
        axes, sent, inputs = self.axes, self.sent.get("map"), self.session.inputs
        if sent is None or axes is None:
            return False
        same = sent[0] is inputs.controllers[inputs.selected]
        return same and sent[1:] == (self.fixed, axes, self._map_machine(axes))

    def _map_machine(self, axes: Axes) -> object:
        """What of the machine a map depends on: not its gap and inertia, unless the controller is fixed."""
        inputs = self.session.inputs
        return inputs.machine if self.fixed else machines.placeless(inputs.machine, axes, inputs.origin)

    def _map_head(self, axes: Axes) -> Frame:
        machine = self.session.inputs.machine
        allowed = machine.limits.shaft_torque
        inertias = (machine.gap_and_inertia[1],) * len(axes.inertias) if self.fixed else axes.inertias
        symbols, labels = machines.map_words(machine)
        return {
            "gaps": list(axes.gaps),
            "inertias": list(axes.inertias),
            "strategy": self.session.inputs.selected,
            "of": str(hash(self._map_machine(axes))),
            "limit": None if allowed is None else numbers(allowed / machines.bases(machine, inertias)),
            "symbols": symbols,
            "labels": labels,
        }


def numbers(values: Vector) -> list[float | None]:
    """Numbers that JSON can carry."""
    return [json_number(value) for value in values.tolist()]


# fields -------------------------------------------------------------------------------------------------


def described(entry: FormField, units: Units) -> Frame:
    """A field as the browser builds it; `text` says that it takes words alone."""
    text = entry.path == NAME or not (entry.unit or entry.choices or entry.path.startswith(STRATEGY))
    return vars(entry) | {
        "unit": unit(entry.seen(units).of(entry.unit)),
        "scale": entry.scale is not None,
        "text": text,
    }


def field_view(entry: FormField, text: str, value: Value, marks: Iterable[Mark], units: Units) -> Frame:
    """What a field shows: its text, where its slider is, and marks on that, each with what it means."""
    scale = entry.scale
    if scale is None:
        return {"text": text}
    return {
        "text": text,
        "position": scale.position(float(value) if isinstance(value, int | float) else 0.0),
        "marks": [
            (scale.position(float(mark)), f"{of}: {written(float(mark), entry.unit, entry.seen(units))}")
            for of, mark in marks
            if mark is not None
        ],
    }


def written_value(value: Value, entry: FormField, units: Units) -> str:
    """The text of a field; empty for a value that is not given."""
    if value is None or isinstance(value, str):
        return value or ""
    parts = value if isinstance(value, tuple) else (value,)
    return "; ".join(written(float(part), entry.unit, entry.seen(units)) for part in parts)


def machine_fields(session: Session, entries: Mapping[str, FormField]) -> dict[str, Frame]:
    """By path what the fields of the machine show; a mark is where its value was when it was loaded."""
    inputs, units = session.inputs, session.inputs.units
    now, before = inputs.machine.parameters_by_path(), inputs.origin.parameters_by_path()
    fields = {}
    for path, entry in entries.items():
        if path not in now:
            continue
        value, loaded = now[path][1], before[path][1]
        if entry.scale:  # no damping is a damping ratio of 0
            value, loaded = (0.0 if number is None else number for number in (value, loaded))
        text = written_value(value, entry, units)
        typed = session.typed.get((path, value), "")
        if " " in text and " " in typed:  # with a unit of its own, as it was typed: 36 arcmin or 0.6 deg
            text = typed
        if path == "units":
            text = seen_from(text, False) or units.at_motor.text  # the shaft has a switch
        fields[path] = field_view(entry, text, value, [("as loaded", loaded)], units)
    return fields


# figures ------------------------------------------------------------------------------------------------


def figure_view(session: Session, result: Strategy) -> Frame:
    """The large figure and the numbers around it."""
    run, units, known = result.run, session.inputs.units, session.row(result.name)
    facts = outcomes(result, units) | {
        "settled_lost": None if known is None else json_number(known.settled_lost),
        "status": result.status,
        "base": json_number(float(units.shown(float(session.inputs.machine.mean_torque), "N*m"))),
        "torque_unit": unit(units.of("N*m")),
        "speed_unit": units.of("rad/s"),
    }
    if run is not None:
        facts |= {
            "reached": math.isfinite(run.limited_time),
            "overshoot": json_number(100.0 * run.overshoot),
            "output_torque": None if units.gear else json_number(run.peak_torque_at_output),
            "contacts": run.contacts,
            "impact_speed": json_number(units.shown(run.impact_speed, "rad/s")),
            "position": "".join(position_notes([run])),
        }
    return facts


def outcomes(result: Strategy, units: Units) -> Frame:
    """Figures of a start that need no other one."""
    return {
        "name": result.name,
        "k_dyn": json_number(result.k_dyn),
        "start_time": json_number(result.start_time),
        "peak_torque": json_number(float(units.shown(result.peak_torque, "N*m"))),
    }


def row(session: Session, result: Strategy) -> Frame:
    """One line of the table; `worn`, `soft`, times of settling, `limits`, `flag` are empty until computed.

    At equal time it is that of the strategy as it is set for that, empty until that is computed.
    """
    known, flag = session.row(result.name), ""
    if session.inputs.at_time and result.run is not None:
        known, flag, trouble = session.at_equal_time(result.name) or EqualTime(None)
        result = Strategy(result.name, None if known is None else known.run, trouble)
    time = math.nan if result.run is None else result.run.limited_time
    duty = session.duty_k_dyn(result.name)
    line = outcomes(result, session.inputs.units) | {"duty": None if duty is None else json_number(duty)}
    line |= {"trouble": result.trouble or ("" if math.isfinite(time) else result.status)}
    if known is None:
        empty = dict.fromkeys(("worn", "light", "soft", "settled", "settled_lost", "overshoot"))
        return line | empty | {"limits": "", "flag": flag, "set_to": ""}
    return line | {
        "worn": json_number(known.k_dyn_worn_gap),
        "light": json_number(known.cases["J2 x0.4"].k_dyn),
        "soft": json_number(known.cases[SOFT_END].k_dyn) if SOFT_END in known.cases else None,
        "settled": json_number(known.run.settled_time),
        "settled_lost": json_number(known.settled_lost),
        "overshoot": json_number(100.0 * known.run.overshoot),
        "limits": known.against_limits,
        "set_to": known.set_to,
        "flag": ", ".join(flag.word for flag in known.flags),
        "trouble": line["trouble"] or "; ".join(flag.text for flag in known.flags),
    }


def reference_words(reference: Reference, inputs: Inputs) -> tuple[str, ...]:
    """A reference's strategy, and what of it and of its machine is not as it is now.

    >>> session = Session()
    >>> session.select("ramp")
    >>> session.set_reference()
    >>> session.set("gap", 1.0)
    >>> session.set_parameter("time", "200 ms")
    >>> reference_words(session.inputs.reference, session.inputs)
    ('ramp', 'time default', 'total gap 0.5 rad')
    """
    controller, now = reference.controller, inputs.controllers.get(reference.label)
    words = [
        f"{parameter.name} {'default' if value is None else value}"
        for parameter in (machines.page_parameters(controller) if type(now) is type(controller) else ())
        if (value := getattr(controller, parameter.name)) != getattr(now, parameter.name)
    ]
    return reference.label, *words, differences(reference.machine, inputs.machine_in_units)


# traces -------------------------------------------------------------------------------------------------


def drawn(
    result: Strategy, units: Units, whole: bool = True, window: tuple[float, float] | None = None
) -> Frame | None:
    """A start as the browser draws it: channels in single precision, the peak; if `whole` shafts and bodies.

    Torques, speeds and angles are in these units; `turn` is how much of a rad/s at the motor one of the
    speeds is.
    """
    run = result.run
    if run is None:
        return None
    traces = traces_of(run, window)
    largest = f"T[{run.worst_shaft}]"
    channels = list(traces) if whole else ["t", largest]
    of = {"w": "rad/s", "theta": "rad", "T": "N*m", "u": "N*m"}
    rows = [units.shown(traces[name], of.get(name.partition("[")[0], "")) for name in channels]
    peak = min(int(np.searchsorted(traces["t"], run.peak_time)), traces["t"].size - 1)
    height = math.copysign(run.peak_torque, traces[largest][peak])
    picture: Frame = {
        "channels": channels,
        "data": b64encode(np.stack(rows).astype("<f4").tobytes()).decode("ascii"),
        "peak": [run.peak_time, float(units.shown(height, "N*m"))],
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
            "allowed": json_number(float(units.shown(run.permissible_torque, "N*m"))),
            "units": {
                "angle": units.of("rad"),
                "speed": units.of("rad/s"),
                "torque": unit(units.of("N*m")),
                "turn": 1.0 / units.shown(1.0, "rad/s"),
                "at": units.at,
            },
        }
    return picture


def stages_of(run: Run, shaft: int) -> list[tuple[float, float, int]]:
    """Contacts and free flights in the gap of one shaft, the first `MOST_STAGES` of them.

    Each has a start and an end in s, and the flank that is touched: 0 while the gap is open.
    """
    spans = run.trajectory.spans
    mode, side = run.trajectory.of_shafts("mode")[:-1, shaft], run.trajectory.of_shafts("side")[:-1, shaft]
    touched = np.where(np.isin(mode, (rec.OPEN, rec.BEYOND)), 0, np.where(side < 0.0, -1, 1))
    first = np.flatnonzero(np.diff(touched, prepend=2))[:MOST_STAGES]
    begins = spans[first, rec.S_START]
    ends = np.append(spans[first[1:], rec.S_START], run.end_time)
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
        return {"u": states["u"], **{name: states[state] for name, state in names.items()}}
    parts = {"T": states["T"], "theta": states["twist"], "w": states["w"]}
    each = {f"{name}[{k}]": row for name, rows in parts.items() for k, row in enumerate(rows.T)}
    return {"u": states["u"], **each}


def landmarks(run: Run) -> Vector:
    """Instants that are never thinned away: events and the instants just before, peaks of all stages, the
    peak of the run, the start time, the ends; and the joints of the motor torque while they are few.
    """
    events, joints = run.trajectory.events["time"], run.trajectory.spans[:, rec.S_START]
    peaks = [*run.trajectory.shafts["peak_time"], *(stage.peak_time for stage in run.stages)]
    if joints.size > JUMPS:
        joints = joints[:0]
    sudden = np.concatenate([events, joints])
    others = [run.peak_time, run.start_time, 0.0, run.end_time]
    times = np.concatenate([sudden, np.nextafter(sudden, 0.0), peaks, others])
    return np.unique(times[~np.isnan(times)].clip(0.0, run.end_time))


def thinned(rows: Vector, width: int) -> NDArray[np.intp]:
    """Which columns to keep so that each bucket of this width keeps the least and largest value of each row.

    >>> thinned(np.array([[0.0, 1.0, 9.0, 1.0, 0.0, -3.0, 0.0, 1.0]]), 4)
    array([0, 2, 5, 7])
    """
    boxes = rows.reshape(rows.shape[0], -1, width)
    starts = np.arange(0, rows.shape[1], width)
    return np.unique([boxes.argmin(axis=2) + starts, boxes.argmax(axis=2) + starts])
