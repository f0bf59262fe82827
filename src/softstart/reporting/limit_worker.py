"""The process that looks for optima, one start time after the other; `limit` ends it when the time is up."""

from __future__ import annotations

import json
import sys
from contextlib import redirect_stdout
from typing import TextIO

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.optimal.front import FrontPoint


def work(task: str, out: TextIO) -> None:
    """Optima for the start times of a task (JSON), each written at once as one line of JSON."""
    from softstart.optimal.result import InfeasibleError, NotConverged, OptimumError
    from softstart.optimal.solving import optimize

    asked = json.loads(task)
    drive, terminal = Drive.from_toml(asked["drive"]), asked["terminal"]
    for start_time in asked["start_times"]:
        try:
            point = FrontPoint.of_optimum(optimize(drive, start_time, terminal=terminal), start_time)
        except InfeasibleError as error:
            point = FrontPoint.of_verdict(error.verdict, start_time, terminal)
        except (OptimumError, NotConverged, InputError) as error:  # InputError: of no class it solves
            point = FrontPoint.not_found(str(error), start_time, terminal)
        print(json.dumps(point.record()), file=out, flush=True)


if __name__ == "__main__":
    with redirect_stdout(sys.stderr):  # what solvers print is no answer
        work(sys.stdin.read(), sys.__stdout__ or sys.stdout)
