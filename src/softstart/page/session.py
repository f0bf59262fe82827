"""The state of one user: a machine, the strategies that start it, and the results. No NiceGUI here.

All that a user can change is one immutable `Inputs`; undo and redo go from one to another. Everything happens
in the thread of the page's event loop; a session belongs to one client.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from softstart.chain.machines import load_machine
from softstart.controller.finding import changed_controller, make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.drive.data_sheet import still_assumed
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.hints import nearest
from softstart.page.duty import PATH, DutyPlan, plan_of, with_duty
from softstart.page.machines import NAME, STRATEGY, startable, with_typed_changes, without
from softstart.page.sentences import FAILED_START, field_labels, sentence_of
from softstart.plugins import controller_names
from softstart.project import Project, StoredOptimum
from softstart.project.parts import refuse_longer, renamed
from softstart.quantities import Units, seen_from
from softstart.start.comparison import (
    REFERENCE,
    SOFT_END,
    Comparison,
    TooSlow,
    changed_case,
    compared,
    equal_time,
    row_at_time,
)
from softstart.start.duty import DutyRun, StepRun, run_duty
from softstart.start.recommendation import CASES, SLOW, Case, Recommendation, Row, recommend
from softstart.start.simulation import DEFAULT_DRIVE, simulate
from softstart.views.numbers import cut, units_of
from softstart.views.starts import outcome

if TYPE_CHECKING:
    from softstart.controller.base import Controller
    from softstart.start.run import Run

MAX_STRATEGIES = 24
MAX_UNDO = 200
PAUSE = 1.0  # s; changes of one slider that follow one another more quickly are one step
MAX_AT_TIME = 10.0  # times the settled time of direct: a longer time sets nothing else
MAX_EVENTS_SET = 2_000  # of a start whose strategy is set for equal time: that takes 64 of them
LONGEST_TIME, LONGEST_LABEL = 40, 60  # characters
LONGEST_DUTY, OTHER_DUTY = 3.0, 0.5  # s of processor time under the selected strategy, and any other one
TOO_LONG_DUTY = (
    "The duty takes too long to be carried out while you wait; give fewer repetitions or shorter steps."
)
MAX_EVENTS = 200_000  # of one start on the page, some tenths of a second; the command line allows a million


NO_PROJECT = Project()


@dataclass(frozen=True, eq=False)
class Strategy:
    """One strategy on the present machine: its start, or the sentence that says why there is none."""

    name: str
    run: Run | None
    trouble: str = ""
    cost: float = 0.0  # processor time of the start, s
    given_up: bool = False  # it had too many events

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient; NaN where the start failed."""
        return math.nan if self.run is None else self.run.k_dyn

    @property
    def start_time(self) -> float:
        """Start time in s; NaN if the load does not reach its target speed."""
        return math.nan if self.run is None else self.run.start_time

    @property
    def settled_time(self) -> float:
        """From when on the load keeps its speed, s; NaN if it does not."""
        return math.nan if self.run is None else self.run.settled_time

    @property
    def peak_torque(self) -> float:
        """Largest |T| in N m."""
        return math.nan if self.run is None else self.run.peak_torque

    @property
    def status(self) -> str:
        """How the start ended, as a sentence."""
        return self.trouble if self.run is None else outcome(self.run)


@dataclass(frozen=True, eq=False)
class DutyResult:
    """The duty under one strategy, or the sentence that says why there is none."""

    run: DutyRun | None
    trouble: str = ""
    given_up: bool = False  # it takes too long


class ClaimedOptimum(NamedTuple):
    """What an optimum claims, and the machine on which it holds; it is checked on that again."""

    machine: Machine
    stored: StoredOptimum


class EqualTime(NamedTuple):
    """A strategy set for a given time: its row, or a word and the sentence that say why there is none."""

    row: Row | None
    flag: str = ""
    trouble: str = ""


@dataclass(frozen=True, eq=False)
class Reference:
    """A start that stays drawn while machine and strategies change: as they were when it was chosen."""

    machine: Machine
    label: str
    controller: Controller


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that a user can change, and what follows from it alone."""

    machine: Machine  # the drive or chain as it is now
    origin: Machine  # as it was loaded: ranges of sliders and maps are about it
    controllers: Mapping[str, Controller]  # all strategies of the table by label, visible or not
    selected: str  # label of the strategy with the large figure and the map
    visible: frozenset[str]  # labels of the strategies that are drawn beside it
    reference: Reference | None = None  # what all strategies are compared with
    at_time: str = ""  # within which the strategies of the table are set to settle, "1.3x"; "" as they are
    duty: DutyPlan | None = None  # of the machine, without its own: start, hold, stop
    project: Project = NO_PROJECT  # what it has beside that: names, notes, other machines, earlier optima
    optima: Mapping[str, ClaimedOptimum] = field(default_factory=dict)  # that were computed here, by label

    @cached_property
    def units(self) -> Units:
        """Units and shaft: as the machine names them, else as its values had them when loaded.

        A value that is typed in another unit changes them for no other field.

        >>> session = Session("hoist-15kw")
        >>> session.set("shaft.gap", "100 mrad")
        >>> session.inputs.units.angle, session.inputs.machine_in_units.units
        ('deg', 'deg, rpm')
        """
        return units_of(self.machine, self.origin)

    @cached_property
    def machine_in_units(self) -> Machine:
        """The machine that names these units, for what is computed and written elsewhere, as reports."""
        same = units_of(self.machine) == self.units
        return self.machine if same else with_typed_changes(self.machine, {"units": self.units.text})

    @property
    def soft_drive(self) -> Drive | None:
        """The present drive at the soft end of an unknown stiffness; None where the stiffness is known."""
        return self.machine.soft if isinstance(self.machine, Drive) else None

    @cached_property
    def plan(self) -> DutyPlan:
        """The duty that is shown."""
        return self.duty or DutyPlan()

    @property
    def machine_with_duty(self) -> Machine:
        """`machine_in_units` with the duty, if one was made; InputError where its steps are wrong."""
        machine = self.machine_in_units
        return machine if self.duty is None else with_duty(machine, self.duty.duty)

    @property
    def claimed(self) -> frozenset[str]:
        """Labels of optima: computed here, or of the project."""
        return frozenset((*self.optima, *(one.name for one in self.project.optima)))

    @property
    def drawn(self) -> tuple[str, ...]:
        """Labels of the strategies that are drawn, in the order of the table; the selected one always is."""
        return tuple(label for label in self.controllers if label in self.visible or label == self.selected)


class Session:
    """Inputs and results of a user; a refused change raises InputError and changes nothing.

    Results are computed when they are asked for and kept until the machine changes.

    >>> session = Session()
    >>> round(session.result("direct").k_dyn, 3)
    3.118
    >>> session.set("shaft.gap", "2 rad")
    >>> round(session.result("direct").k_dyn, 3), session.version
    (4.865, 1)
    >>> session.undo()
    >>> session.inputs.machine.gap
    0.5
    """

    def __init__(
        self, machine: Machine | Project | str = DEFAULT_DRIVE, controllers: Iterable[str] | None = None
    ) -> None:
        project = machine if isinstance(machine, Project) else Project()
        if isinstance(machine, Project):
            machine = machine.single()
        stiff, duty = plan_of(startable(load_machine(machine) if isinstance(machine, str) else machine))
        names = list(ready_controller_names() if controllers is None else controllers)
        selected = _first_selected(names)
        self._initial = {name: make_controller(name) for name in names}
        self.inputs = Inputs(stiff, stiff, self._initial, selected, frozenset((selected,)), duty=duty)
        self._past: list[Inputs] = []
        self._future: list[Inputs] = []
        self._gesture = ("", -math.inf)  # what was changed last, and when
        self._offered = ""  # label that the page itself has selected
        self._followed: tuple[object, ...] = ()  # machine as loaded, and limits, of the last recommendation
        self.name = secrets.token_urlsafe(9)
        self.version = 0  # how often anything was changed
        self.typed: dict[tuple[str, Any], str] = {}  # texts by path and by the value that they gave
        self._listeners: list[Callable[[], None]] = []
        # what was computed last, by label, and for what; `ready` and `row` say whether it is still valid
        self._results: dict[str, tuple[Machine, Controller, Strategy]] = {}
        self._rows: dict[str, Row] = {}
        self._at_equal_time: dict[str, tuple[Machine, Controller, str, EqualTime]] = {}
        self._direct: tuple[Machine, Run | None] | None = None
        self._reference: tuple[Reference, Strategy] | None = None
        self._duty_k_dyn: dict[str, tuple[tuple[Machine, Controller, DutyPlan], float]] = {}
        self._duty: tuple[tuple[Machine, Controller, DutyPlan], DutyResult] | None = None
        if project.machines:
            self.open(project)
            self._past = []

    # the state -----------------------------------------------------------------------------------------

    @property
    def added(self) -> tuple[str, ...]:
        """Labels of the strategies that were added: those that may be removed."""
        return tuple(label for label in self.inputs.controllers if label not in self._initial)

    @property
    def changed(self) -> tuple[str, ...]:
        """Labels of the strategies with a parameter that is not the default."""
        now = self.inputs.controllers
        return tuple(label for label, first in self._initial.items() if now.get(label, first) != first)

    @property
    def steps(self) -> tuple[int, int]:
        """How many steps can be undone, and redone."""
        return len(self._past), len(self._future)

    def on_change(self, callback: Callable[[], None]) -> None:
        """Call `callback()` after each change, until `close`."""
        self._listeners.append(callback)

    # changes -------------------------------------------------------------------------------------------

    def set(self, path: str, value: str | float | None, gesture: str = "") -> None:
        """Change one parameter, `shaft.gap`, `gap` or `strategy.time`, to an SI number or a text with a unit.

        None removes a value that is optional, as a limit. Changes of one gesture are one step.

        >>> session = Session()
        >>> session.set("gap", "4 metres")
        Traceback (most recent call last):
        softstart.errors.InputError: gap = "4 metres": metres is a length, not an angle; ...
        >>> session.inputs.machine.gap
        0.5
        """
        if path == NAME:
            self.rename(self.inputs.selected, str(value or ""))
        elif path.startswith(STRATEGY):
            self.set_parameter(path.removeprefix(STRATEGY), value, gesture)
        elif path.startswith(PATH):
            self.set_duty(self.inputs.plan.changed(path, value), gesture)
        elif value is None:
            self._change(machine=startable(without(self.inputs.machine, path)))
        else:
            self.set_all({path: value}, gesture)

    def set_all(self, changes: Mapping[str, str | float], gesture: str = "") -> None:
        """Change several parameters of the machine in one step, or none of them."""
        settings = {
            path: value if isinstance(value, str) else repr(float(value)) for path, value in changes.items()
        }
        machine, duty = startable(with_typed_changes(self.inputs.machine, settings)), self.inputs.duty
        if duty is not None and any(path.startswith("gear") for path in settings):
            duty = duty.through(machine.gear)
        self._change(gesture, machine=machine, duty=duty)
        if texts := {path: text for path, text in changes.items() if isinstance(text, str)}:
            values = self.inputs.machine.parameters_by_path()
            self.typed |= {(path, values[path][1]): text for path, text in texts.items() if path in values}

    def move(self, gap: float, load_inertia: float) -> None:
        """Go to another place of the map: gap in rad, of a chain all gaps together, and inertia in kg m2."""
        inputs = self.inputs
        self._change(machine=inputs.machine.with_gap_and_inertia(gap, load_inertia, inputs.origin))

    def set_parameter(self, name: str, value: str | float | None, gesture: str = "") -> None:
        """Change one parameter of the selected strategy; None restores its default.

        >>> session = Session()
        >>> session.select("ramp")
        >>> session.set_parameter("time", "200 ms")
        >>> session.inputs.controllers["ramp"].time, session.changed
        (0.2, ('ramp',))
        """
        controllers, label = self.inputs.controllers, self.inputs.selected
        controller = changed_controller(controllers[label], {name: value})
        self._change(gesture, controllers={**controllers, label: controller})

    def show_at(self, output: bool) -> None:
        """See values at the output of the gear, or at the motor shaft; InputError without a gear.

        >>> session = Session()
        >>> session.show_at(True)
        Traceback (most recent call last):
        softstart.errors.InputError: units = "at output": without gear.ratio nothing ...
        >>> session.set("gear.ratio", 38.0)
        >>> session.show_at(True)
        >>> session.inputs.units.text
        'rad, rpm, at output'
        """
        self.set("units", seen_from(self.inputs.machine.units, output))

    def set_duty(self, plan: DutyPlan, gesture: str = "") -> None:
        """Another duty; also one whose steps cannot follow one another, which `duty_result` says.

        >>> session = Session("conveyor-11kw")
        >>> session.set_duty(session.inputs.plan.moved(0, 2))
        >>> session.duty_result().trouble
        'Step 2, stop: the machine stands; a step "start" must come before it.'
        """
        if plan != self.inputs.plan:
            self._change(gesture, duty=plan)

    def load(self, machine: Machine) -> None:
        """Another drive or chain, without the optima and gains that were computed for this one.

        A project keeps its machines and strategies as they are now, and the other machine is the one chosen.
        """
        from softstart.page.project import project_of  # which reads sessions

        project = self.inputs.project
        if project.machines:
            kept = project_of(self).given()
            project = Project(
                **{key: kept[key] for key in kept if key not in ("machine", "beside", "strategy")}
            )
        stiff, duty = plan_of(startable(machine))
        inputs = self.inputs
        controllers = {
            label: controller for label, controller in inputs.controllers.items() if label in self._initial
        } or self._initial
        self._change(
            machine=stiff,
            origin=stiff,
            controllers=controllers,
            selected=inputs.selected if inputs.selected in controllers else _first_selected(controllers),
            visible=inputs.visible.intersection(controllers),
            duty=duty,
            project=project,
            optima={},
        )
        self._offered = self.inputs.selected

    def open(self, project: Project) -> None:
        """Another project: its machine, strategies and choice; one step that can be undone."""
        present = self.inputs.machine_with_duty
        stiff, duty = plan_of(startable(project.single() if project.machines else present))
        own = {one.name: one.controller for one in project.players}
        if len(self._initial | own) > MAX_STRATEGIES:
            raise InputError(
                f"project: it has {len(own)} strategies; the page shows {MAX_STRATEGIES} in all."
            )
        controllers = self._initial | own
        chosen = project.strategy
        selected = chosen if chosen in controllers else _first_selected(controllers)
        self._change(
            machine=stiff, origin=stiff, controllers=controllers, selected=selected,
            visible=frozenset((selected, *own)) | (self.inputs.visible & controllers.keys()), duty=duty,
            project=project, optima={},
        )  # fmt: skip

    def describe(self, key: str, text: str) -> None:
        """Another name in the heading of the project, as `customer`, or other notes.

        >>> session = Session()
        >>> session.describe("customer", "Harbour Cranes Ltd")
        >>> session.inputs.project.customer
        'Harbour Cranes Ltd'
        """
        project, text = self.inputs.project, text.strip()
        if text != getattr(project, key).strip():
            others = {name: value for name, value in project.given().items() if name != key}
            self._change(f"describe {key}", project=Project(**others | ({key: text} if text else {})))

    def restore(self, inputs: Inputs) -> None:
        """Begin with earlier inputs, or with those of somebody else; nothing can be undone then."""
        self._past, self._future = [], []
        self._go_to(inputs)

    def undo(self) -> None:
        """Take the last change back; nothing happens if there is none."""
        if self._past:
            self._future.append(self.inputs)
            self._go_to(self._past.pop())

    def redo(self) -> None:
        """Make the change that was taken back last; nothing happens if there is none."""
        if self._future:
            self._past.append(self.inputs)
            self._go_to(self._future.pop())

    def add(
        self,
        label: str,
        controller: Controller,
        *,
        select: bool = True,
        optimum: ClaimedOptimum | None = None,
    ) -> str:
        """Add a controller (tuned gains, the profile of an `optimum` with its claims) to the strategies.

        A label that exists already is replaced. Returns the label in the table.
        """
        inputs = self.inputs
        label = " ".join(label.split())[:LONGEST_LABEL] or controller.name or type(controller).__name__
        if label not in inputs.controllers and len(inputs.controllers) >= MAX_STRATEGIES:
            raise InputError(
                f'strategy "{label}": there are {MAX_STRATEGIES} strategies already; remove one first.'
            )
        self._change(
            controllers={**inputs.controllers, label: controller},
            visible=inputs.visible | {label},
            selected=label if select else inputs.selected,
            project=inputs.project.without(label),
            optima=_without(inputs.optima, label) | ({} if optimum is None else {label: optimum}),
        )
        return label

    def remove(self, label: str) -> None:
        """Take a strategy out of the table; the last one stays."""
        self._check_label(label)
        inputs = self.inputs
        others = _without(inputs.controllers, label)
        if not others:
            raise InputError(f'strategy "{label}": this is the last strategy; add another one first.')
        selected = next(iter(others)) if inputs.selected == label else inputs.selected
        project = inputs.project.without(label)
        self._change(
            controllers=others, visible=inputs.visible - {label}, selected=selected, project=project,
            optima=_without(inputs.optima, label),
        )  # fmt: skip

    def rename(self, label: str, name: str) -> None:
        """Call an added strategy by another name, at its place in the table.

        >>> session = Session(controllers=["direct"])
        >>> _ = session.add("mine", make_controller("ramp"))
        >>> session.rename("mine", "slow ramp")
        >>> session.inputs.selected, list(session.inputs.controllers)
        ('slow ramp', ['direct', 'slow ramp'])
        >>> session.rename("slow ramp", "s-curve")
        Traceback (most recent call last):
        softstart.errors.InputError: name = "s-curve": there is a strategy of this name already; ...
        """
        self._check_label(label)
        inputs, name = self.inputs, " ".join(name.split())[:LONGEST_LABEL]
        if name == label:
            return
        if label in self._initial:
            raise InputError(f'strategy "{label}": it is one of softstart and keeps its name.')
        if not name or name in (*inputs.controllers, *controller_names()):
            reason = "there is a strategy of this name already" if name else "the field is empty"
            raise InputError(f'name = "{name}": {reason}; write another name, as slow ramp.')
        controller = renamed(inputs.controllers[label], name)

        def by_name(things: Mapping[str, Any]) -> dict[str, Any]:
            return {name if one == label else one: thing for one, thing in things.items()}

        self._change(
            controllers=by_name(inputs.controllers) | {name: controller},
            visible=frozenset(by_name(dict.fromkeys(inputs.visible))),
            selected=name if inputs.selected == label else inputs.selected,
            project=inputs.project.renamed(label, name),
            optima=by_name(inputs.optima),
        )

    def select(self, label: str) -> None:
        """Make a strategy the one with the large figure; it is drawn from then on."""
        self._check_label(label)
        if label != self.inputs.selected or label not in self.inputs.visible:
            self._change(selected=label, visible=self.inputs.visible | {label})

    def show(self, label: str, visible: bool = True) -> None:
        """Draw a strategy or hide it."""
        self._check_label(label)
        if visible != (label in self.inputs.visible):
            self._change(visible=self.inputs.visible ^ {label})

    def set_reference(self, on: bool = True) -> None:
        """Compare with the selected strategy on the machine as both are now; with nothing if not `on`.

        >>> session = Session()
        >>> session.select("direct")
        >>> session.set_reference()
        >>> session.set("gap", 1.0)
        >>> session.reference().k_dyn < session.result("direct").k_dyn
        True
        """
        label = self.inputs.selected
        new = Reference(self.inputs.machine, label, self.inputs.controllers[label]) if on else None
        if new is not None and (result := self.ready(label)) is not None:
            self._reference = new, result
        if new is not self.inputs.reference:
            self._change(reference=new)

    def set_at_time(self, text: str) -> None:
        """Set each strategy of the table for this time, "1.3x" of that of direct or "0.3 s"; "" as they are.

        >>> session = Session(controllers=["direct", "s-curve"])
        >>> session.set_at_time("1.3x")
        >>> list(session.compute_at_equal_time("s-curve"))
        [None]
        >>> session.at_equal_time("s-curve").row.set_to
        'time 0.134 s'
        """
        text = " ".join(text.split())
        if text == self.inputs.at_time:
            return
        if len(text) > LONGEST_TIME:
            raise InputError(f"equal time: the text has more than {LONGEST_TIME} characters; write 1.3x.")
        if text:
            self._equal_time(text)
        self._change(at_time=text)

    def offer(self, label: str = "") -> None:
        """Select this strategy until the user selects another one.

        Without a label the recommended one; without limits, or where none keeps them, that with the lowest
        K_dyn of those that settle in good time.
        """
        if not label and self.inputs.machine.limits:
            label = row.name if (row := self.recommendation().recommended) else ""
        self.select(label or self._lowest_k_dyn())
        self._offered = self.inputs.selected

    def follow(self, recommendation: Recommendation) -> None:
        """Select what is recommended, once for a machine and its limits; not over the user's own choice."""
        now, row = self.inputs, recommendation.recommended
        if row is None or self._followed == (key := (now.origin, now.machine.limits)):
            return
        self._followed = key
        if now.selected == self._offered != row.name:
            self._offered = row.name
            self._go_to(replace(now, selected=row.name, visible=now.visible | {row.name}))

    def _lowest_k_dyn(self) -> str:
        latest = SLOW * (math.inf if (direct := self.direct()) is None else direct.settled_time)
        timely = [strategy for strategy in self.strategies if strategy.settled_time <= latest]
        return min(timely, key=lambda one: one.k_dyn).name if timely else self.inputs.selected

    # results -------------------------------------------------------------------------------------------

    @property
    def strategies(self) -> list[Strategy]:
        """All strategies on the machine as it is now, in the order of the table."""
        return [self.result(label) for label in self.inputs.controllers]

    def ready(self, label: str) -> Strategy | None:
        """The result of a strategy if it is computed already."""
        machine, controller, result = self._results.get(label, (None, None, None))
        valid = machine is self.inputs.machine and controller is self.inputs.controllers.get(label)
        return result if valid else None

    def row(self, label: str) -> Row | None:
        """The row of a strategy in a comparison, if it is computed already, see `compute_row`."""
        row, result = self._rows.get(label), self.ready(label)
        return row if row is not None and result is not None and row.run is result.run else None

    def result(self, label: str, max_events: int = MAX_EVENTS) -> Strategy:
        """A strategy on the machine as it is now. What goes wrong in its start becomes its sentence.

        A start that has more than `max_events` events is given up, and is not kept as the result.
        """
        self._check_label(label)
        if (known := self.ready(label)) is not None:
            return known
        machine, controller = self.inputs.machine, self.inputs.controllers[label]
        own = label not in self._initial and label not in self.inputs.claimed
        result = _started(label, machine, controller, max_events, whole=own)
        if not result.given_up or max_events >= MAX_EVENTS:
            self._results[label] = machine, controller, result
        return result

    def reference(self) -> Strategy | None:
        """The start that all are compared with, on its own machine; None without a reference."""
        reference = self.inputs.reference
        if reference is None:
            return None
        if self._reference is None or self._reference[0] is not reference:
            start = _started(reference.label, reference.machine, reference.controller, MAX_EVENTS)
            self._reference = reference, start
        return self._reference[1]

    def duty_result(self, seconds: float = LONGEST_DUTY) -> DutyResult:
        """The duty under the selected strategy. What goes wrong in it becomes its sentence.

        One that takes longer is given up, and is not kept as the result.
        """
        key = self._duty_key(self.inputs.selected)
        if self._duty is None or self._duty[0] != key:
            result = _in_duty(*key, seconds)
            if result.given_up and seconds < LONGEST_DUTY:
                return result
            self._duty = key, result
        return self._duty[1]

    def duty_k_dyn(self, label: str) -> float | None:
        """K_dyn of the duty under a strategy, if it is computed; NaN where it cannot be carried out."""
        key, k_dyn = self._duty_k_dyn.get(label, (None, None))
        return k_dyn if key == self._duty_key(label) else None

    def compute_duty(self, label: str) -> None:
        """Compute the duty under a strategy, and keep its K_dyn alone."""
        if self.duty_k_dyn(label) is None:
            key = self._duty_key(label)
            run = (self.duty_result() if label == self.inputs.selected else _in_duty(*key, OTHER_DUTY)).run
            self._duty_k_dyn[label] = key, math.nan if run is None else run.k_dyn

    def _duty_key(self, label: str) -> tuple[Machine, Controller, DutyPlan]:
        return self.inputs.machine, self.inputs.controllers[label], self.inputs.plan

    def compute_row(self, label: str) -> Iterator[None]:
        """Compute the row of a strategy in a comparison, step by step; there is none if its start fails."""
        run = self.result(label).run
        if run is None or self.row(label) is not None:
            return
        cases, soft = dict[str, Case](), self.inputs.soft_drive
        for case in (*CASES, *([SOFT_END] if soft else [])):
            yield None
            controller, end = self.inputs.controllers[label], soft if case == SOFT_END else None
            try:
                cases[case] = changed_case(self.inputs.machine, controller, case, soft=end)
            except Exception as error:  # a controller is anyone's code; there is no room for the sentence
                sentence_of(error)  # which is logged
                cases[case] = Case.of(None)
        self._rows[label] = Row(run, self.direct(), cases, tuple(cases), label)
        _ = run.settled_time, self._rows[label].flags  # computed here, kept in the runs

    def at_equal_time(self, label: str) -> EqualTime | None:
        """A strategy set for the time of the inputs, if it is computed, see `compute_at_equal_time`."""
        machine, controller, at_time, known = self._at_equal_time.get(label, (None, None, "", None))
        inputs = self.inputs
        same = machine is inputs.machine and controller is inputs.controllers.get(label)
        return known if same and at_time == inputs.at_time else None

    def compute_at_equal_time(self, label: str) -> Iterator[None]:
        """Set a strategy for the time of the inputs, as `compare` does; not where there is none."""
        inputs, run = self.inputs, self.result(label).run
        if not inputs.at_time or run is None or self.at_equal_time(label) is not None:
            return
        yield None
        machine, controller = inputs.machine, inputs.controllers[label]
        try:
            at, direct = self._equal_time(inputs.at_time)
            if run.trajectory.events.size > MAX_EVENTS_SET:
                raise InputError(f"{label}: its starts have too many events to set it for equal time here.")
            start = partial(compared, machine, direct=direct, soft=inputs.soft_drive)
            found = row_at_time(machine, controller, direct, at, None, start)
            if isinstance(found, TooSlow):
                result = EqualTime(None, "too slow", found._replace(name=label).within(at))
            else:
                result = EqualTime(replace(found, label=label))
        except Exception as error:  # a controller is anyone's code
            result = EqualTime(None, "", sentence_of(error))
        self._at_equal_time[label] = machine, controller, inputs.at_time, result

    def lowest_at_equal_time(self) -> str:
        """The lowest K_dyn of each class of effort at equal time; "" where none is computed."""
        known = [self.at_equal_time(label) for label in self.inputs.controllers]
        rows = tuple(one.row for one in known if one is not None and one.row is not None)
        if not rows:
            return ""
        at, _ = self._equal_time(self.inputs.at_time)
        return Comparison(self.inputs.machine, rows, at_time=at).at_equal_time

    def _equal_time(self, text: str) -> tuple[float, Run]:
        """The time in s, and the direct start of which it is a multiple."""
        direct = self.direct()
        if direct is None or math.isnan(direct.settled_time):
            raise InputError("equal time: direct does not settle on this machine; it sets the time scale.")
        if not (at := equal_time(text, direct)) <= MAX_AT_TIME * direct.settled_time:
            raise InputError(f'equal time = "{text}": give at most {MAX_AT_TIME:g}x.')
        return at, direct

    def recommendation(self) -> Recommendation:
        """What is recommended among the strategies, and why: the text of `softstart.compare`."""
        for label in self.inputs.controllers:
            list(self.compute_row(label))
        rows = [row for label in self.inputs.controllers if (row := self.row(label)) is not None]
        return recommend(self.inputs.machine, rows)

    def direct(self) -> Run | None:
        """The direct start, with which the others are compared; None where it fails."""
        machine = self.inputs.machine
        if self._direct is None or self._direct[0] is not machine:
            known = self.ready(REFERENCE) if REFERENCE not in self.changed else None
            run = known.run if known is not None else None
            try:
                run = run or simulate(machine, REFERENCE, max_events=MAX_EVENTS)
            except (InputError, SimulationError):
                run = None
            self._direct = machine, run
        return self._direct[1]

    def close(self) -> None:
        """Release all results and listeners: the user has gone."""
        for kept in (
            self._listeners, self._results, self._rows, self._at_equal_time, self._past, self._future,
            self._duty_k_dyn,
        ):  # fmt: skip
            kept.clear()
        self._reference = self._duty = None

    # ---------------------------------------------------------------------------------------------------

    def _change(self, gesture: str = "", **changes: Any) -> None:
        """Change the inputs; changes of one gesture that follow one another quickly are one step."""
        now = time.monotonic()
        last, when = self._gesture
        if not gesture or gesture != last or now - when > PAUSE or not self._past:
            self._past = [*self._past[1 - MAX_UNDO :], self.inputs]
        self._future = []
        self._go_to(_without_settled(replace(self.inputs, **changes)), (gesture, now))

    def _go_to(self, inputs: Inputs, gesture: tuple[str, float] = ("", -math.inf)) -> None:
        self.inputs, self._gesture = inputs, gesture
        self.version += 1
        for listener in tuple(self._listeners):
            listener()

    def _check_label(self, label: str) -> None:
        labels = list(self.inputs.controllers)
        if label not in labels:
            near = nearest(label, labels)
            hint = f"did you mean {near}?" if near else f"there are {', '.join(labels)}."
            raise InputError(f'strategy "{cut(label)}": there is no strategy of this name; {hint}')


def _without(things: Mapping[str, Any], label: str) -> dict[str, Any]:
    return {name: thing for name, thing in things.items() if name != label}


def _without_settled(inputs: Inputs) -> Inputs:
    """The inputs without assumptions about values that have been set since the drive was loaded."""
    drive, origin = inputs.machine, inputs.origin
    if not (isinstance(drive, Drive) and isinstance(origin, Drive)):
        return inputs
    # compared with the loaded drive, so that a slider that goes back to its place brings them back too
    if origin.soft_stiffness is not None and drive.stiffness == origin.stiffness:
        drive = drive.replace(soft_stiffness=origin.soft_stiffness)
    values, loaded = drive.given(), origin.given()
    assumed = still_assumed(origin, [name for name in values if values[name] != loaded.get(name)])
    if origin.assumed and assumed != drive.assumed:
        drive = drive.replace(assumed=assumed)
    return inputs if drive == inputs.machine else replace(inputs, machine=drive)


def _first_selected(labels: Iterable[str]) -> str:
    """The strategy that is selected first."""
    return REFERENCE if REFERENCE in labels else next(iter(labels), REFERENCE)


def _started(
    label: str, machine: Machine, controller: Controller, max_events: int, whole: bool = False
) -> Strategy:
    """A start; if `whole`, one that ends before its profile does is refused."""
    began = time.thread_time()
    try:
        run, trouble, given_up = simulate(machine, controller, max_events=max_events), "", False
        if whole:
            refuse_longer(run, f'strategy "{label}"')
    except Exception as error:  # a controller is anyone's code and may fail in any way
        trouble = sentence_of(error, FAILED_START, field_labels(machine))
        run, given_up = None, isinstance(error, SimulationError)
    return Strategy(label, run, trouble, time.thread_time() - began, given_up)


def _in_duty(machine: Machine, controller: Controller, plan: DutyPlan, seconds: float) -> DutyResult:
    latest = time.thread_time() + seconds  # processes beside it must not change what is shown

    def watch(step: StepRun) -> None:
        if time.thread_time() > latest:
            raise TimeoutError

    try:
        return DutyResult(run_duty(machine, controller, plan.duty, stop=plan.stop or None, progress=watch))
    except TimeoutError:
        return DutyResult(None, TOO_LONG_DUTY, given_up=True)
    except Exception as error:  # a controller is anyone's code and may fail in any way
        return DutyResult(None, sentence_of(error, FAILED_START, field_labels(machine)))
