"""`softstart linear`: the loop of a controller in contact, its margins, and limit cycles in the gap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from softstart.cli.commands import Command
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    check_name,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    out_option,
    param_option,
    read_drive,
    read_params,
    set_option,
)
from softstart.views.markdown import output_folder, write_table, write_text

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.linear.loop import Crossing, Margins
    from softstart.linear.view import LinearView

SHOWN_MODES = 16
SHOWN_CROSSINGS = 4


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@controller_option(
    "--controller", "NAME", "A controller's name, or path/to/file.py:ClassName.", required=True
)
@param_option("KEY=VALUE", "Set a parameter of the controller, as period='0.5 ms'. May be repeated.")
@set_option
@json_option
@out_option(
    "Write the Bode and Nyquist diagrams (SVG, PNG), the response (CSV) and report.md into this folder."
)
def linear(
    *,
    drive: str,
    controller: str,
    params: tuple[str, ...],
    settings: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Linearise a controller as it runs, and show margins, modes and limit cycles.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. The controller's own step is linearised at an instant of its start at which
    the gap is closed; the loop is broken at the torque demand. Limit cycles through the gap are foretold by
    the describing function and tried on the exact plant.
    """
    mistakes = Mistakes()
    with mistakes.noted():
        one = read_drive(drive, settings)
    with mistakes.noted():
        check_name(controller, "--controller")
    with mistakes.noted():
        given = read_params(params)
    mistakes.settle()

    with output_folder(out) as folder:
        from softstart.cli.running import Attributed, make_controllers, working

        with working("running and linearising the start ..."):
            (made,) = make_controllers([controller], {controller: given}, prefix=False)
            from softstart.linear.view import linear_view

            with Attributed():
                view = linear_view(one, made)
        if folder is not None:
            with working("drawing the figure ..."):
                write_linear(view, folder, command_line())

    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(view.summary())
    else:
        _show(console(), view)
        if out is not None:
            print(f"\nWritten to {out}: {'report.md, figure and response' if view.margins else 'report.md'}.")


def _frequency(value: float) -> str:
    from softstart.views.numbers import short

    return "-" if math.isnan(value) else f"{short(float(f'{value:.5g}'))} rad/s"


def _frequencies(crossings: Sequence[Crossing]) -> str:
    shown = [_frequency(one.frequency) for one in crossings[:SHOWN_CROSSINGS]]
    return ", ".join([*shown, *(["..."] if len(crossings) > SHOWN_CROSSINGS else [])]) or "-"


def margin_rows(view: LinearView) -> list[list[str]]:
    """The figures of the loop, as words and numbers."""
    from softstart.linear.pictures import delay_text, gain_text, phase_text

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


def mode_columns(view: LinearView) -> dict[str, list[str]]:
    """The closed loop's modes; a pair counts once."""
    from softstart.views.numbers import column_of, number

    modes = [mode for mode in view.modes if mode.value.imag >= 0.0][:SHOWN_MODES]
    return {
        "rad/s": column_of([mode.frequency for mode in modes]),
        "damping\nratio": [number(mode.damping_ratio, 4) for mode in modes],
        "pole z": [
            f"{mode.value.real:.5f}" + (f" +- {mode.value.imag:.5f}j" if mode.value.imag > 0.0 else "")
            for mode in modes
        ],
    }


def variation_columns(view: LinearView) -> dict[str, list[str]]:
    """The same controller on other drives."""
    from softstart.views.numbers import number

    def each(read: str, scale: float, decimals: int) -> list[str]:
        values = [getattr(one.margins, read) for one in view.variations]
        return ["any" if math.isinf(value) else number(scale * value, decimals) for value in values]

    return {
        "drive": [one.name for one in view.variations],
        "stable": ["yes" if one.stable else "no" for one in view.variations],
        "gain\nmargin": each("gain_margin", 1.0, 2),
        "phase\nmargin deg": each("phase_margin", 180.0 / math.pi, 1),
        "delay\nmargin ms": each("delay_margin", 1e3, 2),
        "modulus\nmargin": each("modulus_margin", 1.0, 3),
        "least\ndamping": [number(one.least_damping, 3) for one in view.variations],
    }


def cycle_columns(view: LinearView) -> dict[str, list[str]]:
    """Limit cycles foretold."""
    from softstart.views.numbers import column_of, number

    found = [one.cycle for one in view.cycles]
    said = [cycle_sentence(one.verdict.sentence, one.beyond_limits) for one in view.cycles]
    return {
        "rad/s": column_of([one.frequency for one in found]),
        "amplitude\nrad": [number(one.amplitude, 4) for one in found],
        "bias\nrad": [number(one.bias, 4) for one in found],
        "demand\n+- N m": [number(one.demand_amplitude, 1) for one in found],
        "foretold": ["stable" if one.stable else "unstable" for one in found],
        "on the exact plant": said,
    }


def cycle_sentence(verdict: str, beyond: bool) -> str:
    """What the exact plant says, and whether the motor could make the torque."""
    return verdict + (" (the demand is beyond the motor's limits)" if beyond else "")


TABLES = (
    ("Modes of the closed loop", mode_columns, ("pole z",)),
    ("The same controller on other drives", variation_columns, ("drive", "stable")),
    (
        "Limit cycles foretold by the describing function of the gap",
        cycle_columns,
        ("foretold", "on the exact plant"),
    ),
)


def gap_sentence(view: LinearView) -> str:
    """What was looked for in the gap, and under which mean torque."""
    if view.cycles:
        mean = view.cycles[0].cycle.mean_torque
        if mean:
            return f"The vibrations are biased by the mean shaft torque of {mean:.4g} N m."
        return "The vibrations are unbiased: the mean shaft torque is 0."
    return "No limit cycle through the gap is foretold by the describing function."


def _show(to: Console, view: LinearView) -> None:
    from softstart.views.drives import drive_lines
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(drive_lines(view.drive)):
        sentence(to, line, "bold" if index == 0 else "")
    sentence(to, f"  under  {view.name}")
    to.print()
    if view.margins is None:
        sentence(to, view.notes[0], "bold")
        return
    print_table(to, [Column("", False), Column("", False)], margin_rows(view), headings=False)
    for title, columns, texts in TABLES:
        table = columns(view)
        rows = [list(row) for row in zip(*table.values(), strict=True)]
        if rows:
            to.print()
            print_table(to, [Column(name, name not in texts) for name in table], rows, title=title)
    to.print()
    for note in (gap_sentence(view), *view.notes):
        sentence(to, note, "dim")


def write_linear(view: LinearView, folder: Path, command: str) -> None:
    """The files of --out."""
    from softstart.views.markdown import drive_table, markdown, markdown_table, provenance

    parts = [f"# {markdown(view.drive.name)}: loop of {markdown(view.name)}"]
    if view.margins is None:
        parts.append(markdown(view.notes[0]))
    else:
        from softstart.views.drawing import save_figure

        save_figure(view.plot(), folder, "linear")
        _write_response(view, view.margins, folder)
        parts += [
            markdown_table(["figure", "value"], margin_rows(view), numbers_from=1),
            "![Bode and Nyquist diagrams](linear.svg)",
            "The loop over frequency: [response.csv](response.csv).",
        ]
        for title, columns, _ in TABLES:
            table = columns(view)
            rows = [list(row) for row in zip(*table.values(), strict=True)]
            if rows:
                parts += [f"## {title}", markdown_table([" ".join(name.split()) for name in table], rows)]
        parts += [gap_sentence(view), *map(markdown, view.notes)]
    parts += ["## The drive", drive_table(view.drive), provenance(view.drive, command)]
    write_text(folder / "drive.toml", view.drive.to_toml())
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _write_response(view: LinearView, m: Margins, folder: Path) -> None:
    import numpy as np

    from softstart.linear.systems import at_points, frequencies, poles

    assert view.own_loop is not None
    loop = view.own_loop.broken
    marked = [one.frequency for one in (*m.gain_crossovers, *m.phase_crossovers)]
    w = np.unique(np.concatenate([frequencies(view.period, poles(loop)), marked]))
    L = at_points(loop, np.exp(1j * w * view.period))[:, 0, 0]
    columns = ("frequency [rad/s]", "|L|", "phase of L [rad]", "|1/(1 + L)|")
    rows = np.column_stack([w, np.abs(L), np.angle(L), 1.0 / np.abs(1.0 + L)])
    write_table(folder / "response.csv", columns, rows.tolist())
