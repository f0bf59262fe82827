"""The six findings of [R] on the tractor-like chain: each with the number that decides it.

Free vibration: released from rest with the shaft torques of the gap-free mode, as in fig. 3 of [R], undamped.
With several gaps the motion is chaotic: what is said of peaks and single masses holds for three starts that
differ by 1e-9. Forced: harmonic torques on the cylinders, with and without a constant torque.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.chain import Chain
from softstart.study import Claim, Table, Verdict
from softstart.views.drawing import drawing, new_figure
from softstart_studies.crane import draw_lines
from softstart_studies.paper_r.last_bits import natural_vibration
from softstart_studies.paper_r.vibration_with_gaps import (
    ForcedResponse,
    Motion,
    chain_backbone,
    forced_response,
    harmonic,
    let_go,
    lines,
    main_line,
    twists,
    windowed,
)

NOSE = 2.0  # deg: resonance amplitude at the crank nose that [R] measured; the vibration is released with it
CYCLES, SAMPLES = 60, 64  # periods of the gap-free first mode, and samples in each
SHIFTS = (0.0, 1e-9, -1e-9)
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
MAIN = ("flywheel", "18 track and tractor")
LOCKED_NOSE, LOCKED_CYCLES = 1.0, 40  # deg at the crank nose, gap-free
TORQUES = (0.0, 50.0, 100.0, 150.0, 200.0, 225.0, 250.0, 300.0, 540.0)  # N m at the crank
FREQUENCIES = np.concatenate([np.arange(30.0, 62.0, 4.0), np.arange(62.0, 76.0, 2.0), [80.0, 90.0]])  # rad/s
ASSUMED = "on the tractor-like chain, whose inertias and stiffnesses are assumed"


# motions -------------------------------------------------------------------------------------------------


def tractor() -> Chain:
    """The tractor-like chain in first gear: inertias and stiffnesses assumed, gaps and ratios of [R]."""
    return Chain.load("tractor-like")


NAMES = [mass.name for mass in tractor().masses]
J = tractor().at_motor_shaft().J
FIRST, LAST = (NAMES.index(name) for name in MAIN)


def section(k: int) -> str:
    """Between which masses shaft k lies."""
    return f"{NAMES[k]} - {NAMES[k + 1]}"


def scale_gaps(chain: Chain, factor: float) -> Chain:
    """The chain with all gaps so many times as wide."""
    return replace(chain, shafts=tuple(s.replace(gap=factor * s.gap) for s in chain.shafts))


def single_gap(chain: Chain, k: int, gap: float) -> Chain:
    """The chain at the motor shaft with one gap only, in shaft k."""
    there = chain.brought_to(chain.motor_index)
    shafts = [s.replace(gap=gap if i == k else 0.0) for i, s in enumerate(there.shafts)]
    return replace(there, shafts=tuple(shafts))


@dataclass(frozen=True, eq=False)
class Free:
    """A free vibration: main frequency (rad/s), its shape, whole amplitudes, largest shaft torques.

    `shape` holds the amplitudes of the masses at the main frequency, in rad at the motor shaft, signed by
    their phase; `amplitude` the root mean square of the whole motion of each mass, times sqrt(2). `strongest`
    is the strongest other line of the twist between motor and load over the main one, `beside` the share of
    the mean kinetic energy that is not at the main line.
    """

    motion: Motion
    Omega: float
    shape: Vector
    amplitude: Vector
    torque: Vector
    strongest: float
    beside: float


@lru_cache(maxsize=64)
def free(chain: Chain, mode: int = 1, nose: float = NOSE) -> Free:
    """The crank nose has the amplitude `nose` (deg) in the gap-free first mode, other modes its energy."""
    vibration, arrays = natural_vibration(chain), chain.at_motor_shaft()
    torques = vibration.torque[mode]
    first = vibration.torque[1] / abs(vibration.shape[1, 0]) * np.radians(nose)
    torques = torques * np.sqrt((first**2 @ (1.0 / arrays.c)) / (torques**2 @ (1.0 / arrays.c)))
    w, shape = float(vibration.Omega[mode]), vibration.shape[mode]
    t = np.arange(CYCLES * SAMPLES + 1.0) * (2.0 * np.pi / w / SAMPLES)
    motion = let_go(arrays, twists(arrays, torques), t)
    main = main_line(motion, arrays, shape, w, mode)
    along = lines(windowed(motion.angle @ (arrays.J * shape)), t, main)[0]
    window = np.hanning(t.size) / np.hanning(t.size).sum()
    phasors = lines(motion.angle * window[:, None], t, main)[0]
    at_main = 2.0 * np.real(phasors * np.conj(along)) / abs(along)
    whole = windowed(motion.twist[:, arrays.motor : arrays.load].sum(axis=1))
    others = np.arange(0.05, 4.0, 0.002) * w
    others = others[np.abs(others - main) > 0.1 * main]
    strongest = np.abs(lines(whole, t, others)).max() / abs(lines(whole, t, main)[0])
    at_main_energy = 0.5 * main**2 * float(arrays.J @ at_main**2)
    return Free(
        motion, main, at_main,
        np.sqrt(2.0 * np.mean(motion.angle[:-1] ** 2, axis=0)),
        np.abs(motion.torque).max(axis=0),
        float(strongest), 1.0 - at_main_energy / float(np.mean(motion.w**2 @ arrays.J)),
    )  # fmt: skip


def neighbours(width: float = 1.0) -> tuple[Free, ...]:
    """The same motion from starts 1e-9 apart: with several gaps it is chaotic, and differs in the end."""
    chain = scale_gaps(tractor(), width)
    return tuple(free(chain, 1, NOSE * (1.0 + shift)) for shift in SHIFTS)


def plain() -> Free:
    """The free vibration without gaps."""
    return free(scale_gaps(tractor(), 0.0))


def ratios(width: float) -> Vector:
    """Amplitudes of the whole motion over those without gaps, in the mean of the neighbouring starts."""
    found: Vector = np.mean([run.amplitude for run in neighbours(width)], axis=0) / plain().amplitude
    return found


def normal(one: Free) -> Vector:
    """The shape with the mass of the track at 1."""
    found: Vector = one.shape / one.shape[-1]
    return found


class Placed(NamedTuple):
    """A single gap in shaft k: the share of the mode's largest torque there, and w/Omega with it."""

    shaft: int
    torque: float
    node: bool
    frequency: float


@lru_cache(maxsize=2)
def placed(mode: int, gap: float = 0.05) -> list[Placed]:
    """The same gap, at the crank, in each shaft between flywheel and track in turn."""
    chain = tractor()
    vibration = natural_vibration(chain)
    nodes = {node.shaft for node in vibration.nodes[mode]}
    share = np.abs(vibration.torque[mode]) / np.abs(vibration.torque[mode]).max()
    w = float(vibration.Omega[mode])
    return [
        Placed(k, float(share[k]), k in nodes, free(single_gap(chain, k, gap), mode).Omega / w)
        for k in range(chain.motor_index, len(chain.shafts))
    ]


class Locked(NamedTuple):
    """A free vibration about a constant torque: it in N m, w/Omega, and how many gaps ever open."""

    torque: float
    frequency: float
    open_gaps: int


def alternating() -> Vector:
    """Shaft torques of the first mode with 1 deg at the crank nose, above 0 behind the motor."""
    vibration = natural_vibration(tractor())
    torques = vibration.torque[1] / vibration.shape[1, 0] * np.radians(LOCKED_NOSE)
    found: Vector = torques * np.sign(torques[tractor().motor_index])
    return found


@lru_cache(maxsize=32)
def locked(torque: float) -> Locked:
    """Engine and track pull against each other with `torque`; the first mode is let go on top of it."""
    chain = tractor()
    vibration, arrays = natural_vibration(chain), chain.at_motor_shaft()
    constant = np.zeros(arrays.c.size)
    constant[arrays.motor : arrays.load] = torque
    pull = np.zeros(arrays.J.size)
    pull[arrays.motor], pull[arrays.load] = torque, -torque
    w = float(vibration.Omega[1])
    t = np.arange(LOCKED_CYCLES * SAMPLES + 1.0) * (2.0 * np.pi / w / SAMPLES)
    motion = let_go(arrays, twists(arrays, constant + alternating()), t, acting=harmonic(pull, 0.0 * pull, w))
    opened = (np.abs(motion.torque[:, arrays.gap > 0.0]).min(axis=0) == 0.0).sum()
    return Locked(torque, main_line(motion, arrays, vibration.shape[1], w) / w, int(opened))


@lru_cache(maxsize=2)
def forced(locking: float) -> ForcedResponse:
    """The steady vibration under torques on the cylinders that make 1 deg at resonance without gaps.

    With open gaps several motions may be possible; the one from rest is taken.
    """
    chain = tractor()
    cylinders = [name for name in NAMES if name.startswith("cylinder")]
    w = float(natural_vibration(chain).Omega[1])
    unit = forced_response(chain, w, dict.fromkeys(cylinders, 1.0), from_rest=True, settle=0.0)
    size = np.radians(LOCKED_NOSE) / float(unit.without_gaps[0, 0])
    return forced_response(
        chain, FREQUENCIES, dict.fromkeys(cylinders, size), locking=locking, from_rest=locking == 0.0
    )


# tables --------------------------------------------------------------------------------------------------


def tables() -> tuple[Table, ...]:
    """Places of a gap, backbone, widths of gaps, locking."""
    nodes = [(mode, one) for mode in (1, 2) for one in placed(mode)]
    vibration = natural_vibration(tractor())
    per_nose = float(np.abs(vibration.torque[1]).max() / abs(vibration.shape[1, 0]))
    noses = (0.5, 1.0, 2.0, 4.0, 8.0)
    backbone = chain_backbone(tractor(), per_nose * np.radians(noses))
    locks = [locked(torque) for torque in TORQUES]
    return (
        Table.of("One gap of 0.05 rad at the crank, in each section in turn, same energy (assumed chain)", {
            "mode": [mode for mode, _ in nodes],
            "section": [section(one.shaft) for _, one in nodes],
            "node in it": ["yes" if one.node else "no" for _, one in nodes],
            "torque of the mode there, of its largest": [one.torque for _, one in nodes],
            "w/Omega": [one.frequency for _, one in nodes],
        }),
        Table.of("Backbone: frequency of the free vibration with all gaps (assumed chain)", {
            "nose amplitude, deg": noses,
            "largest torque at release, N m": backbone.torque,
            "chain: w/Omega": backbone.frequency / backbone.Omega,
            "two masses, exact: w/Omega": backbone.two_masses / backbone.Omega,
        }),
        Table(
            "Whole motion of the masses over the width of all gaps, as multiples of that without (assumed "
            "chain)",
            ("gaps, times those of [R]", "w/Omega", *NAMES[FIRST:]),
            [(one, neighbours(one)[0].Omega / plain().Omega, *ratios(one)[FIRST:]) for one in (0.0, *WIDTHS)],
        ),
        Table.of("Free vibration about a constant torque (assumed chain), 1 deg at the crank nose without "
                 "gaps", {
            "constant torque, N m": TORQUES,
            "over the largest alternating torque": np.array(TORQUES) / np.abs(alternating()).max(),
            "w/Omega": [one.frequency for one in locks],
            "gaps that open, of 6": [one.open_gaps for one in locks],
        }),
    )  # fmt: skip


# claims --------------------------------------------------------------------------------------------------


def claims() -> list[Claim]:
    """The twist of the transmission, and the findings, 1 to 6."""
    return [twist(), shape(), frequencies(), other_frequencies(), torques(), locking(), main_masses()]


def twist() -> Claim:
    """The twist of the transmission: the chain was made so."""
    chain = tractor()
    arrays = chain.at_motor_shaft()
    assert chain.motor is not None
    torque = chain.motor.starting_torque
    angle = np.degrees(torque * float(np.sum(1.0 / arrays.c[arrays.motor : arrays.load])))
    return Claim(
        "The whole transmission is twisted by 30 to 50 deg without gaps",
        Verdict.PARTLY,
        f"{angle:.1f} deg at {torque:g} N m, but by choice: the stiffnesses are not printed, and those of "
        "the tractor-like chain were assumed so that this holds.",
    )


def shape() -> Claim:
    """How alike the shapes are, and which mass differs most."""
    without, gaps = plain(), neighbours()[0]
    a, b = without.shape, gaps.shape
    alike = float((a * J @ b) ** 2 / ((a * J @ a) * (b * J @ b)))
    before, after = normal(without), normal(gaps)
    k = int(np.argmax(np.abs(after - before)))
    nodes = [int(np.flatnonzero(np.diff(np.sign(x)))[0]) for x in (before, after)]
    where = " and then ".join(dict.fromkeys(map(section, nodes)))
    return Claim(
        "1. The free shape with gaps differs markedly from the gap-free one",
        Verdict.PARTLY,
        f"At {NOSE:g} deg of the nose: the main line falls from {without.Omega:.1f} to {gaps.Omega:.1f} "
        f"rad/s. Scaled to the track, {NAMES[k]} changes most, from {before[k]:.3f} to {after[k]:.3f}; the "
        f"node lies in {where}, and weighted with the inertias the shapes are alike to {alike:.3f} (modal "
        f"assurance criterion): the light masses between the gaps differ, the heavy ones hardly ({ASSUMED}).",
    )


def frequencies() -> Claim:
    """A single gap, section by section."""
    said, at_node = [], []
    for mode in (1, 2):
        found = placed(mode)
        least, mildest = (extreme(found, key=lambda one: one.frequency) for extreme in (min, max))
        torque, lowering = _ranks([one.torque for one in found]), _ranks([-one.frequency for one in found])
        at_node.append(least.node)
        said.append(
            f"mode {mode}: w/Omega {least.frequency:.4f} with it in {section(least.shaft)} "
            f"({'a' if least.node else 'no'} node there), {mildest.frequency:.4f} in "
            f"{section(mildest.shaft)}; rank correlation of lowering and shaft torque "
            f"{float(np.corrcoef(torque, lowering)[0, 1]):.2f}"
        )
    other = [one for one in placed(2) if one.node][-1]
    return Claim(
        "2. Gaps lower the natural frequencies, most where they sit at a node",
        Verdict.CONFIRMED if all(at_node) else Verdict.PARTLY,
        f"One gap of 0.05 rad in each section in turn, same energy: {'; '.join(said)}. All lie below 1. "
        "What decides is the torque of the mode in the section: at the other node of mode 2, where it is "
        f"{other.torque:.2f} of the largest, the gap lowers the frequency to {other.frequency:.4f} only "
        f"({ASSUMED}).",
    )


def _ranks(values: list[float]) -> Any:
    return np.argsort(np.argsort(values)).astype(np.float64)


def other_frequencies() -> Claim:
    """What lies beside the main line."""
    runs = neighbours()
    beside, strongest = (np.array([getattr(run, name) for run in runs]) for name in ("beside", "strongest"))
    main = [run.Omega for run in runs]
    return Claim(
        "3. Extra oscillations appear at other frequencies",
        Verdict.CONFIRMED,
        f"{100 * beside.min():.0f} to {100 * beside.max():.0f} % of the mean kinetic energy lie beside the "
        f"main line at {min(main):.1f} to {max(main):.1f} rad/s (without gaps "
        f"{100 * abs(plain().beside):.1f} %), in a broad band, not in lines: the strongest other line of "
        f"the twist has {100 * strongest.min():.1f} to {100 * strongest.max():.1f} % of the main one, "
        "elsewhere in each of three starts that differ by 1e-9. The motion with several gaps is chaotic "
        f"({ASSUMED}).",
    )


def torques() -> Claim:
    """The largest torques of the sections over those without gaps."""
    over = np.array([run.torque for run in neighbours()]) / plain().torque
    most, least = over.max(axis=0), over.min(axis=0)
    return Claim(
        "4. The elastic torques of the sections change much",
        Verdict.CONFIRMED,
        "Released with the same shaft torques, the sections between flywheel and track reach "
        f"{least[FIRST:].min():.1f} ({section(int(np.argmin(least)))}) to {most[FIRST:].max():.1f} times "
        f"the largest torque without gaps, the crank up to {most.max():.0f} times; three starts that differ "
        f"by 1e-9 differ by up to {100 * float((most / least - 1.0).max()):.0f} %. Undamped: the gaps close "
        "with impacts that excite the high modes.",
    )


def locking() -> Claim:
    """Free vibration about a constant torque, and the forced response with and without it."""
    found = [locked(torque) for torque in TORQUES]
    part = max((one for one in found if one.open_gaps), key=lambda one: one.frequency)
    full = next(one for one in found if not one.open_gaps)
    loose, tight = forced(0.0), forced(540.0)
    none, gaps, closed = (
        np.degrees(one[:, 0]) for one in (loose.without_gaps, loose.amplitude, tight.amplitude)
    )
    at, best = int(np.argmax(gaps)), int(np.argmax(none))
    return Claim(
        "5. A constant (locking) torque changes the frequencies by locking gaps fully or in part",
        Verdict.CONFIRMED,
        f"w/Omega {found[0].frequency:.4f} without, {part.frequency:.4f} at {part.torque:g} N m (gaps still "
        f"open at times), {full.frequency:.4f} from {full.torque:g} N m on, where none opens. Forced, on "
        f"the grid: without gaps at most {none[best]:.3f} deg, at {FREQUENCIES[best]:.0f} rad/s; with gaps "
        f"{gaps[best]:.3f} deg there and at most {gaps[at]:.3f} deg, at {FREQUENCIES[at]:.0f} rad/s; under "
        f"540 N m as without gaps, within {np.abs(closed - none).max():.0e} deg ({ASSUMED}).",
    )


def main_masses() -> Claim:
    """How far the whole motion of each mass changes with the width of the gaps."""
    over = np.array([ratios(width) for width in WIDTHS])
    least, most = over.min(axis=0), over.max(axis=0)
    change = np.maximum(1.0 - least, most - 1.0)
    others = range(FIRST + 1, LAST)
    calmer = [NAMES[k] for k in others if change[k] < max(change[FIRST], change[LAST])]
    wildest = max(others, key=change.__getitem__)
    flywheel, track = (f"{least[k]:.2f} to {most[k]:.2f}" for k in (FIRST, LAST))
    also = f"; as calm as the flywheel: {', '.join(calmer)}" if calmer else ""
    return Claim(
        "6. The main (largest) masses are the most robust against wider gaps",
        Verdict.PARTLY if calmer else Verdict.CONFIRMED,
        f"Gaps of 0.25 to 4 times those of [R] change the whole motion of the flywheel to {flywheel} and of "
        f"the track to {track} times, that of {NAMES[wildest]} up to {most[wildest]:.2f} times{also} "
        f"({ASSUMED}).",
    )


def shapes_figure() -> Any:
    """The first free shape for gaps of several widths."""
    found = {width: neighbours(width)[0] for width in (0.0, 1.0, 2.0, 4.0)}
    labels = {0.0: "without gaps"} | {w: f"gaps {w:g} times those of [R]" for w in found if w}
    places = range(len(NAMES) - FIRST)
    shapes = {
        f"{labels[w]}: {run.Omega:.1f} rad/s": (places, normal(run)[FIRST:]) for w, run in found.items()
    }
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        title = "Shape of the first free vibration (assumed chain)"
        draw_lines(axes, shapes, title, "", "amplitude at the crank, track = 1", markers="o", levels=[0.0])
        axes.set_xticks(places, NAMES[FIRST:], rotation=30, ha="right")
        axes.legend()
    return figure
