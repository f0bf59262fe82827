"""What a contact sensor is worth: one torque for several gaps, blind, or planned again after the contact.

A drive that does not know its gap makes the same torque for all of them until it feels its contact. Here
this first part is full torque for t1 and none after it, the form of the optimum of a single gap. At the
contact twist and speeds are known, and with them the gap: from there on each gap has its own optimum in the
time that is left, by `optimize` on the drive as it is at that instant. t1 is searched for the lowest K_dyn of
the worst gap.

That figure is reached, so a sensor is worth at least as much against the blind torque that was found; other
first parts might do better still. Nothing goes below the own optimum of the worst gap.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from softstart import Drive, optimize, simulate
from softstart.controller import make_controller
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.profile import TorqueProfile
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.crane import percent
from softstart_studies.optimal_starts.drives import Extent, crane, direct_time

NEAR = 1.01  # so near the own optimum of the worst gap, knowing the gap would add nothing
PULSES, EACH = 200, 10  # where no closed form holds, each tenth is tried


@dataclass(frozen=True)
class Sensed:
    """K_dyn of each gap (rad) within one start time (s): by itself, under one torque, and planned again."""

    start_time: float
    gaps: tuple[float, ...]
    alone: tuple[float, ...]
    blind: tuple[float, ...]
    reacting: tuple[float, ...]

    @property
    def hardest(self) -> float:
        """The largest of the own optima: nothing does better on all gaps."""
        return max(self.alone)

    @property
    def percent(self) -> float:
        """By how much the sensor lowers the worst K_dyn."""
        return 100.0 * (1.0 - max(self.reacting) / max(self.blind))


def sensed(extent: Extent, progress: Progress) -> list[Sensed]:
    """One for each start time."""
    drive = crane(extent.sensor_gaps[0])
    drives = tuple(map(crane, extent.sensor_gaps))
    found = []
    for multiple in extent.sensor_multiples:
        time = multiple * direct_time(float(drive.gap))
        progress(f"one torque for {len(drives)} gaps, {time:.4g} s")
        blind = optimize(drive, time, scenarios=drives[1:], terminal="reached")
        alone = tuple(optimize(one, time, terminal="reached").k_dyn for one in drives)
        gaps = tuple(float(one.gap) for one in drives)
        found.append(Sensed(time, gaps, alone, blind.k_dyn_each, planned_again(drives, time)))
    return found


def planned_again(drives: tuple[Drive, ...], time: float) -> tuple[float, ...]:
    """K_dyn of each drive under the best common pulse and its own optimum after the contact.

    >>> drive = crane(0.5)
    >>> round(planned_again((drive,), 0.2883042)[0], 5)  # a single gap: its own optimum
    0.90925
    """

    def at_least(t1: float) -> float:
        return max(_least_peak(at_contact(one, t1), time) for one in drives)

    longest = max(PulseCoastHold.of(Problem(one, time)).course(np.inf).t_contact for one in drives)
    pulses = longest * np.arange(1, PULSES + 1) / PULSES
    best = int(np.argmin([at_least(t1) for t1 in pulses]))
    ends = pulses[max(best - 1, 0)], pulses[min(best + 1, PULSES - 1)]
    least = minimize_scalar(at_least, bounds=ends, method="bounded", options={"xatol": 1e-12})
    bounds = {float(least.x): float(least.fun)} | {float(t1): at_least(t1) for t1 in pulses[EACH - 1 :: EACH]}
    found: tuple[float, ...] = (np.inf,)
    for t1 in sorted(bounds, key=bounds.__getitem__):
        if bounds[t1] >= max(found) * float(drives[0].mean_torque):
            break  # neither this pulse nor those after it can be better
        with suppress(InfeasibleError, OptimumError):
            found = min(found, tuple(_planned(one, t1, time) for one in drives), key=max)
    return found


def _planned(drive: Drive, t1: float, time: float) -> float:
    contact, touching = at_contact(drive, t1)
    return optimize(touching, time - contact, terminal="reached").k_dyn


def at_contact(drive: Drive, t1: float) -> tuple[float, Drive]:
    """When the gap closes under full torque until t1 and none after it, s, and the drive as it is then.

    >>> time, touching = at_contact(crane(0.5), 0.00757)
    >>> round(time, 4), round(touching.initial_motor_speed, 2), touching.start_position
    (0.0217, 13.41, 0.25)
    """
    pulse = TorqueProfile.steps([0.0, t1, 1.0], [float(drive.Ms), 0.0])
    run = simulate(drive, make_controller("profile", {"profile": pulse}), 1.0)
    time = float(run.first_contact)
    state = run.at(time)
    return time, drive.replace(
        start_position=0.5 * float(drive.gap),
        initial_motor_speed=float(state["w1"]),
        initial_load_speed=float(state["w2"]),
    )


def _least_peak(contact: tuple[float, Drive], time: float) -> float:
    """The least peak of what follows a contact, N m: the bound of the closed form, however it is held."""
    left, touching = time - contact[0], contact[1]
    if not left > 0.0:
        return np.inf
    return PulseCoastHold.of(Problem(touching, left)).least_peak_for(float(touching.target_speed), left)


def table(found: list[Sensed]) -> Table:
    """K_dyn of each gap under the three."""
    rows = [
        (one.start_time, gap, own, blind, reacting, blind / own, reacting / own)
        for one in found
        for gap, own, blind, reacting in zip(one.gaps, one.alone, one.blind, one.reacting, strict=True)
    ]
    columns = ("start time, s", "gap, rad", "own optimum", "blind", "planned again", "blind / own",
               "planned again / own")  # fmt: skip
    return Table("One torque for several gaps", columns, rows)


def sensor_pays(found: list[Sensed]) -> Claim:
    """The worst gap under a torque planned again, beside its own optimum."""
    away = [max(one.reacting) / one.hardest for one in found]
    said = "; ".join(
        f"{one.start_time:.4f} s: worst K_dyn {max(one.blind):.3f} blind, {max(one.reacting):.3f} planned "
        f"again after the contact ({-one.percent:.0f} %), {one.hardest:.3f} for the worst gap by itself"
        for one in found
    )
    pays = min(one.percent for one in found) > 1.0
    return Claim(
        "(Not in [G]) A torque that is planned again after the contact needs no knowledge of the gap.",
        Verdict.REFUTED if not pays else Verdict.of(True, max(away) < NEAR),
        f"Gaps of {', '.join(f'{gap:g}' for gap in found[0].gaps)} rad. {said}. Planned again, the worst "
        f"gap is {percent(min(away), 1)} to {percent(max(away), 1)} from its own optimum.",
    )


def optimum_depends_on_gap(found: list[Sensed]) -> Claim:
    """At equal start time; what a wide gap takes is time."""
    said = "; ".join(f"{one.start_time:.4f} s: {', '.join(f'{k:.4f}' for k in one.alone)}" for one in found)
    spread = [max(one.alone) / min(one.alone) for one in found]
    return Claim(
        "The optimum is invariant to the gap.",
        Verdict.of(max(spread) < 1.01),
        f"Least K_dyn at {', '.join(f'{gap:g}' for gap in found[0].gaps)} rad in the same start time: "
        f"{said}; largest over least {max(spread):.3f} to {min(spread):.3f}. Torque profile and K_dyn both "
        "depend on it; what does not is the form (pulse, coast, hold).",
    )
