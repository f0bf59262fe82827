"""Files: load and save a drive, export what the selected strategy gives, the report, the command line."""

from __future__ import annotations

from collections.abc import Hashable
from contextlib import suppress
from functools import partial
from typing import ClassVar

from nicegui import ui

from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.page import tasks
from softstart.page.downloads import (
    command_text,
    drive_file,
    duty_text,
    file_name,
    profile_file,
    shipped_drives,
    written_text,
)
from softstart.page.job_panel import JobPanel, Task, starts_seconds
from softstart.page.panel_parts import (
    POLL,
    Troubles,
    action,
    box,
    choice,
    follow,
    hint,
    notify,
    save,
    text_area,
    text_field,
    upload,
)
from softstart.page.project import other_machines, project_of, take_file, take_text, turn_to
from softstart.page.sentences import in_words
from softstart.page.session import Session
from softstart.project import Project
from softstart.project.parts import kind_of, profile_of
from softstart.views.numbers import cut

LARGEST = 512 * 1024  # bytes of a file
OF_PROJECT = "project: "  # before the names of its machines
AS_LOADED, NO_OTHER = "this machine as loaded", "no other machine"


class FilesPanel:
    """Drive files, exports and the command line; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        parts = {
            "Project and drive": (DriveFiles, DriveChoice, ProjectNames, BesidePanel),
            "Strategies": (StrategyText,),
            "Export": (Exports, ParameterSheetPanel, ProgramPanel, ReportPanel),
            "Command line": (command_line,),
        }
        for title, panels in parts.items():
            ui.html(title, tag="h3", sanitize=False).classes("panel-title")
            for panel in panels:
                panel(session, user)


class DriveFiles:
    """Load a drive or chain from a file; save the present one, or the project."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        with box("panel-form"):
            remedy = "a drive file has one or two, a project some more"
            upload("Load a file ...", "drive", ".toml,.csv", LARGEST, remedy, self._uploaded, self._refuse)
            action("Save project", self._save_project, "project-save")
            action("Save as TOML", self._save, "drive-save")
        hint(
            "Whatever is saved here: projects, drives, tuned gains, torque profiles (CSV, TOML), duties. A "
            "mistake in a file changes nothing here."
        )
        self._troubles = Troubles("drive")

    def _uploaded(self, content: bytes, name: str) -> None:
        self._troubles.say(())
        notify(take_file(self._session, content, name))

    def _refuse(self, name: str, error: InputError) -> None:
        self._troubles.say(error.sentences, f"{cut(name)} was not loaded; nothing is changed.")

    def _save_project(self) -> None:
        project = project_of(self._session)
        name = file_name(project.project or project.machine, "project", suffix=".toml")
        save(project.to_toml(), name)

    def _save(self) -> None:
        inputs = self._session.inputs
        machine = inputs.machine if inputs.duty is None else inputs.machine_with_duty
        save(machine.to_toml(), drive_file(machine))


class DriveChoice:
    """Another drive or chain: of the project, or a shipped one."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        with box("panel-form"):
            self.choice = choice("Drives of the project, and shipped", {"": ""}, "", "drive-choice")
        self.choice.on_value_change(lambda event: self._take(str(event.value or "")))
        follow(session, self._offer)

    def _offer(self) -> None:
        own = {OF_PROJECT + name: f"{name} (project)" for name in other_machines(self._session)}
        options = {"": "choose one", **own, **{name: one.name for name, one in shipped_drives().items()}}
        if options != self.choice.options:
            self.choice.set_options(options, value="")

    def _take(self, name: str) -> None:
        if not name:
            return
        self.choice.set_value("")
        if name.startswith(OF_PROJECT):
            turn_to(self._session, name.removeprefix(OF_PROJECT))
        else:
            self._session.load(shipped_drives()[name])
        notify(f"{cut(self._session.inputs.machine.name)} is loaded.")


class ProjectNames:
    """Names and notes of the project, which its report has in its heading."""

    LABELS: ClassVar[dict[str, str]] = {
        "customer": "Customer", "project": "Project", "number": "Document number", "author": "Author",
        "company": "Company", "checked": "Checked by, date", "approved": "Approved by, date",
        "paper": "Paper", "decimal": "Decimal sign",
    }  # fmt: skip

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        self._fields: dict[str, ui.input | ui.select | ui.textarea] = {}
        self._labels = {Project.PARAMETERS[key].path: label for key, label in self.LABELS.items()}
        self._seen: dict[str, str] = {}
        with ui.element("details").classes("panel-fold"):
            ui.html("Names and notes", tag="summary", sanitize=False).props('data-testid="project-names"')
            with box("panel-form"):
                for key, label in self.LABELS.items():
                    p, name = Project.PARAMETERS[key], f"project-{key}"
                    example = p.example.strip('"')
                    field = (choice(label, list(p.choices), example, name) if p.choices
                             else text_field(label, "", name, f"such as {example}"))  # fmt: skip
                    self._fields[key] = field
                self._fields["notes"] = text_area("Notes", "", "project-notes")
            hint("The report has them in its heading; notes stay in the project.")
        for key, field in self._fields.items():
            field.on_value_change(partial(self._take, key))
        self._troubles = Troubles("project")
        follow(session, self._refresh)

    def _refresh(self) -> None:
        """Show what the project has, where that is new: what is being typed stays."""
        for key, field in self._fields.items():
            if (text := getattr(self._session.inputs.project, key)) != self._seen.get(key):
                self._seen[key] = text
                field.set_value(text)

    def _take(self, key: str) -> None:
        try:
            self._session.describe(key, str(self._fields[key].value or ""))
            self._seen[key] = getattr(self._session.inputs.project, key)
            self._troubles.say(())
        except InputError as error:
            self._troubles.say([in_words(one, self._labels) for one in error.sentences])


class StrategyText:
    """A torque profile or the file of a strategy as text, pasted: it joins the strategies at once."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        example = "time [s] and torque [N m], as copied from a spreadsheet, or the text of a strategy file"
        with box("panel-form"):
            self._name = text_field("Name", "mine", "paste-name")
            self._text = text_area("Torque profile", example, "paste-text")
            action("Add to the strategies", self._add, "paste-add")
        hint("A line for each instant, straight in between; the start under it is in the table at once.")
        self._troubles = Troubles("paste")

    def _add(self) -> None:
        self._troubles.say(())
        label, text = str(self._name.value or "mine"), str(self._text.value or "")
        try:
            if (kind := kind_of(text, label)) != "strategy":
                raise InputError(f"{label}: this is a {kind}; load its file instead.")
            notify(take_text(self._session, text, label))
        except (InputError, SimulationError) as error:
            sentences = getattr(error, "sentences", (str(error),))
            self._troubles.say(sentences, f"{cut(label)} was not added; the strategies are unchanged.")


class OtherMachine:
    """The choice of a machine beside the present one: as loaded, of the project, or shipped, of its kind."""

    def __init__(self, session: Session, name: str, first: str) -> None:
        self._session, self._first = session, first
        self.choice = choice("Beside it", [first], first, name)
        follow(session, self._offer)

    def _offer(self) -> None:
        inputs = self._session.inputs
        own = other_machines(self._session)
        names = [name for name, one in shipped_drives().items() if type(one) is type(inputs.machine)]
        if (options := [*dict.fromkeys([self._first, AS_LOADED]), *own, *names]) != self.choice.options:
            self.choice.set_options(options, value=inputs.project.beside or self._first)

    @property
    def machine(self) -> Machine | None:
        """The machine; None if none is chosen."""
        inputs, name = self._session.inputs, str(self.choice.value)
        if name == AS_LOADED:
            return inputs.origin
        if name in [one.name for one in inputs.project.machines]:
            return inputs.project.single(name)
        return shipped_drives().get(name)


class BesidePanel(JobPanel):
    """The present machine and another one under the strategies of the table, in one table and figure."""

    name = "beside"
    about = (
        "The strategies of the table on this machine and on another one of the same kind, as loaded before "
        "your changes, of the project or shipped; in one table and figure."
    )
    verb = "Compare"

    def form(self) -> None:
        """The other machine."""
        ui.label("Two machines side by side").classes("panel-caption")
        self._other = OtherMachine(self.session, "beside-machine", AS_LOADED)

    def task(self) -> Task:
        """Both comparisons."""
        inputs = self.session.inputs
        strategies = list(inputs.controllers.values())
        return tasks.beside_task, inputs.machine_in_units, self._other.machine, strategies

    def estimate(self) -> float:
        """Two comparisons."""
        return starts_seconds(self.session.inputs.machine)


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
        "set for them. Add takes the values of the sheet into the table."
    )
    verb = "Parameter sheet"

    def form(self) -> None:
        """The caption."""
        ui.label("For the inverter").classes("panel-caption")

    def task(self) -> Task:
        """The sheet."""
        inputs = self.session.inputs
        name = file_name(inputs.machine.name, inputs.selected, "parameters", suffix=".txt")
        return tasks.sheet_task, inputs.machine_in_units, inputs.controllers[inputs.selected], name

    def estimate(self) -> float:
        """Some starts."""
        return 1.0


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
        return 1.0


class ReportPanel(JobPanel):
    """The report for a customer, saved in the tab that has asked for it."""

    name = "report"
    about = (
        "One file that opens offline and prints: recommendation, strategies, lower bound and optimum, "
        "robustness, parameter sheets. Customer and project are those of Names and notes, above."
    )
    verb = "Report"
    saves = True
    KINDS: ClassVar[dict[str, str]] = {".html": "HTML", ".pdf": "PDF"}

    def form(self) -> None:
        """The kind of the file, and another machine."""
        ui.label("Report for a customer").classes("panel-caption")
        self._kind = choice("File", self.KINDS, ".html", "report-kind")
        self._other = OtherMachine(self.session, "report-beside", NO_OTHER)

    def task(self) -> Task:
        """The report."""
        inputs, suffix = self.session.inputs, str(self._kind.value)
        name = file_name(inputs.machine.name, "report", suffix=suffix)
        option = {".html": "--out", ".pdf": "--pdf"}[suffix]
        command = command_text(inputs.machine_with_duty, inputs.controllers, "report", f"{option}={name}")
        strategies, beside = list(inputs.controllers.values()), self._other.machine
        return (
            tasks.report_task,
            inputs.machine_with_duty,
            strategies,
            command,
            name,
            inputs.project,
            beside,
        )

    def estimate(self) -> float:
        """Its budget for optima, `reporting.result.BUDGET`, and the starts."""
        return 22.0 if len(self.session.inputs.machine.shaft_names) == 1 else 65.0


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
