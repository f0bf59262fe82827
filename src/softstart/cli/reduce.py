"""`softstart reduce`: natural frequencies of a chain, and its reduction to the drive that stands for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.chain.elements import LIBRARY, TABLES
from softstart.chain.model import Chain
from softstart.cli.commands import Command, typed
from softstart.cli.completion import table_keys
from softstart.cli.options import (
    changes_option,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    param_option,
    quantity,
    read_changes,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.errors import InputError
from softstart.late import late
from softstart.vibration import Reduction, Vibration, natural_vibration, reduce_chain
from softstart.views.drawing import save_figure
from softstart.views.drives import drive_lines
from softstart.views.markdown import (
    markdown,
    output_folder,
    table_sections,
    write_report,
    write_table,
    write_text,
)
from softstart.views.terminal import (
    present,
    print_conclusion,
    print_lines,
    print_tables,
    sentence,
)

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.chain import two_masses as simulation
    from softstart.chain.two_masses import TwoMassError
    from softstart.views import chain_schemes
    from softstart.views import chains as views
else:  # no numba for a help, a wrong option or the Tab key; the kernel of starts only with --verify
    simulation = late("softstart.chain.two_masses")
    chain_schemes, views = late("softstart.views.chain_schemes"), late("softstart.views.chains")


def _check_verify(given: Mapping[str, Any]) -> None:
    if given["no_starts"] and given["verify"] is not None:
        raise InputError("--no-starts: it leaves out the starts of --verify; give one of the two.")
    if typed("params") and typed("verify") is None:
        raise InputError("--param: it sets up a controller of --verify; name that, as --verify ramp.")


@click.command(cls=Command, checks=[_check_verify])
@drive_argument(
    lambda name, settings: Chain.load(name, also=read_changes(settings)),
    name="chain",
    default="crane-4-mass",
    names=LIBRARY.names,
)
@click.option(
    "--factor",
    metavar="NUMBER",
    type=quantity("1", "give a number of 1 or more, as 10", above=0.0),
    help="Smallest squared ratio of the frequencies that are left out to the first one. Default: 10.",
)
@click.option("--force", is_flag=True, help="Continue where a frequency that is left out is too low.")
@changes_option(
    lambda: table_keys(TABLES),
    "Change a parameter of the chain, for example mass[2].inertia='0.003 kg*m^2' or shaft[1].gap=0.2.",
)
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
    and tune. The error of the reduction in K_dyn is computed from
    starts of both under the controllers of --verify and 128 torque profiles.
    """
    asked = {name: value for name, value in asked.items() if value is not None}
    with output_folder(out) as folder:
        try:
            with working("reducing the chain ..."), named_as_options():
                found = reduce_chain(chain, **asked)
            check(found, verify)
        except InputError as error:
            refused = error.sentences
            vibration = natural_vibration(chain.freed)
            present(
                lambda: {"chain": chain.name, "vibration": vibration.summary(), "refused": refused},
                lambda to: _show_vibration(to, vibration),
                as_json,
                None,
            )
            raise
        off: TwoMassError | None = None
        if makes_drive(found) and not no_starts:
            with working("starting the drive and the chain ..."):
                off = error_of(found, verify, params)
        if folder is not None:
            with working("drawing the figures ..."):
                _write(found, off, folder, command_line())

    present(
        lambda: {**summary(found), **views.verdict(off)},
        lambda to: _show(to, found, off),
        as_json,
        out and f"{out}: report.md, the scheme, the figures, the tables and what it was reduced to",
    )


def _show_vibration(to: Console, vibration: Vibration) -> None:
    """The chain and its frequencies, where it is not reduced."""
    print_lines(to, drive_lines(vibration.chain))
    print_tables(to, [views.frequencies_table(vibration)])


def _show(to: Console, found: Reduction, off: TwoMassError | None) -> None:
    """The chain, its frequencies and what came out."""
    print_lines(to, drive_lines(found.chain))
    print_tables(to, views.tables(found, off))
    if off is not None:
        sentence(to, views.enough(off), "bold")
    print_conclusion(to, [views.conclusion(found)], views.footnotes(found))


def _write(found: Reduction, off: TwoMassError | None, folder: Path, command: str) -> None:
    """Scheme, shapes, tables, the chain with all changes, what came out, and the report that ties them."""
    write_text(folder / "scheme.svg", chain_schemes.scheme_svg(found.chain))
    save_figure(found.vibration.plot(), folder, "shapes")
    write_text(folder / "chain.toml", found.chain.to_toml())
    results = "[chain.toml](chain.toml)"
    if makes_drive(found):
        write_text(folder / "drive.toml", found.to_drive().to_toml())
        results += ", [drive.toml](drive.toml) for compare, optimize and tune"
    for name, (headings, rows) in views.files(found, off).items():
        write_table(folder / name, headings, rows)

    parts = [
        f"# {markdown(found.chain.name)}: natural frequencies and reduction",
        "\n".join(f"- {markdown(line.strip())}" for line in drive_lines(found.chain)[1:]),
        markdown(views.conclusion(found)),
        "![scheme](scheme.svg)",
    ]
    parts += table_sections(views.tables(found, off))
    if off is not None:
        parts.append(markdown(views.enough(off)))
    parts.append("![shapes](shapes.svg)")
    starts = ", [verified.csv](verified.csv)" if off is not None and off.verified else ""
    parts += [
        *map(markdown, views.footnotes(found)),
        f"What was reduced, and to what: {results}.",
        f"All numbers: [frequencies.csv](frequencies.csv), [shapes.csv](shapes.csv){starts}.",
    ]
    write_report(folder, parts, command, f"Source: {markdown(found.chain.source) or 'none given'}.")


def error_of(
    found: Reduction, names: Sequence[str] | None, params: Mapping[str, Mapping[str, Any]]
) -> TwoMassError:
    """How far the drive is off the chain, under the controllers of these names and under torques."""
    made = None if names is None else make_controllers(names, params, prefix=True)
    with Attributed():
        return simulation.two_mass_error(found.chain, found.to_drive(), made)


def check(found: Reduction, names: Sequence[str] | None) -> None:
    """That there is a drive to start, where controllers are to be verified."""
    if names is not None and not makes_drive(found):
        raise InputError(
            "--verify: a start needs the tables [motor] and [start] with a target_speed; add them."
        )


def summary(found: Reduction) -> dict[str, Any]:
    """All of it as plain data."""
    drive = dict(found.to_drive().given()) if makes_drive(found) else None  # in SI
    return {**found.summary(), "vibration": found.vibration.summary(), "drive": drive}


def makes_drive(found: Reduction) -> bool:
    """Whether a drive comes out: there are a motor and a target speed."""
    return found.chain.motor is not None and found.chain.target_speed is not None
