"""The optimal start: asked for a start time, computed in the background, put among the strategies."""

from __future__ import annotations

from collections.abc import Hashable
from functools import partial
from typing import TYPE_CHECKING, cast

from nicegui import ui

from softstart.errors import InputError
from softstart.optimal.problem import REACTS, StartTime
from softstart.page import tasks
from softstart.page.downloads import file_name
from softstart.page.jobs import Jobs
from softstart.page.panel_parts import (
    POLL,
    TERMINALS,
    JobView,
    StaleNote,
    action,
    box,
    choice,
    facts,
    field,
    guarded,
    hint,
    jobs_of,
    number,
    percent,
    save,
)
from softstart.page.session import Session
from softstart.start.comparison import REFERENCE

if TYPE_CHECKING:
    from softstart.optimal.problem import Terminal
    from softstart.optimal.result import Optimum


class OptimumPanel:
    """Form, progress and result; built in the current slot."""

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self._session = session
        self._found: tasks.Gentlest | None = None
        with box().classes("panel-form"):
            self._time = field(
                "Start time", "1.2x", "optimum-time", "0.3 (s), 300 ms, or 1.2x: that of direct times 1.2"
            ).classes("panel-narrow")
            self._end = choice("At its end", TERMINALS, "reached", "optimum-terminal")
            self._go = action("Compute", self._begin, "optimum-go", main=True)
            self._time.on("keydown.enter", self._begin)
        self._hint = hint(
            "The torque over time with the lowest K_dyn, and a bound that no start can go below. Where "
            "the start position is unknown it is the best fixed profile for all, and feedback can be lower."
        )
        self._view = JobView(jobs or jobs_of(user), user, "optimum", on_done=self._done, on_state=self._state)
        with box().classes("panel-result") as self._result:
            self._stale = StaleNote(session, "optimum")
            self._figures = ui.html("", sanitize=False).classes("w-full")
            self._sentence = ui.label().classes("panel-sentence").props('data-testid="optimum-sentence"')
            self._why = ui.label().classes("panel-hint")
            self._use = action("Add to the strategies", guarded(self._add), "optimum-use")
            with box().classes("panel-actions"):
                ui.label("Torque profile").classes("panel-caption")
                for suffix in (".csv", ".toml", ".c"):
                    text = suffix[1:].upper()
                    action(text, guarded(partial(self._save, suffix)), f"optimum-{suffix[1:]}")
        self._result.set_visibility(False)
        ui.timer(POLL, self._stale.refresh)

    def _begin(self) -> None:
        if self._view.busy:  # the Enter key is heard while the button is not
            return
        text = str(self._time.value).strip()
        try:
            StartTime.of(text, "Start time")
        except InputError as error:
            self._view.refuse(error)
            return
        drive = self._session.machine
        terminal = cast("Terminal", self._end.value)
        self._view.begin("optimal start", tasks.gentlest, drive, text, terminal, subject=drive)

    def _state(self) -> None:
        self._view.settle(self._go, self._result)

    def _done(self, found: tasks.Gentlest) -> None:
        self._found = found
        self._figures.set_content(facts(figures(found.best), "optimum-figures"))
        self._why.set_text(f"Method {found.best.method}: {found.best.why}. {found.bound}")
        self._result.set_visibility(True)
        self._stale.show_for(self._view.subject)
        self._hint.set_visibility(False)
        self._use.set_visibility(not self._view.mine)
        if self._view.mine:
            self._add()
        else:
            self._sentence.set_text("It was computed in another tab, or before this page was loaded anew.")

    def _add(self) -> None:
        """Let the optimum join the strategies."""
        found = self._found
        assert found is not None
        self._use.set_visibility(False)
        try:
            self._stale.check()
            self._session.add(tasks.label_of(found.best), tasks.player_of(found.best), select=False)
        except InputError as error:
            self._sentence.set_text(" ".join(error.sentences))
        else:
            self._sentence.set_text(self._beside(found.best))

    def _beside(self, best: Optimum) -> str:
        """What it is worth, against the constant torque."""
        text = f"It is among the strategies: {tasks.label_of(best)}."
        text += f" {REACTS}" if len(best.problem.drive.positions) > 1 else ""
        if self._stale.stale or REFERENCE not in self._session.controllers:
            return text
        direct = self._session.result(REFERENCE)
        if direct.run is None:
            return text
        return f"{text} Direct has {direct.k_dyn:.4g} in {direct.start_time:.4g} s."

    def _save(self, suffix: str) -> None:
        assert self._found is not None
        name = file_name(tasks.label_of(self._found.best), suffix=suffix)
        save(self._found.files[suffix], name)


def figures(best: Optimum) -> list[tuple[str, str]]:
    """The figures of an optimum as they are shown."""
    known = best.bound.kind != "none"
    return [
        ("K_dyn", number(best.k_dyn)),
        ("lower bound", number(best.bound.k_dyn) if known else number(None)),
        ("above it by", percent(best.gap_percent if known else None)),
        ("start time", f"{number(best.end_time)} s"),
        ("peak torque", f"{number(best.run.peak_torque)} N m"),
        ("contacts", str(best.run.contacts)),
    ]
