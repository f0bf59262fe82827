"""A job as the page shows it: what is being done, how far it is, a button to stop it, why it failed."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

from nicegui import ui

from softstart.errors import InputError
from softstart.page.jobs import Job, Jobs, State

LOOK = 0.2  # s between two looks at a job
CLASS_OF = {
    State.WAITING: "job-waiting",
    State.RUNNING: "job-running",
    State.DONE: "job-done",
    State.CANCELLED: "job-cancelled",
    State.FAILED: "job-failed",
}


def duration(seconds: float) -> str:
    """A time span as people read it.

    >>> duration(0.42), duration(12.3), duration(75)
    ('0.4 s', '12 s', '1 min 15 s')
    """
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def told(job: Job) -> str:
    """The state of a job in a line."""
    if job.stopping:
        return "Stopping ..."
    if job.state is State.WAITING:
        return f"{State.WAITING.value} {job.ahead} before it." if job.ahead else State.WAITING.value
    if job.state is State.RUNNING:
        return f"Computing: {job.message or 'starting a process'}, {duration(job.seconds)}"
    if job.state is State.CANCELLED:
        return f"Cancelled after {duration(job.seconds)}." if job.seconds else State.CANCELLED.value
    return (
        f"{job.state.value[:-1]} in {duration(job.seconds)}." if job.state is State.DONE else job.state.value
    )


class JobView:
    """The one job of a panel; built in the current slot.

    `on_part(value)` is called for each part of the result, `on_done(result)` for the whole; `on_state()`
    whenever the state has changed. `name` marks the elements for those who look for them.
    """

    def __init__(
        self,
        jobs: Jobs,
        user: Hashable,
        name: str,
        *,
        on_done: Callable[[Any], None],
        on_part: Callable[[Any], None] = lambda part: None,
        on_state: Callable[[], None] = lambda: None,
    ) -> None:
        self._jobs, self._user = jobs, user
        self._on_done, self._on_part, self._on_state = on_done, on_part, on_state
        self.job: Job | None = None
        self._seen = self._parts = -1
        self._second = -1
        self._given = False  # its result was handed on
        with ui.element("div").classes("job") as self._box:
            self._line = ui.label().classes("job-line").props(
                f'role=status aria-live=polite data-testid="{name}-state"'
            )  # fmt: skip
            self._cancel = ui.button("Cancel", on_click=self.cancel, color=None)
            self._cancel.props(f'flat dense no-caps data-testid="{name}-cancel"').classes("job-cancel")
            self._bar = ui.linear_progress(0.0, show_value=False, size="3px", color=None).classes("job-bar")
            self._bar.props('instant-feedback aria-label="progress"')
        self._troubles = (
            ui.element("div").classes("troubles").props(f'role=alert data-testid="{name}-trouble"')
        )
        self._box.set_visibility(False)
        self._troubles.set_visibility(False)
        ui.timer(LOOK, self._look)

    @property
    def failed(self) -> bool:
        """Whether the last job failed."""
        return self.job is not None and self.job.state is State.FAILED

    @property
    def busy(self) -> bool:
        """Whether a job waits or runs."""
        return self.job is not None and not self.job.state.over

    def begin(self, title: str, work: Callable[..., Any], *args: Any, **keywords: Any) -> None:
        """Put a job into the queue; refused input is shown as its sentences."""
        if self.busy:
            return
        try:
            self.job = self._jobs.begin(self._user, title, work, *args, **keywords)
        except InputError as error:
            self.refuse(error)
            return
        self._seen, self._parts, self._given = -1, 0, False
        self._look()

    def refuse(self, error: InputError) -> None:
        """Show why nothing was begun."""
        self.job = None
        self._box.set_visibility(False)
        self._say(error.sentences)
        self._on_state()

    def cancel(self) -> None:
        """Stop the job."""
        if self.job is not None:
            self.job.cancel()
            self._look()

    def settle(self, go: Any, result: Any) -> None:
        """Let a button begin no second job, and hide a result that answers another question."""
        go.set_enabled(not self.busy)
        if self.failed:
            result.set_visibility(False)

    def _look(self) -> None:
        job = self.job
        if job is None:
            return
        # the job goes on in a thread of its own: each is read once, the count first, since it is raised last
        changes, state = job.changes, job.state
        second = -1 if state.over else int(job.seconds)
        if changes == self._seen and second == self._second and state is not State.WAITING:
            return
        news = changes != self._seen
        self._seen, self._second = changes, second
        self._line.set_text(told(job))
        if not news:
            return
        while self._parts < len(job.parts):
            self._parts += 1
            self._on_part(job.parts[self._parts - 1])
        self._show(job, state)
        try:
            if state is State.DONE and not self._given:
                self._given = True
                self._on_done(job.result)
        finally:
            self._on_state()

    def _show(self, job: Job, state: State) -> None:
        over = state.over
        self._box.set_visibility(True)
        self._box.classes(add=CLASS_OF[state], remove=" ".join(CLASS_OF[s] for s in State if s is not state))
        self._cancel.set_visibility(not over)
        self._cancel.set_enabled(not job.stopping)
        self._bar.set_visibility(not over)
        share = job.share if state is State.RUNNING else None
        self._bar.props(
            add="indeterminate" if share is None else "", remove="" if share is None else "indeterminate"
        )
        self._bar.set_value(share or 0.0)
        self._say(job.sentences)

    def _say(self, sentences: tuple[str, ...]) -> None:
        self._troubles.clear()
        self._troubles.set_visibility(bool(sentences))
        with self._troubles:
            for sentence in sentences:
                ui.label(sentence).classes("trouble")
