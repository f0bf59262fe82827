"""softstart itself: one call."""

from __future__ import annotations

from typing import Any

from softstart_studies.benchmarks.optima.task import DRIVE, TARGET, Answer, Task


def solve(task: Task, method: Any = "auto") -> Answer:
    """Least peak torque by one of softstart's methods."""
    from softstart.drive import Drive
    from softstart.optimal.solving import optimize

    drive = Drive.load(DRIVE).replace(target_speed=TARGET)
    best = optimize(drive, task.start_time, method=method)
    profile = best.profile
    return Answer(best.claimed, tuple(profile.time.tolist()), tuple(profile.torque.tolist()), best.end_time)
