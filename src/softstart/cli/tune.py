"""`softstart tune`: gains for each gap and load inertia, one set for all, and what robustness costs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli.commands import Command, Reading
from softstart.cli.options import (
    choice,
    command_line,
    controller_option,
    count,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    param_option,
    quantity,
    read_machine_or_identified,
    scheduler_option,
    set_option,
    workers_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import PARAMETERS
from softstart.errors import InputError, Mistakes, SimulationError
from softstart.late import late
from softstart.quantities import to_si, values_in, whole_number
from softstart.views.markdown import kept_state, output_folder
from softstart.views.terminal import present

if TYPE_CHECKING:
    from softstart.chain.machines import Machine
    from softstart.identification.result import Identification
    from softstart.tuning.outcome import Tuning
    from softstart.views import tuning as views
else:  # no numba for a help, a wrong option or the Tab key
    views = late("softstart.views.tuning")

STATE = "tuning.sqlite"
QUESTIONS = ("schedule", "robust")
LARGEST_GRID = 100  # values of one axis
ENDINGS = ("x", "J1")  # of multiples: of the drive's own value, of the motor's inertia


def read_grid(text: str, option: str, unit: str) -> list[Any]:
    """Values with commas between, or from:to:count; quantities, or multiples as 2x or 5J1.

    >>> read_grid("0.5, 2x", "--gaps", "rad"), read_grid("0.5:2:4", "--gaps", "rad")
    ([0.5, '2.0x'], [0.5, 1.0, 1.5, 2.0])
    >>> read_grid("2J1:5J1:3", "--inertias", "kg*m^2")
    ['2.0J1', '3.5J1', '5.0J1']
    """
    if ":" not in text:
        ends = _all(values_in(text, option), option, unit)
        return [value if not ending else f"{value!r}{ending}" for value, ending in ends]
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 3:
        raise InputError(f'{option} = "{text}": a range is from:to:count, as 0.5:2:7 or 1x:4x:7.')
    (first, ending), (last, other) = _all(parts[:2], option, unit)
    if ending != other:
        raise InputError(f'{option} = "{text}": give both ends as quantities, or both as the same multiples.')
    steps = whole_number(parts[2], f'{option} = "{text}": the count', 2, LARGEST_GRID) - 1
    values = [float(f"{first + (last - first) * k / steps:.12g}") for k in range(steps + 1)]
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


def read_free(text: str, option: str = "--free") -> dict[str, tuple[str, str] | None]:
    """Names with commas between, each with a range if one is given.

    >>> read_free("torque,delay=5 ms:20 ms,time=0.5x:2x")
    {'torque': None, 'delay': ('5 ms', '20 ms'), 'time': ('0.5x', '2x')}
    """
    found: dict[str, tuple[str, str] | None] = {}
    mistakes = Mistakes()
    for part in text.split(","):
        name, equals, ends = (piece.strip() for piece in part.partition("="))
        low, colon, high = (piece.strip() for piece in ends.partition(":"))
        with mistakes.noted():
            if not name or (equals and not (low and colon and high)):
                raise InputError(
                    f'{option} "{part.strip()}": write a name, or name=low:high, as time=0.1:0.5 or '
                    "time=0.5x:2x."
                )
            if name in found:
                raise InputError(f'{option} = "{text}": {name} is named twice; name it once.')
            found[name] = (low, high) if equals else None
    mistakes.settle()
    return found


def read_tolerances(texts: Sequence[str], option: str = "--tolerance") -> dict[str, str | list[str]]:
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
                raise InputError(f'{option} "{text}": write KEY=SPREAD, as stiffness=10%.')
            name = names.get(key, key)
            if name in found:
                raise InputError(f'{option} "{text}": {key} is given twice; keep one of the two.')
            several = "," in value or ";" in value
            found[name] = values_in(value, f"{option} {key}") if several else value
    mistakes.settle()
    return found


@click.command(cls=Command)
@drive_argument(read_machine_or_identified)
@controller_option(
    "--controller", "NAME", "The controller to tune, or path/to/file.py:ClassName.", required=True
)
@click.option(
    "--gaps",
    metavar="GAP,...",
    type=Reading(lambda text, option: read_grid(text, option, "rad")),
    help="Gaps: 0.5,1 (rad), '30 deg', 2x (multiple of the drive's), or a range from:to:count such as "
    "0.5:2:7; of a chain the sum of all gaps. Default: 0.5x,1x,2x,4x.",
)
@click.option(
    "--inertias",
    metavar="INERTIA,...",
    type=Reading(lambda text, option: read_grid(text, option, "kg*m^2")),
    help="Load inertias, likewise; also multiples of the motor's, 2J1:5J1:4. Default: 0.4x,1x,2x.",
)
@click.option(
    "--free",
    metavar="NAME[=LOW:HIGH],...",
    type=Reading(read_free),
    help="Parameters to tune, with or without a range: torque,delay='5 ms:20 ms',rise=0.5x:2x (multiples "
    "of the default). Default: all that the controller declares tunable.",
)
@param_option("Fix a parameter of the controller, which is then not tuned. May be repeated.")
@click.option(
    "--metric",
    metavar="NAME",
    default="k_dyn",
    help="Figure to minimise. Default: k_dyn; margin maximises the margin to the [limits].",
)
@click.option(
    "--start-time",
    metavar="TIME",
    help="Upper bound of the start time: 0.3 (s), or 1.2x that of direct in the same cell. Default: that "
    "of the controller with its default gains.",
)
@click.option(
    "--tolerance",
    "tolerances",
    metavar="KEY=SPREAD",
    multiple=True,
    type=Reading(read_tolerances),
    help="Tolerance of a parameter of the drive, stiffness=10% or load_torque=2, or values to cover, "
    "encoder_phase=0,0.5; of a chain also shaft[2].gap=20%. May be repeated.",
)
@click.option(
    "--quantile", metavar="SHARE", type=quantity("1"), default="1", help="Quantile of the starts that is "
    "minimised. Default: 1, the worst case.",
)  # fmt: skip
@click.option(
    "--only",
    metavar="|".join(QUESTIONS),
    type=choice(*QUESTIONS),
    help="Compute the gain schedule or the robust set only.",
)
@click.option(
    "--optimum/--no-optimum",
    "certified",
    default=None,
    help="Compute or skip the optimum of each cell, which takes longest. Default: compute that of drives.",
)
@click.option(
    "--seed", metavar="N", type=count(0), default="0", help="Seed of the random search. Default: 0."
)
@click.option(
    "--restarts", metavar="N", type=count(0), default="3", help="Number of independent searches. Default: 3."
)
@workers_option
@scheduler_option
@set_option
@json_option
@out_option(
    "Write the gains (TOML, CSV), figures (SVG, PNG), tables and report.md into this folder. Finished "
    "parts are saved at once, so that an interrupted command resumes."
)
def tune(
    *,
    drive: Machine | Identification,
    controller: str,
    params: dict[str, str],
    only: str | None,
    certified: bool | None,
    as_json: bool,
    out: str | None,
    **asked: Any,
) -> None:
    """Tune a controller for each gap and load inertia, and one robust set of gains.

    DRIVE is a TOML file, the name of a shipped drive or chain (see: softstart drives), or the folder of an
    identification: the gains are then robust over its confidence region. Of a chain the torques of all shafts
    count. By default the crane drive of the literature. The gains are written as files that every command
    accepts as a controller: softstart simulate DRIVE --controller DIR/robust.toml
    """
    asked |= {
        "parameters": params, "certified": certified,
        "schedule": only != "robust", "robust": only != "schedule",
    }  # fmt: skip
    with output_folder(out) as folder, kept_state(out, STATE, "finished parts") as state:
        tuning = _computed(drive, controller, state, asked)
        if folder is not None:
            with working("drawing the figures ..."):
                views.write_tuning(tuning, folder, command_line())

    present(
        tuning.summary,
        lambda to: views.show(to, tuning),
        as_json,
        out and f"{out}: report.md, the gains, figures, tables and the finished parts",
    )
    if not views.any_in_time(tuning):
        raise SimulationError(
            f"No gains within these ranges start in time ({tuning.question.bound.text()}); allow more time "
            "with --start-time, or wider ranges with --free."
        )


def _computed(
    drive: Machine | Identification, controller: str, state: Path | None, asked: dict[str, Any]
) -> Tuning:
    with working("starting the drive ...") as progress:
        make_controllers([controller], {controller: asked["parameters"]}, prefix=False)
        with Attributed(), named_as_options(_as_typed):
            return softstart.tune(drive, controller, save_to=state, progress=progress, **asked)


def _as_typed(sentence: str) -> str:
    """The sentence with ranges as they are typed behind --free.

    >>> _as_typed('controller = mine: name one with its range, as free={"rise": ("0.5x", "2x")}.')
    'controller = mine: name one with its range, as --free rise=0.5x:2x.'
    """
    sentence = re.sub(r'free=\{"(\w+)": \("([^"]+)", "([^"]+)"\)\}', r"--free \1=\2:\3", sentence)
    sentence = re.sub(r"^(free: \w+ = )\('([^']+)', '([^']+)'\)", r"\1\2:\3", sentence)
    return sentence.replace("workers, scheduler: ", "workers, --scheduler: ", 1)
