"""L2, the root mean square: sqrt((1/T)∫x²dt) (Clemen & Rupp eq. 21)."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from norms.base import Norm, Rows


class L2(Norm):
    """sqrt((1/T)∫x²dt): the heating of a force, the RMS of a power."""

    name = "l2"
    strictly_convex = True

    def measure(self, x: NDArray[np.float64], weights: NDArray[np.float64], duration: float) -> float:
        return sqrt(weights @ np.square(x))

    def lower(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        bound = model.variable(1)[0]  # an epigraph, since the square root has no derivative at zero
        model.at_least_length(bound, x, np.sqrt(weights))
        return bound

    def lower_alone(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        return model.total(weights, model.squares(x))

    def alone(self, value: float) -> float:
        return value**2

    def value_alone(self, value: float) -> float:
        return sqrt(max(value, 0.0))
