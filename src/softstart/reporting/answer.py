"""The answer in plain sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.reporting.strategies import kind_of
from softstart.reporting.values import RPM, digits, fixed, percent, short

if TYPE_CHECKING:
    from softstart.comparison import Row
    from softstart.reporting.choice import Candidate
    from softstart.reporting.result import Report

SAME = 0.005  # a peak within this share of that of direct is no saving


def answer(report: Report) -> str:
    """The paragraph at the head of the report."""
    best, direct = report.choice.recommended, report.row("direct")
    said = _recommended(report, best, direct) if best else _nothing(report)
    plain = report.choice.ordinary
    if plain is not None and plain is not best:
        run = plain.row.run
        said += (
            f" On an ordinary inverter, one that offers torque ramps and no more, {plain.name} is the "
            f"best: K_dyn "
            f"{fixed(run.k_dyn, 3)} and {digits(run.start_time)} s."
        )
    if best is not None:
        bound = report.lower_bound(best.row)
        if bound is not None:
            said += (
                f" For comparison: no motor torque whatever brings this load to speed in that time with a "
                f"K_dyn "
                f"below {fixed(math.floor(bound * 1000.0) / 1000.0, 3)}."
            )
    return said


def _recommended(report: Report, best: Candidate, direct: Row | None) -> str:
    run = best.row.run
    speed = f"{short(float(f'{float(report.drive.target_speed) * RPM:.5g}'))} rpm"
    if kind_of(run.controller) == "direct":
        return (
            f"For this drive direct start is as good as any strategy examined that can be realised: K_dyn "
            f"{fixed(run.k_dyn, 3)}, peak shaft torque {digits(run.peak_torque)} N m, {speed} after "
            f"{digits(run.start_time)} s. A soft start brings nothing here."
        )
    said = (
        f"We recommend {best.name}. With it the shaft carries at most {digits(run.peak_torque)} N m (dynamic "
        f"coefficient K_dyn {fixed(run.k_dyn, 3)}), and the load has its {speed} after "
        f"{digits(run.start_time)} s."
    )
    if direct is None:
        return said
    hard, saved = direct.run, 1.0 - run.peak_torque / direct.run.peak_torque
    beside = f"Direct start, with the full torque from the first instant on, loads the shaft with {digits(hard.peak_torque)} N m (K_dyn {fixed(hard.k_dyn, 3)})"  # noqa: E501
    if saved > SAME:
        beside += f": {percent(saved, 0)} of the peak are saved"
    else:
        beside += ": on this drive as it is the peak is no lower, but over the range of gaps and loads it is"
    late = run.start_time - hard.start_time
    if math.isnan(late):
        return f"{said} {beside}; direct start does not reach the target speed at all."
    share = percent(abs(late) / hard.start_time)
    if abs(late) < 1e-4 * hard.start_time:
        return f"{said} {beside}, at no cost in time."
    more = "costs" if late > 0.0 else "saves"
    return f"{said} {beside}. The strategy {more} {digits(abs(late), 3)} s of start time, {share}."


def _nothing(report: Report) -> str:
    """Honestly, where the rule finds nothing."""
    choice = report.choice
    reasons = [f"{one.name} ({one.out})" for one in choice.candidates if one.out]
    said = "None of the strategies examined can be recommended for this drive: " + "; ".join(reasons) + "."
    if not any(not math.isnan(one.row.run.start_time) for one in choice.candidates):
        return said + " No strategy brings the load to its target speed."
    return said + " Allow a slower start, give tuned gains, or examine more strategies."
