"""Poles: which of them are one pole repeated, and which are at rest at zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from trajopt.plant.exponentials import Complexes

GIVEN: Final = 1e-14  # relative change of a cluster's polynomial that merging may make: poles given by the user
COMPUTED: Final = 1e-11  # and roots or eigenvalues that we computed


def repeated(poles: Sequence[complex], tolerance: float) -> tuple[complex, ...]:
    """The poles with those that are one repeated pole replaced by their mean, conjugates exact, by size.

    A root of multiplicity m that was computed is spread by rounding over a circle of radius eps^(1/m), while the mean
    and the polynomial of the cluster keep all digits. So m poles are merged if prod (s - p_i) = (s - mean)^m up to a
    relative ``tolerance`` in every coefficient.
    """
    left = [complex(p) for p in poles]
    merged: list[complex] = []
    while left:
        seed = max(left, key=lambda p: p.imag)
        near = sorted(range(len(left)), key=lambda i: abs(left[i] - seed))
        count = next(k for k in range(len(near), 0, -1) if _is_one([left[i] for i in near[:k]], tolerance))
        taken = [left[i] for i in near[:count]]
        centre = complex(np.mean(taken))
        left = [left[i] for i in near[count:]]
        if abs(centre.imag) <= 1e-9 * abs(centre) or centre == 0:
            merged += [complex(centre.real)] * count
        else:
            merged += [centre] * count + [centre.conjugate()] * count
            for p in taken:
                left.remove(min(left, key=lambda q: abs(q - p.conjugate())))
    return tuple(sorted(merged, key=lambda p: (abs(p), -p.real, abs(p.imag), -p.imag)))


def _is_one(poles: list[complex], tolerance: float) -> bool:
    """Whether poles are numerically one pole (see `repeated`)."""
    centre = np.mean(poles)
    change = np.abs(np.poly(np.array(poles) - centre)[2:])
    return bool(np.all(change <= tolerance * abs(centre) ** np.arange(2, len(poles) + 1)))


def at_zero(poles: Complexes, size: float) -> int:
    """How many of the computed poles, smallest first, are numerically a repeated pole at zero; ``size`` is the norm of
    their matrix."""
    ordered = poles[np.argsort(np.abs(poles))]
    for count in range(len(poles), 0, -1):
        change = np.abs(np.poly(ordered[:count])[1:])
        if np.all(change <= 64 * len(poles) * np.finfo(float).eps * size ** np.arange(1, count + 1)):
            return count
    return 0


def settled(poles: Sequence[complex], tolerance: float) -> tuple[complex, ...]:
    """The poles with a real part that is rounding alone set to zero; ValueError if one is unstable or lacks its
    conjugate."""
    result = []
    for p in poles:
        if p.real > tolerance * abs(p):
            raise ValueError(
                f"plant: the pole at {p:.6g} is unstable (real part above zero); close a stabilising loop first and "
                "give the closed-loop plant"
            )
        result.append(complex(0.0, p.imag) if abs(p.real) <= tolerance * abs(p) else p)
    for p in result:
        if result.count(p) != result.count(p.conjugate()):
            raise ValueError(f"plant: the pole at {p:.6g} lacks its conjugate; give complex poles in pairs")
    return tuple(result)
