"""What the page computes in the background: optimal start, curve of the least K_dyn, tuning, report.

Each function runs in a process of its own (`softstart.page.jobs`), says how far it is through `progress`, and
gives back plain data.
"""

from __future__ import annotations

import math
import os
import re
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.chain.machines import Machine
from softstart.chain.model import Chain
from softstart.controller.finding import make_controller, ready_controller_names
from softstart.drive import UNKNOWN_POSITIONS, Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import best_start
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.page.downloads import text_of
from softstart.page.machines import changed
from softstart.page.sentences import clipped
from softstart.parallel import Progress
from softstart.quantities import Units, show
from softstart.start.comparison import compare
from softstart.start.fatigue import fatigue
from softstart.start.recommendation import recommend
from softstart.start.simulation import simulate
from softstart.tuning.solving import tune
from softstart.views.numbers import digits, fixed, unit, units_of

if TYPE_CHECKING:
    from softstart import reporting
    from softstart.controller.base import Controller
    from softstart.identification import logs
    from softstart.identification import solving as fits
    from softstart.identification.logs import TorqueIs
    from softstart.optimal import front
    from softstart.optimal import optimize as solving
    from softstart.optimal.front import FrontPoint
    from softstart.optimal.problem import Terminal
    from softstart.optimal.result import Optimum
    from softstart.profile import TorqueProfile
    from softstart.start.recommendation import Row
    from softstart.tuning.outcome import Tuning
    from softstart.views import fatigue as lives
    from softstart.views import identification as shown
    from softstart.views import optima
else:  # they import scipy.optimize; in the server the first page would wait for that
    reporting, front = late("softstart.reporting"), late("softstart.optimal.front")
    logs, fits = late("softstart.identification.logs"), late("softstart.identification.solving")
    shown, optima = late("softstart.views.identification"), late("softstart.views.optima")
    lives = late("softstart.views.fatigue")
    solving = late("softstart.optimal.optimize")

TUNING_SHARES = {
    "starts": (0.0, 0.05),
    "schedule": (0.05, 0.45),
    "robust": (0.45, 0.8),
    "certified": (0.8, 1.0),
}
INTERVAL = 0.1  # s between two reports of a task that would report thousands of times


@dataclass(frozen=True)
class Gentlest:
    """An optimal start, what its bound covers, and the files of its profile by suffix."""

    best: Optimum
    bound: str
    files: dict[str, str]


def gentlest(drive: Machine, start_time: str, terminal: Terminal, *, progress: Progress) -> Gentlest:
    """The gentlest start within a time, as `0.3`, `300 ms` or `1.2x` (of that of `direct`)."""
    progress(None, "looking for the gentlest start")
    with no_solution_as_sentence():
        best = solving.optimize(drive, start_time, terminal=terminal)
    progress(None, "writing the profile")
    about = {"drive": drive.name, "start_time": best.end_time, "terminal": terminal, "k_dyn": best.k_dyn}
    profile = best.profile
    files = {
        ".csv": text_of(profile.to_csv, ".csv"),
        ".toml": text_of(lambda path: profile.to_toml(path, about), ".toml"),
        ".c": text_of(lambda path: profile.to_c(path, about=about), ".c"),
    }
    return Gentlest(best, optima.bound_sentence(best), files)


def player_of(best: Optimum) -> Controller:
    """The controller that plays the optimum, under the name that it has among the strategies."""
    player = make_controller("profile", {"profile": best.profile})
    object.__setattr__(player, "name", label_of(best))  # as `softstart.controller.tuned` names tuned gains
    return player


def label_of(best: Optimum) -> str:
    """What the optimum is called among the strategies."""
    ending = "" if best.problem.terminal == "reached" else f", {best.problem.terminal}"
    return f"{best_start(best.problem.drive)} {best.end_time:.4g} s{ending}"


def curve(
    drive: Machine, start_times: Sequence[float], terminal: Terminal = "reached", *, progress: Progress
) -> list[FrontPoint]:
    """The least K_dyn over the start time, also at those of the strategies, the long start times first.

    Each point is sent as a part as soon as it is known; the result is all of them in order of start time.
    """
    done = 0

    def each(point: FrontPoint) -> None:
        nonlocal done
        done += 1
        if point.found:
            progress.part(point)

    with no_solution_as_sentence():
        progress(0.0, "the shortest start time")
        usual = front.default_start_times(drive, terminal)
        times = sorted({*usual, *(one for one in start_times if math.isfinite(one))})

        def doing(what: str) -> None:
            progress(done / len(times), f"start in {what.rpartition(': ')[2].removesuffix(f', {terminal}')}")

        found = front.pareto(drive, times, terminal=terminal, controllers=[], progress=doing, each=each)
    return [point for point in found.points if point.found]


@contextmanager
def no_solution_as_sentence() -> Iterator[None]:
    """Turns "there is no solution" and "none was found" into a SimulationError with that sentence."""
    try:
        yield
    except (InfeasibleError, OptimumError) as error:
        raise SimulationError(str(error)) from error


@dataclass(frozen=True)
class Tuned:
    """What a tuning found, as plain data: `summary` of the Tuning, and its files by name."""

    summary: dict[str, Any]
    files: dict[str, str]
    seconds: float
    starts: int

    @property
    def controller(self) -> str:
        """Name of the controller that was tuned."""
        return str(self.summary["controller"])


def tuning(
    drive: Machine,
    controller: str,
    gaps: Sequence[Any] | None,
    inertias: Sequence[Any] | None,
    certified: bool = True,
    restarts: int = 3,
    *,
    progress: Progress,
) -> Tuned:
    """Gains of a controller for each gap and load inertia, and one set for all."""
    found = tune(
        drive, controller, gaps, inertias, certified=certified, restarts=restarts, workers=1,
        progress=_Throttled(progress),
    )  # fmt: skip
    progress(1.0, "writing the gains")
    return Tuned(found.summary(), _files(found), found.seconds, found.starts)


def _files(found: Tuning) -> dict[str, str]:
    return {
        "robust.toml": text_of(lambda path: found.to_toml(path, "robust"), ".toml"),
        "schedule.toml": text_of(lambda path: found.to_toml(path, "schedule"), ".toml"),
        "schedule.csv": text_of(found.to_csv, ".csv"),
    }


class _Throttled:
    """Reports the progress of a tuning at most ten times a second, with a share made of its parts."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self.title, self.last = "", -math.inf

    def __call__(self, doing: str) -> None:
        now = time.monotonic()
        title = doing.partition(",")[0]
        if title == self.title and now < self.last + INTERVAL:
            return
        self.title, self.last = title, now
        self.progress(tuning_share(doing), doing)


def tuning_share(doing: str) -> float | None:
    """How much of a tuning is done, from its message.

    >>> tuning_share("schedule, searches 2 of 4, 3,088 starts, 6,314/s"), tuning_share("something else")
    (0.25, None)
    """
    for begin, (low, high) in TUNING_SHARES.items():
        if doing.startswith(begin):
            counted = re.search(r"(search |\s)?(\d+) of (\d+)", doing)
            if counted is None:
                return low
            done = int(counted[2]) - (1 if counted[1] == "search " else 0)
            return low + (high - low) * done / int(counted[3])
    return None


@dataclass(frozen=True)
class Identified:
    """A drive from a log as plain data: the drive, the table of what was found, and the notes."""

    drive: Drive
    headings: list[str]
    rows: list[list[str]]
    notes: list[str]


def columns_of(text: str) -> dict[str, str]:
    """The columns of a log as typed, `torque=M, speed=n[rpm]`; InputError for what is none.

    >>> columns_of("torque=-M_act, speed=n[rpm]"), columns_of(" ")
    ({'torque': '-M_act', 'speed': 'n[rpm]'}, {})
    """
    pairs = [part.partition("=") for part in text.split(",") if part.strip()]
    if wrong := [key for key, equals, name in pairs if not (key.strip() and equals and name.strip())]:
        raise InputError(f"columns: {show(wrong[0].strip())}: write signal=name, as torque=M, speed=n[rpm].")
    return {key.strip(): name.strip() for key, _, name in pairs}


def identified(
    content: bytes,
    name: str,
    guess: Machine,
    torque_is: TorqueIs,
    columns: Mapping[str, str],
    *,
    progress: Progress,
) -> Identified:
    """The drive from the log in these bytes, with its intervals, from this guess.

    Of a chain with one dominant gap it is the two masses that stand for it.
    """
    progress(None, "reading the log")
    with tempfile.TemporaryDirectory(prefix="softstart-log-") as folder:
        path = Path(folder, "log.csv")
        path.write_bytes(content)
        try:
            rated = getattr(guess, "rated", None)  # not of a chain
            log = logs.Log.load(path, columns=columns, torque_is=torque_is, rated_torque=rated)
        except InputError as error:
            raise InputError([one.replace(str(path), name) for one in error.sentences]) from None
    found = fits.identify(log, guess, progress=lambda doing: progress(None, doing))
    table = shown.estimates_table(found)
    rows = [dict(zip([column.heading for column in table.columns], row, strict=True)) for row in table.rows]
    figures = ("found", "from", "to")  # the guess is in the fields of the page
    units = units_of(guess)
    cells = [[one["parameter"] + ("" if one["unit"] == "1" else f", {unit(units.of(one['unit']))}"),
              *(_seen(one[each], one["unit"], units) for each in figures)] for one in rows]  # fmt: skip
    return Identified(found.rounded().drive, ["parameter", *figures], cells, list(found.notes))


def _seen(text: str, si: str, units: Units) -> str:
    """A number of a table, as it is printed in SI, in the units of a user, with as many digits.

    >>> _seen("0.0698", "rad", Units("deg")), _seen("unknown", "rad", Units("deg"))
    ('4.00', 'unknown')
    """
    if units.of(si) == si or not re.fullmatch(r"[-+.e\d]+", text):
        return text
    return digits(units.shown(float(text), si), len(re.sub(r"e.*|^[-+0.]+|\.", "", text)) or 1)


def code(profile: TorqueProfile, about: Mapping[str, object], *, progress: Progress) -> str:
    """C code that plays a torque profile."""
    progress(None, "writing C code")
    return text_of(lambda path: profile.to_c(path, about=about), ".c")


@dataclass(frozen=True)
class Part:
    """One part of a check: a table, and sentences about it or about why there is none."""

    name: str
    title: str
    headings: list[str]
    rows: list[list[str]]
    sentences: list[str]


@dataclass(frozen=True)
class Checked:
    """What `checked` found: its parts, and the quickest start that keeps the limits if there are any."""

    parts: list[Part]
    quickest: Optimum | None


def checked(machine: Machine, controllers: Mapping[str, Controller], *, progress: Progress) -> Checked:
    """Strategies from each start position, margins to limits, life under them, and the quickest start."""
    rows = {}
    for done, (label, controller) in enumerate(controllers.items()):
        progress(0.3 * done / len(controllers), f"limits: {label}")
        with suppress(SimulationError):
            rows[label] = compare(machine, [controller]).rows[0]
    parts = [
        _positions(machine, controllers, progress),
        _margins(machine, rows),
        _life(machine, rows, progress),
    ]
    quickest = None
    if machine.limits and machine.limits.used_torque is None:  # those of single shafts bound no optimum
        progress(0.8, "the quickest start that keeps the limits")
        name, title = "quickest", "The quickest start within limits"
        try:
            with no_solution_as_sentence():
                quickest = solving.optimize(machine, limits=True)
        except (InputError, SimulationError) as error:
            parts.append(Part(name, title, [], [], [str(error)]))
        else:
            runs = [row.run for row in rows.values()]
            said = [optima.comparison(quickest, runs), optima.bound_sentence(quickest)]
            parts.append(Part(name, title, [], [], said))
    return Checked(parts, quickest)


def _positions(machine: Machine, controllers: Mapping[str, Controller], progress: Progress) -> Part:
    """K_dyn from each position at which a start may begin."""
    name, title = "positions", "K_dyn by start position"
    try:
        unknown = changed(machine, {"start.position": "unknown"})
    except InputError as error:
        return Part(name, title, [], [], [f"It starts from one position alone. {' '.join(error.sentences)}"])
    cells = []
    for done, (label, controller) in enumerate(controllers.items()):
        progress(0.3 + 0.3 * done / len(controllers), f"start positions: {label}")
        with suppress(SimulationError):
            run = simulate(unknown, controller)
            each = [one.k_dyn for one in run.positions.values()]
            cells.append([label, *(fixed(k, 3) for k in (*each, run.k_dyn))])
    if not cells or len(cells[0]) < 3:
        return Part(name, title, [], [], ["There is one position alone: no gap, or one that is wound up."])
    cells.sort(key=lambda row: float(row[-1]))
    return Part(
        name, title, ["strategy", *(one.replace("-", " ") for one in UNKNOWN_POSITIONS), "worst"], cells, []
    )


def _margins(machine: Machine, rows: Mapping[str, Row]) -> Part:
    """Which strategies keep the limits, with what margin."""
    name, title = "limits", "Limits"
    if not machine.limits:
        lacking = "neither [limits] nor a permissible_torque of its shafts"
        return Part(name, title, [], [], [f"{clipped(machine.name)} has {lacking}: nothing can be exceeded."])
    cells = [[label, row.against_limits] for label, row in rows.items()]
    return Part(name, title, ["strategy", "limits"], cells, [recommend(machine, rows.values()).text])


def _life(machine: Machine, rows: Mapping[str, Row], progress: Progress) -> Part:
    """The life of the shaft line beside that under direct, of a chain that of each shaft."""
    name, title = "life", "Life over that under direct"
    progress(0.65, "life of the shaft line")
    runs: Any = [row.run for row in rows.values()]
    try:
        found = fatigue(runs)
        shown = lives.fatigue_tables(found, found.ranked)[0]
        said = [lives.conclusion(found), *lives.notes(found)]
    except InputError as error:
        return Part(name, title, [], [], list(error.sentences))
    headings = [column.heading.replace("\n", " ") for column in shown.columns]
    return Part(name, title, headings, [list(row) for row in shown.rows], said)


def ready(machine: Chain, *, progress: Progress) -> Chain:
    """The chain, once all strategies have started it: what must be compiled for that is compiled then."""
    names = ready_controller_names()
    for done, name in enumerate(names):
        progress(done / len(names), f"starting it: {name}")
        with suppress(SimulationError):
            simulate(machine, name)
    return machine


def report(
    drive: Machine, controllers: Sequence[str | Controller], command: str, *, progress: Progress
) -> str:
    """The report for a customer, as one HTML text; SOFTSTART_BUDGET, in s, is its `budget`."""
    progress(0.0, "starting the drive")
    budget = os.environ.get("SOFTSTART_BUDGET")
    options: dict[str, Any] = {"command": command} | ({"budget": float(budget)} if budget else {})
    return str(reporting.report(drive, controllers=controllers, progress=progress, **options).to_html())
