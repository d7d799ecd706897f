"""Types of the arrays of the package."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Real numbers."""

ComplexArray = npt.NDArray[np.complexfloating]
"""Complex numbers."""

IntArray = npt.NDArray[np.int64]
"""Whole numbers."""

BoolArray = npt.NDArray[np.bool_]
"""Yes or no."""
