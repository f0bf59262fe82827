"""What is shown of a linear view: margins, modes, limit cycles, Bode and Nyquist diagrams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.linear.limit_cycles import Outside, frequency_grid
from softstart.linear.sampled_plant import sizes_of
from softstart.linear.systems import at_points, frequencies, poles
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, entitle, head, new_figure
from softstart.views.numbers import NOTHING, Table, column_of, number
from softstart.views.sheet import Sheet, rows_file
from softstart.views.starts import machine_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.linear.loop import Crossing, Margins
    from softstart.linear.systems import Mode
    from softstart.linear.view import LinearView

SHOWN_MODES, SHOWN_CROSSINGS = 16, 4
DECADES = 2.0  # shown below the elastic frequency
WIDEST = 3.0  # of the plane about -1
DEEPEST, HIGHEST = 1e-3, 1e3  # of |L|
MARKED = 100.0  # gain margins up to which a crossing is marked


def conclusion(view: LinearView) -> str:
    """One sentence: the margins and the elastic mode, or why there are none."""
    m = view.margins
    if m is None or not view.stable:
        return view.notes[0] if m is None else "the closed loop is unstable in contact"
    sentence = ", ".join(f"{name} {text}" for name, text in _margins(m).items())
    mode = view.elastic_mode
    return sentence if mode is None else f"{sentence}; elastic mode damped by {mode.damping_ratio:.3g}"


def _margins(m: Margins) -> dict[str, str]:
    """The margins in words; that of the phase is not limited where the loop gain is nowhere 1."""
    texts = {
        "gain margin": (m.gain_margin, f"{m.gain_margin:.3g} ({20.0 * math.log10(m.gain_margin):.1f} dB)"),
        "phase margin": (m.phase_margin, f"{math.degrees(m.phase_margin):.1f} degrees"),
        "delay margin": (m.delay_margin, f"{1e3 * m.delay_margin:.3g} ms"),
    }
    return {name: "not limited" if math.isinf(value) else text for name, (value, text) in texts.items()}


def _frequencies(found: Sequence[Crossing | Mode]) -> str:
    shown = [f"{float(f'{one.frequency:.5g}'):.6g} rad/s" for one in found[:SHOWN_CROSSINGS]]
    return ", ".join([*shown, *(["..."] if len(found) > SHOWN_CROSSINGS else [])]) or NOTHING


def margin_rows(view: LinearView, m: Margins) -> list[tuple[str, str]]:
    """The figures of the loop, as words and numbers."""
    least, mode, point = m.gain_reduction, view.elastic_mode, view.point
    return [
        ("closed loop in contact", "stable" if view.stable else "unstable"),
        *_margins(m).items(),
        *([("least gain", f"{least:.3g} of the present one")] if least > 0.0 else []),
        ("modulus margin", f"{m.modulus_margin:.4g} (sensitivity at most {m.sensitivity_peak:.4g})"),
        ("loop gain is 1 at", _frequencies(m.gain_crossovers)),
        ("loop is at -180 degrees at", _frequencies(m.phase_crossovers)),
        *([("elastic mode", f"{_frequencies([mode])}, damping ratio {mode.damping_ratio:.4g}")]
          if mode is not None else []),
        *([("linear against exact", f"{float(f'{100.0 * point.mismatch:.2g}'):g} % at most")]
          if point is not None else []),
    ]  # fmt: skip


def tables(view: LinearView) -> list[Table]:
    """Modes of the closed loop, where a pair counts once, other drives, and limit cycles."""
    modes = [mode for mode in view.modes if mode.value.imag >= 0.0][:SHOWN_MODES]

    def each(read: str, scale: float, decimals: int) -> list[str]:
        values = [getattr(one.margins, read) for one in view.variations]
        return ["any" if math.isinf(value) else number(scale * value, decimals) for value in values]

    found = [one.cycle for one in view.cycles]
    beyond = {True: " (the demand is beyond the motor's limits)", False: ""}
    pairs = [f" +- {mode.value.imag:.5f}j" if mode.value.imag > 0.0 else "" for mode in modes]
    of_modes = {
        "rad/s": column_of([mode.frequency for mode in modes]),
        "damping\nratio": [number(mode.damping_ratio, 4) for mode in modes],
        "pole z": [f"{mode.value.real:.5f}{pair}" for mode, pair in zip(modes, pairs, strict=True)],
    }
    of_drives = {
        "drive": [one.name for one in view.variations],
        "stable": ["yes" if one.stable else "no" for one in view.variations],
        "gain\nmargin": each("gain_margin", 1.0, 2),
        "phase\nmargin deg": each("phase_margin", 180.0 / math.pi, 1),
        "delay\nmargin ms": each("delay_margin", 1e3, 2),
        "modulus\nmargin": each("modulus_margin", 1.0, 3),
        "least\ndamping": [number(one.least_damping, 3) for one in view.variations],
    }
    of_cycles = {
        "rad/s": column_of([one.frequency for one in found]),
        "amplitude\nrad": [number(one.amplitude, 4) for one in found],
        "bias\nrad": [number(one.bias, 4) for one in found],
        "demand\n+- N m": [number(one.demand_amplitude, 1) for one in found],
        "predicted": ["stable" if one.stable else "unstable" for one in found],
        "on the exact plant": [one.verdict.sentence + beyond[one.beyond_limits] for one in view.cycles],
    }
    cycles = "Limit cycles predicted by the describing function of the gap"
    return [
        Table.of("Modes of the closed loop", of_modes, ("pole z",)),
        Table.of("The same controller on other drives", of_drives, ("drive", "stable")),
        Table.of(cycles, of_cycles, ("predicted", "on the exact plant")),
    ]


def notes(view: LinearView) -> list[str]:
    """The mean torque of the limit cycles, then the notes of the view."""
    sentence = (
        "The loop is that of the whole chain with all gaps closed; limit cycles through several gaps are not "
        "predicted: simulate shows them."
        if view.outside is None
        else f"The mean shaft torque of the limit cycles is {view.cycles[0].cycle.mean_torque:.4g} N m."
        if view.cycles
        else "No limit cycle through the gap is predicted by the describing function."
    )
    return [sentence, *view.notes]


def linear_sheet(view: LinearView) -> Sheet:
    """What is shown of a linear view; its conclusion alone where there is no loop."""
    m = view.margins
    title = f"{view.drive.name}: loop of {view.name}"
    lines = [*machine_lines(view.drive), f"  under  {view.name}"]
    if m is None:
        return Sheet(title, lines, view.notes[0], machine=view.drive)
    return Sheet(
        title,
        lines,
        facts=margin_rows(view, m),
        tables=tables(view),
        notes=notes(view),
        figures={"linear": view.plot},
        files={"response.csv": rows_file(*response(view, m))},
        machine=view.drive,
    )


def _loop(view: LinearView, w: Any) -> Any:
    """L at these frequencies."""
    assert view.own_loop is not None
    return at_points(view.own_loop.broken, np.exp(1j * w * view.period))[:, 0, 0]


def _frequencies_of(view: LinearView) -> Any:
    assert view.own_loop is not None
    return frequencies(view.period, poles(view.own_loop.broken))


def response(view: LinearView, m: Margins) -> tuple[tuple[str, ...], list[list[float]]]:
    """The loop over frequency, with all crossings among the frequencies: headings and rows."""
    marked = [one.frequency for one in (*m.gain_crossovers, *m.phase_crossovers)]
    w = np.unique(np.concatenate([_frequencies_of(view), marked]))
    L = _loop(view, w)
    headings = ("frequency [rad/s]", "|L|", "phase of L [rad]", "|1/(1 + L)|")
    return headings, np.column_stack([w, np.abs(L), np.angle(L), 1.0 / np.abs(1.0 + L)]).tolist()


def linear_figure(view: LinearView) -> Any:
    """Left the Bode diagram with the crossings marked; right the Nyquist diagrams of loop and gap."""
    assert view.margins is not None
    Omega = sizes_of(view.drive).Omega
    w = _frequencies_of(view)
    w = w[w >= Omega * 10.0**-DECADES]
    L = _loop(view, w)
    with drawing():
        figure, panels = new_figure(2, 2, (10.5, 7.4))
        (size, plane), (phase, gap) = panels
        _magnitude(size, w, L, view.margins)
        _phase(phase, w, L, view.margins)
        for axes in (size, phase):
            axes.axvline(Omega, color=GREY, lw=0.9, ls=":", label="elastic frequency")
        size.legend(loc="upper left")
        _nyquist(plane, L, view.margins)
        if view.outside is not None:
            _harmonic_balance(gap, view, view.outside)
        else:
            gap.set_axis_off()  # several gaps have no one describing function
        entitle(figure, f"{view.drive.name}: loop of {view.name} in contact")
    return figure


def _magnitude(axes: Axes, w: Any, L: Any, m: Margins) -> None:
    axes.loglog(w, np.abs(L), color=COLOURS[0])
    axes.axhline(1.0, color=GREY, lw=0.8)
    for index, one in enumerate(one for one in m.phase_crossovers if one.margin < MARKED):
        axes.plot([one.frequency] * 2, [1.0 / one.margin, 1.0], color=COLOURS[1], lw=1.8,
                  label="to -1 at -180 degrees" if index == 0 else None)  # fmt: skip
        axes.plot([one.frequency], [1.0 / one.margin], "o", ms=4.5, color=COLOURS[1])
    top = float(np.quantile(np.abs(L), 0.98))
    ends = max(DEEPEST, 0.5 * float(np.abs(L).min())), min(max(10.0, 3.0 * top), HIGHEST)
    axes.set(xlim=(w[0], w[-1]), ylim=ends)
    head(axes, f"gain margin {_margins(m)['gain margin']}", "|L|", "frequency, rad/s")


def _phase(axes: Axes, w: Any, L: Any, m: Margins) -> None:
    degrees = np.degrees(np.angle(L))
    jumps = np.abs(np.diff(degrees, prepend=degrees[0])) > 170.0
    axes.semilogx(w, np.where(jumps, math.nan, degrees), color=COLOURS[0])
    for one in m.gain_crossovers:
        at = math.degrees(one.margin)
        bound = -180.0 if at > 0.0 else 180.0
        axes.plot([one.frequency] * 2, [bound, bound + at], color=COLOURS[2], lw=1.8)
        axes.plot([one.frequency], [bound + at], "o", ms=4.5, color=COLOURS[2])
        axes.annotate(f"{abs(at):.0f}", (one.frequency, bound + 0.5 * at), xytext=(5, 0),
                      textcoords="offset points", va="center", color=COLOURS[2])  # fmt: skip
    axes.set(xlim=(w[0], w[-1]), ylim=(-190.0, 190.0), yticks=range(-180, 181, 60))
    title = ", ".join(f"{name} {text}" for name, text in list(_margins(m).items())[1:])
    head(axes, title, "phase of L, degrees", "frequency, rad/s")


def _nyquist(axes: Axes, L: Any, m: Margins) -> None:
    turn = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 200))
    axes.plot(turn.real, turn.imag, color=GREY, lw=0.8, ls=":", label="|L| = 1")
    near = -1.0 + m.modulus_margin * turn
    axes.plot(near.real, near.imag, color=COLOURS[1], lw=1.0, ls=DASHES[1],
              label=f"nearest to -1: {m.modulus_margin:.3g}")  # fmt: skip
    axes.plot(L.real, L.imag, color=COLOURS[0], label="L")
    axes.plot(L.real, -L.imag, color=COLOURS[0], lw=0.7, alpha=0.6)
    axes.plot([-1.0], [0.0], "+", ms=9, mew=1.8, color=COLOURS[3])
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlim=(-WIDEST, WIDEST), ylim=(-0.8 * WIDEST, 0.8 * WIDEST))
    axes.legend(loc="upper right")
    head(axes, f"Nyquist diagram; sensitivity at most {m.sensitivity_peak:.3g}", "Im L", "Re L")


def _harmonic_balance(axes: Axes, view: LinearView, outside: Outside) -> None:
    M = outside.contact(frequency_grid(outside))
    # -1/n where the harmonic balance holds
    found = [float(outside.contact(np.array([one.cycle.frequency]))[0].real) for one in view.cycles]
    reach = max([WIDEST, *(-1.5 * at for at in found)])
    shown = np.where(np.abs(M) < 3.0 * reach, M, math.nan)
    axes.plot(shown.real, shown.imag, color=COLOURS[0], label="M = (c + jwd) G")
    axes.plot([-3.0 * reach, -1.0], [0.0, 0.0], color=COLOURS[3], lw=1.6, label="-1/n of the gap")
    axes.plot([-1.0], [0.0], "+", ms=9, mew=1.8, color=COLOURS[3])
    for at, one in zip(found, view.cycles, strict=True):
        face = COLOURS[1] if one.cycle.stable else "none"
        axes.plot([at], [0.0], "o", ms=6, mfc=face, color=COLOURS[1])
        axes.annotate(f"{one.cycle.frequency:.3g} rad/s", (at, 0.0), xytext=(0, 8),
                      textcoords="offset points", ha="center")  # fmt: skip
    axes.set(xlim=(-reach, 0.4 * reach), ylim=(-0.7 * reach, 0.7 * reach))
    axes.legend(loc="lower left")
    count = len(view.cycles) or "none"
    head(axes, f"Gap as describing function n; limit cycles predicted: {count}", "Im M", "Re M")
