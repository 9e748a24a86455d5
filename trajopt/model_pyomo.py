"""Nonconvex models: Pyomo with Debian's Ipopt, in process through PyNumero. The only file that imports pyomo."""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np
import pyomo.environ as pyo
from pyomo.common.modeling import unique_component_name

from trajopt.along import Along, curved
from trajopt.curve import Curve
from trajopt.errors import MissingSolver
from trajopt.model import Claim, Floats, Outcome, Pair, Prices, finite_sides, own_size
from trajopt.signals import Smoothed

_OPTIONS: Final = {
    "tol": 1e-10,
    "constr_viol_tol": 1e-10,
    "compl_inf_tol": 1e-11,  # the default of 1e-4 leaves peaks 1e-5 too high
    "acceptable_tol": 1e-8,
    "bound_relax_factor": 0.0,  # the default lets variables leave their bounds by 1e-8
    "max_iter": 3000,
    "print_level": 0,
    "sb": "yes",
}
# Orderings of MUMPS, measured: with one dense column PORD takes 0.7 s where the default takes 51 s, and for a peak
# power half of AMD's time; for several axes AMD takes from 0.8 to a tenth of PORD's. SCOTCH is faster yet for a
# throw, but does not give the same bits twice.
_AMD, _PORD = 0, 4
RUNGS: Final[dict[str, dict[str, Any]]] = {  # other ways through the barrier: each may end in another local optimum
    "ipopt": {},
    "ipopt-adaptive": {"mu_strategy": "adaptive"},
    "ipopt-warm": {
        "mu_init": 1e-7, "bound_push": 1e-9, "bound_frac": 1e-9, "slack_bound_push": 1e-9, "slack_bound_frac": 1e-9,
    },
}  # fmt: skip
_BEYOND: Final = 0.02  # of its span: how far beyond a table Ipopt may look
ELEMENTWISE: Final = {"sin": np.frompyfunc(pyo.sin, 1, 1), "cos": np.frompyfunc(pyo.cos, 1, 1)}
_CLAIMS: Final = {  # all others, local infeasibility among them, are failures: they prove nothing
    0: Claim.OPTIMAL,
    1: Claim.OPTIMAL,  # acceptable, which is set to 1e-8
    -1: Claim.LIMIT,
    -4: Claim.LIMIT,
}


class NonconvexModel(Smoothed):
    """A nonlinear program under construction; see `trajopt.model.Model` for the meaning of the methods.
    ``coupled``: of several axes."""

    convex = False

    def __init__(self, coupled: bool = False) -> None:
        self._options = _OPTIONS | {"mumps_pivot_order": _AMD if coupled else _PORD}
        self._model = pyo.ConcreteModel()
        self._model.rows = pyo.ConstraintList()
        self._vectors: list[tuple[Any, Any, float]] = []
        self._asked: list[Any] = []  # rows, in the order of the calls; None where there is nothing to decide
        self._named: list[tuple[str, list[Any], float, Floats, Floats]] = []
        self._contradiction = ""
        self._curves: list[Along] = []
        self._initial: list[tuple[Any, Any]] = []
        self._nlp: Any = None

    def afresh(self) -> None:
        """Every variable as it was when this was called first: for another start of the same program."""
        self._initial = self._initial or [(x, x.value) for _, xs, _ in self._vectors for x in xs.values()]
        for variable, value in self._initial:
            variable.set_value(value, skip_validation=True)

    def vector(
        self, count: int, size: float, lower: Floats, upper: Floats, name: str = "", at: Any = None, origin: float = 0.0
    ) -> Any:
        def bounds(_: Any, k: int) -> tuple[float | None, float | None]:
            low, high = float(lower[k]) / size, float(upper[k]) / size
            return (low if np.isfinite(low) else None), (high if np.isfinite(high) else None)

        variables = pyo.Var(range(count), bounds=bounds)
        x = self._add(variables, count, size, name)
        if at is not None:
            self._bounded(variables, name, size, (lower, upper), at, origin)
        return x

    def variable(self, count: int) -> Any:
        return self._add(pyo.Var(range(count), initialize=1.0), count, 1.0)

    def _bounded(
        self, variables: Any, name: str, size: float, bounds: tuple[Floats, Floats], at: Floats, origin: float
    ) -> None:
        for side in finite_sides(*bounds, size)[0]:
            some = [variables[int(k)] for k in np.arange(len(at))[side.at]]
            own = own_size(side.limits + origin, size)
            self._named.append((f"{name}.{side.name}", some, size, at[side.at], own))

    def _add(self, variables: Any, count: int, size: float, name: str = "") -> Any:
        name = unique_component_name(self._model, name or "x")  # axes have variables of one name
        self._model.add_component(name, variables)
        x = np.empty(count, dtype=object)
        x[:] = [size * variables[k] for k in range(count)]
        self._vectors.append((x, variables, size))
        return x

    def start(self, x: Any, values: Floats) -> None:
        """Start Ipopt from these values (SI) of a vector of variables."""
        variables, size = next((v, s) for y, v, s in self._vectors if y is x)
        for k, value in enumerate(values):
            low, high = variables[k].bounds
            scaled = max(float(value) / size, -np.inf if low is None else low)
            variables[k].set_value(min(scaled, np.inf if high is None else high))

    def zero(self, residual: Any, size: float = 1.0) -> None:
        self._asked += [self._row(row, size, equality=True) for row in np.atleast_1d(residual)]

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", at: Any = None, own: Any = None) -> Any:
        rows = [self._row(row, size, equality=False) for row in np.atleast_1d(residual)]
        self._asked += rows
        if name and None not in rows:
            self._named.append((name, rows, size, at, own))

    def _row(self, row: Any, size: float, equality: bool) -> Any:
        if isinstance(row, float):  # nothing to decide: it holds or the problem contradicts itself
            if row > 1e-9 * size or (equality and row < -1e-9 * size):
                self._contradiction = f"a constant row is off by {row:g}"
            return None
        scaled = row * (1 / size)
        return self._model.rows.add(scaled == 0 if equality else scaled <= 0)

    def times(self, factor: Any, x: Any) -> Any:
        if isinstance(factor, np.ndarray) or isinstance(x, np.ndarray):
            return np.multiply(np.asarray(factor, dtype=object), np.asarray(x, dtype=object))
        return factor * x

    def concatenate(self, parts: list[Any]) -> Any:
        return np.concatenate(parts)

    def total(self, weights: Floats, x: Any) -> Any:
        plain = (float(w) if isinstance(w, float) else w for w in weights)  # pyomo is slow on numpy's floats
        return pyo.quicksum(w * y for w, y in zip(plain, x, strict=True))

    def squares(self, x: Any) -> Any:
        return x * x

    def magnitude(self, x: Any) -> Any:
        bound = self.variable(len(x))
        self.nonpositive(x - bound)
        self.nonpositive(-x - bound)
        return bound

    def at_least_length(self, bound: Any, x: Any, weights: Floats) -> None:
        self.nonpositive(-bound)
        self.nonpositive(self.total(np.square(weights), x * x) - bound * bound)

    def along(self, position: Any, wanted: list[tuple[Curve, int]]) -> list[Any]:
        """Variables for derivatives of curves at positions, which Ipopt sees with their exact derivatives.

        The rows ``value - curve(position) = 0`` are written as ``value - position = 0``, and put right by
        `trajopt.along.curved`. Positions keep within the tables, or a little beyond.
        """
        low, high = max(c.span[0] for c, _ in wanted), min(c.span[1] for c, _ in wanted)
        reach = (high - low) * _BEYOND
        count, span = len(position), high - low
        x = self.vector(count, span, np.full(count, low - reach), np.full(count, high + reach))
        for row in position - x:
            self._row(row, span, equality=True)
        found: list[Any] = []
        for curve, order in wanted:
            rows = np.array(curve.position)
            least = np.max(np.abs(curve.value)) / span**order  # the slope of what hardly varies is rounding
            size = float(max(np.max(np.abs(curve.at(rows, order))), least)) or 1.0
            y = self.vector(count, size, np.full(count, -np.inf), np.full(count, np.inf))
            lines = [self._row(row, 1.0, equality=True) for row in y * (1 / size) - x * (1 / span)]
            self._curves.append(Along(curve, order, position, self._vectors[-len(found) - 2], self._vectors[-1], lines))
            found.append(y)
        return found

    def minimize(self, value: Any) -> None:
        self._model.objective = pyo.Objective(expr=value)

    def value(self, x: Any) -> Any:
        if isinstance(x, np.ndarray):
            return np.array([float(pyo.value(y)) for y in x])
        return float(pyo.value(x))

    def run(self, solver: str = "ipopt", seconds: float | None = None) -> Outcome:
        """Solve by Ipopt from the start given; a claim of a local optimum at best.

        Raises MissingSolver when Ipopt or its interface is not installed.
        """
        started = perf_counter()
        if self._contradiction:
            return Outcome(Claim.FAILED, self._contradiction)
        for along in self._curves:
            along.start(self.value(along.position))
        nlp, problem, deadline = self._interface(seconds)
        for option, setting in (self._options | RUNGS[solver]).items():
            problem.add_option(option, setting)
        x, info = problem.solve(np.array([x.value or 0.0 for x in nlp.get_pyomo_variables()]))
        status = int(info["status"])
        claim = Claim.LIMIT if deadline.passed else _CLAIMS.get(status, Claim.FAILED)
        message = info["status_msg"].decode().partition(":")[0].partition(" (")[0]
        for variable, value in zip(nlp.get_pyomo_variables(), x, strict=True):
            variable.set_value(float(value), skip_validation=True)
        seconds = perf_counter() - started
        value, prices, pair = float(info["obj_val"]), self._prices(nlp, info), self._pair(nlp, info["mult_g"])
        return Outcome(
            claim, message, value, deadline.iterations, seconds, read_prices=lambda: prices, read_pair=lambda: pair
        )

    def _prices(self, nlp: Any, info: Any) -> dict[str, Prices]:
        """The prices of named rows and bounds, from Ipopt's multipliers."""
        multipliers: dict[Any, float] = {
            id(row): m for row, m in zip(nlp.get_pyomo_constraints(), info["mult_g"], strict=True)
        }
        for side in ("mult_x_L", "mult_x_U"):
            multipliers |= {(id(v), side): m for v, m in zip(nlp.get_pyomo_variables(), info[side], strict=True)}
        found: dict[str, list[tuple[Floats, Floats, Floats]]] = {}
        for name, rows, size, at, own in self._named:
            side = "mult_x_L" if name.endswith("min") else "mult_x_U"
            values = [multipliers.get(id(row), multipliers.get((id(row), side), 0.0)) for row in rows]
            found.setdefault(name, []).append((at, np.array(values) / size, own))
        return {name: Prices(*map(np.concatenate, zip(*parts, strict=True))) for name, parts in found.items()}

    def _pair(self, nlp: Any, multipliers: Floats) -> Pair:
        """The vectors of `trajopt.model.Pair`, from Ipopt's multipliers and the values of the variables."""
        of_row = {id(row): m for row, m in zip(nlp.get_pyomo_constraints(), multipliers, strict=True)}
        dual = [of_row.get(id(row), 0.0) for row in self._asked]  # a row without variables has none
        inner = {id(variables) for along in self._curves for _, variables, _ in (along.x, along.y)}
        primal = [xs[k].value for _, xs, _ in self._vectors if id(xs) not in inner for k in xs]
        return Pair(np.array(primal, dtype=float), np.array(dual))

    def _interface(self, seconds: float | None) -> tuple[Any, Any, _Deadline]:
        """The program as PyNumero and cyipopt see it; written once. Raises MissingSolver."""
        from pyomo.contrib.pynumero.asl import AmplInterface

        library = Path(sys.prefix) / "lib" / "libpynumero_ASL.so"
        if library.exists():  # compiled into the environment by the set-up, where PyNumero does not look
            AmplInterface.libname = str(library)
        try:
            from pyomo.contrib.pynumero.interfaces.cyipopt_interface import CyIpoptNLP
            from pyomo.contrib.pynumero.interfaces.pyomo_nlp import PyomoNLP

            if self._nlp is None:
                curves = self._curves
                self._nlp = curved(PyomoNLP)(self._model, curves) if curves else PyomoNLP(self._model)
            self._nlp.set_obj_factor(1.0)  # as CyIpoptNLP takes it to be: else Hessians are those of the run before
            deadline = _Deadline(seconds)
            return self._nlp, CyIpoptNLP(self._nlp, intermediate_callback=deadline), deadline
        except (ImportError, RuntimeError) as error:
            raise MissingSolver(
                "Ipopt is not available: install Debian's coinor-libipopt-dev and libamplsolver-dev, then run 'make"
                f" demo' ({' '.join(str(error).split())[:200]})"
            ) from error


class _Deadline:
    """Ipopt's callback after each iteration: stops at a wall time, which Debian's Ipopt cannot do by itself."""

    def __init__(self, seconds: float | None) -> None:
        self._end = None if seconds is None else perf_counter() + seconds
        self.passed = False
        self.iterations = 0

    def __call__(self, _nlp: Any, _mode: int, iteration: int, *_: Any) -> bool:
        self.iterations = iteration
        self.passed = self._end is not None and perf_counter() > self._end
        return not self.passed
