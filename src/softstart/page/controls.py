"""What a user does on the page, applied to the session; an error message appears next to its field."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

from softstart.errors import InputError
from softstart.page import links
from softstart.page.frames import SERVER, STRATEGY, Screen
from softstart.page.machines import DIGITS, NODE_DIGITS, Entry
from softstart.page.sentences import sentence_of
from softstart.page.session import Session

DRIFT = 2e-4  # of two clocks against one another: more than real ones have
LARGEST = 1e15  # beyond any number of a message: clocks in ms, positions, values
LONGEST_TEXT = 200  # letters in a field


class Delay:
    """How late messages come, in s: over the quickest one of late, since the two clocks are not set alike.

    >>> delay = Delay(clock=iter([10.0, 10.5, 11.4]).__next__)
    >>> [round(delay.of(stamp), 3) for stamp in (3.0, 3.5, 4.0)]
    [0.0, 0.0, 0.4]
    """

    def __init__(self, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self._offset = math.inf
        self._last = 0.0

    def of(self, stamp: float) -> float:
        """The delay of a message with the sender's time on it."""
        now = self._clock()
        self._offset = min(now - stamp, self._offset + DRIFT * (now - self._last))
        self._last = now
        return now - stamp - self._offset


class Controls:
    """Takes messages of the browser, dictionaries with `what` and more; never raises for a wrong one.

    `poke` is called after each message that may change what is shown but has left the session unchanged; of
    its own changes the session informs its listeners.
    """

    def __init__(self, session: Session, screen: Screen, poke: Callable[[], None]) -> None:
        self._session = session
        self._screen = screen
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
            "keep": (self._keep, {"kept": bool}),
            "reference": (session.keep_reference, {"kept": bool}),
            "window": (self._window, {"begin": float, "end": float}),
            "hello": (self._hello, {"kept": object, "link": object}),
        }

    def take(self, message: object) -> None:
        """One message. What is wrong with it is said in the next frame, next to its field if it has one."""
        if not isinstance(message, Mapping):
            return
        act, kinds = self._actions.get(str(message.get("what")), (None, {}))
        arguments = {name: message.get(name) for name in kinds}
        if act is None or not all(_is_a(kind, arguments[name]) for name, kind in kinds.items()):
            return
        # without a field, the message appears next to the figure
        path = str(arguments.get("path"))
        place = path if path in self._screen.entries or path in self._screen.strategy_paths() else ""
        version = self._session.version
        stamp: Any = message.get("stamp")
        if _is_a(float, stamp):
            self._screen.stamp = float(stamp)
            self._screen.late = self._delay.of(float(stamp) / 1000.0)
        try:
            act(*arguments.values())
        except Exception as error:  # a drive may refuse anything
            self._screen.mistakes[place] = sentence_of(error)
        else:
            self._screen.mistakes.pop(place, None)
        if self._session.version == version:
            self._poke()

    def _slide(self, path: str, position: float) -> None:
        own = path in self._screen.strategy_paths()
        name = _own(path) if own else path
        scale = (self._screen.strategy_scales if own else self._screen.scales).get(name)
        if scale is None:
            raise InputError(f"{path}: there is no such slider.")
        value, units, si = scale.value(position), self._screen.units, self._screen.si(path)
        if units.of(si) != si:
            value = units.rounded(value, si, DIGITS)
        if own:
            self._session.set_parameter(name, value, gesture=path)
        else:
            self._session.set_all({path: value}, gesture=path)

    def _edit(self, path: str, text: str) -> None:
        own = path in self._screen.strategy_paths()
        example = "a value, or nothing for the default" if own else self._entry(path).parameter.example
        if len(text) > LONGEST_TEXT:
            raise InputError(f"{path}: the text has more than {LONGEST_TEXT} letters; write {example}.")
        words = self._screen.units.typed(" ".join(text.split()), self._screen.si(path))
        if own:
            self._session.set_parameter(_own(path), words or None)
        elif words:
            self._session.set(path, words)
        elif self._entry(path).parameter.default is None:
            self._session.clear(path)
        else:
            raise InputError(f"{path}: the field is empty; write for example {example}.")

    def _reset(self, path: str) -> None:
        """A parameter of the machine as it was loaded, or the default of one of the strategy."""
        if path in self._screen.strategy_paths():
            self._session.set_parameter(_own(path), None)
        else:
            loaded = self._session.origin.by_path()[self._entry(path).path][1]
            if loaded is None:
                self._session.clear(path)
            else:
                self._session.set(path, loaded)

    def _entry(self, path: str) -> Entry:
        if path not in self._screen.entries:
            raise InputError(f'"{path[:LONGEST_TEXT]}": there is no such field.')
        return self._screen.entries[path]

    def _leave(self, path: str) -> None:
        """What was written in a field is undone: nothing changes, and its error message disappears."""

    def _jump(self, gap: float, inertia: float) -> None:
        units = self._screen.units
        self._session.move(units.rounded(units.size("rad") * gap, "rad", NODE_DIGITS), inertia)
        self._screen.mistakes.clear()

    def _hello(self, kept: object, link: object) -> None:
        """A page that is loaded anew goes on with the bench that its tab has kept, or that of its address."""
        self._screen.forget()
        if isinstance(kept, Mapping) and kept.get("server") == SERVER and kept.get("link") == link:
            known = links.kept(str(kept.get("bench")), str(link))
            if known is not None:
                self._session.restore(known)
                return
        if isinstance(link, str) and link:
            self._session.restore(links.bench_of(link, self._session.bench))

    def _keep(self, kept: bool) -> None:
        self._screen.kept = kept

    def _window(self, begin: float, end: float) -> None:
        """What of the starts is seen, in s; all of it if it has no length."""
        self._screen.window = (max(begin, 0.0), end) if end > max(begin, 0.0) else None


def _own(path: str) -> str:
    """The name of a parameter of the selected strategy."""
    return path.removeprefix(STRATEGY)


def _is_a(kind: type, value: object) -> bool:
    """Whether JSON holds a value of this kind; a number is neither true nor beyond all that can be meant."""
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST
    return isinstance(value, kind)
