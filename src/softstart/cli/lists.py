"""`softstart drives` and `softstart controllers`: what there is to choose from."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command, did_you_mean
from softstart.cli.completion import controllers as controllers_known
from softstart.cli.completion import names_or_files
from softstart.cli.options import check_name, controller_names, drive_names, json_option
from softstart.cli.running import Attributed, working
from softstart.drive import PARAMETERS, Drive, library
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.views.numbers import Table, printable
from softstart.views.terminal import console, print_json, print_table, sentence

if TYPE_CHECKING:
    from softstart import controller
    from softstart.controller import Controller
else:
    controller = late("softstart.controller")


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=names_or_files(drive_names))
@json_option
def drives(name: str | None, as_json: bool) -> None:
    """List the shipped drives, or print one as TOML.

    To begin a file of your own: softstart drives crane-4amtkf > mine.toml
    """
    if name is not None and name not in drive_names():
        raise InputError(
            f'"{name}": there is no shipped drive of this name; {did_you_mean(name, drive_names())}'
        )
    if name is not None:
        if as_json:
            print_json({"name": name, "drive": _values(Drive.load(name))})
        else:
            print(library.text(name), end="")
        return
    shipped = {key: Drive.load(key) for key in drive_names()}
    if as_json:
        rows = [{"name": key, "title": one.name, "source": one.source} for key, one in shipped.items()]
        print_json({"drives": rows})
        return
    to = console()
    table = [[key, f"{printable(one.name)}\n{printable(one.source)}"] for key, one in shipped.items()]
    print_table(to, Table.of_texts(("drive", "what it is, and its source"), table))
    to.print()
    sentence(to, "A drive of your own:")
    sentence(to, "  softstart drives crane-4amtkf > mine.toml     then change the numbers in it, and")
    sentence(to, "  softstart compare mine.toml")


def _values(drive: Any) -> dict[str, Any]:
    return {name: getattr(drive, name) for name in PARAMETERS}


@click.command(cls=Command)
@click.argument("name", required=False, shell_complete=controllers_known)
@json_option
def controllers(name: str | None, as_json: bool) -> None:
    """List the controllers, or show the parameters of one.

    NAME is that of a controller, or path/to/file.py:ClassName for one of your own.
    """
    if name is not None:
        check_name(name, "controller")
    broken = Mistakes()
    found: dict[str, type[Controller]] = {}
    with working("looking at the controllers ..."):
        for one in [name] if name else controller_names():
            with broken.noted(), Attributed(one):
                found[one] = controller.controller_class(one)
    if name:
        broken.settle()
    if as_json:
        rows = [_described(key, cls) for key, cls in found.items()]
        print_json(rows[0] if name else {"controllers": rows})
    elif name:
        _show_one(name, found[name])
    else:
        _show_all(found)
        for one in broken.sentences:
            sentence(console(), one)


def _sensors(cls: type[Controller]) -> list[str]:
    always = ["encoder", "motor torque"]
    return always + [
        str(s.name).lower().replace("_", " ") for s in type(cls.sensors) if s in cls.sensors and s
    ]


def _described(name: str, cls: type[Controller]) -> dict[str, Any]:
    return {
        "name": name,
        "summary": cls.summary,
        "sensors": _sensors(cls),
        "source": cls.source,
        "parameters": [
            {
                "name": field.name,
                "unit": field.metadata.get("unit", ""),
                "meaning": field.metadata.get("meaning", ""),
                "default": field.metadata.get("default", ""),
            }
            for field in fields(cls)
        ],
    }


def _show_all(found: dict[str, type[Controller]]) -> None:
    to = console()
    rows = [
        [key, printable(cls.summary), ", ".join(_sensors(cls)[2:]) or "-", printable(cls.source) or "-"]
        for key, cls in found.items()
    ]
    print_table(to, Table.of_texts(("controller", "what it does", "also sees", "source"), rows))
    to.print()
    sentence(
        to, "All see time, the motor's encoder and its torque. Parameters of one: softstart controllers NAME"
    )


def _show_one(name: str, cls: type[Controller]) -> None:
    to = console()
    about = _described(name, cls)
    sentence(to, f"{name}: {about['summary'] or cls.__name__}", "bold")
    sentence(to, f"  sees    {', '.join(['time', *about['sensors']])}")
    if about["source"]:
        sentence(to, f"  source  {about['source']}")
    to.print()
    if not about["parameters"]:
        sentence(to, "It has no parameters.")
        return
    keys = ("name", "unit", "meaning", "default")
    rows = [[one[key] or "-" for key in keys] for one in about["parameters"]]
    print_table(to, Table.of_texts(("parameter", "unit", "meaning", "default"), rows))
    to.print()
    sentence(to, "Set one:")
    sentence(to, f"  softstart simulate crane-4amtkf --controller {name} --param {rows[0][0]}=VALUE")
