"""Figures from written results: what ``trajopt plot`` does."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from trajopt.errors import BadInput
from trajopt.fields import nearest
from trajopt.files import refuse_folder, write_atomically
from trajopt.solution import Solution
from trajopt.stored import read_result

ALONE: Final[dict[str, Callable[[Solution], Any]]] = {
    "trajectory": lambda solution: solution.plot()[0],
    "prices": Solution.plot_prices,
    "arcs": lambda solution: solution.plot_arcs()[0],
    "vibration": Solution.plot_vibration,
    "torque-speed": Solution.plot_torque_speed,
}
ENDINGS: Final = (".png", ".pdf", ".svg")


def redraw(results: Sequence[Path], output: Path, kind: str | None = None, labels: Sequence[str] = ()) -> None:
    """Draw checked results into ``output``: one as a ``kind`` of `ALONE`, or several as ``compare``.

    Raises BadInput, NoSolution, TrajoptError where the checker rejects one, OSError.
    """
    kind = kind or ("trajectory" if len(results) == 1 else "compare")
    if kind not in (*ALONE, "compare"):
        raise BadInput(f"kind: unknown {kind[:60]!r}{nearest(kind, (*ALONE, 'compare'))}")
    if kind != "compare" and len(results) > 1:
        raise BadInput(f"kind: {kind} draws one result, got {len(results)}; use --kind compare, or a picture each")
    if labels and kind != "compare":
        raise BadInput(f"label: {kind} has no legend; leave --label out")
    if output.suffix.lower() not in ENDINGS:
        raise BadInput(f"output: a picture ends in one of {', '.join(ENDINGS)}, got {str(output)[-80:]!r}")
    refuse_folder(output)
    figure = _drawn([read_result(path) for path in results], kind, list(labels) or None).figure
    buffer = io.BytesIO()
    figure.savefig(buffer, format=output.suffix[1:].lower(), dpi=150)
    write_atomically(output, buffer.getvalue())


def _drawn(solutions: list[Solution], kind: str, labels: list[str] | None) -> Any:
    if kind != "compare":
        return ALONE[kind](solutions[0])
    from trajopt.plots.trajectories import compare

    if len({solution.problem.rotary for solution in solutions}) > 1:
        raise BadInput("compare: linear and rotary axes have no unit in common; draw them apart")
    try:
        return compare(solutions, labels)
    except ValueError as error:
        raise BadInput(f"label: {error}") from None
