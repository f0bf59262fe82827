"""What a user does on the page, applied to the session; an error message appears next to its field."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from time import perf_counter

from softstart.errors import InputError
from softstart.page import links
from softstart.page.frames import SERVER, FrameBuilder
from softstart.page.machines import DIGITS, NODE_DIGITS, FormField
from softstart.page.sentences import field_labels, sentence_of
from softstart.page.session import Session
from softstart.quantities import seen_from
from softstart.views.numbers import unit

DRIFT = 2e-4  # of two clocks against one another: more than real ones have
LARGEST = 1e15  # beyond any number of a message: clocks in ms, positions, values
LONGEST_TEXT = 200  # characters in a field


class Delay:
    """How late messages come, in s: over the quickest one of late, since the two clocks are not set alike.

    >>> delay = Delay()
    >>> [round(delay.of(stamp, now), 3) for stamp, now in ((3.0, 10.0), (3.5, 10.5), (4.0, 11.4))]
    [0.0, 0.0, 0.4]
    """

    def __init__(self) -> None:
        self._offset = math.inf
        self._last = 0.0

    def of(self, stamp: float, now: float) -> float:
        """The delay of a message with the sender's time on it that was read now."""
        self._offset = min(now - stamp, self._offset + DRIFT * (now - self._last))
        self._last = now
        return now - stamp - self._offset


class Controls:
    """Takes messages of the browser, dictionaries with `what` and more; never raises for a wrong one.

    `poke` is called after each message that may change what is shown but has left the session unchanged; the
    session informs its listeners of its own changes.
    """

    def __init__(self, session: Session, frames: FrameBuilder, poke: Callable[[], None]) -> None:
        self._session = session
        self._frames = frames
        self._poke = poke
        self._delay = Delay()
        # by `what`: what to do, and the arguments that it needs; other messages are none of this page's
        self._actions: Mapping[str, tuple[Callable[..., None], Mapping[str, type]]] = {
            "slide": (self._slide, {"path": str, "position": float}),
            "edit": (self._edit, {"path": str, "text": str}),
            "reset": (self._reset, {"path": str}),
            "undo": (session.undo, {}),
            "redo": (session.redo, {}),
            "leave": (self._leave, {"path": str}),
            "jump": (self._jump, {"gap": float, "inertia": float}),
            "select": (session.select, {"name": str}),
            "show": (session.show, {"name": str, "visible": bool}),
            "remove": (session.remove, {"name": str}),
            "fix": (self._fix, {"fixed": bool}),
            "reference": (session.set_reference, {"on": bool}),
            "show_at": (session.show_at, {"output": bool}),
            "at_time": (session.set_at_time, {"text": str}),
            "duty_step": (self._duty_step, {"index": float}),
            "duty_add": (self._duty_add, {"index": float, "do": str}),
            "duty_remove": (self._duty_remove, {"index": float}),
            "duty_move": (self._duty_move, {"index": float, "to": float}),
            "duty_time": (self._duty_time, {"index": float, "time": float}),
            "window": (self._window, {"begin": float, "end": float}),
            "hello": (self._hello, {"stored": object, "link": object}),
        }

    def take(self, message: object) -> None:
        """One message. What is wrong with it is in the next frame, next to its field if it has one."""
        if not isinstance(message, Mapping):
            return
        act, kinds = self._actions.get(str(message.get("what")), (None, {}))
        arguments = {name: message.get(name) for name in kinds}
        if act is None or not all(_is_a(kind, arguments[name]) for name, kind in kinds.items()):
            return
        self._frames.follow()
        # without a field, the message appears next to the figure
        place = path if (path := str(arguments.get("path"))) in self._frames.entries else ""
        version = self._session.version
        if _is_a(float, message.get("stamp")):
            self._frames.stamp = float(message["stamp"])
            self._frames.late = self._delay.of(self._frames.stamp / 1000.0, perf_counter())
        try:
            act(*arguments.values())
        except Exception as error:  # a drive may refuse anything
            said = sentence_of(error, labels=self._labels(place))
            if place:  # a number without a unit is in that of the field
                entry = self._frames.entries[place]
                own = unit(entry.seen(self._session.inputs.units).of(entry.unit))
                said = re.sub(r"(?<=as a bare number in )\S+(?=\.)", own, said)
            self._frames.mistakes[place] = said
        else:
            self._frames.mistakes.pop(place, None)
        if self._session.version == version:
            self._poke()

    def _labels(self, place: str) -> dict[str, str]:
        """What fields are called in an error message beside the field at this place, which names it first."""
        entries, labels = self._frames.entries, field_labels(self._session.inputs.machine)
        labels |= {path: entry.label for path, entry in entries.items() if path not in labels}
        table = place.rpartition(".")[0]  # some messages have the key alone
        beside = {path.rpartition(".")[2]: entry.label for path, entry in entries.items()
                  if path.startswith(f"{table}.")}  # fmt: skip
        own = {place: entries[place].label} if place else {"at_time": "equal time"}
        return beside | labels | own

    def _entry(self, path: str) -> FormField:
        if path not in self._frames.entries:
            raise InputError(f'"{path[:LONGEST_TEXT]}": there is no such field.')
        return self._frames.entries[path]

    def _slide(self, path: str, position: float) -> None:
        entry = self._entry(path)
        units = entry.seen(self._session.inputs.units)
        if entry.scale is None:
            raise InputError(f"{path}: there is no such slider.")
        value = entry.scale.value(position)
        if units.of(entry.unit) != entry.unit or units.gear:
            value = units.rounded(value, entry.unit, DIGITS)
        self._session.set(path, value, gesture=path)

    def _edit(self, path: str, text: str) -> None:
        entry = self._entry(path)
        if len(text) > LONGEST_TEXT:
            raise InputError(
                f"{path}: the text has more than {LONGEST_TEXT} characters; write {entry.example}."
            )
        units = self._session.inputs.units
        words = entry.seen(units).typed(" ".join(text.split()), entry.unit)
        if path == "units" and units.gear and "at " not in words:  # the switch beside it says which
            words = seen_from(words, True)
        if not (words or entry.optional):
            raise InputError(f"{path}: the field is empty; write for example {entry.example}.")
        self._session.set(path, words or None)

    def _reset(self, path: str) -> None:
        """A parameter of the machine as it was loaded, or the default of one of the strategy."""
        _, loaded = self._session.inputs.origin.parameters_by_path().get(self._entry(path).path, (None, None))
        self._session.set(path, loaded)

    def _leave(self, path: str) -> None:
        """Discard the text of a field: nothing changes, and its error message disappears."""

    def _jump(self, gap: float, inertia: float) -> None:
        self._session.move(self._session.inputs.units.rounded(gap, "rad", NODE_DIGITS), inertia)
        self._frames.mistakes.clear()

    def _hello(self, stored: object, link: object) -> None:
        """The page is there; reloaded, it goes on with what its tab has stored, or with its address."""
        if isinstance(stored, Mapping) and stored.get("server") == SERVER and stored.get("link") == link:
            inputs = links.stored(str(stored.get("name")), str(link))
            if inputs is not None:
                self._session.restore(inputs)
                return
        if isinstance(link, str) and link:
            self._session.restore(links.inputs_of(link, self._session.inputs))

    def _fix(self, fixed: bool) -> None:
        self._frames.fixed = fixed

    def _window(self, begin: float, end: float) -> None:
        """Visible part of the starts, in s; all of it if it has no length."""
        self._frames.window = (max(begin, 0.0), end) if end > max(begin, 0.0) else None

    # the duty: `index` is the place of a step, from 0

    def _duty_step(self, index: float) -> None:
        self._frames.duty_step = min(max(int(index), 0), len(self._session.inputs.plan.steps) - 1)

    def _duty_add(self, index: float, do: str) -> None:
        inputs = self._session.inputs
        plan = inputs.plan.added(int(index), do, inputs.machine)
        self._frames.duty_step = min(max(int(index), 0), len(inputs.plan.steps))
        self._session.set_duty(plan)

    def _duty_remove(self, index: float) -> None:
        self._session.set_duty(self._session.inputs.plan.removed(int(index)))
        if int(index) < self._frames.duty_step:
            self._frames.duty_step -= 1

    def _duty_move(self, index: float, to: float) -> None:
        plan = self._session.inputs.plan.moved(int(index), int(to))
        self._frames.duty_step = min(max(int(to), 0), len(plan.steps) - 1)
        self._session.set_duty(plan)

    def _duty_time(self, index: float, time: float) -> None:
        plan = self._session.inputs.plan.timed(int(index), time)
        self._session.set_duty(plan, gesture=f"duty_time {int(index)}")


def _is_a(kind: type, value: object) -> bool:
    """Whether JSON holds a value of this kind; a number is neither true nor beyond all that can be meant."""
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST
    return isinstance(value, kind)
