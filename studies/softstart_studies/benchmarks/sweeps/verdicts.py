"""What a sweep is claimed to do, and what became of each claim in this run."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.study import Claim, Verdict

TIMES = 100.0  # LSODA
MEMORY = 2048.0  # MiB
AGREEMENT = 1e-4  # in K_dyn, of sampled starts


@dataclass(frozen=True)
class Found:
    """Starts, starts/s and core of both, largest difference in K_dyn, MiB, and whether the bits agree."""

    starts: int
    rate: float
    peer_rate: float
    apart: float
    memory: float | None
    resumed: bool
    kept: bool
    on_cluster: bool | None


def claims(found: Found) -> list[Claim]:
    """One claim for everything that was tried.

    >>> [claim.verdict.value for claim in claims(Found(1000, 2e4, 10.0, 1e-6, 700.0, True, True, None))]
    ['confirmed', 'confirmed', 'confirmed', 'confirmed']
    """
    ratio = found.rate / found.peer_rate
    made = [
        Claim(
            f"A sweep makes at least {TIMES:.0f} times as many sampled starts a second and core as LSODA.",
            _verdict(ratio >= TIMES),
            f"{found.rate:,.0f} against {found.peer_rate:.3g} starts/s: {ratio:,.0f} times.",
        ),
        Claim(
            f"Both have the same K_dyn within {AGREEMENT:g}.",
            _verdict(found.apart <= AGREEMENT),
            f"Largest difference: {found.apart:.1e}.",
        ),
    ]
    if found.memory is not None:
        made.append(
            Claim(
                "All processes of a sweep together stay below 2 GiB.",
                _verdict(found.memory < MEMORY),
                f"At most {found.memory:,.0f} MiB with {found.starts:,} starts.",
            )
        )
    made.append(
        Claim(
            "Killed twice and begun again, a sweep has the same bits and makes no finished chunk anew.",
            _verdict(found.resumed and found.kept),
            f"Bits {'agree' if found.resumed else 'differ'}; finished chunks were "
            f"{'kept' if found.kept else 'made anew'}.",
        )
    )
    if found.on_cluster is not None:
        made.append(
            Claim(
                "On two dask workers, of which one is killed, a sweep has the same bits.",
                _verdict(found.on_cluster),
                f"Bits {'agree' if found.on_cluster else 'differ'}.",
            )
        )
    return made


def _verdict(held: bool) -> Verdict:
    return Verdict.CONFIRMED if held else Verdict.REFUTED
