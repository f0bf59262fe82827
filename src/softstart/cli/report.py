"""`softstart report`: one HTML file for a customer; `softstart sheet`: the parameters of a strategy."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli import options
from softstart.cli.options import command, option
from softstart.cli.running import Output, answers, attributed, controllers_from_options, option_value, working
from softstart.errors import InputError
from softstart.input.files import write_whole

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.identification.result import Identification
    from softstart.project import Project
    from softstart.reporting import Report

PROJECT = "softstart.project"


def _read_project(name: str, option: str) -> Project:
    """The project of --project; one that has machines stands for DRIVE where that is left out."""
    from softstart.project import Project

    project = Project.open(name)
    if project.machines:
        click.get_current_context().meta[PROJECT] = name
    return project


@command("report")
@option("--out to")
@option("--pdf")
@options.controller_option("--controllers", several=True)
@options.param_option
@option("--resolution")
@option("--budget", options.quantity("s", least=0.0))
@option("--project", _read_project, is_eager=True)  # before DRIVE, for which it may stand
@options.at_option
@options.of_drive(
    options.read_machine_or_identified,
    lambda: click.get_current_context().meta.get(PROJECT, options.DEFAULT_DRIVE),
)
@answers()
def report_command(
    *, drive: Machine | Identification, to: str | None, pdf: str | None, controllers: list[str] | None,
    params: dict[str, str], project: Project | None, **arguments: Any,
) -> Output:  # fmt: skip
    """Write a report on the start of a drive or a chain as one HTML file.

    DRIVE is a TOML file, also of a project, the name of a shipped drive (see: softstart drives) or chain
    (crane-4-mass, tractor-like), or the folder of an identification, which adds confidence intervals; by
    default the crane drive of the literature. The file opens offline and prints to A4. The report recommends
    a strategy and states its parameters, rounded to the resolution of the inverter and simulated again after
    rounding. Of a chain it gives the figures of each shaft, and no maps.

    Options
    -------
    --out FILE
        HTML file to write, for example report.html.
    --controllers A,B,...
        Strategies to compare, including files of tuned gains. Default: the one chosen in the project of
        DRIVE, else all that need no parameter.
    --project FILE
        Project whose customer, author, logo, revisions, approval, data sources, paper size and decimal sign
        the report has (example in docs/howto/read-a-report.md). Default: that of DRIVE. Without DRIVE its
        machine is reported.
    """
    holder = options.read_project(options.typed_machine())

    def make(progress: Callable[[float, str], object], command: str) -> Report:
        from softstart.reporting import report as compute

        steps = {"controllers": controllers_from_options(controllers, params), **arguments}
        if holder is not None:
            steps |= in_project(holder, strategy=controllers is None and not params)
        return compute(drive, command=command, progress=progress, project=project or holder, **steps)

    return written_report(make, to, pdf)


def in_project(project: Project, strategy: bool = True) -> dict[str, Any]:
    """What a report takes from a project besides its machine: the strategy and the second machine chosen."""
    from softstart.project.parts import refuse_longer
    from softstart.start.simulation import simulate

    chosen = dict[str, Any]()
    if strategy and project.strategy:
        chosen["controllers"] = [project.controller()]
    if strategy and project.strategy in [one.name for one in project.strategies]:
        refuse_longer(simulate(project.single(), project.controller()), f'strategy "{project.strategy}"')
    if project.beside:
        chosen["beside"] = options.seen(project.single(project.beside))
    return chosen


def written_report(make: Callable[..., Report], to: str | None, pdf: str | None) -> Output:
    """The report of `make(progress, command)`, written to the files of --out and --pdf."""
    if to is None and pdf is None and not option_value("as_json"):
        raise InputError("--out: name the file to write, as --out report.html (or ask for --json).")
    from softstart.reporting.printing import browser_that_prints, printed

    for flag, path in (("--out", to), ("--pdf", pdf)):
        if path is not None:
            _check_file(flag, path)
    browser = "" if pdf is None else browser_that_prints()
    with working("starting the drive ...") as show, attributed():
        report = make(lambda share, what: show(f"{100.0 * share:.0f} %: {what}"), options.typed_command())
        show("drawing the figures")
        page = "" if to is None and pdf is None else report.to_html()
    with options.named_as_options(output="--out"):
        if to is not None:
            write_whole(Path(to), lambda stream: stream.write(page))
        if pdf is not None:
            with working("printing ..."):
                content = printed(page, browser)
            write_whole(Path(pdf), lambda stream: stream.write(content), binary=True)
    sheet, written = report.sheet, " and ".join(filter(None, (to, pdf)))
    return report.summary, replace(sheet, notes=[*sheet.notes, f"Written to {written}."])


@command("sheet")
@options.controller_option("--controller", required=True)
@options.param_option
@option("--resolution")
@options.at_option
@options.of_drive(options.read_machine_or_identified)
@answers()
def sheet_command(
    *, drive: Machine | Identification, controller: str, params: dict[str, str], resolution: str | None
) -> Output:
    """Show the parameter sheet of a strategy: what to set on the inverter.

    DRIVE is a TOML file, also of a project, the name of a shipped drive (see: softstart drives) or chain, or
    the folder of an identification; by default the crane drive of the literature. Parameters are rounded to
    what an inverter takes and stated in its units; the start is simulated again with exactly the values
    shown, and half a step off. Of a file of tuned gains it shows every cell of the set. Where the drive has
    limits that the strategy does not keep, its parameters are set for them first, as in compare.
    """
    with working("starting the drive ..."), attributed():
        from softstart.reporting.sheet import parameter_sheet

        (strategy,) = controllers_from_options([controller], params, several=False)
        found = parameter_sheet(drive, strategy, resolution=resolution)
    program = found.export_command(options.typed_machine(), controller) if found.is_code else ""
    commands = [(program, "the program with these values (--as c: C)")] if program else []
    return found.summary, replace(found.sheet, commands=commands)


def _check_file(option: str, out: str) -> None:
    """Whether the file can be written, found before anything is computed."""
    path, example = Path(out), "report.html" if option == "--out" else "report.pdf"
    reason = ""
    if not out.strip() or "\0" in out:
        reason = "this cannot be the name of a file"
    elif out.startswith("--"):
        reason = "this is an option, not the name of a file"
    elif path.exists() and not path.is_file():  # a device or a pipe would be replaced by the file
        reason = "this is a folder" if path.is_dir() else "this is no ordinary file"
    else:
        try:
            with tempfile.TemporaryFile(dir=path.parent, prefix=f".{path.name}."):
                return
        except OSError as error:
            reason = f"the file cannot be written there ({error.strerror or error})"
    raise InputError(f'{option} = "{out}": {reason}; name a file in a folder that is there, as {example}.')
