"""What the Tab key makes of the words of a command line, for click's own scripts (`softstart completion`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from softstart.cli.commands import Command, did_you_mean
from softstart.drive import PARAMETERS
from softstart.errors import InputError
from softstart.late import late
from softstart.plugins import CONTROLLERS, STUDIES, registered

if TYPE_CHECKING:
    from softstart import controller as controllers_found
    from softstart.input.documents import Table
else:
    controllers_found = late("softstart.controller")

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
Keys = Mapping[str, tuple[str, Sequence[str]]]  # by key: its meaning, and its values where these are words


def names_or_files(names: Callable[[], Iterable[str]], *endings: str) -> Completer:
    """One of these names, or a file that ends so."""

    def complete(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
        return _items([*names(), *files(begun, *endings)], begun)

    return complete


def _items(words: Iterable[str], begun: str) -> list[CompletionItem]:
    return [CompletionItem(word) for word in words if word.startswith(begun)]


def controllers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """One more controller after the last comma: a name not yet named, tuned gains, or a Python file."""
    done, comma, begun = incomplete.rpartition(",")
    names = [name for name in registered(CONTROLLERS) if name not in done.split(",")]
    found = [f"{one}:" if one.endswith(".py") else one for one in files(begun, ".py", ".toml", ".csv")]
    return _items([f"{done}{comma}{word}" for word in (*names, *found)], incomplete)


def files_only(*endings: str) -> Completer:
    """Files with these endings and folders; folders alone without endings."""
    return names_or_files(tuple, *endings)


def studies(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The name of a study."""
    return _items(registered(STUDIES), incomplete)


def settings(keys: Callable[[], Keys]) -> Completer:
    """`key=`, and behind it a value where the values are words."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        key, equals, _ = incomplete.partition("=")
        if equals:
            return _items([f"{key}={value}" for value in keys().get(key, ("", ()))[1]], incomplete)
        found = keys().items()
        return [CompletionItem(f"{k}=", help=about) for k, (about, _) in found if k.startswith(key)]

    return complete


def axes(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """A parameter of the drive, or `controller=` with names behind it."""
    key, equals, value = incomplete.partition("=")
    if equals and key == "controller":
        return [CompletionItem(f"{key}={item.value}") for item in controllers(ctx, param, value)]
    return _items(["controller="], incomplete) + settings(drive_keys)(ctx, param, incomplete)


def parameters(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """`key=` of the controller named before, `controller.key=` where there may be several.

    Only installed controllers are asked: no file runs because somebody pressed Tab.
    """
    one, known = ctx.params.get("controller"), registered(CONTROLLERS)
    several = (ctx.params.get("controllers") or ",".join(known)).split(",")
    if not one and "." not in incomplete:
        return _items([f"{name}." for name in several if name in known], incomplete)
    name = one or incomplete.partition(".")[0]
    if name not in known or not (one or name in several):
        return []
    keys = {
        f"{'' if one else f'{name}.'}{field.name}": (
            _with_unit(field.metadata.get("meaning", ""), field.metadata.get("unit")),
            (),
        )
        for field in fields(controllers_found.controller_class(name))
    }
    return settings(lambda: keys)(ctx, param, incomplete)


def drive_keys() -> Keys:
    """The parameters of a drive as `--set` names them."""
    return {p.path: (_with_unit(p.meaning, p.unit), p.choices) for p in PARAMETERS.values()}


def table_keys(tables: Iterable[Table]) -> Keys:
    """The keys of a file of tables as `--set` names them; the first of a list of tables stands for all."""
    found: dict[str, tuple[str, Sequence[str]]] = {}
    for table in tables:
        place = f"{table.name}{'[1]' if table.many else ''}." if table.name else ""
        for field in table.parameters:
            found[place + field.key] = (_with_unit(field.meaning, field.unit), field.choices)
    return found


def files(begun: str, *endings: str) -> list[str]:
    """Files with these endings and all folders (with a slash behind) whose path begins so.

    >>> "pyproject.toml" in files("nowhere/", ".toml")
    False
    """
    folder, slash, head = begun.rpartition("/")
    try:
        entries = list(os.scandir(os.path.expanduser(folder) or slash or "."))
    except OSError:
        return []
    found = sorted(
        (entry.is_dir(), f"{folder}{slash}{entry.name}{'/' * entry.is_dir()}")
        for entry in entries
        if entry.name.startswith(head)
        and (head or not entry.name.startswith((".", "__")))
        and (entry.is_dir() or entry.name.endswith(endings))
    )
    return [path for _, path in found]


def _with_unit(meaning: str, unit: Any) -> str:
    return f"{meaning}, {unit}" if unit and unit != "1" else meaning


@click.command(cls=Command)
@click.argument("shell", metavar="[bash|zsh|fish]", required=False)
def completion(shell: str | None) -> None:
    """Print the script for completion with the Tab key.

    By default it is for the shell that runs. To try it at once:

    \b
      eval "$(softstart completion bash)"
      eval "$(softstart completion zsh)"
      softstart completion fish | source
    """
    asked = shell or Path(os.environ.get("SHELL", "")).name
    made = get_completion_class(asked)
    if made is None:
        reason = "there is no completion for this shell" if shell else "the environment names no such shell"
        raise InputError(f'shell = "{asked}": {reason}; {did_you_mean(asked, ("bash", "zsh", "fish"))}')
    root = click.get_current_context().find_root().command
    print(made(root, {}, "softstart", "_SOFTSTART_COMPLETE").source())
