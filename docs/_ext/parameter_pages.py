"""The reference of files and controllers, from the tables that the program itself reads with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from command_pages import cell, prose

from softstart.balancing import Engine
from softstart.chain import Chain
from softstart.clutch.model import Clutch
from softstart.controller import controller_class, controller_names, declared_parameters
from softstart.controller.base import Sensor
from softstart.drive import PARAMETERS, Duty
from softstart.input.documents import DocumentTable
from softstart.input.parameters import REQUIRED
from softstart.plugins import STUDIES, registered
from softstart.study import find_study

OUTPUT = {"": "", "value": "yes", "here": "always"}


def drive_file() -> str:
    """Every key of a drive file."""
    lines: list[str] = []
    for table in dict.fromkeys(p.table for p in PARAMETERS.values()):
        lines += [
            _heading(table, False),
            "",
            "| key | symbol | unit | default | range | meaning | example | at output |",
        ]
        lines += ["|---|---|---|---|---|---|---|---|"]
        for p in (p for p in PARAMETERS.values() if p.table == table):
            default = "**required**" if p.required else _default(p.default, p.unit, p.follows)
            if p.name == "target_speed":
                default = "`rated_speed`, else **required**"
            limit = _choices(p.choices) or _limit(p.limit, p.unit)
            lines.append(
                f"| `{p.key}` | {p.symbol and f'`{p.symbol}`'} | {_unit(p.unit)} | {default} | {limit} "
                f"| {prose(p.meaning)} | `{p.example}` | {OUTPUT[p.at_output]} |"
            )
        lines.append("")
    return "\n".join(lines) + "\n" + _tables(Duty.TABLES)


def chain_file() -> str:
    """Every key of a chain file."""
    return _tables(Chain.TABLES)


def clutch_file() -> str:
    """Every key of a clutch file."""
    return _tables(Clutch.TABLES)


def engine_file() -> str:
    """Every key of an engine file."""
    return _tables(Engine.TABLES)


def _tables(tables: Iterable[DocumentTable]) -> str:
    lines: list[str] = []
    for table in tables:
        lines += [_heading(table.name, table.many), ""]
        if table.many:
            least = f"At least {table.least} of these tables." if table.least else "Optional tables."
            lines += [least, ""]
        elif table.name and not table.required:
            lines += ["Optional table.", ""]
        lines += ["| key | unit | default | range | meaning | example |", "|---|---|---|---|---|---|"]
        for f in table.parameters:
            default = "**required**" if f.default is REQUIRED else _default(f.default, f.unit)
            limit = _choices(f.choices) or _limit(f.limit, f.unit)
            many = " (a list)" if f.many else ""
            lines.append(
                f"| `{f.key}` | {_unit(f.unit)} | {default} | {limit} | {prose(f.meaning)}{many} "
                f"| `{cell(f.example)}` |"
            )
        lines.append("")
    return "\n".join(lines)


def _heading(name: str, many: bool) -> str:
    if not name:
        return "## Top-level keys"
    return f"## `[[{name}]]`" if many else f"## `[{name}]`"


def _unit(unit: str) -> str:
    return {"": "text", "1": "-"}.get(unit, unit.replace("*", "\N{NO-BREAK SPACE}").replace("^2", "²"))


def _limit(limit: str, unit: str) -> str:
    return "" if limit == "any" else limit


def _choices(choices: Iterable[str]) -> str:
    return ", ".join(f"`{choice}`" for choice in choices)


def _default(value: Any, unit: str, follows: str = "") -> str:
    if follows:
        return f"`{follows}`"
    if value is None:
        return "not given"
    if isinstance(value, str):
        return f"`{value}`" if value else "empty"
    if math.isinf(value):
        return "none (`inf`)"
    if unit == "rad" and value:
        return f"{math.degrees(value):g} deg"
    return f"{value:g}"


def controllers() -> str:
    """Every installed controller: summary, measured quantities, parameters."""
    lines: list[str] = []
    for name in controller_names():
        cls = controller_class(name)
        lines += [f"## {name}", "", f"{prose(cls.summary[:1].upper() + cls.summary[1:])}.", ""]
        lines += [f"Measures {', '.join(_measured(cls))}. Source: {prose(cls.source) or 'own design'}.", ""]
        if not declared_parameters(cls):
            lines += ["It has no parameters.", ""]
            continue
        lines += ["| parameter | unit | meaning | default | range for `tune` |", "|---|---|---|---|---|"]
        for key, one in declared_parameters(cls).items():
            lines.append(
                f"| `{key}` | {_unit(one.unit) if one.unit else one.kind} "
                f"| {prose(one.meaning)} | {prose(one.default_text) or '-'} | {_searched(one)} |"
            )
        lines.append("")
    return "\n".join(lines)


def _measured(cls: Any) -> Iterator[str]:
    yield from ("time", "encoder", "motor torque")
    yield from (str(s.name).lower().replace("_", " ") for s in Sensor if s and s in cls.sensors)


def _searched(one: Any) -> str:
    parts = []
    if one.multiples:
        parts.append("{:g} to {:g} times the default".format(*one.multiples))
    if one.between:
        parts.append("{:g} to {:g}".format(*one.between))
    return ", within ".join(parts) or "-"


def shipped() -> str:
    """The shipped drives."""
    from softstart import Drive
    from softstart.drive import library

    lines = ["| name | J1, kg m² | J2, kg m² | c, N m/rad | gap, rad | Ms, N m | load | position | source |"]
    lines += ["|---|--:|--:|--:|--:|--:|---|---|---|"]
    for name in library.names():
        d = Drive.load(name)
        load = f"{d.Mc:g} N m, {d.load_kind}"
        held = ", motor held by its brake" if d.brake == "motor" else ""
        lines.append(
            f"| `{name}` | {d.J1:g} | {d.J2:g} | {d.c:g} | {d.gap:g} | {d.Ms:g} | {load} "
            f"| {d.start_position}{held} | {prose(cell(d.source))} |"
        )
    return "\n".join(lines) + "\n"


def studies() -> str:
    """The studies and their figures."""
    lines = ["| study | title | figures |", "|---|---|---|"]
    for name in registered(STUDIES):
        study = find_study(name)
        pictures = ", ".join(f"`{stem}`" for stem in study.pictures) or "-"
        lines.append(f"| `{name}` | {prose(study.title)} | {pictures} |")
    return "\n".join(lines) + "\n"
