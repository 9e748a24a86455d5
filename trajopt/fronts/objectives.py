"""Which objectives a front is between: friendly names such as ``peak_power``, or a signal and norm, ``power l2``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import norms
from trajopt import units
from trajopt.errors import BadInput
from trajopt.fields import nearest
from trajopt.problem import DERIVATIVES, MINIMIZABLE, WITHOUT_NORM, Problem, Term

_PREFIXES: Final = {"peak": "linf", "rms": "l2"}
_ALIASES: Final = {"torque": "force", "duration": "time"}


def read(names: str | Sequence[str | Term], problem: Problem) -> tuple[Term, ...]:
    """The two or three terms that ``names`` mean: a text with commas between them, or a sequence of names and terms.

    Raises BadInput for a name that is not known, one that appears twice, and for another number of them.
    """
    given = [part for part in names.split(",")] if isinstance(names, str) else list(names)
    terms = tuple(name if isinstance(name, Term) else _term(name) for name in given)
    labels = [term.label for term in terms]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise BadInput(f"objectives: {twice} is given twice; a front is between different objectives")
    if not 2 <= len(terms) <= 3:
        raise BadInput(f"objectives: needs two or three, got {len(terms)}; write for example energy,peak_power")
    problem.replace(objective={"terms": tuple(term for term in terms if term.minimize != "time") or terms})
    return terms


def _term(name: str) -> Term:
    words = name.strip().lower().replace("_", " ").split()
    signal, norm = " ".join(words), None
    if len(words) > 1 and words[0] in _PREFIXES:
        signal, norm = " ".join(words[1:]), _PREFIXES[words[0]]
    elif len(words) > 1 and words[-1] in norms.names():
        signal, norm = " ".join(words[:-1]), words[-1]
    signal = _ALIASES.get(signal, signal).replace(" ", "_")
    if signal not in MINIMIZABLE or (signal in WITHOUT_NORM) != (norm is None):
        close = nearest(name.strip().replace(" ", "_"), _known())
        hint = close if "did you mean" in close else "; write for example energy, peak_power, jerk_l2 or time"
        raise BadInput(f"objectives: unknown {units.shown(name.strip())}{hint}")
    return Term(minimize=signal, norm=norms.get(norm))


def _known() -> list[str]:
    signals = [name for name in MINIMIZABLE if name not in WITHOUT_NORM]
    pairs = [f"{signal}_{norm}" for signal in signals for norm in norms.names()]
    return [*WITHOUT_NORM, *(f"{prefix}_{signal}" for signal in signals for prefix in _PREFIXES), *pairs]


def friendly(term: Term, problem: Problem) -> str:
    """``peak power``, ``RMS jerk``, ``energy``."""
    name = problem.shown(term.minimize).replace("_", " ")
    if term.norm is None:
        return name
    words = {"linf": f"peak {name}"}
    if problem.transcription.scheme == "exact":  # else it is a plain sum
        words["l2"] = f"RMS {name}"
    return words.get(term.norm.name, f"{name} {term.norm.name}")


def unit(term: Term, problem: Problem) -> str:
    """The SI unit of a term's value; 1 where it has no name of its own, as for the plain sums of the Euler scheme."""
    sums = problem.transcription.scheme == "euler" and term.norm is not None and term.norm.name != "linf"
    return "1" if sums or term.kind is None else units.kinds(problem.rotary)[term.kind].unit


def in_one_class(problem: Problem, terms: Sequence[Term]) -> Problem:
    """The problem with the order that all objectives together ask for, whichever of them is minimised: the same moves
    compete everywhere. The end state says so by a derivative that would be zero anyway."""
    whole = problem.replace(objective={"terms": tuple(term for term in terms if term.minimize != "time")})
    move = whole.move
    for name in DERIVATIVES[2 : whole.order]:
        if getattr(move.end, name) is None:
            move = move.model_copy(update={"end": move.end.model_copy(update={name: 0.0})})
    return whole.replace(move=move)
