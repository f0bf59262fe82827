"""`softstart tune`: gains for each gap and load inertia, one set for all, and what robustness costs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.options import command, controller_option, option
from softstart.cli.running import Output, answers, attributed, controllers_from_options, option_value, working
from softstart.drive import PARAMETERS
from softstart.errors import InputError, SimulationError
from softstart.input.gear import BEHIND
from softstart.quantities import read_multiple, to_si, values_in
from softstart.views.markdown import kept_state

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.identification.result import Identification

STATE = "tuning.sqlite"
LARGEST_GRID = 100  # values of one axis; each cell is a search of its own


def read_axis(text: str, option: str, unit: str) -> list[Any]:
    """Values with commas between, or from:to:count; quantities, or multiples as 2x or 5J1.

    >>> read_axis("0.5, 2x", "--gaps", "rad"), read_axis("0.5:2:4", "--gaps", "rad")
    ([0.5, '2.0x'], [0.5, 1.0, 1.5, 2.0])
    >>> read_axis("2J1:5J1:3", "--inertias", "kg*m^2"), read_axis("0.01 rad at output", "--gaps", "rad")
    (['2.0J1', '3.5J1', '5.0J1'], ['0.01 rad at output'])
    """

    def read(part: str) -> tuple[float, str]:
        at_output = BEHIND.fullmatch(part)  # of the gear of the drive, which is read later
        if (multiple := read_multiple(part, option, ("x", "J1"))) is not None:
            return multiple
        value = float(to_si(at_output[1] if at_output else part, unit, name=option))
        return value, f" {unit} at output" if at_output else ""

    values = options.read_value_list(text, option, read, LARGEST_GRID)
    return [
        f"{float(f'{value:.12g}')!r}{ending}" if ending else float(f"{value:.12g}")
        for value, ending in values
    ]


def _grid(unit: str) -> options.Reader:
    return lambda text, name: read_axis(text, name, unit)


def read_free(text: str, option: str = "--free") -> dict[str, tuple[str, str] | None]:
    """Names with commas between, each with a range if one is given.

    >>> read_free("torque,delay=5 ms:20 ms,time=0.5x:2x")
    {'torque': None, 'delay': ('5 ms', '20 ms'), 'time': ('0.5x', '2x')}
    """
    ranges: dict[str, tuple[str, str] | None] = {}
    for part in text.split(","):
        match = re.fullmatch(r"\s*([^=:]+?)\s*(?:=([^:]+):([^:]+))?", part)
        if match is None:
            raise InputError(f'{option} "{part.strip()}": write a name, or name=low:high, as time=0.5x:2x.')
        name, low, high = match.groups()
        if name in ranges:
            raise InputError(f'{option} = "{text}": {name} is named twice; name it once.')
        ranges[name] = (low.strip(), high.strip()) if low else None
    return ranges


def read_tolerances(texts: Sequence[str], option: str = "--tolerance") -> dict[str, str | list[str]]:
    """`key=spread` texts by field of the drive; several values with commas are those to be met.

    >>> read_tolerances(["shaft.stiffness=10 %", "encoder_phase=0,0.5"])
    {'stiffness': '10 %', 'encoder_phase': ['0', '0.5']}
    """
    names = {parameter.path: parameter.name for parameter in PARAMETERS.values()}
    return {
        names.get(key, key): values_in(value, f"{option} {key}") if "," in value or ";" in value else value
        for key, value in options.read_params(texts, option, "stiffness=10%").items()
    }


@command("tune")
@controller_option("--controller", required=True)
@option("--gaps", _grid("rad"))
@option("--inertias", _grid("kg*m^2"))
@option("--free", read_free)
@options.param_option
@option("--metric", default="k_dyn")
@option("--start-time")
@options.duty_option
@options.stop_option
@options.cycles_option
@option("--tolerance tolerances", read_tolerances, multiple=True)
@option("--quantile", options.quantity("1"), default="1")
@option("--only", type=click.Choice(["schedule", "robust"]))
@option("--optimum/--no-optimum certified", default=None)
@option("--seed", options.count(0), default="0")
@option("--restarts", options.count(0), default="3")
@options.workers_option
@options.scheduler_option
@options.at_option
@options.of_drive(options.read_machine_or_identified)
@answers(out=True)
def tune_command(
    *, drive: Machine | Identification, controller: str, params: dict[str, str],
    only: str | None, **arguments: Any,
) -> Output:  # fmt: skip
    """Tune a controller for each gap and load inertia, and one robust set of gains.

    DRIVE is a TOML file, also of a project, the name of a shipped drive or chain (see: softstart drives), or
    the folder of an identification: the gains are then robust over its confidence region. Those of a drive
    whose stiffness is not known are judged at both ends of its range. Of a chain the torques of all shafts
    count. By default the crane drive of the literature. The gains are written as files that every command
    accepts as a controller: softstart simulate DRIVE --controller DIR/robust.toml

    Options
    -------
    --controller NAME
        The controller to tune, or path/to/file.py:ClassName.
    --gaps GAP,...
        Gaps: 0.5,1 (rad), '30 deg', 2x (multiple of the drive's), or a range from:to:count such as
        0.5:2:7; with a gear also '9 arcmin at output'; of a chain the sum of all gaps. Default:
        0.5x,1x,2x,4x.
    --inertias INERTIA,...
        Load inertias, likewise; also multiples of the motor's, 2J1:5J1:4. Default: 0.4x,1x,2x.
    --free NAME[=LOW:HIGH],...
        Parameters to tune, with or without a range: torque,delay='5 ms:20 ms',rise=0.5x:2x (multiples of
        the default). Default: all that the controller declares tunable.
    --param KEY=VALUE
        Fix a parameter of the controller, which is then not tuned. May be repeated.
    --metric NAME
        Figure to minimise. Default: k_dyn; margin maximises the margin to the [limits]. Of a duty also
        k_dyn_step_2, that of its second step, or damage.
    --start-time TIME
        Upper bound of the start time (settled time of a strategy that holds the speed): 0.3 (s), or 1.2x
        that of direct in the same cell. Default: that of the controller with its default gains.
    --tolerance KEY=SPREAD
        Tolerance of a parameter of the drive, stiffness=10% or load_torque=2, or values to cover,
        encoder_phase=0,0.5; of a chain also shaft[2].gap=20%. May be repeated.
    --quantile SHARE
        Quantile of the starts that is minimised. Default: 1, the worst case.
    --only schedule|robust
        Compute the gain schedule or the robust set only.
    --optimum
        Compute or skip the optimum of each cell, which takes longest. Default: compute that of drives.
    --seed N
        Seed of the random search. Default: 0.
    --restarts N
        Number of independent searches. Default: 3.
    --out DIR
        Write the gains (TOML, CSV), figures (SVG, PNG), tables and report.md into this folder. Finished
        parts are saved at once, so that an interrupted command resumes.
    """
    arguments = {name: value for name, value in arguments.items() if value is not None or name != "cycles"}
    arguments |= {"schedule": only != "robust", "robust": only != "schedule", "parameters": params}
    arguments["duty"] = options.typed_duty(drive)
    with (
        kept_state(option_value("out"), STATE, "finished parts") as state,
        working("starting the drive ...") as progress,
        attributed(),
        _as_typed(),
    ):
        # a wrong parameter is reported before the search begins
        controllers_from_options([controller], params, several=False)
        tuning = softstart.tune(drive, controller, save_to=state, progress=progress, **arguments)
    from softstart.views.tuning import any_in_time

    if any_in_time(tuning):
        return tuning
    late = SimulationError(
        f"No gains within these ranges start in time ({tuning.problem.bound}); allow more time with "
        "--start-time, or wider ranges with --free."
    )
    return tuning.summary, tuning.sheet, late


@contextmanager
def _as_typed() -> Iterator[None]:
    """Errors with ranges as they are typed behind --free.

    >>> with _as_typed():
    ...     raise InputError('controller = mine: name one with its range, as free={"rise": ("0.5x", "2x")}.')
    Traceback (most recent call last):
    softstart.errors.InputError: controller = mine: name one with its range, as --free rise=0.5x:2x.
    """
    try:
        yield
    except InputError as error:
        text = re.sub(r'free=\{"(\w+)": \("([^"]+)", "([^"]+)"\)\}', r"--free \1=\2:\3", str(error))
        text = re.sub(r"(?m)^(free: \w+ = )\('([^']+)', '([^']+)'\)", r"\1\2:\3", text)
        raise InputError(text.splitlines()) from error
