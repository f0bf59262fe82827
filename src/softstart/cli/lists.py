"""`softstart drives`, `controllers` and `study`: what there is to choose from."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.completion import one_of
from softstart.cli.options import check_name, command, drive_names
from softstart.cli.running import Output, answers, attributed, option_value, working
from softstart.drive import Drive, library
from softstart.errors import InputError, Mistakes
from softstart.hints import did_you_mean
from softstart.plugins import STUDIES, controller_names, registered
from softstart.study import Study, StudyResult, find_study
from softstart.study import Table as Results
from softstart.views.drawing import PICTURE_ENDINGS
from softstart.views.markdown import file_stem, output_folder
from softstart.views.numbers import Column, TextTable, printable
from softstart.views.sheet import Sheet, Writer, rows_file

if TYPE_CHECKING:
    from softstart.controller import Controller

OWN = (
    ("softstart drives crane-4amtkf > mine.toml", "then change the numbers in it, and"),
    ("softstart compare mine.toml", "compares strategies"),
)


@command("drives")
@click.argument("name", required=False, shell_complete=one_of(drive_names))
@answers()
def drives_command(*, name: str | None) -> Output:
    """List the shipped drives, or print one as TOML.

    To begin a file of your own: softstart drives crane-4amtkf > mine.toml
    """
    if name is None:
        shipped = {key: Drive.load(key) for key in drive_names()}
        rows = [[key, printable(f"{drive.name}\n{drive.source}")] for key, drive in shipped.items()]
        data = [{"name": key, "title": drive.name, "source": drive.source} for key, drive in shipped.items()]
        table = TextTable.of_texts(("drive", "what it is, and its source"), rows)
        notes = ["A drive of your own begins as a copy of one of these."]
        shown = Sheet("Drives", ["Shipped drives"], tables=[table], notes=notes, commands=OWN)
        return lambda: {"drives": data}, shown
    if name not in drive_names():
        raise InputError(f'"{name}": no shipped drive has this name; {did_you_mean(name, drive_names())}')
    return lambda: {"name": name, "drive": Drive.load(name).values()}, library.text(name)


@command("controllers")
@click.argument("name", required=False, shell_complete=one_of(controller_names))
@answers()
def controllers_command(*, name: str | None) -> Output:
    """List the controllers, or show the parameters of one.

    NAME is that of a controller, or path/to/file.py:ClassName for one of your own.
    """
    from softstart.controller import controller_class

    broken = Mistakes()
    descriptions: list[dict[str, Any]] = []
    with working("looking at the controllers ..."):
        for label in [check_name(name, "controller")] if name else controller_names():
            with broken.collect(), attributed(label):
                descriptions.append(_described(label, controller_class(label)))
    if name:
        broken.raise_if_any()
        return lambda: descriptions[0], _one(descriptions[0])
    return lambda: {"controllers": descriptions}, _all(descriptions, broken.sentences)


def _described(name: str, cls: type[Controller]) -> dict[str, Any]:
    from softstart.controller import declared_parameters

    also = [str(s.name).lower().replace("_", " ") for s in type(cls.sensors) if s in cls.sensors and s]
    return {
        "name": name,
        "summary": cls.summary,
        "sensors": ["encoder", "motor torque", *also],
        "source": cls.source,
        "parameters": [
            {"name": key, "unit": one.unit, "meaning": one.meaning, "default": one.default_text}
            for key, one in declared_parameters(cls).items()
        ],
    }


def _all(descriptions: list[dict[str, Any]], broken: list[str]) -> Sheet:
    sees = [", ".join(description["sensors"][2:]) for description in descriptions]
    rows = [
        [
            printable(cell) or "-"
            for cell in (description["name"], description["summary"], also, description["source"])
        ]
        for description, also in zip(descriptions, sees, strict=True)
    ]
    table = TextTable.of_texts(("controller", "what it does", "also sees", "source"), rows)
    see = "All see time, the motor's encoder and its torque. Parameters of one: softstart controllers NAME"
    return Sheet("Controllers", ["Controllers"], tables=[table], notes=[see, *broken])


def _one(about: dict[str, Any]) -> Sheet:
    keys = ("name", "unit", "meaning", "default")
    rows = [[parameter[key] or "-" for key in keys] for parameter in about["parameters"]]
    name, source = about["name"], about["source"]
    command = "softstart simulate crane-4amtkf --controller {} --param {}=VALUE"
    return Sheet(
        title=name,
        lines=[
            f"{name}: {about['summary'] or name.rpartition(':')[2]}",
            f"  sees    {', '.join(['time', *about['sensors']])}",
            *([f"  source  {source}"] if source else []),
        ],
        tables=[TextTable.of_texts(("parameter", *keys[1:]), rows)],
        notes=["A parameter is set by its name." if rows else "It has no parameters."],
        commands=[(command.format(name, rows[0][0]), "sets one")] if rows else (),
    )


@command("study")
@click.argument("name", required=False, shell_complete=one_of(lambda: registered(STUDIES)))
@answers(out=True)
def study_command(*, name: str | None) -> Output:
    """List the studies, or run one.

    Options
    -------
    --out DIR
        Write pictures (SVG, PNG), tables (CSV) and report.md into this folder.
    """
    out = option_value("out")
    if name is None and out is not None:
        raise InputError(f'--out = "{out}": a list writes no files; name a study: softstart study NAME.')
    if name is None:
        return _studies()
    study = find_study(name)
    # what the study writes itself is put in place first
    with output_folder(out) as folder, working(f"{study.name}: beginning ...") as progress:
        result = study.run(folder, lambda doing: progress(f"{study.name}: {doing}"))
    return lambda: {"study": study.name, "title": study.title} | result.summary(), _study_sheet(study, result)


def _studies() -> Output:
    """All studies as data, and as a table with those that cannot be loaded."""
    studies: list[Study] = []
    broken = Mistakes()
    for name in registered(STUDIES):
        with broken.collect():
            studies.append(find_study(name))
    data = [
        {"name": study.name, "title": study.title, "pictures": study.pictures,
         "files": [f"{stem}.{ending}" for stem in study.pictures for ending in PICTURE_ENDINGS]}
        for study in studies
    ]  # fmt: skip
    rows = [[study.name, study.title, ", ".join(study.pictures) or "-"] for study in studies]
    run = "Run one, with its pictures and its tables as CSV: softstart study NAME --out DIR"
    table = TextTable.of_texts(("study", "question", "pictures, each as .svg and .png"), rows)
    sheet = Sheet("Studies", ["Studies"], tables=[table], notes=[run, *broken.sentences])
    return lambda: {"studies": data}, sheet


def _study_sheet(study: Study, result: StudyResult) -> Sheet:
    """Tables, claims with their verdicts and evidence, pictures; each table and the claims as CSV."""
    files: dict[str, Writer] = {}
    rows = [(claim.statement, claim.verdict, claim.evidence) for claim in result.claims]
    claims = Results("claims", ("statement", "verdict", "evidence"), rows)
    for table in (claims, *result.tables) if rows else result.tables:
        stem = file_stem(table.title.lower(), [name.removesuffix(".csv") for name in files])
        files[f"{stem}.csv"] = rows_file(table.columns, table.rows)
    claim_rows = [
        [f"{i:2}. {word}", printable(f"{said}\n{why}")] for i, (said, word, why) in enumerate(rows, 1)
    ]
    return Sheet(
        title=f"{study.name}: {study.title}",
        lines=[f"{study.name}: {study.title}"],
        tables=[*map(_shown, result.tables), TextTable.of_texts(("claims", ""), claim_rows)],
        figures={stem: partial(result.figures.__getitem__, stem) for stem in result.figures},
        files=files,
    )


def _shown(table: Results) -> TextTable:
    """A table of a study, as it is shown: floats with five digits."""

    def text(cell: object) -> str:
        return "-" if cell is None else printable(f"{cell:.5g}" if isinstance(cell, float) else str(cell))

    columns = [
        Column(name, all(isinstance(row[i], int | float | None) for row in table.rows))
        for i, name in enumerate(table.columns)
    ]
    return TextTable(table.title, columns, [list(map(text, row)) for row in table.rows])
