"""What a symmetric trapezoid of the same duration costs: the profile an optimum is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from trajopt.velocity_domain.limits import Envelope, Limits
from trajopt.velocity_domain.motor import Floats, Loss, Objective, Servomotor
from trajopt.velocity_domain.pieces import borders

_GRID: Final = 100  # ramps of the first look
_HALVINGS: Final = 60
_ROUNDING: Final = 1e-12  # relative: by how much a limit may seem to be passed


@dataclass(frozen=True)
class Trapezoid:
    """``ramp`` s up, ``ramp`` s down, ``peak`` rad/s; its cost, J; whether it keeps the limits."""

    ramp: float
    peak: float
    energy: float
    feasible: bool


def trapezoid_energy(
    motor: Servomotor,
    distance: float,
    duration: float,
    ramp: float,
    limits: Limits | None = None,
    objective: Objective = "energy",
) -> Trapezoid:
    """The trapezoid with a given ramp time, s; a third of the duration gives the rule of thirds.

    Raises ValueError for a ramp that is not positive or longer than half the duration.
    """
    if not 0 < ramp <= duration / 2:
        raise ValueError(f"the ramp must be positive and at most half the duration, not {ramp:g} s")
    loss, envelope = Loss.of(motor, objective), Envelope.of(motor, limits or Limits())
    peak = distance / (duration - ramp)
    ramps = sum(_ramp_cost(motor, loss, peak, sign * peak / ramp) for sign in (1.0, -1.0))
    energy = ramps + (duration - 2 * ramp) * float(loss.cost(peak, motor.hold(peak)))
    return Trapezoid(ramp, peak, energy, _feasible(envelope, distance, duration, ramp))


def best_trapezoid(
    motor: Servomotor,
    distance: float,
    duration: float,
    limits: Limits | None = None,
    objective: Objective = "energy",
) -> Trapezoid:
    """The cheapest symmetric trapezoid within the limits. Raises ValueError where none keeps them."""

    def energy(ramp: float) -> float:
        return trapezoid_energy(motor, distance, duration, ramp, limits, objective).energy

    ramps = _within(Envelope.of(motor, limits or Limits()), distance, duration)
    energies = [energy(t) for t in ramps]
    best = int(np.argmin(energies))
    around = ramps[max(best - 1, 0)], ramps[min(best + 1, len(ramps) - 1)]
    found = minimize_scalar(energy, bounds=around, method="bounded", options={"xatol": 1e-12 * duration})
    ramp = float(found.x) if found.fun < energies[best] else ramps[best]
    return trapezoid_energy(motor, distance, duration, ramp, limits, objective)


def _within(envelope: Envelope, distance: float, duration: float) -> list[float]:
    """Ramp times that keep the limits, the ends of their range among them."""
    grid = [float(t) for t in duration / 2 * np.linspace(0, 1, _GRID + 1)[1:]]
    inside = [_feasible(envelope, distance, duration, t) for t in grid]
    if not any(inside):
        raise ValueError(f"no symmetric trapezoid of {duration:g} s keeps the limits")
    first, last = inside.index(True), _GRID - 1 - inside[::-1].index(True)
    ends = []
    for good, bad in ((grid[first], grid[first - 1] if first else 0.0), (grid[last], grid[min(last + 1, _GRID - 1)])):
        for _ in range(_HALVINGS):
            middle = (good + bad) / 2
            if middle > 0 and _feasible(envelope, distance, duration, middle):
                good = middle
            else:
                bad = middle
        ends.append(good)
    return [ends[0], *grid[first : last + 1], ends[1]]


def _feasible(envelope: Envelope, distance: float, duration: float, ramp: float) -> bool:
    """The limits are lines over speed: kept on a ramp if at its ends."""
    peak = distance / (duration - ramp)
    most = peak / ramp * (1 - _ROUNDING)
    speeds = np.array([peak, 0.0])
    up, down = envelope.top(peak, speeds)[0], envelope.bottom(peak, speeds)[0]
    return bool(peak * (1 - _ROUNDING) <= envelope.fastest and (most <= up).all() and (most <= -down).all())


def _ramp_cost(motor: Servomotor, loss: Loss, peak: float, acceleration: float) -> float:
    """J between rest and a peak speed at a constant acceleration, by quadrature between the kinks of the cost."""

    def sort(speed: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
        current = motor.current(speed, acceleration)
        return np.asarray(2 * (current > 0) + (loss.power(speed, current) > 0), dtype=np.int64)

    edges = borders(sort, peak)[0]
    x, w = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in zip(edges, edges[1:], strict=False):
        speed = low + (high - low) * (x + 1) / 2
        total += float(w @ loss.cost(speed, motor.current(speed, acceleration))) * (high - low) / 2
    return total / abs(acceleration)
