"""What a contact sensor is worth: one profile for several gaps, blind or reacting to the contact."""

from __future__ import annotations

from dataclasses import dataclass

from softstart import Drive
from softstart.optimal.result import InfeasibleError, SensorWorth
from softstart.optimal.robust import scenarios_of, worth_of_contact_sensor
from softstart.optimal.solving import optimize
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import Extent, crane, direct_time, percent, rounded

NEAR = 1.01  # so near the own optimum of the worst gap, knowing the gap would add nothing


@dataclass(frozen=True)
class Sensed:
    """The robust optima at one start time, and what each gap could have if it were the only one."""

    start_time: float
    worth: SensorWorth

    @property
    def alone(self) -> tuple[float, ...]:
        """Least K_dyn with one contact of each gap by itself."""
        assert self.worth.alone is not None
        return self.worth.alone

    @property
    def hardest(self) -> float:
        """The largest of them: no profile with one contact does better on all gaps."""
        return max(self.alone)


def sensed(extent: Extent, progress: Progress) -> list[Sensed]:
    """One for each start time."""
    drive = crane(extent.sensor_gaps[0])
    scenarios = scenarios_of(drive, gaps=extent.sensor_gaps)
    found = []
    for multiple in extent.sensor_multiples:
        time = multiple * direct_time(float(drive.gap))
        worth = worth_of_contact_sensor(
            scenarios,
            time,
            progress=lambda text, t=time: progress(f"sensor, {t:.4g} s: {text}"),  # type: ignore[misc]
            k_dyn_alone=lambda one, t=time: _alone(one, t),  # type: ignore[misc]
        )
        found.append(Sensed(time, worth))
    return found


def _alone(drive: Drive, time: float) -> float:
    try:
        return optimize(drive, time, terminal="reached").k_dyn
    except InfeasibleError:
        return float("nan")


def table(found: list[Sensed]) -> Table:
    """K_dyn of each gap under the three."""
    return Table(
        "One profile for several gaps",
        ("start time, s", "gap, rad", "own optimum", "blind", "reacting", "blind / own", "reacting / own"),
        [
            (
                rounded(one.start_time),
                float(drive.gap),
                rounded(own, 4),
                rounded(blind, 4),
                rounded(reacting, 4),
                rounded(blind / own, 3),
                rounded(reacting / own, 3),
            )
            for one in found
            for drive, own, blind, reacting in zip(
                one.worth.blind.scenarios,
                one.alone,
                one.worth.blind.k_dyn_each,
                one.worth.reacting.k_dyn_each,
                strict=True,
            )
        ],
    )


def claims(found: list[Sensed]) -> list[Claim]:
    """Whether it pays, and whether the gap itself has to be known."""
    return [sensor_pays(found), optimum_depends_on_gap(found)]


def sensor_pays(found: list[Sensed]) -> Claim:
    """The worst gap under a profile that reacts, beside its own optimum."""
    away = [one.worth.reacting.k_dyn / one.hardest for one in found]
    said = "; ".join(
        f"{one.start_time:.4f} s: worst K_dyn {one.worth.blind.k_dyn:.3f} blind, "
        f"{one.worth.reacting.k_dyn:.3f} reacting "
        f"({-one.worth.percent:.0f} %), {one.hardest:.3f} for the worst gap by itself"
        for one in found
    )
    pays = min(one.worth.percent for one in found) > 1.0
    return Claim(
        "(Not in [G]) A profile that reacts to the contact needs no knowledge of the gap.",
        Verdict.REFUTED if not pays else Verdict.CONFIRMED if max(away) < NEAR else Verdict.PARTLY,
        f"Gaps of {', '.join(f'{d.gap:g}' for d in found[0].worth.blind.scenarios)} rad under one profile. "
        f"{said}. "
        f"Reacting, the worst gap is {percent(min(away))} to {percent(max(away))} from its own optimum.",
    )


def optimum_depends_on_gap(found: list[Sensed]) -> Claim:
    """At equal start time; what a wide gap takes is time."""
    gaps = [float(drive.gap) for drive in found[0].worth.blind.scenarios]
    said = "; ".join(f"{one.start_time:.4f} s: {', '.join(f'{k:.4f}' for k in one.alone)}" for one in found)
    spread = [max(one.alone) / min(one.alone) for one in found]
    return Claim(
        "The optimum is invariant to the gap.",
        Verdict.CONFIRMED if max(spread) < 1.01 else Verdict.REFUTED,
        f"Least K_dyn at {', '.join(f'{gap:g}' for gap in gaps)} rad in the same start time: {said}; "
        "largest over least "
        f"{max(spread):.3f} to {min(spread):.3f}. Torque profile and K_dyn both depend on it; what does "
        "not is the form (pulse, coast, hold).",
    )
