"""A trajectory: plain floats over a time grid, with the exact interpolant that belongs to its scheme."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np

from trajopt.mesh import Floats, Mesh
from trajopt.objective import measure
from trajopt.problem import DERIVATIVES, Objective, Problem
from trajopt.quantities import Quantities
from trajopt.scaling import Sizes
from trajopt.schemes import Scheme
from trajopt.signals import BetweenReversals, OnFloats, Signal
from trajopt.transcribe import Transcript


@dataclass(frozen=True)
class Trajectory:
    """``chain[i]``: the i-th derivative, (N+1,) at the nodes, and for the top one (N,) on the intervals; SI.

    Positions in ``chain[0]`` are displacements from ``origin``.
    """

    problem: Problem
    mesh: Mesh
    scheme: Scheme
    sizes: Sizes
    duration: float
    origin: float
    chain: tuple[Floats, ...]
    arithmetic: OnFloats = OnFloats()
    quantities: Callable[..., Quantities] = Quantities  # as in `trajopt.transcribe.Setting`

    def __post_init__(self) -> None:
        for values in self.chain:
            values.flags.writeable = False

    def __getstate__(self) -> dict[str, Any]:
        made = ("transcript", "time", "steps")  # anew
        return {name: value for name, value in self.__dict__.items() if name not in made}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    @property
    def order(self) -> int:
        """Number of the top derivative."""
        return len(self.chain) - 1

    @cached_property
    def time(self) -> Floats:
        """(N+1,) node times in s."""
        time: Floats = self.mesh.fractions * self.duration
        time[-1] = self.duration
        time.flags.writeable = False
        return time

    @cached_property
    def steps(self) -> Floats:
        """(N,) interval lengths in s."""
        steps = np.diff(self.time)
        steps.flags.writeable = False
        return steps

    @cached_property
    def transcript(self) -> Transcript:
        """The trajectory as the builder sees it."""
        model = self.arithmetic
        steps = self.mesh.steps * self.duration
        quantities = self.quantities(self.problem, model, self.scheme, self.mesh, self.sizes, list(self.chain), steps)
        return Transcript(
            self.problem, self.mesh, self.scheme, self.sizes, model, list(self.chain), self.duration, quantities
        )

    def signal(self, name: str) -> Signal:
        """A quantity by name, on floats; position as displacement."""
        return self.transcript.quantities.signal(name)

    def measure(self, objective: Objective) -> float:
        """The SI value of an objective."""
        return measure(self.transcript, objective)

    def at(self, t: Any) -> dict[str, Floats]:
        """Position, velocity, … up to the top derivative at times ``t`` (s, within the move), exactly.

        The interpolant is the one of the scheme: for ``exact`` the interval polynomials, for ``euler`` straight lines
        between the nodes. Raises ValueError outside the move.
        """
        t = np.asarray(t, dtype=float)
        if not np.all((t >= 0) & (t <= self.duration)):
            raise ValueError(f"t must be within 0 to {self.duration:g} s")
        k = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, self.mesh.intervals - 1)
        s = t - self.time[k]
        values: dict[str, Floats] = {}
        for i in range(self.order + 1):
            value = self.chain[i][k].astype(float)
            if i < self.order and self.scheme.terms == 1:
                value = value + s * (self.chain[i][k + 1] - self.chain[i][k]) / (self.time[k + 1] - self.time[k])
            else:
                for r in range(1, self.order - i + 1):
                    value = value + s**r / factorial(r) * self.chain[i + r][k]
            values[DERIVATIVES[i]] = value + self.origin if i == 0 else value
        return values

    def of(self, problem: Problem) -> Trajectory:
        """The same move as an answer to another problem."""
        return self if self.problem is problem else replace(self, problem=problem)

    def cut(self, times: Floats) -> Trajectory:
        """The same exact trajectory with nodes added at ``times`` (s), those of its reversals among them."""
        mesh = Mesh(np.unique(np.concatenate([self.mesh.fractions, times / self.duration])))
        inner = mesh.fractions * self.duration
        values = self.at(np.minimum(inner, self.duration))
        chain = [values[name] for name in DERIVATIVES[: self.order + 1]]
        chain[0] = chain[0] - self.origin
        chain[-1] = chain[-1][:-1]
        return replace(self, mesh=mesh, chain=tuple(chain), arithmetic=BetweenReversals())

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, as in a result file."""
        data: dict[str, Any] = {"scheme": self.scheme.name, "order": self.order, "time": self.time.tolist()}
        for i, values in enumerate(self.chain):
            data[DERIVATIVES[i]] = (values + self.origin if i == 0 else values).tolist()
        return data
