"""The options that commands share, and how their texts are read."""

from __future__ import annotations

import os
import re
import shlex
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from softstart.chain.elements import LIBRARY as CHAINS
from softstart.chain.machines import is_chain
from softstart.chain.model import Chain
from softstart.cli.completion import one_of
from softstart.drive import Drive, library
from softstart.drive.data_sheet import DataSheet, UnknownStiffness
from softstart.errors import InputError, SimulationError
from softstart.hints import did_you_mean
from softstart.input.documents import DocumentTable, parsed
from softstart.input.files import ABSENT, Library, read_text, refusal_of
from softstart.input.parameter_set import read_settings
from softstart.input.parameters import Wording
from softstart.plugins import CONTROLLERS, registered
from softstart.quantities import RefusedError, to_si, values_in, whole_number

if TYPE_CHECKING:
    from softstart.identification.result import Identification

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
Load = Callable[[str, Sequence[str]], Any]

DEFAULT_DRIVE = "crane-4amtkf"
CODE, SETTINGS, TYPED = "softstart.allow_code", "softstart.settings", "softstart.typed"


def drive_names() -> tuple[str, ...]:
    """Names of the shipped drives."""
    return tuple(library.names())


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


def reading(read: Callable[[Any, str], Any]) -> Callable[..., Any]:
    """The callback of an option or argument: its command is given `read(text, name)`, or None without it."""

    def callback(context: click.Context, parameter: click.Parameter, text: Any) -> Any:
        return text if text is None or context.resilient_parsing else read(text, parameter.opts[0])

    return callback


def quantity_callback(unit: str, least: float = -np.inf, above: float = -np.inf) -> Callable[..., Any]:
    """The callback of an option that is a quantity in this unit, of `least` or more, or above `above`."""

    def read(text: str, option: str) -> float:
        value = float(to_si(text, unit, name=option))
        if value < least or value <= above:
            wanted = f"{least:g} or more" if value < least else f"a value above {above:g} {unit}"
            raise InputError(f'{option} = "{text}": give {wanted}.')
        return value

    return reading(read)


def count(least: int = 1, most: int = 10**15) -> Callable[..., Any]:
    """The callback of an option that is a whole number."""
    return reading(lambda text, option: whole_number(text, option, least, most))


def read_drive(name: str, settings: Sequence[str]) -> Drive:
    """The one drive asked for, with its changes."""
    found = _drive(name, settings)
    return found.drive if isinstance(found, UnknownStiffness) else found


def _drive(name: str, settings: Sequence[str]) -> Drive | UnknownStiffness:
    """The drive, at both ends where a data sheet has no stiffness."""
    if is_chain(name):
        remedy = f'"softstart reduce {name} --out DIR" writes the two masses that stand for it'
        raise InputError(f'"{name}": this is a chain, and a drive is needed here; {remedy}.')
    sheet = _data_sheet(name)
    if sheet is None:
        return Drive.load(name).with_settings(settings) if settings else Drive.load(name)
    # its own keys are those of the sheet, at their own parts
    paths = {p.path for p in DataSheet.PARAMETERS.values()}
    own = [one for one in settings if one.partition("=")[0].strip() in paths]
    settings = [one for one in settings if one not in own]
    found = DataSheet.from_toml(sheet, where=name, also=read_changes(own))
    print(
        f'"{name}" is a data sheet, read as the drive that follows from it ({found.motion}); "softstart init '
        f'{name} --out FILE" writes that drive.',
        file=sys.stderr,
    )
    for doubt in found.motion_warnings:
        print(f"softstart: doubt: {doubt}", file=sys.stderr)
    given = read_settings(settings, Drive.PARAMETERS)[0]
    ends = found.possible
    drives = [
        one.with_settings(settings) if settings else one
        for one in (ends if isinstance(ends, UnknownStiffness) else (ends,))
    ]
    if "assumed" not in given:
        drives = [one.replace(assumed=found.assumed_still(given)) for one in drives]
    # a stiffness that is set as one of the drive leaves one end
    return UnknownStiffness(*drives) if drives[0].stiffness != drives[-1].stiffness else drives[0]


def _data_sheet(name: str) -> str | None:
    """The text of the file of this name, if it is a data sheet."""
    if name not in drive_names() and refusal_of(name) is None:
        with suppress(RefusedError, InputError):  # told by the reader of drives
            text = read_text(name)
            return text if DataSheet.describes(parsed(text, Wording(name), "a drive")) else None
    return None


def read_machine(name: str, settings: Sequence[str]) -> Drive | Chain:
    """The one drive, or the chain, asked for, with its changes."""
    found = read_as_known(name, settings)
    return found.drive if isinstance(found, UnknownStiffness) else found


def read_as_known(name: str, settings: Sequence[str]) -> Drive | Chain | UnknownStiffness:
    """The one drive, or the chain, asked for; a drive at both ends where a data sheet has no stiffness."""
    if is_chain(name):
        return Chain.load(name, also=read_changes(settings))
    known = (*drive_names(), *CHAINS.names())
    if re.fullmatch(r"[\w-]+", name) and name not in known and refusal_of(name) == ABSENT:
        hint = did_you_mean(name, known)
        raise InputError(
            f'"{name}": there is no such file, and no shipped drive or chain of this name; {hint}'
        )
    return _drive(name, settings)


def read_machine_or_identified(
    name: str, settings: Sequence[str]
) -> Drive | Chain | UnknownStiffness | Identification:
    """The one drive, the chain, or the identification in a folder, with its changes.

    A drive is at both ends where a data sheet has no stiffness.
    """
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
    names = {str(one.name): one.opts[0] for one in options if isinstance(one, click.Option)} | also

    def renamed(sentence: str) -> str:
        found = re.match(r"(\w+)(?= =|:|,| \")", sentence)
        if found is None or found[1] not in names:
            return sentence
        return re.sub(rf"\b{found[1]}(?= =|:|,| \"| out\b)", names[found[1]], sentence)

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
    if ":" not in text:
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
    found: dict[str, str] = {}
    for text in texts:
        key, _, value = (part.strip() for part in text.partition("="))
        if not (key and value):
            raise InputError(f'{option} "{text}": write a key, an equals sign and a value, as {example}.')
        if key in found:
            raise InputError(f'{option} "{text}": {key} is given twice; keep one of the two.')
        found[key] = value
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


def typed_settings() -> tuple[str, ...]:
    """The texts of --set."""
    return tuple(click.get_current_context().meta.get(SETTINGS, ()))


def typed_machine() -> str:
    """The argument for the machine as it was typed."""
    return str(click.get_current_context().meta[TYPED])


def machine_argument(
    name: str,
    read: Callable[[str, Sequence[str]], Any],
    names: Callable[[], Iterable[str]],
    default: str | None,
) -> Decorator:
    """A TOML file or the name of a shipped one; the command gets `read(name, texts of --set)`."""

    def load(given: str, _: str) -> Any:
        click.get_current_context().meta[TYPED] = given
        return read(given, typed_settings())

    metavar = name.upper() if default is None else f"[{name.upper()}]"
    more: dict[str, Any] = {} if default is None else {"default": default}
    return click.argument(name, metavar=metavar, callback=reading(load), shell_complete=one_of(names), **more)


def of_drive(read: Load, needed: bool = False) -> Decorator:
    """DRIVE, a file or the name of a shipped one, with --set."""
    argument = machine_argument("drive", read, drive_names, None if needed else DEFAULT_DRIVE)
    return lambda command: argument(set_option(command))


def of_file(
    kind: Any, default: str, library: Library, tables: Iterable[DocumentTable], example: str
) -> Decorator:
    """The argument for a file of another kind, with --set for the keys of its tables."""
    name = kind.__name__.lower()
    argument = machine_argument(
        name, lambda one, settings: kind.load(one, also=read_changes(settings)), library.names, default
    )
    changes = changes_option(tables, f"Change a parameter of the {name}, for example {example}.")
    return lambda command: argument(changes(command))


def controller_option(name: str, metavar: str, text: str, required: bool = False) -> Decorator:
    """An option that takes one or more controllers, and --allow-code for files of tuned gains among them.

    The command gets a name, or a list of names where the option is in the plural.
    """
    given = click.option(
        name, metavar=metavar, required=required, help=text, shell_complete=one_of(controller_names),
        callback=reading(read_names if metavar.endswith("...") else check_name),
    )  # fmt: skip
    return lambda command: given(_allow_code_option(command))


_allow_code_option = click.option(
    "--allow-code", is_flag=True, expose_value=False,
    callback=lambda context, _, given: context.meta.update({CODE: given}),
    help="Allow a file of tuned gains to name a Python file, which is then executed.",
)  # fmt: skip


def keys_of(tables: Iterable[DocumentTable]) -> list[str]:
    """The keys of a file as --set names them; the first of a list of tables stands for all."""
    return [p.path.replace(".", "[1].", 1) if one.many else p.path for one in tables for p in one.parameters]


def changes_option(tables: Iterable[DocumentTable], text: str) -> Decorator:
    """--set, for a file with these tables; it is read first, as the machine is loaded with its changes."""
    return click.option(
        "--set", "settings", metavar="KEY=VALUE", multiple=True, is_eager=True, expose_value=False,
        callback=lambda context, _, given: context.meta.update({SETTINGS: given}),
        shell_complete=one_of(lambda: keys_of(tables), end="="), help=f"{text} May be repeated.",
    )  # fmt: skip


set_option = changes_option(
    Drive.TABLES, "Change a parameter of the drive, for example load.inertia=0.07 or shaft.gap='2 rad'."
)
until_option = click.option(
    "--until", metavar="TIME",
    callback=quantity_callback("s", above=0.0),
    help="End of the simulation, for example 0.5 (s) or '500 ms'. Default: one elastic period after the "
    "start time (a clutch: after the lock-up).",
)  # fmt: skip
fitted_to_option = click.option(
    "--fitted-to", metavar="DRIVE", shell_complete=one_of(drive_names),
    callback=reading(lambda name, _: read_drive(name, ())),
    help="Set the controllers up for this drive (a file or shipped name) and run them on DRIVE, to check "
    "their robustness. --set changes DRIVE only.",
)  # fmt: skip
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
workers_option = click.option(
    "--workers", metavar="N", callback=count(), help="Number of parallel workers. Default: one per processor."
)
scheduler_option = click.option(
    "--scheduler", metavar="ADDRESS", help="Compute on the dask cluster of this scheduler."
)


def param_option(text: str, metavar: str = "KEY=VALUE") -> Decorator:
    """--param: of one controller, or as CONTROLLER.KEY=VALUE of several."""
    return click.option(
        "--param", "params", metavar=metavar, multiple=True, callback=reading(read_params), help=text
    )
