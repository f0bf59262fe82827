"""How long each shaft of a chain lasts that is started so: cycles of its torque, and their damage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softstart.arrays import Matrix
from softstart.chain.model import Chain
from softstart.drive import SNCurve
from softstart.errors import InputError
from softstart.start.fatigue import DEFAULT_SLOPE, STILL, life_ratio, miner, rainflow_cycles, read_slope
from softstart.start.metrics import REFERENCE
from softstart.start.run import Run
from softstart.start.simulation import simulate


@dataclass(frozen=True, eq=False)
class ShaftLife:
    """What one start does to one shaft of a chain. Torques are those at the motor shaft.

    Attributes
    ----------
    run : Run
        The start; of an unknown position the one that does most damage to this shaft.
    shaft : int
        The index of the shaft.
    turning_points : array of shape (n, 2)
        Time, s, and torque, N m, at the reversals of its torque and at both ends, located.
    spectrum : array of shape (k, 3)
        Range and mean, N m, and number of the rainflow cycles of one start, the largest first.
    equivalent_torque : float
        Damage-equivalent torque, N m: one cycle of it from 0 and back in each start does the same damage.
    relative : float
        Life of this shaft over its life under `direct`.
    used : float
        Largest torque over the permissible one of the shaft; NaN where none is given.
    """

    run: Run
    shaft: int
    turning_points: Matrix
    spectrum: Matrix
    equivalent_torque: float
    relative: float
    used: float

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        return {
            "controller": self.run.controller_name,
            "shaft": self.run.drive.shaft_names[self.shaft],
            "position": self.run.position,
            "k_dyn": float(self.run.k_dyns[self.shaft]),
            "peak_torque": float(self.run.peak_torques[self.shaft]),
            "equivalent_torque": self.equivalent_torque,
            "relative_life": self.relative,
            "utilisation": self.used,
            "cycles": float(self.spectrum[:, 2].sum()),
        }


@dataclass(frozen=True, eq=False)
class ChainFatigue:
    """Lives of the shafts of a chain under several strategies. It is returned by `chain_fatigue`.

    Attributes
    ----------
    chain : Chain
        The chain that is started.
    slope : float
        Slope m of the S-N curve of all shafts.
    slope_given : bool
        Whether it was asked for; else it is that of case-hardened gears.
    rows : tuple of tuple of ShaftLife
        For each run, in the order given, one for each shaft.

    Examples
    --------
    >>> from softstart import Chain, simulate
    >>> from softstart.chain import chain_fatigue
    >>> damped = {f"shaft[{k}].damping_ratio": 0.02 for k in (1, 2, 3)}
    >>> lives = chain_fatigue([simulate(Chain.load("crane-4-mass", also=damped), "direct")])
    >>> {life.relative for life in lives.rows[0]}
    {1.0}

    References
    ----------
    Rainflow counting: ASTM E1049; docs/fatigue.md.
    """

    chain: Chain
    slope: float
    slope_given: bool
    rows: tuple[tuple[ShaftLife, ...], ...]

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "chain": self.chain.name,
            "slope": self.slope,
            "slope_given": self.slope_given,
            "lives": [life.summary() for row in self.rows for life in row],
        }


def chain_fatigue(runs: Run | Sequence[Run], *, slope: float | None = None) -> ChainFatigue:
    """How long each shaft of a chain lasts under these starts, beside `direct`.

    As `fatigue` does for a drive, shaft by shaft: turning points of its torque are located, a start is
    repeated, cycles are counted by rainflow, and Miner's rule adds their damage. An S-N curve of a slope
    alone compares lives; each shaft with a permissible torque is held against it.

    Parameters
    ----------
    runs : Run or sequence of Run
        Starts of one chain, as `simulate` returns them.
    slope : float, optional
        Slope m of the S-N curve. By default 6.6, pitting of case-hardened gears after ISO 6336-2.

    Returns
    -------
    ChainFatigue
        A `ShaftLife` for each shaft of each run.

    Raises
    ------
    InputError
        For bad input, for a shaft without damping, whose rattling never ends, and for a rigid gap, whose
        impacts have no finite torque.

    Examples
    --------
    >>> from softstart import simulate
    >>> chain_fatigue(simulate("crane-4-mass", "ramp"))
    Traceback (most recent call last):
    softstart.errors.InputError: damping is missing in rotor - pinion, pinion - wheel shaft, ...

    References
    ----------
    ASTM E1049, rainflow counting; ISO 6336-2, life factors; docs/fatigue.md.
    """
    asked = [runs] if isinstance(runs, Run) else list(runs) if isinstance(runs, list | tuple) else []
    if not asked or not all(isinstance(one, Run) for one in asked):
        raise InputError("runs: give one Run or several, as simulate returns them for one chain.")
    chain = asked[0].drive
    if any(one.drive is not chain and one.drive != chain for one in asked):
        raise InputError("runs: these are starts of different chains; give those of one chain.")
    _check(chain)
    curve = SNCurve(DEFAULT_SLOPE if slope is None else read_slope(slope))
    direct = next((run for run in asked if run.controller_name == REFERENCE), None)
    reference = _counted(direct or simulate(chain, REFERENCE, fitted_to=asked[0].told), curve)
    rows = [
        tuple(
            ShaftLife(
                one, k, points, spectrum, float(curve.torque(1.0 / damage)) if damage > 0.0 else 0.0,
                life_ratio(reference[k][-1], damage), float(run.utilisation[k]),
            )
            for k, (one, points, spectrum, damage) in enumerate(_counted(run, curve))
        )
        for run in asked
    ]  # fmt: skip
    return ChainFatigue(chain, float(curve.slope or DEFAULT_SLOPE), slope is not None, tuple(rows))


def _check(chain: Chain) -> None:
    at, names = chain.at_motor_shaft(), chain.shaft_names
    rigid = [name for name, c, gap in zip(names, at.c, at.gap, strict=True) if math.isinf(c) and gap > 0.0]
    if rigid:
        raise InputError(
            f"stiffness is infinite in {', '.join(rigid)}: the impacts of a rigid gap have no finite torque, "
            "so that their damage cannot be counted; give these shafts a stiffness."
        )
    undamped = [name for name, c, d in zip(names, at.c, at.d, strict=True) if math.isfinite(c) and d == 0.0]
    if undamped:
        raise InputError(
            f"damping is missing in {', '.join(undamped)}: an undamped shaft rattles without end, and its "
            "cycles make lives out of nothing; give each shaft a damping or a damping_ratio."
        )


def _counted(run: Run, curve: SNCurve) -> list[tuple[Run, Matrix, Matrix, float]]:
    """Of each shaft the start, from whichever position, that does most damage; its cycles and the damage."""
    found = []
    each = list(run.positions.values()) or [run]
    turned = [shaft_turning_points(one) for one in each]
    for k in range(len(run.drive.shafts)):
        counted = []
        for one, points in zip(each, turned, strict=True):
            spectrum = rainflow_cycles(points[k][:, 1].tolist(), repeated=True)
            counted.append((one, points[k], spectrum, miner(spectrum, curve)))
        found.append(max(counted, key=lambda of: of[-1]))
    return found


def shaft_turning_points(run: Run) -> tuple[Matrix, ...]:
    """Times, s, and torques, N m at the motor shaft, where that of each shaft turns, and at both ends.

    Its extremes in a span are located. Where damping makes the torque jump at a contact, both sides count.

    >>> from softstart import simulate
    >>> run = simulate("crane-4-mass", "ramp", 0.1)
    >>> first, *_ = shaft_turning_points(run)
    >>> bool(abs(first[:, 1]).max() <= run.peak_torques[0] * (1.0 + 1e-9))
    True
    """
    return tuple(
        run.recorded.turning_points(k, STILL * float(peak)) for k, peak in enumerate(run.peak_torques)
    )
