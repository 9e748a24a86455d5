"""A linear plant with one input and one output: its poles, its gain at rest and a realisation to simulate it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from trajopt.plant.exponentials import Floats
from trajopt.plant.poles import COMPUTED, GIVEN, at_zero, repeated, settled

StateSpace = tuple[Floats, Floats, Floats, float]


@dataclass(frozen=True)
class Plant:
    """A proper plant without unstable poles whose modes the input excites and the output shows.

    ``poles`` in 1/s, repeated ones exactly equal, conjugates exact, those at zero first; ``zeros`` in 1/s; ``limit`` is
    lim s^r G(s) for s -> 0 with r = ``rigid`` poles at zero; ``matrices`` (A, B, C, D) realise the plant in seconds.
    Build it with `from_poles`, `from_polynomials` or `from_state_space`; they raise ValueError with a remedy.
    """

    poles: tuple[complex, ...]
    zeros: tuple[complex, ...]
    limit: float
    matrices: StateSpace

    @property
    def order(self) -> int:
        """The number of states."""
        return len(self.poles)

    @property
    def rigid(self) -> int:
        """r, the number of poles at zero."""
        return self.poles.count(0j)

    @property
    def modes(self) -> tuple[tuple[complex, int], ...]:
        """The distinct poles with their multiplicities; both of a conjugate pair are listed."""
        return tuple((p, self.poles.count(p)) for p in dict.fromkeys(self.poles))

    @property
    def static_gain(self) -> float:
        """G(0), infinite with a pole at zero."""
        return float("inf") if self.rigid else self.limit

    @staticmethod
    def from_poles(poles: Sequence[complex], zeros: Sequence[complex] = (), gain: float = 1.0) -> Plant:
        """G(s) = gain prod (s - z)/prod (s - p); complex poles and zeros in conjugate pairs."""
        finite = np.all(np.isfinite([*poles, *zeros, gain]))
        if not finite or not gain:
            raise ValueError(f"gain: {gain:g}; it must be finite and not zero, poles and zeros finite")
        _check_order(len(zeros), len(poles))
        known = repeated(settled([complex(p) for p in poles], GIVEN), GIVEN)
        roots = tuple(complex(z) for z in zeros)
        _check_cancellation(known, roots)
        limit = gain * np.prod([-z for z in roots]) / np.prod([-p for p in known if p])
        return Plant(known, roots, float(limit.real), realise(known, roots, gain))

    @staticmethod
    def from_polynomials(numerator: Sequence[float], denominator: Sequence[float]) -> Plant:
        """G(s) = numerator/denominator, coefficients from the highest power of s down to the constant."""
        upper, lower = (np.trim_zeros(np.array(x, float), "f") for x in (numerator, denominator))
        if not (np.all(np.isfinite(upper)) and np.all(np.isfinite(lower)) and len(upper) and len(lower)):
            raise ValueError("plant: numerator and denominator need finite coefficients that are not all zero")
        _check_order(len(upper) - 1, len(lower) - 1)
        shorter = np.trim_zeros(lower, "b")
        rigid = len(lower) - len(shorter)
        known = (0j,) * rigid + _computed(list(np.roots(shorter)))
        zeros = tuple(complex(z) for z in np.roots(upper))
        _check_cancellation(known, zeros)
        return Plant(known, zeros, float(upper[-1] / shorter[-1]), realise(known, zeros, float(upper[0] / lower[0])))

    @staticmethod
    def from_state_space(a: Floats, b: Floats, c: Floats, d: float = 0.0) -> Plant:
        """x' = A x + B u, y = C x + D u with A (n, n), B (n,) or (n, 1), C (n,) or (1, n)."""
        a = np.atleast_2d(np.asarray(a, float))
        n = len(a)
        shapes = (a.shape, np.size(b), np.size(c)) == ((n, n), n, n)
        if not shapes or not np.all(np.isfinite([*a.ravel(), *np.ravel(b), *np.ravel(c), d])):
            raise ValueError(
                f"plant: A of {a.shape}, B of {np.size(b)}, C of {np.size(c)} entries; one input and one output need "
                "A (n, n), B (n,), C (n,), all finite"
            )
        balanced, change = linalg.matrix_balance(a, permute=False)
        a = np.asarray(balanced, float)
        b, c = np.ravel(np.array(b, float)) / np.diag(change), np.ravel(np.array(c, float)) * np.diag(change)
        computed = np.linalg.eigvals(a).astype(complex)
        rigid = at_zero(computed, float(np.linalg.norm(a)))
        ordered = computed[np.argsort(np.abs(computed))]
        known = (0j,) * rigid + _computed(list(ordered[rigid:]))
        _check_minimal(a, b, c, known)
        limit = np.linalg.det(np.block([[-a, -b[:, None]], [c[None, :], np.array([[d]])]]))
        limit = limit / np.prod([-p for p in known if p])
        return Plant(known, _transmission_zeros(a, b, c, d), float(limit.real), (a, b, c, float(d)))


def _computed(poles: Sequence[complex]) -> tuple[complex, ...]:
    return settled(repeated([complex(p) for p in poles], COMPUTED), 1e-10)


def _check_order(upper: int, lower: int) -> None:
    if not lower:
        raise ValueError("plant: no poles; a plant without dynamics needs no command, set the input at once")
    if upper > lower:
        raise ValueError(
            f"plant: improper, {upper} zeros against {lower} poles; add the poles of the drive or the filter"
        )


def _check_cancellation(poles: tuple[complex, ...], zeros: tuple[complex, ...]) -> None:
    for z in zeros:
        near = min(poles, key=lambda p: abs(p - z))
        if abs(near - z) <= 1e-8 * abs(near):
            raise ValueError(
                f"plant: the zero at {z:.6g} cancels the pole at {near:.6g}, so its mode is uncontrollable or "
                "unobservable; remove both"
            )


def _check_minimal(a: Floats, b: Floats, c: Floats, poles: tuple[complex, ...]) -> None:
    """Popov, Belevitch and Hautus: [A - pI, B] and [A - pI; C] keep full rank at every pole."""
    n, size = len(a), float(np.linalg.norm(a)) or 1.0
    column, row = (x * size / (float(np.linalg.norm(x)) or 1.0) for x in (b, c))
    for p in dict.fromkeys(poles):
        shifted = a - p * np.eye(n)
        sights = {"uncontrollable": np.column_stack([shifted, column]), "unobservable": np.vstack([shifted, row])}
        for fault, sight in sights.items():
            if np.linalg.svd(sight, compute_uv=False)[n - 1] <= 1e-10 * size:
                raise ValueError(f"plant: the mode at {p:.6g} is {fault}; remove it from A, B and C")


def _transmission_zeros(a: Floats, b: Floats, c: Floats, d: float) -> tuple[complex, ...]:
    """The finite zeros: as many as the states less the relative degree, of the eigenvalues of the system pencil the
    smallest."""
    n, parameter, column = len(a), d, b.copy()
    relative, size = 0, float(np.linalg.norm(c))
    while abs(parameter) <= 1e-12 * size * float(np.linalg.norm(column)) and relative < n:
        parameter, column, relative = float(c @ column), a @ column, relative + 1
    pencil = np.block([[a, b[:, None]], [c[None, :], np.array([[d]])]])
    values = linalg.eigvals(pencil, np.diag([1.0] * n + [0.0]))
    finite = values[np.isfinite(values)]
    return tuple(complex(z) for z in finite[np.argsort(np.abs(finite))][: n - relative])


def realise(poles: tuple[complex, ...], zeros: tuple[complex, ...], gain: float) -> StateSpace:
    """A chain of sections of first and second order, each with unit gain at rest or, at zero, an integrator."""
    n = len(poles)
    size = max([abs(p) for p in poles if p], default=1.0)
    a, b = np.zeros((n, n)), np.zeros(n)
    source, at = None, 0
    for p in (p for p in poles if p.imag >= 0):
        width = 2 if p.imag else 1
        rate = abs(p) or size
        if p.imag:
            a[at, at + 1], a[at + 1, at], a[at + 1, at + 1] = rate, -rate, 2 * p.real
        else:
            a[at, at] = p.real
        if source is None:
            b[at + width - 1] = rate
        else:
            a[at + width - 1, source] = rate
        source, at = at, at + width
    feedthrough = gain if len(zeros) == n else 0.0
    return a, b, _output(a, b, poles, zeros, gain, feedthrough, size), feedthrough


def _output(
    a: Floats, b: Floats, poles: tuple[complex, ...], zeros: tuple[complex, ...], gain: float, d: float, size: float
) -> Floats:
    """(n,) the output row C with C (sI - A)^-1 B + D = G(s), fitted on circles about the poles."""
    n = len(a)
    radii = sorted({abs(p) for p in poles if p} | {size})
    points = np.array([1.5 * r * np.exp(1j * angle) for r in radii for angle in np.linspace(0.1, 3.0, 2 * n)])
    states = np.array([np.linalg.solve(s * np.eye(n) - a, b) for s in points])
    values = np.array([gain * np.prod([s - z for z in zeros]) / np.prod([s - p for p in poles]) - d for s in points])
    weight = 1 / np.linalg.norm(states, axis=1)
    rows, right = states * weight[:, None], values * weight
    rows, right = np.vstack([rows.real, rows.imag]), np.concatenate([right.real, right.imag])
    row: Floats = np.linalg.lstsq(rows, right, rcond=None)[0]
    return row
