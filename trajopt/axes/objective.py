"""The objective of several axes: terms summed over the axes or the largest of them, lowered and measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from trajopt.axes.problem import AxesObjective, AxesTerm
from trajopt.objective import Lowered, Measured
from trajopt.problem import Term
from trajopt.transcribe import Transcript


def lower(axes: Sequence[Transcript], objective: AxesObjective) -> Lowered:
    """The objective as a scalar expression; its rows go to the model that the axes share."""
    model, terms = axes[0].model, [(term, _of_term(axes, term)) for term in objective.terms]
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
    """The SI value of an objective on axes whose chains and durations are floats; the time is that of the slowest."""
    slowest = max(axes, key=lambda axis: float(axis.duration))
    found = ((term, [slowest] if term.minimize == "time" else axes) for term in objective.terms)
    return sum(combined(term, [m.value for m in _of_term(own, term)]) for term, own in found)


def combined(term: AxesTerm, values: Sequence[float]) -> float:
    """The values of a term on the axes as one."""
    return max(values) if term.combine == "max" else sum(values)


def _of_term(axes: Sequence[Transcript], term: AxesTerm) -> list[Measured]:
    """A term on every axis that it weighs; the time counts once."""
    shares = (term.weight,) if term.minimize == "time" else term.shares(len(axes))
    return [
        Measured.of(axis, Term(minimize=term.minimize, norm=term.norm, weight=share))
        for axis, share in zip(axes, shares, strict=False)
        if share
    ]
