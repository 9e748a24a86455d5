"""What a norm is here: one definition that measures floats and lowers to "a scalar and its constraints"."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Rows(Protocol):
    """What a norm may ask of a model. Expressions are opaque; ``x`` is a vector of them, of size about one."""

    def variable(self, count: int) -> Any:
        """A vector of ``count`` new free variables."""

    def nonpositive(self, residual: Any) -> Any:
        """Demand ``residual <= 0``, elementwise."""

    def concatenate(self, parts: list[Any]) -> Any:
        """One vector of several."""

    def total(self, weights: NDArray[np.float64], x: Any) -> Any:
        """The scalar Σ weights·x."""

    def squares(self, x: Any) -> Any:
        """The vector x²."""

    def at_least_length(self, bound: Any, x: Any, weights: NDArray[np.float64]) -> None:
        """Demand that the scalar ``bound`` is at least the Euclidean length of weights·x."""


class Norm:
    """Base of all norms. A subclass sets ``name`` and gives `measure` and `lower`.

    The samples ``x`` (n,) stand for a signal; ``weights`` (n,) are the fractions of the duration each sample stands
    for, so that a norm is a time integral and keeps its meaning when the mesh changes. A norm must be absolutely
    homogeneous: the builder hands over scaled samples and scales the result back.
    """

    name: str = ""
    strictly_convex: bool = False  # whether its optimum is unique; if not, a second solve breaks the tie

    def measure(self, x: NDArray[np.float64], weights: NDArray[np.float64], duration: float) -> float:
        """The value of the norm on floats."""
        raise NotImplementedError

    def lower(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        """A scalar expression that equals the norm at the optimum; its constraints go to ``model``."""
        raise NotImplementedError

    def lower_alone(self, model: Rows, x: Any, weights: NDArray[np.float64], duration: Any) -> Any:
        """An increasing function of the norm that is easier to minimise when it is the only term."""
        return self.lower(model, x, weights, duration)

    def alone(self, value: float) -> float:
        """That increasing function, on the value of the norm."""
        return value

    def value_alone(self, value: float) -> float:
        """The norm, from the value of `lower_alone`: the inverse of `alone`."""
        return value

    def __repr__(self) -> str:
        return f"<norm {self.name}>"
