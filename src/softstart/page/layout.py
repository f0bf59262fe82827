"""The page: one instrument for each client, joined to a session of its own. Only glue to NiceGUI is here."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import nicegui
from nicegui import ui
from nicegui.client import Client
from nicegui.element import Element

from softstart.drive.machine import Machine
from softstart.page import USER
from softstart.page.controls import Controls
from softstart.page.frames import FrameBuilder
from softstart.page.live import Frame, Live
from softstart.page.sentences import log, sentence_of
from softstart.page.session import Session
from softstart.project import Project

WEB = Path(__file__).with_name("web")
EXPLORE = "Explore"  # the tab of the live part: parameters of the strategy, and the map
DUTY = "Duty"  # this tab is live too: it shows a strip of steps instead of the plots
LARGE = "Sheet"  # this tab is built when it is opened: others would feel it
# further tabs: title, module and class
PANELS = (
    ("Optimum", "panels", "OptimumPanel"),
    ("Pareto", "panels", "ParetoPanel"),
    ("Checks", "panels", "ChecksPanel"),
    ("Tuning", "panels", "TuningPanel"),
    ("Sheet", "data_sheet_panel", "DataSheetPanel"),
    ("Log", "panels", "LogPanel"),
    ("Files", "files_panel", "FilesPanel"),
)


class Instrument(
    Element, component=WEB / "softstart_instrument.js", esm={"softstart-page": str(WEB / "modules")}
):
    """Draws everything live: `web/softstart_instrument.js`, over the modules beside it."""


def style() -> str:
    """The style sheets of the page, in order."""
    names = ("style.css", "quasar.css", "panels.css")
    return "\n".join((WEB / name).read_text(encoding="utf-8") for name in names)


def warm(drive: Machine | Project) -> None:
    """Do what the first tab would wait for, and others behind it."""
    first_strategy(drive)
    for _, module, _ in PANELS:
        with suppress(Exception):  # said in its tab
            import_module(f"softstart.page.{module}")


@cache
def first_strategy(drive: Machine | Project) -> str:
    """The strategy that is selected at first: computed before the first tab, which others would wait for."""
    session = Session(drive)
    session.offer()
    return session.inputs.selected


def build(drive: Machine | Project) -> Session:
    """Build the page for the client of the moment, in a session of its own; returns that session."""
    client = nicegui.context.client
    ui.add_head_html(f"<style>{style()}</style>")
    session = Session(drive)
    if not (isinstance(drive, Project) and drive.strategy):  # else one is chosen
        session.offer(first_strategy(drive))
    session.restore(session.inputs)  # the page begins here: that is no step to undo
    frames = FrameBuilder(session)

    def turned_to(title: str) -> None:
        frames.duty_shown = title == DUTY
        live.poke()

    with Instrument() as element:
        _panels(session, client, turned_to)

    def send(number: int, frame: Frame) -> None:
        if not client.is_deleted:
            element.run_method("frame", number, frame)

    def show(sentence: str) -> None:
        if not client.is_deleted:
            with client:
                ui.notify(sentence, type="negative", position="bottom-left", close_button="close")

    live = Live(frames, send, show)
    controls = Controls(session, frames, live.poke)

    def take(message: object) -> None:
        if isinstance(message, dict) and message.get("what") == "drawn":
            live.drawn(number if isinstance(number := message.get("number"), int) else 0)
        else:
            controls.take(message)

    element.on("act", lambda event: take(event.args))
    session.on_change(live.poke)
    task = nicegui.background_tasks.create(live.run(), name=f"softstart live {client.id}")
    client.on_delete(lambda: _end(task, session))
    client.on_exception(lambda error: show(sentence_of(error)))
    return session


def page(drive: Machine | Project) -> None:
    """The page of one client; what stands in its way is said instead."""
    try:
        build(drive)
    except Exception as error:  # whatever a drive or a controller does: a sentence, never a traceback
        ui.label(sentence_of(error))


def _end(task: asyncio.Task[Any], session: Session) -> None:
    """A tab was closed: nothing of it stays."""
    task.cancel()
    session.close()


def _panels(session: Session, client: Client, turned_to: Callable[[str], None]) -> None:
    """The tabs for what is computed in the background, and for files; `turned_to(title)` at each change."""
    try:
        user = client.request.scope.get("session", {}).get(USER, client.id)  # of all tabs of a browser
    except RuntimeError:  # a page that no request has asked for
        user = client.id
    with ui.tabs().props("dense no-caps align=justify").classes("panel-tabs") as tabs:
        for title in (EXPLORE, DUTY, *(title for title, _, _ in PANELS)):
            ui.tab(title).classes(f"tab-{title.lower()}")
    with ui.tab_panels(tabs, value=EXPLORE, animated=False).classes("panel-body"):
        places = {}
        for title, _, _ in PANELS:
            with ui.tab_panel(title):
                places[title] = ui.element("div").classes("panel")

    def fill(title: str) -> None:
        if (place := places.pop(title, None)) is None:  # it is there already, or live
            return
        module, name = next((module, name) for tab, module, name in PANELS if tab == title)
        with place:
            try:
                getattr(import_module(f"softstart.page.{module}"), name)(session, user)
            except Exception as error:  # the live part must work without it
                log.debug("the panel %s cannot be built", title, exc_info=error)
                ui.label(sentence_of(error))

    tabs.on_value_change(lambda event: fill(str(event.value)))
    tabs.on_value_change(lambda event: turned_to(str(event.value)))
    for title in [title for title in places if title != LARGE]:
        fill(title)
