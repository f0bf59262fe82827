"""All commands under `softstart`, and what it says when called alone."""

from __future__ import annotations

import click

from softstart import __version__
from softstart.cli.balance import balance
from softstart.cli.clutch import clutch
from softstart.cli.compare import compare
from softstart.cli.completion import completion
from softstart.cli.linear import linear
from softstart.cli.lists import controllers, drives
from softstart.cli.optimize import optimize
from softstart.cli.pareto import pareto
from softstart.cli.reduce import reduce
from softstart.cli.report import report
from softstart.cli.serve import serve
from softstart.cli.simulate import simulate
from softstart.cli.study import study
from softstart.cli.sweep import sweep
from softstart.cli.tune import tune
from softstart.cli.usage import HELP_NAMES, Commands

GREETING = f"""\
softstart {__version__}: start a drive with a gap in its transmission gently and fast.

  softstart compare                      strategies side by side: K_dyn and time
  softstart optimize --start-time 1.2x   the gentlest start there can be
  softstart serve                        see it and try it in the browser

For a drive of your own, give its file to any of them:
softstart drives crane-4amtkf > mine.toml makes one to edit.
softstart --help lists all commands."""

EPILOG = """\
Exit codes: 0 done, 2 bad input or usage, 3 no solution, 130 interrupted.

The Tab key completes names after: eval "$(softstart completion bash)", or zsh, or fish.
"""


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings=HELP_NAMES,
    epilog=EPILOG,
    no_args_is_help=False,
)
@click.version_option(__version__, prog_name="softstart", message="%(prog)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """Which soft-start strategy loads the shaft of a drive with a gap least, and what it costs in time."""
    if context.invoked_subcommand is None:
        print(GREETING)


for command in (
    compare,
    simulate,
    optimize,
    pareto,
    tune,
    sweep,
    linear,
    reduce,
    clutch,
    balance,
    report,
    serve,
    drives,
    controllers,
    study,
    completion,
):
    cli.add_command(command)
