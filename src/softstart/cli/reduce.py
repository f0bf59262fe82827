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
    choice,
    command_line,
    controller_option,
    count,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    param_option,
    quantity,
    read_changes,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.views.drawing import save_figure
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

    from softstart.chain import reduction, simulation
    from softstart.chain.reduction import Reduction
    from softstart.chain.two_masses import TwoMassError
    from softstart.chain.vibration import Vibration
    from softstart.views import chain_schemes
    from softstart.views import chains as views
else:  # no numba for a help, a wrong option or the Tab key; the kernel of starts only with --verify
    reduction, simulation = late("softstart.chain.reduction"), late("softstart.chain.two_masses")
    chain_schemes, views = late("softstart.views.chain_schemes"), late("softstart.views.chains")

METHODS = ("lever", "modal")


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
@click.option("--to", metavar="N", type=count(2), help="Number of masses to reduce to. Default: 2, a drive.")
@click.option(
    "--up-to",
    metavar="SPEED",
    type=quantity("rad/s", "give a frequency above 0, as 70 (rad/s) or '11 turn/s'", above=0.0),
    help="Keep all natural frequencies up to this one, for example 70 (rad/s), with as few masses as "
    "possible.",
)
@click.option(
    "--method",
    metavar="|".join(METHODS),
    type=choice(*METHODS),
    default="lever",
    help="lever: merge partial systems one by one, as in the literature; modal: two masses with the first "
    "frequency and the node of the chain. Default: lever.",
)
@click.option(
    "--factor",
    metavar="NUMBER",
    type=quantity("1", "give a number of 1 or more, as 10", above=0.0),
    help="Smallest ratio of the squared partial frequencies to that of the highest frequency to keep. "
    "Default: 10.",
)
@click.option("--force", is_flag=True, help="Continue where a partial frequency is too low.")
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
    drive is an input of compare, optimize and tune. The error of the reduction in K_dyn is computed from
    starts of both under the controllers of --verify and 128 torque profiles.
    """
    asked = {name: value for name, value in asked.items() if value is not None}
    with output_folder(out) as folder:
        try:
            with working("reducing the chain ..."), named_as_options():
                found = reduction.reduce_chain(chain, **asked)
                beside = beside_it(found)
            check(found, verify)
        except InputError as error:
            from softstart.chain.vibration import natural_vibration

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
                _write(found, beside, off, folder, command_line())

    present(
        lambda: {**summary(found, beside), **views.verdict(off)},
        lambda to: _show(to, found, beside, off),
        as_json,
        out and f"{out}: report.md, the scheme, the figures, the tables and what it was reduced to",
    )


def _show_vibration(to: Console, vibration: Vibration) -> None:
    """The chain and its frequencies, where it is not reduced."""
    print_lines(to, views.chain_lines(vibration.chain))
    print_tables(to, [views.frequencies_table(vibration)])


def _show(to: Console, found: Reduction, beside: Reduction | None, off: TwoMassError | None) -> None:
    """The chain, its frequencies, the steps and what came out."""
    print_lines(to, views.chain_lines(found.chain))
    print_tables(to, views.tables(found, beside, off))
    if off is not None:
        sentence(to, views.enough(off), "bold")
    print_conclusion(to, [views.conclusion(found)], views.footnotes(found))


def _write(
    found: Reduction, beside: Reduction | None, off: TwoMassError | None, folder: Path, command: str
) -> None:
    """Scheme, figures, tables, the chain with all changes, what came out, and the report that ties them."""
    vibration = found.whole_vibration
    write_text(folder / "scheme.svg", chain_schemes.scheme_svg(found.chain))
    write_text(folder / "reduced-scheme.svg", chain_schemes.scheme_svg(found.reduced))
    pictures = {"shapes": vibration.plot()}
    if any(step.ratio != float("inf") for step in found.steps):
        pictures["reduction"] = found.plot()
    for stem, figure in pictures.items():
        save_figure(figure, folder, stem)
    write_text(folder / "chain.toml", found.chain.to_toml())
    write_text(folder / "reduced.toml", found.reduced.to_toml())
    results = "[chain.toml](chain.toml), [reduced.toml](reduced.toml)"
    if makes_drive(found):
        write_text(folder / "drive.toml", found.to_drive().to_toml())
        results += ", [drive.toml](drive.toml) for compare, optimize and tune"
    for name, (headings, rows) in views.files(found, off).items():
        write_table(folder / name, headings, rows)

    parts = [
        f"# {markdown(found.chain.name)}: natural frequencies and reduction",
        "\n".join(f"- {markdown(line.strip())}" for line in views.chain_lines(found.chain)[1:]),
        markdown(views.conclusion(found)),
        "![scheme](scheme.svg)",
        "![reduced scheme](reduced-scheme.svg)",
    ]
    parts += table_sections(views.tables(found, beside, off))
    if off is not None:
        parts.append(markdown(views.enough(off)))
    parts += [f"![{stem}]({stem}.svg)" for stem in pictures]
    starts = ", [verified.csv](verified.csv)" if off is not None and off.verified else ""
    parts += [
        *map(markdown, views.footnotes(found)),
        f"What was reduced, and to what: {results}.",
        "All numbers: [frequencies.csv](frequencies.csv), [shapes.csv](shapes.csv), "
        "[holzer.csv](holzer.csv), [partial-systems.csv](partial-systems.csv), [steps.csv](steps.csv)"
        f"{starts}.",
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
    """That there is a drive to design on, where controllers are to be verified."""
    if names is None or makes_drive(found):
        return
    mistakes = Mistakes()
    count = len(found.reduced.masses)
    if count != 2:
        with mistakes.noted():
            raise InputError(
                f"--verify: a start is designed on two masses, and {count} are left; leave out --to and "
                "--up-to, or take --method modal."
            )
    with mistakes.noted():
        if found.chain.motor is None or found.chain.target_speed is None:
            raise InputError(
                "--verify: a start needs the tables [motor] and [start] with a target_speed; add them."
            )
    mistakes.settle()


def beside_it(found: Reduction) -> Reduction | None:
    """The other method's two masses, to be shown beside; None where it has none."""
    if len(found.reduced.masses) != 2:
        return None
    other = "modal" if found.method == "lever" else "lever"
    try:
        return reduction.reduce_chain(found.chain, 2, method=other, force=True)  # type: ignore[arg-type]
    except InputError:
        return None


def summary(found: Reduction, beside: Reduction | None) -> dict[str, Any]:
    """All of it as plain data."""
    data = found.summary()
    data["vibration"] = found.whole_vibration.summary()
    data["drive"] = drive_data(found)
    data["beside"] = None if beside is None else {**beside.summary(), "drive": drive_data(beside)}
    return data


def drive_data(found: Reduction) -> dict[str, Any] | None:
    """The parameters of the drive in SI, or None where there is none."""
    return dict(found.to_drive().given()) if makes_drive(found) else None


def makes_drive(found: Reduction) -> bool:
    """Whether a drive comes out: two masses, with a motor and a target speed."""
    chain = found.reduced
    return len(chain.masses) == 2 and chain.motor is not None and chain.target_speed is not None
