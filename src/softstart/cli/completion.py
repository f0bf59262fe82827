"""What the Tab key makes of the words of a command line, for click's own scripts (`softstart completion`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import click
from click.shell_completion import CompletionItem, get_completion_class

from softstart.errors import InputError
from softstart.hints import did_you_mean

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
SHELLS = ("bash", "zsh", "fish")


def one_of(names: Callable[[], Iterable[str]], otherwise: str = "file", end: str = "") -> Completer:
    """A name, with `end` behind it; the last one of several with commas between.

    Where no name begins so, a file or, `otherwise`, a folder: "dir".
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        done, comma, begun = incomplete.rpartition(",")
        matches = [name for name in names() if name.startswith(begun) and name not in done.split(",")]
        items = [CompletionItem(f"{done}{comma}{name}{end}") for name in matches]
        return items or [CompletionItem(incomplete, type=otherwise)]

    return complete


folders = one_of(tuple, "dir")


@click.command("completion")
@click.argument("shell", metavar="[bash|zsh|fish]", required=False)
def completion_command(shell: str | None) -> None:
    """Print the script for completion with the Tab key.

    By default it is for the shell that runs. To try it at once:

    \b
      eval "$(softstart completion bash)"
      eval "$(softstart completion zsh)"
      softstart completion fish | source
    """
    name = shell or Path(os.environ.get("SHELL", "")).name
    completion = get_completion_class(name)
    if completion is None:
        raise InputError(f'shell = "{name}": no completion for this shell; {did_you_mean(name, SHELLS)}')
    root = click.get_current_context().find_root().command
    print(completion(root, {}, "softstart", "_SOFTSTART_COMPLETE").source())
