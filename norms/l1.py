"""L1, the absolute norm: ∫|x|dt (Clemen & Rupp eq. 18 to 20)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from norms.base import Norm, Rows


class L1(Norm):
    """∫|x|dt: the distance of a velocity, the energy of a power."""

    name = "l1"

    def measure(self, x: NDArray[np.float64], weights: NDArray[np.float64], duration: float) -> float:
        return float(duration * (weights @ np.abs(x)))

    def lower(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        bound = model.variable(len(weights))
        model.nonpositive(x - bound)
        model.nonpositive(-x - bound)
        return duration * model.total(weights, bound)
