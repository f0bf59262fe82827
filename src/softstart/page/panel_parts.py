"""What the panels share: fields, tables, buttons to save a file, a job and its progress, the note on an
earlier drive.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any
from weakref import WeakMethod

from nicegui import app, context, ui

from softstart.chain.machines import Machine
from softstart.errors import MORE_MISTAKES, InputError
from softstart.page.jobs import Job, Jobs, State
from softstart.page.sentences import changed_since, plain, sentence_of
from softstart.page.session import Session
from softstart.views.numbers import DASH as NOTHING

if TYPE_CHECKING:
    from nicegui.events import UiEventArguments, UploadEventArguments

POLL = 0.2  # s between two checks of a job
MOST_SENTENCES = 12  # about one input; whoever has mended these sees the next ones
CLASS_OF = {
    State.WAITING: "job-waiting",
    State.RUNNING: "job-running",
    State.DONE: "job-done",
    State.CANCELLED: "job-cancelled",
    State.FAILED: "job-failed",
}
# what tasks import, in a process that waits for one
IMPORTED = ("softstart.page.tasks", "softstart.optimal.front", "softstart.tuning.solving", "scipy.optimize")
TERMINALS = {
    "synchronous": "both masses at target speed",
    "reached": "load at target speed",
    "steady": "both, and shaft torque at rest",
}
MEDIA = {".csv": "text/csv", ".toml": "application/toml", ".c": "text/x-csrc", ".html": "text/html"}


def box() -> Any:
    """A plain box; its class says how it lays out what is in it."""
    return ui.element("div")


def field(label: str, value: str, name: str, example: str = "") -> Any:
    """A text field below its label."""
    with _labelled(label):
        made = ui.input(value=value).props(f'dense outlined aria-label="{label}" data-testid="{name}"')
        if example:
            made.tooltip(example)
    return made


def choice(label: str, options: dict[str, str] | list[str], value: str, name: str) -> Any:
    """A choice of one of several, below its label."""
    with _labelled(label):
        made = ui.select(options, value=value)
        made.props(f'dense outlined options-dense aria-label="{label}" data-testid="{name}"')
    return made


def _labelled(label: str) -> Any:
    with box().classes("panel-field") as made:
        ui.label(label)
    return made


def action(text: str, act: Callable[[], Any], name: str, main: bool = False) -> Any:
    """A button; the main one of a panel stands out."""
    made = ui.button(text, on_click=act, color=None).props(
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


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits.

    >>> number(0.90924724), number(None), number(float("nan")), number(48.0628, 3)
    ('0.9092', '\N{EN DASH}', '\N{EN DASH}', '48.1')
    """
    return NOTHING if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def percent(value: float | None) -> str:
    """A small share in per cent, already multiplied by 100.

    >>> percent(9.78e-8), percent(0.095), percent(12.0)
    ('< 0.001 %', '0.095 %', '12 %')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    return "< 0.001 %" if abs(value) < 1e-3 else f"{value:.2g} %"


def symbols(text: str) -> str:
    """A text as HTML, symbols as they are printed.

    >>> symbols("K_dyn < 1")
    'K<sub>dyn</sub> &lt; 1'
    """
    return html.escape(text).replace("K_dyn", "K<sub>dyn</sub>")


def hint(text: str) -> Any:
    """A quiet sentence that says what a panel is for."""
    return ui.html(symbols(text), sanitize=False).classes("panel-hint")


def save(text: str, name: str) -> None:
    """Let the browser save a text as a file."""
    suffix = name[name.rindex(".") :]
    ui.download.content(text, name, f"{MEDIA.get(suffix, 'text/plain')}; charset=utf-8")


def few(sentences: Sequence[str]) -> list[str]:
    """The first sentences, without words of the command line, and how many there are beside them.

    >>> few(["a.", "b."]), few([f"{k}." for k in range(20_000)])[-2:]
    (['a.', 'b.'], ['11.', 'There are 19,988 more of them.'])
    """
    left = len(sentences) - MOST_SENTENCES
    if left > 0 and (rest := MORE_MISTAKES.fullmatch(sentences[-1])):  # an InputError counts some itself
        left += int(rest[1]) - 1
    return [
        *map(plain, sentences[:MOST_SENTENCES]),
        *([f"There are {left:,} more of them."] if left > 0 else []),
    ]


def reveal(part: Any, block: str = "start") -> None:
    """Scroll to a part of a panel once the browser has drawn it."""
    seen = f"getHtmlElement({part.id})?.scrollIntoView({{block: '{block}', behavior: 'smooth'}})"
    ui.timer(POLL, lambda: ui.run_javascript(seen), once=True)


def notify(sentence: str) -> None:
    """A short note at the edge of the page."""
    ui.notify(sentence, position="bottom-left", timeout=2500, classes="note")


def guarded(act: Callable[[], Any]) -> Callable[[], Any]:
    """The action; what goes wrong in it is state_of in sentences, and nothing else happens."""

    def acting() -> None:
        try:
            act()
        except Exception as error:  # nobody who uses the page sees a traceback
            sentences = error.sentences if isinstance(error, InputError) else (sentence_of(error),)
            for sentence in few(sentences):
                ui.notify(sentence, type="negative", position="bottom-left", multi_line=True, timeout=8000)

    return acting


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 1, name: str = "") -> str:
    """A table as HTML; the first `texts` columns are text, the others numbers.

    >>> table(["strategy", "K_dyn"], [["direct", "3.118"]])
    '<table class="panel-table"><thead><tr><th>strategy</th><th class="num">K<sub>dyn</sub></th></tr>...
    """
    mark = f' data-testid="{name}"' if name else ""

    def cells(values: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}>{symbols(v)}</{tag}>" if k < texts else f'<{tag} class="num">{symbols(v)}</{tag}>'
            for k, v in enumerate(values)
        )

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    head = f"<thead><tr>{cells(columns, 'th')}</tr></thead>"
    return f'<table class="panel-table"{mark}>{head}<tbody>{body}</tbody></table>'


def facts(pairs: Sequence[tuple[str, str]], name: str = "") -> str:
    """Figures with what they are, as HTML.

    >>> facts([("K_dyn", "0.9092")])
    '<dl class="facts"><div><dt>K<sub>dyn</sub></dt><dd>0.9092</dd></div></dl>'
    """
    mark = f' data-testid="{name}"' if name else ""
    inside = "".join(f"<div><dt>{symbols(k)}</dt><dd>{html.escape(v)}</dd></div>" for k, v in pairs)
    return f'<dl class="facts"{mark}>{inside}</dl>'


class StaleNote:
    """Says for which drive a result is, once the session has another one; built in the current slot."""

    def __init__(self, session: Session, name: str) -> None:
        self._session = session
        self._drive: Machine | None = None
        self._seen = -1
        self.stale = False
        self._label = ui.label().classes("stale").props(f'role=status data-testid="{name}-stale"')
        self._label.set_visibility(False)

    def show_for(self, drive: Machine) -> None:
        """The result shown is of this drive."""
        self._drive, self._seen = drive, -1
        self.refresh()

    def refresh(self) -> None:
        """Compare again where the session has changed."""
        if self._drive is None or self._session.version == self._seen:
            return
        self._seen = self._session.version
        sentence = changed_since(self._drive, self._session.machine)
        self.stale = bool(sentence)
        self._label.set_text(sentence)
        self._label.set_visibility(self.stale)

    def check(self) -> None:
        """Refuse what was computed for another machine: it is none of this one's strategies."""
        now, drive = self._session.machine, self._drive
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
    """The one job of a panel, the same in all tabs of a user; built in the current slot.

    `on_part(value)` is called for each part of the result, `on_done(result)` for the whole; `on_state()`
    whenever the state has changed, `on_begin()` when a job has begun, here or in another tab. `name` tells it
    from those of other panels, and marks the elements for tests.
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
        on_begin: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_begin = on_begin
        self._jobs, self._user, self._name = jobs, user, name
        self._own: Job | None = None  # the one that was begun in this tab
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
        return self.job is not None and self.job.state is State.FAILED

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
        self._say(error.sentences)
        self._on_state()

    def cancel(self) -> None:
        """Stop the job."""
        if self.job is not None:
            self.job.cancel()
            self._refresh()

    def settle(self, go: Any, result: Any) -> None:
        """Let a button begin no second job, and hide a result that answers another question."""
        go.set_enabled(not self.busy)
        if self.failed:
            result.set_visibility(False)

    def _refresh(self) -> None:
        job = self._jobs.shown(self._user, self._name)
        if job is None:
            return
        if job is not self.job:  # begun here or in another tab
            self.job, self._seen, self._parts, self._given = job, -1, 0, False
            self._on_begin()
        # the job goes on in a thread of its own: each is read once, the count first, since it is raised last
        changes, state = job.changes, job.state
        second = -1 if state.over else int(job.seconds)
        if changes == self._seen and second == self._second and state is not State.WAITING:
            return
        news = changes != self._seen
        self._seen, self._second = changes, second
        self._line.set_text(state_of(job))
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
                if self.mine:
                    reveal(self._box)
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
            for sentence in few(sentences):
                ui.label(sentence).classes("trouble")


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
