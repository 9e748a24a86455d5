"""What an engineer reads off a move, exact between the nodes: peaks, root mean squares, energies, path length."""

from __future__ import annotations

from functools import cache
from math import comb
from typing import Final

import numpy as np
from numpy.polynomial import polynomial

from trajopt import motor, vibration
from trajopt.mesh import Floats
from trajopt.problem import DERIVATIVES
from trajopt.signals import OnFloats, Signal, gauss
from trajopt.trajectory import Trajectory

_PARTS: Final = 400  # on these, 18 points miss no change of sign that matters
_HALVINGS: Final = 20  # each leaves a quarter of the error in the interval of a change of sign


def metrics(trajectory: Trajectory) -> dict[str, float]:
    """Peaks and RMS of velocity to the top derivative, distance ∫|v|dt; with a load force, power and energy ∫|P|dt;
    with a motor current, peak voltage, copper loss, electrical energy, and what it feeds back (``brake_energy``); the
    amplitude left in each mode of `Problem.vibration`.

    SI. For the Euler scheme, values at the nodes and their sums (energy by the trapezoidal rule, as in Table II).
    """
    load = trajectory.problem.load
    if load.curves:
        trajectory = trajectory.cut(np.linspace(0.0, trajectory.duration, _PARTS))  # short enough for polynomials
    if load.coulomb and trajectory.scheme.terms > 1:
        trajectory = trajectory.cut(_reversals(trajectory, "velocity"))  # friction jumps there
    names = [*DERIVATIVES[1 : trajectory.order + 1]]
    names += ["force", "power"] if load.inertia is not None else []
    names += ["current"] if load.inertia is not None and load.motor is not None else []
    found: dict[str, float] = {}
    for name in names:
        signal = trajectory.signal(name)
        found[f"peak_{name}"] = peak(signal)
        found[f"rms_{name}"] = rms(trajectory, signal)
    found["distance"] = absolute_integral(trajectory, trajectory.signal("velocity"), plain=True)
    if "power" in names:
        found["energy"] = absolute_integral(trajectory, *(trajectory.signal(x) for x in ("power", "force", "velocity")))
    if "current" in names:
        found |= _electrical(trajectory, found["rms_current"])
    for k, mode in enumerate(trajectory.problem.vibration, start=1):
        found[f"residual_vibration_{k}"] = vibration.left_by(trajectory, mode)
    return found


def _electrical(trajectory: Trajectory, rms_current: float) -> dict[str, float]:
    load = trajectory.problem.load
    assert load.motor is not None
    drawn, returned = _flows(trajectory)
    return {
        "peak_voltage": peak(trajectory.signal("voltage")),
        "copper_loss": load.motor[1] * rms_current**2 * trajectory.duration,
        "electrical_energy": drawn - load.recovery * returned,
        "brake_energy": returned,
    }


def _flows(trajectory: Trajectory) -> tuple[float, float]:
    """∫max(0, P)dt and ∫max(0, -P)dt of the electrical power; for the Euler scheme by the trapezoidal rule.

    By Gauss points between the places where force or velocity change their sign, halving around those of P.
    """
    load, force, velocity = trajectory.problem.load, trajectory.signal("force"), trajectory.signal("velocity")
    if not force.pieces:
        power = motor.power(load, force.nodes, velocity.nodes)
        signs = (np.maximum(power, 0.0), np.maximum(-power, 0.0))
        return float(np.trapezoid(signs[0], trajectory.time)), float(np.trapezoid(signs[1], trajectory.time))
    corners = [_reversals(trajectory, name) for name in ("force", "velocity")]
    trajectory = trajectory.cut(np.concatenate([*corners, np.linspace(0.0, trajectory.duration, _PARTS)]))
    for _ in range(_HALVINGS):
        power, energy = _drawn(trajectory)
        mixed = (power.min(axis=0) < 0) & (power.max(axis=0) > 0)
        if not np.any(mixed):
            break
        time = trajectory.time
        trajectory = trajectory.cut((time[:-1] + time[1:])[mixed] / 2)
    return float(np.sum(np.maximum(energy, 0.0))), float(np.sum(np.maximum(-energy, 0.0)))


def _drawn(trajectory: Trajectory) -> tuple[Floats, Floats]:
    """Electrical power at (points, N) of all intervals, ends included, and (N,) its integral over them."""
    force, velocity = trajectory.signal("force"), trajectory.signal("velocity")
    points, shares = gauss(16)
    at = [(force.within(OnFloats(), s), velocity.within(OnFloats(), s)) for s in (0.0, *points, 1.0)]
    power = np.stack([motor.power(trajectory.problem.load, f, v) for f, v in at])
    return power, shares @ power[1:-1] * trajectory.steps


def peak(signal: Signal) -> float:
    """max|x| at every instant, or at the nodes where only they mean something."""
    if not signal.pieces:
        return float(np.max(np.abs(signal.nodes)))
    pieces = signal.rows
    sizes = np.abs(pieces)
    best = float(np.max(sizes[[0, -1]]))
    doubtful = pieces[:, np.max(sizes, axis=0) > best]  # a polynomial lies within its coefficients
    if not doubtful.size:
        return best
    power = _power_form(doubtful)
    slope = power[1:] * np.arange(1, len(power))[:, None]
    inside = polynomial.polyval(_roots_inside(slope), power[:, None], tensor=False)
    return float(np.max(np.abs(inside), initial=best))


def rms(trajectory: Trajectory, signal: Signal) -> float:
    """sqrt((1/T)∫x²dt)."""
    if not signal.pieces:
        return float(np.sqrt(np.trapezoid(np.square(signal.nodes), trajectory.time) / trajectory.duration))
    pieces = signal.rows
    squares = np.sum(pieces * (_products(signal.degree) @ pieces), axis=0)
    return float(np.sqrt(trajectory.steps @ squares / trajectory.duration))


def absolute_integral(trajectory: Trajectory, signal: Signal, *factors: Signal, plain: bool = False) -> float:
    """∫|x|dt; for the Euler scheme the trapezoidal rule, or (plain) the rectangles it integrates with. ``factors``:
    what the signal is the product of, if anything: they change sign where it does, and have a lower degree."""
    if not signal.pieces:
        x = np.abs(signal.nodes)
        return float(trajectory.steps @ x[:-1] if plain else np.trapezoid(x, trajectory.time))
    pieces = signal.rows
    total = np.abs(_integrals(trajectory, signal))
    steps = trajectory.steps
    rounding = 1e-15 * np.max(np.abs(pieces))
    mixed = np.flatnonzero((pieces.min(axis=0) < -rounding) & (pieces.max(axis=0) > rounding))
    if len(mixed):
        power = _power_form(pieces[:, mixed])
        roots = np.concatenate([_changes(x.rows[:, mixed]) for x in factors or (signal,)])
        ends = np.concatenate([np.zeros((1, len(mixed))), np.sort(roots, axis=0), np.ones((1, len(mixed)))])
        integral = np.concatenate([np.zeros((1, len(mixed))), power / np.arange(1, len(power) + 1)[:, None]])
        risen = polynomial.polyval(ends, integral[:, None], tensor=False)
        total[mixed] = steps[mixed] * np.abs(np.diff(risen, axis=0)).sum(axis=0)
    return float(np.sum(total))


def _reversals(trajectory: Trajectory, name: str) -> Floats:
    """The times at which a signal changes its sign between nodes, s."""
    time, places = trajectory.time, _changes(trajectory.signal(name).rows)
    return np.sort((time[:-1] + places * np.diff(time))[places < 1])


def _changes(pieces: Floats) -> Floats:
    """(n, m) where between 0 and 1 m polynomials in Bernstein form (n+1, m) are zero, sorted; 1 where they are not."""
    found = np.ones((len(pieces) - 1, pieces.shape[1]))
    mixed = (pieces.min(axis=0) < 0) & (pieces.max(axis=0) > 0)
    if mixed.any():
        found[:, mixed] = _roots_inside(_power_form(pieces[:, mixed]))
    return found


def _integrals(trajectory: Trajectory, signal: Signal) -> Floats:
    """(N,) the integral over each interval: its length times the mean Bernstein coefficient."""
    integrals: Floats = trajectory.steps * signal.rows.mean(axis=0)
    return integrals


@cache
def _products(n: int) -> Floats:
    """(n+1, n+1) the integrals over [0, 1] of products of two Bernstein polynomials of degree n."""
    return np.array([[comb(n, i) * comb(n, j) / (comb(2 * n, i + j) * (2 * n + 1)) for i in range(n + 1)]
                     for j in range(n + 1)])  # fmt: skip


@cache
def _powers(n: int) -> Floats:
    return np.array([[(-1.0) ** (j - i) * comb(n, j) * comb(j, i) if i <= j else 0.0 for i in range(n + 1)]
                     for j in range(n + 1)])  # fmt: skip


def _power_form(bernstein: Floats) -> Floats:
    """(n+1, m) power coefficients, lowest first, of m polynomials from their Bernstein coefficients on [0, 1]."""
    power: Floats = _powers(len(bernstein) - 1) @ bernstein
    return power


def _roots_inside(power: Floats) -> Floats:
    """(n, m) the roots of m polynomials (n+1, m) between 0 and 1, sorted; 1 where there are fewer. By the quadratic
    formula, of higher degrees as eigenvalues of their companions."""
    if len(power) <= 3:
        return _sorted_inside(_quadratic_roots(power))
    found = np.ones((len(power) - 1, power.shape[1]))
    counts = np.abs(power) > 1e-14 * np.max(np.abs(power), axis=0, initial=0.0)
    degree = np.max(np.arange(len(power))[:, None] * counts, axis=0, initial=0)
    for n in range(1, len(power)):
        columns = np.flatnonzero(degree == n)
        if not len(columns):
            continue
        of = power[: n + 1, columns]
        if n <= 2:
            roots = _quadratic_roots(of)
        else:
            companion = np.zeros((len(columns), n, n))
            companion[:, 1:, :-1] = np.eye(n - 1)
            companion[:, :, -1] = -(of[:-1] / of[-1]).T
            complex_roots = np.linalg.eigvals(companion)
            roots = np.where(np.abs(complex_roots.imag) < 1e-9, complex_roots.real, 1.0).T
        found[:n, columns] = _sorted_inside(roots)
    return found


def _sorted_inside(roots: Floats) -> Floats:
    return np.sort(np.where((roots > 0) & (roots < 1), roots, 1.0), axis=0)


def _quadratic_roots(power: Floats) -> Floats:
    """(n, m) the roots of polynomials (n+1, m) of degree n or less, one or two, without cancellation; infinite or NaN
    where there are fewer."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if len(power) == 2:
            return np.asarray(-power[:1] / power[1])
        c, b, a = power
        larger = -(b + np.copysign(np.sqrt(b * b - 4 * a * c), b)) / 2
        return np.stack([larger / a, c / larger])
