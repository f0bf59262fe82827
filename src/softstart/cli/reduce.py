"""`softstart reduce`: natural frequencies of a chain, and its reduction to the drive that stands for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from softstart.chain.elements import LIBRARY, TABLES
from softstart.chain.model import Chain
from softstart.cli.commands import Command
from softstart.cli.options import (
    controller_option,
    file_options,
    json_option,
    named_as_options,
    out_option,
    param_option,
    quantity,
)
from softstart.cli.running import Attributed, answering, make_controllers, working
from softstart.errors import InputError
from softstart.late import late
from softstart.vibration import natural_vibration, reduce_chain
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.chain import two_masses as simulation
    from softstart.views import chains as views
    from softstart.views import sheet
else:  # no numba for a help, a wrong option or the Tab key; the kernel of starts only with --verify
    simulation, views = late("softstart.chain.two_masses"), late("softstart.views.chains")
    sheet = late("softstart.views.sheet")


@click.command(cls=Command)
@file_options(Chain, "crane-4-mass", LIBRARY, TABLES, "mass[2].inertia='0.003 kg*m^2' or shaft[1].gap=0.2")
@click.option(
    "--factor",
    metavar="NUMBER",
    type=quantity("1", "give a number of 1 or more, as 10", above=0.0),
    help="Smallest squared ratio of the frequencies that are left out to the first one. Default: 10.",
)
@click.option("--force", is_flag=True, help="Continue where a frequency that is left out is too low.")
@controller_option(
    "--verify",
    "A,B,...",
    "Controllers to set up for the drive and to run on the drive and on the chain. Default: all that need "
    "no parameter.",
)
@click.option(
    "--no-starts", is_flag=True, help="Skip the starts that determine whether two masses are sufficient."
)
@param_option(
    "Set a parameter of a controller of --verify, for example ramp.time='0.2 s'. May be repeated.", "verify"
)
@json_option
@out_option(
    "Write scheme and figures (SVG, PNG), tables (CSV), the drive (TOML) and report.md into this folder."
)
def reduce(
    *,
    chain: Chain,
    verify: list[str] | None,
    no_starts: bool,
    params: dict[str, dict[str, str]],
    as_json: bool,
    out: str | None,
    **asked: Any,
) -> None:
    """Compute the natural frequencies of a chain, and reduce it to two masses.

    CHAIN is a TOML file or the name of a shipped chain (crane-4-mass, tractor-like); by default the crane
    drive as a chain of four masses. Masses are in a row; lump the branches of a branched train first. Where
    the chain cannot be reduced as requested, its natural frequencies are shown nevertheless. The reduced
    drive has the first frequency, the node and the inertia of the chain and is an input of compare, optimize
    and tune. The error of the reduction in K_dyn is computed from starts of both under the controllers of
    --verify and 128 torque profiles.
    """
    if no_starts and verify is not None:
        raise InputError("--no-starts: it leaves out the starts of --verify; give one of the two.")
    if params and verify is None:
        raise InputError("--param: it sets up a controller of --verify; name that, as --verify ramp.")
    with answering(as_json, out) as answer:
        try:
            with working("reducing the chain ..."), named_as_options():
                found = reduce_chain(chain, **{name: one for name, one in asked.items() if one is not None})
        except InputError as error:
            vibration, refused = natural_vibration(chain.freed), error.sentences
            if as_json:
                print_json({"chain": chain.name, "vibration": vibration.summary(), "refused": refused})
            else:
                sheet.show(views.vibration_sheet(vibration))
            raise
        drive = views.drive_of(found) if verify is None else found.to_drive()
        off = None
        if drive is not None and not no_starts:
            with working("starting the drive and the chain ..."), Attributed():
                made = None if verify is None else make_controllers(verify, params, prefix=True)
                off = simulation.two_mass_error(found.chain, drive, made)
        answer(lambda: views.summary(found, off), views.reduction_sheet(found, off))
