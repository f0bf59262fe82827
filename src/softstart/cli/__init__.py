"""The command line: `softstart compare`, `simulate`, `optimize`, `pareto`, `drives`, `study` and more."""

import os

from softstart.isolation import isolate
from softstart.parallel import ONE_THREAD

isolate("matplotlib")

for _name, _count in ONE_THREAD.items():
    os.environ.setdefault(_name, _count)  # before numpy is imported

from softstart.cli.main import main  # noqa: E402

__all__ = ["main"]
