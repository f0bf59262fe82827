"""What the exact plant makes of an answer: the torque is replayed, whatever the package claimed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart import Run, simulate
from softstart.controller import make_controller
from softstart.profile import TorqueProfile
from softstart_studies.benchmarks.optima.task import Answer, Task, crane

SPEED_TOLERANCE = 1e-3  # of the target speed, above which an end speed does not count as reached
TIME_TOLERANCE = 1e-6
TORQUE_TOLERANCE = 1e-6  # of Ms


@dataclass(frozen=True)
class Judged:
    """K_dyn of the whole run to an elastic period after t_f, and how well the conditions are met.

    `motor_error`, `load_error`: w1 and w2 at t_f less the target, rad/s. `torque_excess`: how far the demand
    leaves [0, Ms], N m; the plant is given what is left of it within.
    """

    claimed: float
    k_dyn: float
    end_time: float
    motor_error: float
    load_error: float
    contacts: int
    torque_excess: float
    broken: tuple[str, ...]

    @property
    def disagreement(self) -> float:
        """Claimed over re-simulated K_dyn, less 1."""
        return self.claimed / self.k_dyn - 1.0


def judge(task: Task, answer: Answer) -> Judged:
    """Replay an answer. From t_f on the torque holds the shaft torque of that instant, within [0, Ms].

    >>> from softstart_studies.benchmarks.optima.task import crane_task
    >>> judged = judge(crane_task(0.25), Answer(3.0, (0.0, 0.25), (62.0, 62.0), 0.25))
    >>> round(judged.k_dyn, 2), judged.contacts, judged.broken
    (3.12, 5, ('end speed', 'contact'))
    """
    drive, end = crane(), answer.end_time
    demand = np.array(answer.torque)
    excess = float(max(0.0, -demand.min(), demand.max() - task.Ms))
    profile = TorqueProfile(answer.time, demand.clip(0.0, task.Ms))
    state = _replayed(profile, end).at([end])
    w1, w2, T = (float(state[name][0]) for name in ("w1", "w2", "T"))
    holding = (T * (task.J1 + task.J2) - task.Mc * task.J1) / task.J2
    tail = TorqueProfile([0.0], [float(np.clip(holding, 0.0, task.Ms))])
    run = _replayed(profile.followed_by(end, tail), end + float(drive.elastic_period))
    errors = (w1 - task.target, w2 - task.target)
    conditions = {
        "start time": end <= task.start_time * (1.0 + TIME_TOLERANCE),
        "end speed": max(map(abs, errors)) <= SPEED_TOLERANCE * task.target,
        "contact": run.contacts == 1,
        "torque limits": excess <= TORQUE_TOLERANCE * task.Ms,
    }
    broken = tuple(name for name, kept in conditions.items() if not kept)
    return Judged(answer.claimed, run.k_dyn, end, *errors, run.contacts, excess, broken)


def _replayed(profile: TorqueProfile, until: float) -> Run:
    return simulate(crane(), make_controller("profile", {"profile": profile}), until)
