"""`softstart init`: a drive file from the numbers of plates, catalogues and drawings."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from softstart.chain.elements import LIBRARY
from softstart.cli.asking import asked
from softstart.cli.options import changes_option, json_option, named_as_options, read_changes, typed_settings
from softstart.cli.running import working
from softstart.drive import data_sheet_words as sheets
from softstart.drive import library
from softstart.drive.data_sheet import DataSheet, UnknownStiffness
from softstart.drive.data_sheet_words import ABOUT, MACHINES, TYPICAL
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.input.parameters import Parameter
from softstart.views.terminal import console, print_json, sentence

TEMPLATE = """\
# A data sheet. Replace the example of what you know by your own value and take away the # before it.

"""
ANSWERS = Path("softstart-init.sheet.toml")  # in the current folder


@click.command("init")
@click.argument("sheet", required=False, metavar="[SHEET]")
@changes_option(
    DataSheet.TABLES,
    "Set a value of the data sheet, for example motor.rated_power='3 kW' or gear.ratio=31.5.",
)
@click.option("--out", metavar="FILE", help="Drive file to write, for example mine.toml. Default: print it.")
@click.option("--ask", is_flag=True, help="Ask for missing values; the default on a terminal without SHEET.")
@click.option("--template", is_flag=True, help="Print an empty data sheet to fill in.")
@json_option
def init_command(*, sheet: str | None, out: str | None, ask: bool, template: bool, as_json: bool) -> None:
    """Create a drive file from data sheet values.

    Asks for the values of rating plate, gearbox, shaft and load, and refers them to the motor shaft; comments
    in the file state the origin of each value, and what is assumed. SHEET is a TOML file with the values;
    --template prints one to fill in.
    """
    if template:
        print(template_text(), end="")
        return
    if out is not None and Path(out).exists():
        raise InputError(f"--out {out}: there is such a file already; give another name, or remove it.")
    given = read_changes(typed_settings())
    # of what is only printed, the answers are kept as long as they are not complete
    kept = ANSWERS if out is None else Path(out).with_suffix(".sheet.toml")
    asks = sheet is None and (ask or (sys.stdin.isatty() and not as_json))
    if asks:
        found = asked(given, kept)
    else:
        found = DataSheet.from_settings(given) if sheet is None else DataSheet.load(sheet, also=given)
    text, drive = found.drive_toml(), found.drive  # what the drive refuses is said before anything is written
    if asks and out is None:
        kept.unlink(missing_ok=True)
    if out is not None:
        with named_as_options(output="--out"):
            write_whole(Path(out), lambda stream: stream.write(text))
    if as_json:
        values = {"data_sheet": found.values(), "drive": drive.values(), "at_output": drive.at_output}
        print_json({**values, "plausibility_warnings": found.plausibility_warnings})
        return
    for one in found.plausibility_warnings:
        print(f"softstart: doubt: {one}", file=sys.stderr)
    for one in _both_ends(found):
        print(f"softstart: {one}", file=sys.stderr)
    if out is None:
        print(text, end="")
        return
    assumed = f" Assumed: {drive.assumed}." if drive.assumed else ""
    shipped = out in (*library.names(), *LIBRARY.names())  # whose name alone would be that machine
    path = shlex.quote(f"./{out}" if shipped else out)
    if isinstance(found.possible, UnknownStiffness) and (sheet or asks):  # the drive file has one end only
        path = shlex.quote(sheet or str(kept))
    sentence(console(), f"{out} is written.{assumed} What next: softstart compare {path}")


def _both_ends(sheet: DataSheet) -> list[str]:
    """How the strategies compare at both ends of an unknown stiffness."""
    if not isinstance(sheet.possible, UnknownStiffness):
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

    blocks = [
        [f"[{table.name}]"] * bool(table.name) + [*map(row, table.parameters)] for table in DataSheet.TABLES
    ]
    return TEMPLATE + "\n\n".join(map("\n".join, blocks)) + "\n"
