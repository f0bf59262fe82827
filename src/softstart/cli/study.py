"""`softstart study`: questions of the literature, answered with numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.completion import studies
from softstart.cli.options import json_option, out_option
from softstart.cli.running import working
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.study import Claim, Study, StudyResult, Table, Verdict, find_study, study_names
from softstart.views import numbers
from softstart.views.drawing import PICTURE_ENDINGS, save_figure
from softstart.views.markdown import file_stem, output_folder, write_table
from softstart.views.numbers import printable
from softstart.views.terminal import console, print_json, print_table, sentence

if TYPE_CHECKING:
    import rich.text as rich_text
    from rich.console import Console
else:
    rich_text = late("rich.text")

HEADINGS = ("study", "question", "pictures, each as .svg and .png")
MARKS = {Verdict.CONFIRMED: "green", Verdict.REFUTED: "red", Verdict.PARTLY: "yellow"}


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=studies)
@click.option("--list", "only_list", is_flag=True, help="List the studies.")
@json_option
@out_option("Write pictures (SVG, PNG) and tables (CSV) into this folder.")
def study(name: str | None, only_list: bool, as_json: bool, out: str | None) -> None:
    """List the studies, or run one."""
    if name is None or only_list:
        if out is not None:
            raise InputError(f'--out = "{out}": a list writes no files; name a study: softstart study NAME.')
        _list(as_json)
        return
    found = find_study(name)
    with output_folder(out) as folder, working(f"{found.name}: beginning ...") as show:

        def progress(doing: str) -> None:
            show(f"{found.name}: {doing}")

        result = found.run(folder, progress)
        if folder is not None:
            progress("writing")
            write_study(found, result, folder)

    if as_json:
        print_json({"study": found.name, "title": found.title, **result.summary()})
    else:
        _show(console(), found, result)
        if out is not None:
            pictures = ", ".join(result.figures) or "none"
            print(f"\nWritten to {out}: {len(result.tables)} tables, claims.csv; pictures: {pictures}.")


def write_study(found: Study, result: StudyResult, folder: Path) -> None:
    """Pictures as SVG and PNG, each table and the claims as CSV."""
    if result.figures:
        for stem, figure in result.figures.items():
            save_figure(figure, folder, stem)
    taken: list[str] = ["claims"]
    for table in result.tables:
        taken.append(file_stem(table.title.lower(), taken))
        write_table(folder / f"{taken[-1]}.csv", table.columns, table.rows)
    if result.claims:
        rows = [list(claim.summary().values()) for claim in result.claims]
        write_table(folder / "claims.csv", ("statement", "verdict", "evidence"), rows)


def _listed(one: Study) -> dict[str, Any]:
    """A study in the list: `pictures` are names without ending, `files` those that --out writes."""
    files = [f"{stem}.{ending}" for stem in one.pictures for ending in PICTURE_ENDINGS]
    return {"name": one.name, "title": one.title, "pictures": one.pictures, "files": files}


def _list(as_json: bool) -> None:
    found: list[Study] = []
    broken = Mistakes()
    for name in study_names():
        with broken.noted():
            found.append(find_study(name))
    if as_json:
        print_json({"studies": [_listed(one) for one in found]})
        return
    to = console()
    rows = [[one.name, one.title, ", ".join(one.pictures) or "-"] for one in found]
    print_table(to, numbers.Table.of_texts(HEADINGS, rows))
    to.print()
    sentence(to, "Run one, with its pictures and its tables as CSV: softstart study NAME --out DIR")
    for one in broken.sentences:
        sentence(to, one)


def _show(to: Console, found: Study, result: StudyResult) -> None:
    sentence(to, f"{found.name}: {found.title}", "bold")
    for table in result.tables:
        to.print()
        _show_table(to, table)
    if result.claims:
        to.print()
        _show_claims(to, result.claims)


def _show_table(to: Console, table: Table) -> None:
    numeric = [
        all(isinstance(row[i], int | float | None) for row in table.rows) for i in range(len(table.columns))
    ]
    columns = [numbers.Column(name, number) for name, number in zip(table.columns, numeric, strict=True)]
    rows = [[printable(_cell(cell)) for cell in row] for row in table.rows]
    print_table(to, numbers.Table(table.title, columns, rows))


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _show_claims(to: Console, claims: Sequence[Claim]) -> None:
    """Each claim with its verdict, wrapped to the right of it, and the evidence below."""
    to.print(rich_text.Text("Claims", style="bold"))
    for number, claim in enumerate(claims, start=1):
        verdict = Verdict(claim.verdict)
        head = f"{number:2}. {verdict.value:9}  "
        width, margin = to.width - len(head), " " * len(head)
        statement = f"\n{margin}".join(wrap(printable(claim.statement), width))
        to.print(
            rich_text.Text(head, style=f"bold {MARKS[verdict]}").append(statement, style="default"),
            soft_wrap=True,
        )
        for line in wrap(printable(claim.evidence), width):
            to.print(rich_text.Text(margin + line, style="dim"), soft_wrap=True)
