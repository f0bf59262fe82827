"""Two machines side by side under the same strategies, or one before and after wear: `side_by_side`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softstart.chain.machines import quantity_of, refuse_other_kind
from softstart.errors import InputError
from softstart.results import Result
from softstart.start.comparison import Comparison, as_far_as_known, compare, make_controllers
from softstart.start.demand import ControllerLike
from softstart.start.recommendation import Row


@dataclass(frozen=True, eq=False, repr=False)
class SideBySide(Result, view="beside.beside_sheet"):
    """The same strategies on two machines of one kind.

    Attributes
    ----------
    first, second : Comparison
        The strategies on each machine, one row each, in the same order.
    worn : bool
        Whether the second machine is the first one after wear: strategies are then set up for the first.

    Examples
    --------
    >>> from softstart import side_by_side
    >>> both = side_by_side("crane-4amtkf", worn_gap="2 rad", controllers=["direct", "ramp"])
    >>> [[round(row.run.k_dyn, 3) for row in pair] for pair in both.pairs]
    [[3.118, 4.865], [2.106, 3.643]]

    References
    ----------
    docs/howto/keep-a-project.md.
    """

    first: Comparison
    second: Comparison
    worn: bool = False

    @property
    def machines(self) -> tuple[Comparison, Comparison]:
        """Both comparisons."""
        return self.first, self.second

    @property
    def pairs(self) -> list[tuple[Row, Row]]:
        """The rows of each strategy, on the first and on the second machine."""
        others = {row.name: row for row in self.second.rows}
        return [(row, others[row.name]) for row in self.first.rows if row.name in others]

    def summary(self) -> dict[str, Any]:
        """Both comparisons as plain data."""
        return {"worn": self.worn, "first": self.first.summary(), "second": self.second.summary()}


def side_by_side(
    first: Any,
    second: Any = None,
    controllers: Sequence[ControllerLike] | None = None,
    *,
    worn_gap: float | str | None = None,
    **options: Any,
) -> SideBySide:
    """Compare strategies on two machines of one kind, or on one before and after wear.

    Parameters
    ----------
    first, second : Drive, Chain, Identification, DataSheet, str or path
        Two drives, or two chains. Each strategy is set up for the machine that it starts.
    controllers : sequence of str or Controller, optional
        As in `compare`.
    worn_gap : float or str, optional
        Instead of a second machine the first one with this gap, rad or with a unit; of a chain the sum of its
        gaps at the motor shaft. Strategies stay set up for the first.
    **options : values
        Further ones of `compare`: `parameters`, `until`, `worst_case`, `at_time`.

    Returns
    -------
    SideBySide
        Both comparisons, and the rows in pairs.

    Raises
    ------
    InputError
        Bad input; a drive beside a chain.
    SimulationError
        A start that cannot be finished.

    Examples
    --------
    >>> side_by_side("crane-4amtkf", "crane-4-mass", ["direct"])
    Traceback (most recent call last):
    softstart.errors.InputError: second = "Crane travel drive as a chain of four masses": it is a chain ...

    References
    ----------
    K_dyn: [G] (16).
    """
    machine = as_far_as_known(first, 1, "first")[0]
    if (second is None) == (worn_gap is None):
        raise InputError("second: give another machine or the gap after wear (worn_gap), one of the two.")
    if worn_gap is not None:
        gap, (own, inertia) = quantity_of(machine, "gap", worn_gap, "worn_gap"), machine.gap_and_inertia
        if not gap > own:
            reason = f"wear widens the gap; give one above that of the machine, {own:.6g} rad"
            raise InputError(f"worn_gap = {worn_gap}: {reason}.")
        second = machine.with_gap_and_inertia(gap, inertia)
    refuse_other_kind(machine, as_far_as_known(second, 1, "second")[0], "second")
    made = make_controllers(controllers, options.pop("parameters", None) or {})
    nominal = machine if worn_gap is not None else None
    return SideBySide(
        compare(first, made, **options),
        compare(second, made, **options, fitted_to=nominal),
        worn_gap is not None,
    )
