"""Mistakes in the command line itself, worded like all others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any

import click

from softstart.cli.completing import Words

HELP_NAMES = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


class Command(click.Command):
    """A command whose mistakes know to which command they belong, and whose words complete themselves."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        for parameter in self.params:
            if parameter.type is click.STRING:
                parameter.type = Words()

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments read; a UsageError always has its context."""
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            error.ctx = error.ctx or ctx
            raise


class Commands(Command, click.Group):
    """A group that keeps the order of its commands and names the nearest one for a name it does not have."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which they were written."""
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command asked for; an unknown one is a UsageError in one sentence."""
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            hint = did_you_mean(name, self.commands, "softstart ")
            raise click.UsageError(f'there is no command "{name}"; {hint}', ctx)
        return super().resolve_command(ctx, args)


def did_you_mean(name: str, valid: Iterable[str], before: str = "") -> str:
    """The end of a sentence about an unknown name: the nearest valid one, or all of them.

    >>> did_you_mean("compre", ["compare", "drives"], "softstart ")
    'did you mean softstart compare?'
    >>> did_you_mean("zzz", ["compare", "drives"])
    'there are compare and drives.'
    """
    known = list(valid)
    near = get_close_matches(name.lower(), known, n=1, cutoff=0.5)
    if near:
        return f"did you mean {before}{near[0]}?"
    return f"there are {listed(known)}." if known else "there are none."


def listed(words: Sequence[str]) -> str:
    """Words in a row.

    >>> listed(["a", "b", "c"]), listed(["a"])
    ('a, b and c', 'a')
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def usage_sentence(error: click.UsageError) -> str:
    """One sentence for what click refused, with the command it was about and where help is.

    >>> usage_sentence(click.UsageError("there is no such thing."))
    'there is no such thing. "softstart --help" tells more.'
    """
    command = error.ctx.command_path if error.ctx else "softstart"
    place = command.removeprefix("softstart").strip()
    reason = _reason(error).strip()
    if reason[-1:] not in (".", "?"):
        reason += "."
    return f'{place + ": " if place else ""}{reason} "{command} --help" tells more.'


def _reason(error: click.UsageError) -> str:
    if isinstance(error, click.NoSuchOption):
        return f"there is no option {error.option_name}; {did_you_mean(error.option_name, _options(error))}"
    if isinstance(error, click.MissingParameter) and error.param is not None:
        return _missing(error.param)
    if isinstance(error, click.BadOptionUsage):
        option = _option(error)
        if option is not None and not option.is_flag:
            return f"{error.option_name} needs a value, as {error.option_name} {option.metavar or 'VALUE'}."
        return f"{error.option_name} takes no value."
    message = error.format_message()
    return message[:1].lower() + message[1:]


def _missing(parameter: click.Parameter) -> str:
    if isinstance(parameter, click.Option):
        return f"{parameter.opts[-1]} {parameter.metavar or 'VALUE'} is missing."
    return f"{parameter.metavar or str(parameter.name).upper()} is missing."


def _options(error: click.UsageError) -> list[str]:
    if error.ctx is None:
        return []
    parameters = error.ctx.command.get_params(error.ctx)
    return [
        name for p in parameters if isinstance(p, click.Option) for name in p.opts if name.startswith("--")
    ]


def _option(error: click.BadOptionUsage) -> click.Option | None:
    if error.ctx is None:
        return None
    for parameter in error.ctx.command.get_params(error.ctx):
        if isinstance(parameter, click.Option) and error.option_name in parameter.opts:
            return parameter
    return None
