"""The objective of a transcribed problem: lowered to an expression of size one, and measured on floats in SI."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

import norms
from trajopt.motor import Intake
from trajopt.problem import WITHOUT_NORM, Ceiling, Load, Objective, Term
from trajopt.transcribe import Transcript

POWERS: Final = {"energy": "power", "copper_loss": "heat", "electrical_energy": "electrical_power"}


@dataclass(frozen=True)
class Lowered:
    """An objective on a model: ``expression`` to minimise, of size one; ``si`` maps its value to SI."""

    expression: Any
    scale: float
    norm: norms.Norm | None  # of a single term, which is minimised through an easier increasing function

    def si(self, value: float) -> float:
        """The SI objective, from a value of the expression (or a bound on it)."""
        if self.norm is None:
            return self.scale * value
        unit = self.norm.value_alone(1.0)
        return self.scale / unit * self.norm.value_alone(value) if np.isfinite(value) else value

    def over(self, si: float) -> Lowered:
        """The same objective, with an expression that is one where the SI objective has this value."""
        size = abs(self.expression_value(si))
        if not size:
            return self
        unit = size if self.norm is None else self.norm.value_alone(size) / self.norm.value_alone(1.0)
        return Lowered(self.expression * (1 / size), self.scale * unit, self.norm)

    def slope(self, value: float) -> float:
        """The derivative of `si`."""
        step = 1e-6 * max(abs(value), 1e-12)
        return (self.si(value + step) - self.si(value - step)) / (2 * step)

    def expression_value(self, si: float) -> float:
        """The value of the expression, from the SI objective: the inverse of `si`."""
        return si / self.scale if self.norm is None else self.norm.alone(si / self.scale)


def lower(transcript: Transcript, objective: Objective) -> Lowered:
    """The objective as a scalar expression; its rows, and those of its ceilings, go to the transcript's model, once."""
    if id(objective) not in transcript.lowered:
        transcript.lowered[id(objective)] = objective, _lower(transcript, objective)
    found: Lowered = transcript.lowered[id(objective)][1]
    return found


def _lower(transcript: Transcript, objective: Objective) -> Lowered:
    model = transcript.model
    for ceiling in objective.ceilings or ():
        _hold(transcript, ceiling)
    measured = [Measured.of(transcript, term) for term in objective.terms]
    if len(measured) == 1 and (norm := measured[0].norm) is not None:
        only = measured[0]
        expression = norm.lower_alone(model, only.samples * (1 / only.size), only.weights, only.duration)
        return Lowered(expression * (1 / norm.alone(only.unit)), only.weight * only.size * only.unit, norm)
    scale = sum(m.scale for m in measured)
    total: Any = 0.0
    for m in measured:
        total = total + m.lower(model, scale)
    return Lowered(total, scale, None)


def _hold(transcript: Transcript, ceiling: Ceiling) -> None:
    """A term below its ceiling, by the rows of its norm; priced as ``energy.at_most``."""
    m, most = Measured.of(transcript, ceiling.term), ceiling.at_most
    assert m.norm is not None
    value = m.norm.lower(transcript.model, m.samples * (1 / m.size), m.weights, m.duration) * m.size
    transcript.model.nonpositive(value - most, most, f"{ceiling.term.label}.at_most", np.array([0.5]), np.array([most]))


def measure(transcript: Transcript, objective: Objective) -> float:
    """The SI value of an objective on a transcript whose chain and duration are floats."""
    return sum(Measured.of(transcript, term).value for term in objective.terms)


def integral(name: str, load: Load) -> norms.Norm:
    """What integrates the power behind an energy: its magnitude, all of it, or what the drive takes from the grid."""
    if name == "energy":
        return norms.L1()
    return Intake(1.0 if name == "copper_loss" else load.recovery)


@dataclass(frozen=True)
class Measured:
    """A term laid on the mesh: its samples, what each stands for, and its sizes."""

    samples: Any
    weights: Any  # floats, or expressions where parts of the duration are free
    duration: Any  # s, or 1 for the plain sums of the Euler scheme
    norm: norms.Norm | None  # None: the term is the duration itself
    weight: float
    size: float  # of the samples, SI
    usual: Any  # the weights and the duration where parts of it are free: floats
    typical: float

    @cached_property
    def unit(self) -> float:
        """The norm of samples that are all one."""
        return 1.0 if self.norm is None else self.norm.measure(np.ones(len(self.usual)), self.usual, self.typical)

    @property
    def scale(self) -> float:
        """What the term is likely to be, SI."""
        return self.weight * self.size * self.unit

    @property
    def value(self) -> float:
        """The term on floats, SI."""
        if self.norm is None:
            return self.weight * float(self.duration)
        return self.weight * float(self.norm.measure(self.samples, self.weights, self.duration))

    def lower(self, model: Any, scale: float) -> Any:
        """The term over ``scale`` as an expression; its rows go to the model."""
        if self.norm is None:
            return self.duration * (self.weight / scale)
        value = self.norm.lower(model, self.samples * (1 / self.size), self.weights, self.duration)
        return value * (self.weight * self.size / scale)

    @classmethod
    def of(cls, transcript: Transcript, term: Term) -> Measured:
        duration, sizes = transcript.duration, transcript.sizes
        if term.minimize == "time":
            return cls(None, np.ones(1), duration, None, term.weight, sizes.duration, np.ones(1), 1.0)
        energy = term.minimize in WITHOUT_NORM
        quantity = POWERS.get(term.minimize, term.minimize)
        signal = transcript.quantities.signal(quantity)
        weights = usual = transcript.scheme.weights(signal, transcript.mesh.steps)
        if transcript.phased:
            weights = transcript.scheme.weights(signal, transcript.shares)
        typical = sizes.duration
        if transcript.scheme.terms == 1:  # Euler: plain sums, as in the paper; but an energy stays an integral
            if energy:
                weights = usual = usual / transcript.mesh.intervals
            else:
                duration = typical = 1.0
        samples = signal.samples(transcript.model)
        if quantity == "position" and transcript.problem.move.start_position is None:
            samples = samples - transcript.chain[0][0]  # positions are absolute then; the norm is of the displacement
        norm = term.norm or integral(term.minimize, transcript.problem.load)
        return cls(samples, weights, duration, norm, term.weight, sizes.of(quantity), usual, typical)
