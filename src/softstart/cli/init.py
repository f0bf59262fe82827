"""`softstart init`: a drive file from the numbers of plates, catalogues and drawings."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from softstart.chain.elements import LIBRARY
from softstart.cli.asking import ask_data_sheet
from softstart.cli.options import (
    command,
    json_option,
    named_as_options,
    option,
    read_changes,
    set_option,
    typed_settings,
)
from softstart.cli.running import working
from softstart.drive import data_sheet_words as sheets
from softstart.drive import library
from softstart.drive.data_sheet import DataSheet
from softstart.drive.data_sheet_words import ABOUT, MACHINES, TYPICAL
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.input.parameters import Parameter
from softstart.views.terminal import console, print_json, sentence

TEMPLATE = """\
# A data sheet. Replace the example of what you know by your own value and take away the # before it.

"""
ANSWERS = Path("softstart-init.sheet.toml")  # in the current folder


@command("init")
@click.argument("sheet", required=False, metavar="[SHEET]")
@set_option(DataSheet.TABLES)
@option("--out")
@option("--ask", is_flag=True)
@option("--template", is_flag=True)
@json_option
def init_command(*, sheet: str | None, out: str | None, ask: bool, template: bool, as_json: bool) -> None:
    """Create a drive file from data sheet values.

    Asks for the values of rating plate, gearbox, shaft and load, and refers them to the motor shaft; comments
    in the file state the origin of each value, and what is assumed. SHEET is a TOML file with the values;
    --template prints one to fill in.

    Options
    -------
    --set KEY=VALUE
        Set a value of the data sheet, for example motor.rated_power='3 kW' or gear.ratio=31.5. May be
        repeated.
    --out FILE
        Drive file to write, for example mine.toml. Default: print it.
    --ask
        Ask for missing values; the default on a terminal without SHEET.
    --template
        Print an empty data sheet to fill in.
    """
    if template:
        print(template_text(), end="")
        return
    if out is not None and Path(out).exists():
        raise InputError(f"--out {out}: there is such a file already; give another name, or remove it.")
    settings = read_changes(typed_settings())
    # of what is only printed, the answers are kept as long as they are not complete
    kept = ANSWERS if out is None else Path(out).with_suffix(".sheet.toml")
    asks = sheet is None and (ask or (sys.stdin.isatty() and not as_json))
    if asks:
        data_sheet = ask_data_sheet(settings, kept)
    else:
        data_sheet = (
            DataSheet.from_settings(settings) if sheet is None else DataSheet.load(sheet, also=settings)
        )
    # what the drive refuses is reported before anything is written
    text, drive = data_sheet.drive_toml(), data_sheet.drive
    if asks and out is None:
        kept.unlink(missing_ok=True)
    if out is not None:
        with named_as_options(output="--out"):
            write_whole(Path(out), lambda stream: stream.write(text))
    if as_json:
        values = {"data_sheet": data_sheet.values(), "drive": drive.values(), "at_output": drive.at_output}
        print_json({**values, "plausibility_warnings": data_sheet.plausibility_warnings})
        return
    for warning in data_sheet.plausibility_warnings:
        print(f"softstart: warning: {warning}", file=sys.stderr)
    for warning in _both_ends(data_sheet):
        print(f"softstart: {warning}", file=sys.stderr)
    if out is None:
        print(text, end="")
        return
    assumed = f" Assumed: {drive.assumed}." if drive.assumed else ""
    shipped = out in (*library.names(), *LIBRARY.names())  # whose name alone would be that machine
    path = shlex.quote(f"./{out}" if shipped else out)
    sentence(
        console(), f"{out} is written: {data_sheet.motion}.{assumed} What next: softstart compare {path}"
    )


def _both_ends(sheet: DataSheet) -> list[str]:
    """How the strategies compare at both ends of an unknown stiffness."""
    if sheet.drive.soft is None:
        return []
    from softstart.start.comparison import compare
    from softstart.views.starts import both_ends

    with working("comparing both ends of the stiffness ..."):
        return both_ends(compare(sheet))[1:]


def template_text() -> str:
    """An empty data sheet: every key in a comment, with an example, which is no data until it is replaced."""

    def row(p: Parameter) -> str:
        nothing = sheets.if_empty(p)
        about = (
            p.meaning,
            "; ".join(f"{word}: {MACHINES[word]}" for word in p.choices),
            TYPICAL.get(p.name, ("", ""))[1],
            "needed" if p.required else f"only for {', '.join(ABOUT[p.name])}" if p.name in ABOUT else "",
            "" if p.required or nothing == "none" else f"without it {nothing}",
        )
        return f"# {p.key} = {p.example}  # {'; '.join(filter(None, about))}"

    blocks = [[*[t.bracket] * bool(t.name), *map(row, t.parameters)] for t in DataSheet.TABLES]
    return TEMPLATE + "\n\n".join(map("\n".join, blocks)) + "\n"
