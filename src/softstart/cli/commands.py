"""The commands under `softstart`, loaded by name when called, and the messages for a wrong command line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from itertools import pairwise, takewhile
from typing import Any

import click
from click.shell_completion import CompletionItem

from softstart import __version__
from softstart.errors import Mistakes, listed

# name: the module in this package that defines it, and the first sentence of its help
COMMANDS = {
    "compare": ("starts", "Compare strategies on a drive or a chain."),
    "simulate": ("starts", "Simulate one start of a drive or a chain."),
    "fatigue": ("starts", "Estimate the fatigue life of the shaft line under each strategy."),
    "optimize": (
        "optimize", "Compute the torque profile with the lowest K_dyn for a start time, and a lower bound."
    ),
    "pareto": (
        "pareto", "Compute the lowest K_dyn over the start time, and compare the controllers with it."
    ),
    "tune": ("tune", "Tune a controller for each gap and load inertia, and one robust set of gains."),
    "sweep": ("sweep", "Simulate a grid of drives and controllers of any size."),
    "linear": ("linear", "Linearise the control loop: stability margins, modes, limit cycles."),
    "reduce": ("reduce", "Compute the natural frequencies of a chain, and reduce it to two masses."),
    "clutch": ("clutch", "Simulate a clutch engagement: peak shaft torque, friction work, slip time."),
    "balance": ("balance", "Compute forces and moments of a piston engine by order, and design a balancer."),
    "report": ("report", "Write a report on the start of a drive or a chain as one HTML file."),
    "serve": ("serve", "Open the interactive page in the browser."),
    "init": ("init", "Create a drive file from data sheet values."),
    "plan": ("identify", "Plan an experiment that identifies a drive accurately."),
    "identify": (
        "identify", "Identify the parameters of a drive, with confidence intervals, from inverter logs."
    ),
    "wear": (
        "identify",
        "Compute the growth of the gap from several identifications, and when it is worn.",
    ),
    "drives": ("lists", "List the shipped drives, or print one as TOML."),
    "controllers": ("lists", "List the controllers, or show the parameters of one."),
    "study": ("study", "List the studies, or run one."),
    "completion": ("completion", "Print the script for completion with the Tab key."),
}  # fmt: skip
PURPOSES = {
    "Your own drive": ("init", "plan", "identify", "wear", "drives", "reduce"),
    "Strategies": ("compare", "simulate", "fatigue", "controllers", "linear"),
    "Design": ("optimize", "pareto", "tune", "sweep"),
    "Results": ("serve", "report"),
    "Other machines and tools": ("clutch", "balance", "study", "completion"),
}

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


TYPED = "softstart.typed"


def typed(name: str) -> Any:
    """The text of this option or argument of the command that runs; None where it is not given."""
    return click.get_current_context().meta[TYPED][name]


class Reading(click.types.StringParamType):
    """The type of an option whose command is given what `read(text, option, *others)` returns.

    `option` is the option's name, and `others` are what the options `needs` have; one of them without a
    reading, as --set, is text for this one alone, which the command does not see. `words` are offered to
    complete it.
    """

    def __init__(self, read: Callable[..., Any], *needs: str, words: Sequence[str] = ()) -> None:
        self.read, self.needs, self.words = read, needs, words

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """The words that begin with `incomplete`."""
        return [CompletionItem(word) for word in self.words if word.startswith(incomplete)]


class Command(click.Command):
    """A command that reads its options, and names itself in its usage errors.

    What is wrong with any option is reported together with what the `checks` find, which are called with all
    values by name; a value that could not be read is None there.
    """

    def __init__(
        self, *arguments: Any, checks: Sequence[Callable[[Mapping[str, Any]], None]] = (), **keywords: Any
    ) -> None:
        super().__init__(*arguments, **keywords)
        self.checks = checks

    def invoke(self, ctx: click.Context) -> Any:
        """Read all options, report all mistakes at once, and run the command with the values."""
        mistakes = Mistakes()
        ctx.meta[TYPED] = ctx.params
        ctx.params = self._read(ctx.params, mistakes)
        for check in self.checks:
            with mistakes.noted():
                check(ctx.params)
        mistakes.settle()
        return super().invoke(ctx)

    def _read(self, given: Mapping[str, Any], mistakes: Mistakes) -> dict[str, Any]:
        options = {str(one.name): one for one in self.params if one.name in given}
        readings = {name: one.type for name, one in options.items() if isinstance(one.type, Reading)}
        found = {name: text for name, text in given.items() if name not in readings or text is None}

        def value(name: str) -> Any:
            if name not in found:
                found[name] = None  # if it cannot be read
                others = [value(other) for other in readings[name].needs]
                with mistakes.noted():
                    found[name] = readings[name].read(given[name], options[name].opts[0], *others)
            return found[name]

        texts = {other for one in readings.values() for other in one.needs if other not in readings}
        return {name: value(name) for name in options if name not in texts}

    def get_help_option_names(self, ctx: click.Context) -> list[str]:
        """Both names, whichever context asks first: click keeps the option that it has made for that one."""
        return ["-h", "--help"]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments read; a UsageError always has its context, and no option is the value of another."""
        try:
            options = [one for one in self.get_params(ctx) if isinstance(one, click.Option)]
            names = {name for one in options for name in one.opts}
            valued = {name for one in options if not (one.is_flag or one.count) for name in one.opts}
            for name, value in pairwise(takewhile("--".__ne__, args)):
                if name in valued and value in names and not ctx.resilient_parsing:
                    raise click.BadOptionUsage(name, f"{name} needs a value", ctx)
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            error.ctx = error.ctx or ctx
            raise


class Commands(Command, click.Group):
    """The group: it lists its commands without importing them, and imports one when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order of the table."""
        return [*COMMANDS, *self.commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, imported; None if there is none."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        found: click.Command = getattr(import_module(f"softstart.cli.{COMMANDS[cmd_name][0]}"), cmd_name)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands in the help, by purpose."""
        limit = formatter.width - 6 - max(map(len, COMMANDS))
        wide = max(map(len, COMMANDS))
        for purpose, names in PURPOSES.items():
            with formatter.section(purpose):
                formatter.write_dl([(f"{name:{wide}}", short_help(name, limit)) for name in names])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands and options that begin with `incomplete`."""
        found = [CompletionItem(n, help=short_help(n)) for n in COMMANDS if n.startswith(incomplete)]
        return found + click.Command.shell_complete(self, ctx, incomplete)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command asked for; an unknown one is a UsageError in one sentence."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            hint = did_you_mean(name, known, "softstart ")
            raise click.UsageError(f'there is no command "{name}"; {hint}', ctx)
        return super().resolve_command(ctx, args)


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"max_content_width": 100},
    epilog=EPILOG,
    no_args_is_help=False,
)
@click.version_option(__version__, prog_name="softstart", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """Compare and design soft-start torque strategies for drives with backlash."""
    if context.invoked_subcommand is None:
        print(GREETING)


def short_help(name: str, limit: int = 45) -> str:
    """The help of a command in at most `limit` letters, as click shortens it."""
    return click.Command(name, help=COMMANDS[name][1]).get_short_help_str(limit)


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


def usage_sentence(error: click.UsageError) -> str:
    """One sentence for what click refused, with the command it was about and where help is.

    >>> usage_sentence(click.UsageError("there is no such thing."))
    'there is no such thing. See "softstart --help".'
    """
    command = error.ctx.command_path if error.ctx else "softstart"
    place = command.removeprefix("softstart").strip()
    reason = error.format_message().strip()
    if reason[-1:] not in (".", "?"):
        reason += "."
    return f'{place + ": " if place else ""}{reason} See "{command} --help".'
