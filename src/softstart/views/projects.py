"""What is shown of a project: its machines, strategies, optima, duties and the choice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from softstart.views.numbers import TextTable, number, with_unit
from softstart.views.sheet import Sheet

if TYPE_CHECKING:
    from softstart.project import Project


def project_sheet(project: Project, checks: Mapping[str, float] = {}) -> Sheet:
    """What is shown of a project; `checks` holds the K_dyn of optima that were started again."""
    machines = [
        [one.name, project.single(one.name).KIND, project.single(one.name).name, _role(project, one.name)]
        for one in project.machines
    ]
    strategies = [
        [one.name, "torque profile" if hasattr(one.controller, "profile") else one.controller.name]
        for one in project.strategies
    ]
    optima = [
        [
            one.name, one.machine, one.terminal, with_unit(one.end_time, "s"), number(one.claimed, 4),
            number(one.bound, 4) if one.bound else "",
            f"K_dyn {checks[one.name]:.4f}: holds" if one.name in checks else "",
        ]
        for one in project.optima
    ]  # fmt: skip
    duties = [[one.name, f"{one.file.count('[[duty]]')} steps"] for one in project.duties]
    tables = {
        "Machines": (("machine", "kind", "title", "role"), machines),
        "Strategies": (("strategy", "what it is"), strategies),
        "Optima": (("optimum", "machine", "ends", "start time", "claimed", "lower bound", "checked"), optima),
        "Duties": (("duty", "what it is"), duties),
    }
    chosen = f"Chosen: {project.strategy} on {project.machine}." if project.strategy else ""
    title = project.name
    return Sheet(
        title,
        [title, *(f"  {what}  {value}" for what, value in project.lines if what != "Project")],
        tables=[TextTable.of_rows(name, heads, (), rows) for name, (heads, rows) in tables.items() if rows],
        conclusions=[chosen] if chosen else [],
        notes=[*project.notes.splitlines()],
    )


def _role(project: Project, name: str) -> str:
    return {project.machine: "chosen", project.beside: "beside it"}.get(name, "")
