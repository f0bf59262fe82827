"""What takes longer than a blink: optimal start, limit over the start time, tuning; the server's jobs.

Each panel is built for the client of the moment, in the current slot.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cache

from nicegui import app, context, ui

from softstart.page.bench import Bench
from softstart.page.curve_panel import CurvePanel
from softstart.page.elements import WEB
from softstart.page.jobs import Jobs
from softstart.page.optimum_panel import OptimumPanel
from softstart.page.tuning_panel import TuningPanel

# what works import, in a process that waits for one
IMPORTED = ("softstart.page.works", "softstart.optimal.solving", "softstart.tuning.solving", "scipy.optimize")


def optimum_panel(bench: Bench, user: Hashable) -> None:
    """The gentlest start within a time."""
    _panel(OptimumPanel, bench, user)


def curve_panel(bench: Bench, user: Hashable) -> None:
    """The least K_dyn over the start time, and the strategies beside it."""
    _panel(CurvePanel, bench, user)


def tuning_panel(bench: Bench, user: Hashable) -> None:
    """Gains for each gap and inertia, and one set for all."""
    _panel(TuningPanel, bench, user)


def _panel(build: Callable[[Bench, Hashable, Jobs], object], bench: Bench, user: Hashable) -> None:
    with ui.element("div").classes("panel"):
        build(bench, user, jobs_of(user))


def jobs_of(user: Hashable) -> Jobs:
    """The jobs of the server; those of `user`, the client of the moment, end when the client has gone."""
    style()
    jobs = server_jobs()
    jobs.warm()
    context.client.on_delete(lambda: jobs.leave(user))
    return jobs


@cache
def server_jobs() -> Jobs:
    """The jobs of all users of this server; they end with it."""
    jobs = Jobs(modules=IMPORTED)

    def end() -> None:  # without a parameter: for one, NiceGUI would hand itself over
        jobs.end()

    app.on_shutdown(end)
    return jobs


def style() -> None:
    """The look of the panels, once a client."""
    if not getattr(context.client, "softstart_panels_styled", False):
        context.client.softstart_panels_styled = True  # type: ignore[attr-defined]
        ui.add_head_html(f"<style>{sheet()}</style>")


@cache
def sheet() -> str:
    """The style sheet of the panels."""
    return (WEB / "panels.css").read_text(encoding="utf-8")
