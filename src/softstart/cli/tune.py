"""`softstart tune`: gains for each gap and load inertia, one set for all, and what robustness costs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command, did_you_mean
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    check_name,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    out_option,
    param_option,
    read_drive,
    read_params,
    set_option,
)
from softstart.cli.tune_options import named_as_options, read_free, read_grid, read_tolerances
from softstart.errors import InputError, SimulationError
from softstart.views.markdown import kept_state, output_folder

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.tuning.outcome import Tuning

STATE = "tuning.jsonl"
QUESTIONS = ("schedule", "robust")


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@controller_option(
    "--controller", "NAME", "The controller to tune, or path/to/file.py:ClassName.", required=True
)
@click.option(
    "--gaps",
    metavar="GAP,...",
    help="Gaps, as 0.5,1 (rad), '30 deg', 2x (of the drive's own), or from:to:count, as 0.5:2:7. "
    "By default 0.5x,1x,2x,4x.",
)
@click.option(
    "--inertias",
    metavar="INERTIA,...",
    help="Load inertias, likewise; also multiples of the motor's, as 2J1:5J1:4. By default 0.4x,1x,2x.",
)
@click.option(
    "--free",
    metavar="NAME[=LOW:HIGH],...",
    help="Parameters to tune, and within what, as torque,delay='5 ms:20 ms',rise=0.5x:2x (of the default). "
    "By default all that the controller offers.",
)
@param_option("KEY=VALUE", "Set a parameter of the controller; it is not tuned then. May be repeated.")
@click.option("--metric", metavar="NAME", default="k_dyn", help="What is made small. By default k_dyn.")
@click.option(
    "--start-time",
    metavar="TIME",
    help="Bound on the start time, as 0.3 (s) or 1.2x (of direct in the same cell). By default that of the "
    "controller's own defaults.",
)
@click.option(
    "--tolerance",
    "tolerances",
    metavar="KEY=SPREAD",
    multiple=True,
    help="What drives may be off by, as stiffness=10%, load_torque=2, or values to be met, as "
    "encoder_phase=0,0.5. May be repeated.",
)
@click.option(
    "--quantile", metavar="SHARE", help="Share of the starts judged by. By default 1, the worst case."
)
@click.option("--only", metavar="schedule|robust", help="Answer one of the two questions.")
@click.option("--no-optimum", is_flag=True, help="Leave out the certified optima, which may take a while.")
@click.option("--seed", metavar="N", help="Of the random search. By default 0.")
@click.option("--restarts", metavar="N", help="Independent searches. By default 3.")
@click.option("--workers", metavar="N", help="Processes. By default one a processor; the result is the same.")
@set_option
@json_option
@out_option(
    "Write the gains (TOML, CSV), figures (SVG, PNG), tables and report.md into this folder, and each "
    "finished part at once: an interrupted command goes on from there."
)
def tune(
    *,
    drive: str,
    controller: str,
    gaps: str | None,
    inertias: str | None,
    free: str | None,
    params: tuple[str, ...],
    metric: str,
    start_time: str | None,
    tolerances: tuple[str, ...],
    quantile: str | None,
    only: str | None,
    no_optimum: bool,
    seed: str | None,
    restarts: str | None,
    workers: str | None,
    settings: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Find the gains of a controller for each gap and load inertia, and one set of gains for all.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. The gains are written as files that stand for a controller everywhere:
    softstart simulate DRIVE --controller DIR/robust.toml
    """
    mistakes = Mistakes()
    one: Drive | None = None
    asked: dict[str, Any] = {
        "metric": metric, "start_time": start_time, "certified": not no_optimum, "quantile": 1.0,
        "schedule": only != "robust", "robust": only != "schedule",
    }  # fmt: skip
    with mistakes.noted():
        one = read_drive(drive, settings)
    with mistakes.noted():
        check_name(controller, "--controller")
    with mistakes.noted():
        asked["parameters"] = read_params(params)
    with mistakes.noted():
        asked["gaps"] = read_grid(gaps, "--gaps", "rad")
    with mistakes.noted():
        asked["inertias"] = read_grid(inertias, "--inertias", "kg*m^2")
    with mistakes.noted():
        asked["free"] = read_free(free)
    with mistakes.noted():
        asked["tolerances"] = read_tolerances(tolerances)
    with mistakes.noted():
        if only is not None and only not in QUESTIONS:
            raise InputError(f'--only = "{only}": there is no such choice; {did_you_mean(only, QUESTIONS)}')
    for name, text in (("seed", seed), ("restarts", restarts), ("workers", workers)):
        with mistakes.noted():
            asked |= _whole(name, text)
    if quantile is not None:
        with mistakes.noted():
            asked["quantile"] = _share(quantile)
    mistakes.settle()
    assert one is not None

    with output_folder(out) as folder, kept_state(out, STATE, "finished parts") as state:
        tuning = _computed(one, controller, state, asked)
        if folder is not None:
            from softstart.cli.running import working
            from softstart.cli.tune_report import write_tuning

            with working("drawing the figures ..."):
                write_tuning(tuning, folder, command_line())

    from softstart.cli.tune_text import any_in_time, show
    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(tuning.summary())
    else:
        show(console(), tuning)
        if out is not None:
            print(f"\nWritten to {out}: report.md, the gains, figures, tables and the finished parts.")
    if not any_in_time(tuning):
        raise SimulationError(
            f"No gains within these ranges start in time ({tuning.question.bound.text()}); allow more time "
            "with --start-time, or wider ranges with --free."
        )


def _computed(drive: Drive, controller: str, state: Path | None, asked: dict[str, Any]) -> Tuning:
    from softstart.cli.running import Attributed, make_controllers, working

    with working("starting the drive ...") as status:
        from softstart.tuning.solving import tune as compute

        make_controllers([controller], {controller: asked["parameters"]}, prefix=False)

        def progress(doing: str) -> None:
            if status is not None:
                status.update(f"{doing} ...")

        with Attributed(), named_as_options():
            return compute(drive, controller, save_to=state, progress=progress, **asked)


def _whole(name: str, text: str | None) -> dict[str, int]:
    """An option that is a whole number; how small it may be is checked where it is used."""
    if text is None:
        return {}
    if not (text.strip().isascii() and text.strip().isdigit()):
        raise InputError(f'--{name} = "{text}": give a whole number.')
    return {name: int(text)}


def _share(text: str) -> float:
    from softstart.quantities import to_si

    return float(to_si(text, "1", name="--quantile"))
