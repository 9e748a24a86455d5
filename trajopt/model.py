"""What a model must offer so that one constraint builder serves all: residuals, never comparisons.

A model is short-lived: built by `trajopt.transcribe`, solved, and gone. Expressions are opaque to the builder;
they support ``+``, ``-``, slices, and products with a scalar. All other operations go through the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from norms import Rows

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


class Claim(Enum):
    """What a solver says of its own work; a claim, never an answer."""

    OPTIMAL = "optimal"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    LIMIT = "limit"
    FAILED = "failed"


@dataclass(frozen=True)
class Prices:
    """The multipliers of the rows of one side of a limit: ``at`` (n,) fractions of the duration, ``per_unit`` (n,) the
    change of the objective per SI unit by which the limit gives way there, ``own`` (n,) the limit itself (see
    `own_size`)."""

    at: Floats
    per_unit: Floats
    own: Floats


@dataclass(frozen=True)
class Pair:
    """The primal and dual vector of an answer, for `trajopt.lagrangian`: the variables, and the multipliers of the
    rows, that the builder asked for, in that order; bounds of variables left out."""

    primal: Floats
    dual: Floats


@dataclass(frozen=True)
class Outcome:
    """The end of one solver run: its claim, its own word for it, objective value, iterations and seconds."""

    claim: Claim
    raw_status: str
    value: float = np.nan
    iterations: int = 0
    seconds: float = 0.0
    bound: float = -np.inf  # lower bound on ``value``, recomputed by us from the duals; -inf where there is none
    forgiven: float = 0.0  # what the check lets pass in the rows, times multipliers: a bound may lie so far above
    read_prices: Callable[[], dict[str, Prices]] = field(default=dict, repr=False)  # many a run is never asked for them
    read_pair: Callable[[], Pair | None] = field(default=lambda: None, repr=False)
    solver: str = ""  # of a convex program: the one of several that this is the end of
    proof: float = 0.0  # s, of ``seconds``, that our own bound took

    @cached_property
    def prices(self) -> dict[str, Prices]:
        """The prices of named rows."""
        return self.read_prices()

    @cached_property
    def pair(self) -> Pair | None:
        """The primal and dual vector."""
        return self.read_pair()


class Model(Rows, Protocol):
    """The builder's view of a backend."""

    convex: bool

    def vector(
        self, count: int, size: float, lower: Floats, upper: Floats, name: str = "", at: Any = None, origin: float = 0.0
    ) -> Any:
        """(count,) variables of the given size, with bounds (infinite where none) known to the solver as bounds.

        ``name``, ``at`` (count,) fractions of the duration and ``origin``, to which the limits as stated add up with
        the bounds, are for their prices."""

    def zero(self, residual: Any, size: float = 1.0) -> None:
        """Demand ``residual == 0``; ``size`` scales the row."""

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", at: Any = None, own: Any = None) -> Any:
        """Demand ``residual <= 0``; rows with a name have prices, at fractions ``at`` of the duration."""

    def times(self, factor: Any, x: Any) -> Any:
        """The elementwise product of a constant (scalar or vector), or in a nonconvex model any expression, and x."""

    def magnitude(self, x: Any) -> Any:
        """|x| or, in a nonconvex model, variables that are at least that: for what is pressed down."""

    def minimize(self, value: Any) -> None:
        """Set the objective, a scalar of size about one."""

    def value(self, x: Any) -> Floats:
        """The floats of an expression after a run."""

    def run(self, solver: str, seconds: float | None = None) -> Outcome:
        """Hand the program, now complete, to a solver, or to a further one where the first failed. Never raises for a
        failed solve; raises MissingSolver."""


def own_size(bound: Floats, size: float) -> Floats:
    """What a limit is measured in when widened or priced: its own value, or the signal's size where it is zero."""
    return np.abs(bound) if np.all(bound) else np.full(len(bound), size)


@dataclass(frozen=True)
class Side:
    """Where one side of a limit is finite: ``name``, min or max; ``sign``, -1 or 1; ``at``, a slice or indices; and the
    limits there."""

    name: str
    sign: float
    at: Any
    limits: Floats


def finite_sides(lower: Floats, upper: Floats, size: float) -> tuple[list[Side], float]:
    """The sides of a limit that are finite somewhere, and what divides the rows of both: the size of the signal, or the
    limit where that is larger."""
    found = []
    for name, sign, bound in (("min", -1.0, lower), ("max", 1.0, upper)):
        at: Any = np.flatnonzero(np.isfinite(bound))
        if not len(at):
            continue
        if at[-1] - at[0] == len(at) - 1:
            at = slice(int(at[0]), int(at[-1]) + 1)
        found.append(Side(name, sign, at, bound[at]))
        size = max(size, float(np.abs(found[-1].limits).max()))
    return found, size
