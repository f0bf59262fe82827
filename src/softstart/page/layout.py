"""The page: one instrument for each client, joined to a bench of its own. Only glue to NiceGUI is here."""

from __future__ import annotations

import asyncio
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from softstart.drive import Drive
from softstart.page.bench import Bench
from softstart.page.controls import Controls, groups
from softstart.page.elements import instrument, style
from softstart.page.frames import Screen
from softstart.page.live import Frame, Live
from softstart.page.trouble import log, sentence_of

if TYPE_CHECKING:
    from nicegui.client import Client

# tabs beside the live part: title, module and function that builds it
PANELS = (
    ("Optimum", "softstart.page.background", "optimum_panel"),
    ("Limit", "softstart.page.background", "curve_panel"),
    ("Tuning", "softstart.page.background", "tuning_panel"),
    ("Files", "softstart.page.files_panel", "files_panel"),
)


def build(drive: Drive) -> Bench:
    """Build the page for the client of the moment, on a bench of its own; returns that bench."""
    from nicegui import background_tasks, context, ui

    client = context.client
    ui.add_head_html(f"<style>{style()}</style>")
    bench = Bench(drive)
    bench.show_gentlest()
    screen = Screen(bench)
    with instrument()() as element:
        _panels(bench, client)
    element.props["groups"] = groups(screen)

    def send(number: int, frame: Frame) -> None:
        if not client.is_deleted:
            element.run_method("frame", number, frame)

    def tell(sentence: str) -> None:
        if not client.is_deleted:
            with client:
                ui.notify(sentence, type="negative", position="bottom-left", close_button="close")

    live = Live(screen, send, tell)
    controls = Controls(bench, screen, live.poke)

    def take(message: Any) -> None:
        if isinstance(message, dict) and message.get("what") == "drawn":
            live.drawn(int(message.get("number") or 0))
        else:
            controls.take(message)

    element.on("act", lambda event: take(event.args))
    bench.on_change(live.poke)
    task = background_tasks.create(live.run(), name=f"softstart live {client.id}")
    client.on_delete(lambda: _end(task, bench))
    client.on_exception(lambda error: tell(sentence_of(error)))
    return bench


def page(drive: Drive) -> None:
    """The page of one client; what stands in its way is said instead."""
    from nicegui import ui

    try:
        build(drive)
    except Exception as error:  # whatever a drive or a controller does: a sentence, never a traceback
        ui.label(sentence_of(error))


def _end(task: asyncio.Task[Any], bench: Bench) -> None:
    """A tab was closed: nothing of it stays."""
    task.cancel()
    bench.close()


def _panels(bench: Bench, client: Client) -> None:
    """The tabs for what runs in the background and for files."""
    from nicegui import ui

    found = [panel for panel in PANELS if find_spec(panel[1]) is not None]
    if not found:
        return
    with ui.tabs().props("dense no-caps align=left").classes("panel-tabs") as tabs:
        for title, _, _ in found:
            ui.tab(title)
    with ui.tab_panels(tabs, value=found[0][0], animated=False).classes("panel-body"):
        for title, module, function in found:
            with ui.tab_panel(title):
                try:
                    getattr(import_module(module), function)(bench, client.id)
                except Exception as error:  # the live part must work without it
                    log.debug("the panel %s cannot be built", title, exc_info=error)
                    ui.label(sentence_of(error))
