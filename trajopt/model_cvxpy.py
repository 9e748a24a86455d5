"""Convex models: a program collected as rows of one sparse matrix (`trajopt.affine`), for `trajopt.convex_solvers`.

CVXPY's own canonicalisation arrives at the same program, and took ten times as long as solving it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any, Final

import numpy as np

from trajopt import certificate, convex_solvers
from trajopt.affine import NONE, Affine, in_cones, stacked
from trajopt.errors import MissingSolver
from trajopt.model import Claim, Floats, Integers, Outcome, Pair, Prices, finite_sides, own_size


class ConvexModel:
    """A convex program under construction; see `trajopt.model.Model` for the meaning of the methods."""

    convex = True

    def __init__(self) -> None:
        self._count = 0
        self._rows = {"equal": _Rows(), "below": _Rows(), "inside": _Rows()}  # of second-order cones, of these sizes
        self._sizes: list[int] = []
        self._asked: tuple[list[slice], list[tuple[str, slice]]] = [], []  # see `trajopt.model.Pair`
        self._names: dict[str, list[tuple[slice, float, Floats, Floats]]] = {}
        self._objective = Affine.of(0.0)
        self._constant = 0.0  # of the objective, which the program leaves out
        self._sums: dict[int, tuple[Affine, Affine]] = {}  # expressions with variables of their own, by identity
        self._answer: Floats | None = None

    def copied(self) -> ConvexModel:
        """A model with the same rows and variables so far, to be completed by itself."""
        twin = ConvexModel()
        twin._count, twin._sizes = self._count, [*self._sizes]
        twin._rows = {kind: _Rows([*rows.parts], rows.count) for kind, rows in self._rows.items()}
        twin._asked = [*self._asked[0]], [*self._asked[1]]
        twin._names = {name: [*rows] for name, rows in self._names.items()}
        return twin

    def vector(
        self, count: int, size: float, lower: Floats, upper: Floats, name: str = "", at: Any = None, origin: float = 0.0
    ) -> Any:
        x = self.variable(count) * size
        sides, row_size = finite_sides(lower, upper, size)
        for side in sides:
            key, where = (f"{name}.{side.name}", at[side.at]) if at is not None else ("", None)
            rows = Affine.each(x.columns[side.at], side.sign * size / row_size, side.limits * (-side.sign / row_size))
            self._below(rows, row_size, key, where, own_size(side.limits + origin, size))
        return x

    def variable(self, count: int) -> Affine:
        self._asked[0].append(slice(self._count, self._count + count))
        return self._unasked(count)

    def _add(self, kind: str, rows: Affine) -> slice:
        if "_stated" in self.__dict__:
            raise RuntimeError("rows cannot be added to a program that has been stated")
        return self._rows[kind].add(rows)

    def _unasked(self, count: int) -> Affine:
        self._count += count
        return Affine.variables(self._count - count, count)

    def zero(self, residual: Any, size: float = 1.0) -> None:
        self._asked[1].append(("equal", self._add("equal", Affine.of(residual) / size)))

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", at: Any = None, own: Any = None) -> None:
        self._asked[1].append(("below", self._below(Affine.of(residual) / size, size, name, at, own)))

    def _below(self, rows: Affine, size: float, name: str, at: Any, own: Any) -> slice:
        """Rows that have been divided by ``size``."""
        if rows.squares:  # bounded by variables: measured, with the cones on their own the duals are more exact
            bound = self._unasked(len(rows))
            self._add_cones(*in_cones(rows.convex - bound))
            rows = rows.affine + bound
        place = self._add("below", rows)
        if name:
            self._names.setdefault(name, []).append((place, size, at, own))
        return place

    def times(self, factor: Any, x: Any) -> Any:
        return factor * x

    def concatenate(self, parts: list[Any]) -> Affine:
        return stacked([Affine.of(part) for part in parts])

    def total(self, weights: Floats, x: Any) -> Any:
        return Affine.of(x).total(weights)

    def squares(self, x: Any) -> Affine:
        return Affine.of(x).squared()

    def magnitude(self, x: Any) -> Affine:
        bound = self.variable(len(x))
        self.nonpositive(x - bound)
        self.nonpositive(-x - bound)
        return bound

    def at_least_length(self, bound: Any, x: Any, weights: Floats) -> None:
        place = self._add_cones(stacked([Affine.of(bound), Affine.of(x) * weights]), [len(weights) + 1])
        self._asked[1].append(("inside", place))

    def _add_cones(self, inside: Affine, sizes: list[int]) -> slice:
        self._sizes += sizes
        return self._add("inside", inside)

    def minimize(self, value: Any) -> None:
        """Of the same rows, as often as one likes: only what brings rows of its own cannot follow a run."""
        value = Affine.of(value)
        self.__dict__.pop("program", None)
        self._objective = value.affine
        for _, weights, of in value.squares:
            if len(of.rows) > len(of):  # a sum of several gets a variable of its own: OSQP stalls without
                of = self._sum(of)
            self._objective = self._objective + of.squared().total(weights)

    def _sum(self, of: Affine) -> Affine:
        """Variables that equal expressions; the same ones for the same."""
        if id(of) not in self._sums:
            own = self._unasked(len(of))
            self._add("equal", of - own)
            self._sums[id(of)] = of, own
        return self._sums[id(of)][1]

    def value(self, x: Any) -> Floats:
        if not isinstance(x, Affine):
            return np.asarray(x, dtype=float)
        assert self._answer is not None
        return x.at(self._answer)

    @cached_property
    def program(self) -> certificate.ConeProgram:
        """All that has been asked for, as the solver sees it; without the constant of the objective."""
        P, q, self._constant = self._objective.quadratic(self._count)
        return certificate.ConeProgram(P, q, **self._stated)

    @cached_property
    def _stated(self) -> dict[str, Any]:
        """The rows, to which none can be added from then on."""
        opposite = _opposites(self._rows["below"].parts)
        equal, below, inside = self._rows.values()
        rows = stacked([*equal.parts, *below.parts, *(part * -1.0 for part in inside.parts)])
        for kind in self._rows.values():
            kind.parts = []  # the memory of large meshes
        return {
            "A": rows.matrix(self._count), "b": -rows.constant, "zero": equal.count, "nonnegative": below.count,
            "cones": tuple(self._sizes), "opposite": opposite,
        }  # fmt: skip

    def takes(self, solver: str) -> bool:
        """Whether a rung of LADDER or ``osqp`` is for programs of this kind."""
        return not self._sizes or solver.startswith("clarabel")

    def run(
        self, solver: str, seconds: float | None = None, gap: float = 0.0, above: float = np.inf, near: bool = False
    ) -> Outcome:
        """Solve by a rung of LADDER or ``osqp``. The claim is the solver's, but an infeasible one has been
        verified; the bound is recomputed from the duals, no closer than to a relative ``gap``, and without more effort
        where it lies ``above`` that value; a value that does not needs none then. ``near``: the answer of the last
        run, which kept the same rows, is probably close."""
        started, name, program = perf_counter(), solver.partition("-")[0], self.program
        if not self.takes(solver):
            return Outcome(Claim.FAILED, f"{solver} does not take cone programs")
        try:
            claim, status, iterations, x, z = convex_solvers.run(
                solver, program, seconds, self._answer if near else None
            )
        except ImportError as missing:
            raise MissingSolver(f"{name} is not installed; 'pip install {name}' or 'make demo' brings it") from missing
        solved = perf_counter()
        value, bound = np.nan, -np.inf
        late = seconds is not None and solved - started >= seconds
        if name == "piqp" and late:
            claim = Claim.LIMIT
        if claim is Claim.LIMIT and solver in convex_solvers.RESCUES and not late:  # its own, for which nobody asked
            claim, status = Claim.FAILED, "out of iterations"
        if claim is Claim.INFEASIBLE and not certificate.is_infeasible(program, z):
            claim, status = Claim.FAILED, f"{status}, by a proof that does not hold"
        if claim in (Claim.OPTIMAL, Claim.INACCURATE):
            self._answer, constant = x, self._constant
            value = program.value(x) + constant
            if value > above or (np.isinf(above) and np.isfinite(gap)):
                wanted = min(above, value - gap * abs(value)) - constant
                bound = certificate.lower_bound(program, x, z, wanted) + constant
        ended = perf_counter()
        with np.errstate(over="ignore"):  # of a run that came to nothing
            forgiven = _EXCESS * float(np.abs(z).sum())
        return Outcome(
            claim, status, value, iterations, ended - started, bound, forgiven,
            lambda: self._prices(z[program.zero :]), lambda: self._pair(x, z), name, ended - solved,
        )  # fmt: skip

    def _pair(self, x: Floats, z: Floats) -> Pair:
        """The vectors of `trajopt.model.Pair`, from those of the program."""
        first = dict(zip(self._rows, np.cumsum([0, *(rows.count for rows in self._rows.values())]), strict=False))
        variables, rows = self._asked
        places = [slice(first[kind] + place.start, first[kind] + place.stop) for kind, place in rows]
        return Pair(*(np.concatenate([np.empty(0), *(of[k] for k in at)]) for of, at in ((x, variables), (z, places))))

    def _prices(self, multipliers: Floats) -> dict[str, Prices]:
        """The prices of named rows, from the multipliers of inequalities."""
        with np.errstate(over="ignore"):  # of a limit absurdly small against the move
            return {
                name: Prices(
                    np.concatenate([at for _, _, at, _ in rows]),
                    np.concatenate([multipliers[place] / size for place, size, _, _ in rows]),
                    np.concatenate([own for _, _, _, own in rows]),
                )
                for name, rows in self._names.items()
            }


@dataclass
class _Rows:
    """Rows of one kind, and how many there have been."""

    parts: list[Affine] = field(default_factory=list)
    count: int = 0

    def add(self, rows: Affine) -> slice:
        self.parts.append(rows)
        self.count += len(rows)
        return slice(self.count - len(rows), self.count)


_EXCESS: Final = 1e-6  # of a row, which has size one: what a move that passes the check may exceed it by


def _opposites(parts: list[Affine]) -> tuple[Integers, Integers]:
    """(n,) rows of stacked parts, and (n,) those which, but for their constants, are their negatives: the two sides of
    a limit, one part after the other."""
    first, second, at = [NONE], [NONE], 0
    previous: Affine | None = None
    for part in parts:
        before, previous = previous, part
        if before is not None and _are_opposite(before, part):
            second.append(np.arange(at, at + len(part)))
            first.append(second[-1] - len(part))
            previous = None
        at += len(part)
    return np.concatenate(first), np.concatenate(second)


def _are_opposite(a: Affine, b: Affine) -> bool:
    return len(a) == len(b) and all(
        x is y or np.array_equal(x, y) for x, y in ((a.rows, b.rows), (a.columns, b.columns), (a.values, -b.values))
    )
