"""What was identified: values with intervals, what the logs cannot tell, drives that they leave possible."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Matrix, Vector, plain_fields
from softstart.chain.machines import machine_table
from softstart.drive import FRICTIONS as OF_TWO
from softstart.drive import PARAMETERS, Drive
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError
from softstart.identification.logs import Log
from softstart.input.files import read_text, write_whole
from softstart.quantities import RefusedError
from softstart.results import Result
from softstart.start.comparison import INTERVAL

FRICTIONS: Final[tuple[str, ...]] = (*OF_TWO, "load_friction")  # what may be 0
AT_LIMIT = "at the limit of the search"  # the reason of an estimate that is no answer of the logs
WIDEST = 3.0  # upper over lower end of an interval: beyond it a parameter is called unknown
FORMAT = 1  # of the file
FILE, DRIVE_FILE = "identification.json", "drive.toml"  # in the folder of an identification


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value, its interval of 95 %, and whether the logs tell it.

    >>> Estimate("gap", 0.08, 0.079, 0.081, known=True).half_width
    0.0125...
    """

    name: str  # of the drive, or "position" of a log, from -1 (opposite flank) to 1 (driving flank)
    value: float  # SI; of what is unknown that at which the search ended
    lower: float  # NaN where no interval is stated
    upper: float
    known: bool  # whether upper/lower < 3 (of a friction, known within a tenth of the accelerating torque)
    reason: str = ""  # why it is not known

    @property
    def half_width(self) -> float:
        """Half the interval over the value, as a share; infinite if the value is 0."""
        return 0.5 * (self.upper - self.lower) / abs(self.value) if self.value else math.inf

    def moved(self, shares: ArrayLike) -> Vector:
        """Values so many half intervals away: 1 is the end further from 0, -1 the other end, by logarithms.

        None is more than a factor of 3 off: what is unknown is left that far. Frictions, which may be 0, move
        in proportion, from 0 to two half intervals above the value.

        >>> Estimate("gap", 0.08, 0.076, 0.085, known=True).moved([-1.0, 0.0, 1.0]).round(4).tolist()
        [0.076, 0.08, 0.085]
        >>> Estimate("motor_friction", 0.2, 0.0, 0.5, known=True).moved([-2.0, 0.0, 1.0]).tolist()
        [0.0, 0.2, 0.5]
        """
        steps_asked = np.asarray(shares, dtype=np.float64)
        if self.name in FRICTIONS:
            sides = np.where(steps_asked > 0.0, self.upper - self.value, self.value - self.lower)
            return np.asarray(np.maximum(self.value + sides * np.minimum(steps_asked, 2.0), 0.0))
        near, far = sorted((abs(self.lower), abs(self.upper)))
        size = abs(self.value)
        steps = np.where(steps_asked > 0.0, math.log(far / size), math.log(size / near)) * steps_asked
        return np.asarray(self.value * np.exp(np.clip(steps, -math.log(WIDEST), math.log(WIDEST))))


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result, view="identification.identification_sheet"):
    """A drive from its logs.

    Attributes
    ----------
    drive, guess : Drive
        The drive with the values found, and that from which the search began.
    logs, residuals : tuple
        The logs, in the order given, and model minus log in their units; none if it was loaded.
    estimates : tuple
        Of each parameter that was free, then of the position of each log: name, value, lower and upper end
        of the interval of 95 %, known, reason.
    correlations : array of shape (k, k)
        Of the logarithms of the estimates (of positions and frictions themselves).
    ripple : float
        Standard deviation of the torque error in each sample, N m.
    searches, agreed : int
        How many searches were made, and how many of them ended at the best minimum.
    notes : tuple of str
        What was done to the logs, what they show that the model has not, what cannot be known.

    Examples
    --------
    >>> from softstart import identify
    >>> from softstart.identification.planning import simulated_log
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> found = identify(simulated_log(crane, "two levels, then reverse", ripple=1.0), crane, searches=2)
    >>> [one.name for one in found.estimates if not one.known]
    []
    """

    drive: Drive
    guess: Drive
    logs: tuple[Log, ...]
    estimates: tuple[Estimate, ...]
    correlations: Matrix
    ripple: float
    searches: int
    agreed: int
    notes: tuple[str, ...]
    residuals: tuple[Vector, ...]

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter."""
        return next(estimate for estimate in self.estimates if estimate.name == name)

    @property
    def shared(self) -> tuple[Estimate, ...]:
        """The estimates of the drive, without the positions of the logs."""
        return tuple(estimate for estimate in self.estimates if estimate.name in PARAMETERS)

    @property
    def stated(self) -> bool:
        """Whether intervals are stated: not where the drive does not explain the logs."""
        return all(math.isfinite(estimate.upper - estimate.lower) for estimate in self.estimates)

    def draws(self, count: int = 200, seed: int = 0) -> MachineTable:
        """Drives that the logs leave possible, drawn from the joint distribution of the estimates."""
        if not self.stated:
            raise InputError(
                f"{self.drive.name}: its identification has no confidence intervals ({self.notes[0]}) Use "
                f"{DRIVE_FILE} alone, as a drive without intervals."
            )
        rows = [i for i, one in enumerate(self.estimates) if one.name in PARAMETERS]
        values, vectors = np.linalg.eigh(self.correlations[np.ix_(rows, rows)])
        normal = np.random.default_rng(seed).standard_normal((count, len(rows)))
        moves = normal @ (vectors * np.sqrt(np.maximum(values, 0.0))).T / INTERVAL.quantile
        moved = {one.name: one.moved(move) for one, move in zip(self.shared, moves.T, strict=True)}
        return machine_table(self.drive, **moved)

    def with_settings(self, settings: Iterable[str]) -> Self:
        """The identification with other parameters of its drive, as typed at a command line.

        What was identified stays: a value of one's own has no interval.
        """
        texts = list(settings)
        changed = replace(self, drive=self.drive.with_settings(texts)) if texts else self
        changed._check(f"--set {', '.join(texts)}")
        return changed

    def _check(self, where: str) -> None:
        for estimate in self.shared:
            if (value := float(getattr(self.drive, estimate.name))) != estimate.value:
                raise InputError(
                    f"{where}: {PARAMETERS[estimate.name].path} = {value:.6g}, but it was identified as "
                    f"{estimate.value:.6g} ({estimate.lower:.6g} to {estimate.upper:.6g}); leave it as it "
                    f"is, or use {DRIVE_FILE} alone, as a drive without intervals."
                )

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `drive.toml` and `identification.json`, which `load` reads, into a folder."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        text = json.dumps({"format": FORMAT, "guess": self.guess.to_toml()} | self.summary(), indent=2)
        write_whole(Path(folder) / DRIVE_FILE, lambda stream: stream.write(self.drive.to_toml()))
        write_whole(Path(folder) / FILE, lambda stream: stream.write(text + "\n"))

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """The identification of a folder that `softstart identify --out` or `save` wrote.

        The drive is that of `drive.toml`, to which limits and all that was not identified may be added; what
        was identified, with intervals and correlations, is in `identification.json`. The logs are not kept.

        >>> Identification.load("nowhere")
        Traceback (most recent call last):
        softstart.errors.InputError: nowhere/identification.json: there is no such file; name a folder that
        softstart identify --out has written.
        """
        path = Path(folder) / FILE
        try:
            kept = json.loads(read_text(path))
            if kept["format"] != FORMAT:
                raise ValueError(f"it is not of the format {FORMAT}")
            keys = [field.name for field in fields(Estimate)]
            estimates = tuple(
                Estimate(**{key: _or_nan(one[key]) for key in keys}) for one in kept["estimates"]
            )
            guess = Drive.from_toml(kept["guess"], where=f"{path}, guess")
            found = cls(
                drive=Drive.load(Path(folder) / DRIVE_FILE), guess=guess, logs=(), estimates=estimates,
                correlations=np.array(kept["correlations"], dtype=np.float64), ripple=float(kept["ripple"]),
                searches=int(kept["searches"]), agreed=int(kept["agreed"]),
                notes=tuple(map(str, kept["notes"])), residuals=(),
            )  # fmt: skip
        except RefusedError as refusal:
            reason = "name a folder that softstart identify --out has written"
            raise InputError(f"{path}: {refusal.reason}; {reason}.") from None
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise InputError(
                f"{path}: this is not what softstart identify wrote ({type(error).__name__}: {error}); "
                "identify the drive again."
            ) from None
        found._check(str(Path(folder) / DRIVE_FILE))
        return found

    def summary(self) -> dict[str, Any]:
        """Everything as numbers and words, for JSON."""
        estimates = []
        for one in self.estimates:
            ends = {} if self.stated else {"lower": None, "upper": None}
            percent = 100.0 * one.half_width if one.value and self.stated else None
            estimates.append(plain_fields(one) | ends | {"half_width_percent": percent})
        return {
            "drive": {name: value for name, value in self.drive.given().items() if name in PARAMETERS}
            | {"name": self.drive.name},
            "estimates": estimates,
            "correlations": self.correlations.tolist(),
            "ripple": self.ripple,
            "searches": self.searches,
            "agreed": self.agreed,
            "logs": [
                {"name": one.name, "samples": one.time.size, "kind": one.kind, "notes": list(one.notes)}
                for one in self.logs
            ],
            "notes": list(self.notes),
        }


def _or_nan(value: Any) -> Any:
    return math.nan if value is None else value
