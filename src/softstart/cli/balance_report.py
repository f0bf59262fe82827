"""The files of --out of `softstart balance`."""

from __future__ import annotations

import math
import platform
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softstart import __version__
from softstart.views.markdown import markdown, markdown_table, write_table, write_text

if TYPE_CHECKING:
    from softstart.balancing import Balance

RPM = math.pi / 30.0
STEPS = 1440  # of the torque over the cycle: half degrees


def write_balance(found: Balance, folder: Path, command: str) -> None:
    """Figures, tables, the engine with all changes, and the report that ties them together."""
    from softstart.balancing import MeasuredCycle
    from softstart.balancing.engine import INDICATOR_FILE
    from softstart.cli.balance_text import conclusion, engine_lines, footnotes, tables
    from softstart.views.drawing import save_figure

    engine = found.engine
    figures = found.figures()
    for stem, figure in figures.items():
        save_figure(figure, folder, stem)
    write_text(folder / "engine.toml", engine.to_toml())
    if isinstance(engine.gas, MeasuredCycle):
        write_text(folder / INDICATOR_FILE, engine.gas.to_csv())
    _write_tables(found, folder)
    parts = [
        f"# {markdown(engine.name)}: forces, moments and balancers",
        "\n".join(f"- {markdown(line)}" for line in engine_lines(found)[1:]),
        markdown(conclusion(found)),
    ]
    for shown in tables(found):
        headings = [" ".join(heading.split()) for heading in shown.headings]
        parts += [
            f"## {markdown(shown.title)}",
            markdown_table(headings, shown.rows, numbers_from=shown.texts),
        ]
    parts += [f"![{stem}]({stem}.svg)" for stem in figures]
    parts += [
        *map(markdown, footnotes(found)),
        "All numbers: [orders.csv](orders.csv), [residuals.csv](residuals.csv), torque over the cycle at the "
        "tuning speed [torque.csv](torque.csv).",
        f"## Where this comes from\n\nsoftstart {__version__}, Python {platform.python_version()}, with the "
        f"command\n\n```sh\n{command}\n```\n\non the engine of [engine.toml](engine.toml), which holds all "
        f"changes. Source: {markdown(engine.source) or 'none given'}.",
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _write_tables(found: Balance, folder: Path) -> None:
    orders = found.orders()
    if orders:
        write_table(folder / "orders.csv", list(orders[0]), [list(row.values()) for row in orders])
    rows = [{"balancer": one.name, **one.row(i)} for one in found.residuals for i in range(one.speeds.size)]
    write_table(folder / "residuals.csv", list(rows[0]), [list(row.values()) for row in rows])
    phi = np.linspace(0.0, 4.0 * math.pi, STEPS + 1)
    engine, w = found.engine, found.tuning_speed
    gas, inertia = engine.gas_torque(phi, w, found.load), engine.inertia_torque(phi, w)
    columns = ("crank angle [deg]", "gas torque [N*m]", "inertia torque [N*m]", "pressure in cylinder 1 [Pa]")
    pressure = engine.pressure(phi - engine.cylinders.firing_angles[0], w, found.load)
    cells = np.column_stack([np.degrees(phi), gas, inertia, pressure])
    write_table(folder / "torque.csv", columns, cells.tolist())
