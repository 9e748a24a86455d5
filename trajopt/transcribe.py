"""The one constraint builder: a problem, laid on a mesh by a scheme, becomes rows and an objective on any model."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from trajopt import vibration
from trajopt.envelope import Envelope
from trajopt.fields import Limit, Table
from trajopt.mesh import LARGE, Floats, Mesh, mesh_for
from trajopt.model import finite_sides, own_size
from trajopt.problem import DERIVATIVES, Problem
from trajopt.quantities import Quantities
from trajopt.scaling import Sizes, sizes_of
from trajopt.schemes import SCHEMES, Scheme, trapezoids
from trajopt.signals import Signal, gauss

_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Setting:
    """All that a transcription needs beside the model: the problem, its mesh, scheme and sizes."""

    problem: Problem
    mesh: Mesh
    scheme: Scheme
    sizes: Sizes
    quantities: Callable[..., Quantities] = Quantities  # makes force and power from the chain; a relaxation has its own
    laid: dict[Any, Transcript] = field(default_factory=dict, compare=False, repr=False)  # see `transcribe_again`

    @classmethod
    def of(cls, problem: Problem) -> Setting:
        """The setting of a problem, from its transcription section."""
        return cls(problem, mesh_for(problem), SCHEMES[problem.transcription.scheme], sizes_of(problem))


def without(setting: Setting, names: Sequence[str]) -> Setting:
    """The setting without some limits."""
    names = [name for name in names if getattr(setting.problem.limits, name) is not None]
    if not names:
        return setting
    limits = setting.problem.limits.model_copy(update=dict.fromkeys(names))
    return replace(setting, problem=setting.problem.model_copy(update={"limits": limits}))


def drawn_in(setting: Setting, share: float, sampled: bool = False) -> Setting:
    """The setting with every constant limit drawn in by a share of itself, but not past a prescribed state;
    ``sampled``: only those of force and what follows from it, which some loads make no polynomials of."""
    move = setting.problem.move
    states = [state.fixed(setting.problem.order, None) for state in (move.start, move.end, *move.via)]

    def side(name: str, bound: float | Table | None, sign: float) -> float | Table | None:
        if not isinstance(bound, float) or name == "position" or (sampled and name in DERIVATIVES):
            return bound
        i = DERIVATIVES.index(name) if name in DERIVATIVES else -1
        given = [sign * state[i] for state in states if i in state]
        return sign * max(sign * bound - share * abs(bound), max(given, default=-np.inf))

    limits: dict[str, Limit | Envelope] = {
        name: limit.model_copy(update={"min": side(name, limit.min, -1.0), "max": side(name, limit.max, 1.0)})
        for name, limit in setting.problem.limits
        if isinstance(limit, Limit)
    }
    problem = setting.problem
    if problem.limits.envelope is not None:
        limits["envelope"] = problem.limits.envelope.scaled(1 - share)
    return replace(setting, problem=problem.model_copy(update={"limits": problem.limits.model_copy(update=limits)}))


@dataclass(frozen=True)
class Transcript:
    """A transcribed problem: the expressions from which the floats of the answer are read."""

    problem: Problem
    mesh: Mesh
    scheme: Scheme
    sizes: Sizes
    model: Any
    chain: list[Any]
    duration: Any  # s: a float, or an expression when it is free
    quantities: Quantities
    widen: Mapping[str, Any] = field(default_factory=dict)
    phased: bool = False  # whether the steps are no fixed fractions of the duration
    lowered: dict[int, Any] = field(init=False, default_factory=dict)  # see `trajopt.objective.lower`

    @property
    def shares(self) -> Any:
        """(N,) the fraction of the duration that each interval takes: floats, or expressions where parts are free."""
        return self.quantities.steps / self.duration if self.phased else self.mesh.steps


@dataclass(frozen=True)
class Waypoints:
    """Position at the ends and where it is prescribed, (k,) ``values`` at ``nodes``: at the others it is no variable,
    since nothing is said of it there. That saves a convex program a seventh of its time."""

    nodes: tuple[int, ...]
    values: Any

    def __getitem__(self, nodes: Any) -> Any:
        """The position at one of the nodes, which may be counted from the end, or at an array of them."""
        return self.values[np.searchsorted(self.nodes, np.where(np.less(nodes, 0), self.nodes[-1] + 1, 0) + nodes)]

    def follow(self, model: Any, change: Any, size: float) -> None:
        """Demand that it grows from one of its nodes to the next by the sum of the (N,) changes."""
        for k, (left, right) in enumerate(zip(self.nodes, self.nodes[1:], strict=False)):
            grown = model.total(np.ones(right - left), change[left:right])
            model.zero(self.values[k + 1] - self.values[k] - grown, size)


def _needs_path(problem: Problem) -> bool:
    """Whether position counts between the ends and the nodes where it is prescribed."""
    asked = any(term.minimize == "position" for term in problem.objective.all_terms)
    return asked or problem.limits.position is not None or bool(problem.load.curves)


def transcribe(setting: Setting, model: Any, duration: Any, widen: Mapping[str, Any] = _NOTHING) -> Transcript:
    """Kinematics, boundary and via states, and limits of a problem on ``model``; the objective comes separately.

    ``duration`` (s) is a float, or an expression of a nonconvex model. ``widen`` maps sides of limits, such as
    ``velocity.max``, to scalar expressions: the side is moved outwards by so many times its own value (see
    `trajopt.model.own_size`).
    """
    transcript = lay(setting, model, duration, widen=widen)
    hold(transcript)
    return transcript


def transcribe_again(setting: Setting, empty: Any, duration: float) -> Transcript:
    """`transcribe`, of which the programs of one solve share what they have in common: rows that are kinematic alone
    are laid once, on the ``empty`` model, and copied."""
    problem = setting.problem
    kinematic = not problem.vibration and problem.limits.given.keys() <= set(DERIVATIVES)
    if setting.mesh.intervals > LARGE or not kinematic:
        return transcribe(setting, empty, duration)
    key = (id(problem), id(setting.mesh), id(setting.sizes), duration)  # of what the transcript keeps alive
    if key not in setting.laid:
        setting.laid[key] = transcribe(replace(setting, quantities=Quantities), empty, duration)
    laid = setting.laid[key]
    model, known = laid.model.copied(), laid.quantities
    own = setting.quantities(problem, model, known.scheme, known.mesh, known.sizes, known.chain, known.steps)
    return replace(laid, model=model, quantities=own)


def lay(
    setting: Setting, model: Any, duration: Any, steps: Any = None, widen: Mapping[str, Any] = _NOTHING
) -> Transcript:
    """The first half of `transcribe`: kinematics, boundary and via states, and what bounds a variable; ``steps`` (N,),
    s, are expressions where parts of the duration are free by themselves."""
    problem, mesh, scheme, sizes = setting.problem, setting.mesh, setting.scheme, setting.sizes
    phased = steps is not None
    steps = steps if phased else model.times(mesh.steps, duration)
    chain = _variables(problem, mesh, sizes, model, duration, widen)
    for i in range(problem.order):
        change = scheme.change(model, chain, i, steps)
        if isinstance(chain[i], Waypoints):
            chain[i].follow(model, change, sizes.derivative[i])
        else:
            model.zero(chain[i][1:] - (chain[i][:-1] + change), sizes.derivative[i])
    stated = prescribed(problem, mesh)
    for i in range(problem.order):
        if nodes := [node for node, j, _ in stated if j == i]:
            values = np.array([value for _, j, value in stated if j == i])
            model.zero(chain[i][np.array(nodes)] - values, sizes.derivative[i])
    known = setting.quantities(problem, model, scheme, mesh, sizes, chain, steps)
    return Transcript(problem, mesh, scheme, sizes, model, chain, duration, known, widen, phased)


def hold(transcript: Transcript) -> None:
    """The second half of `transcribe`: rows for the limits on all that is no variable, on a transcript whose quantities
    are known."""
    problem = transcript.problem
    special = {"envelope": _envelope, "rms_force": _rms, "brake_energy": _brake}
    for name, limit in problem.limits.given.items():
        special.get(name, _limit)(transcript, name, limit)
    for mode in problem.vibration:
        vibration.rows(transcript, mode)


def prescribed(problem: Problem, mesh: Mesh) -> list[tuple[int, int, float]]:
    """(node, derivative, value) of every boundary and via condition, as in `Problem.prescribed`."""
    nodes = {0.0: 0, 1.0: mesh.intervals}
    return [(nodes[at] if at in nodes else mesh.node_at(at), i, value) for at, i, value in problem.prescribed]


def _variables(
    problem: Problem, mesh: Mesh, sizes: Sizes, model: Any, duration: Any, widen: Mapping[str, Any]
) -> list[Any]:
    """The chain: (N+1,) node values of each derivative below the order, (N,) interval values at the order.

    Node limits are bounds of the variables, except where a boundary state is prescribed (there an equality says it)
    and where they are to be widened. Position is held at waypoints alone where that is enough.
    """
    chain: list[Any] = []
    for i in range(problem.order + 1):
        if i == 0 and model.convex and not _needs_path(problem):
            nodes = sorted({0, mesh.intervals, *(node for node, j, _ in prescribed(problem, mesh) if j == 0)})
            infinite = np.full(len(nodes), np.inf)
            chain.append(Waypoints(tuple(nodes), model.vector(len(nodes), sizes.derivative[0], -infinite, infinite)))
            continue
        name = DERIVATIVES[i]
        lower, upper = node_limits(problem, i, mesh, duration)
        if f"{name}.min" in widen:
            lower = np.full(len(lower), -np.inf)
        if f"{name}.max" in widen:
            upper = np.full(len(upper), np.inf)
        places = mesh.places(top=i == problem.order)
        origin = origin_of(problem, name)
        chain.append(model.vector(len(lower), sizes.derivative[i], lower, upper, name, places, origin))
    return chain


def node_limits(problem: Problem, i: int, mesh: Mesh, duration: Any) -> tuple[Floats, Floats]:
    """Lower and upper limit of the i-th derivative at the nodes, or of the top one over whole intervals; infinite where
    there is none or where a state is prescribed."""
    top = i == problem.order
    limit = getattr(problem.limits, DERIVATIVES[i])
    count = mesh.intervals + (not top)
    if limit is None:
        return np.full(count, -np.inf), np.full(count, np.inf)
    lower, upper = sides(problem, i, limit, duration, mesh.fractions)
    if top:
        return np.maximum(lower[:-1], lower[1:]), np.minimum(upper[:-1], upper[1:])
    for node in (node for node, j, _ in prescribed(problem, mesh) if j == i):
        lower[node], upper[node] = -np.inf, np.inf
    return lower, upper


def sides(problem: Problem, i: int, limit: Limit, duration: Any, fractions: Floats) -> tuple[Floats, Floats]:
    """A limit at fractions of the duration; that of position (i = 0) as displacement from the start."""
    times = fractions * (duration if isinstance(duration, float) else 1.0)
    lower, upper = limit.at(times)
    origin = origin_of(problem, DERIVATIVES[i]) if i >= 0 else 0.0
    lower = np.full(len(fractions), -np.inf) if lower is None else lower
    upper = np.full(len(fractions), np.inf) if upper is None else upper
    return (lower - origin, upper - origin) if origin else (lower, upper)


def origin_of(problem: Problem, name: str) -> float:
    """What the chain's position is counted from, m or rad; zero for all other signals."""
    return (problem.move.start_position or 0.0) if name == "position" else 0.0


def _limit(transcript: Transcript, name: str, limit: Limit) -> None:
    """Rows that hold a limit between nodes (and, for what is no variable or is widened, at them)."""
    _hold(transcript, name, transcript.quantities.signal(name), limit)


def _hold(transcript: Transcript, name: str, signal: Signal, limit: Limit) -> None:
    problem, mesh, duration = transcript.problem, transcript.mesh, transcript.duration
    i = DERIVATIVES.index(name) if name in DERIVATIVES else -1
    if i >= 0 and transcript.widen:  # else the bounds of the variables hold it there
        at_nodes, places = node_limits(problem, i, mesh, duration), mesh.places(top=i == problem.order)
        _rows(transcript, name, transcript.chain[i], at_nodes, places, only=transcript.widen)
    elif i < 0 and signal.nodes is not None:
        _rows(transcript, name, signal.nodes, sides(problem, i, limit, duration, mesh.fractions), mesh.fractions)
    if i == problem.order:
        return  # the top derivative is constant on intervals: nothing is left to hold
    for b, at in _between(signal):
        where = mesh.fractions[:-1] + mesh.steps * at
        lower, upper = sides(problem, i, limit, duration, where)
        if i >= 0:
            _skip_prescribed(problem, mesh, i, b, signal.degree, lower, upper)
        _rows(transcript, name, signal.pieces[b], (lower, upper), where)


def _between(signal: Signal) -> list[tuple[int, float]]:
    """The pieces that are held beside the nodes, each with its place in the intervals."""
    if signal.points:
        return list(enumerate(signal.points))
    held = range(1, signal.degree) if signal.nodes is not None else range(signal.degree + 1)
    return [(b, b / signal.degree if signal.degree else 0.5) for b in held]


def _envelope(transcript: Transcript, name: str, limit: Limit) -> None:
    """Force and speed below every side of the envelope; of a move one way, the sides that it can meet."""
    envelope, way = transcript.problem.limits.envelope, transcript.problem.one_way
    assert envelope is not None
    for force, velocity in envelope.lines:
        for sign in (1, -1) if force and velocity else (1,):
            held = limit
            if way and velocity:  # a·F + b·v from below, or from above, where v has one sign, follows from others
                held = Limit(max=limit.max) if sign == way else Limit(min=limit.min)
            _hold(transcript, name, transcript.quantities.mix(force, sign * velocity), held)


def _rms(transcript: Transcript, name: str, limit: Limit) -> None:
    """The RMS of force over the cycle, exactly: by Gauss points on the interval polynomials (Euler: trapezoids; a load
    over position: Lobatto points, and what holds it through the dwell)."""
    model, size, duration = transcript.model, transcript.sizes.of(name), transcript.duration
    force, steps, dwell = transcript.quantities.signal("force"), transcript.mesh.steps, transcript.problem.move.dwell
    if force.points:
        held = transcript.quantities.holding() * (dwell / duration) ** 0.5
        samples = model.concatenate([force.samples(model), np.array([held], dtype=object)])
        weights = np.append(transcript.scheme.weights(force, transcript.mesh.steps), 1.0)
    elif force.pieces:
        points, shares = gauss(force.degree + 1)
        samples = model.concatenate([force.within(model, point) for point in points])
        weights = np.concatenate([share * steps for share in shares])
    else:
        samples, weights = force.nodes, trapezoids(steps)
    rms = model.variable(1)
    cycle = (duration + dwell) / duration
    model.at_least_length(rms[0] * cycle**0.5, samples * (1 / size), np.sqrt(weights))
    highest = np.array([limit.highest])
    _rows(transcript, name, rms * size, (-np.inf * highest, highest), np.array([0.5]))


def _brake(transcript: Transcript, name: str, limit: Limit) -> None:
    """The energy that the motor feeds back, from above: by the Bernstein coefficients of what bounds its power."""
    model, size, steps = transcript.model, transcript.sizes.of("electrical_power"), transcript.mesh.steps
    returned = transcript.quantities.returned()
    coefficients = list(returned.pieces) or [returned.nodes]
    shares = [steps / len(coefficients) if returned.pieces else trapezoids(steps)] * len(coefficients)
    if returned.points:
        coefficients = [returned.samples(model)]
        shares = [transcript.scheme.weights(returned, transcript.mesh.steps)]
    energy: Any = 0.0
    for values, weights in zip(coefficients, shares, strict=True):
        bound = model.variable(len(weights))
        model.nonpositive(values * (1 / size) - bound)
        model.nonpositive(-bound)
        energy = energy + model.total(weights, bound)
    highest = np.array([limit.highest])
    values = model.times(np.array([transcript.duration * size]), energy)
    _rows(transcript, name, values, (-np.inf * highest, highest), np.array([0.5]))


def _skip_prescribed(problem: Problem, mesh: Mesh, i: int, b: int, degree: int, lower: Floats, upper: Floats) -> None:
    """Drop the limit on a coefficient that boundary states at rest fix already: a row without interior stalls solvers.

    The b-th coefficient is fixed by derivatives i..i+b at the left node, or i..i+degree-b at the right one.
    """
    values = {(node, j): value for node, j, value in prescribed(problem, mesh)}
    for node, k, reach in ((0, 0, b), (mesh.intervals, -1, degree - b)):
        states = [values.get((node, j)) for j in range(i, i + reach + 1)]
        at_rest = all(x is not None for x in states) and not any(states[1:])
        if at_rest and lower[k] <= states[0] <= upper[k]:
            lower[k], upper[k] = -np.inf, np.inf


def _rows(
    transcript: Transcript,
    name: str,
    values: Any,
    limits: tuple[Floats, Floats],
    at: Floats,
    only: Container[str] | None = None,
) -> None:
    """``values`` within ``limits`` at fractions ``at`` of the duration; with ``only``, the sides named there alone."""
    model, size = transcript.model, transcript.sizes.of(name)
    finite, row_size = finite_sides(*limits, size)
    for side in finite:
        key = f"{name}.{side.name}"
        if only is not None and key not in only:
            continue
        residual = side.sign * (values[side.at] - side.limits)
        own = own_size(side.limits + origin_of(transcript.problem, name), size)
        if key in transcript.widen:
            residual = residual - transcript.widen[key] * own
        model.nonpositive(residual, row_size, key, at[side.at], own)
