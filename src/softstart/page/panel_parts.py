"""What the panels share: fields, buttons, a job and its progress, and a form whose answer a job computes."""

from __future__ import annotations

import html
from collections.abc import Callable, Hashable, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, ClassVar
from weakref import WeakMethod

from nicegui import app, context, ui

from softstart.controller.base import Controller
from softstart.drive.machine import Machine
from softstart.errors import MORE_MISTAKES, InputError
from softstart.page.jobs import Job, Jobs, JobState
from softstart.page.sentences import changed_since, clipped, page_sentence, sentence_of
from softstart.page.session import Session

if TYPE_CHECKING:
    from nicegui.events import UiEventArguments, UploadEventArguments

    from softstart.page.tasks import TaskResult

POLL = 0.2  # s between two checks of a job
MOST_SENTENCES = 12  # about one input; whoever has mended these sees the next ones
# what tasks import, in a process that waits for one
IMPORTED = (
    "softstart.page.tasks",
    "softstart.optimal.front",
    "softstart.tuning.solving",
    "matplotlib.figure",
)
TERMINALS = {
    "synchronous": "both masses at target speed",
    "reached": "load at target speed",
    "steady": "both, and shaft torque at rest",
}
ENLARGE = """(event) => {
  const figure = event.target.closest("figure");
  if (!figure || (event.type === "keydown" && !["Enter", "Escape"].includes(event.key))) return;
  figure.classList.toggle("large", event.key !== "Escape" && !figure.classList.contains("large"));
}"""
MEDIA = {".csv": "text/csv", ".toml": "application/toml", ".c": "text/x-csrc", ".html": "text/html"}


def box(classes: str) -> Any:
    """A plain box; its class says how it lays out what is in it."""
    return ui.element("div").classes(classes)


def text_field(label: str, value: str, name: str, example: str = "") -> Any:
    """A text field below its label."""
    with box("panel-field"):
        ui.label(label)
        made = ui.input(value=value).props(f'dense outlined aria-label="{label}" data-testid="{name}"')
        return made.tooltip(example) if example else made


def choice(label: str, options: dict[str, str] | list[str], value: str, name: str) -> Any:
    """A choice of one of several, below its label."""
    with box("panel-field"):
        ui.label(label)
        made = ui.select(options, value=value)
        return made.props(f'dense outlined options-dense aria-label="{label}" data-testid="{name}"')


def action(text: str, act: Callable[[], Any], name: str, main: bool = False) -> Any:
    """A button; the main one of a panel stands out. What goes wrong is said in sentences."""

    def acting() -> None:
        try:
            act()
        except Exception as error:  # nobody who uses the page sees a traceback
            sentences = error.sentences if isinstance(error, InputError) else (sentence_of(error),)
            for sentence in few(sentences):
                ui.notify(sentence, type="negative", position="bottom-left", multi_line=True, timeout=8000)

    made = ui.button(text, on_click=acting, color=None).props(
        f'dense no-caps {"unelevated" if main else "flat"} data-testid="{name}"'
    )
    return made.classes("panel-main" if main else "panel-action")


def upload(
    text: str,
    name: str,
    media: str,
    largest: int,
    remedy: str,
    take: Callable[[bytes, str], None],
    refuse: Callable[[str, InputError], None],
) -> Any:
    """A button that hands the file a user chooses to the method `take(content, name)`.

    The method `refuse(name, error)` is called where `take` raises, and, with the remedy, for a file of
    more than `largest` bytes.
    """
    # the route of an upload outlives its tab, and must not keep its session
    taking, refusing = WeakMethod(take), WeakMethod(refuse)

    def refused(file: str, error: Exception) -> None:
        if (method := refusing()) is not None:
            method(file, error if isinstance(error, InputError) else InputError(sentence_of(error)))

    too_large = InputError(f"It has more than {largest // 1024} kB; {remedy}.")

    def rejected(event: UiEventArguments) -> None:
        event.sender.reset()  # type: ignore[attr-defined]
        refused("The file", too_large)

    async def uploaded(event: UploadEventArguments) -> None:
        file = event.file.name
        large = event.file.size() > largest  # the browser refuses that itself; others may ask
        content = b"" if large else await event.file.read()
        event.sender.reset()  # type: ignore[attr-defined]
        if (method := taking()) is None:
            return
        try:
            if large:
                raise too_large
            method(content, file)
        except Exception as error:  # a file may hold anything
            refused(file, error)

    chooser = ui.upload(on_upload=uploaded, on_rejected=rejected, max_file_size=largest, auto_upload=True)
    chooser.classes("panel-upload").props(f'accept="{media},text/plain" data-testid="{name}-upload"')
    made = action(text, lambda: None, f"{name}-load", main=True)
    return made.on("click", js_handler=f"() => getElement({chooser.id}).pickFiles()")


def hint(text: str) -> Any:
    """A quiet sentence that says what a panel is for."""
    written = html.escape(text).replace("K_dyn", "K<sub>dyn</sub>")
    return ui.html(written, sanitize=False).classes("panel-hint")


def save(text: str, name: str) -> None:
    """Let the browser save a text as a file."""
    suffix = name[name.rindex(".") :]
    ui.download.content(text, name, f"{MEDIA.get(suffix, 'text/page_sentence')}; charset=utf-8")


def few(sentences: Sequence[str]) -> list[str]:
    """The first sentences, without words of the command line, and how many there are beside them.

    >>> few(["a.", "b."]), few([f"{k}." for k in range(20_000)])[-2:]
    (['a.', 'b.'], ['11.', 'There are 19,988 more of them.'])
    """
    left = len(sentences) - MOST_SENTENCES
    if left > 0 and (rest := MORE_MISTAKES.fullmatch(sentences[-1])):  # an InputError counts some itself
        left += int(rest[1]) - 1
    return [
        *map(page_sentence, sentences[:MOST_SENTENCES]),
        *([f"There are {left:,} more of them."] if left > 0 else []),
    ]


class Troubles:
    """A box for sentences about what is wrong, empty and hidden at first; built in the current slot."""

    def __init__(self, name: str) -> None:
        self._box = box("troubles").props(f'role=alert data-testid="{name}-trouble"')
        self._box.set_visibility(False)

    def say(self, sentences: Sequence[str], title: str = "") -> None:
        """Say these instead of what was said; nothing where there are none."""
        self._box.clear()
        self._box.set_visibility(bool(sentences))
        with self._box:
            if title:
                ui.label(title).classes("trouble-title")
            for sentence in few(sentences):
                ui.label(sentence).classes("trouble")


def reveal(part: Any, block: str = "start") -> None:
    """Scroll to a part of a panel once the browser has drawn it."""
    seen = f"getHtmlElement({part.id})?.scrollIntoView({{block: '{block}', behavior: 'smooth'}})"
    ui.timer(POLL, lambda: ui.run_javascript(seen), once=True)


def notify(sentence: str) -> None:
    """A short note at the edge of the page."""
    ui.notify(sentence, position="bottom-left", timeout=2500, classes="note")


class StaleNote:
    """Says for which drive a result is, once the session has another one; built in the current slot."""

    def __init__(self, session: Session, name: str) -> None:
        self._session = session
        self._drive: Machine | None = None
        self._seen = -1
        self._label = ui.label().classes("stale").props(f'role=status data-testid="{name}-stale"')
        self._label.set_visibility(False)
        ui.timer(POLL, self.refresh)

    def show_for(self, drive: Machine) -> None:
        """The result shown is of this drive."""
        self._drive, self._seen = drive, -1
        self.refresh()

    def refresh(self) -> None:
        """Compare again where the session has changed."""
        if self._drive is None or self._session.version == self._seen:
            return
        self._seen = self._session.version
        sentence = changed_since(self._drive, self._session.inputs.machine_in_units)
        self._label.set_text(sentence)
        self._label.set_visibility(bool(sentence))

    def check(self) -> None:
        """Refuse what was computed for another machine: it is none of this one's strategies."""
        now, drive = self._session.inputs.machine, self._drive
        if drive is not None and drive.name != now.name and (sentence := changed_since(drive, now)):
            raise InputError(f"{sentence[:-1]}: it is not added to the strategies.")


def duration(seconds: float) -> str:
    """A time span as people read it.

    >>> duration(0.42), duration(12.3), duration(75)
    ('0.4 s', '12 s', '1 min 15 s')
    """
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def state_of(job: Job) -> str:
    """The state of a job in a line."""
    if job.stopping:
        return "Stopping ..."
    if job.state is JobState.WAITING:
        return f"{JobState.WAITING.value} {job.ahead} before it." if job.ahead else JobState.WAITING.value
    if job.state is JobState.RUNNING:
        return f"Computing: {job.message or 'starting a process'}, {duration(job.seconds)}"
    if job.state is JobState.CANCELLED:
        return f"Cancelled after {duration(job.seconds)}." if job.seconds else JobState.CANCELLED.value
    return f"Done in {duration(job.seconds)}." if job.state is JobState.DONE else job.state.value


class JobView:
    """The one job of a panel, the same in all tabs of a user; built in the current slot.

    `on_done(result)` is called with its result, `on_state()` whenever the state has changed. `name` tells it
    from those of other panels, and marks the elements for tests.
    """

    def __init__(
        self,
        jobs: Jobs,
        user: Hashable,
        name: str,
        *,
        on_done: Callable[[Any], None],
        on_state: Callable[[], None] = lambda: None,
    ) -> None:
        self._jobs, self._user, self._name = jobs, user, name
        self._own: Job | None = None  # the one that was begun in this tab
        self._on_done, self._on_state = on_done, on_state
        self.job: Job | None = None
        self._seen = self._second = -1
        self._given = False  # its result was handed on
        with box("job") as self._box:
            self._line = ui.label().classes("job-line").props(
                f'role=status aria-live=polite data-testid="{name}-state"'
            )  # fmt: skip
            self._cancel = ui.button("Cancel", on_click=self.cancel, color=None)
            self._cancel.props(f'flat dense no-caps data-testid="{name}-cancel"').classes("job-cancel")
            self._bar = ui.linear_progress(0.0, show_value=False, size="3px", color=None).classes("job-bar")
            self._bar.props('instant-feedback aria-label="progress"')
        self._troubles = Troubles(name)
        self._box.set_visibility(False)
        ui.timer(POLL, self._refresh)

    @property
    def mine(self) -> bool:
        """Whether the job was begun in this tab."""
        return self.job is not None and self.job is self._own

    @property
    def subject(self) -> Any:
        """What the result is of."""
        return None if self.job is None else self.job.subject

    @property
    def failed(self) -> bool:
        """Whether the last job failed."""
        return self.job is not None and self.job.state is JobState.FAILED

    @property
    def busy(self) -> bool:
        """Whether a job waits or runs."""
        return self.job is not None and not self.job.state.over

    def begin(self, title: str, work: Callable[..., Any], *args: Any, subject: Any = None) -> None:
        """Put a job into the queue; refused input is shown as its sentences. `subject` stays with it."""
        if self.busy:
            return
        try:
            self._own = self._jobs.begin(self._user, title, work, *args)
        except InputError as error:
            self.refuse(error)
            return
        self._own.subject = subject
        self._jobs.show(self._user, self._name, self._own)
        self._refresh()

    def refuse(self, error: InputError) -> None:
        """Show why nothing was begun."""
        if not self.busy:
            self.job = None
            self._jobs.show(self._user, self._name, None)
            self._box.set_visibility(False)
        self._troubles.say(error.sentences)
        self._on_state()

    def cancel(self) -> None:
        """Stop the job."""
        if self.job is not None:
            self.job.cancel()
            self._refresh()

    def _refresh(self) -> None:
        job = self._jobs.shown(self._user, self._name)
        if job is None:
            return
        if job is not self.job:  # begun here or in another tab
            self.job, self._seen, self._given = job, -1, False
        # the job goes on in a thread of its own: each is read once, the count first, since it is raised last
        changes, state = job.changes, job.state
        second = -1 if state.over else int(job.seconds)
        if changes == self._seen and second == self._second and state is not JobState.WAITING:
            return
        news = changes != self._seen
        self._seen, self._second = changes, second
        self._line.set_text(state_of(job))
        if not news:
            return
        self._show(job, state)
        try:
            if state is JobState.DONE and not self._given:
                self._given = True
                self._on_done(job.result)
                if self.mine:
                    reveal(self._box)
        finally:
            self._on_state()

    def _show(self, job: Job, state: JobState) -> None:
        self._box.set_visibility(True)
        each = {one: f"job-{one.name.lower()}" for one in JobState}
        self._box.classes(
            add=each[state], remove=" ".join(text for one, text in each.items() if one is not state)
        )
        self._cancel.set_visibility(not state.over)
        self._cancel.set_enabled(not job.stopping)
        self._bar.set_visibility(not state.over)
        share = job.share if state is JobState.RUNNING else None
        self._bar.props(
            add="indeterminate" if share is None else "", remove="" if share is None else "indeterminate"
        )
        self._bar.set_value(share or 0.0)
        self._troubles.say(job.sentences)


class TaskPanel:
    """A form, a job, and its `softstart.page.tasks.TaskResult`; built in the current slot.

    A subclass builds its fields in `form` and says in `question` what is computed: a title, a function of
    `softstart.page.tasks`, and its arguments; InputError for a wrong field.
    """

    name: ClassVar[str]
    about: ClassVar[str]  # what the panel is for
    verb: ClassVar[str] = "Compute"  # on the button; without one the form has another way to begin
    joins: ClassVar[bool] = False  # what a tab has asked for is added to its strategies at once

    def __init__(self, session: Session, user: Hashable, jobs: Jobs | None = None) -> None:
        self.session = session
        self._found: TaskResult | None = None
        with box("panel-form"):
            self.form()
            if self.verb:
                self.go = action(self.verb, self.begin, f"{self.name}-go", main=True)
        self._hint = hint(self.about)
        self.view = JobView(jobs or jobs_of(user), user, self.name, on_done=self._done, on_state=self._state)
        with box("panel-result") as self._result:
            self._stale = StaleNote(session, self.name)
            self._buttons = box("panel-actions")
            self._shown = ui.html("", sanitize=False).classes("answer")
            self._shown.props(f'data-testid="{self.name}-answer" tabindex=0 role=group aria-label="Answer"')
            for event in ("click", "keydown"):
                self._shown.on(event, js_handler=ENLARGE)
        self._result.set_visibility(False)

    def form(self) -> None:
        """The fields of the panel."""

    def question(self) -> tuple[Any, ...]:
        """A title, a task, and its arguments."""
        raise NotImplementedError

    def begin(self) -> None:
        """Put what is asked for into the queue."""
        if self.view.busy:  # the Enter key is heard while the button is not
            return
        try:
            title, *work = self.question()
        except InputError as error:
            self.view.refuse(error)
        else:
            self.view.begin(title, *work, subject=self.session.inputs.machine)

    def _state(self) -> None:
        self.go.set_enabled(not self.view.busy)
        if self.view.failed or self.view.job is None:
            self._result.set_visibility(False)  # it answers another question

    def _done(self, found: TaskResult) -> None:
        self._found = found
        self._shown.set_content(found.html)
        self._hint.set_visibility(False)
        self._result.set_visibility(True)
        self._stale.show_for(self.view.subject)
        self._buttons.clear()
        with self._buttons:
            for label in found.controllers:
                button = action(f"Add {label}", partial(self.add, label), f"{self.name}-use")
                if self.joins and self.view.mine:
                    self.add(label)
                    button.set_visibility(False)
            if found.drive is not None:
                action("Use this drive", self._use, f"{self.name}-use", main=True)
            for file, text in found.files.items():
                action(file, partial(save, text, file), f"{self.name}-file").props(f'title="Save {file}"')

    def add(self, label: str) -> None:
        """Let a controller of the answer join the strategies."""
        controllers: dict[str, Controller] = dict(self._found.controllers) if self._found else {}
        self._stale.check()
        label = self.session.add(label, controllers[label], select=False)
        notify(f"{label} was added to the strategies.")

    def _use(self) -> None:
        if self._found is not None and self._found.drive is not None:
            self.session.load(self._found.drive)
            notify(f"{clipped(self._found.drive.name)} is loaded.")


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
