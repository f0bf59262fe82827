"""Start positions, limits and life of all strategies, and the quickest start within limits."""

from __future__ import annotations

from collections.abc import Hashable

from nicegui import ui

from softstart.errors import InputError
from softstart.page import tasks
from softstart.page.jobs import Jobs
from softstart.page.panel_parts import (
    POLL,
    JobView,
    StaleNote,
    action,
    box,
    few,
    guarded,
    hint,
    jobs_of,
    table,
)
from softstart.page.session import Session


class ChecksPanel:
    """A button, progress and tables; built in the current slot."""

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self._session = session
        with box().classes("panel-form"):
            self._go = action("Compute", self._begin, "checks-go", main=True)
        self._hint = hint(
            "K_dyn of each strategy from both flanks and the middle of the gaps, margins to the limits, life "
            "beside that under direct, and the quickest start that keeps the limits."
        )
        self._view = JobView(jobs or jobs_of(user), user, "checks", on_done=self._done, on_state=self._state)
        with box().classes("panel-result") as self._result:
            self._stale = StaleNote(session, "checks")
            self._tables = box().classes("w-full")
            self._use = action("Add the quickest start to the strategies", guarded(self._add), "checks-use")
        self._result.set_visibility(False)
        self._found: tasks.Checked | None = None
        ui.timer(POLL, self._stale.refresh)

    def _begin(self) -> None:
        if self._view.busy:
            return
        session = self._session
        self._view.begin(
            "positions, limits and life", tasks.checked, session.machine, dict(session.controllers),
            subject=session.machine,
        )  # fmt: skip

    def _state(self) -> None:
        self._view.settle(self._go, self._result)

    def _done(self, found: tasks.Checked) -> None:
        self._found = found
        self._tables.clear()
        with self._tables:
            for part in found.parts:
                ui.html(part.title, tag="h3", sanitize=False).classes("panel-title")
                if part.rows:
                    text = table(part.headings, part.rows, 1, f"checks-{part.name}")
                    shown = ui.html(text, sanitize=False).classes("panel-scroll w-full")
                    shown.props(f'tabindex=0 role=group aria-label="{part.title}"')
                for sentence in few(part.sentences):
                    hint(sentence)
        self._use.set_visibility(found.quickest is not None)
        self._result.set_visibility(True)
        self._hint.set_visibility(False)
        self._stale.show_for(self._view.subject)

    def _add(self) -> None:
        best = None if self._found is None else self._found.quickest
        if best is None:
            raise InputError("There is no quickest start to add; give limits, and compute again.")
        self._stale.check()
        self._session.add(f"quickest {best.end_time:.4g} s", tasks.player_of(best), select=False)
