"""The array types of the project, whose sizes and meaning stand where they are used; their plain data."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]  # one dimension, or one quantity of any shape
Matrix = NDArray[np.float64]  # two dimensions
Complex = NDArray[np.complex128]
Indices = NDArray[np.intp]


def plain_fields(of: Any, *but: str) -> dict[str, Any]:
    """The fields of a dataclass as plain data, arrays and tuples as lists, but for those named."""
    found = {field.name: getattr(of, field.name) for field in fields(of) if field.name not in but}
    for name, value in found.items():
        if isinstance(value, np.ndarray | tuple):
            found[name] = value.tolist() if isinstance(value, np.ndarray) else list(value)
    return found
