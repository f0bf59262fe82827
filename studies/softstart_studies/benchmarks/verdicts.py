"""What softstart's speed is claimed to be, and what became of each claim in this run."""

from __future__ import annotations

from collections.abc import Sequence

from softstart.study import Claim, Verdict
from softstart_studies.benchmarks.contest import Outcome, shown

MANY = 20_000.0  # times LSODA, for a batch without sampling
MILLION = 1e6  # starts/s on one core
AGREEMENT = 1e-6  # in K_dyn, where nothing is sampled


def claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """One claim for each kind of duel that has been fought."""
    kernel = [one for one in outcomes if one.duel.ours == "kernel" and one.duel.peer == "lsoda"]
    sampled = [one for one in outcomes if one.duel.peer == "lsoda-sampled"]
    single = [one for one in outcomes if one.duel.ours.startswith("run") and one.duel.peer == "lsoda"]
    staged = [one for one in outcomes if one.duel.peer in {"lsoda", "lsoda-restarted"}]
    found = []
    if kernel:
        found.append(_ratio_claim("In a batch, constant and staged torque", kernel))
        rates = [one.our_rate for one in kernel]
        millions = ", ".join(f"{one.duel.strategy} {one.our_rate / 1e6:.2f}" for one in kernel)
        found.append(
            Claim(
                "One core makes at least 1 million starts a second with constant and staged torque.",
                _verdict([rate >= MILLION for rate in rates]),
                f"Million starts/s: {millions}.",
            )
        )
    if sampled:
        found.append(_ratio_claim("In a batch, a ramp sampled at 1 kHz", sampled))
    if single:
        found.append(_ratio_claim("One simulate call with its full Run", single))
    if staged:
        apart = [one.k_dyn_difference for one in staged]
        found.append(
            Claim(
                "LSODA at rtol 1e-8 has the same K_dyn within 1e-6.",
                _verdict([value <= AGREEMENT for value in apart]),
                f"Largest difference: {max(apart):.1e}.",
            )
        )
    return found


def _ratio_claim(what: str, outcomes: Sequence[Outcome]) -> Claim:
    wanted = max(one.duel.wanted or 0.0 for one in outcomes)
    ratios = ", ".join(f"{one.duel.strategy} ({one.duel.ours}) {shown(one.ratio)}" for one in outcomes)
    return Claim(
        f"{what}: at least {wanted:,.0f} times as many starts a second as LSODA with located events.",
        _verdict([one.ratio >= (one.duel.wanted or 0.0) for one in outcomes]),
        f"Ratio: {ratios}.",
    )


def _verdict(held: Sequence[bool]) -> Verdict:
    """Confirmed if all held, refuted if none did.

    >>> _verdict([True, False])
    <Verdict.PARTLY: 'partly'>
    """
    if all(held):
        return Verdict.CONFIRMED
    return Verdict.PARTLY if any(held) else Verdict.REFUTED
