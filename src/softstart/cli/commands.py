"""The commands under `softstart`, loaded by name when called, and the messages for a wrong command line."""

from __future__ import annotations

from importlib import import_module

import click
from click.shell_completion import CompletionItem

from softstart import __version__
from softstart.hints import did_you_mean

# by purpose: the name of a command, the module in this package that defines it, the beginning of its help
PURPOSES = {
    "Your own drive": (
        ("init", "init", "Create a drive file from data sheet values."),
        ("plan", "identify", "Plan an experiment that identifies a drive accurately."),
        ("identify", "identify",
         "Identify the parameters of a drive, with confidence intervals, from inverter logs."),
        ("wear", "identify",
         "Compute the growth of the gap from several identifications, and when it is worn."),
        ("drives", "lists", "List the shipped drives, or print one as TOML."),
        ("reduce", "reduce", "Compute the natural frequencies of a chain, and reduce it to two masses."),
    ),
    "Strategies": (
        ("compare", "starts", "Compare strategies on a drive or a chain."),
        ("simulate", "starts", "Simulate one start of a drive or a chain."),
        ("fatigue", "starts", "Estimate the fatigue life of the shaft line under each strategy."),
        ("controllers", "lists", "List the controllers, or show the parameters of one."),
        ("linear", "starts", "Linearise the control loop: stability margins, modes, limit cycles."),
    ),
    "Design": (
        ("optimize", "optimize",
         "Compute the torque profile with the lowest K_dyn for a start time, and a lower bound."),
        ("pareto", "optimize",
         "Compute the lowest K_dyn over the start time, and compare the controllers with it."),
        ("tune", "tune", "Tune a controller for each gap and load inertia, and one robust set of gains."),
        ("sweep", "sweep", "Simulate a grid of drives and controllers of any size."),
    ),
    "Results": (
        ("serve", "serve", "Open the interactive page in the browser."),
        ("report", "report", "Write a report on the start of a drive or a chain as one HTML file."),
    ),
    "Other machines and tools": (
        ("clutch", "machines", "Simulate a clutch engagement: peak shaft torque, friction work, slip time."),
        ("balance", "machines",
         "Compute forces and moments of a piston engine by order, and design a balancer."),
        ("study", "lists", "List the studies, or run one."),
        ("completion", "completion", "Print the script for completion with the Tab key."),
    ),
}  # fmt: skip
COMMANDS = {name: (module, text) for rows in PURPOSES.values() for name, module, text in rows}

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
        command: click.Command = getattr(
            import_module(f"softstart.cli.{COMMANDS[cmd_name][0]}"), f"{cmd_name}_command"
        )
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands in the help, by purpose."""
        wide = max(map(len, COMMANDS))
        for purpose, rows in PURPOSES.items():
            with formatter.section(purpose):
                limit = formatter.width - 6 - wide
                formatter.write_dl([(f"{name:{wide}}", short_help(name, limit)) for name, *_ in rows])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands and options that begin with `incomplete`."""
        items = [
            CompletionItem(name, help=short_help(name)) for name in COMMANDS if name.startswith(incomplete)
        ]
        return items + click.Command.shell_complete(self, ctx, incomplete)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command asked for; an unknown one is a UsageError in one sentence."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            raise click.UsageError(
                f'there is no command "{name}"; {did_you_mean(name, known, "softstart ")}', ctx
            )
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


def short_help(name: str, limit: int = 45) -> str:
    """The help of a command in at most `limit` characters, as click shortens it."""
    return click.Command(name, help=COMMANDS[name][1]).get_short_help_str(limit)


def usage_sentence(error: click.UsageError, command: str = "") -> str:
    """One sentence for what click refused, with the command it was about and where help is.

    >>> usage_sentence(click.UsageError("there is no such thing."), "tune")
    'tune: there is no such thing. See "softstart tune --help".'
    """
    place = command if command in COMMANDS else ""
    reason = error.format_message().strip()
    end = "" if reason[-1:] in (".", "?") else "."
    return f'{place}{": " if place else ""}{reason}{end} See "softstart {place}{" " if place else ""}--help".'
