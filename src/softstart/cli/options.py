"""The options that commands share, and reading them: all errors of one command line are reported at once."""

from __future__ import annotations

import os
import re
import shlex
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from softstart.chain.model import Chain, is_chain, load_machine
from softstart.cli.commands import Reading, did_you_mean
from softstart.cli.completion import (
    Keys,
    controllers,
    drive_keys,
    files_only,
    names_or_files,
    parameters,
    table_keys,
)
from softstart.cli.completion import settings as settings_of
from softstart.drive import Drive, library
from softstart.drive.data_sheet import DataSheet
from softstart.errors import InputError, Mistakes
from softstart.input.documents import Table
from softstart.input.files import Library, read_text, refusal_of
from softstart.input.parameter_set import read_settings
from softstart.late import late
from softstart.plugins import CONTROLLERS, registered
from softstart.quantities import RefusedError, to_si, whole_number

if TYPE_CHECKING:
    from softstart.chain import two_masses as simulation
    from softstart.identification import result
    from softstart.identification.result import Identification
    from softstart.views import chains as views
else:
    result, simulation = late("softstart.identification.result"), late("softstart.chain.two_masses")
    views = late("softstart.views.chains")

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

DEFAULT_DRIVE = "crane-4amtkf"
CODE = "softstart.allow_code"
# keywords of Python functions that are called otherwise than the option
KEYWORDS = {"k_dyn": "--max-k-dyn", "heat": "--max-heat", "start_time": "--start-times", "grid": "--axis",
            "tolerances": "--tolerance", "to": "--out", "output": "--out"}  # fmt: skip


def drive_names() -> tuple[str, ...]:
    """Names of the shipped drives."""
    return tuple(library.names())


@cache
def controller_names() -> tuple[str, ...]:
    """Names of the installed controllers, found without importing any."""
    return tuple(registered(CONTROLLERS))


def code_allowed() -> bool:
    """Whether the command that runs now has --allow-code."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(CODE))


def command_line() -> str:
    """The command that runs now, as one would type it."""
    return shlex.join(["softstart", *(click.get_current_context().obj or ())])


# reading them --------------------------------------------------------------------------------------------


def read_drive(name: str, settings: Sequence[str]) -> Drive:
    """The one drive asked for, with its changes; of a chain the two masses that stand for it."""
    if is_chain(name):
        return two_masses(Chain.load(name, also=read_changes(settings)), name)
    sheet = _data_sheet(name)
    if sheet is None:
        return Drive.load(name).with_settings(settings) if settings else Drive.load(name)
    # its own keys are those of the sheet, at their own parts
    paths = {path for p in DataSheet.PARAMETERS.values() for path in (p.path, p.formerly)}
    own = [one for one in settings if one.partition("=")[0].strip() in paths]
    settings = [one for one in settings if one not in own]
    found = DataSheet.from_toml(sheet, where=name, also=read_changes(own))
    print(
        f'"{name}" is a data sheet, read as the drive that follows from it; "softstart init {name} '
        '--out FILE" writes that drive.',
        file=sys.stderr,
    )
    drive = found.drive.with_settings(settings) if settings else found.drive
    given = read_settings(settings, Drive.PARAMETERS)[0]
    return drive if "assumed" in given else drive.replace(assumed=found.assumed_still(given))


def _data_sheet(name: str) -> str | None:
    """The text of the file of this name, if it is a data sheet."""
    if name in drive_names() or refusal_of(name) is not None:
        return None
    with suppress(RefusedError, ValueError):  # told by the reader of drives
        text = read_text(name)
        return text if DataSheet.describes(tomllib.loads(text)) else None
    return None


def two_masses(chain: Chain, name: str) -> Drive:
    """The two masses of a chain, if their K_dyn is near enough to that of the chain; says so."""
    found = simulation.two_mass_error(chain)
    if not found.enough:
        raise InputError(
            f'"{name}": this is a chain, and this command takes a drive. {views.enough(found)} '
            f'"softstart reduce {name} --out DIR" writes the two masses all the same.'
        )
    print(f'"{name}" is a chain. {views.enough(found)}', file=sys.stderr)
    return found.drive


def read_machine(name: str, settings: Sequence[str]) -> Drive | Chain:
    """The one drive, or the chain, asked for, with its changes."""
    if is_chain(name):
        return Chain.load(name, also=read_changes(settings))
    try:
        return read_drive(name, settings)
    except InputError:
        load_machine(name)  # names a chain that may be meant
        raise


def read_machine_or_identified(name: str, settings: Sequence[str]) -> Drive | Chain | Identification:
    """The one drive, the chain, or the identification in a folder, with its changes."""
    if name not in drive_names() and os.path.isfile(os.path.join(name, "identification.json")):
        return result.Identification.load(name).with_settings(settings)
    return read_machine(name, settings)


def _read_fitted_to(name: str, option: str) -> Drive:
    """The drive of --fitted-to."""
    try:
        return read_drive(name, ())
    except InputError as error:
        raise InputError([f"{option}: {sentence}" for sentence in error.sentences]) from None


def quantity(unit: str, meaning: str = "", least: float | None = None, above: float | None = None) -> Reading:
    """The type of an option that is a quantity in this unit, of `least` or more, or above `above`.

    >>> quantity("s", "give a time above 0 s", above=0.0).read("-1 ms", "--until")
    Traceback (most recent call last):
    softstart.errors.InputError: --until = "-1 ms": give a time above 0 s.
    """

    def read(text: str, option: str) -> float:
        value = float(to_si(text, unit, name=option))
        if not ((above is None or value > above) and (least is None or value >= least)):
            raise InputError(f'{option} = "{text}": {meaning}.')
        return value

    return Reading(read)


@contextmanager
def named_as_options(typed: Callable[[str], str] = str) -> Iterator[None]:
    """Sentences about keywords of Python functions, as sentences about options of the command that runs.

    `typed` rewrites what else is typed otherwise than in Python.
    """
    try:
        yield
    except InputError as error:
        raise InputError([as_option(typed(sentence)) for sentence in error.sentences]) from error


def as_option(sentence: str) -> str:
    """The sentence with the option's name where the keyword's was.

    >>> command = click.Command("sweep", params=[click.Option(["--chunk"])])
    >>> with click.Context(command):
    ...     as_option("chunk = 3: ...; leave chunk out to go on"), as_option("gap = -1: a gap is 0 or more.")
    ('--chunk = 3: ...; leave --chunk out to go on', 'gap = -1: a gap is 0 or more.')
    """
    found, context = re.match(r"(\w+)(?= =|:|,)", sentence), click.get_current_context(silent=True)
    if found is None or context is None:
        return sentence
    options = [one for one in context.command.params if isinstance(one, click.Option)]
    by_keyword = {str(one.name): one.opts[0] for one in options}
    by_keyword |= {one.opts[0].lstrip("-").replace("-", "_"): one.opts[0] for one in options}
    other = KEYWORDS.get(found[1], "")
    option = by_keyword.get(found[1]) or (other if other in by_keyword.values() else "")
    return re.sub(rf"\b{found[1]}(?= =|:|,| out\b)", option, sentence) if option else sentence


def count(least: int = 1, most: int = 10**15) -> Reading:
    """The type of an option that is a whole number.

    >>> count().read("12", "--workers")
    12
    """
    return Reading(lambda text, option: whole_number(text, option, least, most))


def choice(*words: str) -> Reading:
    """The type of an option that is one of these words.

    >>> choice("synchronous", "steady", "reached").read("steedy", "--terminal")
    Traceback (most recent call last):
    softstart.errors.InputError: --terminal = "steedy": there is no such choice; did you mean steady?
    """

    def read(text: str, option: str) -> str:
        if text not in words:
            raise InputError(f'{option} = "{text}": there is no such choice; {did_you_mean(text, words)}')
        return text

    return Reading(read, words=words)


def read_each(parts: Iterable[str], read: Callable[[str], Any]) -> list[Any]:
    """Every part of a list, read; all errors at once."""
    mistakes = Mistakes()
    found = []
    for part in parts:
        with mistakes.noted():
            found.append(read(part))
    mistakes.settle()
    return found


def read_range(
    text: str, option: str, most: int = 1000
) -> tuple[list[str], Callable[[float, float], list[float]]]:
    """The ends of from:to:count, or from:to:count:log, and what gives all values once these are read.

    >>> ends, values = read_range("0.5 rad:2 rad:4", "--gaps")
    >>> ends, values(0.5, 2.0)
    (['0.5 rad', '2 rad'], [0.5, 1.0, 1.5, 2.0])
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) < 3 or parts[3:] not in ([], ["log"]):
        raise InputError(f'{option} = "{text}": a range is from:to:count, or from:to:count:log.')
    count = whole_number(parts[2], f'{option} = "{text}": the count', 2, most)

    def values(low: float, high: float) -> list[float]:
        if low == high:
            raise InputError(f'{option} = "{text}": both ends are the same; write the one value.')
        if parts[3:] and not (low > 0.0 and high > 0.0):
            raise InputError(f'{option} = "{text}": the ends of a range in equal ratios (log) are above 0.')
        found: list[float] = (np.geomspace if parts[3:] else np.linspace)(low, high, count).tolist()
        return found

    return parts[:2], values


def read_list(text: str, option: str) -> list[str]:
    """Words with commas between.

    >>> read_list("gap, stiffness", "--free")
    ['gap', 'stiffness']
    """
    return [word.strip() for word in text.split(",")]


def read_names(text: str, option: str = "--controllers") -> list[str]:
    """The controllers of a comma-separated list, each known and named once."""
    names = read_list(text, option)
    if not all(names):
        raise InputError(
            f'{option} = "{text}": a name is empty; write names with commas between, as direct,ramp.'
        )
    mistakes = Mistakes()
    for index, name in enumerate(names):
        with mistakes.noted():
            check_name(name, option)
            if name in names[:index]:
                raise InputError(f'{option} = "{text}": {name} is named twice; name it once.')
    mistakes.settle()
    return names


def check_name(name: str, option: str, several: str = "") -> str:
    """The name, if it is that of an installed controller or leads to a file that is there.

    Such a file holds Python code, or tuned gains as TOML or CSV. `several` says what to do with more than one
    controller, where that can be done in one go.
    """
    code, python, _ = name.partition(".py")
    if "," in name and not Path(f"{code}.py").is_file():
        names = ",".join(part.strip() for part in name.split(",") if part.strip())
        remedy = several + names if several else "run the command once for each of them"
        raise InputError(f'{option} = "{name}": give one controller here; {remedy}.')
    if python and (reason := refusal_of(path := Path(f"{code}.py"))) is not None:
        raise InputError(f'{option} = "{name}": {path}: {reason}; give path/to/file.py:ClassName.')
    if python or name in controller_names():
        return name
    if not name.lower().endswith((".toml", ".csv")):
        hint = did_you_mean(name, controller_names())
        raise InputError(f'{option} = "{name}": there is no controller of this name; {hint}')
    if (reason := refusal_of(Path(name))) is not None:
        raise InputError(f'{option} = "{name}": {reason}; give one that softstart tune has written.')
    return name


def read_params(
    texts: Sequence[str], option: str = "--param", example: str = 'torque="15 N*m"'
) -> dict[str, str]:
    """The `key=value` texts of an option as a mapping; what asked for it reads the values.

    >>> read_params(["torque=15 N*m"])
    {'torque': '15 N*m'}
    """
    mistakes = Mistakes()
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        with mistakes.noted(f'{option} "{text}": '):
            if not (key and equals and value):
                raise InputError(f"write a key, an equals sign and a value, as {example}.")
            if key in found:
                raise InputError(f"{key} is given twice; keep one of the two.")
            found[key] = value
    mistakes.settle()
    return found


def read_params_of(
    texts: Sequence[str], option: str = "--param", names: Sequence[str] | None = None
) -> dict[str, dict[str, str]]:
    """The `controller.key=value` texts of --param, by controller; `names`: by default all that are installed.

    >>> read_params_of(["ramp.time=0.2"], names=["direct", "ramp"])
    {'ramp': {'time': '0.2'}}
    """
    names = controller_names() if names is None else names
    mistakes = Mistakes()
    found: dict[str, dict[str, str]] = {}
    for whole, value in read_params(texts, option, "ramp.time=0.2").items():
        name, _, key = whole.rpartition(".")
        with mistakes.noted(f'{option} "{whole}={value}": '):
            if not (name and key):
                raise InputError("write CONTROLLER.key=value, as ramp.time=0.2.")
            if name not in names:
                raise InputError(f"{name} is not compared here; {did_you_mean(name, names)}")
            found.setdefault(name, {})[key] = value
    mistakes.settle()
    return found


def read_changes(settings: Sequence[str]) -> dict[str, Any]:
    """The `key=value` texts of --set for a file of tables: a value that is one in TOML is read, else text.

    >>> read_changes(["masses.reciprocating=0.6 kg", "cylinders.firing_order=[1, 2]"])
    {'masses.reciprocating': '0.6 kg', 'cylinders.firing_order': [1, 2]}
    """
    found: dict[str, Any] = {}
    for key, value in read_params(settings, "--set", "load.inertia=0.07").items():
        try:
            found[key] = tomllib.loads(f"value = {value}")["value"]
        except (RecursionError, ValueError):  # no TOML, or an integer of thousands of digits
            found[key] = value
    return found


# the options -----------------------------------------------------------------------------------------


def file_argument(
    name: str,
    read: Callable[[str, Sequence[str]], Any],
    names: Callable[[], Iterable[str]],
    default: str | None,
) -> Decorator:
    """A TOML file or the name of a shipped one; the command gets `read(name, changes of --set)`."""
    given: dict[str, Any] = {"metavar": name.upper()}
    if default is not None:
        given = {"metavar": f"[{name.upper()}]", "default": default}
    kind = Reading(lambda given, _, settings: read(given, settings), "settings")
    return click.argument(name, type=kind, shell_complete=names_or_files(names, ".toml"), **given)


def drive_argument(read: Callable[[str, Sequence[str]], Any], needed: bool = False) -> Decorator:
    """DRIVE, a file or the name of a shipped one."""
    return file_argument("drive", read, drive_names, None if needed else DEFAULT_DRIVE)


def file_options(
    kind: Any, default: str, library: Library, tables: Iterable[Table], example: str
) -> Decorator:
    """The argument for a file of another kind, and --set with the keys of its tables."""
    name = kind.__name__.lower()
    argument = file_argument(
        name, lambda one, settings: kind.load(one, also=read_changes(settings)), library.names, default
    )
    changes = changes_option(
        lambda: table_keys(tables), f"Change a parameter of the {name}, for example {example}."
    )
    return lambda command: argument(changes(command))


def controller_option(
    name: str, metavar: str, text: str, required: bool = False, read: Callable[..., Any] | None = None
) -> Decorator:
    """An option that takes one or more controllers, and --allow-code for files of tuned gains among them.

    The command gets a name, or a list of names where the option is in the plural, if `read` is left out.
    """
    given = click.option(
        name, metavar=metavar, required=required, help=text, shell_complete=controllers,
        type=Reading(read or (read_names if metavar.endswith("...") else check_name)),
    )  # fmt: skip
    return lambda command: given(_allow_code_option(command))


_allow_code_option = click.option(
    "--allow-code", is_flag=True, expose_value=False,
    callback=lambda context, _, given: context.meta.update({CODE: given}),
    help="Allow a file of tuned gains to name a Python file, which is then executed.",
)  # fmt: skip


def changes_option(keys: Callable[[], Keys], text: str) -> Decorator:
    """--set, for a file with these keys."""
    return click.option(
        "--set", "settings", metavar="KEY=VALUE", multiple=True, shell_complete=settings_of(keys),
        help=f"{text} May be repeated.",
    )  # fmt: skip


set_option = changes_option(
    drive_keys, "Change a parameter of the drive, for example load.inertia=0.07 or shaft.gap='2 rad'."
)
until_option = click.option(
    "--until", metavar="TIME",
    type=quantity("s", 'the end of the run is a time above 0 s, as 0.5 or "500 ms"', above=0.0),
    help="End of the simulation, for example 0.5 (s) or '500 ms'. Default: one elastic period after the "
    "start time.",
)  # fmt: skip
fitted_to_option = click.option(
    "--fitted-to", metavar="DRIVE", type=Reading(_read_fitted_to),
    shell_complete=names_or_files(drive_names, ".toml"),
    help="Set the controllers up for this drive (a file or shipped name) and run them on DRIVE, to check "
    "their robustness. --set changes DRIVE only.",
)  # fmt: skip
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
workers_option = click.option(
    "--workers", metavar="N", type=count(), help="Number of parallel workers. Default: one per processor."
)
scheduler_option = click.option(
    "--scheduler", metavar="ADDRESS", help="Compute on the dask cluster of this scheduler."
)


def param_option(text: str, names: str | None = None) -> Decorator:
    """--param: of one controller, or of several, which the option `names` has."""
    kind = Reading(read_params) if names is None else Reading(read_params_of, names)
    metavar = "KEY=VALUE" if names is None else "CONTROLLER.KEY=VALUE"
    return click.option(
        "--param", "params", metavar=metavar, multiple=True, type=kind, help=text, shell_complete=parameters
    )


def out_option(text: str) -> Decorator:
    """--out DIR."""
    return click.option("--out", metavar="DIR", help=text, shell_complete=files_only())
