"""The way of Clemen & Rupp: a Pyomo model for every weight, solved by Ipopt; here on the exact scheme."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pyomo.environ as pyo
from pyomo.contrib.pynumero.asl import AmplInterface

from bench.cases import ACCELERATION, DISTANCE, DURATION, JERK, MASS, VELOCITY
from bench.peers.casadi_opti import SIZES

AmplInterface.libname = str(Path(sys.prefix) / "lib" / "libpynumero_ASL.so")  # where the set-up compiles it


def mixture(energy: float, power: float, intervals: int) -> float:
    """min energy·E + power·(peak power), built and solved anew."""
    n, h, model = intervals, DURATION / intervals, pyo.ConcreteModel()
    model.k, model.i = pyo.RangeSet(0, n), pyo.RangeSet(0, n - 1)
    s = {"q": SIZES[0], "v": SIZES[1], "a": SIZES[2], "j": SIZES[3]}
    model.q = pyo.Var(model.k, initialize=lambda _, k: (k / n) ** 2 * (3 - 2 * k / n))
    model.v = pyo.Var(model.k, bounds=(VELOCITY[0] / s["v"], 1.0), initialize=0.5)
    model.a = pyo.Var(model.k, bounds=(-ACCELERATION / s["a"], 1.0), initialize=0.0)
    model.j = pyo.Var(model.i, bounds=(-JERK / s["j"], 1.0), initialize=0.0)
    model.e = pyo.Var(model.k, initialize=1.0)
    model.peak = pyo.Var(initialize=1.0)

    def chain(x: str, k: int) -> Any:
        return s[x] * getattr(model, x)[k]

    def taylor(x: str, rest: str, k: int) -> Any:
        terms = (h ** (r + 1) / (1, 2, 6)[r] * chain(y, k) for r, y in enumerate(rest))
        return (chain(x, k + 1) - chain(x, k) - sum(terms)) / s[x] == 0

    for x, rest in (("q", "vaj"), ("v", "aj"), ("a", "j")):
        setattr(model, f"d{x}", pyo.Constraint(model.i, rule=lambda _, k, x=x, rest=rest: taylor(x, rest, k)))
    ends = [("q", 0, 0.0), ("v", 0, 0.0), ("a", 0, 0.0), ("q", n, DISTANCE), ("v", n, 0.0), ("a", n, 0.0)]
    for x, k, value in ends:
        getattr(model, x)[k].fix(value / s[x])
    middle = pyo.RangeSet(1, n - 2)
    model.between = pyo.Constraint(middle, rule=lambda _, k: (
        VELOCITY[0], chain("v", k) + h / 2 * chain("a", k), VELOCITY[1]))  # fmt: skip
    for sign, name in ((1, "above"), (-1, "below")):
        drawn = lambda k, sign=sign: sign * MASS * chain("a", k) * chain("v", k)  # noqa: E731
        setattr(model, name, pyo.Constraint(model.k, rule=lambda _, k, p=drawn: p(k) <= model.e[k]))
        setattr(model, name + "_peak", pyo.Constraint(model.k, rule=lambda _, k, p=drawn: p(k) <= model.peak))
    total = sum((h / 2 if k in (0, n) else h) * model.e[k] for k in model.k)
    model.value = pyo.Objective(expr=energy * total + power * model.peak)
    solver = pyo.SolverFactory("cyipopt")
    solver.config.options = {"tol": 1e-9, "mumps_pivot_order": 4, "print_level": 0, "sb": "yes"}
    solver.solve(model)
    return float(pyo.value(model.value))
