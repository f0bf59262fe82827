"""A linear view in words and as plain figures."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softstart.linear.margins import Margins
    from softstart.linear.view import LinearView


def conclusion(view: LinearView) -> str:
    """One sentence: the margins and the elastic mode, or why there are none."""
    if view.margins is None:
        return view.notes[0]
    if not view.stable:
        return "the closed loop is unstable in contact"
    m = view.margins
    said = f"gain margin {gain_text(m)}, phase margin {phase_text(m)}, delay margin {delay_text(m)}"
    if view.elastic_mode is not None:
        said += f"; elastic mode damped by {view.elastic_mode.damping_ratio:.3g}"
    return said


def gain_text(m: Margins) -> str:
    """The gain margin in words."""
    if math.isinf(m.gain_margin):
        return "not limited"
    return f"{m.gain_margin:.3g} ({20.0 * math.log10(m.gain_margin):.1f} dB)"


def phase_text(m: Margins) -> str:
    """The phase margin in degrees; where the loop gain is nowhere 1, that."""
    return "not limited" if math.isinf(m.phase_margin) else f"{math.degrees(m.phase_margin):.1f} degrees"


def delay_text(m: Margins) -> str:
    """The delay margin in ms."""
    return "not limited" if math.isinf(m.delay_margin) else f"{1e3 * m.delay_margin:.3g} ms"


def summary(view: LinearView) -> dict[str, Any]:
    """All figures of a view."""
    found: dict[str, Any] = {
        "drive": view.drive.name,
        "controller": view.name,
        "parameters": view.controller.parameters,
        "kind": view.kind,
        "conclusion": view.conclusion,
        "notes": list(view.notes),
    }
    if view.margins is None or view.point is None or view.own_loop is None:
        return found
    point = view.point
    elastic = view.elastic_mode
    return found | {
        "stable": view.stable,
        "period": view.period,
        "operating_point": {
            "time": point.sample.time,
            "steady": point.steady,
            "demand": point.sample.demand,
            "states": list(point.states),
            "mismatch": point.mismatch,
        },
        "order_of_loop": view.own_loop.broken.A.shape[0],
        "order_of_controller": view.own_loop.minimal_law.A.shape[0],
        **margin_figures(view.margins),
        "elastic_frequency": elastic.frequency if elastic else None,
        "elastic_damping_ratio": elastic.damping_ratio if elastic else None,
        "modes": [
            {
                "frequency": mode.frequency,
                "damping_ratio": mode.damping_ratio,
                "real": mode.value.real,
                "imag": mode.value.imag,
            }
            for mode in view.modes
        ],
        "variations": [
            {
                "name": one.name,
                "stable": one.stable,
                "least_damping": one.least_damping,
                **margin_figures(one.margins),
            }
            for one in view.variations
        ],
        "limit_cycles": [
            {
                **asdict(one.cycle),
                "beyond_limits": one.beyond_limits,
                "measured_frequency": one.verdict.frequency,
                "measured_amplitude": one.verdict.amplitude,
                "confirmed": one.verdict.confirmed,
                "verdict": one.verdict.sentence,
            }
            for one in view.cycles
        ],
    }


def margin_figures(m: Margins) -> dict[str, Any]:
    """The margins: angles in rad, delays in s, frequencies in rad/s."""
    return {**asdict(m), "sensitivity_peak": m.sensitivity_peak}
