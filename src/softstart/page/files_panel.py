"""Files: load and save a drive, export what the selected strategy gives, the report, the command line."""

from __future__ import annotations

import tempfile
from collections.abc import Hashable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import ClassVar

from nicegui import ui

from softstart.chain.machines import is_chain_text
from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive.data_sheet import DataSheet
from softstart.errors import InputError
from softstart.input.documents import parsed
from softstart.input.parameters import Wording
from softstart.page import tasks
from softstart.page.downloads import (
    command_text,
    drive_file,
    duty_text,
    file_name,
    profile_file,
    profile_of,
    shipped_drives,
    written_text,
)
from softstart.page.job_panel import JobPanel, Task
from softstart.page.machines import Loaded, machine_from
from softstart.page.panel_parts import POLL, Troubles, action, box, choice, follow, hint, notify, save, upload
from softstart.page.session import Session
from softstart.profile import TorqueProfile
from softstart.views.numbers import cut

LARGEST = 64 * 1024  # bytes of a drive file
LONGEST_LINE = 2000  # characters; a key of thousands of parts is read for many seconds


class FilesPanel:
    """Drive files, exports and the command line; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        parts = {
            "Drive": (DriveFiles,),
            "Strategies": (StrategyFiles,),
            "Export": (Exports, ParameterSheetPanel, ProgramPanel, ReportPanel),
            "Command line": (command_line,),
        }
        for title, panels in parts.items():
            ui.html(title, tag="h3", sanitize=False).classes("panel-title")
            for panel in panels:
                panel(session, user)


class DriveFiles:
    """Load a drive or chain from a file or from the shipped ones; save the present one."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        shipped = {"": "choose one", **{name: drive.name for name, drive in shipped_drives().items()}}
        with box("panel-form"):
            remedy = "a drive file has one or two"
            upload("Load a file ...", "drive", ".toml", LARGEST, remedy, self._uploaded, self._refuse)
            action("Save as TOML", self._save, "drive-save")
            self._shipped = choice("Shipped drives", shipped, "", "drive-shipped")
            self._shipped.on_value_change(lambda event: self._take(str(event.value or "")))
        hint("A drive file holds texts with units or bare SI numbers; a mistake in it changes nothing here.")
        self._troubles = Troubles("drive")

    def _uploaded(self, content: bytes, name: str) -> None:
        self._take_over(machine_of(content, name))

    def _take(self, name: str) -> None:
        if name:
            self._shipped.set_value("")
            self._take_over(shipped_drives()[name])

    def _take_over(self, machine: Loaded) -> None:
        self._troubles.say(())
        self._session.load(machine)
        notify(f"{cut(self._session.inputs.machine.name)} is loaded.")

    def _refuse(self, name: str, error: InputError) -> None:
        self._troubles.say(error.sentences, f"{cut(name)} was not loaded; the drive is unchanged.")

    def _save(self) -> None:
        inputs = self._session.inputs
        machine = inputs.machine if inputs.duty is None else inputs.machine_with_duty
        save(machine.to_toml(), drive_file(machine))


def machine_of(content: bytes, name: str) -> Loaded:
    """The drive, chain or data sheet in the bytes of a file; InputError with a sentence for each mistake.

    >>> machine_of(b"\\xff\\xfe", "mine.toml")
    Traceback (most recent call last):
    softstart.errors.InputError: mine.toml: the file is not UTF-8 text (line 1); save it as UTF-8.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}: the file is not UTF-8 text (line {place}); save it as UTF-8.") from None
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > LONGEST_LINE:
            raise InputError(
                f"{name}: line {number} has more than {LONGEST_LINE} characters, as no drive file has."
            )
    if not is_chain_text(text) and DataSheet.describes(parsed(text, Wording(style="toml"), "a drive")):
        return DataSheet.from_toml(text).possible
    return machine_from(text)


class StrategyFiles:
    """Tuned gains and torque profiles, as the page and the commands save them, join the strategies."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        with box("panel-form") as form:
            vars(form)["panel"] = self  # an upload does not keep what it calls
            remedy = "gains and profiles have fewer"
            upload(
                "Load a strategy ...", "strategy", ".toml,.csv", LARGEST, remedy, self._uploaded, self._refuse
            )
        hint("Tuned gains (TOML) or a torque profile (TOML, CSV), as they are saved here.")
        self._troubles = Troubles("strategy")

    def _uploaded(self, content: bytes, name: str) -> None:
        self._troubles.say(())
        label = self._session.add(Path(name).stem, strategy_of(content, name))
        notify(f"{cut(label)} joins the strategies.")

    def _refuse(self, name: str, error: InputError) -> None:
        self._troubles.say(error.sentences, f"{cut(name)} was not loaded; the strategies are unchanged.")


def strategy_of(content: bytes, name: str) -> Controller:
    """The tuned gains or the player of the torque profile in the bytes of a file.

    >>> strategy_of(b"time,torque\\n0,20\\n0.1,62\\n", "mine.csv").profile.torque.tolist()
    [20.0, 62.0]
    """
    with tempfile.TemporaryDirectory(prefix="softstart-") as folder:
        path = Path(folder) / Path(name).name
        path.write_bytes(content)
        try:
            if path.suffix.lower() == ".toml" and b"kind" in content:
                return make_controller(str(path))
            return make_controller("profile", {"profile": TorqueProfile.load(path)})
        except InputError as error:  # the user knows the file by its name
            raise InputError([text.replace(str(path), name) for text in error.sentences]) from None


class Exports:
    """Traces and profile of the selected strategy as files."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        with box("panel-actions"):
            self._caption = ui.label().classes("panel-caption").props('data-testid="export-strategy"')
            action("Traces CSV", self._traces, "export-traces")
            with box("panel-actions") as self._of_profile:
                for suffix, text in ((".csv", "Profile CSV"), (".toml", "Profile TOML"), (".c", "C code")):
                    action(text, partial(self._profile, suffix), f"export-profile-{suffix[1:]}")
        follow(session, self._refresh)

    def _refresh(self) -> None:
        """The strategy to which the buttons refer."""
        inputs = self._session.inputs
        self._caption.set_text(f"Selected: {inputs.selected}")
        self._of_profile.set_visibility(profile_of(inputs.controllers[inputs.selected]) is not None)

    def _traces(self) -> None:
        inputs = self._session.inputs
        result = self._session.result(inputs.selected)
        if result.run is None:
            raise InputError(f"{result.name} has no traces: {result.trouble}")
        name = file_name(inputs.machine.name, result.name, "traces", suffix=".csv")
        save(written_text(result.run.to_csv, ".csv"), name)

    def _profile(self, suffix: str) -> None:
        inputs = self._session.inputs
        profile = profile_of(inputs.controllers[inputs.selected])
        if profile is None:  # another strategy was selected a moment ago
            raise InputError(f"{inputs.selected}: this strategy plays no torque profile.")
        about = {"drive": inputs.machine.name, "strategy": inputs.selected}
        name, text = profile_file(profile, inputs.selected, suffix, about)
        save(text, name)


class ParameterSheetPanel(JobPanel):
    """What to set on the inverter for the selected strategy, to be copied or saved as a text."""

    name = "parameters"
    about = (
        "What to set on the inverter for the selected strategy, tuned gains too: rounded values in its "
        "units, with the K_dyn of exactly these. Where the strategy does not keep the limits as it is, it is "
        "set for them."
    )
    verb = "Parameter sheet"

    def form(self) -> None:
        """The caption."""
        ui.label("For the inverter").classes("panel-caption")

    def task(self) -> Task:
        """The sheet."""
        inputs = self.session.inputs
        name = file_name(inputs.machine.name, inputs.selected, "parameters", suffix=".txt")
        return tasks.sheet_task, inputs.both_ends, inputs.controllers[inputs.selected], name

    def estimate(self) -> float:
        """Some starts."""
        return 2.0


class ProgramPanel(JobPanel):
    """The selected strategy as a program, or the machine as FMU, saved in the tab that has asked for it."""

    name = "program"
    about = (
        "The selected strategy with its guard, tuned gains too, as a program for a PLC, an inverter or a "
        "simulator; with instructions, and a test by real starts."
    )
    verb = "Program ZIP"
    saves = True
    KINDS: ClassVar[dict[str, str]] = {
        "c": "C99", "st": "Structured Text", "fmu": "FMU", "machine": "FMU of the machine",
    }  # fmt: skip
    REALS: ClassVar[dict[str, str]] = {"float64": "double precision", "float32": "single precision"}

    def form(self) -> None:
        """Language and precision."""
        ui.label("Program").classes("panel-caption")
        self._kind = choice("Language", self.KINDS, "c", "program-language")
        self._real = choice("Numbers", self.REALS, "float64", "program-real")

    def task(self) -> Task:
        """The export."""
        inputs, kind = self.session.inputs, str(self._kind.value)
        of_machine = kind == "machine"
        parts = [inputs.machine.name] if of_machine else [inputs.machine.name, inputs.selected]
        file = file_name(*parts, self.KINDS[kind].split()[0], suffix=".zip")
        controller = None if of_machine else inputs.controllers[inputs.selected]
        return tasks.program_task, inputs.machine, controller, kind, str(self._real.value), file

    def estimate(self) -> float:
        """Translation and some starts in cycles."""
        return 5.0


class ReportPanel(JobPanel):
    """The report for a customer, saved in the tab that has asked for it."""

    name = "report"
    about = (
        "The report is one file that opens offline and prints: drive, strategies, limit, robustness, "
        "parameter sheet."
    )
    verb = "Report HTML"
    saves = True

    def form(self) -> None:
        """The caption."""
        ui.label("Report for a customer").classes("panel-caption")

    def task(self) -> Task:
        """The report."""
        inputs = self.session.inputs
        name = file_name(inputs.machine.name, "report", suffix=".html")
        command = command_text(inputs.machine_with_duty, inputs.controllers, "report", f"--out={name}")
        return tasks.report_task, inputs.both_ends_with_duty, list(inputs.controllers.values()), command, name

    def estimate(self) -> float:
        """Mostly its budget for maps and limits."""
        return 30.0


def command_line(session: Session, user: Hashable) -> None:
    """What to type in a terminal for the same drive and strategies."""
    command = ui.label().classes("command").props('data-testid="command" tabindex=0')
    duty = ui.label().classes("command").props('data-testid="duty-command" tabindex=0')
    note = ui.label().classes("panel-hint")

    def refresh() -> None:
        inputs = session.inputs
        drawn = {label: inputs.controllers[label] for label in inputs.drawn}
        text = command_text(inputs.machine, drawn)
        command.set_text(text)
        of_duty = ""
        with suppress(InputError):  # the tab of the duty says so
            if inputs.duty is not None:
                one = inputs.controllers[inputs.selected]
                of_duty = duty_text(inputs.machine_with_duty, inputs.selected, one, inputs.duty.stop)
        duty.set_text(of_duty)
        duty.set_visibility(bool(of_duty))
        words = f"{text} {of_duty}".replace(",", " ").replace("=", " ").split()
        files = dict.fromkeys(word for word in words if word.endswith((".toml", ".csv")))
        notes = [f"First save from here: {', '.join(files)}." if files else
                 "It prints the strategies that are drawn as a table in a terminal."]  # fmt: skip
        profiles = sum(profile_of(controller) is not None for controller in drawn.values())
        if profiles > 1:
            notes.append(f"Of the {profiles} profiles a command takes one.")
        note.set_text(" ".join(notes))

    follow(session, refresh, 2 * POLL)
