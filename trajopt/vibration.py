"""Residual vibration: what a move leaves behind in a mode that hangs on the axis, as rows for any objective.

A mode of natural frequency w (rad/s) and damping ratio z answers the acceleration a of the axis by
x'' + 2 z w x' + w² x = -a, from rest. With l = -z w + i wd, wd = w sqrt(1 - z²), and

    V = ∫ a(t) exp(l (T - t)) dt

it swings on after the move with amplitude |V|/wd. On the exact scheme a is a polynomial on every interval, so that V is
linear in the kinematic variables, exactly, by the functions phi of exponential integrators. Zero vibration is V = 0;
its robust form (zero derivative, ZVD) also dV/dw = 0 (Tuttle & Seering: a pole of higher multiplicity).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, factorial, pi, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import BadInput
from trajopt.mesh import Floats
from trajopt.problem import Vibration

Complex = NDArray[np.complex128]
_SPACING: Final = 0.5  # of a band's samples, in 1/T (V is of exponential type T); closer cones stall solvers
_BAND: Final = 41  # frequencies at which a band is measured
_SERIES: Final = 24  # terms; enough below |z| = 1


@dataclass(frozen=True)
class Mode:
    """One frequency to keep quiet: ``natural`` rad/s; ``most`` the amplitude allowed, m or rad; ``robust``: V's
    derivative by the frequency, times the frequency, is held as V is."""

    natural: float
    damping: float
    most: float
    robust: bool

    @property
    def damped(self) -> float:
        """wd, rad/s."""
        return self.natural * sqrt(1 - self.damping**2)

    @property
    def pole(self) -> complex:
        """l, 1/s."""
        return complex(-self.damping * self.natural, self.damped)


def modes(vibration: Vibration, duration: float) -> list[Mode]:
    """The frequencies that stand for a vibration: one, or samples of a band, close and tight enough for all between."""
    if isinstance(vibration.frequency, float):
        return [Mode(2 * pi * vibration.frequency, vibration.damping, vibration.residual, vibration.robust)]
    low, high = (2 * pi * f for f in vibration.frequency)
    count = max(ceil((high - low) * duration / _SPACING), 1)
    spacing = (high - low) / count * duration
    most = vibration.residual * (1 - spacing**2 / 8)  # between samples |V| rises by this at most (Bernstein)
    return [Mode(w, vibration.damping, most, vibration.robust) for w in np.linspace(low, high, count + 1).tolist()]


def rows(transcript: Any, vibration: Vibration) -> None:
    """Hold the residual vibration of a transcribed move at zero, or below what is allowed, on its model.

    Raises BadInput where the duration is an unknown of the model: the rows are linear at a fixed one only.
    """
    model, chain, duration = transcript.model, transcript.chain, transcript.duration
    if not isinstance(duration, float):
        raise BadInput('vibration: a free time goes with it only where one end is at rest and no power is limited;'
                       ' write a fixed move.time such as "1 s"')  # fmt: skip
    steps, size = transcript.mesh.steps * duration, transcript.sizes.derivative[1]
    for mode in modes(vibration, duration):
        parts = [kernels(mode, steps, len(chain) - 2)]
        if mode.robust:
            parts.append(kernels(mode, steps, len(chain) - 2, derivative=True))
        for kernel in parts:
            real, imaginary = (_total(model, chain, part / size) for part in (np.real(kernel), np.imag(kernel)))
            if not mode.most:
                model.zero(real)
                model.zero(imaginary)
                continue
            pair = model.variable(2)
            model.zero(pair[0] - real)
            model.zero(pair[1] - imaginary)
            model.at_least_length(mode.most * mode.damped / size, pair, np.ones(2))


def left_by(trajectory: Any, vibration: Vibration) -> float:
    """The amplitude, m or rad, that a move leaves in a mode; the largest of a band."""
    given = vibration.frequency
    points = given if isinstance(given, float) else np.linspace(*given, _BAND)
    return float(np.max(residual(trajectory, points, vibration.damping)))


def residual(trajectory: Any, frequency: Any, damping: float = 0.0) -> Floats:
    """The amplitude (m or rad) that a move of the exact scheme leaves in modes of these frequencies (Hz) and damping
    ratio."""
    natural = 2 * pi * np.atleast_1d(np.asarray(frequency, dtype=float))
    found = np.empty(len(natural))
    steps = trajectory.mesh.steps * trajectory.duration
    for k, w in enumerate(natural):
        mode = Mode(float(w), damping, 0.0, False)
        kernel = kernels(mode, steps, trajectory.order - 1)
        value = sum(complex(kernel[r] @ _left(trajectory.chain, r)) for r in range(len(kernel)))
        found[k] = abs(value) / mode.damped
    return found


def kernels(mode: Mode, steps: Floats, count: int, derivative: bool = False) -> Complex:
    """(count, N) by what acceleration, jerk, … at the left of each interval enter V; or w dV/dw with ``derivative``."""
    z: Complex = np.asarray(mode.pole * steps, dtype=complex)
    phi = _phi(z, count + 1)
    later = np.concatenate([np.cumsum(steps[::-1])[::-1][1:], [0.0]])
    decay = np.exp(mode.pole * later)
    if not derivative:
        return np.array([decay * steps ** (r + 1) * phi[r + 1] for r in range(count)])
    slope = [phi[r + 1] - (r + 1) * phi[r + 2] for r in range(count)]  # phi_m' = phi_m - m phi_(m+1)
    return mode.pole * np.array(
        [decay * steps ** (r + 1) * (later * phi[r + 1] + steps * slope[r]) for r in range(count)]
    )


def _phi(z: Complex, highest: int) -> list[Complex]:
    """phi_0 .. phi_highest: phi_0 = exp, phi_(m+1) = (phi_m - 1/m!)/z; by their series near zero."""
    small = np.abs(z) < 1.0
    far = np.where(small, 1.0, z)
    found = [np.exp(z)]
    for m in range(highest):
        series = sum(z**k / factorial(k + m + 1) for k in range(_SERIES))
        found.append(np.where(small, series, (found[m] - 1 / factorial(m)) / far))
    return found


def _left(chain: Any, r: int) -> Any:
    """(N,) the r-th derivative of acceleration at the left of the intervals."""
    return chain[2 + r] if 2 + r == len(chain) - 1 else chain[2 + r][:-1]


def _total(model: Any, chain: Any, kernel: Floats) -> Any:
    total = model.total(kernel[0], _left(chain, 0))
    for r in range(1, len(kernel)):
        total = total + model.total(kernel[r], _left(chain, r))
    return total

