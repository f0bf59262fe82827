"""A linear view in words, tables and figures: margins, modes, limit cycles, Bode and Nyquist diagrams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.linear.limit_cycles import Outside, frequency_grid
from softstart.linear.sampled_plant import sizes_of
from softstart.linear.systems import at_points, frequencies, poles
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, entitle, head, new_figure
from softstart.views.numbers import NOTHING, Table, column_of, number, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.linear.loop import Crossing, Margins
    from softstart.linear.view import LinearView

SHOWN_MODES = 16
SHOWN_CROSSINGS = 4
DECADES = 2.0  # shown below the elastic frequency
WIDEST = 3.0  # of the plane about -1
DEEPEST, HIGHEST = 1e-3, 1e3  # of |L|
MARKED = 100.0  # gain margins up to which a crossing is marked


def conclusion(view: LinearView) -> str:
    """One sentence: the margins and the elastic mode, or why there are none."""
    if view.margins is None:
        return view.notes[0]
    if not view.stable:
        return "the closed loop is unstable in contact"
    m = view.margins
    sentence = f"gain margin {gain_text(m)}, phase margin {phase_text(m)}, delay margin {delay_text(m)}"
    if view.elastic_mode is not None:
        sentence += f"; elastic mode damped by {view.elastic_mode.damping_ratio:.3g}"
    return sentence


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


def _frequency(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{short(float(f'{value:.5g}'))} rad/s"


def _frequencies(crossings: Sequence[Crossing]) -> str:
    shown = [_frequency(one.frequency) for one in crossings[:SHOWN_CROSSINGS]]
    return ", ".join([*shown, *(["..."] if len(crossings) > SHOWN_CROSSINGS else [])]) or NOTHING


def margin_rows(view: LinearView) -> list[list[str]]:
    """The figures of the loop, as words and numbers."""
    m = view.margins
    assert m is not None
    rows = [
        ["closed loop in contact", "stable" if view.stable else "unstable"],
        ["gain margin", gain_text(m)],
        ["phase margin", phase_text(m)],
        ["delay margin", delay_text(m)],
        ["modulus margin", f"{m.modulus_margin:.4g} (sensitivity at most {m.sensitivity_peak:.4g})"],
        ["loop gain is 1 at", _frequencies(m.gain_crossovers)],
        ["loop is at -180 degrees at", _frequencies(m.phase_crossovers)],
    ]
    if m.gain_reduction > 0.0:
        rows.insert(2, ["least gain", f"{m.gain_reduction:.3g} of the present one"])
    if view.elastic_mode is not None:
        mode = view.elastic_mode
        rows.append(["elastic mode", f"{_frequency(mode.frequency)}, damping ratio {mode.damping_ratio:.4g}"])
    if view.point is not None:
        rows.append(["linear against exact", f"{100.0 * view.point.mismatch:.2g} % at most"])
    return rows


def _modes(view: LinearView) -> Table:
    """The closed loop's modes; a pair counts once."""
    modes = [mode for mode in view.modes if mode.value.imag >= 0.0][:SHOWN_MODES]
    cells = {
        "rad/s": column_of([mode.frequency for mode in modes]),
        "damping\nratio": [number(mode.damping_ratio, 4) for mode in modes],
        "pole z": [
            f"{mode.value.real:.5f}" + (f" +- {mode.value.imag:.5f}j" if mode.value.imag > 0.0 else "")
            for mode in modes
        ],
    }
    return Table.of("Modes of the closed loop", cells, ("pole z",))


def _variations(view: LinearView) -> Table:
    def each(read: str, scale: float, decimals: int) -> list[str]:
        values = [getattr(one.margins, read) for one in view.variations]
        return ["any" if math.isinf(value) else number(scale * value, decimals) for value in values]

    cells = {
        "drive": [one.name for one in view.variations],
        "stable": ["yes" if one.stable else "no" for one in view.variations],
        "gain\nmargin": each("gain_margin", 1.0, 2),
        "phase\nmargin deg": each("phase_margin", 180.0 / math.pi, 1),
        "delay\nmargin ms": each("delay_margin", 1e3, 2),
        "modulus\nmargin": each("modulus_margin", 1.0, 3),
        "least\ndamping": [number(one.least_damping, 3) for one in view.variations],
    }
    return Table.of("The same controller on other drives", cells, ("drive", "stable"))


def _cycles(view: LinearView) -> Table:
    found = [one.cycle for one in view.cycles]
    beyond = " (the demand is beyond the motor's limits)"
    cells = {
        "rad/s": column_of([one.frequency for one in found]),
        "amplitude\nrad": [number(one.amplitude, 4) for one in found],
        "bias\nrad": [number(one.bias, 4) for one in found],
        "demand\n+- N m": [number(one.demand_amplitude, 1) for one in found],
        "predicted": ["stable" if one.stable else "unstable" for one in found],
        "on the exact plant": [
            one.verdict.sentence + (beyond if one.beyond_limits else "") for one in view.cycles
        ],
    }
    title = "Limit cycles predicted by the describing function of the gap"
    return Table.of(title, cells, ("predicted", "on the exact plant"))


def tables(view: LinearView) -> list[Table]:
    """Modes, other drives and limit cycles."""
    return [_modes(view), _variations(view), *([_cycles(view)] if view.outside is not None else [])]


def notes(view: LinearView) -> list[str]:
    """The mean torque of the limit cycles, then the notes of the view."""
    if view.outside is None:
        return [
            "The loop is that of the whole chain with all gaps closed; limit cycles through several gaps are "
            "not predicted: simulate shows them.",
            *view.notes,
        ]
    sentence = "No limit cycle through the gap is predicted by the describing function."
    if view.cycles:
        mean = view.cycles[0].cycle.mean_torque
        sentence = "The vibrations are unbiased: the mean shaft torque is 0."
        if mean:
            sentence = f"The vibrations are biased by the mean shaft torque of {mean:.4g} N m."
    return [sentence, *view.notes]


def response(view: LinearView) -> tuple[tuple[str, ...], list[list[float]]]:
    """The loop over frequency, with all crossings among the frequencies: headings and rows."""
    assert view.own_loop is not None
    assert view.margins is not None
    loop, m = view.own_loop.broken, view.margins
    marked = [one.frequency for one in (*m.gain_crossovers, *m.phase_crossovers)]
    w = np.unique(np.concatenate([frequencies(view.period, poles(loop)), marked]))
    L = at_points(loop, np.exp(1j * w * view.period))[:, 0, 0]
    headings = ("frequency [rad/s]", "|L|", "phase of L [rad]", "|1/(1 + L)|")
    return headings, np.column_stack([w, np.abs(L), np.angle(L), 1.0 / np.abs(1.0 + L)]).tolist()


def linear_figure(view: LinearView) -> Any:
    """Left the Bode diagram with the crossings marked; right the Nyquist diagrams of loop and gap."""
    assert view.own_loop is not None
    assert view.margins is not None
    loop, period = view.own_loop.broken, view.period
    w = frequencies(period, poles(loop))
    Omega = sizes_of(view.drive).Omega
    w = w[w >= Omega * 10.0**-DECADES]
    L = at_points(loop, np.exp(1j * w * period))[:, 0, 0]
    with drawing():
        figure, panels = new_figure(2, 2, (10.5, 7.4))
        (size, plane), (phase, gap) = panels
        _magnitude(size, w, L, view.margins)
        _phase(phase, w, L, view.margins)
        _mark_elastic((size, phase), Omega)
        _nyquist(plane, L, view.margins)
        if view.outside is not None:
            _harmonic_balance(gap, view, view.outside)
        else:
            gap.set_axis_off()  # several gaps have no one describing function
        entitle(figure, f"{view.drive.name}: loop of {view.name} in contact")
    return figure


def _mark_elastic(panels: tuple[Axes, ...], Omega: float) -> None:
    for index, axes in enumerate(panels):
        label = "elastic frequency" if index == 0 else None
        axes.axvline(Omega, color=GREY, lw=0.9, ls=":", label=label)
    panels[0].legend(loc="upper left")


def _magnitude(axes: Axes, w: Any, L: Any, m: Margins) -> None:
    axes.loglog(w, np.abs(L), color=COLOURS[0])
    axes.axhline(1.0, color=GREY, lw=0.8)
    for index, one in enumerate(one for one in m.phase_crossovers if one.margin < MARKED):
        axes.plot([one.frequency] * 2, [1.0 / one.margin, 1.0], color=COLOURS[1], lw=1.8,
                  label="to -1 at -180 degrees" if index == 0 else None)  # fmt: skip
        axes.plot([one.frequency], [1.0 / one.margin], "o", ms=4.5, color=COLOURS[1])
    top = float(np.quantile(np.abs(L), 0.98))
    axes.set_ylim(max(DEEPEST, 0.5 * float(np.abs(L).min())), min(max(10.0, 3.0 * top), HIGHEST))
    axes.set_xlim(w[0], w[-1])
    head(axes, f"gain margin {gain_text(m)}", "|L|", "frequency, rad/s")


def _phase(axes: Axes, w: Any, L: Any, m: Margins) -> None:
    degrees = np.degrees(np.angle(L))
    jumps = np.abs(np.diff(degrees)) > 170.0
    shown = degrees.copy()
    shown[1:][jumps] = math.nan
    axes.semilogx(w, shown, color=COLOURS[0])
    for one in m.gain_crossovers:
        at = math.degrees(one.margin)
        bound = -180.0 if at > 0.0 else 180.0
        axes.plot([one.frequency] * 2, [bound, bound + at], color=COLOURS[2], lw=1.8)
        axes.plot([one.frequency], [bound + at], "o", ms=4.5, color=COLOURS[2])
        axes.annotate(f"{abs(at):.0f}", (one.frequency, bound + 0.5 * at), xytext=(5, 0),
                      textcoords="offset points", va="center", color=COLOURS[2])  # fmt: skip
    axes.set_yticks(range(-180, 181, 60))
    axes.set_ylim(-190.0, 190.0)
    axes.set_xlim(w[0], w[-1])
    title = f"phase margin {phase_text(m)}, delay margin {delay_text(m)}"
    head(axes, title, "phase of L, degrees", "frequency, rad/s")


def _nyquist(axes: Axes, L: Any, m: Margins) -> None:
    turn = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 200))
    axes.plot(turn.real, turn.imag, color=GREY, lw=0.8, ls=":", label="|L| = 1")
    near = -1.0 + m.modulus_margin * turn
    label = f"nearest to -1: {m.modulus_margin:.3g}"
    axes.plot(near.real, near.imag, color=COLOURS[1], lw=1.0, ls=DASHES[1], label=label)
    axes.plot(L.real, L.imag, color=COLOURS[0], label="L")
    axes.plot(L.real, -L.imag, color=COLOURS[0], lw=0.7, alpha=0.6)
    axes.plot([-1.0], [0.0], "+", ms=9, mew=1.8, color=COLOURS[3])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(-WIDEST, WIDEST)
    axes.set_ylim(-0.8 * WIDEST, 0.8 * WIDEST)
    axes.legend(loc="upper right")
    head(axes, f"Nyquist diagram; sensitivity at most {m.sensitivity_peak:.3g}", "Im L", "Re L")


def _harmonic_balance(axes: Axes, view: LinearView, outside: Outside) -> None:
    w = frequency_grid(outside)
    M = outside.contact(w)
    reach = max([WIDEST, *(1.5 / _n(outside, one.cycle.frequency) for one in view.cycles)])
    shown = np.where(np.abs(M) < 3.0 * reach, M, math.nan)
    axes.plot(shown.real, shown.imag, color=COLOURS[0], label="M = (c + jwd) G")
    axes.plot([-3.0 * reach, -1.0], [0.0, 0.0], color=COLOURS[3], lw=1.6, label="-1/n of the gap")
    axes.plot([-1.0], [0.0], "+", ms=9, mew=1.8, color=COLOURS[3])
    for one in view.cycles:
        style: dict[str, Any] = {"mfc": COLOURS[1] if one.cycle.stable else "none", "color": COLOURS[1]}
        axes.plot([-1.0 / _n(outside, one.cycle.frequency)], [0.0], "o", ms=6, **style)
        axes.annotate(f"{one.cycle.frequency:.3g} rad/s", (-1.0 / _n(outside, one.cycle.frequency), 0.0),
                      xytext=(0, 8), textcoords="offset points", ha="center")  # fmt: skip
    axes.set_xlim(-reach, 0.4 * reach)
    axes.set_ylim(-0.7 * reach, 0.7 * reach)
    axes.legend(loc="lower left")
    count = len(view.cycles)
    predicted = "no limit cycle" if count == 0 else f"{count} limit cycle{'s' * (count > 1)}"
    head(axes, f"Gap as describing function n: {predicted} predicted", "Im M", "Re M")


def _n(outside: Outside, frequency: float) -> float:
    """The value of n at which the harmonic balance holds."""
    return -1.0 / float(outside.contact(np.array([frequency]))[0].real)
