"""`softstart report`: one HTML file for a customer."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    command_line,
    controller_names,
    controller_option,
    drive_argument,
    json_option,
    param_option,
    read_drive,
    read_names,
    read_params_of,
    set_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.quantities import to_si
from softstart.views.drives import drive_lines
from softstart.views.terminal import console, print_json, print_lines, sentence

if TYPE_CHECKING:
    from rich.console import Console

    from softstart import reporting
    from softstart.reporting import document
else:
    reporting, document = late("softstart.reporting"), late("softstart.reporting.document")


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@click.option(
    "--out",
    metavar="FILE",
    help="The HTML file to write, as report.html. Without it (then give --json) only the numbers are made.",
)
@controller_option(
    "--controllers",
    "A,B,...",
    "Strategies to examine, files of tuned gains among them. By default all that need no parameter.",
)
@set_option
@param_option(
    "CONTROLLER.KEY=VALUE", "Set a parameter of a controller, as ramp.time='0.2 s'. May be repeated."
)
@click.option(
    "--resolution",
    metavar="KEY=STEP,...",
    help="Steps in which the inverter can be set, as torque=0.5%,time=10ms,speed=1rpm,frequency=0.1Hz,"
    "share=1%. "
    "Torque in % of the rated torque or in N*m. By default 0.1 %, 1 ms, 1 rpm, 0.1 Hz and 0.01.",
)
@click.option(
    "--budget",
    metavar="TIME",
    help="Time for the search of optima where there is no formula, as 60 (s). By default 20 s; 0 for none.",
)
@json_option
def report(
    *,
    drive: str,
    out: str | None,
    controllers: str | None,
    settings: tuple[str, ...],
    params: tuple[str, ...],
    resolution: str | None,
    budget: str | None,
    as_json: bool,
) -> None:
    """Write a report on the start of a drive: one HTML file that opens offline and prints to A4.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. The report recommends a strategy and gives its parameters, rounded to what the
    inverter can be set to and started again after rounding.
    """
    mistakes = Mistakes()
    one: Drive | None = None
    names: Sequence[str] | None = None
    given: dict[str, dict[str, str]] = {}
    asked: dict[str, Any] = {}
    with mistakes.noted():
        _check_out(out, as_json)
    with mistakes.noted():
        one = read_drive(drive, settings)
    with mistakes.noted():
        names = read_names(controllers)
    with mistakes.noted():
        given = read_params_of(params, names or controller_names())
    if resolution is not None:
        with mistakes.noted():
            asked["resolution"] = reporting.Resolution.read(resolution, "--resolution")
    if budget is not None:
        with mistakes.noted():
            asked["budget"] = _seconds(budget)
    mistakes.settle()
    assert one is not None

    made, page = _made(one, names, given, asked, out is not None)
    if out is not None:
        write_whole(Path(out), lambda stream: stream.write(page))

    if as_json:
        print_json(made.summary())
    else:
        _show(console(), made, str(out))


def _made(
    drive: Drive,
    names: Sequence[str] | None,
    given: dict[str, dict[str, str]],
    asked: dict[str, Any],
    drawn: bool,
) -> tuple[reporting.Report, str]:
    """The report and, if it is `drawn`, its page."""
    with working("starting the drive ...") as status:
        controllers = make_controllers(names, given, prefix=True)

        def progress(share: float, what: str) -> None:
            if status is not None:
                status.update(f"{100.0 * share:.0f} %: {what} ...")

        with Attributed():
            made = reporting.report(
                drive, controllers=controllers, progress=progress, command=command_line(), **asked
            )
        if status is not None:
            status.update("drawing the figures ...")
        return made, made.to_html() if drawn else ""


def _check_out(out: str | None, as_json: bool) -> None:
    """Whether the file can be written, found before anything is computed."""
    if out is None:
        if not as_json:
            raise InputError("--out: name the file to write, as --out report.html (or ask for --json).")
        return
    if not out.strip() or "\0" in out:
        raise InputError(f"--out = {out!r}: this cannot be the name of a file; write one, as report.html.")
    path = Path(out)
    try:
        if path.is_dir():
            raise InputError(
                f'--out = "{out}": this is a folder; name a file in it, as {path / "report.html"}.'
            )
        if path.exists() and not path.is_file():  # a device or a pipe would be replaced by the file
            raise InputError(f'--out = "{out}": this is no ordinary file; name one, as report.html.')
        with tempfile.TemporaryFile(dir=path.parent, prefix=f".{path.name}."):
            pass
    except OSError as error:
        reason = error.strerror or error
        raise InputError(
            f'--out = "{out}": the file cannot be written there ({reason}); name one in a folder that is '
            "there and that you may write to."
        ) from None


def _seconds(text: str) -> float:
    """A time in s, 0 or more."""
    value = float(to_si(text, "s", name="--budget"))
    if value < 0.0:
        raise InputError(f'--budget = "{text}": give a time, as 20 or "60 s", or 0 for no search.')
    return value


def _show(to: Console, made: reporting.Report, out: str) -> None:
    print_lines(to, drive_lines(made.drive))
    to.print()
    sentence(to, document.answer(made), "bold")
    for sheet in made.sheets:
        if sheet.rounded is None:
            sentence(to, f"{sheet.name}: cannot be started with rounded values ({sheet.failure})")
            continue
        sentence(
            to,
            f"{sheet.name}: K_dyn {sheet.exact.k_dyn:.4f} exact, {sheet.rounded.k_dyn:.4f} after rounding"
            + (f", {sheet.worst_k_dyn:.4f} at most half a step off." if sheet.variants else "."),
            "dim",
        )
    for name, reason in made.failed:
        sentence(to, f"{name} was left out: {reason}", "dim")
    to.print()
    sentence(to, f"Written to {out}: open it in a browser, or print it to A4.")
