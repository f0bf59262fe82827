"""Free vibration of the tractor-like chain with its gaps: findings 1 to 4 and 6 of [R]."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.chain import Chain
from softstart.study import Table
from softstart_studies.paper_r.last_bits import natural_vibration
from softstart_studies.paper_r.motion import Motion, moved, released
from softstart_studies.paper_r.vibration_with_gaps import chain_backbone

__all__ = [
    "Free",
    "analysed",
    "backbone_table",
    "free",
    "node_table",
    "placed",
    "scale_gaps",
    "single_gap",
    "tractor",
]

Vector = NDArray[np.float64]

NOSE = 2.0  # deg: resonance amplitude at the crank nose that [R] measured; the vibration is released with it
CYCLES, SAMPLES = 60, 64  # periods of the gap-free first mode, and samples in each


def tractor() -> Chain:
    """The tractor-like chain in first gear: inertias and stiffnesses assumed, gaps and ratios of [R]."""
    return Chain.load("tractor-like")


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
    """A free vibration: main frequency (rad/s), its shape, the largest shaft torques, and the other lines.

    The main frequency is that of the motion along the gap-free shape. `shape` holds the amplitudes of the
    masses there, in rad at the motor shaft, signed by their phase; `amplitude` the root mean square of the
    whole motion of each mass, times sqrt(2). `lines` are the strongest other spectral lines of the twist
    between motor and load: (rad/s, share of the main one). `drift` is what the energy changes, as a share.
    """

    chain: Chain
    motion: Motion
    Omega: float
    shape: Vector
    amplitude: Vector
    torque: Vector
    lines: tuple[tuple[float, float], ...]
    drift: float


@lru_cache(maxsize=64)
def free(chain: Chain, mode: int = 1, nose: float = NOSE) -> Free:
    """Released from rest with the shaft torques of a mode of the gap-free chain, as [R] has it in fig. 3.

    The scale: the crank nose has the amplitude `nose` (deg) in the gap-free first mode; another mode gets the
    same elastic energy.
    """
    vibration = natural_vibration(chain)
    arrays = chain.at_motor_shaft()
    first = vibration.torque[1] / abs(vibration.shape[1, 0]) * np.radians(nose)
    torques = vibration.torque[mode]
    energy = [float(T**2 @ (1.0 / arrays.c)) for T in (first, torques)]
    torques = torques * np.sqrt(energy[0] / energy[1])
    w = float(vibration.Omega[mode])
    sample = 2.0 * np.pi / w / SAMPLES
    motion = moved(chain, released(chain, torques), CYCLES * SAMPLES * sample, sample)
    return analysed(chain, motion, mode)


def analysed(chain: Chain, motion: Motion, mode: int = 1) -> Free:
    """What a recorded motion is, against a mode of the gap-free chain."""
    arrays = chain.at_motor_shaft()
    vibration = natural_vibration(chain)
    w = float(vibration.Omega[mode])
    angles = motion.about_the_mean(arrays.J)
    along = angles @ (arrays.J * vibration.shape[mode])
    along = along - along.mean()
    between = slice(min(arrays.motor, arrays.load), max(arrays.motor, arrays.load))
    whole = motion.twist[:, between].sum(axis=1)
    window = np.hanning(motion.t.size)
    window /= window.sum()
    frequencies = np.arange(0.05, 4.0, 0.002) * w
    spectrum = np.abs(_lines(along * window, motion.t, frequencies))
    near = (frequencies > (0.2 if mode == 1 else 0.5) * w) & (frequencies < 1.15 * w)
    main = _refined(along * window, motion.t, float(frequencies[near][np.argmax(spectrum[near])]))
    at_main = np.array([main])
    towards = _lines(along * window, motion.t, at_main)[0]
    phasors = _lines(angles * window[:, None], motion.t, at_main)[0]
    shape = 2.0 * np.real(phasors * np.conj(towards)) / abs(towards)
    spectrum = np.abs(_lines((whole - whole.mean()) * window, motion.t, frequencies))
    spectrum /= np.abs(_lines(whole * window, motion.t, at_main)[0])
    energy = 0.5 * (motion.w**2 @ arrays.J) + 0.5 * (motion.torque**2 @ (1.0 / arrays.c))
    return Free(
        chain,
        motion,
        main,
        shape,
        np.sqrt(2.0 * np.mean(angles[:-1] ** 2, axis=0)),
        np.abs(motion.torque).max(axis=0),
        _peaks(frequencies, spectrum, main),
        float(np.ptp(energy) / energy[0]),
    )


def _lines(signals: Vector, t: Vector, frequencies: Vector) -> NDArray[np.complex128]:
    return np.asarray(np.exp(-1j * np.outer(frequencies, t)) @ signals)


def _refined(signal: Vector, t: Vector, guess: float) -> float:
    """The frequency of the line, where its amplitude is largest."""
    from scipy.optimize import minimize_scalar

    width = 2.0 * np.pi / t[-1]
    found = minimize_scalar(
        lambda w: -float(np.abs(_lines(signal, t, np.array([w]))[0])),
        bounds=(guess - width, guess + width),
        method="bounded",
        options={"xatol": 1e-6 * guess},
    )
    return float(found.x)


def _peaks(frequencies: Vector, spectrum: Vector, main: float) -> tuple[tuple[float, float], ...]:
    inner = (spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] >= spectrum[2:])
    found = [
        (float(frequencies[i + 1]), float(spectrum[i + 1]))
        for i in np.flatnonzero(inner)
        if abs(frequencies[i + 1] - main) > 0.1 * main
    ]
    return tuple(sorted(found, key=lambda line: -line[1])[:4])


class Placed(NamedTuple):
    """A single gap in shaft k: the share of the mode's largest torque there, and w/Omega with it."""

    shaft: int
    torque: float
    node: bool
    frequency: float


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


def node_table() -> Table:
    """Where a gap lowers the frequency most."""
    names = [mass.name for mass in tractor().masses]
    rows = [
        (
            mode,
            f"{names[p.shaft]} - {names[p.shaft + 1]}",
            "yes" if p.node else "no",
            round(p.torque, 4),
            round(p.frequency, 4),
        )
        for mode in (1, 2)
        for p in placed(mode)
    ]
    return Table(
        "One gap of 0.05 rad at the crank, in each section in turn, same energy (assumed chain)",
        ("mode", "section", "node in it", "torque of the mode there, of its largest", "w/Omega"),
        rows,
    )


def backbone_table() -> Table:
    """Frequency against amplitude: the chain with all its gaps, and its two masses by the exact formula."""
    vibration = natural_vibration(tractor())
    per_nose = float(np.abs(vibration.torque[1]).max() / abs(vibration.shape[1, 0]))
    noses = (0.5, 1.0, 2.0, 4.0, 8.0)
    found = chain_backbone(tractor(), per_nose * np.radians(noses))
    columns = (found.torque, found.frequency / found.Omega, found.two_masses / found.Omega)
    rows = [
        (nose, round(torque, 1), round(chain, 4), round(exact, 4))
        for nose, torque, chain, exact in zip(noses, *(column.tolist() for column in columns), strict=True)
    ]
    return Table(
        "Backbone: frequency of the free vibration with all gaps (assumed chain)",
        (
            "nose amplitude, deg",
            "largest torque at release, N m",
            "chain: w/Omega",
            "two masses, exact: w/Omega",
        ),
        rows,
    )
