"""Tuned gains as text, which `softstart.controller.gain_files` reads back to the last bit."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.controller.gain_files import AXES, CSV_TITLE, ROBUST, SCHEDULE, RobustFile, ScheduleFile
from softstart.drive import Drive


def robust_text(saved: RobustFile, about: Mapping[str, Any] | None = None) -> str:
    """The TOML text of a robust set; `about` says where it comes from and is not read.

    >>> from pathlib import Path
    >>> from softstart.controller.gain_files import read_gains
    >>> saved = RobustFile("ramp", {"time": 0.12}, Drive.load("crane-4amtkf"))
    >>> read_gains(robust_text(saved), Path("robust.toml")) == saved
    True
    """
    blocks = [
        f"# softstart simulate DRIVE --controller FILE plays it\nkind = {_literal(ROBUST)}\n"
        f"controller = {_literal(saved.controller)}",
        _table("parameters", saved.parameters),
        *([_table("about", about)] if about else []),
        _nested(saved.drive),
    ]
    return "\n\n".join(blocks) + "\n"


def schedule_text(saved: ScheduleFile, about: Mapping[str, Any] | None = None) -> str:
    """The TOML text of a schedule; `about` says where it comes from and is not read."""
    blocks = [
        "# softstart simulate DRIVE --controller FILE plays it, with the gap and load inertia that DRIVE "
        f"declares\nkind = {_literal(SCHEDULE)}\ncontroller = {_literal(saved.controller)}\n"
        f"gaps = {_literal(saved.gaps)}  # rad, the rows of each table of values\n"
        f"load_inertias = {_literal(saved.load_inertias)}  # kg*m^2, its columns",
        *([_table("fixed", saved.fixed)] if saved.fixed else []),
    ]
    for name, gain in saved.gains.items():
        rows = "".join(f"    {_literal(row)},\n" for row in gain.values)
        blocks.append(f"[gains.{name}]\nscale = {_literal(gain.scale)}\nvalues = [\n{rows}]")
    if about:
        blocks.append(_table("about", about))
    return "\n\n".join(blocks) + "\n"


def schedule_csv(saved: ScheduleFile, columns: Mapping[str, NDArray[np.float64]] | None = None) -> str:
    """The CSV text of a schedule: comment lines that say what it is, then one row a cell.

    `columns` are further figures of each cell; they are not read back.
    """
    stream = io.StringIO()
    stream.write(f"{CSV_TITLE}\n# controller: {saved.controller}\n")
    stream.write(f"# gains: {json.dumps({name: gain.scale for name, gain in saved.gains.items()})}\n")
    stream.write(f"# fixed: {json.dumps(saved.fixed)}\n")
    tables = {name: gain.values for name, gain in saved.gains.items()} | dict(columns or {})
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*AXES, *tables])
    for i, gap in enumerate(saved.gaps):
        for j, inertia in enumerate(saved.load_inertias):
            writer.writerow([_cell(value) for value in (gap, inertia, *(t[i, j] for t in tables.values()))])
    return stream.getvalue()


def _cell(value: Any) -> str:
    plain = value.item() if hasattr(value, "item") else value
    if isinstance(plain, float):
        return "" if math.isnan(plain) else repr(plain)
    return str(plain)


def _literal(value: Any) -> str:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _table(name: str, values: Mapping[str, Any]) -> str:
    lines = [f"{key} = {_literal(value)}" for key, value in values.items() if value is not None]
    return "\n".join([f"[{name}]", *lines])


def _nested(drive: Drive) -> str:
    """The drive's own file, below the table [drive]."""
    lines = drive.to_toml().splitlines()
    nested = [f"[drive.{line[1:]}" if line.startswith("[") else line for line in lines]
    return "\n".join(["[drive]", *nested])
