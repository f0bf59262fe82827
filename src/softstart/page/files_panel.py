"""Files: load and save a drive, export what the selected strategy gives, the report, the command line."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any
from weakref import WeakMethod

from nicegui import ui

from softstart.chain.machines import Machine
from softstart.errors import InputError
from softstart.page import tasks
from softstart.page.downloads import command_text, drive_file, file_name, profile_of, shipped_drives, text_of
from softstart.page.jobs import Jobs
from softstart.page.machines import machine_from, single
from softstart.page.panel_parts import (
    POLL,
    JobView,
    action,
    box,
    choice,
    few,
    guarded,
    hint,
    jobs_of,
    notify,
    save,
    upload,
)
from softstart.page.sentences import clipped
from softstart.page.session import Session

if TYPE_CHECKING:
    from softstart.profile import TorqueProfile

LARGEST = 64 * 1024  # bytes of a drive file
USUAL = "a drive file has one or two"
LONGEST_LINE = 2000  # letters; a key of thousands of parts is read for many seconds


class FilesPanel:
    """Drive files, exports and the command line; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        _title("Drive")
        DriveFiles(session, user)
        _title("Export")
        Exports(session, user)
        _title("Command line")
        CommandLine(session)


def _title(text: str) -> None:
    ui.html(text, tag="h3", sanitize=False).classes("panel-title")


class DriveFiles:
    """Load a drive or chain from a file or from the shipped ones; save the present one."""

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self._session = session
        shipped = {"": "choose one", **{name: drive.name for name, drive in shipped_drives().items()}}
        with box().classes("panel-form"):
            upload("Load a file ...", "drive", ".toml", LARGEST, USUAL, self._uploaded, self._refuse)
            action("Save as TOML", guarded(self._save), "drive-save")
            self._shipped = choice("Shipped drives", shipped, "", "drive-shipped")
            self._shipped.on_value_change(lambda event: self._take(str(event.value or "")))
        hint(
            "A drive file holds strings with units or bare SI numbers; a mistake in it changes nothing here. "
            "A chain file is started under all strategies first, in the background."
        )
        with box().classes("troubles").props('role=alert data-testid="drive-trouble"') as self._troubles:
            pass
        self._troubles.set_visibility(False)
        done = WeakMethod(self._done)  # a timer that never ran outlives its tab
        self._view = JobView(
            jobs or jobs_of(user), user, "chain", on_done=lambda found: (one := done()) and one(found)
        )

    def _uploaded(self, content: bytes, name: str) -> None:
        self._begin(machine_of(content, name))

    def _begin(self, machine: Machine) -> None:
        """Take two masses at once, and more as soon as all strategies have started them."""
        self._troubles.set_visibility(False)
        if len(machine.mass_names) == 2:
            self._take_over(machine)
        elif self._view.busy:
            raise InputError("A chain is being started; wait for it, or cancel it.")
        else:
            self._view.begin("chain", tasks.ready, single(machine))

    def _done(self, machine: Machine) -> None:
        if self._view.mine:
            self._take_over(machine)

    def _take(self, name: str) -> None:
        if name:
            self._shipped.set_value("")
            self._begin(shipped_drives()[name])

    def _take_over(self, machine: Machine) -> None:
        self._session.take(machine)
        notify(f"{clipped(self._session.machine.name)} is loaded.")

    def _refuse(self, name: str, error: InputError) -> None:
        self._troubles.clear()
        self._troubles.set_visibility(True)
        with self._troubles:
            ui.label(f"{clipped(name)} was not loaded; the drive is unchanged.").classes("trouble-title")
            for sentence in few(error.sentences):
                ui.label(sentence).classes("trouble")

    def _save(self) -> None:
        save(self._session.machine.to_toml(), drive_file(self._session.machine))


def machine_of(content: bytes, name: str) -> Machine:
    """The drive or chain in the bytes of a file; InputError with a sentence for each mistake.

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
                f"{name}: line {number} has more than {LONGEST_LINE} letters, as no drive file has."
            )
    return machine_from(text)


class Exports:
    """Traces and profile of the selected strategy, and the report, as files."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        self._text = ""
        self._seen = -1
        with box().classes("panel-actions"):
            self._caption = ui.label().classes("panel-caption").props('data-testid="export-strategy"')
            action("Traces CSV", guarded(self._traces), "export-traces")
            with box().classes("panel-actions") as self._of_profile:
                action("Profile CSV", guarded(lambda: self._profile(".csv")), "export-profile-csv")
                action("Profile TOML", guarded(lambda: self._profile(".toml")), "export-profile-toml")
                self._c = action("C code", guarded(self._code), "export-c")
        with box().classes("panel-actions"):
            ui.label("Report for a customer").classes("panel-caption")
            self._report = action("Report HTML", guarded(self._begin_report), "export-report", main=True)
        hint(
            "The report is one file that opens offline and prints: drive, strategies, limit, robustness, "
            "parameter sheet. It takes a while and is computed in the background."
        )
        self._view = JobView(jobs_of(user), user, "export", on_done=self._done, on_state=self._state)
        # some browsers hold back a file that comes long after the press of a button
        with box().classes("panel-actions"):
            self._again = action("Save it again", guarded(self._save), "export-again")
        self._again.set_visibility(False)
        ui.timer(POLL, self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        """The strategy that the buttons mean."""
        if self._session.version == self._seen:
            return
        self._seen = self._session.version
        self._caption.set_text(f"Selected: {self._session.selected}")
        self._of_profile.set_visibility(self._profile_of_selected() is not None)

    def _state(self) -> None:
        for button in (self._report, self._c):  # what is computed aside, one after the other
            button.set_enabled(not self._view.busy)
        self._again.set_visibility(bool(self._text) and not self._view.busy and not self._view.failed)

    def _named(self, *parts: str, suffix: str) -> str:
        return file_name(self._session.machine.name, *parts, suffix=suffix)

    def _traces(self) -> None:
        found = self._session.result(self._session.selected)
        if found.run is None:
            raise InputError(f"{found.name} has no traces: {found.trouble}")
        save(text_of(found.run.to_csv, ".csv"), self._named(found.name, "traces", suffix=".csv"))

    def _profile_of_selected(self) -> TorqueProfile | None:
        return profile_of(self._session.controllers[self._session.selected])

    def _needed(self) -> TorqueProfile:
        profile = self._profile_of_selected()
        if profile is None:  # another strategy was selected a moment ago
            raise InputError(f"{self._session.selected}: this strategy plays no torque profile.")
        return profile

    def _profile(self, suffix: str) -> None:
        profile = self._needed()
        about = {"drive": self._session.machine.name, "strategy": self._session.selected}
        write: Any = profile.to_csv if suffix == ".csv" else lambda path: profile.to_toml(path, about)
        save(text_of(write, suffix), file_name(self._session.selected, suffix=suffix))

    def _code(self) -> None:
        if self._view.busy:
            return
        profile = self._needed()
        self._text = ""
        about = {"drive": self._session.machine.name, "strategy": self._session.selected}
        name = file_name(self._session.selected, suffix=".c")
        self._view.begin("C code", tasks.code, profile, about, subject=name)

    def _begin_report(self) -> None:
        if self._view.busy:
            return
        session = self._session
        strategies = dict(session.controllers)
        name, self._text = self._named("report", suffix=".html"), ""
        self._view.begin(
            "report",
            tasks.report,
            session.machine,
            list(strategies.values()),
            command_text(session.machine, strategies, "report", f"--out={name}"),
            subject=name,
        )

    def _done(self, text: str) -> None:
        self._text = text
        if self._view.mine:
            self._save()

    def _save(self) -> None:
        save(self._text, self._view.subject)


class CommandLine:
    """What to type in a terminal for the same drive and strategies."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._seen = -1
        self._text = ui.label().classes("command").props('data-testid="command" tabindex=0')
        with box().classes("panel-actions"):
            copy = action("Copy", lambda: notify("Copied."), "command-copy")
            copy.on("click", js_handler=COPY % self._text.id)
        self._note = ui.label().classes("panel-hint")
        ui.timer(2 * POLL, self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        if self._session.version == self._seen:
            return
        self._seen = self._session.version
        session = self._session
        text = command_text(session.machine, {label: session.controllers[label] for label in session.shown})
        self._text.set_text(text)
        needed = [
            word
            for word in text.replace(",", " ").replace("=", " ").split()
            if word.endswith((".toml", ".csv"))
        ]
        profiles = [label for label in session.shown if profile_of(session.controllers[label]) is not None]
        self._note.set_text(
            (f"First save from here: {', '.join(needed)}. " if needed else "")
            + (f"Of the {len(profiles)} profiles a command takes one. " if len(profiles) > 1 else "")
            + ("" if needed else "It gives the strategies that are drawn as a table in a terminal.")
        )


COPY = """() => {
  const text = getHtmlElement(%d).innerText;
  if (navigator.clipboard && window.isSecureContext) { navigator.clipboard.writeText(text); return; }
  const area = document.createElement('textarea');
  area.value = text; document.body.append(area); area.select(); document.execCommand('copy'); area.remove();
}"""
