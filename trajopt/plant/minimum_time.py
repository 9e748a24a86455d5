"""Minimum-time commands for plants with any poles: structure from a coarse program, switching times exact, proved.

T. D. Tuttle, W. P. Seering, Creating time-optimal commands with practical constraints, Proc. IEEE CCA 1996: a command
of impulses brings the plant to rest iff it has zeros at the plant's poles. Where an oscillatory plant needs more
switches than states less one, the roots of the switching function supply the missing equations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trajopt.plant.basis import DECAYED, Basis
from trajopt.plant.coarse import Coarse, Move, coarse
from trajopt.plant.command import Command
from trajopt.plant.exponentials import Floats
from trajopt.plant.plant import Plant
from trajopt.plant.poles import GIVEN, repeated, settled
from trajopt.plant.polish import (
    Structure,
    costate_of,
    renewed,
    residuals,
    settle,
    settled_sign,
    sign_margin,
    without_rounding,
)
from trajopt.plant.simulate import end_error
from trajopt.plant.vibration import mode_pole

_MESHES: Final = (30, 60, 120, 240, 480)
_REPAIRS: Final = 4
_PERIODS: Final = 3000
_LEAST: Final = 1e-8  # of the input range: what must be left beyond u_ss for real poles
_MATCH: Final = 1e-9  # relative difference of u_ss and y_f/G(0) that still counts as agreement


@dataclass(frozen=True)
class Candidate:
    """A structure that solves the equations, with its costate and the margin of its sign test."""

    basis: Basis
    horizon: float
    structure: Structure
    costate: Floats
    margin: float

    @property
    def duration(self) -> float:
        """s."""
        return float(self.structure.h[0]) * self.horizon


def time_optimal(
    plant: Plant,
    umin: float,
    umax: float,
    u_ss: float | None = None,
    y_f: float | None = None,
    robust: str | Sequence[complex] = (),
) -> Command:
    """The shortest command that takes the plant from rest at y = 0 (u = 0) to rest at ``y_f``, umin <= u <= umax,
    with the input ``u_ss`` from then on.

    Without poles at zero either of ``u_ss`` and ``y_f`` follows from the other; with them ``u_ss`` is 0. ``robust``
    adds poles whose equations must hold too: "zvd" every oscillatory pole once more (zero derivative), or a list of
    poles (1/s; conjugates may be left out), repeated for flatness or spread over a band (`band`).

    ValueError: one line with a remedy, for input that cannot be met. RuntimeError: no structure was found.
    """
    u_ss, y_f = ends(plant, umin, umax, u_ss, y_f)
    move = _move(plant, umin, umax, u_ss, y_f, added_poles(plant, robust))
    best: Candidate | None = None
    start = coarse(move, _MESHES[0], np.empty(0), move.guess())
    for intervals in _MESHES:
        if intervals > _MESHES[0]:
            start = coarse(move, intervals, start.switches()[1], start.duration)
        _check_periods(move, start.duration)
        for candidate in _candidates(move, start):
            if best is None or _is_better(candidate, best):
                best = candidate
        if best is not None and settled_sign(best.margin):
            break
    if best is None:
        raise RuntimeError(
            f"no command found on meshes of up to {_MESHES[-1]} intervals; widen the input limits or move less"
        )
    return _command(plant, move, best, umin, umax, u_ss, y_f)


def band(low: float, high: float, damping: float = 0.0, count: int = 3) -> tuple[complex, ...]:
    """Upper poles (1/s) of ``count`` frequencies from ``low`` to ``high`` (rad/s), for ``robust``."""
    if not (0 < low <= high and 0 <= damping < 1 and count >= 1):
        raise ValueError(
            f"band: {low:g} to {high:g} rad/s, damping {damping:g}, {count} samples; needs 0 < low <= high, "
            "0 <= damping < 1, at least one sample"
        )
    return tuple(mode_pole(float(w), damping) for w in np.linspace(low, high, count))


def _is_better(one: Candidate, other: Candidate) -> bool:
    if settled_sign(one.margin) != settled_sign(other.margin):
        return settled_sign(one.margin)
    return one.duration < other.duration


def _candidates(move: Move, start: Coarse) -> Iterator[Candidate]:
    """The polished answer of one mesh, and what becomes of it when sigma's own roots correct its structure."""
    sign, switches = start.switches()
    structure, costate = Structure(sign, np.append(1.0, switches)), start.costate
    for _ in range(_REPAIRS):
        found = settle(move, start.basis, structure, costate)
        if found is None:
            return
        costate = costate_of(start.basis, found)
        margin = sign_margin(start.basis, found, costate)
        yield Candidate(start.basis, start.duration, found, costate, margin)
        if settled_sign(margin):
            return
        structure = renewed(start.basis, found, costate)
        if len(structure.h) == len(found.h):
            return


def ends(plant: Plant, umin: float, umax: float, u_ss: float | None, y_f: float | None) -> tuple[float, float]:
    """The final input and output, each from the other where one is missing; ValueError if they cannot be met."""
    given = [x for x in (umin, umax, u_ss, y_f) if x is not None]
    if not np.all(np.isfinite(given)) or not umin < umax:
        raise ValueError(f"input limits: {umin:g} to {umax:g}; they and the final values must be finite, umin < umax")
    if plant.rigid:
        u_ss = u_ss or 0.0
        if u_ss:
            raise ValueError(f"u_ss: {u_ss:g} keeps a plant with a pole at zero moving; give 0")
        if y_f is None:
            raise ValueError("y_f: missing; a plant with a pole at zero needs the final output")
    elif u_ss is None:
        if y_f is None or not plant.limit:
            raise ValueError("u_ss: missing, and it does not follow from y_f; give the final input")
        u_ss = y_f / plant.limit
    assert u_ss is not None
    y_f = u_ss * plant.limit if y_f is None else y_f
    if not plant.rigid and abs(y_f - u_ss * plant.limit) > _MATCH * max(abs(y_f), abs(u_ss * plant.limit)):
        held = u_ss * plant.limit
        raise ValueError(f"u_ss: {u_ss:g} holds y = {held:g}, not y_f = {y_f:g}; correct it or leave it out")
    if not umin <= u_ss <= umax:
        raise ValueError(
            f"u_ss: {u_ss:g}, which holds y_f = {y_f:g}, is outside the input limits {umin:g} to {umax:g}; "
            "widen them or move less"
        )
    if not (y_f if plant.rigid else u_ss):
        raise ValueError("y_f: a move of zero length needs no command; give a final value other than zero")
    _check_reach(plant, umin, umax, u_ss, y_f)
    return u_ss, y_f


def _check_reach(plant: Plant, umin: float, umax: float, u_ss: float, y_f: float) -> None:
    """A final input that is itself a limit leaves the input one side only, and real poles need both."""
    real = [p.real for p in plant.poles if p.real < 0 and not p.imag]
    if plant.rigid and (umin == 0 or umax == 0):
        forward = y_f / plant.limit > 0
        if plant.rigid > 1 or real or forward != (umax > 0):
            raise ValueError(
                f"input limits: {umin:g} to {umax:g} cannot both start and stop this move; allow both signs"
            )
    beyond = umax - u_ss if u_ss > 0 else u_ss - umin
    if real and not plant.rigid and beyond <= _LEAST * (umax - umin):
        raise ValueError(
            f"u_ss: {u_ss:g} is the input limit itself or too close to it, and the pole at {real[0]:.6g} gets there "
            "only in infinite time; widen the limit or move less"
        )


def _check_periods(move: Move, duration: float) -> None:
    for p in move.poles:
        periods = p.imag * min(duration, DECAYED / max(-p.real, 1e-300)) / (2 * np.pi)
        if periods > _PERIODS:
            raise ValueError(
                f"plant: the mode at {p:.6g} swings {periods:.0f} times in a move of {duration:.4g} s, too often to "
                f"time its switches (at most {_PERIODS}); leave it out or damp it"
            )


def added_poles(plant: Plant, robust: str | Sequence[complex]) -> tuple[complex, ...]:
    """The poles of ``robust`` (see `time_optimal`) with their conjugates; ValueError if there are none to add."""
    if isinstance(robust, str):
        if robust != "zvd":
            raise ValueError(f'robust: "{robust}"; give "zvd" or a list of poles')
        added = tuple(p for p in dict.fromkeys(plant.poles) if p.imag)
        if not added:
            raise ValueError('robust: "zvd", but the plant has no oscillatory pole; leave it out or list poles')
        return added
    upper = [complex(p) for p in robust]
    conjugates = [p.conjugate() for p in upper if p.imag and upper.count(p.conjugate()) < upper.count(p)]
    if not np.all(np.isfinite(upper)) or 0 in upper or any(p.real > 0 for p in upper):
        raise ValueError("robust: poles must be finite, not zero and not unstable (real part above zero)")
    return settled([*upper, *conjugates], GIVEN)


def _move(plant: Plant, umin: float, umax: float, u_ss: float, y_f: float, added: tuple[complex, ...]) -> Move:
    unit = max(abs(umin), abs(umax))
    rest = y_f / plant.limit / unit if plant.rigid else 0.0
    return Move(repeated((*plant.poles, *added), GIVEN), umin / unit, umax / unit, u_ss / unit, rest)


def _command(plant: Plant, move: Move, best: Candidate, umin: float, umax: float, u_ss: float, y_f: float) -> Command:
    structure, duration = without_rounding(best.structure), best.duration
    switches = tuple(float(x) for x in duration - structure.h[1:] * best.horizon)
    up = structure.sign * (-1.0) ** np.arange(len(structure.h)) > 0
    levels = tuple(umax if x else umin for x in up)
    return Command(
        umin=umin,
        umax=umax,
        u_ss=u_ss,
        y_f=y_f,
        switches=switches,
        levels=levels,
        duration=duration,
        poles=move.poles,
        residuals=tuple(float(x) for x in residuals(move, best.basis, structure)),
        end_error=end_error(plant.matrices, (0.0, *switches, duration), levels, u_ss, y_f),
        optimal=settled_sign(best.margin) and levels[-1] != u_ss,
        margin=best.margin,
        costate=tuple(float(x) for x in best.costate),
        basis=best.basis,
        horizon=best.horizon,
    )
