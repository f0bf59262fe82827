"""`softstart project`: the machines, strategies, optima and duties of a job in one file."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli import options
from softstart.cli.options import command, option
from softstart.cli.report import in_project, written_report
from softstart.cli.running import Output, answers, attributed, working
from softstart.cli.serve import serve_page
from softstart.errors import InputError
from softstart.page.address import Address

if TYPE_CHECKING:
    from softstart.project import Project
    from softstart.reporting import Report

ACTIONS = ("new", "open", "show", "report")


@command("project")
@click.argument("action", metavar="|".join(ACTIONS), type=click.Choice(ACTIONS))
@click.argument("file")
@click.argument("parts", nargs=-1)
@option("--check", is_flag=True)
@option("--out to")
@option("--pdf")
@option("--resolution")
@option("--budget", options.quantity("s", least=0.0))
@answers()
def project_command(
    *, action: str, file: str, parts: tuple[str, ...], check: bool, to: str | None, pdf: str | None,
    **steps: Any,
) -> Output:  # fmt: skip
    """Keep the machines, strategies, optima and duties of a job in one file.

    "new" makes FILE from PARTS: machines (files or shipped names), tuned gains (robust.toml, schedule.toml),
    torque profiles (CSV, TOML) and duties, each called by its file's name; the first machine is chosen.
    "open" opens FILE on the interactive page, as "softstart serve FILE" does. "show" lists what is in it.
    "report" writes the report of the machine and the strategy that are chosen, with --out, --pdf,
    --resolution and --budget. Names, notes and the choice
    are edited on the page or in the file, which is TOML (see docs/howto/keep-a-project.md).

    Options
    -------
    --check
        With show: start each optimum again on its machine, and check what it claims.
    --out FILE
        HTML file to write, for example report.html.
    """
    from softstart.project import Project

    if parts and action != "new":
        raise InputError(f'"{parts[0]}": "{action}" takes one file; leave this word out.')
    of_report = {"--out": to, "--pdf": pdf} | {f"--{name}": value for name, value in steps.items()}
    for flag, value in ({"--check": check or None} | of_report).items():
        owner = "show" if flag == "--check" else "report"
        if value is not None and action != owner:
            raise InputError(f'{flag}: it goes with "softstart project {owner}"; leave it out of "{action}".')
    if action == "new":
        return _new(Project, Path(file), parts)
    project = Project.open(file)
    if action == "report":
        return written_report(lambda *shown: _report(project, *shown, **steps), to, pdf)
    if action == "open":
        serve_page(project, Address())
        return project.summary, ""
    return _shown(project, file, check)


def _new(kind: type[Project], path: Path, parts: tuple[str, ...]) -> Output:
    if path.exists():
        raise InputError(f'FILE = "{path}": there is such a file already, which is kept; name another one.')
    if not parts:
        raise InputError('PARTS: name at least one machine, as "softstart project new job.toml mine.toml".')
    project = kind.new(*parts)
    with options.named_as_options(output="FILE"):
        project.save(path)
    data, sheet = _shown(project, str(path))
    return data, replace(sheet, notes=[*sheet.notes, f"Written to {path}."])


def _shown(project: Project, path: str, check: bool = False) -> tuple[Any, Any]:
    from softstart.views.projects import project_sheet

    checks = {}
    with working("starting the optima ..."), attributed():
        for one in project.optima if check else ():
            checks[one.name] = max(run.k_dyn for run in one.checked(*map(project.single, one.machines)))
    sheet = project_sheet(project, checks)
    steps = [
        ("project open", [], "the interactive page"),
        ("project report", ["--out", "report.html"], "its report"),
    ]
    commands = [(shlex.join(["softstart", *name.split(), path, *more]), gives) for name, more, gives in steps]
    return project.summary, replace(sheet, commands=commands)


def _report(project: Project, progress: Any, typed: str, **steps: Any) -> Report:
    from softstart.reporting import report

    chosen = in_project(project)
    return report(project.single(), command=typed, progress=progress, project=project, **chosen, **steps)
