"""`softstart report`: one HTML file for a customer."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.chain.model import Chain
from softstart.cli.commands import Command, Reading
from softstart.cli.options import (
    command_line,
    controller_option,
    drive_argument,
    json_option,
    param_option,
    quantity,
    read_machine_or_identified,
    set_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.views.terminal import console, print_json, print_lines, sentence

if TYPE_CHECKING:
    from softstart import reporting
    from softstart.identification.result import Identification
    from softstart.views import starts
else:
    reporting = late("softstart.reporting")
    starts = late("softstart.views.starts")

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge"),
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)
EXAMPLES = {"--out": "report.html", "--pdf": "report.pdf"}
PRINTING = 120.0  # s for a browser to print a report


def _read_resolution(text: str, option: str) -> reporting.Resolution:
    return reporting.Resolution.read(text, option)


def _check_files(given: Mapping[str, Any]) -> None:
    if given["out"] is None and given["pdf"] is None and not given["as_json"]:
        raise InputError("--out: name the file to write, as --out report.html (or ask for --json).")
    for option in ("out", "pdf"):
        if given[option] is not None:
            _check_file(f"--{option}", given[option])
    if given["pdf"] is not None:
        _browser()


@click.command(cls=Command, checks=[_check_files])
@drive_argument(read_machine_or_identified)
@click.option(
    "--out",
    metavar="FILE",
    help="HTML file to write, for example report.html.",
)
@click.option(
    "--pdf",
    metavar="FILE",
    help="PDF file to write, for example report.pdf; printed with Chromium, Chrome or Edge.",
)
@controller_option(
    "--controllers",
    "A,B,...",
    "Strategies to compare, including files of tuned gains. Default: all that need no parameter.",
)
@set_option
@param_option(
    "Set a parameter of a controller, for example ramp.time='0.2 s'. May be repeated.", "controllers"
)
@click.option(
    "--resolution",
    metavar="KEY=STEP,...",
    type=Reading(_read_resolution),
    help="Resolution of the inverter parameters, for example torque=0.5%,time=10ms,speed=1rpm,"
    "frequency=0.1Hz,share=1%. Torque in % of the rated torque or in N*m. Default: 0.1 %, 1 ms, 1 rpm, "
    "0.1 Hz and 0.01.",
)
@click.option(
    "--budget",
    metavar="TIME",
    type=quantity("s", 'give a time, as 20 or "60 s", or 0 for no search', least=0.0),
    help="Time limit of numerical optimisation, for example 60 (s). Default: 20 s, of several shafts 60 s; 0 "
    "disables it.",
)
@click.option(
    "--project",
    metavar="FILE",
    type=Reading(lambda path, option: reporting.Project.load(path)),
    help="TOML file with customer, project, author, logo, revisions, approval, data sources, paper size and "
    "decimal sign (example in docs/howto/read-a-report.md).",
)
@json_option
def report(
    *,
    drive: Drive | Chain | Identification,
    out: str | None,
    pdf: str | None,
    controllers: list[str] | None,
    params: dict[str, dict[str, str]],
    as_json: bool,
    **asked: Any,
) -> None:
    """Write a report on the start of a drive or a chain as one HTML file.

    DRIVE is a TOML file, the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like), or the folder of an identification, which adds confidence intervals; by default the crane
    drive of the literature. The file opens offline and prints to A4. The report recommends a strategy and
    states its parameters, rounded to the resolution of the inverter and simulated again after rounding. Of a
    chain it gives the figures of each shaft, and no maps.
    """
    asked = {name: value for name, value in asked.items() if value is not None}
    browser = None if pdf is None else _browser()
    made, page = _made(drive, controllers, params, asked, out is not None or pdf is not None)
    if out is not None:
        write_whole(Path(out), lambda stream: stream.write(page))
    if pdf is not None and browser is not None:
        with working("printing ..."):
            printed = _printed(page, browser)
        write_whole(Path(pdf), lambda stream: stream.write(printed), binary=True)
    written = " and ".join(path for path in (out, pdf) if path is not None)
    if as_json:
        print_json(made.summary())
        return
    _show(made)
    if written:
        print(f"\nWritten to {written}.")


def _made(
    drive: Drive | Chain | Identification,
    names: Sequence[str] | None,
    given: dict[str, dict[str, str]],
    asked: dict[str, Any],
    drawn: bool,
) -> tuple[reporting.Report, str]:
    """The report and, if it is `drawn`, its page."""
    with working("starting the drive ...") as show:
        controllers = make_controllers(names, given, prefix=True)

        def progress(share: float, what: str) -> None:
            show(f"{100.0 * share:.0f} %: {what}")

        asked |= {"controllers": controllers, "progress": progress, "command": command_line()}
        with Attributed():
            made = reporting.report(drive, **asked)
        show("drawing the figures")
        return made, made.to_html() if drawn else ""


def _check_file(option: str, out: str) -> None:
    """Whether the file can be written, found before anything is computed."""
    example = EXAMPLES[option]
    if not out.strip() or "\0" in out:
        raise InputError(f"{option} = {out!r}: this cannot be the name of a file; write one, as {example}.")
    path = Path(out)
    try:
        if path.is_dir():
            raise InputError(f'{option} = "{out}": this is a folder; name a file in it, as {path / example}.')
        if path.exists() and not path.is_file():  # a device or a pipe would be replaced by the file
            raise InputError(f'{option} = "{out}": this is no ordinary file; name one, as {example}.')
        with tempfile.TemporaryFile(dir=path.parent, prefix=f".{path.name}."):
            pass
    except OSError as error:
        reason = error.strerror or error
        raise InputError(
            f'{option} = "{out}": the file cannot be written there ({reason}); name one in a folder that is '
            "there and that you may write to."
        ) from None


def _browser() -> str:
    """The browser that prints: that of SOFTSTART_CHROMIUM, or one that is installed."""
    if named := os.environ.get("SOFTSTART_CHROMIUM"):
        if shutil.which(named) is None:
            raise InputError(
                f'SOFTSTART_CHROMIUM = "{named}": there is no such program; name a Chromium or a Chrome.'
            )
        return named
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise InputError(
            "--pdf: no Chromium, Chrome or Edge was found to print with; install one (Debian: apt-get "
            "install chromium), name it in SOFTSTART_CHROMIUM, or print the file of --out in any browser."
        )
    return browser


def _printed(page: str, browser: str) -> bytes:
    """The page as PDF, printed by the browser without a window."""
    with tempfile.TemporaryDirectory(prefix="softstart-print-", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        words = [browser, "--headless", "--disable-gpu", "--no-pdf-header-footer"]
        words += [f"--user-data-dir={folder}/profile", f"--print-to-pdf={target}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            words.append("--no-sandbox")  # which root cannot have
        try:
            done = subprocess.run(
                [*words, source.as_uri()], capture_output=True, timeout=PRINTING, check=False
            )
            said = " ".join(done.stderr.decode(errors="replace").split()[-20:])
            why = said or f"exit code {done.returncode}"
        except (OSError, subprocess.TimeoutExpired) as error:
            why = str(error)
        if not target.exists():
            raise InputError(f"--pdf: {browser} did not print ({why}); print the HTML file of --out instead.")
        return target.read_bytes()


def _show(made: reporting.Report) -> None:
    to = console()
    print_lines(to, starts.machine_lines(made.drive))
    to.print()
    sentence(to, made.answer, "bold")
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
