"""`softstart export`: a strategy as C, Structured Text or FMU, and a machine as FMU."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from softstart.cli import options
from softstart.cli.completion import folders, one_of
from softstart.cli.options import command, option, typed_command
from softstart.cli.running import (
    Output,
    answers,
    attributed,
    controllers_from_options,
    working,
)
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.controller import Controller
    from softstart.drive.machine import Machine
    from softstart.export.package import Export, Language, Real

LANGUAGES = ("c", "st", "fmu")
PRECISIONS = ("float64", "float32")


@command("export")
@options.controller_option("--controller")
@option("--gains", shell_complete=one_of(tuple))
@options.param_option
@option("--as language", type=click.Choice(LANGUAGES), required=True)
@option("--real", type=click.Choice(PRECISIONS), default="float64")
@option("--prefix", default="")
@option("--period", options.quantity("s", above=0.0))
@option("--out folder", required=True, shell_complete=folders)
@options.of_drive(options.read_machine)
@answers()
def export_command(
    *, drive: Machine, controller: str | None, gains: str | None, params: dict[str, str], language: Language,
    real: Real, prefix: str, period: float | None, folder: str,
) -> Output:  # fmt: skip
    """Export a strategy as C, Structured Text or FMU, or a machine as FMU.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain;
    by default the crane drive of the literature. The export has the source of the strategy with its guard,
    vectors of real starts, a program that tests it, and a README on how to connect it. Parameters are rounded
    as on the parameter sheet. Without --controller, --as fmu exports the machine itself.

    Options
    -------
    --controller NAME
        A compiled strategy: its name, path/to/file.py:ClassName, or a file of tuned gains (.toml).
    --gains FILE
        Tuned gains of this strategy, a file that softstart tune has written.
    --as c|st|fmu
        C99, Structured Text of IEC 61131-3 with PLCopen XML, or FMI 2.0 and 3.0.
    --real float32|float64
        Precision of the numbers; times and angles are always double. Default: float64.
    --prefix P
        Beginning of all names in the code. Default: the name of the strategy.
    --period TIME
        Time between two calls, for example '2 ms'. Default: the sample period of the strategy, or 1 ms.
    --out DIR
        Write the files into this folder; an export that is in it is replaced.
    """
    if controller is None and gains is None:
        export = _machine(drive, language, params, prefix, period, folder)
        return export.summary, _text(export)
    with working("translating the strategy ..."), attributed():
        strategy = _strategy(controller, gains, params)
        from softstart.export.controller import export_controller

        export = export_controller(
            strategy, drive, language, folder, real=real, prefix=prefix, period=period, origin=_origin()
        )
    return export.summary, _text(export)


def _machine(
    drive: Machine, language: str, params: dict[str, str], prefix: str, period: float | None, folder: str
) -> Export:
    """The machine itself."""
    if language != "fmu":
        raise InputError(
            f'--as = "{language}": this needs a strategy, as --controller take-up; a machine is exported '
            "with --as fmu."
        )
    if params or period is not None:
        what = "--param" if params else "--period"
        raise InputError(f"{what}: it belongs to a strategy; add --controller, or leave {what} out.")
    from softstart.export.drive import export_drive

    with working("translating the machine ..."):
        return export_drive(drive, folder, prefix=prefix, origin=_origin())


def _strategy(controller: str | None, gains: str | None, params: dict[str, str]) -> Controller:
    """The strategy of --controller with the gains of --gains."""
    if gains is None:
        assert controller is not None
        return controllers_from_options([controller], params, several=False)[0]
    from softstart.controller.tuned import Tuned, is_gain_file

    if params:
        raise InputError(f'--param: the gains of "{gains}" are given; change them in that file.')
    if not Path(gains).is_file():
        raise InputError(
            f'--gains = "{gains}": there is no such file; softstart tune --out DIR writes robust.toml and '
            "schedule.toml."
        )
    if not is_gain_file(gains):
        raise InputError(f'--gains = "{gains}": give a file that softstart tune has written (.toml).')
    (tuned,) = controllers_from_options([gains], {}, several=False)
    assert isinstance(tuned, Tuned)
    other = None if controller is None else controllers_from_options([controller], {}, several=False)[0]
    if other is not None and type(other) is not type(tuned.controller):
        raise InputError(
            f'--gains = "{gains}": these are gains of {tuned.controller.name}, not of {controller}; '
            "leave --controller out."
        )
    return tuned


def _origin() -> str:
    """The command without its folder and without the paths of this computer."""
    words, kept = shlex.split(typed_command()), list[str]()
    skip = False
    for word in words:
        if skip or word.startswith("--out="):
            skip = False
        elif word == "--out":
            skip = True
        elif word != "--json":
            kept.append(os.path.basename(word) if os.path.isabs(word) else word)
    return shlex.join(kept)


def _text(export: Export) -> str:
    """What was written, K_dyn, and what to do next."""
    from softstart.export.package import LANGUAGES as NAMES

    figures = export.figures
    lines = [f"{export.prefix}: {NAMES[export.language]}, {export.real}, in {export.folder}", ""]
    shown = {
        "k_dyn_simulated": "K_dyn of simulate", "k_dyn_rounded": "K_dyn with rounded parameters",
        "k_dyn_in_cycles": "K_dyn of the exported block, in cycles",
    }  # fmt: skip
    rows = [(label, f"{figures[key]:.6g}") for key, label in shown.items() if key in figures]
    rows += [
        (f"K_dyn of the code in float32, {name}", f"{value:.6g}")
        for name, value in figures.get("k_dyn_float32", {}).items()
    ]
    rows += [
        (label, str(figures[key]))
        for key, label in (("state_bytes", "state, bytes"), ("operations", "operations of a step, at most"))
        if key in figures
    ]
    wide = max((len(label) for label, _ in rows), default=0)
    lines += [f"  {label:{wide}}  {value}" for label, value in rows]
    lines += ["", *(f"Note: {note}" for note in export.notes)] if export.notes else []
    files = ", ".join(sorted(export.files))
    lines += ["", f"Files: {files}."]
    if export.language == "c":
        lines.append(f"Test: make -C {shlex.quote(export.folder)} test")
    return "\n".join(lines) + "\n"
