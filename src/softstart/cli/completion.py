"""`softstart completion`: the Tab key in bash, zsh and fish.

A shell gives the line up to the cursor in COMP_LINE and gets the words that the last one may become. Scripts
and classes take the place of those that come with click: they set no space behind a word that goes on
(`load.inertia=`, `drives/`), and know values behind an equals sign, as in `--controllers=direct`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import click
from click.shell_completion import (
    BashComplete,
    CompletionItem,
    FishComplete,
    ShellComplete,
    ZshComplete,
    add_completion_class,
    split_arg_string,
)

from softstart.cli.commands import Command, did_you_mean
from softstart.cli.completing import files
from softstart.errors import InputError

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


class _Line(ShellComplete):
    """Reads the line up to the cursor; gives whole words."""

    def source(self) -> str:
        """The script, as it stands."""
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
            found = list(_whole(super().get_completions(args, incomplete)))
        except (click.UsageError, InputError):
            return []  # the line is wrong before its last word
        option, equals, _ = incomplete.partition("=")
        if equals and option.startswith("--"):
            for item in found:
                item.value = f"{option}={item.value}"
        return found


class Bash(_Line, BashComplete):
    """Words alone, with what is special to a shell escaped."""

    source_template = BASH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line."""
        return SPECIAL.sub(r"\\\1", item.value)


class Zsh(_Line, ZshComplete):
    """Words and what they mean, a colon between."""

    source_template = ZSH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line, its colons escaped, and its meaning."""
        word = item.value.replace(":", "\\:")
        return f"{word}:{_one_line(item)}" if item.help else word


class Fish(_Line, FishComplete):
    """Words and what they mean, a tabulator between."""

    source_template = FISH

    def format_completion(self, item: CompletionItem) -> str:
        """One word a line, and its meaning."""
        return f"{item.value}\t{_one_line(item)}" if item.help else str(item.value)


def _whole(items: list[CompletionItem]) -> Iterator[CompletionItem]:
    """The items, with files and folders by name where click says only that such are wanted."""
    for item in items:
        if item.type == "plain":
            yield item
        else:
            yield from map(CompletionItem, files(item.value, *([] if item.type == "dir" else [""])))


def _one_line(item: CompletionItem) -> str:
    return " ".join(str(item.help).split())


SHELLS: dict[str, type[_Line]] = {one.name: one for one in (Bash, Zsh, Fish)}


def register_shells() -> None:
    """Make click answer the Tab key by these classes."""
    for shell in SHELLS.values():
        add_completion_class(shell)


@click.command(cls=Command)
@click.argument("shell", metavar="[bash|zsh|fish]", required=False)
def completion(shell: str | None) -> None:
    """Print what makes the Tab key complete commands, drives, controllers, keys and studies.

    Without a name it is for the shell that runs. It begins with the place to put it; to try it at once:

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
