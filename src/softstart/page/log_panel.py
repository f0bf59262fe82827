"""The drive from a log: a file of an inverter is identified beside the drive, which is the guess."""

from __future__ import annotations

import weakref
from collections.abc import Hashable
from typing import TYPE_CHECKING

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
)
from softstart.page.sentences import clipped, sentence_of
from softstart.page.session import Session

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

LARGEST = 1_000_000  # bytes of a log; a request may have little more


class LogPanel:
    """Upload of a log, what is found with its intervals, and the drive found; built in the current slot."""

    def __init__(self, session: Session, user: Hashable) -> None:
        self._session = session
        self._found: tasks.Identified | None = None
        hint(
            "A CSV file with time, torque, and angle or speed of the motor, units in its first line, from "
            "standstill. The drive of this page is the guess, by a factor of 3 if need be; it stays as it is "
            "until you use the drive found."
        )
        with box().classes("panel-form"):
            kinds = {"demand": "a demand", "measured": "measured"}
            self._torque_is = choice("The torque is", kinds, "demand", "log-torque-is")
            self._columns = field(
                "Columns, if they are named otherwise", "", "log-columns", "torque=M, speed=n[rpm]"
            )
            own = weakref.ref(self)  # the route of an upload outlives its tab, and must not keep its session

            async def uploaded(event: UploadEventArguments) -> None:
                if (panel := own()) is not None:
                    await panel._uploaded(event)

            def rejected() -> None:
                if (panel := own()) is not None:
                    panel._view.refuse(InputError(TOO_LARGE))

            self._upload = ui.upload(
                on_upload=uploaded, on_rejected=rejected, max_file_size=LARGEST, auto_upload=True
            ).classes("panel-upload")
            self._upload.props('accept=".csv,text/csv,text/plain" data-testid="log-upload"')
            self._pick = action("Load a log ...", lambda: None, "log-load", main=True)
            self._pick.on("click", js_handler=f"() => getElement({self._upload.id}).pickFiles()")
        self._view = JobView(jobs_of(user), user, "log", on_done=self._done, on_state=self._state)
        with box() as self._result:
            self._table = ui.html("", sanitize=False)
            self._notes = box().classes("panel-form")
            with box().classes("panel-actions"):
                action("Use this drive", guarded(self._use), "log-use", main=True)
                action("Save drive as TOML", guarded(self._save), "log-save")
        self._result.set_visibility(False)

    async def _uploaded(self, event: UploadEventArguments) -> None:
        name = event.file.name
        large = event.file.size() > LARGEST
        content = b"" if large else await event.file.read()
        self._upload.reset()
        try:
            if large:
                raise InputError(TOO_LARGE)
            columns = tasks.columns_of(str(self._columns.value or ""))
        except Exception as error:
            self._view.refuse(error if isinstance(error, InputError) else InputError(sentence_of(error)))
            return
        self._result.set_visibility(False)
        self._view.begin(
            f"drive from {clipped(name)}", tasks.identified, content, name, self._session.drive,
            str(self._torque_is.value), columns,
        )  # fmt: skip

    def _state(self) -> None:
        self._view.settle(self._pick, self._result)

    def _done(self, found: tasks.Identified) -> None:
        self._found = found
        self._table.set_content(table(found.headings, found.rows, 2, "log-found"))
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


TOO_LARGE = f"It has more than {LARGEST // 1000} kB; cut the log to the start, or use softstart identify."
