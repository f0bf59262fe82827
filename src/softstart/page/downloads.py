"""What a user takes away: files by safe names, and the command line that shows the same in a terminal."""

from __future__ import annotations

import re
import shlex
import tempfile
import unicodedata
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.chain.elements import LIBRARY
from softstart.chain.model import Chain
from softstart.controller.base import Controller
from softstart.controller.finding import ready_controller_names
from softstart.controller.parameters import declared_parameters
from softstart.controller.tuned import Tuned
from softstart.drive import Drive, library
from softstart.drive.machine import Machine
from softstart.page.sentences import changes
from softstart.plugins import controller_names
from softstart.project.parts import profile_of
from softstart.quantities import shortest

if TYPE_CHECKING:
    from softstart.profile import TorqueProfile

UNSETTABLE = ("name", "source")  # by --set
MOST_SETTINGS = 8  # more than that are better kept in a file
LONGEST = 60
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}


def file_name(*parts: str, suffix: str) -> str:
    """A file name made of texts that a user has typed: letters, digits, hyphens, and dots within numbers.

    >>> file_name("Crane travel drive 4AMTKF(H)112L6", suffix=".toml")
    'crane-travel-drive-4amtkf-h-112l6.toml'
    >>> file_name("optimum 0.4482 s", suffix=".csv")
    'optimum-0.4482-s.csv'
    >>> file_name("../../etc/passwd", suffix=".csv")
    'etc-passwd.csv'
    >>> file_name("\\u041a\\u0440\\u0430\\u043d", "CON", suffix=".toml")
    'softstart-con.toml'
    >>> file_name("nul", suffix=".c"), file_name("", suffix=".c")
    ('softstart-nul.c', 'softstart.c')
    """
    plain = unicodedata.normalize("NFKD", "-".join(parts)).encode("ascii", "ignore").decode()
    stem = re.sub(r"(?<!\d)\.|\.(?!\d)|[^a-z0-9.]+", "-", plain.lower())  # a dot only within a number
    stem = re.sub(r"-+", "-", stem)[:LONGEST].strip("-.")
    if stem in RESERVED:
        stem = f"softstart-{stem}"
    return (stem or "softstart") + suffix


def written_text(write: Callable[[Path], Any], suffix: str) -> str:
    """The text that `write(path)` would write into a file of its own.

    >>> written_text(lambda path: path.write_text("hello"), ".txt")
    'hello'
    """
    with tempfile.TemporaryDirectory(prefix="softstart-") as folder:
        path = Path(folder) / f"file{suffix}"
        write(path)
        return path.read_text("utf-8")


def command_text(
    drive: Machine, strategies: Mapping[str, Controller], command: str = "compare", *more: str
) -> str:
    """`softstart compare ...`, or another command, for a drive and strategies by label.

    A shipped drive is called by its name with its changes, another one by the file that saving it gives.
    Tuned gains and profiles are called by the files that their downloads give.

    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf").replace(gap=1.0)
    >>> command_text(crane, {name: make_controller(name) for name in ("direct", "ramp")})
    'softstart compare crane-4amtkf --set shaft.gap=1.0 --controllers direct,ramp'
    >>> command_text(crane.with_settings(["gap=4 deg"]), {"direct": make_controller("direct")})
    'softstart compare crane-4amtkf --set shaft.gap=4deg --controllers direct'
    >>> command_text(crane, {"ramp": make_controller("ramp", {"time": 0.2})})
    'softstart compare crane-4amtkf --set shaft.gap=1.0 --controllers ramp --param ramp.time=0.2'
    """
    words = ["softstart", command, *drive_words(drive), *more]
    names: list[str] = []
    params: list[str] = []
    for label, controller in strategies.items():
        if isinstance(controller, Tuned):
            names.append(file_name(label, suffix=".toml"))
        elif profile_of(controller) is not None:
            names.append("profile")
            params.append(f"profile.file={file_name(label, suffix='.csv')}")
        elif label in controller_names():
            names.append(label)
            params += [
                f"{label}.{name}={_literal(value, parameter.unit)}"
                for name, parameter in declared_parameters(controller).items()
                if (value := getattr(controller, name)) is not None
            ]
    profiles = [param for param in params if param.startswith("profile.")]
    if profiles or names != list(ready_controller_names()):
        words += ["--controllers", ",".join(dict.fromkeys(names))]
    for param in params:
        if param not in profiles[:-1]:  # the command takes one profile
            words += ["--param", param]
    return shlex.join(words)


def duty_text(machine: Machine, label: str, controller: Controller, stop: str) -> str:
    """`softstart duty ...` for a machine with its duty, under one strategy.

    >>> from softstart import Duty, DutyStep
    >>> from softstart.controller import make_controller
    >>> machine = Drive.load("conveyor-11kw").replace(duty=Duty([DutyStep("jog", time=0.2)]))
    >>> duty_text(machine, "ramp", make_controller("ramp", {"time": 0.2}), "coast")
    'softstart duty belt-conveyor-11-kw-level.toml --stop coast --controller ramp --param time=0.2'
    """
    text = command_text(machine, {label: controller}, "duty", *(["--stop", stop] if stop else []))
    return re.sub(r"--param [\w-]+\.", "--param ", text.replace("--controllers", "--controller"))


def drive_words(drive: Machine) -> list[str]:
    """How a command line calls the drive: a shipped one with its changes, else the file it is saved in.

    >>> drive_words(Chain.load("crane-4-mass"))
    ['crane-4-mass']
    """
    if drive.duty is not None:
        return [drive_file(drive)]
    same_kind = {name: machine for name, machine in shipped_drives().items() if type(machine) is type(drive)}
    candidates = [(name, changes(machine, drive)) for name, machine in same_kind.items()]
    name, different = min(candidates, key=lambda candidate: len(candidate[1]))
    unsettable = any(change.new is None or change.parameter.name in UNSETTABLE for change in different)
    if len(different) > MOST_SETTINGS or unsettable:
        return [drive_file(drive)]
    settings = (f"{change.path}={_literal(change.new, change.parameter.unit)}" for change in different)
    return [name, *(word for setting in settings for word in ("--set", setting))]


@cache
def shipped_drives() -> dict[str, Machine]:
    """The drives and chains that come with softstart, by name."""
    drives: dict[str, Machine] = {name: Drive.load(name) for name in library.names()}
    return drives | {name: Chain.load(name) for name in LIBRARY.names()}


def _literal(value: object, unit: str) -> str:
    """A value as one word of a command line."""
    if not isinstance(value, float):
        return str(value)
    return shortest(value, unit).replace(" ", "")


def drive_file(drive: Machine) -> str:
    """The file name under which a drive is saved."""
    return file_name(drive.name, suffix=".toml")


def profile_file(
    profile: TorqueProfile, label: str, suffix: str, about: Mapping[str, object]
) -> tuple[str, str]:
    """The name and the text of the file of a torque profile; TOML and C state what it is `about`."""
    writers: dict[str, Callable[[Path], object]] = {
        ".csv": profile.to_csv,
        ".toml": lambda path: profile.to_toml(path, about),
        ".c": lambda path: profile.to_c(path, about=about),
    }
    return file_name(label, suffix=suffix), written_text(writers[suffix], suffix)
