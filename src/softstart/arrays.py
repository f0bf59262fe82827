"""The array types of the project; sizes and meaning stand where they are used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]  # one dimension, or one quantity of any shape
Matrix = NDArray[np.float64]  # two dimensions
Complex = NDArray[np.complex128]
