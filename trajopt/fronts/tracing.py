"""The front of a problem: what is asked for, refused where it cannot be meant, and traced."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from trajopt.errors import BadInput
from trajopt.fields import nearest
from trajopt.fronts.front import Front
from trajopt.fronts.objectives import in_one_class, read
from trajopt.fronts.search import MOST, Progress, Request, Search
from trajopt.fronts.time_search import TimeSearch
from trajopt.problem import Problem, Term
from trajopt.workers import Here, Processes

METHODS: Final = ("weights", "epsilon")
DEFAULT_ERROR: Final = 0.005
TIMES: Final = 11  # points where time is an objective: nothing is blended there, and each per cent takes many


def pareto(
    problem: Problem,
    objectives: str | Sequence[str | Term],
    *,
    points: int | None = None,
    error: float | None = None,
    method: str = "weights",
    workers: int = 1,
) -> Front:
    """The front between ``objectives`` (two or three names such as ``energy``, ``peak_power``, ``jerk_l2``, or terms),
    whatever the problem's own objective is.

    Without ``points`` it is refined where it is known least, until it is known within ``error`` (0.005 by default: half
    a per cent of the ranges between the anchors). With ``points``, so many are placed evenly: in weights w, 1 - w in
    SI (Clemen & Rupp eq. 26), or with ``method="epsilon"`` in ceilings on the first objective. ``workers`` processes
    solve at once; which points are solved does not depend on them. Raises BadInput.
    """
    search = prepare(problem, objectives, points=points, error=error, method=method)
    check_workers(workers)
    with Here() if workers == 1 else Processes(workers) as at_work:
        front: Front = search(at_work, lambda *_: None).run()
        return front


def check_workers(workers: Any) -> None:
    """Raise BadInput unless so many processes can be meant."""
    if type(workers) is not int or not 1 <= workers <= 256:
        raise BadInput(f"workers: must be a whole number, 1 to 256, got {workers!r}")


def prepare(
    problem: Any,
    objectives: str | Sequence[str | Term],
    *,
    points: int | None = None,
    error: float | None = None,
    method: str = "weights",
) -> Any:
    """What makes a `Search`, from who is to solve and who hears of progress. Raises BadInput."""
    if not isinstance(problem, Problem):
        if hasattr(problem, "plant"):
            raise BadInput("plant: the fastest command to a plant has one objective, its time; a front needs an axis")
        raise BadInput(
            "axes: fronts are traced for one axis; for several, vary the weights of objective.terms by trajopt study"
        )
    request = _request(points, error, method)
    terms = read(objectives, problem)
    if request.method == "epsilon" and len(terms) > 2:
        raise BadInput("method: epsilon takes two objectives; use weights for three")
    if problem.move.fixed_time is None:
        raise BadInput('move.time: a front needs a fixed time such as "1 s"; with time as an objective, its longest')
    timed = any(term.minimize == "time" for term in terms)
    if timed and (len(terms) > 2 or request.method == "epsilon"):
        raise BadInput("objectives: time is traced against one other objective, time by time; leave method out")
    if timed and points is None and error is None:
        request = Request(points=TIMES)
    whole = in_one_class(problem, terms)

    def made(at_work: Here | Processes, progress: Progress) -> Search:
        return (TimeSearch if timed else Search)(whole, terms, request, at_work, progress)

    return made


def _request(points: int | None, error: float | None, method: str) -> Request:
    if method not in METHODS:
        hint = nearest(str(method), METHODS).partition("; known")[0]
        raise BadInput(f"method: unknown {str(method)[:60]!r}; one of {', '.join(METHODS)}{hint}")
    if points is not None and error is not None:
        raise BadInput("points: give either points or error, not both; error places as many points as it takes")
    if points is not None and (type(points) is not int or not 2 <= points <= MOST):
        raise BadInput(f"points: must be a whole number, 2 to {MOST}, got {points!r}; 21 are usual")
    if error is not None and (type(error) not in (int, float) or not 1e-5 <= error <= 0.5):
        raise BadInput(f"error: must be 0.001 % to 50 % (0.00001 to 0.5), got {error!r}; 0.5 % is usual")
    asked = DEFAULT_ERROR if points is None and error is None else error
    return Request(method, points, asked)
