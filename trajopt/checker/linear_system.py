"""A linear plant for the checker: a realisation from a problem's data, and its matrix exponential.

Time is counted in durations of the command, so that rates are pure numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trajopt.checker.case import Array

_CHUNK: Final = 2000  # matrices at once
_PADE: Final = (
    64764752532480000.0, 32382376266240000.0, 7771770303897600.0, 1187353796428800.0, 129060195264000.0,
    10559470521600.0, 670442572800.0, 33522128640.0, 1323241920.0, 40840800.0, 960960.0, 16380.0, 182.0, 1.0,
)  # fmt: skip
_REACH: Final = 5.37  # the norm up to which the approximant of degree 13 is exact to rounding (Higham 2005)


@dataclass(frozen=True)
class System:
    """x' = a x + b u, y = c x + d u; a (n, n), b (n,), c (n,)."""

    a: Array
    b: Array
    c: Array
    d: float

    def reached(self, s: Array) -> tuple[Array, Array]:
        """(k, n, n) exp(a s) and (k, n) ∫ exp(a r) b dr from 0 to s, at times (k,)."""
        n = len(self.b)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.a, self.b
        parts = [exponential(block * x[:, None, None]) for x in np.split(s, range(_CHUNK, len(s), _CHUNK))]
        whole = np.concatenate(parts)
        return whole[:, :n, :n], whole[:, :n, n]

    def balanced(self) -> System:
        """The system with states that a constant input brings to about one in the course of the command."""
        system, times = self, np.concatenate([np.geomspace(1e-6, 1.0, 40), np.linspace(0.0, 1.0, 41)])
        for _ in range(2):
            exponentials, integrals = system.reached(times)
            size = np.maximum(np.max(np.abs(exponentials @ system.b), axis=0), np.max(np.abs(integrals), axis=0))
            size[size == 0] = 1.0
            a = system.a * size[None, :] / size[:, None]
            system = System(a, system.b / size, system.c * size, system.d)
        return system


def exponential(matrices: Array) -> Array:
    """(k, n, n) the exponentials of matrices: the Padé approximant of degree 13, scaling and squaring."""
    norms = np.max(np.sum(np.abs(matrices), axis=1), axis=1)
    halvings = np.ceil(np.log2(np.maximum(norms / _REACH, 1.0))).astype(int)
    x = matrices / 2.0 ** halvings[:, None, None]
    one = np.broadcast_to(np.eye(x.shape[-1]), x.shape)
    x2 = x @ x
    x4 = x2 @ x2
    x6 = x4 @ x2
    p = _PADE
    odd = x @ (x6 @ (p[13] * x6 + p[11] * x4 + p[9] * x2) + p[7] * x6 + p[5] * x4 + p[3] * x2 + p[1] * one)
    even = x6 @ (p[12] * x6 + p[10] * x4 + p[8] * x2) + p[6] * x6 + p[4] * x4 + p[2] * x2 + p[0] * one
    result: Array = np.linalg.solve(even - odd, even + odd)
    for k in range(int(np.max(halvings, initial=0))):
        more = halvings > k
        result[more] = result[more] @ result[more]
    return result


def chain(poles: Sequence[complex], zeros: Sequence[complex], gain: float) -> System:
    """gain prod (s - z)/prod (s - p) as sections of second and first order in series, each about one in size."""
    tops = _pairs(zeros)
    sections = []
    for pair in _pairs(poles):
        fitting = max((top for top in tops if len(top) <= len(pair)), key=len, default=None)
        top = () if fitting is None else tops.pop(tops.index(fitting))
        section, size = _section(pair, top)
        sections.append(section)
        gain *= size
    whole = series(sections)
    return System(whole.a, whole.b, whole.c * gain, whole.d * gain)


def series(systems: Sequence[System]) -> System:
    """The first system drives the second, and so on; the last one's output is the whole's."""
    n = sum(len(system.b) for system in systems)
    a, b, c, d, at = np.zeros((n, n)), np.zeros(n), np.zeros(n), 1.0, 0
    for system in systems:
        to = at + len(system.b)
        a[at:to, at:to] = system.a
        a[at:to, :at] = np.outer(system.b, c[:at])
        b[at:to] = system.b * d
        c[:at] *= system.d
        c[at:to] = system.c
        d *= system.d
        at = to
    return System(a, b, c, d)


def _pairs(roots: Sequence[complex]) -> list[tuple[complex, ...]]:
    """Conjugate pairs and real roots two by two, the last one alone; the fastest first, so that the states behind are
    not copies of those before."""
    real = sorted((r for r in roots if not r.imag), key=abs, reverse=True)
    pairs: list[tuple[complex, ...]] = [(r, r.conjugate()) for r in roots if r.imag > 0]
    pairs += [tuple(real[i : i + 2]) for i in range(0, len(real), 2)]
    return sorted(pairs, key=lambda pair: -abs(pair[0]))


def _section(poles: tuple[complex, ...], zeros: tuple[complex, ...]) -> tuple[System, float]:
    """prod (s - z)/prod (s - p) over a size, and the size."""
    top = np.zeros(3)
    top[2 - len(zeros) :] = np.poly(zeros).real
    rates = [max(abs(p), 1.0) for p in poles]
    first, second = poles[0].real, poles[-1].real
    if len(poles) == 1:
        a, b, d = np.array([[first]]), np.array([rates[0]]), top[1]
        c = np.array([(top[2] + top[1] * first) / rates[0]])
    else:
        d = top[0]
        r1 = top[1] + d * (first + second)
        r0 = top[2] - d * (poles[0] * poles[1]).real
        if poles[0].imag:
            a = np.array([[first, rates[0]], [-(poles[0].imag ** 2) / rates[0], first]])
            b = np.array([0.0, rates[0]])
            c = np.array([(r0 + r1 * first) / rates[0] ** 2, r1 / rates[0]])
        else:
            a = np.array([[first, 0.0], [rates[1], second]])
            b = np.array([rates[0], 0.0])
            c = np.array([r1 / rates[0], (r0 + r1 * second) / (rates[0] * rates[1])])
    size = max(float(np.max(np.abs(c))), abs(float(d)))
    return System(a, b, c / size, float(d) / size), size
