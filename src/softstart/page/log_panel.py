"""The drive from a log: a file of an inverter is identified beside the drive, which is the guess."""

from __future__ import annotations

from collections.abc import Hashable

from nicegui import ui

from softstart.errors import InputError
from softstart.page import tasks
from softstart.page.panel_parts import (
    JobView,
    action,
    box,
    choice,
    few,
    field,
    guarded,
    hint,
    jobs_of,
    notify,
    save,
    table,
    upload,
)
from softstart.page.sentences import clipped
from softstart.page.session import Session

LARGEST = 1000 * 1024  # bytes of a log; a request may have little more
SHORTER = "cut the log to the start"


class LogPanel:
    """Upload of a log, what is found with its intervals, and the drive found; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        self._found: tasks.Identified | None = None
        hint(
            "A CSV file of a start from standstill: time, torque, and angle or speed of the motor, with "
            "units in its first line. The drive on this page is the first guess and may be off by a factor "
            "of 3; of a chain with one dominant gap, two masses are found. Nothing changes until you use the "
            "drive found."
        )
        with box().classes("panel-form"):
            kinds = {"demand": "a demand", "measured": "measured"}
            self._torque_is = choice("The torque is", kinds, "demand", "log-torque-is")
            self._columns = field("Column names, optional", "", "log-columns", "torque=M, speed=n[rpm]")
            self._pick = upload(
                "Load a log ...", "log", ".csv,text/csv", LARGEST, SHORTER, self._uploaded, self._refuse
            )
        self._view = JobView(jobs_of(user), user, "log", on_done=self._done, on_state=self._state)
        with box().classes("panel-result") as self._result:
            self._table = ui.html("", sanitize=False).classes("panel-scroll")
            self._notes = box().classes("panel-form")
            with box().classes("panel-actions"):
                action("Use this drive", guarded(self._use), "log-use", main=True)
                action("Save drive as TOML", guarded(self._save), "log-save")
        self._result.set_visibility(False)

    def _uploaded(self, content: bytes, name: str) -> None:
        columns = tasks.columns_of(str(self._columns.value or ""))
        self._result.set_visibility(False)
        self._view.begin(
            f"drive from {clipped(name)}", tasks.identified, content, name, self._session.machine,
            str(self._torque_is.value), columns,
        )  # fmt: skip

    def _refuse(self, name: str, error: InputError) -> None:
        self._view.refuse(error)

    def _state(self) -> None:
        self._view.settle(self._pick, self._result)

    def _done(self, found: tasks.Identified) -> None:
        self._found = found
        self._table.set_content(table(found.headings, found.rows, 1, "log-found"))
        self._notes.clear()
        with self._notes:
            for note in few(found.notes):
                hint(note)
        self._result.set_visibility(True)

    def _use(self) -> None:
        if self._found is not None:
            self._session.take(self._found.drive)
            notify(f"{clipped(self._found.drive.name)}, as identified, is loaded.")

    def _save(self) -> None:
        if self._found is not None:
            save(self._found.drive.to_toml(), "identified-drive.toml")
