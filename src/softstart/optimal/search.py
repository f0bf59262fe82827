"""Demands of one problem, their exact starts, and how good these are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.optimal.demand import Demand
from softstart.optimal.problem import Objective, Problem
from softstart.optimal.starts import DemandRun, DemandSimulator, steady_shaft_torques, wanted
from softstart.profile import TorqueProfile

KNOTS, MOST_KNOTS = 10, 160  # even ones, in the mean of slowest and fastest period, and in all
APART = 0.4  # of their distance, which they keep from knots that are known, so that these do not add up
INSTANTS = 32  # of the fastest period, at which torques are limited
PENALTY = 200.0  # of what is missed, as shares, beside the objective as a share
ENDS = 257  # instants among which the end of a first demand is looked for
MISSED, MET = 1e-5, 1e-8  # share by which a condition is missed: near to it, and kept
ROUNDING = 1e-11  # share by which a speed may lie below one that is to be reached
IN_LAG = 0.04  # of a torque lag, between instants at which a curve limits the torque
BETWEEN = 5e-5  # of the highest torque: kept from the curve for what happens between the instants
CALM = 1e-5  # weight of the total variation of the torque, in highest torques


@dataclass(frozen=True, eq=False)
class Found:
    """A demand, the exact starts under it, and how good they are."""

    demand: Demand
    end: float  # t_f, s
    starts: tuple[DemandRun, ...]
    peak: float  # of all shafts, machines and instants, N m
    missing: Vector  # what the terminal quantities of all machines lack, as shares; below 0 a surplus
    lacking: Vector  # the same as far as it counts
    beyond: float  # above the torque-speed curve, as a share of the highest torque
    over: float  # above the bounds on K_dyn and heat, as a share of them
    heat: float  # s
    objective: float  # as a share of its scale
    met: float  # what of `lacking` is rounding

    def merit(self, penalty: float = PENALTY) -> float:
        """The objective, and what missing a condition costs."""
        return self.objective + penalty * (float(self.lacking.sum()) + self.beyond + self.over)

    @property
    def missed(self) -> float:
        """The largest share by which a condition is missed."""
        return max(float(self.lacking.max(initial=0.0)), self.beyond, 0.02 * self.over)

    @property
    def ends(self) -> bool:
        """Whether it is one that keeps all conditions; of the distance to a curve a little may be used."""
        kept = self.beyond <= 0.1 * BETWEEN and 0.02 * self.over <= MET
        return kept and float(self.lacking.max()) <= self.met

    @property
    def near(self) -> bool:
        """Whether it misses its conditions by no more than the smallest changes mend."""
        return self.missed <= MISSED

    @cached_property
    def profile(self) -> TorqueProfile:
        """The torque over time, with as few knots as it needs."""
        return TorqueProfile(self.demand.time, self.demand.torque).simplified()


class Search:
    """Exact starts of one problem under demands: the latest t_f, s, and the objective."""

    def __init__(
        self, problem: Problem, latest: float, objective: Objective | None = None,
        players: Sequence[DemandSimulator] = (),
    ) -> None:  # fmt: skip
        self.problem, self.latest, self.objective = problem, latest, objective or problem.minimise
        self.players = tuple(players or map(DemandSimulator, problem.machines))
        self.period = max(player.period for player in self.players)
        self.until = self.latest + self.period
        self.low, self.high, self.base = problem.lowest_torque, problem.highest_torque, problem.base_torque
        machines = [player.rows.machine for player in self.players]
        self.rate = min(float(one.rate) for one in machines)
        self.initial = float(machines[0].initial_torque)
        fastest = min(player.fastest for player in self.players)
        self.step = min(fastest / INSTANTS, self.latest / 24)  # of instants at which T is limited
        lags = [float(one.lag) for one in machines if one.lag > 0.0]
        self.curve_step = max(min([0.15 * self.step, *(IN_LAG * lag for lag in lags)]), 2e-5 * self.latest)
        self.starts_at_initial = math.isfinite(self.rate) or problem.smoothness > 0.0
        # the instants of steps: unknown where nothing depends on the torque at an instant itself
        self.heats = self.objective == "heat" or problem.heat is not None
        self.switches = not (self.starts_at_initial or self.heats or problem.torque_speed)
        stiff = self.players[0].mean_torque(self.latest) / problem.starting_torque
        scales = {"k_dyn": self.base, "heat": stiff * stiff * self.latest, "start_time": self.latest}
        self.scale = scales[self.objective]
        count = min(max(math.ceil(KNOTS * self.until / math.sqrt(fastest * self.period)), 24), MOST_KNOTS)
        self.even = np.linspace(0.0, self.until, count + 1)

    # demands -----------------------------------------------------------------------------------------------

    def onto(self, profile: TorqueProfile, apart: float = APART) -> Demand:
        """A demand on its own knots and the even ones that are not near to them, within the limits."""
        keep = profile.time < self.until
        when = profile.time[keep]
        far = np.abs(self.even[:, None] - when).min(axis=1, initial=math.inf) > apart * self.even[1]
        far[-1] = True
        far[0] = when.size == 0 or when[0] > 0.0
        new = self.even[far]
        if self.starts_at_initial:  # no steps
            time = np.unique(np.concatenate([new, when]))
            torque = profile.at(time)
        else:
            time = np.concatenate([when, new])
            order = np.argsort(time, kind="stable")
            time, torque = time[order], np.concatenate([profile.torque[keep], profile.at(new)])[order]
        return self.demand(time, torque)

    def demand(self, time: Vector, torque: Vector) -> Demand:
        """A demand on these knots, with steps where their instants are unknown."""
        made = self.allowed(Demand(time, torque, self.high, float(self.even[1])))
        return made.with_steps() if self.switches else made

    def allowed(self, demand: Demand) -> Demand:
        """The same within the limits of torque and rate."""
        u = np.clip(demand.torque, self.low, self.high)
        if self.starts_at_initial:
            u[0] = min(max(self.initial, self.low), self.high)
        if math.isfinite(self.rate):
            levels = u.tolist()
            for i, rise in enumerate((self.rate * np.diff(demand.time)).tolist()):
                levels[i + 1] = min(max(levels[i + 1], levels[i] - rise), levels[i] + rise)
            u = np.array(levels)
        return replace(demand, torque=u)

    # starts ------------------------------------------------------------------------------------------------

    def play(self, demand: Demand, end: float | None = None) -> Found | None:
        """The exact starts under a demand that end at `end`; None if one cannot be finished.

        Without an end it is the latest; where that misses the speeds that are asked for alone, or the time is
        minimised, the first instant at which all loads have them.
        """
        profile, weights = demand.played
        asked = self.latest if end is None else end
        try:
            starts = tuple(one.play(profile, asked + one.period, weights) for one in self.players)
            if end is None and self._sooner(starts):
                return self.play(demand, self.first_end(starts))
        except SimulationError:
            return None
        end, problem = asked, self.problem
        peak = max(one.peak for one in starts)
        pairs = list(zip(self.players, starts, strict=True))
        missing = np.concatenate([self._missing(*pair, end) for pair in pairs])
        beyond = max(0.0, *(self._beyond(*pair) for pair in pairs)) if problem.torque_speed else 0.0
        heat = 0.0
        if self.heats:
            times, shares = starts[0].quadrature(end)
            u = starts[0].trajectory.at(times)["u"] / problem.starting_torque
            heat = float(shares @ (u * u))
        objective = {"k_dyn": peak, "heat": heat, "start_time": end}[self.objective] / self.scale
        objective += self._roughness(demand)
        lacking = np.maximum(missing, 0.0) if problem.terminal == "reached" else np.abs(missing)
        over = max(peak / (problem.k_dyn * self.base) - 1.0, 0.0) if problem.k_dyn else 0.0
        over += max(heat / problem.heat - 1.0, 0.0) if problem.heat else 0.0
        met = ROUNDING if problem.terminal == "reached" else MET
        return Found(demand, end, starts, peak, missing, lacking, beyond, over, heat, objective, met)

    def _sooner(self, starts: Sequence[DemandRun]) -> bool:
        """Whether a demand should not end at the latest instant."""
        if self.objective == "start_time" or self.problem.terminal != "reached":
            return self.objective == "start_time"
        pairs = zip(self.players, starts, strict=True)
        return any((self._missing(*pair, self.latest) > 0.0).any() for pair in pairs)

    def first_end(self, starts: Sequence[DemandRun]) -> float:
        """The first instant at which all loads, or all masses as one, have the target speed, s.

        Without one until the latest, that at which they come nearest to it.
        """
        times = np.linspace(0.0, self.latest, ENDS)
        weights = [one.J * np.isfinite(one.J) for one in self.players]
        if self.problem.terminal == "reached":
            weights = [np.eye(one.J.size)[one.load] for one in self.players]

        def lack(when: Vector) -> Vector:
            every = [
                1.0 - one.trajectory.at(when)["w"] @ by / (by.sum() * at.target)
                for at, one, by in zip(self.players, starts, weights, strict=True)
            ]
            return np.max(every, axis=0) - 1e-12

        lacking = lack(times)
        there = np.flatnonzero(lacking <= 0.0)
        if not there.size:
            return float(times[ENDS // 2 + np.argmin(lacking[ENDS // 2 :])])
        before, after = float(times[max(there[0] - 1, 0)]), float(times[there[0]])
        if before == after:
            return after
        from scipy.optimize import brentq

        # the later end of what is left of the bracket
        at = float(
            brentq(lambda t: float(lack(np.array([t]))[0]), before, after, xtol=1e-15 * after, rtol=1e-15)
        )
        return at if lack(np.array([at]))[0] <= 0.0 else min(at * (1.0 + 4e-15), after)

    def _missing(self, player: DemandSimulator, start: DemandRun, end: float) -> Vector:
        state = start.trajectory.at([end])
        lacking: Vector = 1.0 - state["w"][0] / player.target
        if self.problem.terminal == "reached":
            return lacking[[player.load]]
        if self.problem.terminal == "steady":
            lacking = np.concatenate([lacking, self._twisted(player, state)[0][0]])
        return lacking

    def _twisted(self, player: DemandSimulator, state: Mapping[str, Vector]) -> tuple[Matrix, Vector]:
        """What shaft torques lack at each instant, as shares of the base torque, and which shafts count.

        While its flanks are apart, or the others press, a shaft also lacks the share of its gap that it has
        still to cross: torque alone would not say where to. Flanks that should carry nothing may be apart.
        """
        own = steady_shaft_torques(player.rows)
        T, aim = state["T"], wanted(own, self.base, player.motor)
        side = np.where(aim > 0.0, 1.0, -1.0)
        wide = 2.0 * player.half_gap
        across = (player.half_gap - side * state["twist"]) / np.where(wide > 0.0, wide, 1.0)
        lacking = (aim - T) / self.base + side * np.where(wide > 0.0, across.clip(0.0, 1.0), 0.0)
        counts = ~((T[0] == 0.0) & (np.abs(own) < np.abs(aim)))
        return np.where(counts, lacking, 0.0), counts

    def terminal_rows(self, found: Found, answers: Sequence[Matrix] = ()) -> tuple[Matrix, Vector]:
        """By how much each terminal quantity rises, as a share, with each unknown, and with t_f.

        `answers` are the derivatives of the state of each machine at t_f, if they are known.
        """
        rows, rates, end = [], [], found.end
        answers = answers or [start.by_demand((), [end])[1][0] for start in found.starts]
        for player, start, answer in zip(self.players, found.starts, answers, strict=True):
            joints, beside = player.joints, 1e-5 * player.period
            at = start.trajectory.at([end - beside, end, end + beside])
            w = answer[joints:-1] / player.target
            rate = (at["w"][2] - at["w"][0]) / (2.0 * beside * player.target)
            if self.problem.terminal == "reached":
                w, rate = w[[player.load]], rate[[player.load]]
            if self.problem.terminal == "steady":
                lacking, counts = self._twisted(player, at)
                apart = counts & (at["T"][1] == 0.0) & (player.half_gap > 0.0)
                twisting = player.twisting((at["T"][1] != 0.0).astype(float), answer) / self.base
                twisting[apart] = answer[:joints][apart] / (2.0 * player.half_gap[apart, None])
                w = np.vstack([w, twisting])
                rate = np.concatenate([rate, (lacking[0] - lacking[2]) / (2.0 * beside)])
            rows.append(w)
            rates.append(rate)
        return np.vstack(rows), np.concatenate(rates)

    def _beyond(self, player: DemandSimulator, start: DemandRun) -> float:
        """By how much the realised torque exceeds the curve at worst, as a share of the highest torque."""
        times = start.instants(self.curve_step)
        state = start.trajectory.at(times)
        return max(float(self.above(state["u"], state["w"][:, player.motor]).max()), 0.0)

    def above(self, u: Vector, w: Vector) -> Vector:
        """By how much motor torques lie above the curve at these speeds, as shares of the highest torque."""
        lines = self.lines()
        found: Vector = (u - (lines[:, :1] + lines[:, 1:] * w).min(axis=0)) / self.high + BETWEEN
        return found

    def lines(self) -> Matrix:
        """The torque-speed curve as straight lines a + b w: rows (a, b)."""
        corners = np.array(self.problem.torque_speed)
        slope = np.diff(corners[:, 1]) / np.diff(corners[:, 0])
        return np.column_stack([corners[:-1, 1] - slope * corners[:-1, 0], slope])

    def _roughness(self, demand: Demand) -> float:
        rise = np.diff(demand.torque)
        calm = CALM * float(np.abs(rise).sum()) / self.high
        if self.problem.smoothness == 0.0:
            return calm
        step = rise / self.problem.starting_torque
        return calm + self.problem.smoothness * float((step * step / np.diff(demand.time)).sum())
