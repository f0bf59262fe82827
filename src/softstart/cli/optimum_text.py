"""An optimal start in words: what was asked, its figures, and how it compares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.optimal.result import Optimum
    from softstart.start.run import Run

AIMS = {"k_dyn": "K_dyn", "heat": "heat", "start_time": "start time"}


def name_of(run: Run) -> str:
    """The controller's name, or that of its class."""
    return run.controller.name or type(run.controller).__name__


def controller_summary(run: Run) -> dict[str, Any]:
    """The figures of a controller that matter beside an optimum."""
    return {"controller": name_of(run), "k_dyn": run.k_dyn, "start_time": run.start_time}


def figure_rows(best: Optimum) -> list[list[str]]:
    """The figures of the optimum, as words and numbers."""
    from softstart.views.numbers import NOTHING, number, short

    run, bound, problem = best.run, best.bound, best.problem
    bounded = bound.kind != "none"
    allowed = "" if problem.start_time is None else f", {short(problem.start_time)} s allowed"
    most = "" if problem.k_dyn is None else f", {short(problem.k_dyn)} allowed"
    hottest = "" if problem.heat is None else f", {short(problem.heat)} s allowed"
    rows = [
        ["K_dyn", number(best.k_dyn, 6) + most],
        ["lower bound of K_dyn", f"{number(bound.k_dyn, 6)}, {bound.kind}" if bounded else NOTHING],
        ["gap between them", f"{best.gap_percent:.3g} %" if bounded else NOTHING],
        ["peak shaft torque", f"{short(run.peak_torque)} N m at {short(run.peak_time)} s"],
        ["start time", f"{short(best.end_time)} s{allowed}"],
        ["I2t heat", f"{short(best.heat)} s of starting torque{hottest}"],
        ["first contact", NOTHING if math.isnan(run.first_contact) else f"{short(run.first_contact)} s"],
        ["contacts", str(run.contacts)],
        ["knots of the profile", str(best.profile.time.size)],
        ["computed in", f"{best.seconds:.2g} s"],
    ]
    return rows


def question(best: Optimum) -> str:
    """What was asked for."""
    problem = best.problem
    words = [f"least {AIMS[problem.minimise]}"]
    if problem.start_time is not None:
        words.append(f"start time at most {problem.start_time:.6g} s")
    if problem.k_dyn is not None:
        words.append(f"K_dyn at most {problem.k_dyn:.6g}")
    if problem.heat is not None:
        words.append(f"heat at most {problem.heat:.6g} s")
    words.append(f"terminal {problem.terminal}")
    if problem.torque_speed:
        words.append("motor torque limited over its speed")
    if problem.smoothness:
        words.append(f"smoothness {problem.smoothness:.6g} s")
    return ", ".join(words)


def comparison(best: Optimum, others: Sequence[Run]) -> str:
    """The optimum beside `direct` and beside the gentlest shipped controller."""
    said = f"K_dyn {best.k_dyn:.3f} in {best.end_time:.4g} s"
    reaching = [run for run in others if not math.isnan(run.start_time)]
    direct = next((run for run in reaching if name_of(run) == "direct"), None)
    if direct is not None:
        said += f"; direct has {direct.k_dyn:.3f} in {direct.start_time:.4g} s"
    quick = [run for run in reaching if run.start_time <= best.end_time * (1.0 + 1e-9) and run is not direct]
    if quick:
        gentlest = min(quick, key=lambda run: run.k_dyn)
        said += f"; the gentlest shipped controller as quick, {name_of(gentlest)}, has {gentlest.k_dyn:.3f}"
    elif reaching:
        gentlest = min(reaching, key=lambda run: run.k_dyn)
        said += (
            "; no other shipped controller is as quick, the gentlest of all, "
            f"{name_of(gentlest)}, has {gentlest.k_dyn:.3f} in {gentlest.start_time:.4g} s"
        )
    return said + "."


def bound_sentence(best: Optimum) -> str:
    """What the lower bound covers."""
    if best.bound.kind == "none":
        return (
            f"No lower bound is known here: {best.bound.covers}" if best.bound.covers else "No lower bound."
        )
    return f"The lower bound ({best.bound.kind}) covers {best.bound.covers}".rstrip(".") + "."


def show_optimum(to: Console, best: Optimum, others: Sequence[Run]) -> None:
    """All of it, on the terminal or into a pipe."""
    from softstart.views.drives import drive_lines
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(drive_lines(best.problem.drive)):
        sentence(to, line, "bold" if index == 0 else "")
    sentence(to, f"  asked  {question(best)}")
    sentence(to, f"  method {best.method}: {best.why}")
    to.print()
    print_table(to, [Column("", False), Column("", False)], figure_rows(best), headings=False)
    to.print()
    sentence(to, comparison(best, others), "bold")
    sentence(to, bound_sentence(best), "dim")
