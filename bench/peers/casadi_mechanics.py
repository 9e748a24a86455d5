"""CasADi's Opti with Ipopt on what is nonlinear by itself: a throw, a crank, and a servomotor, on our meshes."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

import trajopt
from bench.peers.casadi_opti import OPTIONS
from problems import slider_crank
from trajopt.axes.starts import guesses
from trajopt.axes.transcription import AxesSetting


def _chain(opti: ca.Opti, order: int, n: int, h: float, sizes: list[float]) -> list[Any]:
    """Position and its derivatives, the top one constant on intervals, tied by their Taylor series."""
    chain = [size * opti.variable(n + (i < order)) for i, size in enumerate(sizes)]
    for i in range(order):
        step = sum(h**k / np.prod(range(1, k + 1)) * chain[i + k][:n] for k in range(1, order - i + 1))
        opti.subject_to((chain[i][1:] - chain[i][:-1] - step) / sizes[i] == 0)
    return chain


_OPTIONS = OPTIONS | {"mumps_pivot_order": 0}  # AMD, measured the fastest here


def _solved(opti: ca.Opti) -> float:
    opti.solver("ipopt", {"print_time": False, "error_on_fail": True}, _OPTIONS)
    return float(opti.solve().value(opti.f))


def throw(problem: trajopt.AxesProblem) -> float:
    """Half of each joint's peak power, W, from the first of our own guesses."""
    opti, setting = ca.Opti(), AxesSetting.of(problem)
    n, h, arm = setting.mesh.intervals, 1.0 / setting.mesh.intervals, problem.dynamics
    start = next(iter(guesses(problem))).chains(setting)
    axes = [_chain(opti, 3, n, h, [1.0, 10.0, 50.0, 100.0]) for _ in problem.axes]
    value: Any = 0.0
    q, w, a = ([axis[i] for axis in axes] for i in range(3))
    torque = _torque(arm, q, w, a)
    for k, (axis, guess) in enumerate(zip(axes, start, strict=True)):
        for x, known in zip(axis, guess, strict=True):
            opti.set_initial(x, known)
        opti.subject_to(ca.vertcat(axis[0][0], axis[1][0], axis[2][0]) == 0)
        opti.subject_to(opti.bounded(-np.pi, axis[0][1:], np.pi))
        opti.subject_to(opti.bounded(-100.0, axis[3], 100.0))
        peak, power = opti.variable(), torque[k] * axis[1]
        opti.subject_to(power <= peak)
        opti.subject_to(-power <= peak)
        opti.set_initial(peak, 400.0)
        value += 0.5 * peak
    (l1, l2), one, both = arm.lengths, q[0][-1], q[0][-1] + q[1][-1]
    opti.subject_to(-l1 * ca.sin(one) * w[0][-1] - l2 * ca.sin(both) * (w[0][-1] + w[1][-1]) == 0.0)
    opti.subject_to(l1 * ca.cos(one) * w[0][-1] + l2 * ca.cos(both) * (w[0][-1] + w[1][-1]) == 12.5)
    opti.minimize(value)
    return _solved(opti)


def _torque(arm: Any, q: Any, w: Any, a: Any) -> list[Any]:
    """scara.TwoLinkArm.torque on CasADi's expressions."""
    inertia1, inertia2, coupling = arm.constants
    c, s = coupling * ca.cos(q[1]), coupling * ca.sin(q[1])
    both = inertia2 + c
    return [
        (inertia1 + inertia2 + 2.0 * c) * a[0] + both * a[1] - s * (2.0 * w[0] * w[1] + w[1] * w[1]),
        both * a[0] + inertia2 * a[1] + s * w[0] * w[0],
    ]


def crank(n: int) -> float:
    """The least RMS torque of the slider-crank's half turn, N m: jerk constant on intervals, four Lobatto
    points an interval, the mechanism in closed form."""
    opti, h = ca.Opti(), slider_crank.DURATION / n
    q, v, a, j = _chain(opti, 3, n, h, [1.0, 50.0, 5000.0, 1e6])
    s, weights = np.array([0.0, 0.5 - 0.1 * 5**0.5, 0.5 + 0.1 * 5**0.5, 1.0]), np.array([1, 5, 5, 1]) / 12
    square: Any = 0.0
    for at, weight in zip(s * h, weights, strict=True):
        here = q[:-1] + at * v[:-1] + at**2 / 2 * a[:-1] + at**3 / 6 * j
        speed, rate = v[:-1] + at * a[:-1] + at**2 / 2 * j, a[:-1] + at * j
        torque = slider_crank.load_torque(here) + slider_crank.inertia(here) * rate
        torque += slider_crank.inertia_slope(here) * speed**2 / 2
        square += weight / n * ca.sumsqr(torque)
    opti.subject_to(ca.vertcat(q[0], v[0], v[-1]) == 0)
    opti.subject_to(q[-1] == slider_crank.TURN)
    t = np.linspace(0.0, 1.0, n + 1)
    opti.set_initial(q, slider_crank.TURN * (3 * t**2 - 2 * t**3))
    opti.set_initial(v, slider_crank.TURN * (6 * t - 6 * t**2) / slider_crank.DURATION)
    opti.set_initial(a, slider_crank.TURN * (6 - 12 * t) / slider_crank.DURATION**2)
    opti.minimize(square)
    return float(_solved(opti) ** 0.5)


def servomotor(problem: trajopt.Problem, n: int) -> float:
    """The least electrical energy, J, of a motor that feeds nothing back: power at both ends of every interval."""
    opti, load, move = ca.Opti(), problem.load, problem.move
    duration, distance = move.fixed_time, move.end.position
    assert duration is not None and isinstance(distance, float)
    assert load.torque_constant is not None and load.resistance is not None and isinstance(load.inertia, float)
    h, most = duration / n, problem.limits.given["acceleration"].highest
    q, v, a = _chain(opti, 2, n, h, [distance, distance / duration, most])
    energy: Any = 0.0
    for speed in (v[:-1], v[1:]):
        force = load.inertia * a + load.viscous * speed + load.coulomb
        u, drawn, size = force / load.torque_constant, opti.variable(n), opti.variable(n)
        opti.subject_to(u - size <= 0)
        opti.subject_to(-u - size <= 0)
        opti.subject_to(force * speed + load.resistance * u**2 + load.switching * size - drawn <= 0)
        opti.subject_to(drawn >= 0)
        energy += h / 2 * ca.sum1(drawn)
    opti.subject_to(ca.vertcat(q[0], v[0], v[-1]) == 0)
    opti.subject_to(q[-1] == distance)
    opti.subject_to(v >= 0)
    opti.subject_to(opti.bounded(-most, a, most))
    t = np.linspace(0.0, 1.0, n + 1)
    opti.set_initial(q, distance * (3 * t**2 - 2 * t**3))
    opti.set_initial(v, distance * (6 * t - 6 * t**2) / duration)
    opti.set_initial(a, distance * (6 - 12 * t[:-1]) / duration**2)
    opti.minimize(energy)
    return _solved(opti)
