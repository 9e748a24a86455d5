"""What a command leaves vibrating, from the jumps of its input.

A mode of frequency ω and damping ratio ζ has the pole p = ω(-ζ + j sqrt(1 - ζ²)); impulses A_i of the input leave
sum A_i exp(p (T - t_i)) (N. Singer, W. Seering, Preshaping command inputs to reduce system vibration, 1990).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from trajopt.plant.exponentials import Floats


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
    t, a, w = np.asarray(times, float), np.asarray(amplitudes, float), np.asarray(frequency, float)
    if t.shape != a.shape or t.ndim != 1 or not len(t):
        raise ValueError(f"impulses: {t.shape} times and {a.shape} amplitudes; give as many of one as of the other")
    poles = np.array([mode_pole(float(x), damping) for x in w.ravel()])
    left = np.exp(np.multiply.outer(poles, np.max(t) - t)) @ a
    result: Floats = 100 * np.abs(left).reshape(w.shape) / np.sum(np.abs(a))
    return result
