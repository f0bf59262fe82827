"""The state of one user: a drive, the strategies that start it, and what came out. No NiceGUI here.

Everything happens in the thread of the page's event loop; a session belongs to one client.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from softstart.controller.finding import make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.page.sentences import FAILED_START, clipped, sentence_of
from softstart.quantities import nearest
from softstart.start.comparison import DEFAULT_DRIVE, REFERENCE, k_dyn_worn_gap
from softstart.start.simulation import simulate
from softstart.views.starts import outcome

if TYPE_CHECKING:
    from softstart.controller.base import Controller
    from softstart.start.run import Run

MAX_STRATEGIES = 24
MOST_EVENTS = 200_000  # of one start on the page, some tenths of a second; the command line allows a million


@dataclass(frozen=True, eq=False)
class Strategy:
    """One strategy on the drive of the moment: its start, or the sentence that says why there is none.

    `cost` is the processor time that it took to compute, in s.
    """

    name: str
    run: Run | None
    trouble: str = ""
    cost: float = 0.0

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


class Session:
    """The drive and the strategies of one user; a refused change raises InputError and changes nothing.

    Results are computed when they are asked for and kept until the drive changes.

    >>> session = Session()
    >>> round(session.result("direct").k_dyn, 3)
    3.118
    >>> session.set("shaft.gap", "2 rad")
    >>> round(session.result("direct").k_dyn, 3), session.version
    (4.865, 1)
    """

    def __init__(self, drive: Drive | str = DEFAULT_DRIVE, controllers: Iterable[str] | None = None) -> None:
        self._drive = _single(Drive.load(drive) if isinstance(drive, str) else drive)
        self._origin = self._drive
        names = list(ready_controller_names() if controllers is None else controllers)
        self._controllers: dict[str, Controller] = {name: make_controller(name) for name in names}
        self._first = frozenset(names)
        self._selected = REFERENCE if REFERENCE in names or not names else names[0]
        self._shown = {self._selected}
        self._version = 0
        self._listeners: list[Callable[[], None]] = []
        self._results: dict[str, Strategy] = {}
        self._worn: dict[str, float] = {}
        self._reference: float | None = None

    # the state -----------------------------------------------------------------------------------------

    @property
    def drive(self) -> Drive:
        """The drive as it is now."""
        return self._drive

    @property
    def origin(self) -> Drive:
        """The drive as it was loaded: ranges of sliders and maps are about it."""
        return self._origin

    @property
    def controllers(self) -> Mapping[str, Controller]:
        """All strategies of the table: controllers by label, shown or not."""
        return dict(self._controllers)

    @property
    def shown(self) -> tuple[str, ...]:
        """Labels of the strategies that are drawn, in the order of the table; the selected one always is."""
        return tuple(label for label in self._controllers if label in {*self._shown, self._selected})

    @property
    def added(self) -> tuple[str, ...]:
        """Labels of the strategies that have joined: those that may be taken out again."""
        return tuple(label for label in self._controllers if label not in self._first)

    @property
    def selected(self) -> str:
        """Label of the strategy whose figure stands large and whose map is drawn."""
        return self._selected

    @property
    def version(self) -> int:
        """How often anything was changed."""
        return self._version

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback()` after each change; returns a function that ends this."""
        self._listeners.append(callback)

        def stop() -> None:
            if callback in self._listeners:
                self._listeners.remove(callback)

        return stop

    # changes -------------------------------------------------------------------------------------------

    def set(self, path: str, value: str | float) -> None:
        """Change one parameter, `shaft.gap` or `gap`, to an SI number or a text with a unit.

        >>> session = Session()
        >>> session.set("gap", "4 metres")
        Traceback (most recent call last):
        softstart.errors.InputError: gap = "4 metres": metres is a length, not an angle; ...
        >>> session.drive.gap
        0.5
        """
        self.set_all({path: value})

    def set_all(self, changes: Mapping[str, str | float]) -> None:
        """Change several parameters in one step, or none of them."""
        settings = [f"{path}={value if isinstance(value, str) else repr(float(value))}"
                    for path, value in changes.items()]  # fmt: skip
        self._take(_single(self._drive.with_settings(settings)))

    def load(self, text: str, where: str = "") -> None:
        """Take the drive of a TOML text; `where` is put before each sentence of an InputError."""
        self.take(Drive.from_toml(text, where=where))

    def take(self, drive: Drive) -> None:
        """Go over to another drive."""
        drive = _single(drive)
        self._origin = drive
        self._take(drive)

    def add(self, label: str, controller: Controller, *, select: bool = True) -> str:
        """Let a controller (tuned gains, the profile of an optimum) join the strategies.

        A label that is there already is replaced. Returns the label under which it stands.
        """
        label = " ".join(label.split())[:60] or controller.name or type(controller).__name__
        if label not in self._controllers and len(self._controllers) >= MAX_STRATEGIES:
            raise InputError(
                f'strategy "{label}": there are {MAX_STRATEGIES} strategies already; remove one first.'
            )
        self._controllers[label] = controller
        self._shown.add(label)
        self._forget([label])
        if select:
            self._selected = label
        self._changed()
        return label

    def remove(self, label: str) -> None:
        """Take a strategy out of the table; the last one stays."""
        self._known(label)
        if len(self._controllers) == 1:
            raise InputError(f'strategy "{label}": this is the last strategy; add another one first.')
        del self._controllers[label]
        self._shown.discard(label)
        self._forget([label])
        if self._selected == label:
            self._selected = next(iter(self._controllers))
        self._changed()

    def select(self, label: str) -> None:
        """Make a strategy the one whose figure stands large; it is shown from then on."""
        self._known(label)
        if label != self._selected or label not in self._shown:
            self._selected = label
            self._shown.add(label)
            self._changed()

    def show(self, label: str, visible: bool = True) -> None:
        """Draw a strategy or hide it."""
        self._known(label)
        if visible != (label in self._shown):
            (self._shown.add if visible else self._shown.discard)(label)
            self._changed()

    def show_gentlest(self) -> None:
        """Draw the strategy with the least K_dyn among those that reach the target speed."""
        reaching = [found for found in self.strategies if not math.isnan(found.start_time)]
        if reaching:
            self.show(min(reaching, key=lambda found: found.k_dyn).name)

    # what came out -------------------------------------------------------------------------------------

    @property
    def strategies(self) -> list[Strategy]:
        """All strategies on the drive as it is now, in the order of the table."""
        return [self.result(label) for label in self._controllers]

    def ready(self, label: str) -> Strategy | None:
        """The result of a strategy if it is computed already."""
        return self._results.get(label)

    def result(self, label: str, max_events: int = MOST_EVENTS) -> Strategy:
        """A strategy on the drive as it is now. What goes wrong in its start becomes its sentence.

        A start that has more than `max_events` events is given up, and is not kept as the result.
        """
        known = self._results.get(label)
        if known is not None:
            return known
        self._known(label)
        began = time.thread_time()
        try:
            run = simulate(self._drive, self._controllers[label], max_events=max_events)
        except Exception as error:  # a controller is anyone's code and may fail in any way
            found = Strategy(label, None, sentence_of(error, FAILED_START), time.thread_time() - began)
            if isinstance(error, SimulationError) and max_events < MOST_EVENTS:
                return found
        else:
            found = Strategy(label, run, "", time.thread_time() - began)
        self._results[label] = found
        return found

    def worn(self, label: str) -> float:
        """K_dyn of a strategy, set up for this drive, when the gap is 4 times as wide; NaN where it fails.

        The same figure, with the same cap on events, as `k_dyn_worn_gap` of `softstart.compare`.
        """
        if label not in self._worn:
            self._known(label)
            try:
                self._worn[label] = k_dyn_worn_gap(self._drive, self._controllers[label])
            except Exception as error:  # a controller is anyone's code; there is no room for the sentence
                sentence_of(error)  # which is logged
                self._worn[label] = math.nan
        return self._worn[label]

    def worn_ready(self, label: str) -> float | None:
        """`worn` if it is computed already."""
        return self._worn.get(label)

    def time_lost(self, label: str) -> float:
        """Start time over that of `direct`, s; NaN where one of them is."""
        if self._reference is None:
            try:
                known = self._results.get(REFERENCE)
                run = known.run if known is not None and known.run is not None else None
                self._reference = (run or simulate(self._drive, REFERENCE, max_events=MOST_EVENTS)).start_time
            except (InputError, SimulationError):
                self._reference = math.nan
        return self.result(label).start_time - self._reference

    def close(self) -> None:
        """Let go of all results and listeners: the user has gone."""
        self._listeners.clear()
        self._forget(list(self._controllers))

    # ---------------------------------------------------------------------------------------------------

    def _take(self, drive: Drive) -> None:
        self._drive = drive
        self._forget(self._controllers)
        self._reference = None
        self._changed()

    def _forget(self, labels: Iterable[str]) -> None:
        for label in labels:
            self._results.pop(label, None)
            self._worn.pop(label, None)

    def _changed(self) -> None:
        self._version += 1
        for listener in tuple(self._listeners):
            listener()

    def _known(self, label: str) -> None:
        if label not in self._controllers:
            near = nearest(label, list(self._controllers))
            hint = f"did you mean {near}?" if near else f"there are {', '.join(self._controllers)}."
            raise InputError(f'strategy "{clipped(label)}": there is no strategy of this name; {hint}')


def _single(drive: Drive) -> Drive:
    if drive.shape != ():
        count = math.prod(drive.shape)
        raise InputError(
            f"{drive.name}: lists of values make {count} drives, and the page starts one; "
            "give one value a key."
        )
    return drive
