"""`softstart reduce`: natural frequencies of a chain, and its reduction to the drive that stands for it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.completion import Keys, names_or_files, table_keys
from softstart.cli.completion import settings as settings_of
from softstart.cli.optimal_options import read_choice, read_positive
from softstart.cli.options import (
    Mistakes,
    command_line,
    controller_option,
    json_option,
    out_option,
    param_option,
    read_changes,
    read_names,
    read_params_of,
)
from softstart.errors import InputError
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from softstart.chain import Chain, Reduction
    from softstart.chain.simulation import Verification

DEFAULT_CHAIN = "crane-4-mass"
METHODS = ("lever", "modal")


def _chains() -> Iterable[str]:
    from softstart.chain.elements import LIBRARY

    return LIBRARY.names()


def _keys() -> Keys:
    from softstart.chain.elements import TABLES

    return table_keys(TABLES)


@click.command(cls=Command)
@click.argument(
    "chain", metavar="[CHAIN]", default=DEFAULT_CHAIN, shell_complete=names_or_files(_chains, ".toml")
)
@click.option("--to", metavar="N", help="Number of masses to reduce to. By default 2, a drive.")
@click.option(
    "--up-to",
    metavar="SPEED",
    help="Keep all frequencies up to this one, as 70 (rad/s), with as few masses as that takes.",
)
@click.option(
    "--method",
    metavar="|".join(METHODS),
    help="lever: partial systems merged one by one, as in the literature; modal: two masses with the first "
    "frequency and the node of the chain. By default lever.",
)
@click.option(
    "--factor",
    metavar="NUMBER",
    help="How many times the square of the highest wanted frequency those of partial systems must be. By "
    "default 10.",
)
@click.option("--force", is_flag=True, help="Go on where a partial frequency is too low.")
@click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=settings_of(_keys),
    help="Change a value of the chain, as mass[2].inertia='0.003 kg*m^2' or shaft[1].gap=0.2. May be "
    "repeated.",
)
@controller_option(
    "--verify",
    "A,B,...",
    "Controllers to set up for the drive and to start on the drive and on the whole chain.",
)
@param_option(
    "CONTROLLER.KEY=VALUE",
    "Set a parameter of a controller to verify, as ramp.time='0.2 s'. May be repeated.",
)
@json_option
@out_option(
    "Write scheme and figures (SVG, PNG), tables (CSV), the drive (TOML) and report.md into this folder."
)
def reduce(
    *,
    chain: str,
    to: str | None,
    up_to: str | None,
    method: str | None,
    factor: str | None,
    force: bool,
    settings: tuple[str, ...],
    verify: str | None,
    params: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Find the natural frequencies of a chain of masses, and reduce it to the drive that stands for it.

    CHAIN is a TOML file or the name of a shipped chain (crane-4-mass, tractor-like); without it, the crane
    drive as a chain of four masses is taken. The drive that comes out goes into compare, optimize and tune.
    """
    mistakes = Mistakes()
    one: Chain | None = None
    asked: dict[str, Any] = {"force": force}
    with mistakes.noted():
        one = read_chain(chain, settings)
    with mistakes.noted():
        asked["method"] = read_choice(method or "lever", "--method", METHODS)
    if to is not None:
        with mistakes.noted():
            asked["to"] = read_count(to)
    for option, text, unit, meaning in (
        ("up_to", up_to, "rad/s", "a frequency above 0, as 70 (rad/s) or '11 turn/s'"),
        ("factor", factor, "1", "a number of 1 or more, as 10"),
    ):
        if text is not None:
            with mistakes.noted():
                asked[option] = read_positive(text, f"--{option.replace('_', '-')}", unit, meaning)
    names: Sequence[str] | None = None
    with mistakes.noted():
        names = read_names(verify, "--verify")
    given: dict[str, dict[str, Any]] = {}
    with mistakes.noted():
        if params and names is None:
            raise InputError("--param: it sets up a controller of --verify; name that, as --verify ramp.")
        given = read_params_of(params, names or ())
    mistakes.settle()
    assert one is not None

    from softstart.cli.reduce_verify import check, verdict, verified
    from softstart.cli.running import working

    with output_folder(out) as folder:
        with working("reducing the chain ..."):
            found = reduced(one, asked)
            beside = beside_it(found)
        check(found, names)
        done: list[Verification] = []
        if names:
            with working("starting the drive and the chain ..."):
                done = verified(found, names, given)
        if folder is not None:
            from softstart.cli.reduce_report import write_reduction

            with working("drawing the figures ..."):
                write_reduction(found, beside, done, folder, command_line())

    from softstart.cli.reduce_text import show_reduction
    from softstart.views.terminal import console, print_json

    if as_json:
        verification = {"verified": [one.summary() for one in done], "verdict": verdict(done)}
        print_json({**summary(found, beside), **verification})
        return
    show_reduction(console(), found, beside, done)
    if out is not None:
        print(
            f"\nWritten to {out}: report.md, the scheme, the figures, the tables and what it was reduced to."
        )


def reduced(chain: Chain, asked: dict[str, Any]) -> Reduction:
    """The reduction asked for; keywords in sentences as options."""
    from softstart.chain import reduce_chain

    try:
        return reduce_chain(chain, **asked)
    except InputError as error:
        said = error.sentences
        for keyword, option in (
            ("to", "--to"),
            ("up_to", "--up-to"),
            ("method", "--method"),
            ("factor", "--factor"),
        ):
            said = tuple(
                s.replace(f"{keyword} = ", f"{option} = ", 1) if s.startswith(f"{keyword} = ") else s
                for s in said
            )
        raise InputError(said) from error


def beside_it(found: Reduction) -> Reduction | None:
    """The other method's two masses, to be shown beside; None where it has none."""
    from softstart.chain import reduce_chain

    if len(found.reduced.masses) != 2:
        return None
    other = "modal" if found.method == "lever" else "lever"
    try:
        return reduce_chain(found.chain, 2, method=other, force=True)  # type: ignore[arg-type]
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


def read_chain(name: str, settings: Sequence[str]) -> Chain:
    """The chain asked for, with its changes."""
    from softstart.chain import Chain

    mistakes = Mistakes()
    changes: dict[str, Any] = {}
    with mistakes.noted():
        changes = read_changes(settings)
    mistakes.settle()
    return Chain.load(name, also=changes)


def read_count(text: str) -> int:
    """A whole number of masses.

    >>> read_count("two")
    Traceback (most recent call last):
    softstart.errors.InputError: --to = "two": write a whole number of masses, 2 or more.
    """
    if not text.strip().isdecimal() or int(text) < 2:
        raise InputError(f'--to = "{text}": write a whole number of masses, 2 or more.')
    return int(text)
