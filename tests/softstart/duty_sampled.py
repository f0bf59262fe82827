"""Duties of sampled strategies on the oracle: what they measure is read off it, what they demand is held."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from tests.duty_cases import REST, Case, Player, ends_of, given_of, held_period
from tests.duty_oracle import Until

from softstart.controller import Measured, PlainController

Ends = Callable[[], list[Until]]


class SampledPlayer(Player):
    """A cycle under a strategy without other sensors; `twin` is the strategy in plain Python, set up.

    Torque strategies are over when the load has its speed; one that `holds` the speed stays in command.
    """

    def __init__(self, case: Case, twin: PlainController, holds: bool):
        super().__init__(case)
        self.twin, self.holds, self.in_command = twin, holds, False
        self.sense, self.run, self.since = 1.0, 1.0, 0.0

    def begin(self) -> None:
        """The strategy begins, in a frame in which the commanded direction is forward."""
        self.sense, self.state, self.next = self.way, tuple(self.twin.initial_state), 0.0
        self.zero, self.angle, self.in_command = self.oracle.time, float(self.oracle.y[-1]), True
        self.since = 0.0

    @property
    def now(self) -> float:
        """The time of the strategy."""
        return self.oracle.time - self.zero

    def measured(self) -> Measured:
        o, g = self.oracle, self.oracle.given
        path = range(g.motor, g.load % o.n)  # of a motor before the load
        angle = float(o.y[-1]) - self.angle + float(sum(o.y[k] for k in path))
        speed = float(o.y[o.n - 1 + g.motor])
        nothing = dict.fromkeys(Measured._fields, math.nan)
        seen = {
            "time": self.now, "motor_angle": self.sense * angle, "motor_speed": self.sense * speed,
            "motor_torque": self.sense * o.u, "run": self.run, "set_speed": self.sense * self.speed,
            "command_time": self.now - self.since,
        }  # fmt: skip
        return Measured(**nothing | seen)

    def follow(self, ends: Ends) -> str:
        """On under the strategy until one of these ends, which has this kind."""
        while True:
            torque = None
            if self.now >= self.next - 1e-12 * max(1.0, self.next):
                answer = self.twin.step(self.measured(), self.state)
                demand = float(np.clip(answer.torque, -self.case.braking, self.case.torque))
                torque = [(0.0, self.sense * demand)]
                self.state = self.state if answer.state is None else answer.state
                self.next = math.inf if answer.ask_again is None else answer.ask_again
            sample = [Until("time", self.next - self.now)] if self.next < math.inf else []
            end = self.oracle.phase(*ends(), *sample, torque=torque)
            left = [one.value for one in ends() if one.kind == "time"]
            if end.reason != "time" or (left and min(left) < 1e-12):
                return end.reason

    def start(self, set_speed: float = math.nan, time: float = math.inf, angle: float = math.inf) -> None:
        o, stood = self.oracle, self.speed == 0.0
        self.speed = self.case.target if math.isnan(set_speed) else set_speed
        left = ends_of(o, time, angle)
        if not self.holds or not self.in_command or (stood and self.sense != self.way):
            self.begin()
        self.since, self.run = self.now, 1.0
        if stood and self.case.brake > 0.0:
            o.brake = math.inf
            o.phase(*ends_of(o, self.case.opening)(), torque=REST)
            self.zero, self.since = o.time, 0.0  # the strategy begins when the brake is open
        o.brake = 0.0
        reaches = [] if self.holds else [Until("load", self.speed, self.way)]
        reason = self.follow(lambda: [*reaches, *left(self.way)])
        if not self.holds:
            self.in_command = False
            if reason == "load" and min(time, angle) < math.inf:
                self.keep(*left(self.way))

    def hold(self, time: float = math.inf, angle: float = math.inf, set_speed: float = math.nan) -> None:
        if not self.in_command:
            super().hold(time, angle)
            return
        if not math.isnan(set_speed) and set_speed != self.speed:
            self.speed, self.since = set_speed, self.now
        left = ends_of(self.oracle, time, angle)
        self.follow(lambda: left(self.way))

    def stop(self, by: str, **given: Any) -> None:
        if by != "strategy":
            self.in_command = False
            super().stop(by, **given)
            return
        self.run, self.since = 0.0, self.now
        self.oracle.watch()
        self.oracle.rest_from = self.oracle.time
        self.follow(lambda: [Until("stand", held_period(self.oracle.given))])
        self.oracle.rest_from = None
        self.oracle.watch(False)
        self.speed = 0.0


def sampled_case(holds: bool) -> Case:
    """A drive with a wide gap, to and fro: every stop, and of a strategy that holds the speed its own."""
    given = given_of(
        [0.05, 0.25], [400.0], [1.2], [0.2], Mc=[0.0, 5.0], reactive=[False, True], friction=[0.4, 0.0],
        ground=[1e-3, 1e-3], theta0=[0.03],
    )  # fmt: skip
    steps: list[dict[str, Any]] = [
        {"do": "start"}, {"do": "hold", "time": 0.2}, {"do": "reverse", "set_speed": -16.0},
        {"do": "hold", "angle": 3.0}, {"do": "stop", "by": "torque"},
        {"do": "jog", "time": 0.21, "by": "coast", "set_speed": -20.0}, {"do": "start", "angle": 6.0},
        {"do": "stop", "by": "brake", "brake_speed": 10.0},
    ]  # fmt: skip
    if holds:
        steps = [
            {"do": "start", "time": 0.8, "set_speed": 18.0}, {"do": "hold", "time": 0.5, "set_speed": 24.0},
            {"do": "reverse", "set_speed": -15.0, "time": 1.4}, {"do": "stop", "by": "strategy"},
            {"do": "hold", "time": 0.1}, {"do": "start", "time": 0.7, "set_speed": -12.0},
            {"do": "stop", "by": "strategy"}, {"do": "start", "time": 0.5}, {"do": "stop", "by": "torque"},
        ]  # fmt: skip
    brake = 0.0 if holds else 25.0
    return Case(given, 40.0, 30.0, 0.003, 4000.0, 20.0, [], steps, brake, 0.02, 0.03)
