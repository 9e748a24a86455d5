"""L∞, the peak: max|x| (Clemen & Rupp eq. 22 to 24)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from norms.base import Norm, Rows


class Linf(Norm):
    """max|x|: what a drive, a motor or a gear must be rated for."""

    name = "linf"

    def measure(self, x: NDArray[np.float64], weights: NDArray[np.float64], duration: float) -> float:
        return float(np.max(np.abs(x)))

    def lower(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        peak = model.variable(1)[0]
        model.nonpositive(x - peak)
        model.nonpositive(-x - peak)
        return peak
