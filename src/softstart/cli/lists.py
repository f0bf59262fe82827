"""`softstart drives` and `softstart controllers`: what there is to choose from."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command, did_you_mean
from softstart.cli.completion import controllers as controllers_known
from softstart.cli.completion import names_or_files
from softstart.cli.options import check_name, controller_names, drive_names, json_option
from softstart.cli.running import Attributed, answering, working
from softstart.drive import Drive, library
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.views.numbers import Table, printable
from softstart.views.sheet import Sheet
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart import controller
    from softstart.controller import Controller
else:
    controller = late("softstart.controller")

OWN = (
    ("softstart drives crane-4amtkf > mine.toml", "then change the numbers in it, and"),
    ("softstart compare mine.toml", "compares strategies"),
)


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=names_or_files(drive_names))
@json_option
def drives(name: str | None, as_json: bool) -> None:
    """List the shipped drives, or print one as TOML.

    To begin a file of your own: softstart drives crane-4amtkf > mine.toml
    """
    if name is None:
        shipped = {key: Drive.load(key) for key in drive_names()}
        rows = [[key, printable(f"{one.name}\n{one.source}")] for key, one in shipped.items()]
        data = [{"name": key, "title": one.name, "source": one.source} for key, one in shipped.items()]
        table = Table.of_texts(("drive", "what it is, and its source"), rows)
        with answering(as_json, None) as answer:
            notes = ["A drive of your own begins as a copy of one of these."]
            shown = Sheet("Drives", ["Shipped drives"], tables=[table], notes=notes, commands=OWN)
            answer(lambda: {"drives": data}, shown)
    elif name not in drive_names():
        raise InputError(
            f'"{name}": there is no shipped drive of this name; {did_you_mean(name, drive_names())}'
        )
    elif as_json:
        print_json({"name": name, "drive": Drive.load(name).values()})
    else:
        print(library.text(name), end="")


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=controllers_known)
@json_option
def controllers(name: str | None, as_json: bool) -> None:
    """List the controllers, or show the parameters of one.

    NAME is that of a controller, or path/to/file.py:ClassName for one of your own.
    """
    broken = Mistakes()
    found: list[dict[str, Any]] = []
    with working("looking at the controllers ..."):
        for one in [check_name(name, "controller")] if name else controller_names():
            with broken.noted(), Attributed(one):
                found.append(_described(one, controller.controller_class(one)))
    if name:
        broken.settle()
    with answering(as_json, None) as answer:
        if name:
            answer(lambda: found[0], _one(found[0]))
        else:
            answer(lambda: {"controllers": found}, _all(found, broken.sentences))


def _described(name: str, cls: type[Controller]) -> dict[str, Any]:
    also = [str(s.name).lower().replace("_", " ") for s in type(cls.sensors) if s in cls.sensors and s]
    return {
        "name": name,
        "summary": cls.summary,
        "sensors": ["encoder", "motor torque", *also],
        "source": cls.source,
        "parameters": [
            {"name": one.name, **{key: one.metadata.get(key, "") for key in ("unit", "meaning", "default")}}
            for one in fields(cls)
        ],
    }


def _all(found: list[dict[str, Any]], broken: list[str]) -> Sheet:
    sees = [", ".join(one["sensors"][2:]) for one in found]
    rows = [
        [printable(cell) or "-" for cell in (one["name"], one["summary"], also, one["source"])]
        for one, also in zip(found, sees, strict=True)
    ]
    table = Table.of_texts(("controller", "what it does", "also sees", "source"), rows)
    see = "All see time, the motor's encoder and its torque. Parameters of one: softstart controllers NAME"
    return Sheet("Controllers", ["Controllers"], tables=[table], notes=[see, *broken])


def _one(about: dict[str, Any]) -> Sheet:
    keys = ("name", "unit", "meaning", "default")
    rows = [[one[key] or "-" for key in keys] for one in about["parameters"]]
    name, source = about["name"], about["source"]
    command = "softstart simulate crane-4amtkf --controller {} --param {}=VALUE"
    return Sheet(
        title=name,
        lines=[
            f"{name}: {about['summary'] or name.rpartition(':')[2]}",
            f"  sees    {', '.join(['time', *about['sensors']])}",
            *([f"  source  {source}"] if source else []),
        ],
        tables=[Table.of_texts(("parameter", *keys[1:]), rows)],
        notes=["A parameter is set by its name." if rows else "It has no parameters."],
        commands=[(command.format(name, rows[0][0]), "sets one")] if rows else (),
    )
