"""The command line: `softstart compare`, `simulate`, `optimize`, `pareto`, `drives`, `study` and more."""

from softstart.cli.main import main

__all__ = ["main"]
