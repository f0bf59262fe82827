"""The command line: `softstart compare`, `simulate`, `drives`, `controllers`, `study`."""

from softstart.cli.main import main

__all__ = ["main"]
