"""Switching by time and by acceleration and delay, set up for the new gap, while the gap wears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart import records
from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import CRANE, GAP_1, GAP_2, SHARE, closed_form, many
from softstart_studies.paper_g.switching import SwitchAtInstant

GAPS: Vector = np.linspace(GAP_1, GAP_2, 61)
SHOWN = (0, 10, 20, 30, 40, 50, 60)  # of these, in the table
KEPT = 1.05  # a first contact at most this much above (18) counts as kept


@dataclass(frozen=True)
class Kept:
    """K_dyn of one way of switching over the gap."""

    first_contact: Vector
    whole: Vector


@dataclass(frozen=True)
class Wear:
    """K_dyn over the gap: what (18) promises, and three ways of switching, M1/Ms = 0.25."""

    gaps: Vector
    promised: Vector
    by_time: Kept
    by_delay: Kept  # delay (15), as [G] says
    by_half_delay: Kept  # delay (14)


def wear() -> Wear:
    """All starts.

    >>> found = wear()
    >>> bool(found.by_time.first_contact[-1] > 1.3 * found.promised[-1])
    True
    """
    worn = records(CRANE, gap=GAPS)
    torque = SHARE * float(CRANE.Ms)
    half = 0.5 * float(closed_form(CRANE, SHARE, 2).contact_duration)
    return Wear(
        GAPS,
        np.asarray(closed_form(CRANE, SHARE, 2, gap=GAPS).k_dyn),
        Kept(*many(worn, SwitchAtInstant(torque=torque))),
        Kept(*many(worn, "acceleration-delay", torque=torque)),
        Kept(*many(worn, "acceleration-delay", torque=torque, delay=half)),
    )


def table(found: Wear) -> Table:
    """First contact and whole start at some gaps."""
    ways = (found.by_time, found.by_delay, found.by_half_delay)
    columns = (
        found.gaps,
        found.promised,
        *(values for way in ways for values in (way.first_contact, way.whole)),
    )
    return Table(
        "K_dyn while the gap wears",
        (
            "gap, rad",
            "(18)",
            "instant: first",
            "whole",
            "delay (15): first",
            "whole",
            "delay (14): first",
            "whole",
        ),
        [tuple(round(float(column[i]), 4) for column in columns) for i in SHOWN],
    )


def claims(found: Wear) -> list[Claim]:
    """Time fails, acceleration and delay does not."""
    return [time_fails(found), acceleration_holds(found)]


def time_fails(found: Wear) -> Claim:
    """At first contact yes; over the whole start the delay of [G] is harder still."""
    excess = found.by_time.first_contact / found.promised
    fails = float(excess[-1]) > KEPT
    gentler = bool(np.all(found.by_time.whole <= found.by_delay.whole + 0.01))
    method_1 = float(closed_form(CRANE.replace(gap=GAP_2), SHARE, 1).k_dyn)
    softest = int(np.argmin(found.by_time.whole))
    return Claim(
        "Switching by time is unacceptable, because wear lengthens the stages.",
        Verdict.REFUTED if not fails else Verdict.PARTLY if gentler else Verdict.CONFIRMED,
        "Set up for 0.5 rad and worn to 2 rad, the torque rises as the gap closes: first contact "
        f"{_ends(found.by_time.first_contact)}, {100 * (float(excess[-1]) - 1):.0f} % above (18) and near "
        f"method 1 ({method_1:.4f}). Over the whole start K is {_ends(found.by_time.whole)}, with a least of "
        f"{found.by_time.whole[softest]:.4f} at {found.gaps[softest]:.2f} rad, where the instant falls near "
        f"the peak of stage 2: {'at no gap harder' if gentler else 'sometimes harder'} than the delay that "
        f"[G] puts in its place ({_ends(found.by_delay.whole)}).",
    )


def acceleration_holds(found: Wear) -> Claim:
    """At first contact; over the whole start only with the delay (14)."""
    excess = float(np.max(found.by_delay.first_contact / found.promised))
    half = float(np.max(found.by_half_delay.whole / found.promised))
    holds, whole_holds = excess < KEPT, float(np.max(found.by_delay.whole / found.promised)) < KEPT
    return Claim(
        "Torque held reduced by the acceleration of the motor and then for a delay equal to stage 2 does "
        "not fail with wear.",
        Verdict.CONFIRMED if holds and whole_holds else Verdict.PARTLY if holds else Verdict.REFUTED,
        f"At 1 kHz with an encoder the first contact is that of (18) to {max(abs(excess - 1), 1e-16):.0e}: "
        f"{_ends(found.by_delay.first_contact)}. But raised at the end of stage 2 or later, the torque makes "
        f"the second contact hard: whole start {_ends(found.by_delay.whole)}. With the delay (14), half as "
        f"long, the whole start stays within {100 * (half - 1):.1f} % of (18): "
        f"{_ends(found.by_half_delay.whole)}.",
    )


def _ends(k: Vector) -> str:
    return f"{k[0]:.4f} to {k[-1]:.4f}"
