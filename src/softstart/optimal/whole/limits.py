"""A linear program as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from softstart.optimal.whole.answer import Matrix, Vector


@dataclass(frozen=True, eq=False)
class Limits:
    """Minimise cost @ x subject to A_ub x <= b_ub, A_eq x = b_eq."""

    cost: Vector
    A_ub: Any
    b_ub: Vector
    A_eq: Any
    b_eq: Vector

    def solved(self, bounds: Matrix) -> Vector | None:
        """The best x within the bounds (columns, 2); None where there is none."""
        from scipy.optimize import linprog

        found = linprog(self.cost, self.A_ub, self.b_ub, self.A_eq, self.b_eq, bounds, method="highs-ds")
        return np.asarray(found.x) if found.status == 0 else None


class Gathered:
    """Limits and equations, gathered as sparse rows."""

    def __init__(self) -> None:
        self.matrices: list[Any] = []
        self.rights: list[Vector] = []

    def add(self, matrix: Any, right: Vector) -> None:
        self.matrices.append(matrix)
        self.rights.append(np.broadcast_to(right, (matrix.shape[0],)))

    def all(self, columns: int) -> tuple[Any, Vector]:
        if not self.matrices:
            return sparse.csr_array((0, columns)), np.zeros(0)
        return sparse.vstack(self.matrices).tocsr(), np.concatenate(self.rights)
