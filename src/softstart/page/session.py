"""The state of one user: a drive, the strategies that start it, and what came out. No NiceGUI here.

What a user changes is one immutable `Inputs`; undo and redo go from one to another. Everything happens in the
thread of the page's event loop; a session belongs to one client.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from softstart.chain.model import load_machine
from softstart.controller.finding import changed_controller, make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.drive.data_sheet import UnknownStiffness
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.page.machines import STRATEGY, Loaded, startable, with_typed_changes, without
from softstart.page.sentences import FAILED_START, clipped, sentence_of
from softstart.quantities import Units, nearest
from softstart.start.comparison import DEFAULT_DRIVE, REFERENCE, SOFT_END, as_far_as_known, changed_case
from softstart.start.recommendation import CASES, SLOW, Case, Recommendation, Row, recommend
from softstart.start.simulation import simulate
from softstart.views.numbers import units_of
from softstart.views.starts import outcome

if TYPE_CHECKING:
    from softstart.controller.base import Controller
    from softstart.start.run import Run

SOFT = ("stiffness", "damping")  # what differs at the soft end of an unknown stiffness
MAX_STRATEGIES = 24
MOST_STEPS = 200  # that can be undone
PAUSE = 1.0  # s; changes of one slider that follow one another more quickly are one step
MOST_EVENTS = 200_000  # of one start on the page, some tenths of a second; the command line allows a million


@dataclass(frozen=True, eq=False)
class Strategy:
    """One strategy on the drive of the moment: its start, or the sentence that says why there is none.

    `cost` is the processor time that it took to compute, in s; `given_up`: it had too many events.
    """

    name: str
    run: Run | None
    trouble: str = ""
    cost: float = 0.0
    given_up: bool = False

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient; NaN where the start failed."""
        return math.nan if self.run is None else self.run.k_dyn

    @property
    def start_time(self) -> float:
        """Start time in s; NaN if the load does not reach its target speed."""
        return math.nan if self.run is None else self.run.start_time

    @property
    def peak_torque(self) -> float:
        """Largest |T| in N m."""
        return math.nan if self.run is None else self.run.peak_torque

    @property
    def status(self) -> str:
        """How the start ended, as a sentence."""
        return self.trouble if self.run is None else outcome(self.run)


@dataclass(frozen=True, eq=False)
class Reference:
    """A start that stays drawn while drive and strategies change: a controller, its label then, its drive."""

    drive: Machine
    label: str
    controller: Controller


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that a user can change.

    Parameters
    ----------
    drive : the drive or chain as it is now.
    origin : as it was loaded; ranges of sliders and maps are about it.
    controllers : all strategies of the table, by label, shown or not.
    selected : label of the strategy whose figure is large and whose map is drawn.
    drawn : labels of the strategies that are drawn beside it.
    reference : what all of them are compared with, if something is.
    soft : stiffness and damping at the soft end, of a drive that was loaded without any stiffness.
    """

    drive: Machine
    origin: Machine
    controllers: Mapping[str, Controller]
    selected: str
    drawn: frozenset[str]
    reference: Reference | None = None
    soft: Mapping[str, float] = field(default_factory=dict)


class Session:
    """Drive or chain and the strategies of a user; a refused change raises InputError and changes nothing.

    Results are computed when they are asked for and kept until the drive changes.

    >>> session = Session()
    >>> round(session.result("direct").k_dyn, 3)
    3.118
    >>> session.set("shaft.gap", "2 rad")
    >>> round(session.result("direct").k_dyn, 3), session.version
    (4.865, 1)
    >>> session.undo()
    >>> session.machine.gap
    0.5
    """

    def __init__(self, drive: Loaded | str = DEFAULT_DRIVE, controllers: Iterable[str] | None = None) -> None:
        drive, soft = _loaded(load_machine(drive) if isinstance(drive, str) else drive)
        names = list(ready_controller_names() if controllers is None else controllers)
        selected = _main(names)
        self._first = {name: make_controller(name) for name in names}
        self.bench = Inputs(drive, drive, self._first, selected, frozenset((selected,)), soft=soft)
        self._past: list[Inputs] = []
        self._future: list[Inputs] = []
        self._gesture = ("", -math.inf)  # what was changed last, and when
        self.name = secrets.token_urlsafe(9)
        self.version = 0  # how often anything was changed
        self.typed: dict[tuple[str, Any], str] = {}  # texts by path and by the value that they gave
        self._listeners: list[Callable[[], None]] = []
        # what was computed last, by label, and for what; `ready` and `row` tell whether it still holds
        self._results: dict[str, tuple[Machine, Controller, Strategy]] = {}
        self._rows: dict[str, Row] = {}
        self._direct: tuple[Machine, Run | None] | None = None
        self._reference: tuple[Reference, Strategy] | None = None

    # the state -----------------------------------------------------------------------------------------

    @property
    def machine(self) -> Machine:
        """The drive or the chain as it is now."""
        return self.bench.drive

    @property
    def origin(self) -> Machine:
        """The drive or chain as it was loaded: ranges of sliders and maps are about it."""
        return self.bench.origin

    @property
    def units(self) -> Units:
        """Those of angles and speeds: as the machine names them, else as its values had them when loaded.

        A value that is typed in another unit changes them for no other field.

        >>> session = Session("hoist-15kw")
        >>> session.set("shaft.gap", "100 mrad")
        >>> session.units.angle, session.seen.units
        ('deg', 'deg, rpm')
        """
        return units_of(self.origin, self.machine.units)

    @property
    def seen(self) -> Machine:
        """The machine in these units, for what is computed and written elsewhere, as reports and tabs."""
        same = units_of(self.machine) == self.units
        return self.machine if same else with_typed_changes(self.machine, {"units": self.units.text})

    @property
    def soft(self) -> Drive | None:
        """The drive of now at the soft end of an unknown stiffness; None where the stiffness is known.

        A value that has been set since is that of both ends; a stiffness that has been set is known.

        >>> from softstart.drive.data_sheet import UnknownStiffness
        >>> crane = Session().machine
        >>> session = Session(UnknownStiffness(crane, crane.replace(stiffness=0.01 * crane.stiffness)))
        >>> session.set("gap", 1.0)
        >>> round(session.soft.stiffness, 5), session.soft.gap
        (3.68465, 1.0)
        >>> session.set("stiffness", 400.0)
        >>> session.soft is None
        True
        """
        now, origin, soft = self.machine, self.origin, self.bench.soft
        if not (soft and isinstance(now, Drive) and isinstance(origin, Drive)):
            return None
        if now.stiffness != origin.stiffness:
            return None
        same = {name: value for name, value in soft.items() if getattr(now, name) == getattr(origin, name)}
        return now.replace(**same)

    @property
    def possible(self) -> Machine | UnknownStiffness:
        """`seen`, at both ends where its stiffness is unknown."""
        seen, soft = self.seen, self.soft
        if soft is None or not isinstance(seen, Drive):
            return seen
        return UnknownStiffness(seen, soft.replace(units=seen.units))

    @property
    def controllers(self) -> Mapping[str, Controller]:
        """All strategies of the table: controllers by label, shown or not."""
        return self.bench.controllers

    @property
    def shown(self) -> tuple[str, ...]:
        """Labels of the strategies that are drawn, in the order of the table; the selected one always is."""
        drawn = {*self.bench.drawn, self.selected}
        return tuple(label for label in self.controllers if label in drawn)

    @property
    def added(self) -> tuple[str, ...]:
        """Labels of the strategies that have joined: those that may be taken out again."""
        return tuple(label for label in self.controllers if label not in self._first)

    @property
    def changed(self) -> tuple[str, ...]:
        """Labels of the strategies with a parameter that is not the default."""
        return tuple(label for label, first in self._first.items()
                     if self.controllers.get(label, first) != first)  # fmt: skip

    @property
    def selected(self) -> str:
        """Label of the strategy whose figure is large and whose map is drawn."""
        return self.bench.selected

    @property
    def steps(self) -> tuple[int, int]:
        """How many steps can be undone, and redone."""
        return len(self._past), len(self._future)

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback()` after each change; returns a function that ends this."""
        self._listeners.append(callback)

        def stop() -> None:
            if callback in self._listeners:
                self._listeners.remove(callback)

        return stop

    # changes -------------------------------------------------------------------------------------------

    def set(self, path: str, value: str | float | None, gesture: str = "") -> None:
        """Change one parameter, `shaft.gap`, `gap` or `strategy.time`, to an SI number or a text with a unit.

        None takes a value back that need not be given, as a limit. Changes of one gesture are one step.

        >>> session = Session()
        >>> session.set("gap", "4 metres")
        Traceback (most recent call last):
        softstart.errors.InputError: gap = "4 metres": metres is a length, not an angle; ...
        >>> session.machine.gap
        0.5
        """
        if path.startswith(STRATEGY):
            self.set_parameter(path.removeprefix(STRATEGY), value, gesture)
        elif value is None:
            self._put(drive=startable(without(self.machine, path)))
        else:
            self.set_all({path: value}, gesture)

    def set_all(self, changes: Mapping[str, str | float], gesture: str = "") -> None:
        """Change several parameters of the machine in one step, or none of them."""
        settings = {path: value if isinstance(value, str) else repr(float(value))
                    for path, value in changes.items()}  # fmt: skip
        self._put(gesture, drive=startable(with_typed_changes(self.machine, settings)))
        if texts := {path: text for path, text in changes.items() if isinstance(text, str)}:
            values = self.machine.parameters_by_path()
            self.typed |= {(path, values[path][1]): text for path, text in texts.items() if path in values}

    def move(self, gap: float, load_inertia: float) -> None:
        """Go to another place of the map: gap in rad, of a chain all gaps together, and inertia in kg m2."""
        self._put(drive=self.machine.with_gap_and_inertia(gap, load_inertia, self.origin))

    def set_parameter(self, name: str, value: str | float | None, gesture: str = "") -> None:
        """Change one parameter of the selected strategy; None gives it back its default.

        >>> session = Session()
        >>> session.select("ramp")
        >>> session.set_parameter("time", "200 ms")
        >>> session.controllers["ramp"].time, session.changed
        (0.2, ('ramp',))
        """
        controller = changed_controller(self.controllers[self.selected], {name: value})
        self._put(gesture, controllers={**self.controllers, self.selected: controller})

    def take(self, drive: Loaded) -> None:
        """Go over to another drive or chain, without the optima and gains that were computed for this one."""
        drive, soft = _loaded(drive)
        own = {label: one for label, one in self.controllers.items() if label in self._first} or self._first
        selected = self.selected if self.selected in own else _main(own)
        drawn = self.bench.drawn.intersection(own)
        self._put(drive=drive, origin=drive, controllers=own, selected=selected, drawn=drawn, soft=soft)

    def restore(self, bench: Inputs) -> None:
        """Begin with a bench of before, or of somebody else; nothing can be undone then."""
        self._past, self._future = [], []
        self._go_to(bench)

    def undo(self) -> None:
        """Take the last change back; nothing happens if there is none."""
        if self._past:
            self._future.append(self.bench)
            self._go_to(self._past.pop())

    def redo(self) -> None:
        """Make the change that was taken back last; nothing happens if there is none."""
        if self._future:
            self._past.append(self.bench)
            self._go_to(self._future.pop())

    def add(self, label: str, controller: Controller, *, select: bool = True) -> str:
        """Let a controller (tuned gains, the profile of an optimum) join the strategies.

        A label that is there already is replaced. Returns the label under which it stands.
        """
        label = " ".join(label.split())[:60] or controller.name or type(controller).__name__
        if label not in self.controllers and len(self.controllers) >= MAX_STRATEGIES:
            raise InputError(
                f'strategy "{label}": there are {MAX_STRATEGIES} strategies already; remove one first.'
            )
        self._put(
            controllers={**self.controllers, label: controller},
            drawn=self.bench.drawn | {label},
            selected=label if select else self.selected,
        )
        return label

    def remove(self, label: str) -> None:
        """Take a strategy out of the table; the last one stays."""
        self._known(label)
        if len(self.controllers) == 1:
            raise InputError(f'strategy "{label}": this is the last strategy; add another one first.')
        left = {name: controller for name, controller in self.controllers.items() if name != label}
        selected = next(iter(left)) if self.selected == label else self.selected
        self._put(controllers=left, drawn=self.bench.drawn - {label}, selected=selected)

    def select(self, label: str) -> None:
        """Make a strategy the one whose figure is large; it is shown from then on."""
        self._known(label)
        if label != self.selected or label not in self.bench.drawn:
            self._put(selected=label, drawn=self.bench.drawn | {label})

    def show(self, label: str, visible: bool = True) -> None:
        """Draw a strategy or hide it."""
        self._known(label)
        if visible != (label in self.bench.drawn):
            self._put(drawn=self.bench.drawn ^ {label})

    def keep_reference(self, kept: bool = True) -> None:
        """Compare with the selected strategy on the drive as both are now; with nothing if not `kept`.

        >>> session = Session()
        >>> session.select("direct")
        >>> session.keep_reference()
        >>> session.set("gap", 1.0)
        >>> session.reference().k_dyn < session.result("direct").k_dyn
        True
        """
        label = self.selected
        made = Reference(self.machine, label, self.controllers[label]) if kept else None
        if made is not None and (known := self.ready(label)) is not None:
            self._reference = made, known
        if made is not self.bench.reference:
            self._put(reference=made)

    def select_gentlest(self) -> None:
        """Select the strategy with the least K_dyn of those that reach the target speed in good time."""
        latest = SLOW * (math.inf if (direct := self.direct()) is None else direct.start_time)
        timely = [found for found in self.strategies if found.start_time <= latest]
        if timely:
            self.select(min(timely, key=lambda found: found.k_dyn).name)

    # what came out -------------------------------------------------------------------------------------

    @property
    def strategies(self) -> list[Strategy]:
        """All strategies on the drive as it is now, in the order of the table."""
        return [self.result(label) for label in self.controllers]

    def ready(self, label: str) -> Strategy | None:
        """The result of a strategy if it is computed already."""
        drive, controller, found = self._results.get(label, (None, None, None))
        return found if drive is self.machine and controller is self.controllers.get(label) else None

    def row(self, label: str) -> Row | None:
        """The row of a strategy in a comparison, if it is computed already, see `judged`."""
        row, found = self._rows.get(label), self.ready(label)
        return row if row is not None and found is not None and row.run is found.run else None

    def result(self, label: str, max_events: int = MOST_EVENTS) -> Strategy:
        """A strategy on the drive as it is now. What goes wrong in its start becomes its sentence.

        A start that has more than `max_events` events is given up, and is not kept as the result.
        """
        self._known(label)
        if (known := self.ready(label)) is not None:
            return known
        drive, controller = self.machine, self.controllers[label]
        found = _started(label, drive, controller, max_events)
        if not found.given_up or max_events >= MOST_EVENTS:
            self._results[label] = drive, controller, found
        return found

    def reference(self) -> Strategy | None:
        """The start that all are compared with, on the drive that it was kept with; None if none was kept."""
        kept = self.bench.reference
        if kept is None:
            return None
        if self._reference is None or self._reference[0] is not kept:
            self._reference = kept, _started(kept.label, kept.drive, kept.controller, MOST_EVENTS)
        return self._reference[1]

    def judged(self, label: str) -> Iterator[None]:
        """Compute the row of a strategy in a comparison, step by step; there is none if its start fails."""
        run = self.result(label).run
        if run is None or self.row(label) is not None:
            return
        cases, soft = dict[str, Case](), self.soft
        for case in (*CASES, *([SOFT_END] if soft else [])):
            yield None
            there = soft if case == SOFT_END else None
            try:
                cases[case] = changed_case(self.machine, self.controllers[label], case, soft=there)
            except Exception as error:  # a controller is anyone's code; there is no room for the sentence
                sentence_of(error)  # which is logged
                cases[case] = Case.of(None)
        self._rows[label] = Row(run, self.direct(), cases, tuple(cases), label)
        _ = run.settled_time, self._rows[label].flags  # computed here, kept in the runs

    def recommendation(self) -> Recommendation:
        """What is recommended among the strategies, and why: the text of `softstart.compare`."""
        for label in self.controllers:
            list(self.judged(label))
        return recommend(
            self.machine, [row for one in self.controllers if (row := self.row(one)) is not None]
        )

    def direct(self) -> Run | None:
        """The start that the others are compared with; None where it fails."""
        if self._direct is None or self._direct[0] is not self.machine:
            known = self.ready(REFERENCE) if REFERENCE not in self.changed else None
            run = known.run if known is not None else None
            try:
                run = run or simulate(self.machine, REFERENCE, max_events=MOST_EVENTS)
            except (InputError, SimulationError):
                run = None
            self._direct = self.machine, run
        return self._direct[1]

    def time_lost(self, found: Strategy) -> float:
        """Start time over that of `direct`, s; NaN where one of them is."""
        direct = self.direct()
        return found.start_time - (math.nan if direct is None else direct.start_time)

    def close(self) -> None:
        """Let go of all results and listeners: the user has gone."""
        self._listeners.clear()
        self._results.clear()
        self._rows.clear()
        self._past, self._future, self._reference = [], [], None

    # ---------------------------------------------------------------------------------------------------

    def _put(self, gesture: str = "", **changes: Any) -> None:
        """Change the bench; changes of one gesture that follow one another quickly are one step."""
        now = time.monotonic()
        last, when = self._gesture
        if not gesture or gesture != last or now - when > PAUSE or not self._past:
            self._past = [*self._past[1 - MOST_STEPS :], self.bench]
        self._future = []
        self._go_to(replace(self.bench, **changes), (gesture, now))

    def _go_to(self, bench: Inputs, gesture: tuple[str, float] = ("", -math.inf)) -> None:
        self.bench, self._gesture = bench, gesture
        self.version += 1
        for listener in tuple(self._listeners):
            listener()

    def _known(self, label: str) -> None:
        if label not in self.controllers:
            near = nearest(label, list(self.controllers))
            hint = f"did you mean {near}?" if near else f"there are {', '.join(self.controllers)}."
            raise InputError(f'strategy "{clipped(label)}": there is no strategy of this name; {hint}')


def _loaded(given: Loaded) -> tuple[Machine, dict[str, float]]:
    """The machine of now, and what differs at the soft end of an unknown stiffness."""
    known, _, soft = as_far_as_known(given)
    return startable(known), {} if soft is None else {name: getattr(soft, name) for name in SOFT}


def _main(labels: Iterable[str]) -> str:
    """The strategy that is selected first."""
    return REFERENCE if REFERENCE in labels else next(iter(labels), REFERENCE)


def _started(label: str, drive: Machine, controller: Controller, max_events: int) -> Strategy:
    began = time.thread_time()
    try:
        run, trouble, given_up = simulate(drive, controller, max_events=max_events), "", False
    except Exception as error:  # a controller is anyone's code and may fail in any way
        run, trouble, given_up = None, sentence_of(error, FAILED_START), isinstance(error, SimulationError)
    return Strategy(label, run, trouble, time.thread_time() - began, given_up)
