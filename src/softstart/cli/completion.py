"""What the Tab key makes of the words of a command line, for click's own scripts (`softstart completion`)."""

from __future__ import annotations

import ast
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from softstart.cli.commands import Command, did_you_mean
from softstart.drive import PARAMETERS
from softstart.errors import InputError
from softstart.input.files import read_text
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
        found = [name for name in names() if name.startswith(begun)]
        return [*map(CompletionItem, found), *map(CompletionItem, files(begun, *endings))]

    return complete


def controllers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """One more controller after the last comma: a name not yet named, tuned gains, or a class in a file."""
    done, comma, begun = incomplete.rpartition(",")
    path, colon, _ = begun.rpartition(":")
    if colon:
        found = [f"{path}:{name}" for name in classes(path)]
    else:
        named = done.split(",")
        found = [name for name in registered(CONTROLLERS) if name not in named]
        found += [
            path + ":" if path.endswith(".py") else path for path in files(begun, ".py", ".toml", ".csv")
        ]
    return [CompletionItem(done + comma + word) for word in found if word.startswith(begun)]


def files_only(*endings: str) -> Completer:
    """Files with these endings and folders; folders alone without endings."""
    return names_or_files(tuple, *endings)


def studies(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The name of a study."""
    return [CompletionItem(name) for name in registered(STUDIES) if name.startswith(incomplete)]


def settings(keys: Callable[[], Keys]) -> Completer:
    """`key=`, and behind it a value where the values are words."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        key, equals, _ = incomplete.partition("=")
        known = keys()
        if equals:
            _, values = known.get(key, ("", ()))
            found = [CompletionItem(f"{key}={value}") for value in values]
        else:
            found = [CompletionItem(f"{key}=", help=meaning) for key, (meaning, _) in known.items()]
        return [item for item in found if item.value.startswith(incomplete)]

    return complete


def axes(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """A parameter of the drive, or `controller=` with names behind it."""
    key, equals, value = incomplete.partition("=")
    if equals and key == "controller":
        return [CompletionItem(f"{key}={item.value}") for item in controllers(ctx, param, value)]
    found = [CompletionItem("controller=", help="controllers, with commas between")]
    return [item for item in found if item.value.startswith(incomplete)] + settings(drive_keys)(
        ctx, param, incomplete
    )


def parameters(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """`key=` of the controller named before, `controller.key=` where there may be several.

    Only installed controllers are asked: no file runs because somebody pressed Tab.
    """
    one, several = ctx.params.get("controller"), ctx.params.get("controllers")
    names = (one or several or ",".join(registered(CONTROLLERS))).split(",")
    if not one and "." not in incomplete:
        found = [f"{name}." for name in names if name in registered(CONTROLLERS)]
        return [CompletionItem(word) for word in found if word.startswith(incomplete)]
    items: list[CompletionItem] = []
    for name in names:
        if name in registered(CONTROLLERS) and (one or incomplete.startswith(f"{name}.")):
            items += _parameters_of(name, "" if one else f"{name}.")
    return [item for item in items if item.value.startswith(incomplete)]


def _parameters_of(name: str, before: str) -> Iterator[CompletionItem]:
    for field in fields(controllers_found.controller_class(name)):
        meaning, unit = field.metadata.get("meaning", ""), field.metadata.get("unit", "")
        yield CompletionItem(f"{before}{field.name}=", help=_with_unit(meaning, unit))


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
    place = os.path.expanduser(folder) or slash or "."
    found: list[tuple[bool, str]] = []
    try:
        with os.scandir(place) as entries:
            for entry in entries:
                name, is_folder = entry.name, entry.is_dir()
                hidden = name.startswith((".", "__")) and not head.startswith((".", "__"))
                if name.startswith(head) and not hidden and (is_folder or name.endswith(endings)):
                    found.append((is_folder, f"{folder}{slash}{name}{'/' if is_folder else ''}"))
    except OSError:
        return []
    return [path for _, path in sorted(found)]


def classes(path: str) -> list[str]:
    """Names of the classes in a Python file, which is read and not run."""
    try:
        body = ast.parse(read_text(os.path.expanduser(path))).body
    except (RecursionError, SyntaxError, ValueError):
        return []
    return [node.name for node in body if isinstance(node, ast.ClassDef)]


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
