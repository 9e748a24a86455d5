"""Which model and solver a problem goes to, and why; can be asked without solving."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from trajopt.errors import BadInput
from trajopt.problem import FREE, Problem
from trajopt.quantities import FORCES, is_affine
from trajopt.switching_times import as_chain, forwards

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.plant.problem import PlantProblem

ALONE: Final = ("piqp", "osqp")  # solvers that, asked for by name, have no other one behind them


@dataclass(frozen=True)
class Route:
    """``model``: cvxpy, pyomo, or arcs and closed form without one; ``solver``: piqp, clarabel, osqp, ipopt, newton on
    switching times, or linear equations, as expected, and on a solution the one whose answer it is; ``reason``: one
    line for people."""

    model: str
    solver: str
    reason: str
    tie_break: str = ""  # what a second solve did where the optimum may not be unique
    unique: bool | None = None  # whether the optimum determines the profile; None where that is not known

    def because(self, reason: str) -> Route:
        """The same route for another reason."""
        return replace(self, reason=reason)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))


def route(problem: Problem | PlantProblem | AxesProblem) -> Route:
    """The route of a problem: switching times for a plant and for the minimum time of a chain, else its curvature
    decides, unless ``transcription.solver`` asks otherwise.

    Raises BadInput, with the reason, when the solver asked for cannot take the problem.
    """
    if not isinstance(problem, Problem):
        return _of_another_kind(problem)
    wanted = problem.transcription.solver
    if wanted == "auto" and problem.move.fixed_time is None and as_chain(_lean(problem)) is not None:
        return Route("arcs", "newton", "minimum time of a chain of integrators: its switching times, exactly")
    return route_on_mesh(problem)


def _of_another_kind(problem: PlantProblem | AxesProblem) -> Route:
    if hasattr(problem, "plant"):
        return Route("arcs", "newton", "minimum time of a linear plant: its switching times, exactly")
    if problem.coupled:
        why = "the dynamics of an arm couple" if problem.arm is not None else "their time couples"
        return Route("pyomo", "ipopt", f"{why} the axes: local optima from {problem.search.starts} starts")
    found = route(problem.moves[0])
    return found.because(f"nothing couples the axes but their time: each by itself ({found.reason})")


def route_on_mesh(problem: Problem) -> Route:
    """The route of a transcribed problem: the one there is where switching times are not asked for, or not found."""
    wanted = problem.transcription.solver
    hindrance = _nonconvex(problem)
    if wanted == "ipopt":
        return Route(
            "pyomo", "ipopt", "asked for" + (f"; {hindrance}" if hindrance else ", though the problem is convex")
        )
    if hindrance and has_power_bound(problem) and wanted in ("auto", "clarabel"):
        why = f"{hindrance}; found by sequential convex programs, bounded by a relaxation"
        return Route("cvxpy", "piqp" if wanted == "auto" else wanted, why)
    if hindrance:
        if wanted != "auto":
            raise BadInput(f'transcription.solver = {wanted!r} takes convex problems only: {hindrance}; use "ipopt"')
        return Route("pyomo", "ipopt", hindrance)
    obstacle = beyond_quadratic(problem)
    if wanted in ALONE:
        obstacle = obstacle or ("a search over the time may need others" if problem.move.fixed_time is None else "")
        if obstacle:
            raise BadInput(f'transcription.solver = "{wanted}" takes linear and quadratic programs only: {obstacle}')
    solver = wanted if wanted != "auto" else "clarabel" if obstacle else "piqp"
    return Route("cvxpy", solver, _convex_reason(problem))


def _lean(problem: Problem) -> Problem:
    """The problem without the limits that are tried without first."""
    problem = forwards(problem)
    limits = problem.limits.model_copy(update=dict.fromkeys(nonaffine_limits(problem)))
    return problem.model_copy(update={"limits": limits})


def nonaffine_limits(problem: Problem) -> list[str]:
    """The limits that make a convex problem nonconvex; they are tried without first."""
    return [name for name in problem.limits.given if not is_affine(problem, name)]


def is_time_search(problem: Problem) -> bool:
    """Whether the problem is minimum time as a search over fixed-time convex programs.

    Feasibility is monotone in the duration when one end is at rest: the axis can wait there. Elsewhere a range can be
    searched where the durations that are possible are known.
    """
    only_time = [term.minimize for term in problem.objective.all_terms] == ["time"]
    return problem.move.fixed_time is None and only_time and (problem.can_wait or _knows_possible_times(problem))


def _knows_possible_times(problem: Problem) -> bool:
    in_range = isinstance(problem.move.time, tuple) and problem.order <= 3 and problem.limits.position is None
    return in_range and as_chain(_lean(problem)) is not None


def has_power_bound(problem: Problem) -> bool:
    """Whether `trajopt.power` can bound power and energy globally: exact scheme, jerk or acceleration on top, fixed
    time, one way, ends of given velocity (and acceleration), equal steps. Elsewhere no global bound is known."""
    move = problem.move
    varies = any(limit.varies for limit in problem.limits.given.values()) or bool(problem.load.curves)
    varies = varies or not isinstance(problem.load.inertia, float)
    return (
        problem.transcription.scheme == "exact"
        and problem.order in (2, 3)
        and move.fixed_time is not None
        and problem.one_way != 0
        and all(state.fixed(problem.order).keys() >= set(range(1, problem.order)) for state in (move.start, move.end))
        and move.start.position != FREE
        and not (move.via or varies)
    )


def _nonconvex(problem: Problem) -> str:
    """Why the problem is not convex, or nothing."""
    if problem.move.fixed_time is None:
        if is_time_search(problem):
            return ""
        return "the duration is free: step times velocity is a product of unknowns"
    for term in problem.objective.all_terms:
        if not is_affine(problem, term.minimize):
            return f"{problem.shown(term.label)} is nonconvex: {_product(problem, term.minimize)}"
    return ""


def _product(problem: Problem, name: str) -> str:
    curves = [problem.shown(curve) for curve in problem.load.curves]
    if curves:
        return f"the load's {' and '.join(curves)} depend{'' if len(curves) > 1 else 's'} on the position"
    return "friction changes sign with the velocity" if name in FORCES else "a product of force and velocity"


def beyond_quadratic(problem: Problem) -> str:
    """What of a problem, beside its power, takes more than a quadratic program; or nothing."""
    if problem.limits.rms_force is not None:
        return "an RMS limit is a second-order cone"
    norms_used = [term.norm for term in problem.objective.terms if term.norm]
    if any(ceiling.norm and ceiling.norm.name == "l2" for ceiling in problem.objective.ceilings or ()):
        return "a ceiling on an l2 norm is a second-order cone"
    if len(norms_used) > 1 and any(norm.name == "l2" for norm in norms_used):
        return "an l2 norm in a weighted sum is a second-order cone"
    unknown = [norm.name for norm in norms_used if norm.name not in ("l1", "l2", "linf")]
    return f"norm {unknown[0]!r} may need a cone" if unknown else ""


def _convex_reason(problem: Problem) -> str:
    extra = nonaffine_limits(problem)
    condition = f", as long as the {extra[0]} limit stays inactive" if extra else ""
    if problem.move.fixed_time is None:
        return f"convex at every fixed time: a search over the time{condition}"
    norms_used = {term.norm.name if term.norm else term.minimize for term in problem.objective.terms}
    kind = {frozenset({"l2"}): "quadratic", frozenset({"copper_loss"}): "quadratic"}.get(
        frozenset(norms_used), "linear" if norms_used <= {"l1", "linf"} else "cone"
    )
    held = {ceiling.norm.name for ceiling in problem.objective.ceilings or () if ceiling.norm}
    kind = "cone" if "l2" in held or problem.limits.rms_force is not None else kind
    return f"convex: a {kind} program{condition}"
