"""`softstart init`: a drive file from the numbers of plates, catalogues and drawings."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path

import click

from softstart.chain.elements import LIBRARY
from softstart.cli.options import changes_option, json_option, named_as_options, read_changes, typed_settings
from softstart.drive import data_sheet as sheets
from softstart.drive import library
from softstart.drive.data_sheet import ABOUT, INSTEAD, MACHINES, TYPICAL, USUAL, DataSheet
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


@click.command()
@click.argument("sheet", required=False, metavar="[SHEET]")
@changes_option(
    DataSheet.TABLES,
    "Set a value of the data sheet, for example motor.rated_power='3 kW' or gear.ratio=31.5.",
)
@click.option("--out", metavar="FILE", help="Drive file to write, for example mine.toml. Default: print it.")
@click.option("--ask", is_flag=True, help="Ask for missing values; the default on a terminal without SHEET.")
@click.option("--template", is_flag=True, help="Print an empty data sheet to fill in.")
@json_option
def init(*, sheet: str | None, out: str | None, ask: bool, template: bool, as_json: bool) -> None:
    """Create a drive file from data sheet values.

    Asks for the values of rating plate, gearbox, shaft and load, and refers them to the motor shaft; comments
    in the file state the origin of each value, and what is assumed. SHEET is a TOML file with the values;
    --template prints one to fill in.
    """
    if template:
        print(template_text(), end="")
        return
    given = read_changes(typed_settings())
    if sheet is None and (ask or (sys.stdin.isatty() and not as_json)):
        given = asked(given)
    found = DataSheet.from_settings(given) if sheet is None else DataSheet.load(sheet, also=given)
    text, drive = found.drive_toml(), found.drive  # what the drive refuses is said before anything is written
    if out is not None:
        if Path(out).exists():
            raise InputError(f"--out {out}: there is such a file already; give another name, or remove it.")
        with named_as_options(output="--out"):
            write_whole(Path(out), lambda stream: stream.write(text))
    if as_json:
        print_json({"data_sheet": found.values(), "drive": drive.values(), "doubts": doubts(drive)})
        return
    for one in doubts(drive):
        print(f"softstart: doubt: {one}", file=sys.stderr)
    if out is None:
        print(text, end="")
        return
    assumed = f" Assumed: {drive.assumed}." if drive.assumed else ""
    shipped = out in (*library.names(), *LIBRARY.names())  # whose name alone would be that machine
    path = shlex.quote(f"./{out}" if shipped else out)
    sentence(console(), f"{out} is written.{assumed} What next: softstart compare {path}")


def asked(given: Mapping[str, object]) -> dict[str, object]:
    """The values by path, with answers from standard input to what is not in `given`."""
    found, parameters = dict(given), DataSheet.PARAMETERS

    def known(name: str | None) -> bool:
        """Whether this was answered or given, and is more than 0."""
        try:
            return name is not None and bool(read_value(parameters[name], found[parameters[name].path]))
        except (KeyError, RefusedError):
            return False

    for p in sorted(parameters.values(), key=lambda p: p.name not in FIRST):
        machine = found.get("load.machine")
        about = machine in ABOUT.get(p.name, (machine,)) and (p.name not in AFTER or known(AFTER[p.name]))
        if p.path not in given and about and not known(INSTEAD.get(p.name)):
            own = ("output_inertia",) if machine == "rotor" else ("mass", "radius")
            if answer := _answer(p, needed=p.required or p.name in ("rated_torque", *own)):
                found[p.path] = answer
    return found


def _answer(p: Parameter, needed: bool) -> str:
    """What is typed for one parameter, asked again until it can be read; "" for nothing."""
    while True:
        print(question(p, needed), end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise InputError(
                f"the answers end before {p.place} ({p.meaning}); give it with --set {p.path}={p.example}, "
                "or in a file (softstart init --template prints one)."
            )
        text = sheets.typed(p, line)
        try:
            if not text and needed:
                raise RefusedError(f"it is needed; write for example {p.example}")
            said = ""
            if text:
                read_value(p, text)
                said = sheets.echo(p, line)
        except RefusedError as refusal:
            reason, usual = Wording(style="toml").refused(p, text, refusal), USUAL.get(p.name, p.unit)
            print(
                f"  {reason.replace(f'bare number in {p.unit}', f'bare number in {usual}')}", file=sys.stderr
            )
            continue
        if said:
            print(f"  {said}", file=sys.stderr)
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
    return f"{asks}{'' if needed or p.required else f' [{sheets.if_empty(p)}]'}: "


def template_text() -> str:
    """An empty data sheet: every key in a comment, with an example."""

    def row(p: Parameter) -> str:
        nothing = sheets.if_empty(p)
        about = (
            p.meaning,
            "; ".join(f"{word}: {MACHINES[word]}" for word in p.choices),
            TYPICAL.get(p.name, ("", ""))[1],
            "needed" if p.required else f"only for {', '.join(ABOUT[p.name])}" if p.name in ABOUT else "",
            "" if p.required or nothing == "none" else f"without it {nothing}",
        )
        return f"{'' if p.required else '# '}{p.key} = {p.example}  # {'; '.join(filter(None, about))}"

    blocks = [
        [f"[{table.name}]"] * bool(table.name) + [*map(row, table.parameters)] for table in DataSheet.TABLES
    ]
    return "\n\n".join(map("\n".join, blocks)) + "\n"
