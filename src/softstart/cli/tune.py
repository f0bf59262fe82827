"""`softstart tune`: gains for each gap and load inertia, one set for all, and what robustness costs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli.commands import Command, did_you_mean
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    check_name,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    param_option,
    read_drive,
    read_identified,
    read_params,
    scheduler_option,
    set_option,
    workers_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import PARAMETERS
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.quantities import to_si, values_in, whole_number
from softstart.views.markdown import kept_state, output_folder
from softstart.views.terminal import console, print_json

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.identification.result import Identification
    from softstart.tuning.outcome import Tuning
    from softstart.views import tuning as views
else:  # no numba for a help, a wrong option or the Tab key
    views = late("softstart.views.tuning")

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
@click.option(
    "--metric",
    metavar="NAME",
    default="k_dyn",
    help="What is made small, by default k_dyn; margin: what is left of the [limits], made large.",
)
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
@workers_option
@scheduler_option
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
    scheduler: str | None,
    settings: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Find the gains of a controller for each gap and load inertia, and one set of gains for all.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives), or the folder of an
    identification: the gains are then robust over the drives that its logs leave possible. Without it, the
    crane drive of the literature is taken. The gains are written as files that stand for a controller
    everywhere: softstart simulate DRIVE --controller DIR/robust.toml
    """
    mistakes = Mistakes()
    one: Drive | Identification | None = None
    asked: dict[str, Any] = {
        "metric": metric, "start_time": start_time, "certified": not no_optimum, "quantile": 1.0,
        "schedule": only != "robust", "robust": only != "schedule", "scheduler": scheduler,
    }  # fmt: skip
    with mistakes.noted():
        one = read_identified(drive, settings) or read_drive(drive, settings)
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
            with working("drawing the figures ..."):
                views.write_tuning(tuning, folder, command_line())

    if as_json:
        print_json(tuning.summary())
    else:
        views.show(console(), tuning)
        if out is not None:
            print(f"\nWritten to {out}: report.md, the gains, figures, tables and the finished parts.")
    if not views.any_in_time(tuning):
        raise SimulationError(
            f"No gains within these ranges start in time ({tuning.question.bound.text()}); allow more time "
            "with --start-time, or wider ranges with --free."
        )


def _computed(
    drive: Drive | Identification, controller: str, state: Path | None, asked: dict[str, Any]
) -> Tuning:

    with working("starting the drive ...") as progress:
        make_controllers([controller], {controller: asked["parameters"]}, prefix=False)

        with Attributed(), named_as_options(_as_typed):
            return softstart.tune(drive, controller, save_to=state, progress=progress, **asked)


def _whole(name: str, text: str | None) -> dict[str, int]:
    """An option that is a whole number; how small it may be is checked where it is used."""
    return {} if text is None else {name: whole_number(text, f"--{name}", 0)}


def _share(text: str) -> float:

    return float(to_si(text, "1", name="--quantile"))


OPTIONS = (
    "gaps",
    "inertias",
    "metric",
    "start_time",
    "quantile",
    "seed",
    "restarts",
    "workers",
    "scheduler",
    "free",
)
LARGEST_GRID = 100  # values of one axis
ENDINGS = ("x", "J1")  # of multiples: of the drive's own value, of the motor's inertia


def read_grid(text: str | None, option: str, unit: str) -> list[Any] | None:
    """Values with commas between, or from:to:count; quantities, or multiples as 2x or 5J1.

    >>> read_grid("0.5, 2x", "--gaps", "rad"), read_grid("0.5:2:4", "--gaps", "rad")
    ([0.5, '2.0x'], [0.5, 1.0, 1.5, 2.0])
    >>> read_grid("2J1:5J1:3", "--inertias", "kg*m^2")
    ['2.0J1', '3.5J1', '5.0J1']
    """
    if text is None:
        return None
    if ":" not in text:
        ends = _all(values_in(text, option), option, unit)
        return [value if not ending else f"{value!r}{ending}" for value, ending in ends]
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 3:
        raise InputError(f'{option} = "{text}": a range is from:to:count, as 0.5:2:7 or 1x:4x:7.')
    (first, ending), (last, other) = _all(parts[:2], option, unit)
    if ending != other:
        raise InputError(f'{option} = "{text}": give both ends as quantities, or both as the same multiples.')
    count = whole_number(parts[2], f'{option} = "{text}": the count', 2, LARGEST_GRID)
    values = [float(f"{first + (last - first) * k / (count - 1):.12g}") for k in range(count)]
    return [value if not ending else f"{value!r}{ending}" for value in values]


def _all(parts: Sequence[str], option: str, unit: str) -> list[tuple[float, str]]:
    """Each part as a number and the ending of its multiple, if it is one."""
    mistakes = Mistakes()
    found = []
    for part in parts:
        with mistakes.noted():
            ending = next((one for one in ENDINGS if part.endswith(one)), "")
            value = part.removesuffix(ending) if ending else part
            found.append((float(to_si(value, "1" if ending else unit, name=option)), ending))
    mistakes.settle()
    return found


def read_free(text: str | None) -> dict[str, tuple[str, str] | None] | None:
    """Names with commas between, each with a range if one is given.

    >>> read_free("torque,delay=5 ms:20 ms,time=0.5x:2x")
    {'torque': None, 'delay': ('5 ms', '20 ms'), 'time': ('0.5x', '2x')}
    """
    if text is None:
        return None
    found: dict[str, tuple[str, str] | None] = {}
    mistakes = Mistakes()
    for part in text.split(","):
        name, equals, ends = (piece.strip() for piece in part.partition("="))
        low, colon, high = (piece.strip() for piece in ends.partition(":"))
        with mistakes.noted():
            if not name or (equals and not (low and colon and high)):
                raise InputError(
                    f'--free "{part.strip()}": write a name, or name=low:high, as time=0.1:0.5 or '
                    "time=0.5x:2x."
                )
            if name in found:
                raise InputError(f'--free = "{text}": {name} is named twice; name it once.')
            found[name] = (low, high) if equals else None
    mistakes.settle()
    return found


def read_tolerances(texts: Sequence[str]) -> dict[str, str | list[str]]:
    """`key=spread` texts by field of the drive; several values with commas are those to be met.

    >>> read_tolerances(["shaft.stiffness=10 %", "encoder_phase=0,0.5"])
    {'stiffness': '10 %', 'encoder_phase': ['0', '0.5']}
    """
    names = {parameter.path: parameter.name for parameter in PARAMETERS.values()}
    found: dict[str, str | list[str]] = {}
    mistakes = Mistakes()
    for text in texts:
        key, equals, value = (piece.strip() for piece in text.partition("="))
        with mistakes.noted():
            if not (key and equals and value):
                raise InputError(f'--tolerance "{text}": write KEY=SPREAD, as stiffness=10%.')
            name = names.get(key, key)
            if name in found:
                raise InputError(f'--tolerance "{text}": {key} is given twice; keep one of the two.')
            several = "," in value or ";" in value
            found[name] = values_in(value, f"--tolerance {key}") if several else value
    mistakes.settle()
    return found


def _as_typed(sentence: str) -> str:
    """The sentence with ranges as they are typed behind --free.

    >>> _as_typed('controller = mine: name one with its range, as free={"rise": ("0.5x", "2x")}.')
    'controller = mine: name one with its range, as --free rise=0.5x:2x.'
    """
    sentence = re.sub(r'free=\{"(\w+)": \("([^"]+)", "([^"]+)"\)\}', r"--free \1=\2:\3", sentence)
    sentence = re.sub(r"^(free: \w+ = )\('([^']+)', '([^']+)'\)", r"\1\2:\3", sentence)
    return sentence.replace("workers, scheduler: ", "workers, --scheduler: ", 1)
