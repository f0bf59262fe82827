"""`softstart linear`: the loop of a controller in contact, its margins, and limit cycles in the gap."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import softstart
from softstart.cli.commands import Command
from softstart.cli.options import (
    command_line,
    controller_option,
    drive_argument,
    json_option,
    out_option,
    param_option,
    read_machine,
    set_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.late import late
from softstart.views.drawing import save_figure
from softstart.views.markdown import (
    figure_table,
    markdown,
    output_folder,
    table_sections,
    write_drive_report,
    write_table,
)
from softstart.views.terminal import (
    present,
    print_conclusion,
    print_figures,
    print_lines,
    print_tables,
    sentence,
)

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.chain.machines import Machine
    from softstart.views import linear as views
    from softstart.views import starts
else:  # no numba for a help, a wrong option or the Tab key
    views, starts = late("softstart.views.linear"), late("softstart.views.starts")


@click.command(cls=Command)
@drive_argument(read_machine)
@controller_option(
    "--controller", "NAME", "A controller's name, or path/to/file.py:ClassName.", required=True
)
@param_option("Set a parameter of the controller, for example period='0.5 ms'. May be repeated.")
@set_option
@json_option
@out_option(
    "Write the Bode and Nyquist diagrams (SVG, PNG), the response (CSV) and report.md into this folder."
)
def linear(
    *,
    drive: Machine,
    controller: str,
    params: dict[str, str],
    as_json: bool,
    out: str | None,
) -> None:
    """Linearise the control loop: stability margins, modes, limit cycles.

    DRIVE is a TOML file or the name of a shipped drive or chain (see: softstart drives); by default the crane
    drive of the literature. The controller's step function is linearised at an instant of its start at which
    all gaps are closed; the loop is broken at the torque demand. Limit cycles through the gap of a drive are
    predicted by the describing function and checked on the exact plant.
    """
    with output_folder(out) as folder:
        with working("running and linearising the start ..."):
            (made,) = make_controllers([controller], {controller: params}, prefix=False)
            with Attributed():
                view = softstart.linear_view(drive, made)
        if folder is not None:
            with working("drawing the figure ..."):
                write_linear(view, folder, command_line())

    files = "report.md, figure and response" if view.margins else "report.md"
    present(view.summary, lambda to: _show(to, view), as_json, out and f"{out}: {files}")


def _show(to: Console, view: softstart.LinearView) -> None:
    print_lines(to, starts.machine_lines(view.drive))
    sentence(to, f"  under  {view.name}")
    to.print()
    if view.margins is None:
        sentence(to, view.notes[0], "bold")
        return
    print_figures(to, views.margin_rows(view))
    print_tables(to, views.tables(view))
    print_conclusion(to, [], views.notes(view))


def write_linear(view: softstart.LinearView, folder: Path, command: str) -> None:
    """The files of --out."""
    parts = [f"# {markdown(view.drive.name)}: loop of {markdown(view.name)}"]
    if view.margins is None:
        parts.append(markdown(view.notes[0]))
    else:
        save_figure(view.plot(), folder, "linear")
        write_table(folder / "response.csv", *views.response(view))
        parts += [
            figure_table(views.margin_rows(view)),
            "![Bode and Nyquist diagrams](linear.svg)",
            "The loop over frequency: [response.csv](response.csv).",
            *table_sections(views.tables(view)),
            *map(markdown, views.notes(view)),
        ]
    write_drive_report(folder, parts, view.drive, command)
