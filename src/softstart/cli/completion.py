"""`softstart completion`, and what the Tab key makes of the words of a command line in bash, zsh and fish.

Click's own scripts are not used, since most words here do not end where a shell ends them: after
`load.inertia=` or `drives/` no space may follow, bash splits words at `=` and `:`, and a value may be joined
to its option, as in `--controllers=direct,ra`. The shell passes the line up to the cursor in COMP_LINE and
gets back whole words; one that ends in `=`, `/`, `:` or `.` goes on. Nothing here raises: at worst there is
no completion.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, split_arg_string

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


# the shells ----------------------------------------------------------------------------------------------

BASH = """\
# softstart in bash: put this into ~/.local/share/bash-completion/completions/softstart, or into ~/.bashrc
_softstart_completion() {
    local IFS=$'\\n' line="${COMP_LINE:0:COMP_POINT}" breaks="${COMP_WORDBREAKS//[^=:]/}" word cut=""
    word="${line##*[[:space:]]}"
    if [[ -n $breaks && $word == *[$breaks]* ]]; then
        cut="${word%"${word##*[$breaks]}"}"  # bash replaces only what stands behind the last = or :
    fi
    COMPREPLY=()
    for word in $(COMP_LINE="$line" _SOFTSTART_COMPLETE=bash_complete "$1" 2>/dev/null); do
        [[ $word == *[=/:.] ]] && compopt -o nospace
        COMPREPLY+=("${word#"$cut"}")
    done
}
complete -o nosort -F _softstart_completion softstart
"""

ZSH = """\
#compdef softstart
# softstart in zsh: put this as _softstart into a folder of $fpath, or into ~/.zshrc after compinit
_softstart_completion() {
    local line
    local -a going done
    for line in "${(@f)$(COMP_LINE="${(j: :)words[1,CURRENT-1]} $PREFIX" _SOFTSTART_COMPLETE=zsh_complete \\
            ${(Q)words[1]} 2>/dev/null)}"; do
        case $line in
            "") ;;
            *(=|/|:|.)|*(=|/|\\\\:|.):*) going+=("$line") ;;
            *) done+=("$line") ;;
        esac
    done
    (( $#done )) && _describe -V softstart done -U
    (( $#going )) && _describe -V softstart going -U -S ''
}
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
    _softstart_completion "$@"
else
    compdef _softstart_completion softstart
fi
"""

FISH = """\
# softstart in fish: put this into ~/.config/fish/completions/softstart.fish
function __softstart_completion
    set -l line (commandline -cp)
    env COMP_LINE="$line" _SOFTSTART_COMPLETE=fish_complete softstart 2>/dev/null
end
complete --command softstart --no-files --keep-order --arguments "(__softstart_completion)"
"""

SPECIAL = re.compile(r"""([\s"'`$&|;<>()*?\[\]!\\])""")


class _Shell(ShellComplete):
    """Reads the line up to the cursor, returns whole words."""

    def source(self) -> str:
        """The script as it is: click would format its per cent signs."""
        return self.source_template

    def get_completion_args(self) -> tuple[list[str], str]:
        """The words before the last one, without the command's own name; and the last one."""
        line = os.environ.get("COMP_LINE", "")
        words = split_arg_string(line)
        if not words or (line[-1:].isspace() and line[-2:-1] != "\\"):
            words.append("")
        while len(words) > 1 and re.fullmatch(r"\w+=.*", words[0]):  # settings of the environment
            words.pop(0)
        return words[1:-1], words[-1] if len(words) > 1 else ""

    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        """What the last word may become; a value written as --option=value with its option."""
        try:
            found = super().get_completions(args, incomplete)
        except (click.UsageError, InputError):
            return []  # the line is wrong before its last word
        option, equals, _ = incomplete.partition("=")
        if equals and option.startswith("--"):
            for item in found:
                item.value = f"{option}={item.value}"
        return found


class Bash(_Shell):
    """Words alone, with what is special to a shell escaped."""

    name = "bash"
    source_template = BASH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line."""
        return SPECIAL.sub(r"\\\1", item.value)


class Zsh(_Shell):
    """Words and what they mean, a colon between."""

    name = "zsh"
    source_template = ZSH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line, its colons escaped, and its meaning."""
        word = item.value.replace(":", "\\:")
        return f"{word}:{_one_line(item)}" if item.help else word


class Fish(_Shell):
    """Words and what they mean, a tabulator between."""

    name = "fish"
    source_template = FISH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line, and its meaning."""
        return f"{item.value}\t{_one_line(item)}" if item.help else str(item.value)


def _one_line(item: CompletionItem) -> str:
    return " ".join(str(item.help).split())


SHELLS: dict[str, type[_Shell]] = {one.name: one for one in (Bash, Zsh, Fish)}


def register_shells() -> None:
    """Make click answer the Tab key by these classes."""
    for shell in SHELLS.values():
        add_completion_class(shell)


@click.command(cls=Command)
@click.argument("shell", metavar="[bash|zsh|fish]", required=False)
def completion(shell: str | None) -> None:
    """Print the script for completion with the Tab key.

    By default it is for the shell that runs. Its first line names the file to put it in; to try it at once:

    \b
      eval "$(softstart completion bash)"
      eval "$(softstart completion zsh)"
      softstart completion fish | source
    """
    asked = shell or Path(os.environ.get("SHELL", "")).name
    if asked not in SHELLS:
        reason = "there is no completion for this shell" if shell else "the environment names no such shell"
        raise InputError(f'shell = "{asked}": {reason}; {did_you_mean(asked, SHELLS)}')
    print(SHELLS[asked](click.get_current_context().command, {}, "softstart", "").source(), end="")
