"""What the panels share: fields, buttons, uploads, downloads, error messages."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any
from weakref import WeakMethod

from nicegui import ui
from nicegui.element import Element

from softstart.errors import MORE_MISTAKES, InputError
from softstart.page.sentences import page_sentence, sentence_of

if TYPE_CHECKING:
    from nicegui.events import UiEventArguments, UploadEventArguments

    from softstart.page.session import Session

POLL = 0.2  # s between two checks of a job
MOST_SENTENCES = 12  # about one input; the next ones appear when these are corrected
# a page that is served to other machines without TLS has no clipboard of its own
COPY = """(event) => {
  const text = %s;
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const field = document.body.appendChild(document.createElement("textarea"));
  field.value = text;
  field.select();
  document.execCommand("copy");
  field.remove();
}"""
TERMINALS = {
    "synchronous": "both masses at target speed",
    "reached": "load at target speed",
    "steady": "both, and shaft torque at rest",
}
MEDIA = {".csv": "text/csv", ".toml": "application/toml", ".c": "text/x-csrc", ".html": "text/html",
         ".zip": "application/zip", ".pdf": "application/pdf"}  # fmt: skip


def box(classes: str) -> Element:
    """A plain box; its class says how it lays out what is in it."""
    return ui.element("div").classes(classes)


def text_field(label: str, value: str, name: str, example: str = "") -> ui.input:
    """A text field below its label."""
    with box("panel-field"):
        ui.label(label)
        field = ui.input(value=value).props(f'dense outlined aria-label="{label}" data-testid="{name}"')
        return field.tooltip(example) if example else field


def text_area(label: str, example: str, name: str) -> ui.textarea:
    """A field for several lines, as wide as the panel, below its label."""
    with box("panel-field panel-wide"):
        ui.label(label)
        return ui.textarea(placeholder=example).props(
            f'dense outlined autogrow aria-label="{label}" data-testid="{name}"'
        )


def row_of(field: Element) -> Element:
    """The box of a field and its label."""
    assert field.parent_slot is not None
    return field.parent_slot.parent


def choice(label: str, options: dict[str, str] | list[str], value: str, name: str) -> ui.select:
    """A choice of one of several, below its label."""
    with box("panel-field"):
        ui.label(label)
        field = ui.select(options, value=value)
        return field.props(f'dense outlined options-dense aria-label="{label}" data-testid="{name}"')


def action(text: str, act: Callable[[], Any], name: str, main: bool = False) -> ui.button:
    """A button; the main one of a panel stands out. Errors are shown as sentences."""

    def acting() -> None:
        try:
            act()
        except Exception as error:  # nobody who uses the page sees a traceback
            sentences = error.sentences if isinstance(error, InputError) else (sentence_of(error),)
            for sentence in few(sentences):
                ui.notify(sentence, type="negative", position="bottom-left", multi_line=True, timeout=8000)

    button = ui.button(text, on_click=acting, color=None).props(
        f'dense no-caps {"unelevated" if main else "flat"} data-testid="{name}"'
    )
    return button.classes("panel-main" if main else "panel-action")


def copying(text: str, name: str) -> ui.button:
    """A button that puts a text into the clipboard."""
    button = action("Copy", lambda: notify("Copied as text."), name)
    return button.on("click", js_handler=COPY % json.dumps(text))


def upload(
    text: str,
    name: str,
    media: str,
    largest: int,
    remedy: str,
    take: Callable[[bytes, str], None],
    refuse: Callable[[str, InputError], None],
) -> ui.button:
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
    button = action(text, lambda: None, f"{name}-load", main=True)
    return button.on("click", js_handler=f"() => getElement({chooser.id}).pickFiles()")


def hint(text: str) -> Element:
    """A sentence in grey: what a panel is for."""
    written = html.escape(text).replace("K_dyn", "K<sub>dyn</sub>")
    return ui.html(written, sanitize=False).classes("panel-hint")


def save(content: str | bytes, name: str) -> None:
    """Let the browser save a text or bytes as a file."""
    suffix = name[name.rindex(".") :]
    if isinstance(content, bytes):
        ui.download.content(content, name, MEDIA[suffix])
        return
    ui.download.content(content, name, f"{MEDIA.get(suffix, 'text/plain')}; charset=utf-8")


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
        self._said: tuple[Sequence[str], str] = ((), "")

    def say(self, sentences: Sequence[str], title: str = "") -> None:
        """Show these instead of the present ones; nothing where there are none."""
        if (sentences, title) == self._said:
            return
        self._said = sentences, title
        self._box.clear()
        self._box.set_visibility(bool(sentences))
        with self._box:
            if title:
                ui.label(title).classes("trouble-title")
            for sentence in few(sentences):
                ui.label(sentence).classes("trouble")


def reveal(part: Element, block: str = "start") -> None:
    """Scroll to a part of a panel once the browser has drawn it."""
    seen = f"getHtmlElement({part.id})?.scrollIntoView({{block: '{block}', behavior: 'smooth'}})"
    ui.timer(POLL, lambda: ui.run_javascript(seen), once=True)


def follow(session: Session, refresh: Callable[[], None], seconds: float = POLL) -> None:
    """Call `refresh()` now, and later whenever the session has changed, checked every so many seconds."""
    seen = -1

    def check() -> None:
        nonlocal seen
        if session.version != seen:
            seen = session.version
            refresh()

    check()
    ui.timer(seconds, check)


def notify(sentence: str) -> None:
    """A short note at the edge of the page."""
    ui.notify(sentence, position="bottom-left", timeout=2500, classes="note")
