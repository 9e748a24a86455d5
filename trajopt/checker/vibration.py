"""Residual vibration, recomputed by swinging: the state of each mode is carried through the move, interval by interval.

x'' + 2 z w x' + w² x = -a from rest, with a a polynomial on every interval: a particular polynomial solution and a
damped rotation, exact but for rounding.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from trajopt.checker.case import Case, Mode
from trajopt.checker.report import Check

_TOLERANCE: Final = 1e-6  # of the most that the move could leave in the mode, ∫|a|dt/wd
_SLOPE: Final = 1e-6  # of that, times w T
_NEAR: Final = 1e-3  # step of the central difference by the frequency, in 1/T


def vibration_checks(case: Case) -> list[Check]:
    """For each mode: its amplitude after the move against what is allowed and against what the metrics claim, and where
    it must be robust the slope by the frequency."""
    checks = []
    for k, mode in enumerate(case.vibration, start=1):
        amplitude = residual_vibration(case, mode)
        most = _most(case) / _damped(min(mode.points), mode.damping)
        checks.append(_amplitude(case, f"vibration {k}", amplitude - mode.residual, _TOLERANCE * most))
        if mode.robust:
            turns = 2 * math.pi * max(mode.points) * case.end_time
            slope = max(abs(_slope(case, 2 * math.pi * f, mode.damping)) for f in mode.points)
            checks.append(_amplitude(case, f"vibration {k} slope", slope - 2 * mode.residual, _SLOPE * most * turns))
        claimed = case.metrics.get(f"residual_vibration_{k}")
        if claimed is not None:
            off = abs(claimed - amplitude)
            checks.append(_amplitude(case, f"metric residual_vibration_{k}", off, _TOLERANCE * most))
    return checks


def residual_vibration(case: Case, mode: Mode) -> float:
    """The amplitude after the move, m or rad; the largest of a band."""
    return max(abs(_phasor(case, 2 * math.pi * f, mode.damping)) for f in mode.points)


def _amplitude(case: Case, name: str, over: float, tolerance: float) -> Check:
    over = max(over, 0.0)
    return Check(name, over, tolerance, case.end_time, over <= tolerance)


def _slope(case: Case, w: float, damping: float) -> complex:
    """The phasor's derivative by the frequency, times the frequency."""
    step = _NEAR / case.end_time
    change = _phasor(case, w + step, damping) - _phasor(case, w - step, damping)
    return change * w / (2 * step)


def _damped(frequency: float, damping: float) -> float:
    return 2 * math.pi * frequency * math.sqrt(1 - damping**2)


def _most(case: Case) -> float:
    """An upper bound on ∫|a|dt, m/s: what the velocity can have gained and lost."""
    rows = case.signal[2]
    left = np.abs(rows if case.order == 2 else rows[:-1])
    right = left if case.order == 2 else np.abs(rows[1:])
    return float(np.diff(case.time) @ np.maximum(left, right))


def _phasor(case: Case, w: float, damping: float) -> complex:
    """x' + (z w) x over wd, and x, at the end of the move: the amplitude and phase of what swings on."""
    wd, decay = w * math.sqrt(1 - damping**2), damping * w
    swing = 0.0 + 0.0j  # x - i (x' + decay x)/wd
    for h, row in zip(np.diff(case.time).tolist(), _accelerations(case), strict=True):
        particular = _particular(row, w, damping)
        start = particular[0] - 1j * ((particular[1] if len(particular) > 1 else 0.0) + decay * particular[0]) / wd
        value = sum(c * h**n for n, c in enumerate(particular))
        rate = sum(n * c * h ** (n - 1) for n, c in enumerate(particular) if n)
        end = value - 1j * (rate + decay * value) / wd
        swing = (swing - start) * complex(math.cos(wd * h), math.sin(wd * h)) * math.exp(-decay * h) + end
    return swing


def _accelerations(case: Case) -> list[list[float]]:
    """By interval: coefficients of the acceleration in powers of the time since its left node."""
    parts = [case.signal[i] if i == case.order else case.signal[i][:-1] for i in range(2, case.order + 1)]
    scaled = [values / math.factorial(n) for n, values in enumerate(parts)]
    return np.stack(scaled, axis=1).tolist()  # type: ignore[no-any-return]


def _particular(row: list[float], w: float, damping: float) -> list[float]:
    """The polynomial that solves x'' + 2 z w x' + w² x = -a; its highest coefficient is found first."""
    found = [0.0] * (len(row) + 2)
    for n in reversed(range(len(row))):
        coupled = (n + 2) * (n + 1) * found[n + 2] + 2 * damping * w * (n + 1) * found[n + 1]
        found[n] = (-row[n] - coupled) / w**2
    return found[: max(len(row), 2)]
