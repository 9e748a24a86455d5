"""Curves over position in a nonlinear program: rows that PyNumero evaluates with exact derivatives.

A spline has no expression without branches. Pyomo is given straight lines in its place, and the program that Ipopt sees
is put right here: values, Jacobian and Hessian. So any table will do, and the rows stay few: a polynomial of the same
accuracy would be an expression of dozens of terms at every sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.curve import Curve
from trajopt.model import Floats


@dataclass(frozen=True)
class Along:
    """A derivative of a curve at positions: the expressions of these, their variables and those of the values, each
    with its size, and the rows that say so."""

    curve: Curve
    order: int
    position: Any
    x: tuple[Any, Any, float]
    y: tuple[Any, Any, float]
    rows: list[Any]

    def start(self, at: Floats) -> None:
        """Have Ipopt start at positions, and at the values there."""
        (_, places, span), (_, values, size) = self.x, self.y
        for k, (q, value) in enumerate(zip(at, self.curve.at(at, self.order), strict=True)):
            low, high = places[k].bounds
            places[k].set_value(min(max(q / span, low), high))
            values[k].set_value(float(value) / size)

    def indices(self, nlp: Any) -> tuple[Any, Any]:
        """The numbers of the rows and of the variables of the positions."""
        places = self.x[1]
        rows = nlp.get_constraint_indices(self.rows)
        return np.array(rows), np.array(nlp.get_primal_indices([places[k] for k in range(len(self.rows))]))

    def scaled(self, x: Floats, more: int = 0) -> Floats:
        """The curve, or a derivative of it, as the rows have it."""
        span, size = self.x[2], self.y[2]
        return self.curve.at(x * span, self.order + more) * (span**more / size)


def curved(base: Any) -> Any:
    """A class of programs, derived from PyNumero's, in whose rows curves take the place of straight lines."""
    from scipy.sparse import coo_matrix

    class CurvedNLP(base):  # type: ignore[misc]
        def __init__(self, model: Any, curves: list[Along]) -> None:
            super().__init__(model)
            self._along = [(along, *along.indices(self)) for along in curves]
            self._in_rows = np.concatenate([rows for _, rows, _ in self._along])
            self._in_columns = np.concatenate([columns for _, _, columns in self._along])

        def _values(self, more: int) -> Floats:
            x = self.get_primals()
            return np.concatenate([along.scaled(x[columns], more) for along, _, columns in self._along])

        def evaluate_constraints(self, out: Any = None) -> Any:
            found = super().evaluate_constraints(out)
            np.add.at(found, self._in_rows, self.get_primals()[self._in_columns] - self._values(0))
            return found

        def evaluate_jacobian(self, out: Any = None) -> Any:
            return self._joined(super().evaluate_jacobian(), self._in_rows, 1 - self._values(1), out)

        def evaluate_hessian_lag(self, out: Any = None) -> Any:
            bent = -self.get_duals()[self._in_rows] * self._values(2)
            return self._joined(super().evaluate_hessian_lag(), self._in_columns, bent, out)

        def _joined(self, found: Any, rows: Any, values: Floats, out: Any) -> Any:
            data = np.concatenate([found.data, values])
            if out is not None:
                np.copyto(out.data, data)
                return out
            places = (np.concatenate([found.row, rows]), np.concatenate([found.col, self._in_columns]))
            return coo_matrix((data, places), shape=found.shape)

    return CurvedNLP
