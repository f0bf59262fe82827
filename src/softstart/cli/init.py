"""`softstart init`: a drive file from the numbers of plates, catalogues and drawings."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path

import click

from softstart.chain.elements import LIBRARY
from softstart.cli.commands import Command
from softstart.cli.completion import files_only, table_keys
from softstart.cli.options import changes_option, json_option, named_as_options, read_changes
from softstart.drive import library
from softstart.drive.data_sheet import (
    ABOUT,
    INSTEAD,
    MACHINES,
    TYPICAL,
    USUAL,
    DataSheet,
    echo,
    if_empty,
    typed,
)  # fmt: skip
from softstart.drive.doubts import doubts
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.input.parameters import Parameter, Wording, read_value
from softstart.quantities import RefusedError
from softstart.views.terminal import console, print_json, sentence

# asked only where the other one was answered
AFTER = {
    "coupling_diameter": "coupling_play", "efficiency": "ratio", "play_diameter": "output_play",
    "shaft_length": "shaft_diameter", "rope_diameter": "rope_length", "rope_modulus": "rope_length",
}  # fmt: skip
FIRST = ("name", "source", "machine")


@click.command(cls=Command)
@click.argument("sheet", required=False, metavar="[SHEET]", shell_complete=files_only(".toml"))
@changes_option(
    lambda: table_keys(DataSheet.TABLES),
    "Set a value of the data sheet, for example motor.rated_power='3 kW' or gear.ratio=31.5.",
)
@click.option(
    "--out",
    metavar="FILE",
    shell_complete=files_only(".toml"),
    help="Drive file to write, for example mine.toml. Default: print it.",
)
@click.option("--ask", is_flag=True, help="Ask for missing values; the default on a terminal without SHEET.")
@click.option("--template", is_flag=True, help="Print an empty data sheet to fill in.")
@json_option
def init(
    *, sheet: str | None, settings: tuple[str, ...], out: str | None, ask: bool, template: bool, as_json: bool
) -> None:
    """Create a drive file from data sheet values.

    Asks for the values of rating plate, gearbox, shaft and load, and refers them to the motor shaft; comments
    in the file state the origin of each value, and what is assumed. SHEET is a TOML file with the values;
    --template prints one to fill in.
    """
    if template:
        click.echo(template_text(), nl=False)
        return
    given = read_changes(settings)
    if sheet is None and (ask or (sys.stdin.isatty() and not as_json)):
        found = asked(given)
    elif sheet is None:
        found = DataSheet.from_settings(given)
    else:
        found = DataSheet.load(sheet, also=given)
    text, drive = found.drive_toml(), found.drive  # what the drive refuses is said before anything is written
    if out is not None:
        if Path(out).exists():
            raise InputError(f"--out {out}: there is such a file already; give another name, or remove it.")
        with named_as_options():
            write_whole(Path(out), lambda stream: stream.write(text))
    if as_json:
        print_json({"data_sheet": found.values(), "drive": drive.values(), "doubts": doubts(drive)})
        return
    for one in doubts(drive):
        click.echo(f"softstart: doubt: {one}", err=True)
    if out is None:
        click.echo(text, nl=False)
    else:
        assumed = f" Assumed: {drive.assumed}." if drive.assumed else ""
        shipped = out in (*library.names(), *LIBRARY.names())  # whose name alone would be that machine
        path = shlex.quote(f"./{out}" if shipped else out)
        sentence(console(), f"{out} is written.{assumed} What next: softstart compare {path}")


def asked(given: Mapping[str, object]) -> DataSheet:
    """The data sheet from answers on standard input; what is in `given` by path is not asked."""
    answers, parameters = dict(given), DataSheet.PARAMETERS

    def known(name: str) -> bool:
        """Whether this was answered or given, and is more than 0."""
        try:
            return bool(read_value(parameters[name], answers[parameters[name].path]))
        except (KeyError, RefusedError):
            return False

    for p in sorted(parameters.values(), key=lambda p: p.name not in FIRST):
        machine = answers.get("load.machine")
        if p.path in given or machine not in ABOUT.get(p.name, (machine,)):
            continue
        if (p.name in AFTER and not known(AFTER[p.name])) or (p.name in INSTEAD and known(INSTEAD[p.name])):
            continue
        own = ("output_inertia",) if machine == "rotor" else ("mass", "radius")
        answer = _answer(p, needed=p.required or p.name in ("rated_torque", *own))
        if answer:
            answers[p.path] = answer
    return DataSheet.from_settings(answers)


def _answer(p: Parameter, needed: bool) -> str:
    """What is typed for one parameter, asked again until it can be read; "" for nothing."""
    while True:
        click.echo(question(p, needed), nl=False, err=True)
        line = sys.stdin.readline()
        if not line:
            click.echo(err=True)
            raise InputError(
                f"the answers end before {p.place} ({p.meaning}); give it with --set {p.path}={p.example}, "
                "or in a file (softstart init --template prints one)."
            )
        text = typed(p, line)
        if not text and not needed:
            return ""
        try:
            if not text:
                raise RefusedError(f"it is needed; write for example {p.example}")
            read_value(p, text)
        except RefusedError as refusal:
            said, usual = Wording(style="toml").refused(p, text, refusal), USUAL.get(p.name, p.unit)
            click.echo(f"  {said.replace(f'bare number in {p.unit}', f'bare number in {usual}')}", err=True)
            continue
        if said := echo(p, line):
            click.echo(f"  {said}", err=True)
        return text


def question(p: Parameter, needed: bool = False) -> str:
    """The question for one parameter, with the unit of a bare number and what Enter stands for.

    >>> question(DataSheet.PARAMETERS["backlash"])
    'backlash of the gears at the output in arcmin, as 15 [none]: '
    """
    unit = USUAL.get(p.name, p.unit)
    example = p.example.strip('"').removesuffix(f" {unit}")
    hint = f" ({TYPICAL[p.name][1]})" if p.name in TYPICAL else ""
    asks = f"{p.meaning}{f' in {unit}' if unit not in ('', '1') else ''}, as {example}{hint}"
    if p.choices:
        asks = f"{p.meaning}: {'; '.join(f'{word} ({MACHINES[word]})' for word in p.choices)}"
    return f"{asks}{'' if needed or p.required else f' [{if_empty(p)}]'}: "


def template_text() -> str:
    """An empty data sheet: every key in a comment, with an example."""
    blocks = []
    for table in DataSheet.TABLES:
        rows = []
        for p in table.parameters:
            only = f"only for {', '.join(ABOUT[p.name])}" if p.name in ABOUT else ""
            need = "needed" if p.required else only
            words = "; ".join(f"{word}: {MACHINES[word]}" for word in p.choices)
            nothing = "none" if p.required else if_empty(p)
            nothing = "" if nothing == "none" else f"without it {nothing}"
            about = "; ".join(
                filter(None, (p.meaning, words, TYPICAL.get(p.name, ("", ""))[1], need, nothing))
            )
            row = f"{p.key} = {p.example}"
            rows.append(f"{'' if p.required else '# '}{row}  # {about}")
        blocks.append("\n".join([f"[{table.name}]", *rows] if table.name else rows))
    return "\n\n".join(blocks) + "\n"
