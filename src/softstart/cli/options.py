"""Commands described by their docstrings, the options that they share, and how the texts are read.

Options that several commands have alike; the docstring of a command describes its own, or another meaning:

--allow-code
    Allow a file of tuned gains to name a Python file, which is then executed.
--at motor|output
    Show torques, speeds, angles, stiffness and inertia at the motor shaft or at the output of the gear.
    Default: as `units` of DRIVE says, else at the motor shaft. --json and CSV files are always at the motor.
--budget TIME
    Time limit of numerical optimisation, for example 60 (s). Default: 20 s, of several shafts 60 s; 0
    disables it.
--controllers A,B,...
    Strategies, separated by commas. Default: all installed ones that need no parameter.
--cycles N
    Number of cycles of the duty. Default: 2.
--duty [FILE]
    Carry every machine through a duty instead of a start: a file, or the name of a shipped duty; without FILE
    the [[duty]] of DRIVE, which is then written first.
--fitted-to DRIVE
    Set the controllers up for this drive (a file or shipped name) and run them on DRIVE, to check their
    robustness. --set changes DRIVE only.
--json
    Print the result as one JSON object.
--param CONTROLLER.KEY=VALUE
    Set a parameter of a strategy, for example ramp.time='0.2 s'. May be repeated.
--pdf FILE
    PDF file to write, for example report.pdf; printed with Chromium, Chrome or Edge.
--resolution KEY=STEP,...
    Resolution of the inverter parameters, for example
    torque=0.5%,time=10ms,speed=1rpm,frequency=0.1Hz,share=1%. Torque in % of the rated torque or in N*m.
    Default: 0.1 %, 1 ms, 1 rpm, 0.1 Hz and 0.01.
--scheduler ADDRESS
    Compute on the dask cluster of this scheduler.
--set KEY=VALUE
    Change a parameter of the drive, for example load.inertia=0.07 or shaft.gap='2 rad'. May be repeated.
--stop strategy|torque|coast|brake
    How the machine stops where a step does not say it. Default: by the strategy if it can stop, else by
    torque if motor.minimum_torque is below 0, else coast.
--torque-speed SPEED:TORQUE,...
    Corners of the torque-speed curve that limits the motor, for example '0 rad/s:62 N*m,90 rad/s:40 N*m':
    two or more, concave, above the load torque up to the target speed; the last piece goes on.
--until TIME
    End of the simulation, for example 0.5 (s) or '500 ms'. Default: one elastic period after the start
    time (a clutch: after the lock-up).
--workers N
    Number of parallel workers. Default: one per processor.

Of commands with one strategy:

--controller NAME
    A strategy: its name, path/to/file.py:ClassName, a file of tuned gains (.toml), or a torque profile
    (.csv).
--param KEY=VALUE
    Set a parameter of the strategy, for example time='200 ms'. May be repeated.
"""

from __future__ import annotations

import inspect
import os
import re
import shlex
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import click
import numpy as np

from softstart.chain.elements import LIBRARY as CHAINS
from softstart.chain.machines import is_chain_text
from softstart.chain.model import Chain
from softstart.cli.completion import one_of
from softstart.drive import Drive, library
from softstart.drive.data_sheet import DataSheet, still_assumed
from softstart.drive.duty import Duty, StopBy
from softstart.drive.machine import Machine
from softstart.drive.model import OF_DUTY
from softstart.errors import InputError, SimulationError
from softstart.hints import did_you_mean
from softstart.input.documents import DocumentTable, is_project, parsed
from softstart.input.files import ABSENT, read_text, refusal_of
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import read_settings
from softstart.input.parameters import Wording
from softstart.plugins import controller_names
from softstart.quantities import RefusedError, show, to_si, values_in, whole_number
from softstart.views.numbers import seen_at

if TYPE_CHECKING:
    from softstart.identification.result import Identification
    from softstart.project import Project

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
Load = Callable[[str, Sequence[str]], Any]
Reader = Callable[[Any, str], Any]

DEFAULT_DRIVE = "crane-4amtkf"
CODE, SETTINGS, TYPED = "softstart.allow_code", "softstart.settings", "softstart.typed"
DUTY, AT = "softstart.duty", "softstart.at"


def drive_names() -> tuple[str, ...]:
    """Names of the shipped drives."""
    return tuple(library.names())


def code_allowed() -> bool:
    """Whether the command that runs now has --allow-code."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(CODE))


def typed_command() -> str:
    """The command that runs now, as one would type it."""
    return shlex.join(["softstart", *(click.get_current_context().obj or ())])


# reading them --------------------------------------------------------------------------------------------


def reading(read: Reader) -> Callable[..., Any]:
    """The callback of an option or argument: its command is given `read(text, name)`, or None without it."""

    def callback(context: click.Context, parameter: click.Parameter, text: object) -> object:
        return text if text is None or context.resilient_parsing else read(text, parameter.opts[0])

    return callback


def quantity(unit: str, least: float = -np.inf, above: float = -np.inf) -> Reader:
    """Reads a quantity in this unit, of `least` or more, or above `above`."""

    def read(text: str, option: str) -> float:
        value = float(to_si(text, unit, name=option))
        if value < least or value <= above:
            wanted = f"{least:g} or more" if value < least else f"a value above {above:g} {unit}"
            raise InputError(f'{option} = "{text}": give {wanted}.')
        return value

    return read


def count(least: int = 1, most: int = 10**15) -> Reader:
    """Reads a whole number."""
    return lambda text, option: whole_number(text, option, least, most)


def read_drive(name: str, settings: Sequence[str]) -> Drive:
    """The one drive asked for, with its changes."""
    file = _file(name)
    if is_chain_text(file.text):
        remedy = f'"softstart reduce {name} --out DIR" writes the two masses that stand for it'
        if file.project is not None:
            remedy = "choose a drive of the project"
        raise InputError(f"{file.subject}: this is a chain, and a drive is needed here; {remedy}.")
    machine = _made(file, settings)
    assert isinstance(machine, Drive)
    return _at_one_end(machine)


def read_machine(name: str, settings: Sequence[str]) -> Drive | Chain:
    """The one drive, or the chain, asked for, with its changes."""
    machine = read_as_known(name, settings)
    return _at_one_end(machine) if isinstance(machine, Drive) else machine


def read_as_known(name: str, settings: Sequence[str]) -> Drive | Chain:
    """The one drive, or the chain, asked for, as far as it is known; of a project the one chosen there."""
    known = (*drive_names(), *CHAINS.names())
    # a single word that is no file was meant as the name of a shipped machine
    if re.fullmatch(r"[\w-]+", name) and name not in known and refusal_of(name) == ABSENT:
        hint = did_you_mean(name, known)
        raise InputError(f'"{name}": no such file, and no shipped drive or chain has this name; {hint}')
    return _made(_file(name), settings)


def read_project(name: str) -> Project | None:
    """The project of the file of this name; None if it is of another kind, or cannot be read."""
    if name in (*drive_names(), *CHAINS.names()):
        return None
    with suppress(RefusedError):  # told by the reader of machines
        if is_project(text := read_text(name)):
            from softstart.project import Project

            return Project.read(text, name, Path(name).parent)
    return None


class _File(NamedTuple):
    """The text of a machine's file, what it is called in sentences, and the project that holds it."""

    text: str
    where: str
    project: Project | None = None

    @property
    def subject(self) -> str:
        return self.where if self.project is not None else show(self.where)


def _file(name: str) -> _File:
    """That of a machine by its name or path; of a project that of the machine chosen there."""
    if (project := read_project(name)) is None:
        shipped = CHAINS if name in CHAINS.names() and name not in drive_names() else library
        return _File(*shipped.find(name))
    try:
        stored = project.stored()
    except InputError as error:
        raise InputError(f"{name}: {one}" for one in error.sentences) from None
    return _File(stored.file, f'{name}: machine "{stored.name}"', project)


def _made(file: _File, settings: Sequence[str]) -> Drive | Chain:
    """The machine of a file with its changes, and with the duty that its project has chosen."""
    if file.project is None or not file.project.duty:
        return _changed(file, settings)
    of_duty = [one for one in settings if OF_DUTY.match(one)]
    machine = _changed(file, [one for one in settings if one not in of_duty])
    changed: Drive | Chain = file.project.with_duty(machine, read_changes(of_duty))
    return changed


def _changed(file: _File, settings: Sequence[str]) -> Drive | Chain:
    """The machine of a file, of a data sheet too, with its changes."""
    text, where, _ = file
    if is_chain_text(text):
        return Chain.from_toml(text, where=where, also=read_changes(settings))
    if not _is_data_sheet(text):
        drive = Drive.from_toml(text, where=where)
        return drive.with_settings(settings) if settings else drive
    # its own keys are those of the sheet, at their own parts
    paths = {p.path for p in DataSheet.PARAMETERS.values()}
    sheet_settings = [one for one in settings if one.partition("=")[0].strip() in paths]
    settings = [one for one in settings if one not in sheet_settings]
    data_sheet = DataSheet.from_toml(text, where=where, also=read_changes(sheet_settings))
    writes = "" if file.project is not None else f'; "softstart init {where} --out FILE" writes the drive'
    print(
        f"{file.subject} is a data sheet, converted to a drive ({data_sheet.motion}){writes}.",
        file=sys.stderr,
    )
    for warning in data_sheet.motion_warnings:
        print(f"softstart: warning: {warning}", file=sys.stderr)
    drive_settings = read_settings(settings, Drive.PARAMETERS)[0]
    drive = data_sheet.drive.with_settings(settings) if settings else data_sheet.drive
    if "assumed" in drive_settings:
        return drive
    return drive.replace(assumed=still_assumed(drive, drive_settings))


def _is_data_sheet(text: str) -> bool:
    with suppress(InputError):  # told by the reader of drives
        return DataSheet.describes(parsed(text, Wording(), "a drive"))
    return False


def _at_one_end(drive: Drive) -> Drive:
    """The drive, for commands that take one stiffness."""
    if drive.soft is not None:
        print(
            "softstart: warning: no stiffness is known; this command computes with the stiff end of the "
            "range only (compare, tune and report take both ends).",
            file=sys.stderr,
        )
    return drive


def read_machine_or_identified(name: str, settings: Sequence[str]) -> Drive | Chain | Identification:
    """The one drive, the chain, or the identification in a folder, with its changes."""
    if name not in drive_names() and os.path.isfile(os.path.join(name, "identification.json")):
        from softstart.identification.result import Identification

        return Identification.load(name).with_settings(settings)
    return read_as_known(name, settings)


@contextmanager
def named_as_options(**also: str) -> Iterator[None]:
    """Sentences about keywords of Python functions, as sentences about options of the command that runs.

    A keyword is the name of the option's parameter, or is in `also`.

    >>> command = click.Command("sweep", params=[click.Option(["--axis", "grid"])])
    >>> with click.Context(command), named_as_options():
    ...     raise InputError("grid = 3: name the axes, or leave grid out.")
    Traceback (most recent call last):
    softstart.errors.InputError: --axis = 3: name the axes, or leave --axis out.
    """
    options = click.get_current_context().command.params
    flags = {str(one.name): one.opts[0] for one in options if isinstance(one, click.Option)}
    names = flags | also  # `also` wins: an option may stand for an argument of another function

    def renamed(sentence: str) -> str:
        if sentence.startswith("[duty] "):  # found with the machine: which file it is
            meta = click.get_current_context().meta
            return f"{meta.get(DUTY) or meta.get(TYPED)}: {sentence}"
        keyword = re.match(r"(\w+)(?= =|:|,| \")", sentence)
        if keyword is None or keyword[1] not in names:
            return sentence
        return re.sub(rf"\b{keyword[1]}(?= =|:|,| \"| out\b)", names[keyword[1]], sentence)

    try:
        yield
    except InputError as error:
        raise InputError(map(renamed, error.sentences)) from error
    except SimulationError as error:
        raise SimulationError(renamed(str(error))) from error


def read_list(text: str, option: str) -> list[str]:
    """Words with commas between."""
    return [word.strip() for word in text.split(",")]


def read_value_list(
    text: str, option: str, read: Callable[[str], tuple[float, Any]], most: int = 1000
) -> list[tuple[float, Any]]:
    """Values with commas between, or from:to:count, or from:to:count:log for equal ratios.

    `read` gives a number and of what it is a multiple; both ends of a range are of one kind.

    >>> read_value_list("0.5 rad:2 rad:3", "--gaps", lambda text: (to_si(text, "rad"), ""))
    [(0.5, ''), (1.25, ''), (2.0, '')]
    """
    if ":" not in text:  # no range
        return [read(part) for part in values_in(text, option)]
    parts = [part.strip() for part in text.split(":")]
    if len(parts) < 3 or parts[3:] not in ([], ["log"]):
        raise InputError(f'{option} = "{text}": a range is from:to:count, or from:to:count:log.')
    number = whole_number(parts[2], f'{option} = "{text}": the count', 2, most)
    (low, kind), (high, other) = map(read, parts[:2])
    if kind != other:
        raise InputError(f'{option} = "{text}": give both ends as quantities, or as the same multiples.')
    if low == high:
        raise InputError(f'{option} = "{text}": both ends are the same; write the one value.')
    if parts[3:] and not (low > 0.0 and high > 0.0):
        raise InputError(f'{option} = "{text}": the ends of a range in equal ratios (log) are above 0.')
    spaced = np.geomspace if parts[3:] else np.linspace
    return [(value, kind) for value in spaced(low, high, number).tolist()]


def read_names(text: str, option: str = "--controllers") -> list[str]:
    """The controllers of a comma-separated list, each known and named once."""
    names = [check_name(name, option) for name in read_list(text, option)]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise InputError(f'{option} = "{text}": {twice} is named twice; name it once.')
    return names


def check_name(name: str, option: str) -> str:
    """The name of an installed controller, or of a file with Python code or tuned gains (TOML, CSV)."""
    if "," in name and not Path(f"{name.partition('.py')[0]}.py").is_file():
        remedy = "compare and sweep take several, other commands are run once for each"
        raise InputError(f'{option} = "{name}": give one controller here; {remedy}.')
    known = controller_names()
    if name not in known and ".py" not in name and not name.lower().endswith((".toml", ".csv")):
        hint = did_you_mean(name, known)
        raise InputError(f'{option} = "{name}": there is no controller of this name; {hint}')
    return name


def read_params(
    texts: Sequence[str], option: str = "--param", example: str = 'torque="15 N*m"'
) -> dict[str, str]:
    """The `key=value` texts of an option as a mapping; what asked for it reads the values.

    >>> read_params(["torque=15 N*m"])
    {'torque': '15 N*m'}
    """
    params: dict[str, str] = {}
    for text in texts:
        key, _, value = (part.strip() for part in text.partition("="))
        if not (key and value):
            raise InputError(f'{option} "{text}": write a key, an equals sign and a value, as {example}.')
        if key in params:
            raise InputError(f'{option} "{text}": {key} is given twice; keep one of the two.')
        params[key] = value
    return params


def read_changes(settings: Sequence[str]) -> dict[str, Any]:
    """The `key=value` texts of --set for a file of tables: a value that is one in TOML is read, else text.

    >>> read_changes(["masses.reciprocating=0.6 kg", "cylinders.firing_order=[1, 2]"])
    {'masses.reciprocating': '0.6 kg', 'cylinders.firing_order': [1, 2]}
    """
    changes: dict[str, Any] = {}
    for key, value in read_params(settings, "--set", "load.inertia=0.07").items():
        try:
            changes[key] = tomllib.loads(f"value = {value}")["value"]
        except (RecursionError, ValueError):  # no TOML, or an integer of thousands of digits
            changes[key] = value
    return changes


# commands and options --------------------------------------------------------------------------------------

DESCRIBED = re.compile(r"^(--\S+)(?: (\S.*))?\n((?:    .*\n?)+)", re.MULTILINE)


def described_options(text: str) -> dict[str, tuple[str | None, str]]:
    """Metavar and meaning of each option that a docstring describes.

    >>> described_options("--until TIME\\n    End of the simulation,\\n    in s.\\n--json\\n    Print JSON.")
    {'--until': ('TIME', 'End of the simulation, in s.'), '--json': (None, 'Print JSON.')}
    """
    rows = DESCRIBED.findall(text)
    return {flag: (metavar or None, " ".join(lines.split())) for flag, metavar, lines in rows}


SHARED, WITH_ONE_STRATEGY = map(described_options, (__doc__ or "").split("Of commands with one strategy:"))


class DocumentedCommand(click.Command):
    """A command whose docstring describes its options too, under *Options*: flag, metavar and meaning."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        # what stands behind the heading belongs to the options, not to the text of the command
        self.help, _, options = inspect.cleandoc(self.help or "").partition("\n\nOptions\n-------\n")
        one = any(parameter.opts[0] == "--controller" for parameter in self.params)
        meanings = SHARED | (WITH_ONE_STRATEGY if one else {}) | described_options(options)
        for parameter in self.params:
            if isinstance(parameter, click.Option):
                parameter.metavar, parameter.help = meanings.get(parameter.opts[0], (None, None))


command = partial(click.command, cls=DocumentedCommand)


def option(flag: str, read: Reader | None = None, **settings: Any) -> Decorator:
    """An option, its text read by `read(text, flag)`; behind the flag may be the name of its parameter."""
    return click.option(*flag.split(), callback=None if read is None else reading(read), **settings)


def typed_settings(of_duty: bool = False) -> tuple[str, ...]:
    """The texts of --set for the machine; or those for the duty, where --duty has a file of its own."""
    meta = click.get_current_context().meta
    texts = meta.get(SETTINGS, ())
    return tuple(one for one in texts if of_duty == bool(meta.get(DUTY) and OF_DUTY.match(one)))


def typed_shaft() -> list[str]:
    """--at and its shaft as typed, if it was."""
    shaft = click.get_current_context().meta.get(AT)
    return [] if shaft is None else ["--at", shaft]


def typed_machine() -> str:
    """The argument for the machine as it was typed."""
    return str(click.get_current_context().meta[TYPED])


def machine_argument(
    name: str, read: Load, names: Callable[[], Iterable[str]], default: str | Callable[[], str],
    tables: Iterable[DocumentTable],
) -> Decorator:  # fmt: skip
    """A TOML file or the name of a shipped one, with --set; the command gets `read(name, texts of --set)`."""

    def load(typed: str, _: str) -> object:
        click.get_current_context().meta[TYPED] = typed
        return seen(read(typed, typed_settings()))

    argument = click.argument(
        name,
        metavar=f"[{name.upper()}]",
        callback=reading(load),
        shell_complete=one_of(names),
        default=default,
    )
    return lambda command: argument(set_option(tables)(command))


def of_drive(read: Load, default: str | Callable[[], str] = DEFAULT_DRIVE) -> Decorator:
    """DRIVE, a file or the name of a shipped one, with --set."""
    return machine_argument("drive", read, drive_names, default, Drive.TABLES)


def of_file(kind: type[ParameterFile], default: str) -> Decorator:
    """The argument for a file of another kind, with --set for the keys of its tables."""

    def read(name: str, settings: Sequence[str]) -> ParameterFile:
        return kind.load(name, also=read_changes(settings))

    return machine_argument(kind.__name__.lower(), read, kind.LIBRARY.names, default, kind.TABLES)


def controller_option(flag: str, several: bool = False, **settings: Any) -> Decorator:
    """An option that takes one or more controllers, and --allow-code for files of tuned gains among them.

    The command gets a name or, of several, a list of names.
    """
    read = read_names if several else check_name
    names = option(flag, read, shell_complete=one_of(controller_names), **settings)
    return lambda command: names(allow_code_option(command))


def keys_of(tables: Iterable[DocumentTable]) -> list[str]:
    """The keys of a file as --set names them; the first of a list of tables stands for all."""
    return [p.path.replace(".", "[1].", 1) if one.many else p.path for one in tables for p in one.parameters]


def set_option(tables: Iterable[DocumentTable]) -> Decorator:
    """--set, for a file with these tables; it is read first, as the machine is loaded with its changes."""
    # is_eager: click calls the callback of the machine argument after this one
    return click.option(
        "--set", "settings", multiple=True, is_eager=True, expose_value=False,
        callback=lambda context, _, texts: context.meta.update({SETTINGS: texts}),
        shell_complete=one_of(lambda: keys_of(tables), end="="),
    )  # fmt: skip


allow_code_option = click.option(
    "--allow-code", is_flag=True, expose_value=False,
    callback=lambda context, _, allowed: context.meta.update({CODE: allowed}),
)  # fmt: skip


def seen(found: Any) -> Any:
    """A machine, or what holds one, that is seen at the shaft of --at."""
    shaft = click.get_current_context().meta.get(AT)
    if shaft is None:
        return found
    if not isinstance(found, Machine):
        return replace(found, drive=seen(found.drive))
    try:
        return seen_at(found, shaft)
    except RefusedError as refusal:
        # where no value was written "at output", none can be written at the motor
        reason = refusal.reason.replace("or write the value at the motor shaft", "or leave --at out")
        raise InputError(f"--at {shaft}: {reason}.") from None


def typed_duty(given: Machine | Identification) -> Duty | bool | None:
    """The duty of --duty for this machine, with the changes of --set; True: its own, None: no --duty."""
    name = click.get_current_context().meta.get(DUTY)
    if not name:
        return None if name is None else True
    machine = given if isinstance(given, Machine) else given.drive
    return Duty.load_for(machine, name, read_changes(typed_settings(True)))


def _read_fitted_to(name: str, option: str) -> Drive:
    return read_drive(name, ())


until_option = option("--until", quantity("s", above=0.0))
fitted_to_option = option("--fitted-to", _read_fitted_to, shell_complete=one_of(drive_names))
# is_eager: the machine is loaded with it
at_option = click.option(
    "--at", type=click.Choice(["motor", "output"]), is_eager=True, expose_value=False,
    callback=lambda context, _, shaft: context.meta.update({AT: shaft}),
)  # fmt: skip
json_option = option("--json as_json", is_flag=True)
# is_eager: the machine is loaded without the changes of a duty in a file of its own
duty_file_option = click.option(
    "--duty", is_eager=True, expose_value=False, shell_complete=one_of(Duty.LIBRARY.names),
    callback=lambda context, _, name: context.meta.update({DUTY: name}),
)  # fmt: skip
duty_option = click.option(
    "--duty", is_eager=True, expose_value=False, shell_complete=one_of(Duty.LIBRARY.names),
    callback=lambda context, _, name: context.meta.update({DUTY: name}), is_flag=False, flag_value="",
)  # fmt: skip
stop_option = option("--stop", type=click.Choice(get_args(StopBy)))
cycles_option = option("--cycles", count(1, 100_000))
workers_option = option("--workers", count())
scheduler_option = option("--scheduler")
param_option = option("--param params", read_params, multiple=True)
