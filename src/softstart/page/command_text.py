"""The command line that shows in a terminal what the page shows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

from softstart.controller.base import Controller
from softstart.controller.finding import controller_names, ready_controller_names
from softstart.controller.tuned import Tuned
from softstart.drive import Drive, library
from softstart.input.parameters import Parameter
from softstart.page.downloads import file_name
from softstart.page.drift import changes

if TYPE_CHECKING:
    from softstart.profile import TorqueProfile

MOST_SETTINGS = 8  # more than that are better kept in a file


def command_text(
    drive: Drive, strategies: Mapping[str, Controller], command: str = "compare", *more: str
) -> str:
    """`softstart compare ...`, or another command, for a drive and strategies by label.

    A shipped drive is called by its name with its changes, another one by the file that saving it gives.
    Tuned gains and profiles are called by the files that their downloads give.

    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf").replace(gap=1.0)
    >>> command_text(crane, {name: make_controller(name) for name in ("direct", "ramp")})
    'softstart compare crane-4amtkf --set shaft.gap=1.0 --controllers direct,ramp'
    """
    words = ["softstart", command, *drive_words(drive), *more]
    names: list[str] = []
    params: list[str] = []
    for label, controller in strategies.items():
        if isinstance(controller, Tuned):
            names.append(gain_file(label))
        elif profile_of(controller) is not None:
            names.append("profile")
            params.append(f"profile.file={profile_file(label)}")
        elif label in controller_names():
            names.append(label)
    if params or names != list(ready_controller_names()):
        words += ["--controllers", ",".join(dict.fromkeys(names))]
    for param in params[-1:]:  # the command takes one profile
        words += ["--param", param]
    return shlex.join(words)


def profile_of(controller: Controller) -> TorqueProfile | None:
    """The torque profile that a controller plays; None for one that plays none.

    >>> from softstart.controller import make_controller
    >>> profile_of(make_controller("direct")) is None
    True
    """
    profile = getattr(controller, "profile", None)
    return profile if hasattr(profile, "to_c") else None


def drive_words(drive: Drive) -> list[str]:
    """How a command line calls the drive: a shipped one with its changes, else the file it is saved in."""
    shipped = [(name, changes(one, drive)) for name, one in shipped_drives().items()]
    name, differing = min(shipped, key=lambda one: len(one[1]))
    if len(differing) > MOST_SETTINGS or any(getattr(drive, p.name) is None for p in differing):
        return [drive_file(drive)]
    if any(p.name in ("name", "source") for p in differing):
        return [drive_file(drive)]
    return [name, *(word for p in differing for word in ("--set", f"{p.path}={_literal(drive, p)}"))]


@cache
def shipped_drives() -> dict[str, Drive]:
    """The drives that come with softstart, by name."""
    return {name: Drive.load(name) for name in library.names()}


def _literal(drive: Drive, parameter: Parameter) -> str:
    value = getattr(drive, parameter.name)
    return value if isinstance(value, str) else repr(float(value))


def drive_file(drive: Drive) -> str:
    """The file name under which a drive is saved."""
    return file_name(drive.name, suffix=".toml")


def gain_file(label: str) -> str:
    """The file name under which tuned gains are saved."""
    return file_name(label, suffix=".toml")


def profile_file(label: str) -> str:
    """The file name under which a torque profile is saved."""
    return file_name(label, suffix=".csv")
