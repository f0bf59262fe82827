"""`softstart study`: questions of the literature, answered with numbers."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import click

from softstart.cli.commands import Command
from softstart.cli.completion import studies
from softstart.cli.options import json_option, out_option
from softstart.cli.running import answering, working
from softstart.errors import InputError, Mistakes
from softstart.study import Study, StudyResult, find_study, study_names
from softstart.views.drawing import PICTURE_ENDINGS
from softstart.views.markdown import file_stem, output_folder
from softstart.views.numbers import Column, Table, printable
from softstart.views.sheet import Sheet, rows_file


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=studies)
@click.option("--list", "only_list", is_flag=True, help="List the studies.")
@json_option
@out_option("Write pictures (SVG, PNG), tables (CSV) and report.md into this folder.")
def study(name: str | None, only_list: bool, as_json: bool, out: str | None) -> None:
    """List the studies, or run one."""
    listed = name is None or only_list
    if listed and out is not None:
        raise InputError(f'--out = "{out}": a list writes no files; name a study: softstart study NAME.')
    with answering(as_json, out) as answer:
        if listed:
            answer(*_list())
            return
        found = find_study(str(name))
        # what the study writes itself is put in place first
        with output_folder(out) as folder, working(f"{found.name}: beginning ...") as progress:
            result = found.run(folder, lambda doing: progress(f"{found.name}: {doing}"))
        about = {"study": found.name, "title": found.title}
        answer(lambda: about | result.summary(), _sheet(found, result))


def _list() -> tuple[Any, Sheet]:
    """All studies as data, and as a table with those that cannot be loaded."""
    found: list[Study] = []
    broken = Mistakes()
    for name in study_names():
        with broken.noted():
            found.append(find_study(name))
    data = [
        {"name": one.name, "title": one.title, "pictures": one.pictures,
         "files": [f"{stem}.{ending}" for stem in one.pictures for ending in PICTURE_ENDINGS]}
        for one in found
    ]  # fmt: skip
    rows = [[one.name, one.title, ", ".join(one.pictures) or "-"] for one in found]
    run = "Run one, with its pictures and its tables as CSV: softstart study NAME --out DIR"
    table = Table.of_texts(("study", "question", "pictures, each as .svg and .png"), rows)
    return lambda: {"studies": data}, Sheet(
        "Studies", ["Studies"], tables=[table], notes=[run, *broken.sentences]
    )


def _sheet(found: Study, result: StudyResult) -> Sheet:
    """Tables, claims with their verdicts and evidence, pictures; each table and the claims as CSV."""
    stems = ["claims"]
    for table in result.tables:
        stems.append(file_stem(table.title.lower(), stems))
    claims = [(one.statement, one.verdict, one.evidence) for one in result.claims]
    told = [
        [f"{i:2}. {verdict}", printable(f"{statement}\n{evidence}")]
        for i, (statement, verdict, evidence) in enumerate(claims, start=1)
    ]
    files = {
        f"{stem}.csv": rows_file(table.columns, table.rows)
        for stem, table in zip(stems[1:], result.tables, strict=True)
    }
    if claims:
        files["claims.csv"] = rows_file(("statement", "verdict", "evidence"), claims)
    return Sheet(
        title=f"{found.name}: {found.title}",
        lines=[f"{found.name}: {found.title}"],
        tables=[*map(_shown, result.tables), Table.of_texts(("claims", ""), told)],
        figures={stem: partial(result.figures.__getitem__, stem) for stem in result.figures},
        files=files,
    )


def _shown(table: Any) -> Table:
    """A table of a study, as it is shown: floats with five digits."""

    def text(cell: Any) -> str:
        if cell is None or (isinstance(cell, float) and math.isnan(cell)):
            return "-"
        return printable(f"{cell:.5g}" if isinstance(cell, float) else str(cell))

    columns = [
        Column(name, all(isinstance(row[i], int | float | None) for row in table.rows))
        for i, name in enumerate(table.columns)
    ]
    return Table(table.title, columns, [list(map(text, row)) for row in table.rows])
