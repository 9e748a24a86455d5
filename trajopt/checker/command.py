"""The checks of a minimum-time command for a linear plant.

The plant is realised anew from the problem's data and driven through the command: it must end at rest at the final
value. That nothing is faster: with any row l, every command that brings the plant to rest obeys

    l'x(T) = ∫ sigma(s) u(T - s) ds <= ∫ max(sigma u) ds over 0 .. T,    sigma(s) = l' exp(A s) B,

over the inputs u within their limits, so T is at least the time at which the right side, which does not depend on the
command, reaches the left (weak duality; the maximum principle of Pontryagin is the case of equality). The row is one
whose sigma vanishes at the switches; where many do, the one whose sigma is nearest to the samples in the file.

Tolerances, relative: end at rest and final value 1e-6 of the largest value on the way; the sign of sigma 1e-7 of the
sum of its terms; the bound 1e-6.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt.checker.case import Array
from trajopt.checker.command_reading import FORMAT, Commanded, read_command
from trajopt.checker.linear_system import System, chain
from trajopt.checker.report import Check, question
from trajopt.checker.result_file import _text as read_text

__all__ = ["FORMAT", "REST", "command_bound", "command_checks", "steps_checks"]
REST: Final = 1e-6
_SIGN: Final = 1e-7
_GAP: Final = 1e-6
_CLAIM: Final = 1e-9
_TIME: Final = 1e-12
_VALUE: Final = 1e-6
_PRINTED: Final = 1e-15
_NULL: Final = 1e-8  # of the largest: singular values below it are zero
_ARC: Final = 40  # samples of sigma an arc, at least
_MOST: Final = 20_000  # samples of sigma in all
_PERIOD: Final = 24  # samples an oscillation


def command_checks(result: Mapping[str, Any], notes: list[str]) -> list[Check]:
    """Everything that is checked of a command; what is not goes to ``notes``. Never raises on the content."""
    try:
        with np.errstate(all="ignore"):
            commanded = read_command(result, notes)
            if commanded is None:
                notes.append(f"the verdict {result['status']} (nothing in the file proves it)")
                return [question("structure")]
            return [question("structure"), *_of_the_command(commanded), *_of_the_proof(commanded, notes)]
    except np.linalg.LinAlgError as error:
        return [question("simulation", f"its numbers do not stay finite: {error}")]
    except (ValueError, OverflowError, RecursionError) as fault:  # Malformed among them
        return [question("structure", str(fault) or "nested too deeply")]


def command_bound(result: Mapping[str, Any]) -> float | None:
    """The lower bound (s) on the duration of any command, from the switches of this one; None where none is found."""
    try:
        with np.errstate(all="ignore"):
            commanded = read_command({**result, "certificate": None}, [])
            proof = None if commanded is None else _proof(commanded)
    except ValueError:  # Malformed and LinAlgError among them
        return None
    return None if proof is None else proof[1]


def steps_checks(path: Path, result: Mapping[str, Any]) -> list[Check]:
    """Whether a command.csv beside a result.json says the same: a row a jump of the input, its time and the level."""
    table = path.with_name("command.csv")
    if path.name != "result.json" or not os.path.lexists(table):
        return []
    try:
        with np.errstate(all="ignore"):
            x = read_command(result, [])
        rows = [row for row in read_text(table).splitlines() if row and not row.startswith("#")]
        cells = [row.split(",") for row in rows]
        given = np.array([[float(cell) for cell in row] for row in cells[1:]])
    except (ValueError, RecursionError) as error:
        return [question("command.csv", f"cannot be compared: {error}")]
    if x is None:
        return [question("command.csv", "carries numbers although the result is no solution")]
    expected = np.column_stack([x.time, [*x.levels, x.final_input]])
    fault = "" if cells[:1] == [["t [s]", "u"]] else "its header is not t [s],u"
    if given.shape != expected.shape:
        fault = f"has {len(given)} rows where {len(expected)} belong"
    elif not np.all(np.abs(given - expected) <= _PRINTED * np.abs(expected)):
        fault = "has other numbers than the result"
    return [question("command.csv", fault)]


def _of_the_command(x: Commanded) -> list[Check]:
    off = np.minimum(np.abs(x.levels - x.low), np.abs(x.levels - x.high))
    outside = max(x.low - x.final_input, x.final_input - x.high, 0.0)
    checks = [
        _close("duration", x.duration, x.duration, float(x.time[-1]), _TIME),
        _close("objective", x.duration, x.objective, x.duration, _TIME),
        question("levels", "" if not np.any(off) else "an input is neither the least nor the largest"),
        question("final input", "outside the limits" if outside else ""),
    ]
    if x.wanted_input is not None:
        checks.append(_close("final input as stated", x.duration, x.final_input, x.wanted_input, _TIME))
    checks.append(_at_rest("end at rest", x.plant, x))
    if x.added:
        checks.append(_at_rest("robust end at rest", _augmented(x), x))
    states, inputs = _driven(x.plant, x)
    output = states @ x.plant.c + x.plant.d * inputs
    largest = float(np.max(np.abs(output)))
    checks.append(_close("final value", x.duration, float(output[-1]), x.final_value, REST, largest))
    known = _metrics(x)
    named = ((name, value) for name, value in x.metrics.items() if name in known)
    return [*checks, *(_close(f"metric {name}", None, value, known[name], _VALUE, 1.0) for name, value in named)]


def _of_the_proof(x: Commanded, notes: list[str]) -> list[Check]:
    notes += [f"metrics.{name}" for name in x.metrics if name not in _metrics(x)]
    proof = _proof(x)
    if proof is None:
        notes.append("optimality (many switching functions vanish at the switches, and none is in the file)")
        return [question("optimality", "SOLVED without a proof")] if x.solved else []
    astray, bound = proof
    gap = (x.duration - bound) / x.duration
    checks = []
    if x.solved:
        checks.append(Check("sign of the switching function", astray, _SIGN, None, astray <= _SIGN))
        checks.append(Check("optimality", gap, _GAP, None, gap <= _GAP))
    if x.lower_bound is None or x.gap is None:
        notes.append("certificate (it has no lower bound)")
        return checks
    over = max(x.lower_bound - bound, 0.0) / x.duration
    checks.append(Check("certificate bound", over, _CLAIM, None, over <= _CLAIM))
    off = abs(x.gap - (x.duration - x.lower_bound) / x.duration)
    return [*checks, Check("certificate gap", off, _CLAIM, None, off <= _CLAIM)]


def _close(name: str, time: float | None, value: float, wanted: float, tolerance: float, size: float = 0.0) -> Check:
    """A number against what it should be; ``tolerance`` is relative to the larger of it and ``size``."""
    off, allowed = abs(value - wanted), tolerance * max(abs(wanted), size)
    return Check(name, off, allowed, time, bool(off <= allowed))


def _augmented(x: Commanded) -> System:
    """A chain of the plant's poles and the added ones: it rests only if all their modes do."""
    return chain([*x.poles, *x.added], (), 1.0).balanced()


def _driven(system: System, x: Commanded, points: int = 8) -> tuple[Array, Array]:
    """States (k, n) and inputs (k,) before and after every jump of the command and between, the last at its end."""
    state, states, inputs = np.zeros(len(system.b)), [], []
    shares = np.linspace(0.0, 1.0, points + 1)
    for length, level in zip(-np.diff(x.backward), x.levels, strict=True):
        exponentials, integrals = system.reached(shares * length)
        reached = exponentials @ state + integrals * level
        states += list(reached)
        inputs += [level] * len(shares)
        state = reached[-1]
    return np.array([*states, state]), np.array([*inputs, x.final_input])


def _at_rest(name: str, system: System, x: Commanded) -> Check:
    """The rates of the states at the end, under the final input, relative to their largest on the way."""
    states, inputs = _driven(system, x)
    rates = np.abs(states @ system.a.T + np.outer(inputs, system.b))
    worst = float(np.max(rates[-1] / np.maximum(np.max(rates, axis=0), 1e-300)))
    return Check(name, worst, REST, x.duration, bool(worst <= REST))


def _metrics(x: Commanded) -> dict[str, float]:
    """What the solution's metrics must be: the number of switches, and of every oscillatory mode of the plant its
    frequency (Hz), damping ratio and residual vibration (per cent of all jumps in step)."""
    found = {"switches": float(len(x.levels) - 1)}
    jumps = np.diff([0.0, *x.levels, x.final_input])
    for k, p in enumerate(x.modes, 1):
        found[f"mode{k}_frequency"] = abs(p) / (2 * np.pi * x.duration)
        found[f"mode{k}_damping"] = -p.real / abs(p)
        left = abs(np.exp(p * x.backward) @ jumps) / np.sum(np.abs(jumps))
        found[f"mode{k}_residual"] = float(100 * left)
    return found


def _proof(x: Commanded) -> tuple[float, float] | None:
    """How far sigma goes astray of the sign of its arc, relative to its terms; the lower bound on the duration, s."""
    system = _augmented(x)
    row = _row(system, x)
    if row is None:
        return None
    s, level = _samples(system, x)
    exponentials, integrals = system.reached(s)
    waves = exponentials @ system.b
    sigma, area = waves @ row, integrals @ row
    input_up = np.where(np.isin(s, x.backward), 0.0, level - (x.low + x.high) / 2)
    astray = -(sigma * np.sign(input_up)) / np.maximum(np.abs(waves) @ np.abs(row), 1e-300)
    target = float(np.diff(area) @ level[:-1])
    bound = _first_reached(system, row, s, area, target, (x.low, x.high))
    return float(np.max(astray, initial=0.0)), bound * x.duration


def _row(system: System, x: Commanded) -> Array | None:
    """(n,) the row whose sigma vanishes at the switches, with the sign that the arcs ask for."""
    waves = system.reached(x.backward[1:-1])[0] @ system.b
    rows = waves / np.maximum(np.linalg.norm(waves, axis=1, keepdims=True), 1e-300)
    if len(rows):
        _, sizes, right = np.linalg.svd(rows)
        rank = min(int(np.sum(sizes > _NULL * sizes[0])), len(system.b) - 1)
    else:
        right, rank = np.eye(len(system.b)), 0
    kernel = right[rank:].T
    if kernel.shape[1] > 1:
        if x.sigma is None:
            return None
        time, values = x.sigma
        table = system.reached(np.maximum(1 - time / x.time[-1], 0.0))[0] @ system.b @ kernel
        row: Array = kernel @ np.linalg.lstsq(table, values, rcond=1e-12)[0]
    else:
        row = kernel[:, 0]
    arcs = np.diff(system.reached(x.backward[::-1])[1] @ row)[::-1]
    return row if arcs @ (x.levels - (x.low + x.high) / 2) >= 0 else -row


def _samples(system: System, x: Commanded) -> tuple[Array, Array]:
    """Backward times, rising from 0 to 1, that resolve every arc, oscillation and decay; the input from each on."""
    ends = x.backward[::-1]
    poles = np.linalg.eigvals(system.a)
    count = int(np.clip(_PERIOD * np.max(np.abs(poles.imag)) / (2 * np.pi), 400, _MOST))
    parts = [np.linspace(0.0, 1.0, count), *(np.linspace(a, b, _ARC) for a, b in zip(ends, ends[1:], strict=False))]
    parts += [np.geomspace(0.01, 40.0, 60) / rate for rate in {float(-p.real) for p in poles} if rate > 1]
    s = np.unique(np.concatenate([*parts, ends]))
    s = s[(s >= 0) & (s <= 1)]
    arc = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(ends) - 2)
    return s, x.levels[::-1][arc]


def _first_reached(
    system: System, row: Array, s: Array, area: Array, target: float, limits: tuple[float, float]
) -> float:
    """The first backward time at which the integral of max(sigma u) reaches ``target``, at most 1."""
    gains = np.max(np.outer(np.diff(area), limits), axis=1)
    reached = np.concatenate([[0.0], np.cumsum(gains)])
    k = int(np.argmax(reached >= target)) - 1
    if target <= 0 or k < 0:
        return 0.0 if target <= 0 else 1.0
    low, high = float(s[k]), float(s[k + 1])
    for _ in range(60):
        middle = (low + high) / 2
        part = float(system.reached(np.array([middle]))[1][0] @ row) - float(area[k])
        enough = reached[k] + max(part * limits[0], part * limits[1]) >= target
        low, high = (low, middle) if enough else (middle, high)
    return low
