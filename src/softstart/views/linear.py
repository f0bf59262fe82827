"""What is shown of a linear view: margins, modes, limit cycles, Bode and Nyquist diagrams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.linear.limit_cycles import SHARES, oscillating
from softstart.linear.plant import plant_scales
from softstart.linear.systems import frequencies
from softstart.linear.view import LinearView, margin_texts
from softstart.views.drawing import COLOURS, GREY, drawing, entitle, head, new_figure
from softstart.views.numbers import NOTHING, DataColumn, TextTable, units_of
from softstart.views.sheet import Sheet, rows_file
from softstart.views.starts import machine_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.linear.loop import Crossing, Loop, Margins
    from softstart.linear.systems import Mode

SHOWN_MODES, SHOWN_CROSSINGS = 16, 4
DECADES = 2.0  # shown below the elastic frequency
WIDEST = 3.0  # of the plane about -1
DEEPEST, HIGHEST = 1e-3, 1e3  # of |L|
MARKED = 100.0  # gain margins up to which a crossing is marked


def _frequencies(found: Sequence[Crossing | Mode]) -> str:
    shown = [f"{float(f'{one.frequency:.5g}'):.6g} rad/s" for one in found[:SHOWN_CROSSINGS]]
    return ", ".join([*shown, *(["..."] if len(found) > SHOWN_CROSSINGS else [])]) or NOTHING


def margin_rows(view: LinearView, loop: Loop) -> list[tuple[str, str]]:
    """The figures of the loop, as words and numbers."""
    m, mode = loop.margins, view.elastic_mode
    return [
        ("closed loop in contact", "stable" if loop.stable else "unstable"),
        *margin_texts(m).items(),
        ("gain reduction margin", f"{m.gain_reduction:.3g}" if m.gain_reduction > 0.0 else ""),
        ("modulus margin", f"{m.modulus_margin:.4g} (sensitivity at most {m.sensitivity_peak:.4g})"),
        ("bandwidth", "" if math.isnan(loop.bandwidth) else f"{loop.bandwidth:.4g} rad/s"),
        ("gain crossover", _frequencies(m.gain_crossovers)),
        ("phase crossover", _frequencies(m.phase_crossovers)),
        ("elastic mode", f"{_frequencies([mode])}, damping ratio {mode.damping_ratio:.4g}" if mode else ""),
        ("linearisation error, max.", f"{float(f'{100.0 * loop.point.mismatch:.2g}'):g} %"),
    ]  # fmt: skip


def _limited(margin: float) -> float:
    """A margin; NaN where there is no limit."""
    return margin if math.isfinite(margin) else math.nan


MODES = (
    DataColumn("rad/s", lambda mode: mode.frequency),
    DataColumn("damping\nratio", lambda mode: mode.damping_ratio, 4),
    DataColumn("pole z", lambda mode: _pole(mode.value)),
)
VARIATIONS = (
    DataColumn("drive", lambda loop: loop.name or "as it is"),
    DataColumn("stable", lambda loop: "yes" if loop.stable else "no"),
    DataColumn("gain\nmargin", lambda loop: _limited(loop.margins.gain_margin), 2),
    DataColumn("phase\nmargin deg", lambda loop: _limited(math.degrees(loop.margins.phase_margin)), 1),
    DataColumn("delay\nmargin ms", lambda loop: _limited(1e3 * loop.margins.delay_margin), 2),
    DataColumn("modulus\nmargin", lambda loop: _limited(loop.margins.modulus_margin), 3),
    DataColumn("minimum\ndamping", lambda loop: loop.least_damping, 3),
    DataColumn("bandwidth\nrad/s", lambda loop: loop.bandwidth, optional=True),
)
CYCLES = (
    DataColumn("rad/s", lambda cycle: cycle.frequency),
    DataColumn("amplitude\nrad", lambda cycle: cycle.amplitude, 4, si="rad"),
    DataColumn("bias\nrad", lambda cycle: cycle.bias, 4, si="rad"),
    DataColumn("demand\n+- N m", lambda cycle: cycle.demand_amplitude, 1, si="N*m"),
    DataColumn("predicted", lambda cycle: "stable" if cycle.stable else "unstable"),
    DataColumn("motor\nlimits", lambda cycle: "exceeded" if cycle.beyond_limits else "kept"),
)


def _pole(z: complex) -> str:
    return f"{z.real:.5f}" + (f" +- {z.imag:.5f}j" if z.imag > 0.0 else "")


def tables(view: LinearView, loop: Loop) -> list[TextTable]:
    """Modes of the closed loop, where a pair counts once, other drives, and limit cycles."""
    modes = [mode for mode in loop.modes if mode.imag >= 0.0][:SHOWN_MODES]
    return [
        TextTable.of_data("Modes of the closed loop", MODES, modes),
        TextTable.of_data(
            "Both loops, and the same controller on other drives (-: not limited)",
            VARIATIONS,
            [loop, *view.variations[-1:], *view.variations[:-1]],
        ),
        TextTable.of_data(
            "Limit cycles predicted by the describing function of the gap",
            CYCLES,
            view.cycles,
            units_of(view.drive),
        ),
    ]


def linear_notes(view: LinearView) -> list[str]:
    """What the limit cycles assume, then the notes of the view."""
    note = "No limit cycle through the gap is predicted by the describing function."
    if len(view.drive.shaft_names) > 1:
        note = (
            "The loop is that of the whole chain with all gaps closed. Limit cycles through several gaps are "
            "not predicted; use simulate."
        )
    elif view.cycles:
        units = units_of(view.drive)
        mean = f"{units.shown(view.cycles[0].mean_torque, 'N*m'):.4g} {units.label('N*m')}{units.behind}"
        note = (
            f"Mean shaft torque of the limit cycles: {mean}. Assumed: the "
            "controller has the same linear law in the gap. Verify with simulate."
        )
    return [note, *view.notes]


def linear_sheet(view: LinearView) -> Sheet:
    """What is shown of a linear view; its conclusion alone where there is no loop."""
    loop = view.loop
    title = f"{view.drive.name}: loop of {view.name}"
    lines = [*machine_lines(view.drive), f"  under  {view.name}"]
    if loop is None:
        why = f'controller = "{view.name}": {view.notes[0]}'
        return Sheet(title, lines, view.notes[0], machine=view.drive, no_figure=why)
    return Sheet(
        title,
        lines,
        view.warning,
        facts=margin_rows(view, loop),
        tables=tables(view, loop),
        notes=linear_notes(view),
        figures={"linear": lambda: linear_figure(view)},
        files={"response.csv": rows_file(*response(loop))},
        machine=view.drive,
    )


def response(loop: Loop) -> tuple[tuple[str, ...], list[list[float]]]:
    """The loop over frequency, with all crossings among the frequencies: headings and rows."""
    m = loop.margins
    marked = [one.frequency for one in (*m.gain_crossovers, *m.phase_crossovers)]
    w = np.unique(np.concatenate([frequencies(loop.period, loop.broken), marked]))
    L = loop.broken.at(w, loop.period)
    headings = ("frequency [rad/s]", "|L|", "phase of L [rad]", "|1/(1 + L)|")
    return headings, np.column_stack([w, np.abs(L), np.angle(L), 1.0 / np.abs(1.0 + L)]).tolist()


def linear_figure(view: LinearView) -> Figure:
    """Left the Bode diagram with the crossings marked; right the Nyquist diagrams of loop and gap."""
    loop, Omega = view.loop, plant_scales(view.drive).Omega
    assert loop is not None
    w = frequencies(loop.period, loop.broken)
    w = w[w >= Omega * 10.0**-DECADES]
    L = loop.broken.at(w, loop.period)
    with drawing():
        figure, ((size, plane), (phase, gap)) = new_figure(2, 2, (10.5, 7.4))
        _magnitude(size, w, L, loop.margins)
        _phase(phase, w, L, loop.margins)
        for axes in (size, phase):
            axes.axvline(Omega, color=GREY, lw=0.9, ls=":", label="elastic frequency")
            axes.set(xlim=(w[0], w[-1]), xlabel="frequency, rad/s")
        size.legend(loc="upper left")
        _nyquist(plane, L, loop.margins)
        if len(view.drive.shaft_names) == 1:
            _harmonic_balance(gap, view, loop)
        else:
            gap.set_axis_off()  # several gaps have no one describing function
        entitle(figure, f"{view.drive.name}: loop of {view.name} in contact")
    return figure


def _magnitude(axes: Axes, w: Vector, L: Complex, m: Margins) -> None:
    """|L|, its distance from 1 where the phase is -180 degrees."""
    axes.loglog(w, np.abs(L), color=COLOURS[0])
    axes.axhline(1.0, color=GREY, lw=0.8)
    label = "to -1 at -180 degrees"
    for one in (one for one in m.phase_crossovers if one.margin < MARKED):
        axes.plot([one.frequency] * 2, [1.0, 1.0 / one.margin], "o-", ms=4.5, color=COLOURS[1], label=label)
        label = f"_{label}"
    top = float(np.quantile(np.abs(L), 0.98))
    axes.set_ylim(max(DEEPEST, 0.5 * float(np.abs(L).min())), min(max(10.0, 3.0 * top), HIGHEST))
    head(axes, f"gain margin {margin_texts(m)['gain margin']}", "|L|")


def _phase(axes: Axes, w: Vector, L: Complex, m: Margins) -> None:
    """The phase of L, its distance from 180 degrees where |L| is 1."""
    degrees = np.degrees(np.angle(L))
    jumps = np.abs(np.diff(degrees, prepend=degrees[0])) > 170.0
    axes.semilogx(w, np.where(jumps, math.nan, degrees), color=COLOURS[0])
    for one in m.gain_crossovers:
        at = math.degrees(one.margin)
        bound = -180.0 if at > 0.0 else 180.0
        axes.plot([one.frequency] * 2, [bound, bound + at], "o-", ms=4.5, color=COLOURS[2])
        axes.text(1.05 * one.frequency, bound + 0.5 * at, f"{abs(at):.0f}", va="center", color=COLOURS[2])
    axes.set(ylim=(-190.0, 190.0), yticks=range(-180, 181, 60))
    title = ", ".join(f"{name} {text}" for name, text in list(margin_texts(m).items())[1:])
    head(axes, title, "phase of L, degrees")


def _nyquist(axes: Axes, L: Complex, m: Margins) -> None:
    """L near -1, and how near it comes."""
    turn, least = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 200)), m.modulus_margin
    near = least * turn - 1.0
    axes.plot(turn.real, turn.imag, color=GREY, lw=0.8, ls=":", label="|L| = 1")
    axes.plot(near.real, near.imag, color=COLOURS[1], lw=1.0, ls="--", label=f"nearest to -1: {least:.3g}")
    axes.plot(L.real, L.imag, color=COLOURS[0], label="L")
    axes.plot(L.real, -L.imag, color=COLOURS[0], lw=0.7, alpha=0.6)
    axes.plot([-1.0], [0.0], "+", ms=9, mew=1.8, color=COLOURS[3])
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlim=(-WIDEST, WIDEST), ylim=(-0.8 * WIDEST, 0.8 * WIDEST))
    axes.legend(loc="upper right")
    head(axes, f"Nyquist diagram; sensitivity at most {m.sensitivity_peak:.3g}", "Im L", "Re L")


def _harmonic_balance(axes: Axes, view: LinearView, loop: Loop) -> None:
    """Damping of the least damped mode over n; a limit cycle is where it passes through zero."""
    outermost = [oscillating(loop, float(n))[0][:1] for n in SHARES]
    s = np.array([np.log(one[0]) if one.size else math.nan for one in outermost])
    axes.semilogx(SHARES, -s.real / np.abs(s), color=COLOURS[0])
    axes.axhline(0.0, color=GREY, lw=0.8)
    for one in view.cycles:
        face = COLOURS[1] if one.stable else "none"
        axes.plot([one.share], [0.0], "o", ms=6, mfc=face, color=COLOURS[1])
        axes.annotate(f"{one.frequency:.3g} rad/s", (one.share, 0.0), xytext=(0, 8),
                      textcoords="offset points", ha="center")  # fmt: skip
    axes.set(xlim=(SHARES[0], 1.0))
    count = len(view.cycles) or "none"
    title = f"Gap as describing function n; limit cycles predicted: {count}"
    head(axes, title, "least damping ratio", "n, share of the stiffness")
