"""The delay of acceleration-delay, set up for one elastic frequency, on drives that have another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from softstart import records
from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import CRANE, SHARE, base, closed_form, many

DEVIATIONS: Vector = np.linspace(-0.3, 0.4, 71)  # of the elastic frequency
BAND = 0.20  # the wider bound of [G]
KEPT = 1.10  # K_dyn at most this much above that of the delay fitted to the drive counts as kept
Cause = Literal["load inertia", "stiffness"]


@dataclass(frozen=True)
class Detuned:
    """K_dyn over the deviation of the elastic frequency, on the base of the nominal drive, M1/Ms = 0.25."""

    cause: Cause
    deviations: Vector
    J2: Vector  # kg m2
    c: Vector  # N m/rad
    promised: Vector  # (18), delay fitted to the drive
    first_contact: Vector  # delay (15) of the nominal drive
    whole: Vector
    half_delay: Vector  # delay (14) of the nominal drive, whole start

    def within(self, band: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Where the frequency is off by no more than this share."""
        inside: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.abs(self.deviations) <= band + 1e-9
        return inside


def detuned(cause: Cause) -> Detuned:
    """All starts; by the inertia of the load the frequency can only fall to that of an infinite one.

    Omega^2 = c/J1 + c/J2, so J2 = J1/(Omega^2 J1/c - 1): from 5 J1 up Omega falls by 8.7 % at the most.

    >>> float(detuned("load inertia").deviations[0].round(2))
    -0.08
    """
    squared = (CRANE.Omega * (1.0 + DEVIATIONS)) ** 2
    if cause == "load inertia":
        over = squared * CRANE.J1 / CRANE.c - 1.0
        possible = over > 0.01
        J2 = CRANE.J1 / over[possible]
        c, deviations = np.full(J2.shape, float(CRANE.c)), DEVIATIONS[possible]
    else:
        c, deviations = CRANE.c * (1.0 + DEVIATIONS) ** 2, DEVIATIONS
        J2 = np.full(c.shape, float(CRANE.J2))
    drives = records(CRANE, load_inertia=J2, stiffness=c)
    torque = SHARE * float(CRANE.Ms)
    half = 0.5 * float(closed_form(CRANE, SHARE, 2).contact_duration)
    first, whole = many(drives, "acceleration-delay", torque=torque)
    _, by_half = many(drives, "acceleration-delay", torque=torque, delay=half)
    promised = np.asarray(closed_form(CRANE, SHARE, 2, base(), J2=J2, c=c).k_dyn)
    return Detuned(cause, deviations, J2, c, promised, first, whole, by_half)


def table(sweeps: list[Detuned]) -> Table:
    """K_dyn at deviations of 10 % steps."""
    rows = [
        (
            sweep.cause,
            f"{100 * sweep.deviations[i]:+.0f} %",
            round(float(sweep.J2[i] / CRANE.J1), 3),
            round(float(sweep.c[i] / CRANE.c), 3),
            *(
                round(float(k[i]), 4)
                for k in (sweep.promised, sweep.first_contact, sweep.whole, sweep.half_delay)
            ),
        )
        for sweep in sweeps
        for i in range(len(sweep.deviations))
        if round(100 * float(sweep.deviations[i])) % 10 == 0
    ]
    return Table(
        "K_dyn over elastic frequency",
        (
            "changed",
            "Omega",
            "J2/J1",
            "c/c new",
            "(18)",
            "delay (15): first",
            "whole",
            "delay (14): whole",
        ),
        rows,
    )


def claims(sweeps: list[Detuned]) -> list[Claim]:
    """The 10-20 % of [G].

    >>> [claim.verdict.value for claim in claims([detuned("load inertia"), detuned("stiffness")])]
    ['partly']
    """
    by_load, by_shaft = sweeps
    excess = {sweep.cause: sweep.first_contact / sweep.promised for sweep in sweeps}
    kept_by_load = bool(np.all(excess["load inertia"][by_load.within(BAND)] < KEPT))
    kept_by_shaft = bool(np.all(excess["stiffness"][by_shaft.within(BAND)] < KEPT))
    broken = by_shaft.deviations[excess["stiffness"] > KEPT]
    lost = float(broken.max()) if broken.size else float("nan")
    near, far = by_shaft.within(BAND / 2), by_shaft.within(BAND)
    at_worst = int(np.argmax(np.where(far, excess["stiffness"], 0.0)))
    half = max(float(np.max((s.half_delay / s.promised)[s.within(BAND)])) for s in sweeps)
    lowest = float(np.sqrt(CRANE.J2 / (CRANE.J1 + CRANE.J2))) - 1.0
    return [
        Claim(
            "The delay fits while J2 varies so little that the elastic frequency stays within 10-20 %.",
            Verdict.CONFIRMED
            if kept_by_load and kept_by_shaft
            else Verdict.PARTLY
            if kept_by_load
            else Verdict.REFUTED,
            f"At first contact J2 does not matter: from {_share(by_load.deviations[0])} (no J2 lowers the "
            f"frequency of this drive by more than {_share(-lowest, '')}) to "
            f"{_share(by_load.deviations[-1])} K is "
            f"that of (18) to {np.abs(excess['load inertia'] - 1).max():.0e}. Where the stiffness moves "
            "the frequency, "
            f"it holds within 10 % (to {np.abs(excess['stiffness'][near] - 1).max():.0e}) and breaks from "
            f"{_share(lost)} on, where the torque rises inside stage 2: "
            f"{by_shaft.first_contact[at_worst]:.4f} "
            f"instead of {by_shaft.promised[at_worst]:.4f} at {_share(by_shaft.deviations[at_worst])}. "
            "Over the "
            f"whole start, within 20 %, K is {_span(by_load.whole[by_load.within(BAND)])} by J2 and "
            f"{_span(by_shaft.whole[far])} by stiffness, where (18) promises "
            f"{_span(by_shaft.promised[far])}; with "
            f"the delay (14) it is at most {100 * (half - 1):.0f} % above (18).",
        )
    ]


def _span(k: Vector) -> str:
    return f"{float(k.min()):.2f} to {float(k.max()):.2f}"


def _share(deviation: float, sign: str = "+") -> str:
    return f"{100 * float(deviation):{sign}.1f} %"
