"""The plant driven through a command by matrix exponentials: knows nothing of the equations that it verifies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm

from trajopt.checker.linear_system import System
from trajopt.plant.command import Command
from trajopt.plant.exponentials import Floats
from trajopt.plant.plant import Plant, StateSpace


def response(plant: Plant, command: Command, times: Floats) -> Floats:
    """(m,) the output y at times (m,) s >= 0, also after the command."""
    starts, levels = command.impulses[0], np.array([*command.levels, command.u_ss])
    t = np.asarray(times, float)
    if t.ndim != 1 or np.any(t < 0):
        raise ValueError(f"times: {t.shape}; give a row of times from 0 on")
    states = pieces(plant.matrices, starts, levels[:-1])
    piece = np.searchsorted(starts, t, side="right") - 1
    system = System(*plant.matrices)
    exponentials, integrals = system.reached(t - starts[piece])
    later = (exponentials @ states[piece, :, None])[:, :, 0] + integrals * levels[piece, None]
    result: Floats = later @ system.c + system.d * levels[piece]
    return result


def end_error(
    matrices: StateSpace, times: Sequence[float] | Floats, levels: Sequence[float] | Floats, u_ss: float, y_f: float
) -> float:
    """The worst state and output at the end against the equilibrium with y = y_f, each relative to its largest value at
    the switches. ``times`` (m + 2,) s from 0, with ``levels`` (m + 1,) between them."""
    _, _, c, d = matrices
    states = pieces(matrices, times, levels)
    rest = equilibrium(matrices, u_ss, y_f)
    values = np.hstack([states, (states @ c)[:, None]])
    wanted = np.append(rest, y_f - d * u_ss)
    largest = np.maximum(np.max(np.abs(values), axis=0), np.abs(wanted))
    return float(np.max(np.abs(values[-1] - wanted) / np.maximum(largest, 1e-300)))


def pieces(matrices: StateSpace, times: Sequence[float] | Floats, levels: Sequence[float] | Floats) -> Floats:
    """(m + 2, n) the states at the times, from rest."""
    states = [np.zeros(len(matrices[0]))]
    for step, level in zip(np.diff(times), levels, strict=True):
        states.append(_advance(matrices, states[-1], level, step))
    return np.array(states)


def _advance(matrices: StateSpace, state: Floats, level: float, step: float) -> Floats:
    """(n,) the state a step (s) later under a constant input."""
    a, b, _, _ = matrices
    n = len(a)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a * step, b * (level * step)
    later: Floats = (expm(block) @ np.append(state, 1.0))[:n]
    return later


def equilibrium(matrices: StateSpace, u_ss: float, y_f: float) -> Floats:
    """(n,) the state at rest with the input u_ss and the output y_f."""
    a, b, c, d = matrices
    rate, gain = (float(np.linalg.norm(x)) or 1.0 for x in (a, c))
    rows = np.vstack([a / rate, c / gain])
    right = np.append(-b * u_ss / rate, (y_f - d * u_ss) / gain)
    rest: Floats = np.linalg.lstsq(rows, right, rcond=None)[0]
    return rest
