"""The objective of several axes: terms summed over the axes or the largest of them, lowered and measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from trajopt.axes.problem import AxesObjective, AxesTerm
from trajopt.objective import Lowered, Measured
from trajopt.problem import Term
from trajopt.transcribe import Transcript


def lower(axes: Sequence[Transcript], objective: AxesObjective) -> Lowered:
    """The objective as a scalar expression; its rows go to the model that the axes share."""
    model, terms = axes[0].model, list(_measured(axes, objective))
    scale = sum(combined(term, [m.scale for m in found]) for term, found in terms)
    total: Any = 0.0
    for term, found in terms:
        values = [m.lower(model, scale) for m in found]
        if term.combine == "max" and len(values) > 1:
            largest = model.variable(1)[0]
            for value in values:
                model.nonpositive(value - largest)
            values = [largest]
        total = total + sum(values[1:], values[0])
    return Lowered(total, scale, None)


def measure(axes: Sequence[Transcript], objective: AxesObjective) -> float:
    """The SI value of an objective on axes whose chains and duration are floats."""
    return sum(combined(term, [m.value for m in found]) for term, found in _measured(axes, objective))


def combined(term: AxesTerm, values: Sequence[float]) -> float:
    """The values of a term on the axes as one."""
    return max(values) if term.combine == "max" else sum(values)


def _measured(axes: Sequence[Transcript], objective: AxesObjective) -> Iterator[tuple[AxesTerm, list[Measured]]]:
    """Every term on every axis that it weighs; the time counts once."""
    for term in objective.terms:
        one = term.minimize == "time"
        shares = (term.weight,) if one else term.shares(len(axes))
        plain = (Term(minimize=term.minimize, norm=term.norm, weight=share) if share else None for share in shares)
        found = zip(axes[:1] if one else axes, plain, strict=True)
        yield term, [Measured.of(axis, own) for axis, own in found if own is not None]
