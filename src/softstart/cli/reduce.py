"""`softstart reduce`: natural frequencies of a chain, and its reduction to the drive that stands for it."""

from __future__ import annotations

from typing import Any

from softstart.chain.model import Chain
from softstart.cli import options
from softstart.cli.options import command, option
from softstart.cli.running import Output, answers, attributed, controllers_from_options, option_value, working
from softstart.errors import InputError
from softstart.vibration import natural_vibration, reduce_chain
from softstart.views.terminal import print_json


@command("reduce")
@option("--factor", options.quantity("1", above=0.0))
@option("--force", is_flag=True)
@options.controller_option("--verify", several=True)
@option("--no-starts", is_flag=True)
@options.param_option
@options.of_file(Chain, "crane-4-mass")
@answers(out=True)
def reduce_command(
    *, chain: Chain, verify: list[str] | None, no_starts: bool, params: dict[str, str], **arguments: Any
) -> Output:  # fmt: skip
    """Compute the natural frequencies of a chain, and reduce it to two masses.

    CHAIN is a TOML file or the name of a shipped chain (crane-4-mass, tractor-like); by default the crane
    drive as a chain of four masses. Masses are in a row; lump the branches of a branched train first. Where
    the chain cannot be reduced as requested, its natural frequencies are shown nevertheless. The reduced
    drive has the first frequency, the node and the inertia of the chain and is an input of compare, optimize
    and tune. The error of the reduction in K_dyn is computed from starts of both under the controllers of
    --verify and 128 torque profiles.

    Options
    -------
    --factor NUMBER
        Smallest squared ratio of the frequencies that are left out to the first one. Default: 10.
    --force
        Continue where a frequency that is left out is too low.
    --verify A,B,...
        Controllers to set up for the drive and to run on the drive and on the chain. Default: all that
        need no parameter.
    --no-starts
        Skip the starts that determine whether two masses are sufficient.
    --param CONTROLLER.KEY=VALUE
        Set a parameter of a controller of --verify, for example ramp.time='0.2 s'. May be repeated.
    --set KEY=VALUE
        Change a parameter of the chain, for example mass[2].inertia='0.003 kg*m^2' or shaft[1].gap=0.2.
        May be repeated.
    --out DIR
        Write scheme, figures (SVG, PNG), tables (CSV), the drive (TOML) and report.md into this folder.
    """
    if no_starts and verify is not None:
        raise InputError("--no-starts: it leaves out the starts of --verify; give one of the two.")
    if params and verify is None:
        raise InputError("--param: it sets up a controller of --verify; name that, as --verify ramp.")
    from softstart.views import chains as views
    from softstart.views import sheet

    try:
        with working("reducing the chain ..."):
            given = {name: value for name, value in arguments.items() if value is not None}
            reduction = reduce_chain(chain, **given)
    except InputError as error:
        vibration, refused = natural_vibration(chain), error.sentences
        if option_value("as_json"):
            print_json({"chain": chain.name, "vibration": vibration.summary(), "refused": refused})
        else:
            sheet.print_sheet(views.vibration_sheet(vibration))
        raise
    drive = views.drive_of(reduction) if verify is None else reduction.to_drive()
    off = None
    if drive is not None and not no_starts:
        with working("starting the drive and the chain ..."), attributed():
            from softstart.chain.two_masses import two_mass_error

            chosen = None if verify is None else controllers_from_options(verify, params)
            off = two_mass_error(reduction.chain, drive, chosen)
    return lambda: views.summary(reduction, off), views.reduction_sheet(reduction, off)
