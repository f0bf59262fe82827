"""What was identified: values with intervals, what the logs cannot tell, and K_dyn with its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.drive import PARAMETERS, Drive
from softstart.identification.logs import Log
from softstart.late import late
from softstart.start.simulation import simulate

views = late("softstart.views.identification")  # above this module; see softstart.late
notebook = late("softstart.views.notebook")

CONFIDENCE = 0.95
WIDEST = 3.0  # upper over lower end of an interval: beyond it a parameter is called unknown
FEWEST_KNOWN = 0.9  # of the draws of a strategy's K_dyn that must end


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value, its interval of 95 %, and whether the logs tell it.

    Attributes
    ----------
    name : str
        The parameter of the drive, or "position" of a log, from -1 (opposite flank) to 1 (driving flank).
    value, lower, upper : float
        In SI. What is unknown has the value at which the search ended.
    known : bool
        False if the interval is wider than a factor of 3.
    by_profile : bool
        Whether the interval is where the fit gets worse, with all other parameters fitted anew, because its
        quadratic would mislead.
    reason : str
        Why it is unknown; else empty.

    Examples
    --------
    >>> Estimate("gap", 0.08, 0.079, 0.081, known=True).half_width
    0.0125...

    References
    ----------
    docs/identification.md.
    """

    name: str
    value: float
    lower: float
    upper: float
    known: bool
    by_profile: bool = False
    reason: str = ""

    @property
    def half_width(self) -> float:
        """Half the interval over the value, as a share."""
        return 0.5 * (self.upper - self.lower) / abs(self.value) if self.value else math.inf


@dataclass(frozen=True, eq=False)
class Identification:
    """A drive from its logs.

    Attributes
    ----------
    drive : Drive
        The drive with the values found; it stands wherever a drive does.
    guess : Drive
        The drive that the search began from.
    logs : tuple of Log
        The logs, in the order given.
    estimates : tuple of Estimate
        One for each parameter that was free, then the position of each log.
    correlations : array of shape (k, k)
        Of the logarithms of the estimates (of the positions themselves).
    ripple : float
        Standard deviation of the torque error in each sample, N m.
    searches, agreed : int
        How many searches were made, and how many of them ended at the best minimum.
    seconds : float
        What it took.
    notes : tuple of str
        What the logs show that the model has not, what was done to the logs, what cannot be known.

    Examples
    --------
    >>> from softstart import identify
    >>> from softstart.identification.planning import made_up_log
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> found = identify(made_up_log(crane, "two levels, then reverse", ripple=1.0), crane, searches=2)
    >>> [one.name for one in found.estimates if not one.known]
    []
    >>> abs(found.drive.gap / 0.08 - 1.0) < 0.05
    True

    References
    ----------
    docs/identification.md.
    """

    drive: Drive
    guess: Drive
    logs: tuple[Log, ...]
    estimates: tuple[Estimate, ...]
    correlations: Matrix
    ripple: float
    searches: int
    agreed: int
    seconds: float
    notes: tuple[str, ...]
    point: Vector  # where the search ended, in logarithms; the covariance there
    covariance: Matrix
    residuals: tuple[Vector, ...]  # of each log, in its own unit

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter."""
        return next(one for one in self.estimates if one.name == name)

    @property
    def shared(self) -> tuple[Estimate, ...]:
        """The estimates of the drive, without the positions of the logs."""
        return tuple(one for one in self.estimates if one.name in PARAMETERS)

    def draws(self, count: int = 200, seed: int = 0) -> Drive:
        """Drives that the logs leave possible: a batch, drawn from the joint distribution of the estimates.

        >>> from softstart import identify
        >>> from softstart.identification.planning import made_up_log
        >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
        >>> found = identify(made_up_log(crane, "two levels, then reverse", ripple=1.0), crane, searches=2)
        >>> found.draws(100).shape
        (100,)
        """
        generator = np.random.default_rng(seed)
        shared = self.shared
        size = len(shared)  # they stand first
        values, vectors = np.linalg.eigh(self.covariance[:size, :size])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        moves = np.clip(
            generator.standard_normal((count, size)) @ root.T, -math.log(WIDEST), math.log(WIDEST)
        )
        changes = {one.name: one.value * np.exp(moves[:, i]) for i, one in enumerate(shared)}
        return self.drive.replace(**changes)

    def k_dyn(
        self, controllers: Sequence[str], count: int = 200, seed: int = 0
    ) -> dict[str, tuple[float, float, float]]:
        """K_dyn of each strategy with its interval of 95 %: of the drive found, lower end, upper end.

        Each strategy is set up for the drive found and started on `draws`.
        """
        drives = self.draws(count, seed)
        found = {}
        for name in controllers:
            value = float(simulate(self.drive, name).k_dyn)
            starts: Any = simulate(drives, name, fitted_to=self.drive)
            each = np.asarray(starts["k_dyn"])
            ended = each[np.isfinite(each)]
            if ended.size < FEWEST_KNOWN * count:
                found[name] = (value, math.nan, math.nan)
                continue
            lower, upper = np.quantile(ended, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
            found[name] = (value, min(float(lower), value), max(float(upper), value))
        return found

    def summary(self) -> dict[str, Any]:
        """Everything as numbers and words, for JSON."""
        return {
            "drive": self.drive.given() | {"name": self.drive.name},
            "estimates": [
                {**vars(one), "half_width_percent": 100.0 * one.half_width} for one in self.estimates
            ],
            "correlations": self.correlations.tolist(),
            "ripple": self.ripple,
            "searches": self.searches,
            "agreed": self.agreed,
            "seconds": self.seconds,
            "logs": [
                {"name": one.name, "samples": one.time.size, "kind": one.kind, "notes": list(one.notes)}
                for one in self.logs
            ],
            "notes": list(self.notes),
        }

    def plot(self) -> Any:
        """The logs beside the start of the drive found, and what is left; a matplotlib figure."""
        return views.figure(self)

    def _repr_html_(self) -> str:
        return str(notebook.of_identification(self))
