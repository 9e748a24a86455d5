"""One case solved, JSON to JSON: what travels to a worker process or to another machine, and what comes back."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from trajopt.verdict import Verdict

if TYPE_CHECKING:
    from trajopt.answer import Answer

FORMAT: Final = "trajopt study 1"


def question(content: Mapping[str, Any], seconds: float, trajectory: bool) -> str:
    """What `solve` is asked: the content of a problem file, a wall-time limit (s), and whether the move itself is
    wanted."""
    return json.dumps({"problem": content, "seconds": seconds, "trajectory": trajectory})


def solve(asked: str) -> str:
    """The answer to a `question`, whatever happens: a solver that is not installed has ``stop`` in its answer, a bug in
    trajopt is CRASHED. Raises MemoryError."""
    from trajopt import problem_file, worker
    from trajopt.errors import BadInput, MissingSolver

    given = json.loads(asked)
    try:
        problem = problem_file.from_dict(given["problem"], "the problem")
        solution = worker.solve_here(problem, given["seconds"])
        return json.dumps(_plain(solution, given["trajectory"]), allow_nan=False)
    except BadInput as error:
        return json.dumps(unsolved(Verdict.BAD_INPUT, str(error)))
    except MissingSolver as error:
        return json.dumps(unsolved(Verdict.UNDECIDED, str(error)) | {"stop": True})
    except MemoryError:
        raise
    except Exception as error:
        return json.dumps(unsolved(Verdict.CRASHED, f"a bug in trajopt: {error!r}"))


def key_of(problem_hash: str) -> str:
    """The identity of a case: its canonical problem, and the version of trajopt that answers it."""
    from trajopt import __version__

    return hashlib.sha256(f"{FORMAT} {__version__} {problem_hash}".encode()).hexdigest()


def unsolved(status: Verdict, message: str) -> dict[str, Any]:
    """The answer of a case that has no solution."""
    return {"format": FORMAT, "status": status.value, "message": message}


def _plain(solution: Answer, trajectory: bool) -> dict[str, Any]:
    """What is kept of a solution. Nothing of it depends on how long it took."""
    from trajopt import __version__

    found = unsolved(solution.status, _reason(solution)) | {"problem": solution.problem.hash, "trajopt": __version__}
    if not solution.status.solved:
        return found
    found |= {
        "objective": solution.objective,
        "duration": solution.duration,
        "lower_bound": solution.certificate.get("lower_bound"),
        "gap": solution.certificate.get("gap"),
        "metrics": dict(solution.metrics),
        "rotary": bool(getattr(solution.problem, "rotary", False)),
        "minimised": _minimised(solution),
    }
    return found | ({"files": {".json": json.dumps(solution.sealed()), ".csv": solution.csv()}} if trajectory else {})


def _minimised(solution: Answer) -> str:
    from trajopt.axes.problem import AxesProblem
    from trajopt.axes.report import objective_name as name_of_axes
    from trajopt.problem import Problem
    from trajopt.report import objective_name

    if isinstance(solution.problem, AxesProblem):
        return name_of_axes(solution.problem)
    return objective_name(solution.problem) if isinstance(solution.problem, Problem) else "time"


def _reason(solution: Answer) -> str:
    """One line on why there is no answer."""
    if solution.status.solved:
        return ""
    text = list(solution.explanation.get("text") or [])
    return " ".join("; ".join(text or [solution.message or solution.status.advice]).split())
