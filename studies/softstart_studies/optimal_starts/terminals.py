"""What it costs to end synchronous or steady instead of with the target speed only reached."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.optimal.front import Front, FrontPoint
from softstart.optimal.problem import TERMINALS
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import crane, direct_time, gap_of, optima, percent, rounded

PROMISED = 0.05  # by how much reached is said to lie below synchronous where K_dyn > 1


@dataclass(frozen=True)
class Endings:
    """The optima of one gap for every terminal condition, each over its start times."""

    gap: float
    by_terminal: dict[str, tuple[FrontPoint, ...]]

    def at(self, terminal: str, time: float) -> FrontPoint | None:
        """The point asked at this start time in s, if it was."""
        points = [p for p in self.by_terminal[terminal] if p.start_time_bound == time]
        return points[0] if points else None

    def cost(self, terminal: str, time: float) -> float | None:
        """K_dyn over that of `reached` at the same start time."""
        here, least = self.at(terminal, time), self.at("reached", time)
        if here is None or least is None or here.k_dyn is None or least.k_dyn is None:
            return None
        return here.k_dyn / least.k_dyn

    def costs(self, terminal: str) -> list[tuple[float, float]]:
        """(start time in s, K_dyn over that of reached), where both have an optimum."""
        pairs = [
            (p.start_time_bound, self.cost(terminal, p.start_time_bound)) for p in self.by_terminal[terminal]
        ]
        return [(time, cost) for time, cost in pairs if cost is not None]


def endings(front: Front, progress: Progress) -> Endings:
    """The other two terminals at the start times of a front; steady, slower to find, at some of them."""
    gap = gap_of(front)
    times = [point.start_time_bound for point in front.points]
    return Endings(
        gap,
        {
            "reached": front.points,
            "synchronous": optima(crane(gap), times, "synchronous", progress).points,
            "steady": optima(crane(gap), times[2::2], "steady", progress).points,
        },
    )


def table(found: list[Endings]) -> Table:
    """K_dyn of the three over the start time."""
    rows = []
    for one in found:
        for point in one.by_terminal["reached"]:
            time = point.start_time_bound
            points = [one.at(terminal, time) for terminal in TERMINALS]
            costs = [one.cost(terminal, time) for terminal in ("synchronous", "steady")]
            rows.append(
                (
                    one.gap,
                    rounded(time),
                    rounded(time / direct_time(one.gap), 3),
                    *(rounded(p.k_dyn) if p is not None else None for p in points),
                    *(None if cost is None else round(100 * (cost - 1.0), 3) for cost in costs),
                )
            )
    return Table(
        "What the terminal condition costs",
        ("gap, rad", "start time, s", "x direct", *TERMINALS, "synchronous, % more", "steady, % more"),
        rows,
    )


def claims(found: list[Endings]) -> list[Claim]:
    """Synchronous and steady against reached."""
    return [reached_is_lower(found), steady_costs(found)]


def reached_is_lower(found: list[Endings]) -> Claim:
    """The coasting tail counts: what is gained before t_f comes back after it."""
    above: list[float] = []
    below: list[float] = []
    most = (0.0, 0.0, 0.0)
    for one in found:
        for time, cost in one.costs("synchronous"):
            point = one.at("synchronous", time)
            assert point is not None
            assert point.k_dyn is not None
            lower = 1.0 - 1.0 / cost
            (above if point.k_dyn > 1.0 else below).append(lower)
            if point.k_dyn > 1.0 and lower > most[0]:
                most = (lower, time, one.gap)
    largest = max(above, default=0.0)
    verdict = Verdict.CONFIRMED if largest > 0.9 * PROMISED else Verdict.REFUTED
    tail = f"; at K_dyn < 1 by at most {100 * max(map(abs, below)):.1g} %" if below else ""
    return Claim(
        f"Reached is up to {100 * PROMISED:.0f} % below synchronous where K_dyn > 1.",
        verdict,
        f"By at most {100 * largest:.2f} % at {len(above)} start times with K_dyn > 1 ({most[2]:g} rad, "
        f"{most[1]:.4f} s)"
        f"{tail}. The peak of the whole run counts, and with it that of the coasting shaft after the "
        "target speed.",
    )


def steady_costs(found: list[Endings]) -> Claim:
    """Coming down to the load torque takes a share of the time."""
    short, long = [], []
    for one in found:
        costs = one.costs("steady")
        if costs:
            short.append(f"{percent(costs[0][1])} at {costs[0][0]:.4f} s")
            long.append(f"{percent(costs[-1][1])} at {costs[-1][0]:.4f} s ({one.gap:g} rad)")
    worst = max((cost for one in found for _, cost in one.costs("steady")), default=1.0)
    return Claim(
        "(Not in [G]) Ending steady, at the torque of the load, costs little.",
        Verdict.REFUTED if not long else Verdict.PARTLY if worst > 1.05 else Verdict.CONFIRMED,
        "K_dyn over that of reached at the same start time: "
        + "; ".join(f"{a}, {b}" for a, b in zip(short, long, strict=True))
        + ". Bringing the shaft down without swing takes time that is dear in short starts.",
    )
