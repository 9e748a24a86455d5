"""Roots of many increasing functions at once, and of two functions of two unknowns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import root

from trajopt.velocity_domain.motor import Floats

_ROUNDS = 80
_MET = 1e-10  # of functions of size one: where both are this small they vanish
_SETTLED = 1e-10  # relative: a Newton step this small leaves an error of its square


def increasing_root(function: Callable[[Floats], tuple[Floats, Floats]], top: Floats) -> Floats:
    """(n,) roots on [0, top] of functions that increase there, by Newton's method kept in a bracket; an end where
    there is none. ``function`` returns values and derivatives, each (n,). The first guess is near ``top``."""
    low, high = np.zeros_like(top), np.array(top)
    x = 0.9 * high
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(_ROUNDS):
            value, slope = function(x)
            low, high = np.where(value < 0, x, low), np.where(value < 0, high, x)
            step = x - value / slope
            following = np.where((step >= low) & (step <= high), step, (low + high) / 2)
            done = np.abs(following - x) <= _SETTLED * np.abs(x)
            x = following
            if done.all():
                break
        value, slope = function(x)
        step = x - value / slope
    return np.where((step >= low) & (step <= high), step, x)


def common_root(functions: Callable[[float, float], tuple[float, float]], start: tuple[float, float]) -> Floats | None:
    """(2,) where two functions of size one vanish together, near a start; None if they are not found to. Much faster
    than a search within a search, which stays for those cases. Infinite values keep unknowns within their range."""

    def values(x: Floats) -> tuple[float, float]:
        return functions(float(x[0]), float(x[1]))

    with np.errstate(invalid="ignore", over="ignore"):
        found: Floats = root(values, start, tol=1e-11).x
        return found if np.max(np.abs(values(found))) <= _MET else None
