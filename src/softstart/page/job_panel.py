"""The panel of a computation in the background: form, start, progress, cancel and result, for all tabs."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Hashable
from contextlib import suppress
from functools import cache, partial
from typing import TYPE_CHECKING, Any, ClassVar

from nicegui import app, context, ui

from softstart.errors import InputError
from softstart.page.jobs import Job, Jobs, JobState
from softstart.page.panel_parts import POLL, Troubles, action, box, copying, hint, notify, reveal, save
from softstart.page.sentences import changed_since
from softstart.page.session import ClaimedOptimum, Session
from softstart.views.numbers import cut

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.page.tasks import TaskResult

# what tasks import, in a process that waits for one
IMPORTED = (
    "softstart.page.tasks",
    "softstart.optimal.front",
    "softstart.tuning.solving",
    "matplotlib.figure",
)
ENLARGE = """(event) => {
  const figure = event.target.closest("figure");
  if (!figure || (event.type === "keydown" && !["Enter", "Escape"].includes(event.key))) return;
  figure.classList.toggle("large", event.key !== "Escape" && !figure.classList.contains("large"));
}"""

Task = tuple[Any, ...]  # a function of `softstart.page.tasks`, and its arguments


def duration(seconds: float) -> str:
    """A time span as people read it.

    >>> duration(0.42), duration(3.0), duration(12.3), duration(75)
    ('0.4 s', '3 s', '12 s', '1 min 15 s')
    """
    if seconds < 9.95:
        return f"{round(seconds, 1):g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def starts_seconds(machine: Machine) -> float:
    """All strategies from each start position: 0.3 to 0.7 s of two masses, 7 s of a chain of 15."""
    return 0.3 * max(len(machine.shaft_names), len(machine.positions))


def rounded(seconds: float) -> str:
    """A time that is known roughly.

    >>> rounded(0.2), rounded(12.7), rounded(93.0), rounded(260.0)
    ('1 s', '13 s', '1 min 30 s', '4 min')
    """
    step = next(
        step for most, step in ((20.0, 1.0), (60.0, 5.0), (180.0, 30.0), (math.inf, 60.0)) if seconds < most
    )
    return duration(max(round(seconds / step), 1) * step).removesuffix(" 0 s")


def state_of(job: Job, state: JobState) -> str:
    """The state of a job in a line."""
    if job.stopping:
        return "Stopping ..."
    if state is JobState.WAITING:
        return f"{state.value} {job.ahead} before it." if job.ahead else state.value
    if state is JobState.RUNNING:  # in whole seconds: screen readers speak each change
        return f"Computing: {job.message or 'starting a process'}, {duration(math.floor(job.seconds))}"
    if state is JobState.CANCELLED and job.seconds:
        return f"Cancelled after {duration(job.seconds)}."
    return f"Done in {duration(job.seconds)}." if state is JobState.DONE else state.value


class JobPanel(ABC):
    """A form, the one job that it starts, and its result, the same in all tabs of a user.

    A subclass builds its fields in `form` and says in `task` what is computed; InputError for a wrong field.
    The panel is built in the current slot.
    """

    name: ClassVar[str]  # tells it from other panels, and marks its elements for tests
    about: ClassVar[str]  # what the panel is for
    verb: ClassVar[str] = "Compute"  # on the button; without one the form has another way to start
    # in the tab that has started the job, as soon as it is done: are its controllers added, its files saved
    adds: ClassVar[bool] = False
    saves: ClassVar[bool] = False
    # the quickest and the slowest job on shipped machines, times the estimate; of a processor that is free
    spread: ClassVar[tuple[float, float]] = (1.0, 2.0)
    # by panel: how much longer than estimated the last job took on this server
    took: ClassVar[dict[str, float]] = {}

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self.session, self._user, self._jobs = session, user, jobs or jobs_of(user)
        self.job: Job | None = None
        self._started: Job | None = None  # in this tab
        self._result: TaskResult | None = None
        self._compared = -1  # version of the session with which the result was compared
        with box("panel-form"):
            self.form()
            if self.verb:
                self.go = action(self.verb, self.start, f"{self.name}-go", main=True)
        self._hint = hint(self.about)
        self._takes = ui.label().classes("panel-hint").props(f'data-testid="{self.name}-takes"')
        with box("job") as self._box:
            self._line = ui.label().classes("job-line")
            self._line.props(f'role=status aria-live=polite data-testid="{self.name}-state"')
            self._cancel = ui.button("Cancel", on_click=self.cancel, color=None).classes("job-cancel")
            self._cancel.props(f'flat dense no-caps data-testid="{self.name}-cancel"')
            self._bar = ui.linear_progress(0.0, show_value=False, size="3px", color=None).classes("job-bar")
            self._bar.props('instant-feedback aria-label="progress"')
        self._troubles = Troubles(self.name)
        with box("panel-result") as self._result_box:
            self._stale = ui.label().classes("stale").props(f'role=status data-testid="{self.name}-stale"')
            self._buttons = box("panel-actions")
            self._answer = ui.html("", sanitize=False).classes("answer")
            self._answer.props(f'data-testid="{self.name}-answer" tabindex=0 role=group aria-label="Answer"')
            for event in ("click", "keydown"):
                self._answer.on(event, js_handler=ENLARGE)
        for hidden in (self._box, self._result_box, self._stale):
            hidden.set_visibility(False)
        ui.timer(POLL, self.refresh)

    def form(self) -> None:  # noqa: B027  # a panel may have no fields
        """The fields of the panel."""

    @abstractmethod
    def task(self) -> Task:
        """What is computed."""

    @abstractmethod
    def estimate(self) -> float:
        """The median of its seconds on shipped machines; InputError for a wrong field."""

    @property
    def mine(self) -> bool:
        """Whether the job was started in this tab."""
        return self.job is not None and self.job is self._started

    @property
    def busy(self) -> bool:
        """Whether a job waits or runs."""
        return self.job is not None and not self.job.state.over

    def start(self) -> None:
        """Put the task into the queue; a wrong field is shown as its sentences."""
        if self.busy:  # the Enter key works while the button is disabled
            return
        try:
            function, *arguments = self.task()
            self._started = self._jobs.begin(self._user, self.name, function, *arguments)
        except InputError as error:
            self.refuse(error)
            return
        self._started.machine, self._started.estimate = self.session.inputs.machine, self.estimate()
        self._jobs.show(self._user, self.name, self._started)
        self.refresh()

    def takes(self) -> str:
        """How long it takes: as the last job of this kind on this server; "" for wrong fields."""
        with suppress(InputError):
            known = (ratio,) if (ratio := self.took.get(self.name)) else self.spread
            ends = dict.fromkeys(rounded(self.estimate() * ratio) for ratio in known)
            between = " to ".join(ends) if len(ends) > 1 else f"about {next(iter(ends))}"
            return f"Takes {between}; can be cancelled."
        return ""

    def refuse(self, error: InputError) -> None:
        """Show why nothing was started."""
        if not self.busy:
            self.job = None
            self._jobs.show(self._user, self.name, None)
            self._box.set_visibility(False)
            self._result_box.set_visibility(False)  # it answers another question
        self._troubles.say([re.sub(r'^([A-Z][a-z ]+) = "', r'\1 "', one) for one in error.sentences])

    def cancel(self) -> None:
        """Stop the job."""
        if self.job is not None:
            self.job.cancel()
            self.refresh()

    def refresh(self) -> None:
        """Show the state of the job, its result once it is there, and whether that is of another machine."""
        job = self._jobs.shown(self._user, self.name)
        self._takes.set_text("" if job is not None and not job.state.over else self.takes())
        if job is None:
            return
        if job is not self.job:  # started here or in another tab
            self.job, self._result = job, None
            self._troubles.say(())
        state = job.state  # read once: the job goes on in a thread of its own
        self._box.set_visibility(True)
        self._box.classes(replace=f"job job-{state.name.lower()}")
        self._line.set_text(state_of(job, state))
        self._cancel.set_visibility(not state.over)
        self._cancel.set_enabled(not job.stopping)
        share = job.share if state is JobState.RUNNING else None
        self._bar.set_visibility(not state.over)
        self._bar.props("indeterminate") if share is None else self._bar.props(remove="indeterminate")
        self._bar.set_value(share or 0.0)
        if state.over:
            self._troubles.say(job.sentences)
        self.go.set_enabled(state.over)
        if state is JobState.FAILED:
            self._result_box.set_visibility(False)
        if state is JobState.DONE and self._result is None:
            self._result = job.result
            self.took[self.name] = job.seconds / job.estimate
            self.show(job.result)
        self._compare(job)

    def show(self, result: TaskResult) -> None:
        """Show a result, with buttons for what can be taken over from it."""
        self._answer.set_content(result.html)
        self._answer.set_visibility(bool(result.html))
        self._hint.set_visibility(not result.html)
        self._result_box.set_visibility(True)
        self._compared = -1
        self._buttons.clear()
        with self._buttons:
            if result.copy:
                copying(result.copy, f"{self.name}-copy")
            for file, text in result.files.items():
                action(file, partial(save, text, file), f"{self.name}-file").props(f'title="Save {file}"')
                if self.saves and self.mine:
                    save(text, file)
            if result.drive is not None:
                action("Use this drive", self._use, f"{self.name}-use", main=True)
            for label in result.controllers:
                button = action(f"Add {label}", partial(self.add, label), f"{self.name}-use")
                if self.adds and self.mine:
                    self.add(label)
                    button.set_visibility(False)
        if self.mine:
            reveal(self._box)

    def _compare(self, job: Job) -> None:
        """Say for which machine a result is, once the session has another one."""
        if self._result is None or job.machine is None or self.session.version == self._compared:
            return
        self._compared = self.session.version
        sentence = changed_since(job.machine, self.session.inputs.machine_in_units)
        self._stale.set_text(sentence)
        self._stale.set_visibility(bool(sentence))

    def add(self, label: str) -> None:
        """Add a controller of the result to the strategies, unless it was computed for another machine."""
        if self.job is None or self.job.machine is None or self._result is None:
            return
        now, computed = self.session.inputs.machine, self.job.machine
        if computed.name != now.name and (sentence := changed_since(computed, now)):
            raise InputError(f"{sentence[:-1]}: it is not added to the strategies.")
        claims = self._result.optima.get(label)
        optimum = None if claims is None else ClaimedOptimum(computed, claims)
        label = self.session.add(label, self._result.controllers[label], select=False, optimum=optimum)
        notify(f"{label} was added to the strategies.")

    def _use(self) -> None:
        if self._result is not None and self._result.drive is not None:
            self.session.load(self._result.drive)
            notify(f"{cut(self._result.drive.name)} is loaded.")


def jobs_of(user: Hashable) -> Jobs:
    """The jobs of the server; those of `user` end when the last tab has gone, of which this client is one."""
    jobs, tab = server_jobs(), context.client.id
    jobs.warm()
    jobs.enter(user, tab)
    context.client.on_delete(lambda: jobs.leave(user, tab))
    return jobs


@cache
def server_jobs() -> Jobs:
    """The jobs of all users of this server; they end with it."""
    jobs = Jobs(modules=IMPORTED)

    def end() -> None:  # without a parameter: for one, NiceGUI would hand itself over
        jobs.end()

    app.on_shutdown(end)
    return jobs
