"""Solve one small problem through the whole chain: Pyomo, PyNumero's AMPL interface, cyipopt, Ipopt."""

import platform
import sys

import cyipopt
import pyomo.environ as pyo
from pyomo.contrib.pynumero.asl import AmplInterface

AmplInterface.libname = sys.prefix + "/lib/libpynumero_ASL.so"

m = pyo.ConcreteModel()
m.x = pyo.Var(initialize=1.0, bounds=(0.1, 10.0))
m.y = pyo.Var(initialize=1.0)
m.unit_product = pyo.Constraint(expr=m.x * m.y == 1.0)
m.cost = pyo.Objective(expr=m.x + 4.0 * m.y)

result = pyo.SolverFactory("cyipopt").solve(m, tee=False)
pyo.assert_optimal_termination(result)
if abs(pyo.value(m.x) - 2.0) > 1e-6:
    sys.exit(f"set-up: Ipopt answered x = {pyo.value(m.x)} where 2 is right")
version = ".".join(map(str, cyipopt.IPOPT_VERSION))
print(f"set-up: ready, with Ipopt {version} on Python {platform.python_version()}")
