"""Files: load and save a drive, export what the selected strategy gives, the report, the command line."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from nicegui import ui

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.page import works
from softstart.page.background import jobs_of
from softstart.page.bench import Bench
from softstart.page.command_text import command_text, drive_file, shipped_drives
from softstart.page.downloads import file_name, text_of
from softstart.page.job_view import LOOK, JobView
from softstart.page.jobs import Jobs
from softstart.page.panel_parts import action, box, choice, guarded, hint, save, tell

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from softstart.profile import TorqueProfile

LARGEST = 256 * 1024  # bytes of a drive file


def files_panel(bench: Bench, user: Hashable) -> None:
    """Build the panel of the client of the moment."""
    jobs = jobs_of(user)
    with ui.element("div").classes("panel"):
        _title("Drive")
        DriveFiles(bench)
        _title("Export")
        Exports(bench, user, jobs)
        _title("Command line")
        CommandLine(bench)


def _title(text: str) -> None:
    ui.html(text, tag="h3", sanitize=False).classes("panel-title")


class DriveFiles:
    """Load a drive from a file or from the shipped ones; save the one on the bench."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        shipped = {"": "choose one", **{name: drive.name for name, drive in shipped_drives().items()}}
        with box().classes("panel-form"):
            self._upload = ui.upload(
                on_upload=self._uploaded, on_rejected=self._rejected, max_file_size=LARGEST, auto_upload=True
            ).classes("panel-upload")
            self._upload.props('accept=".toml,text/plain" data-testid="drive-upload"')
            pick = action("Load a file ...", lambda: None, "drive-load", main=True)
            pick.on("click", js_handler=f"() => getElement({self._upload.id}).pickFiles()")
            action("Save as TOML", guarded(self._save), "drive-save")
            self._shipped = choice("Shipped drives", shipped, "", "drive-shipped")
            self._shipped.on_value_change(lambda event: self._take(str(event.value or "")))
        hint(
            "A drive file holds strings with units or bare SI numbers; a mistake in it changes nothing here."
        )
        with box().classes("troubles").props('role=alert data-testid="drive-trouble"') as self._troubles:
            pass
        self._troubles.set_visibility(False)

    async def _uploaded(self, event: UploadEventArguments) -> None:
        name = event.file.name
        content = await event.file.read()
        self._upload.reset()
        try:
            self._bench.take(drive_of(content, name))
        except InputError as error:
            self._refuse(name, error)
        else:
            self._taken()

    def _rejected(self) -> None:
        self._upload.reset()
        self._refuse(
            "The file", InputError(f"It has more than {LARGEST // 1024} kB; a drive file has one or two.")
        )

    def _take(self, name: str) -> None:
        if name:
            self._bench.take(Drive.load(name))
            self._shipped.set_value("")
            self._taken()

    def _taken(self) -> None:
        self._troubles.set_visibility(False)
        tell(f"{self._bench.drive.name} is on the bench.")

    def _refuse(self, name: str, error: InputError) -> None:
        self._troubles.clear()
        self._troubles.set_visibility(True)
        with self._troubles:
            ui.label(f"{name} was not loaded; the drive on the bench is as it was.").classes("trouble-title")
            for sentence in error.sentences:
                ui.label(sentence).classes("trouble")

    def _save(self) -> None:
        save(self._bench.drive.to_toml(), drive_file(self._bench.drive))


def drive_of(content: bytes, name: str) -> Drive:
    """The drive in the bytes of a file; InputError with a sentence for each mistake.

    >>> drive_of(b"\\xff\\xfe", "mine.toml")
    Traceback (most recent call last):
    softstart.errors.InputError: mine.toml: the file is not UTF-8 text (line 1); save it as UTF-8.
    """
    if len(content) > LARGEST:
        raise InputError(f"{name}: the file has more than {LARGEST // 1024} kB; a drive file has one or two.")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}: the file is not UTF-8 text (line {line}); save it as UTF-8.") from None
    return Drive.from_toml(text)


class Exports:
    """Traces and profile of the selected strategy, and the report, as files."""

    def __init__(self, bench: Bench, user: Hashable, jobs: Jobs) -> None:
        self._bench = bench
        self._saved_as = ""
        self._seen = -1
        with box().classes("panel-actions"):
            self._caption = ui.label().classes("panel-caption").props('data-testid="export-strategy"')
            action("Traces CSV", guarded(self._traces), "export-traces")
            with box().classes("panel-actions") as self._of_profile:
                action("Profile CSV", guarded(lambda: self._profile(".csv")), "export-profile-csv")
                action("Profile TOML", guarded(lambda: self._profile(".toml")), "export-profile-toml")
                action("C code", guarded(self._code), "export-c")
        with box().classes("panel-actions"):
            ui.label("Report for a customer").classes("panel-caption")
            self._report = action("Report HTML", guarded(self._begin_report), "export-report", main=True)
        hint(
            "The report is one file that opens offline and prints: drive, strategies, limit, robustness, "
            "parameter sheet. It takes a while and is computed in the background."
        )
        self._view = JobView(jobs, user, "export", on_done=self._done, on_state=self._state)
        ui.timer(LOOK, self._look)
        self._look()

    def _look(self) -> None:
        """The strategy that the buttons mean."""
        if self._bench.version == self._seen:
            return
        self._seen = self._bench.version
        self._caption.set_text(f"Selected: {self._bench.selected}")
        self._of_profile.set_visibility(self._profile_of_selected() is not None)

    def _state(self) -> None:
        self._report.set_enabled(not self._view.busy)

    def _named(self, *parts: str, suffix: str) -> str:
        return file_name(self._bench.drive.name, *parts, suffix=suffix)

    def _traces(self) -> None:
        found = self._bench.result(self._bench.selected)
        if found.run is None:
            raise InputError(f"{found.name} has no traces: {found.trouble}")
        save(text_of(found.run.to_csv, ".csv"), self._named(found.name, "traces", suffix=".csv"))

    def _profile_of_selected(self) -> TorqueProfile | None:
        profile = getattr(self._bench.controllers[self._bench.selected], "profile", None)
        return profile if hasattr(profile, "to_c") else None

    def _profile(self, suffix: str) -> None:
        profile = self._profile_of_selected()
        assert profile is not None
        about = {"drive": self._bench.drive.name, "strategy": self._bench.selected}
        write: Any = profile.to_csv if suffix == ".csv" else lambda path: profile.to_toml(path, about)
        save(text_of(write, suffix), file_name(self._bench.selected, suffix=suffix))

    def _code(self) -> None:
        if self._view.busy:
            return
        self._saved_as = file_name(self._bench.selected, suffix=".c")
        about = {"drive": self._bench.drive.name, "strategy": self._bench.selected}
        self._view.begin("C code", works.code, self._profile_of_selected(), about)

    def _begin_report(self) -> None:
        if self._view.busy:
            return
        bench = self._bench
        strategies = dict(bench.controllers)
        self._saved_as = self._named("report", suffix=".html")
        self._view.begin(
            "report",
            works.report,
            bench.drive,
            list(strategies.values()),
            command_text(bench.drive, strategies, "report", f"--out={self._saved_as}"),
        )

    def _done(self, text: str) -> None:
        save(text, self._saved_as)


class CommandLine:
    """What to type in a terminal for the same drive and strategies."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._seen = -1
        self._text = ui.label().classes("command").props('data-testid="command" tabindex=0')
        with box().classes("panel-actions"):
            copy = action("Copy", lambda: tell("Copied."), "command-copy")
            copy.on("click", js_handler=COPY % self._text.id)
        self._note = ui.label().classes("panel-hint")
        ui.timer(2 * LOOK, self._look)
        self._look()

    def _look(self) -> None:
        if self._bench.version == self._seen:
            return
        self._seen = self._bench.version
        bench = self._bench
        text = command_text(bench.drive, {label: bench.controllers[label] for label in bench.shown})
        self._text.set_text(text)
        needed = [
            word
            for word in text.replace(",", " ").replace("=", " ").split()
            if word.endswith((".toml", ".csv"))
        ]
        self._note.set_text(
            f"First save from here: {', '.join(needed)}." if needed
            else "It repeats the table of strategies for this drive in a terminal."
        )  # fmt: skip


COPY = """() => {
  const text = getHtmlElement(%d).innerText;
  if (navigator.clipboard && window.isSecureContext) { navigator.clipboard.writeText(text); return; }
  const area = document.createElement('textarea');
  area.value = text; document.body.append(area); area.select(); document.execCommand('copy'); area.remove();
}"""
