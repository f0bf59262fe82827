"""What is raised when no solution comes out."""

from __future__ import annotations


class NotConverged(RuntimeError):  # noqa: N818 - the name says what happened
    """IPOPT found no solution: `reason` is its own word, `violation` the largest violated constraint.

    `violation` is relative to the units of the problem (Ms, target speed, start time). A large one speaks for
    a problem without solution, a small one for a search that lost its way.
    """

    def __init__(self, reason: str, violation: float, final: bool = False) -> None:
        self.reason, self.violation = reason, violation
        self.final = final  # no other first guess is worth trying
        super().__init__(
            f"collocation: {reason} (largest violated constraint {violation:.2g} of the drive's own units)."
        )
