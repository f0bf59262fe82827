"""The six findings of [R] on the tractor-like chain: each with the number that decides it."""

from __future__ import annotations

import numpy as np

from softstart.arrays import Vector
from softstart.study import Claim, Table
from softstart_studies.paper_r.free import NOSE, Free, free, placed, scale_gaps, tractor
from softstart_studies.paper_r.locked import FREQUENCIES, TORQUES, forced, locked

__all__ = ["claims", "masses_table", "sections_table", "twist_claim", "widths_table"]


SHIFTS = (0.0, 1e-9, -1e-9)
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
MAIN = ("flywheel", "18 track and tractor")
ASSUMED = "on the tractor-like chain, whose inertias and stiffnesses are assumed"


def widened() -> dict[float, Free]:
    """The free vibration by the width of all gaps, as multiples of those of [R]; 0 is without gaps."""
    return {width: free(scale_gaps(tractor(), width)) for width in (0.0, *WIDTHS)}


def neighbours(width: float = 1.0) -> tuple[Free, ...]:
    """The same motion from starts 1e-9 apart: with several gaps it is chaotic, and differs in the end.

    What the claims say of peaks and of single masses is said of all of these.
    """
    chain = scale_gaps(tractor(), width)
    return tuple(free(chain, 1, NOSE * (1.0 + shift)) for shift in SHIFTS)


def normal(one: Free) -> Vector:
    """The shape with the mass of the track at 1."""
    return np.asarray(one.shape / one.shape[-1])


def masses_table() -> Table:
    """Finding 1: the shapes, with and without gaps."""
    runs = widened()
    names = [mass.name for mass in tractor().masses]
    plain, gaps = normal(runs[0.0]), normal(runs[1.0])
    rows = [
        (name, round(float(a), 4), round(float(b), 4)) for name, a, b in zip(names, plain, gaps, strict=True)
    ]
    return Table(
        "Shape of the first free vibration, track = 1 (assumed chain)",
        ("mass", "without gaps", "with gaps"),
        rows,
    )


def sections_table() -> Table:
    """Finding 4: the largest torques of the sections."""
    runs = widened()
    names = [mass.name for mass in tractor().masses]
    rows = []
    for k in range(len(names) - 1):
        plain = float(runs[0.0].torque[k])
        least, most = _span([float(run.torque[k]) for run in neighbours()])
        rows.append((_section(names, k), round(plain, 1), round(least), round(most), round(most / plain, 2)))
    return Table(
        "Largest torque of each section in the free vibration, N m at the crank (assumed chain)",
        ("section", "without gaps", "with gaps, least", "with gaps, most", "times"),
        rows,
    )


def widths_table() -> Table:
    """Finding 6: amplitudes of the masses over the width of the gaps."""
    runs = widened()
    chain = tractor()
    names = [mass.name for mass in chain.masses]
    shown = [names.index(MAIN[0]), *range(names.index(MAIN[0]) + 1, len(names))]
    rows = [
        (width, round(run.Omega / runs[0.0].Omega, 3), *(round(float(ratios(width)[k]), 2) for k in shown))
        for width, run in runs.items()
    ]
    return Table(
        "Whole motion of the masses over the width of all gaps, as multiples of that without (assumed chain)",
        ("gaps, times those of [R]", "w/Omega", *(names[k] for k in shown)),
        rows,
    )


def ratios(width: float) -> Vector:
    """Amplitudes of the whole motion over those without gaps, in the mean of the neighbouring starts."""
    mean = np.mean([run.amplitude for run in neighbours(width)], axis=0)
    return np.asarray(mean / widened()[0.0].amplitude)


def _span(values: list[float]) -> tuple[float, float]:
    return min(values), max(values)


def twist_claim() -> Claim:
    """The twist of the transmission: the chain was made so."""
    chain = tractor()
    arrays = chain.at_motor_shaft()
    assert chain.motor is not None
    torque = chain.motor.starting_torque
    twist = torque * float(np.sum(1.0 / arrays.c[arrays.motor : arrays.load]))
    return Claim(
        "The whole transmission is twisted by 30 to 50 deg without gaps",
        "partly",
        f"{np.degrees(twist):.1f} deg at {torque:g} N m, but by choice: the stiffnesses are not printed, and "
        "those of the tractor-like chain were assumed so that this holds.",
    )


def claims() -> list[Claim]:
    """The findings, 1 to 6."""
    runs = widened()
    plain, gaps = runs[0.0], runs[1.0]
    names = [mass.name for mass in tractor().masses]
    return [
        twist_claim(),
        _shape(plain, gaps, names),
        _frequencies(names),
        _others(plain),
        _torques(plain, names),
        _locking(),
        _robust(names),
    ]


def _shape(plain: Free, gaps: Free, names: list[str]) -> Claim:
    J = tractor().at_motor_shaft().J
    a, b = plain.shape, gaps.shape
    alike = float((a * J @ b) ** 2 / ((a * J @ a) * (b * J @ b)))
    before, after = normal(plain), normal(gaps)
    k = int(np.argmax(np.abs(after - before)))
    nodes = [int(np.flatnonzero(np.diff(np.sign(x)))[0]) for x in (before, after)]
    where = " and then ".join(dict.fromkeys(_section(names, i) for i in nodes))
    return Claim(
        "1. The free shape with gaps differs markedly from the gap-free one",
        "partly",
        f"At {NOSE:g} deg of the nose: the main line falls from {plain.Omega:.1f} to {gaps.Omega:.1f} rad/s. "
        f"Scaled to the track, {names[k]} changes most, from {before[k]:.3f} to {after[k]:.3f}; the node "
        "lies "
        f"in {where}, and weighted with the inertias the shapes are alike to {alike:.3f} (modal "
        f"assurance criterion): the light masses between the gaps differ, the heavy ones hardly ({ASSUMED}).",
    )


def _frequencies(names: list[str]) -> Claim:
    said, at_node = [], []
    for mode in (1, 2):
        found = placed(mode)
        least = min(found, key=lambda p: p.frequency)
        mildest = max(found, key=lambda p: p.frequency)
        torques, lowerings = _ranks([p.torque for p in found]), _ranks([-p.frequency for p in found])
        at_node.append(least.node)
        said.append(
            f"mode {mode}: w/Omega {least.frequency:.4f} with it in {_section(names, least.shaft)} "
            f"({'a' if least.node else 'no'} node there), {mildest.frequency:.4f} in "
            f"{_section(names, mildest.shaft)}; rank correlation of lowering and shaft torque "
            f"{float(np.corrcoef(torques, lowerings)[0, 1]):.2f}"
        )
    other = [p for p in placed(2) if p.node][-1]
    return Claim(
        "2. Gaps lower the natural frequencies, most where they sit at a node",
        "confirmed" if all(at_node) else "partly",
        f"One gap of 0.05 rad in each section in turn, same energy: {'; '.join(said)}. All lie below 1. What "
        "decides is the torque of the mode in the section: at the other node of mode 2, where it is "
        f"{other.torque:.2f} of the largest, the gap lowers the frequency to {other.frequency:.4f} only "
        f"({ASSUMED}).",
    )


def _ranks(values: list[float]) -> Vector:
    return np.argsort(np.argsort(values)).astype(np.float64)


def _section(names: list[str], k: int) -> str:
    return f"{names[k]} - {names[k + 1]}"


def _others(plain: Free) -> Claim:
    beside = _span([100 * _beside(run) for run in neighbours()])
    main = _span([run.Omega for run in neighbours()])
    strongest = _span([100 * run.lines[0][1] for run in neighbours()])
    return Claim(
        "3. Extra oscillations appear at other frequencies",
        "confirmed",
        f"{beside[0]:.0f} to {beside[1]:.0f} % of the mean kinetic energy lie beside the main line at "
        f"{main[0]:.1f} to "
        f"{main[1]:.1f} rad/s (without gaps {100 * abs(_beside(plain)):.1f} %), in a broad band, not in "
        "lines: the "
        f"strongest other line of the twist has {strongest[0]:.1f} to {strongest[1]:.1f} % of the main "
        "one, elsewhere "
        "in each of three starts that differ by 1e-9. The motion with several gaps is chaotic "
        f"({ASSUMED}).",
    )


def _beside(run: Free) -> float:
    """The share of the mean kinetic energy that is not at the main line."""
    J = tractor().at_motor_shaft().J
    return 1.0 - 0.5 * run.Omega**2 * float(J @ run.shape**2) / float(np.mean(run.motion.w**2 @ J))


def _torques(plain: Free, names: list[str]) -> Claim:
    most = np.max([run.torque for run in neighbours()], axis=0) / plain.torque
    least = np.min([run.torque for run in neighbours()], axis=0) / plain.torque
    first = names.index(MAIN[0])
    crank, low = int(np.argmax(most)), int(np.argmin(least))
    return Claim(
        "4. The elastic torques of the sections change much",
        "confirmed",
        f"Released with the same shaft torques, the sections between flywheel and track reach "
        f"{least[first:].min():.1f} ({_section(names, low)}) to {most[first:].max():.1f} times the "
        "largest torque "
        f"without gaps, the crank up to {most[crank]:.0f} times; three starts that differ by 1e-9 differ "
        "by up to "
        f"{100 * float((most / least - 1.0).max()):.0f} %. Undamped: the gaps close with impacts that "
        "excite the "
        "high modes.",
    )


def _locking() -> Claim:
    found = [locked(torque) for torque in TORQUES]
    part = max((one for one in found if one.open_gaps), key=lambda one: one.frequency)
    full = next(one for one in found if not one.open_gaps)
    gaps, locked_up, none = forced(1.0, 0.0), forced(1.0, 540.0), forced(0.0, 0.0)
    at, best = int(np.argmax(gaps)), int(np.argmax(none))
    apart = max(abs(a - b) for a, b in zip(locked_up, none, strict=True))
    return Claim(
        "5. A constant (locking) torque changes the frequencies by locking gaps fully or in part",
        "confirmed",
        f"w/Omega {found[0].frequency:.4f} without, {part.frequency:.4f} at {part.torque:g} N m (gaps "
        "still open "
        f"at times), {full.frequency:.4f} from {full.torque:g} N m on, where none opens. Forced, on the "
        "grid: "
        f"without gaps at most {none[best]:.3f} deg, at {FREQUENCIES[best]:.0f} rad/s; with gaps "
        f"{gaps[best]:.3f} deg there and at most {gaps[at]:.3f} deg, at {FREQUENCIES[at]:.0f} rad/s; "
        "under 540 N m "
        f"as without gaps, within {apart:.0e} deg ({ASSUMED}).",
    )


def _robust(names: list[str]) -> Claim:
    main = [names.index(name) for name in MAIN]
    others = list(range(main[0] + 1, main[1]))
    spans = {}
    for k in (*main, *others):
        course = [float(ratios(width)[k]) for width in WIDTHS]
        spans[k] = (min(course), max(course))

    def change(k: int) -> float:
        return max(1.0 - spans[k][0], spans[k][1] - 1.0)

    calmer = [names[k] for k in others if change(k) < max(map(change, main))]
    wildest = max(others, key=change)
    flywheel, track = (f"{spans[k][0]:.2f} to {spans[k][1]:.2f}" for k in main)
    also = f"; as calm as the flywheel: {', '.join(calmer)}" if calmer else ""
    return Claim(
        "6. The main (largest) masses are the most robust against wider gaps",
        "partly" if calmer else "confirmed",
        f"Gaps of 0.25 to 4 times those of [R] change the whole motion of the flywheel to {flywheel} and "
        "of the "
        f"track to {track} times, that of {names[wildest]} up to {spans[wildest][1]:.2f} times{also} "
        f"({ASSUMED}).",
    )
