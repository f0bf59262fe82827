"""`softstart linear`: the loop of a controller in contact, its margins, and limit cycles in the gap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

import softstart
from softstart.cli.commands import Command
from softstart.cli.options import (
    controller_option,
    drive_argument,
    json_option,
    out_option,
    param_option,
    read_machine,
    set_option,
)
from softstart.cli.running import Attributed, answering, make_controllers, working
from softstart.late import late

if TYPE_CHECKING:
    from softstart.chain.machines import Machine
    from softstart.views import linear as views
else:  # no numba for a help, a wrong option or the Tab key
    views = late("softstart.views.linear")


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
    *, drive: Machine, controller: str, params: dict[str, str], as_json: bool, out: str | None
) -> None:
    """Linearise the control loop: stability margins, modes, limit cycles.

    DRIVE is a TOML file or the name of a shipped drive or chain (see: softstart drives); by default the crane
    drive of the literature. The controller's step function is linearised at an instant of its start at which
    all gaps are closed; the loop is broken at the torque demand. Limit cycles through the gap of a drive are
    predicted by the describing function and checked on the exact plant.
    """
    with answering(as_json, out) as answer:
        with working("running and linearising the start ..."):
            (made,) = make_controllers([controller], {controller: params}, prefix=False)
            with Attributed():
                view = softstart.linear_view(drive, made)
        answer(view.summary, views.linear_sheet(view))
