"""What a command leaves vibrating: of impulses at an input, and of an acceleration profile as a linear functional.

A mode of frequency ω and damping ratio ζ has the pole p = ω(-ζ + j sqrt(1 - ζ²)). Impulses A_i of the input leave
sum A_i exp(p (T - t_i)); an acceleration a(t) leaves V = ∫ a(t) exp(p (T - t)) dt, and a mode q'' + 2ζω q' + ω² q = a
that began at rest follows q(T + s) = Im(V exp(p s))/(ω sqrt(1 - ζ²)). (Singer and Seering 1990; zero derivatives:
Singhose, Pao and Seering 1996.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from trajopt.plant.exponentials import Complexes, Floats, divided_exponentials


def mode_pole(frequency: float, damping: float = 0.0) -> complex:
    """The upper pole (1/s) of a mode of undamped frequency (rad/s) and damping ratio; ValueError outside 0 <= ζ < 1."""
    if not (0 < frequency < np.inf and 0 <= damping < 1):
        raise ValueError(
            f"mode: frequency {frequency:g} rad/s, damping {damping:g}; needs frequency > 0, 0 <= damping < 1"
        )
    return complex(-damping * frequency, frequency * np.sqrt(1 - damping**2))


def residual_vibration(times: ArrayLike, amplitudes: ArrayLike, frequency: ArrayLike, damping: float = 0.0) -> Floats:
    """The vibration after impulses, in percent of what all of them would leave in step and undamped.

    ``times`` (s) and ``amplitudes`` (m,), ``frequency`` of any shape (rad/s), which the result has. With positive
    amplitudes it is the percentage of input shaping.
    """
    a = np.asarray(amplitudes, float)
    share = residual_amplitude(times, a, frequency, damping) / np.sum(np.abs(a))
    result: Floats = 100 * share
    return result


def residual_amplitude(times: ArrayLike, amplitudes: ArrayLike, frequency: ArrayLike, damping: float = 0.0) -> Floats:
    """|sum A_i exp(p (T - t_i))| at the last impulse, in the input's unit; a mode of unit gain at rest then swings with
    this amplitude over sqrt(1 - ζ²), decaying with exp(-ζωs)."""
    t, a, w = np.asarray(times, float), np.asarray(amplitudes, float), np.asarray(frequency, float)
    if t.shape != a.shape or t.ndim != 1 or not len(t):
        raise ValueError(f"impulses: {t.shape} times and {a.shape} amplitudes; give as many of one as of the other")
    poles = np.array([mode_pole(float(x), damping) for x in w.ravel()])
    left = np.exp(np.multiply.outer(poles, np.max(t) - t)) @ a
    result: Floats = np.abs(left).reshape(w.shape)
    return result


def mode_weights(times: ArrayLike, degree: int, frequency: float, damping: float = 0.0) -> Complexes:
    """(N,) c with V = sum c_k u_k for a chain from rest whose top derivative is u_k on [times[k], times[k + 1]].

    ``times`` (N + 1,) s; the acceleration is a piecewise polynomial of ``degree`` 0 (u is the acceleration), 1 (jerk)
    or 2 (snap), or more. Exact on each interval. The real and the imaginary parts are the two rows of "no
    vibration left".
    """
    p = mode_pole(frequency, damping)
    return _steps(times, _kernel(degree) + (p,))


def mode_derivative_weights(times: ArrayLike, degree: int, frequency: float, damping: float = 0.0) -> Complexes:
    """(N,) the derivative of `mode_weights` by the frequency (s/rad) at constant damping: rows for zero derivative."""
    p = mode_pole(frequency, damping)
    return p / frequency * _steps(times, _kernel(degree) + (p, p))


def start_weights(duration: float, degree: int, frequency: float, damping: float = 0.0) -> Complexes:
    """(degree,) what the acceleration at the start and its derivatives below the top add to V per unit of each."""
    p = mode_pole(frequency, damping)
    table = [divided_exponentials((0j,) * (i + 1) + (p,), np.array([duration]))[-1, 0] for i in range(degree)]
    return np.array(table, complex)


def profile_vibration(
    times: ArrayLike, top: ArrayLike, degree: int, frequency: ArrayLike, damping: float = 0.0
) -> Floats:
    """The amplitude |V|/(ω sqrt(1 - ζ²)) with which modes swing after a profile from rest, over an array of frequencies
    (rad/s): in the unit of position, of a mode q'' + 2ζω q' + ω² q = a."""
    w = np.asarray(frequency, float)
    u = np.asarray(top, float)
    left = [
        abs(mode_weights(times, degree, float(x), damping) @ u) / mode_pole(float(x), damping).imag for x in w.ravel()
    ]
    return np.array(left, float).reshape(w.shape)


def _kernel(degree: int) -> tuple[complex, ...]:
    if degree < 0:
        raise ValueError(
            f"degree: {degree}; the acceleration is constant (0), linear (1), quadratic (2) on an interval"
        )
    return (0j,) * (degree + 1)


def _steps(times: ArrayLike, nodes: tuple[complex, ...]) -> Complexes:
    """(N,) the differences over the intervals of the last divided exponential of the nodes in the time that remains."""
    t = np.asarray(times, float)
    if t.ndim != 1 or len(t) < 2 or np.any(np.diff(t) <= 0):
        raise ValueError(f"times: {t.shape}; give at least two, rising")
    value = divided_exponentials(nodes, t[-1] - t)[-1]
    result: Complexes = value[:-1] - value[1:]
    return result
