"""The commands under `softstart`, loaded by name when called, and the messages for a wrong command line."""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pkgutil import get_data

import click
from click.shell_completion import CompletionItem

from softstart import __version__
from softstart.hints import did_you_mean

# by purpose: the name of a command, and the module in this package that defines it
PURPOSES = {
    "Your own drive": {
        "init": "init", "plan": "identify", "identify": "identify", "wear": "identify", "drives": "lists",
        "reduce": "reduce",
    },
    "Strategies": {
        "compare": "starts", "simulate": "starts", "fatigue": "starts", "controllers": "lists",
        "linear": "starts", "duty": "duty",
    },
    "Design": {"optimize": "optimize", "pareto": "optimize", "tune": "tune", "sweep": "sweep"},
    "Results": {
        "serve": "serve", "report": "report", "sheet": "report", "project": "project", "export": "export",
    },
    "Other machines and tools": {
        "clutch": "machines", "balance": "machines", "study": "lists", "completion": "completion",
    },
}  # fmt: skip
COMMANDS = {name: module for commands in PURPOSES.values() for name, module in commands.items()}

GREETING = f"""\
softstart {__version__}: soft-start torque strategies for drives with backlash.

  softstart compare                      compare strategies: K_dyn, start time
  softstart optimize --start-time 1.2x   compute the lowest possible K_dyn
  softstart serve                        open the interactive page

Pass the file of your own drive to any of them;
softstart init --out mine.toml         asks for data sheet values.
softstart --help lists all commands."""

EPILOG = """\
Exit codes: 0 done, 2 bad input or usage, 3 no solution, 130 interrupted.

For completion with the Tab key: eval "$(softstart completion bash)", or zsh, or fish.
"""


class Commands(click.Group):
    """The group: it lists its commands without importing them, and imports one when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order of the table."""
        return [*COMMANDS, *self.commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, imported; None if there is none."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        module = import_module(f"softstart.cli.{COMMANDS[cmd_name]}")
        command: click.Command = getattr(module, f"{cmd_name}_command")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands in the help, by purpose."""
        wide = max(map(len, COMMANDS))
        for purpose, rows in PURPOSES.items():
            with formatter.section(purpose):
                limit = formatter.width - 6 - wide
                formatter.write_dl([(f"{name:{wide}}", short_help(name, limit)) for name in rows])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands and options that begin with `incomplete`."""
        names = [name for name in COMMANDS if name.startswith(incomplete)]
        items = [CompletionItem(name, help=short_help(name)) for name in names]
        return items + click.Command.shell_complete(self, ctx, incomplete)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command asked for; an unknown one is a UsageError in one sentence."""
        name, known = args[0], self.list_commands(ctx)
        # resilient_parsing: completion reads lines that are not finished
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            raise click.UsageError(f'no command "{name}"; {did_you_mean(name, known, "softstart ")}', ctx)
        return super().resolve_command(ctx, args)


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"max_content_width": 100, "help_option_names": ["-h", "--help"]},
    epilog=EPILOG,
    no_args_is_help=False,
)
@click.version_option(__version__, prog_name="softstart", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """Compare and design soft-start torque strategies for drives with backlash."""
    if context.invoked_subcommand is None:
        print(GREETING)


@cache
def first_sentences(module: str) -> dict[str, str]:
    """The first paragraph of the docstring of each command of a module, which is not imported for it."""
    # importing all commands for their first sentences would take longer than most answers
    try:
        tree = ast.parse(get_data(__package__, f"{module}.py") or b"")
    except OSError:  # installed without sources
        return {}
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {node.name: (ast.get_docstring(node) or "").split("\n\n")[0] for node in functions}


def short_help(name: str, limit: int = 45) -> str:
    """The help of a command in at most `limit` characters, as click shortens it."""
    text = first_sentences(COMMANDS[name]).get(f"{name}_command", "")
    return click.Command(name, help=text).get_short_help_str(limit)


def usage_sentence(error: click.UsageError, command: str = "") -> str:
    """One sentence for what click refused, with the command it was about and where help is.

    >>> usage_sentence(click.UsageError("there is no such thing."), "tune")
    'tune: there is no such thing. See "softstart tune --help".'
    """
    place = command if command in COMMANDS else ""
    reason = error.format_message().strip()
    end = "" if reason[-1:] in (".", "?") else "."
    return f'{place}{": " if place else ""}{reason}{end} See "softstart {place}{" " if place else ""}--help".'
