"""rockit: the same moves by its multiple shooting; a Runge-Kutta step is exact for jerk constant on an interval.

It holds limits at the nodes and not between them, so that it is compared where none is active there.
"""

from __future__ import annotations

from typing import Any

import rockit

from bench.cases import ACCELERATION, DISTANCE, DURATION, JERK, VELOCITY
from bench.peers.casadi_opti import OPTIONS, SIZES


def _stage(duration: Any, intervals: int) -> tuple[Any, ...]:
    ocp = rockit.Ocp(t0=0, T=duration)
    q, v, a = (ocp.state(scale=size) for size in SIZES[:3])
    j = ocp.control(scale=SIZES[3])
    for x, rate in ((q, v), (v, a), (a, j)):
        ocp.set_der(x, rate)
    for x, end in ((q, DISTANCE), (v, 0.0), (a, 0.0)):
        ocp.subject_to(ocp.at_t0(x) == 0)
        ocp.subject_to(ocp.at_tf(x) == end)
    for x, low, high in ((v, *VELOCITY), (a, -ACCELERATION, ACCELERATION), (j, -JERK, JERK)):
        ocp.subject_to(x >= low, include_first=x is j, include_last=False)
        ocp.subject_to(x <= high, include_first=x is j, include_last=False)
    ocp.solver("ipopt", {"print_time": False, "ipopt": OPTIONS})
    ocp.method(rockit.MultipleShooting(N=intervals, intg="rk"))
    return ocp, j


def least_jerk(intervals: int) -> float:
    """The least RMS of jerk, m/s³."""
    ocp, j = _stage(DURATION, intervals)
    ocp.add_objective(ocp.sum(j**2) / intervals)
    solution = ocp.solve()
    return float(solution.value(ocp.objective) ** 0.5)
