"""The necessary conditions of an energy-optimal move (Wang, Ueda, Bortoff 2013), recomputed from its trajectory.

With λ1 = -(price of distance) the costate λ2 of the speed is integrated through the whole move, continuous, from the
value that the Hamiltonian H = Q + λ1 ω + λ2 dω/dt has at the start. Whether H then stays constant, the current
minimises it at every instant and the multipliers have the right sign is a matter of the trajectory alone.

On an arc where P = 0 with u < 0 the current follows the speed, as on a limited arc: the costate equation has the term
of that constraint, which the paper's (18) leaves out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from trajopt.velocity_domain.law import NA, NC, NU, PA, PC, PU, PV, S2, S11, S12, Codes, Law, Z
from trajopt.velocity_domain.motor import Floats
from trajopt.velocity_domain.pieces import NODES, Piece, integral, mapped, nodes, series
from trajopt.velocity_domain.servo import ServoOptimum

_LEVEL: Final = 1e-9  # relative: what counts as zero power, as on a limit
_SLIGHT: Final = 1e-13  # of the peak speed: just below it
_ROUNDING: Final = 1e-13  # of the current that holds the peak speed: what counts as none
_TRIALS: Final = 400  # admissible currents against which the Hamiltonian is compared

# The orders of arcs within each sub-trajectory that Theorems 15, 17, 19 and 20 admit.
_S11 = {(PU,), (PA, PU), (PU, PV, PU), (PA, PU, PV, PU)}
_S2 = {(Z,), (Z, NA), (Z, NU), (Z, NA, NU)}
_S12 = {(NU,), (NU, NA), (NA,)}


@dataclass(frozen=True)
class Conditions:
    """Numbers near or above 0 and booleans true for an optimum. Relative numbers are over the largest |Q| or |λ2|.

    ``theorems_apply``: the orders of arcs are proved for the cost max(0, R u² + Ks|u| + Kτ u ω) and no limit but those
    of speed and acceleration, the latter never slowing the move while u > 0; elsewhere the orders are reported, and may
    be false for an optimum.
    """

    hamiltonian: float  # its mean, W
    hamiltonian_spread: float  # relative
    costate_jump: float  # relative: between the costates that the arcs on the two sides of a junction ask for
    stationarity: float  # relative: |∂H/∂u| on unconstrained arcs, as a costate
    minimum_principle: float  # relative: by how much another admissible current has a lower H
    acceleration_multiplier: float  # relative: the least on limited arcs, inf without any
    speed_multiplier: float  # W per rad/s²: the least of the speed limit, inf without an arc on it
    power_multiplier: float  # the least distance of the multiplier of P = 0 from its ends, inf without such an arc
    subtrajectory_order: bool  # Theorems 9 and 11
    s11_order: bool  # Theorems 15 and 17
    s2_order: bool  # Theorem 19; true without S2
    s12_order: bool  # Theorem 20; true without S12
    theorems_apply: bool


@dataclass(frozen=True)
class _Stretch:
    """A piece at the nodes: (n,) each. ``kind`` is one of the names of arcs, found from the values."""

    piece: Piece
    kind: int
    sub: int
    on_power: bool  # P = 0 holds the current
    speed: Floats
    acceleration: Floats
    current: Floats
    pace: Floats  # dt/ds
    follow: float | Floats | None  # d(acceleration)/d(speed) where the current follows the speed
    cost_by_current: Floats
    cost_by_speed: Floats


def conditions(result: ServoOptimum) -> Conditions:
    """Recompute the necessary conditions on an answer."""
    law = result.law
    stretches = [_stretch(law, piece) for piece in result.pieces]
    costates = _costates(law, result, stretches)
    gain = law.motor.torque_constant / law.motor.inertia
    cost = [law.loss.cost(x.speed, x.current) for x in stretches]
    hamiltonian = [
        q - law.slope * x.speed + y * x.acceleration for q, x, y in zip(cost, stretches, costates, strict=True)
    ]
    everywhere, largest = np.concatenate(hamiltonian), max(float(np.abs(q).max()) for q in cost)
    big = max(float(np.abs(y).max()) for y in costates)
    wanted = [-x.cost_by_current / gain for x in stretches]
    off = [np.abs(y - w)[_clear(x)].max() for y, w, x in zip(costates, wanted, stretches, strict=True) if _free(x)]
    lower = [_lower(law, x, y, h) for x, y, h in zip(stretches, costates, hamiltonian, strict=True)]
    orders = _orders(stretches)
    return Conditions(
        hamiltonian=float(everywhere.mean()),
        hamiltonian_spread=float(np.ptp(everywhere)) / largest,
        costate_jump=_jump(stretches, costates, wanted) / big,
        stationarity=float(max(off, default=0.0)) / big,
        minimum_principle=max(lower) / largest,
        acceleration_multiplier=_least(
            x.piece.way * (w - y) for x, y, w in zip(stretches, costates, wanted, strict=True) if _limited(x)
        )
        / big,
        speed_multiplier=_least(_speed_multiplier(law, x, y) for x, y in zip(stretches, costates, strict=True)),
        power_multiplier=_least(
            np.minimum(share - law.loss.recovery, 1 - share)
            for share in (
                -y * gain / law.loss.power_by_current(x.speed, x.current)
                for x, y in zip(stretches, costates, strict=True)
                if x.on_power
            )
        ),
        subtrajectory_order=orders[0],
        s11_order=orders[1],
        s2_order=orders[2],
        s12_order=orders[3],
        theorems_apply=_apply(law, stretches),
    )


def _stretch(law: Law, piece: Piece) -> _Stretch:
    s = nodes()
    below = mapped(np.array(piece.begin), np.array(piece.end), s)
    speed = law.peak - below
    if piece.way == 0:
        acceleration, pace = np.zeros(NODES), np.full(NODES, piece.duration)
    else:
        acceleration = (law.rising if piece.way > 0 else law.falling)(below)[0]
        pace = (piece.end - piece.begin) * 6 * s * (1 - s) / -acceleration
    current = law.motor.current(speed, acceleration)
    sign = 0.0 if np.abs(current).max() <= _ROUNDING * law.motor.hold(law.peak) else float(np.sign(np.median(current)))
    kind, follow = _kind(law, piece, below, acceleration, sign)
    power = law.loss.power(speed, current)
    scale = law.loss.quadratic(speed) * current**2 + law.loss.mechanical * speed * np.abs(current)
    on_power = sign < 0 and follow is None and bool((np.abs(power) <= _LEVEL * scale).all())
    paying = sign != 0 and not on_power and float(np.median(power)) > 0
    by_current, by_speed = law.loss.power_by_current(speed, current), law.loss.power_by_speed(speed, current)
    weight = 0.0 if on_power or sign == 0 else 1.0 if paying else law.loss.recovery
    if on_power:
        gain, drag = law.motor.torque_constant / law.motor.inertia, law.motor.viscous / law.motor.inertia
        follow = -gain * by_speed / by_current - drag
    sub = (S11 if sign > 0 else S12) if paying else S2
    return _Stretch(
        piece, kind, sub, on_power, speed, acceleration, current, pace, follow, weight * by_current, weight * by_speed
    )


def _kind(law: Law, piece: Piece, below: Floats, acceleration: Floats, sign: float) -> tuple[int, float | None]:
    """The name of the arc, and the slope of the limit it lies on."""
    if piece.way == 0:
        limited = law.peak >= law.envelope.fastest * (1 - _LEVEL)
        return (Z if sign == 0 else PV if limited else PU), None
    limit, line = (law.envelope.top if piece.way > 0 else law.envelope.bottom)(law.peak, below)
    if np.isfinite(limit).all() and (np.abs(acceleration - limit) <= _LEVEL * np.abs(limit)).all():
        index = int(line[0])
        slope = (law.envelope.upper if piece.way > 0 else law.envelope.lower)[index][1]
        name = (PA if index == 0 else PC) if sign > 0 else (NA if index == 0 else NC)
        return name, slope
    return (Z if sign == 0 else PU if sign > 0 else NU), None


def _costates(law: Law, result: ServoOptimum, stretches: list[_Stretch]) -> list[Floats]:
    """(n,) λ2 on each piece: λ2' = -∂L/∂ω, a linear equation solved by collocation."""
    drag = law.motor.viscous / law.motor.inertia
    gain = law.motor.torque_constant / law.motor.inertia
    at_nodes, at_end = _integrals()
    value = _by_hamiltonian(law, result.time_price, np.array([law.peak]), law.rising)
    found = []
    for x in stretches:
        if x.piece.way == 0:
            after = _by_hamiltonian(law, result.time_price, np.array([_SLIGHT * law.peak]), law.falling)
            ends = (value, value) if x.kind != Z else (value, after)
            found.append(np.asarray(ends[0] + nodes() * (ends[1] - ends[0])))
            value = ends[1]
            continue
        if x.follow is None:
            rate, source = np.full(NODES, drag), law.slope - x.cost_by_speed
        else:
            rate = -x.follow * np.ones(NODES)
            source = law.slope - x.cost_by_speed - x.cost_by_current * (x.follow + drag) / gain
        matrix = np.eye(NODES) - at_nodes * (rate * x.pace)[None, :]
        here = np.asarray(np.linalg.solve(matrix, value + at_nodes @ (source * x.pace)), dtype=np.float64)
        value += float(at_end @ ((rate * here + source) * x.pace))
        found.append(here)
    return found


def _by_hamiltonian(law: Law, level: float, below: Floats, way: Callable[[Floats], tuple[Floats, Codes]]) -> float:
    """λ2 from the level of the Hamiltonian, at one speed."""
    speed, acceleration = law.peak - below, way(below)[0]
    cost = law.loss.cost(speed, law.motor.current(speed, acceleration))
    return float(((level - cost + law.slope * speed) / acceleration)[0])


def _integrals() -> tuple[Floats, Floats]:
    """(n, n) and (n,): values at the nodes -> integrals from s = 0 to the nodes and to 1."""
    whole = integral(series(np.eye(NODES)))
    at_nodes = np.asarray(chebyshev.chebval(2 * nodes() - 1, whole.T).T, dtype=np.float64)
    return at_nodes, np.asarray(whole.sum(axis=1), dtype=np.float64)


def _jump(stretches: list[_Stretch], costates: list[Floats], wanted: list[Floats]) -> float:
    """The largest jump at a junction: the costate of an unconstrained arc is the one its own current asks for."""
    at_ends = np.array([[-1.0, 1.0]])
    own = [w if _free(x) and _clear(x).all() else y for x, y, w in zip(stretches, costates, wanted, strict=True)]
    ends = [chebyshev.chebval(at_ends[0], series(values[None])[0]) for values in own]
    return max((abs(float(b[0] - a[1])) for a, b in zip(ends, ends[1:], strict=False)), default=0.0)


def _lower(law: Law, x: _Stretch, costate: Floats, hamiltonian: Floats) -> float:
    """By how much an admissible current beats the one chosen, W."""
    below = law.peak - x.speed
    top, bottom = law.envelope.top(law.peak, below)[0], law.envelope.bottom(law.peak, below)[0]
    width = 4 * np.abs(x.current).max() + 1
    low = np.maximum(law.motor.current(x.speed, bottom), -width)
    high = np.minimum(law.motor.current(x.speed, top if x.kind != PV else np.zeros(NODES)), width)
    trial = low + np.linspace(0, 1, _TRIALS)[:, None] * (high - low)
    value = law.loss.cost(x.speed, trial) - law.slope * x.speed + costate * law.motor.acceleration(x.speed, trial)
    return float(np.max(hamiltonian - value.min(axis=0)))


def _speed_multiplier(law: Law, x: _Stretch, costate: Floats) -> Floats:
    """What the speed limit adds to the costate equation at the peak; infinite elsewhere. Without a speed limit there,
    it is zero for an optimum."""
    if x.piece.way != 0:
        return np.full(1, np.inf)
    rate = (costate[-1] - costate[0]) / (nodes()[-1] - nodes()[0]) / x.piece.duration
    return np.asarray(law.slope - x.cost_by_speed + costate * law.motor.viscous / law.motor.inertia - rate)


def _free(x: _Stretch) -> bool:
    return x.kind in (PU, PV, NU) and not x.on_power


def _clear(x: _Stretch) -> NDArray[np.bool_]:
    """(n,) where the current is large enough that |u|^(γ - 1) has figures."""
    return np.asarray(np.abs(x.current) >= _LEVEL * np.abs(x.current).max())


def _limited(x: _Stretch) -> bool:
    return x.follow is not None and not x.on_power


def _least(values: object) -> float:
    return min((float(np.min(v)) for v in values), default=np.inf)  # type: ignore[attr-defined]


def _orders(stretches: list[_Stretch]) -> tuple[bool, bool, bool, bool]:
    """Whether the sub-trajectories, and the arcs in S11, S2 and S12, come in the order of the theorems."""
    subs = [sub for sub, _ in groupby(x.sub for x in stretches)]
    arcs = [tuple(kind for kind, _ in groupby(x.kind for x in stretches if x.sub == sub)) for sub in (S11, S2, S12)]
    allowed = ([S11], [S11, S2], [S11, S2, S12])
    return subs in allowed, arcs[0] in _S11, arcs[1] in {*_S2, ()}, arcs[2] in {*_S12, ()}


def _apply(law: Law, stretches: list[_Stretch]) -> bool:
    loss, drive = law.loss, len(law.envelope.upper) > 1
    pushed = any(x.kind == PA and x.piece.way < 0 for x in stretches)
    return not (loss.eddy or loss.hysteresis or loss.recovery or drive or pushed) and loss.mechanical > 0
