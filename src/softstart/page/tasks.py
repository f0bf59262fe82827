"""What the page computes in the background: optimum, Pareto curve, checks, tuning, identification, report.

Each function runs in a process of its own (`softstart.page.jobs`), says how far it is through `progress`, and
gives back plain data.
"""

from __future__ import annotations

import html
import math
import os
import re
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.controller.base import Controller
from softstart.controller.finding import controller_class, ready_controller_names
from softstart.controller.parameters import declared_parameters
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes, SimulationError
from softstart.page.downloads import file_name, profile_file, written_text
from softstart.page.machines import with_typed_changes
from softstart.page.sentences import page_sentence
from softstart.parallel import Progress
from softstart.project.parts import StoredOptimum, player_of
from softstart.quantities import show
from softstart.start.comparison import compare
from softstart.start.fatigue import fatigue
from softstart.start.simulation import simulate

if TYPE_CHECKING:
    from softstart.export.package import Language, Real
    from softstart.identification.logs import TorqueIs
    from softstart.optimal.problem import Terminal
    from softstart.optimal.result import Optimum
    from softstart.project import Project
    from softstart.views.sheet import Sheet

TUNING_SHARES = {"starts": (0.0, 0.05), "schedule": (0.05, 0.45), "robust": (0.45, 0.8), "optima": (0.8, 1.0)}
COLUMN = 314.0  # pixels of an answer on a screen of 1280
INTERVAL = 0.1  # s between two reports of a task that would report thousands of times


@dataclass(frozen=True)
class TaskResult:
    """The result of a task: HTML to show, contents of files by name, and what may be taken over from it.

    `controllers` may join the strategies, by label, with what they claim as `optima`; `drive` may become that
    of the page; `copy` is what a button puts into the clipboard.
    """

    html: str
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    controllers: Mapping[str, Controller] = field(default_factory=dict)
    optima: Mapping[str, StoredOptimum] = field(default_factory=dict)
    drive: Machine | None = None
    copy: str = ""


SET_FOR_LIMITS = ", set"  # behind the name of a strategy with parameters that are set for the limits


def shown(*sheets: Sheet, first: bool = False) -> str:
    """The sheets of a terminal as HTML, figures `first` or last, with advice for the page."""
    from softstart.views.sheet import as_html

    parts = []
    for sheet in sheets:
        conclusions, notes = ([*map(page_sentence, texts)] for texts in (sheet.conclusions, sheet.notes))
        on_page = replace(sheet, conclusions=conclusions, notes=notes)
        parts.append(as_html(on_page, len(sheet.figures), first=first, width=COLUMN))
    return "\n".join(parts)


def optimum_task(drive: Machine, start_time: str, terminal: Terminal, *, progress: Progress) -> TaskResult:
    """The start with the lowest K_dyn within a time, as `0.3`, `300 ms` or `1.2x` (of that of `direct`)."""
    from softstart.optimal.optimize import optimize
    from softstart.views.optima import optimum_sheet

    progress(None, "minimising K_dyn")
    best = optimize(
        drive, start_time, terminal=terminal, progress=lambda doing: progress(counted(doing), doing)
    )
    others = []
    for name in ready_controller_names():
        with suppress(InputError, SimulationError):
            others.append(simulate(drive, name))
    return with_optimum(best, optimum_label(best), optimum_sheet(best, others))


def with_optimum(best: Optimum, label: str, *sheets: Sheet) -> TaskResult:
    """These sheets, the profile as files, and the optimum as a strategy with its claims."""
    return TaskResult(
        shown(*sheets),
        profile_files(best, label),
        {label: player_of(best.profile, label)},
        {label: StoredOptimum.of(best, label, best.problem.drive.name)},
    )


def optimum_label(best: Optimum) -> str:
    """What the optimum is called among the strategies."""
    from softstart.views.optima import best_start

    ending = "" if best.problem.terminal == "reached" else f", {best.problem.terminal}"
    return f"{best_start(best.problem.drive)} {best.end_time:.4g} s{ending}"


def profile_files(best: Optimum, label: str) -> dict[str, str]:
    """The profile of an optimum as CSV, TOML and C."""
    problem = best.problem
    about = {
        "drive": problem.drive.name,
        "start_time": best.end_time,
        "terminal": problem.terminal,
        "k_dyn": best.k_dyn,
    }
    return dict(profile_file(best.profile, label, suffix, about) for suffix in (".csv", ".toml", ".c"))


def curve(
    drive: Machine, controllers: Sequence[Controller], terminal: Terminal, *, progress: Progress
) -> TaskResult:
    """The lowest K_dyn over the start time, and each strategy beside that of its own start time."""
    from softstart.optimal import front

    progress(None, "the shortest start time")
    total, done = front.COUNT + len(controllers), 0

    def doing(what: str) -> None:
        nonlocal done
        _, point, within = what.rpartition(": ")
        if point:
            progress(min(done / total, 1.0), f"start in {within.removesuffix(f', {terminal}')}")
            done += 1

    found = front.pareto(drive, terminal=terminal, controllers=controllers, progress=doing)
    name = file_name(drive.name, "pareto", suffix=".csv")
    return TaskResult(shown(found.sheet, first=True), {name: written_text(found.to_csv, ".csv")})


def beside_task(
    first: Machine, second: Machine, controllers: Sequence[Controller], *, progress: Progress
) -> TaskResult:
    """Two machines side by side, or one before and after changes."""
    from softstart.start.beside import side_by_side

    progress(None, "starting both machines")
    return TaskResult(shown(side_by_side(first, second, controllers).sheet, first=True))


def tuning(
    drive: Machine,
    controller: str,
    gaps: Sequence[Any] | None,
    inertias: Sequence[Any] | None,
    certified: bool = True,
    restarts: int = 3,
    *,
    progress: Progress,
) -> TaskResult:
    """Gains of a controller for each gap and load inertia, and one set for all."""
    from softstart.tuning.solving import tune

    tuned = tune(
        drive, controller, gaps, inertias, certified=certified, restarts=restarts, workers=1,
        progress=_Throttled(progress),
    )  # fmt: skip
    progress(1.0, "writing the gains")
    sheet = tuned.sheet
    files = {}
    for name, write in sheet.files.items():
        stem, suffix = Path(name).stem, Path(name).suffix
        text = write if isinstance(write, str) else written_text(write, suffix)
        files[file_name(controller, stem, suffix=suffix)] = text
    controllers: dict[str, Controller] = {}
    if tuned.robust is not None:
        controllers[f"{controller} (robust)"] = tuned.robust.controller
    if tuned.schedule is not None:
        controllers[f"{controller} (schedule)"] = tuned.scheduled
    answer = shown(sheet)
    for name in declared_parameters(controller_class(controller)):  # their fields have names without signs
        answer = re.sub(rf"\b{name}\b", name.replace("_", " "), answer)
    return TaskResult(answer, files, controllers)


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

    >>> tuning_share("schedule, generation 2 of 4, 3,088 starts, 6,314/s"), tuning_share("something else")
    (0.25, None)
    """
    for begin, (low, high) in TUNING_SHARES.items():
        if doing.startswith(begin):
            return low + (high - low) * (counted(doing) or 0.0)
    return None


def counted(doing: str) -> float | None:
    """How much is done by what a message counts.

    >>> counted("start 3 of 15 around the best one"), counted("mid-gap alone: K_dyn 0.865")
    (0.2, None)
    """
    found = re.search(r"(\d+) of (\d+)", doing)
    return int(found[1]) / int(found[2]) if found else None


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
) -> TaskResult:
    """The drive from the log in these bytes, with its intervals, from this guess.

    Of a chain with one dominant gap it is the two masses that stand for it.
    """
    from softstart.identification.logs import Log
    from softstart.identification.solving import identify

    progress(None, "reading the log")
    with tempfile.TemporaryDirectory(prefix="softstart-log-") as folder:
        path = Path(folder, file_name(Path(name).stem, suffix=".csv"))
        path.write_bytes(content)
        try:
            log = Log.load(path, columns=columns, torque_is=torque_is)
        except InputError as error:
            raise InputError([sentence.replace(str(path), name) for sentence in error.sentences]) from None
    fit = identify(log, guess, progress=lambda doing: progress(None, doing))
    files = {"identified-drive.toml": fit.drive.to_toml()}
    return TaskResult(shown(fit.sheet), files, drive=fit.drive)


def checked(possible: Machine, controllers: Mapping[str, Controller], *, progress: Progress) -> TaskResult:
    """Strategies from each start position, margins to limits, life under them, and the quickest start.

    Those that keep the limits when they are set for them, as `compare` does, are to be added.
    """
    from softstart.optimal.optimize import optimize
    from softstart.views.checks import margins_sheet, positions_sheet
    from softstart.views.optima import optimum_sheet
    from softstart.views.sheet import Sheet

    progress(0.0, "limits")
    compared = compare(possible, list(controllers.values()))
    machine: Machine = compared.drive
    set_for_limits = {
        f"{label.removesuffix(SET_FOR_LIMITS)}{SET_FOR_LIMITS}": replace(controller, **row.setting)
        for (label, controller), row in zip(controllers.items(), compared.rows, strict=True)
        if row.setting
    }
    progress(0.3, "start positions")
    unknown, runs, mistakes = None, {}, Mistakes()
    with mistakes.collect():
        unknown = with_typed_changes(machine, {"start.position": "unknown"})
    for label, controller in controllers.items() if unknown is not None else ():
        with suppress(SimulationError):
            runs[label] = simulate(unknown, controller)
    sheets = [positions_sheet(runs, mistakes.sentences), margins_sheet(compared)]
    progress(0.6, "life of the shaft line")
    try:
        sheets.append(fatigue([row.run for row in compared.rows]).sheet)
    except InputError as error:
        sheets.append(Sheet("Life of the shaft line", notes=list(error.sentences)))
    # the permissible torques of single shafts bound no optimum
    if not machine.limits or machine.limits.used_torque is not None:
        return TaskResult(shown(*sheets), controllers=set_for_limits)
    progress(0.8, "the quickest start that keeps the limits")
    try:
        best = optimize(machine, limits=True)
    except (InputError, SimulationError) as error:
        notes = error.sentences if isinstance(error, InputError) else [str(error)]
        sheets.append(Sheet("The quickest start within limits", notes=notes))
        return TaskResult(shown(*sheets), controllers=set_for_limits)
    label = f"quickest {best.end_time:.4g} s"
    sheets.append(optimum_sheet(best, [row.run for row in compared.rows]))
    result = with_optimum(best, label, *sheets)
    return replace(result, controllers={**set_for_limits, **result.controllers})


def sheet_task(drive: Machine, controller: Controller, file: str, *, progress: Progress) -> TaskResult:
    """The parameter sheet of a strategy: rounded values, and the start with exactly these, to be added."""
    from softstart.reporting.sheet import parameter_sheet

    progress(None, "rounding, and starting the drive half a step off")
    found = parameter_sheet(drive, controller)
    printed = found.rounded if found.settings and not found.cells else None
    as_printed = None if printed is None else printed.controller
    added = {} if as_printed is None else {f"{found.name.removesuffix(', sheet')}, sheet": as_printed}
    return TaskResult(shown(found.sheet), {file: str(found)}, added, copy=str(found))


def report_task(
    drive: Machine,
    controllers: Sequence[str | Controller],
    command: str,
    file: str,
    project: Project,
    beside: Machine | None,
    *,
    progress: Progress,
) -> TaskResult:
    """The report for a customer, one HTML or PDF file; SOFTSTART_BUDGET, in s, is its `budget`."""
    from softstart import reporting
    from softstart.reporting.printing import browser_that_prints, printed

    browser = browser_that_prints() if file.endswith(".pdf") else ""
    progress(0.0, "starting the drive")
    budget = float(text) if (text := os.environ.get("SOFTSTART_BUDGET")) else None
    report = reporting.report(
        drive, controllers=controllers, progress=progress, command=command, budget=budget or None,
        project=project, beside=beside,
    )  # fmt: skip
    page = report.to_html()
    return TaskResult("", {file: printed(page, browser) if browser else page})


def program_task(
    drive: Machine,
    controller: Controller | None,
    language: Language,
    real: Real,
    file: str,
    *,
    progress: Progress,
) -> TaskResult:
    """A strategy with its guard as a program, or without a controller the machine as FMU, as a ZIP file."""
    from softstart.export.controller import export_controller
    from softstart.export.drive import export_drive
    from softstart.export.fmu import packed

    progress(None, "translating, and starting the drive in cycles")
    if controller is None:
        made = export_drive(drive)
    else:
        made = export_controller(controller, drive, language, real=real)
    contents = {name: text if isinstance(text, bytes) else text.encode() for name, text in made.files.items()}
    texts = [f"{file}: {', '.join(sorted(contents))}.", *made.notes]
    if (cycles := made.figures.get("k_dyn_in_cycles")) is not None:
        texts.insert(1, f"K_dyn {cycles:.4g} under the program, {made.figures['k_dyn_simulated']:.4g} here.")
    shown_texts = "".join(f"<p>{html.escape(page_sentence(text))}</p>" for text in texts)
    return TaskResult(shown_texts, {file: packed(contents)})
