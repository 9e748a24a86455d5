"""The switching function sigma(h) = sum c_j D_j'(h): its roots, and where to sample it so that none is missed."""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt.plant.basis import DECAYED, Basis
from trajopt.plant.exponentials import Floats

_HALVINGS: Final = 25  # of a sample's width, to a root
_NEARLY: Final = 0.03  # of the sum of its terms: a sample of sigma that low may hide a root beside it


def roots(basis: Basis, costate: Floats, top: float) -> tuple[float, Floats]:
    """The sign of sigma just below ``top`` and its roots in (0, top), falling."""
    h = samples(basis, 0.0, top)
    for _ in range(2):
        h = np.union1d(h, lowest(h, np.abs(share(basis, costate, h))))
    sigma = costate @ basis.tables(h)[1]
    signs = np.where(sigma >= 0, 1.0, -1.0)
    at = np.flatnonzero(signs[1:] != signs[:-1])
    low, high, sign = h[at].copy(), h[at + 1].copy(), signs[at]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        same = np.where(costate @ basis.tables(middle)[1] >= 0, 1.0, -1.0) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return float(signs[-1]), ((low + high) / 2)[::-1]


def lowest(h: Floats, value: Floats) -> Floats:
    """Samples between the neighbours of every inner sample where the value is lowest of the three and nearly zero."""
    low = (value[1:-1] <= value[:-2]) & (value[1:-1] <= value[2:]) & (value[1:-1] < _NEARLY)
    inner = 1 + np.flatnonzero(low)
    result: Floats = np.unique(np.linspace(h[inner - 1], h[inner + 1], 41))
    return result


def share(basis: Basis, costate: Floats, h: Floats) -> Floats:
    """(len(h),) sigma relative to the sum of its terms."""
    slope = basis.tables(h)[1]
    result: Floats = (costate @ slope) / np.maximum(np.abs(costate) @ np.abs(slope), 1e-300)
    return result


def samples(basis: Basis, low: float, high: float) -> Floats:
    """Backward times from ``low`` to ``high``, rising, that resolve every oscillation until it has decayed, every
    decay, and both ends."""
    parts = [np.linspace(low, high, 201), low + np.geomspace(1e-6, 0.5, 40) * (high - low)]
    parts.append(low + high - parts[-1])
    for p in {p for group in basis.groups for p in group.nodes}:
        end = min(high, DECAYED / max(-p.real, 1e-300))
        if end > low and p.imag > 0:
            parts.append(np.linspace(low, end, int(2 + 10 * p.imag * (end - low))))
        if p.real:
            parts.append(np.geomspace(0.01, DECAYED, 60) / -p.real)
    h = np.unique(np.concatenate(parts))
    result: Floats = h[(h >= low) & (h <= high)]
    return result
