"""Divided differences of the exponential: the functions behind poles of any multiplicity.

exp[x_0 .. x_j](h), the divided difference of x -> exp(x h), is the impulse response of 1/((s - x_0) .. (s - x_j)).
Equal nodes give h^j exp(x h)/j!, distinct ones a combination of exponentials, and nodes that nearly coincide keep all
digits.
With D_j = exp[x_0 .. x_j]:  D_j' = x_j D_j + D_(j-1).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
_NEAR: Final = 2.0  # |x - mean| h up to which the series holds; beyond, differences lose no digits
_TERMS: Final = 32


def divided_exponentials(nodes: Sequence[complex], h: Floats) -> Complexes:
    """(len(nodes), len(h)) the prefixes exp[x_0](h), exp[x_0, x_1](h), ... for h >= 0; equal nodes lie side by side.

    Where the nodes are close on the scale of 1/h a series about their mean, elsewhere the difference quotient
    (A. McCurdy, K. C. Ng, B. N. Parlett, Math. Comp. 43, 1984).
    """
    h = np.asarray(h, float)
    known: dict[tuple[int, int], Complexes] = {}
    return np.array([_difference(nodes, h, 0, j, known) for j in range(len(nodes))]).reshape(len(nodes), len(h))


def _difference(
    nodes: Sequence[complex], h: Floats, i: int, j: int, known: dict[tuple[int, int], Complexes]
) -> Complexes:
    """(len(h),) exp[x_i .. x_j](h)."""
    if (i, j) not in known:
        chosen = np.array(nodes[i : j + 1], complex)
        centre = chosen.mean()
        near = np.max(np.abs(chosen - centre)) * h <= _NEAR
        value: Complexes = np.empty(len(h), complex)
        value[near] = _series(chosen - centre, h[near]) * np.exp(centre * h[near])
        if not np.all(near):
            right, left = (_difference(nodes, h, *ends, known) for ends in ((i + 1, j), (i, j - 1)))
            first, last = _farthest(nodes, i, j)
            value[~near] = (right[~near] - left[~near]) / (last - first)
        known[i, j] = value
    return known[i, j]


def _farthest(nodes: Sequence[complex], i: int, j: int) -> tuple[complex, complex]:
    """The end nodes, which must differ where a quotient is taken."""
    if nodes[i] == nodes[j]:
        raise ValueError(f"nodes {i} and {j} agree but those between do not: order equal nodes side by side")
    return nodes[i], nodes[j]


def _series(offsets: Complexes, h: Floats) -> Complexes:
    """(len(h),) h^j sum_k S_k(offsets) h^k/(j + k)!, S_k the complete symmetric polynomials, j = len(offsets) - 1."""
    terms = _TERMS if np.any(offsets) else 1
    symmetric = np.zeros(terms, complex)
    symmetric[0] = 1.0
    for x in offsets:
        for k in range(1, terms):
            symmetric[k] += x * symmetric[k - 1]
    order = len(offsets) - 1
    total: Complexes = np.zeros(len(h), complex)
    for k in reversed(range(terms)):
        total *= h
        total += symmetric[k] / factorial(order + k)
    total *= h**order
    return total
