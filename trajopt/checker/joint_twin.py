"""The float twin of a joint of an arm: torque by the checker's own dynamics, polynomials through it between nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from trajopt.checker.arm import Limbs
from trajopt.checker.case import Array, Case
from trajopt.checker.float_twin import FloatTwin, Instants, _Pieces
from trajopt.checker.polynomials import product

_DEGREE: Final = 8  # of the polynomials through torque


class JointTwin(FloatTwin):
    """The float twin of one joint, whose torque follows from the motion of all; ``limbs`` None: from the file."""

    def __init__(self, case: Case, joint: int, limbs: Limbs | None, given: Array | None) -> None:
        super().__init__(case)
        self.joint, self.limbs, self.given = joint, limbs, given
        self.all: Sequence[JointTwin] = (self,)

    def loaded(self, name: str, instants: Instants, velocity: Array, friction: Array) -> Array:
        if self.limbs is None:
            assert self.given is not None
            force = self.given[instants.node]
        else:
            q, w, a = (np.array([twin.sampled(i, instants) for twin in self.all]) for i in range(3))
            force = self.limbs.torque(q, w, a)[self.joint] + self.case.viscous * velocity
        return force * velocity if name == "power" else force

    def loaded_rows(self, name: str, at_rest: float) -> Array:
        if name == "power":
            return product(self.polynomial("force")[0], self.rows(1, self.one_way))
        points = (1 - np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)) / 2
        values = np.array([self.inside(self.one_way, s) for s in points])
        return np.asarray(np.linalg.solve(np.vander(points, increasing=True), values).T)

    def inside(self, pieces: _Pieces, s: float) -> Array:
        """The torque at a fraction of every piece."""
        assert self.limbs is not None
        q, w, a = (np.array([horner(twin.rows(i, pieces), s) for twin in self.all]) for i in range(3))
        return np.asarray(self.limbs.torque(q, w, a)[self.joint] + self.case.viscous * w[self.joint])

    def missed(self) -> float:
        """By how much of its peak the polynomials miss the torque between the points they were drawn through."""
        rows, pieces = self.polynomial("force")[0], self.one_way
        off = [np.max(np.abs(horner(rows, s) - self.inside(pieces, s))) for s in (0.07, 0.31, 0.5, 0.83)]
        return float(max(off)) / max(self.peak("force"), 1e-300)

    def noise(self, name: str) -> float:
        return 1e-9 * self.peak(name) if self.case.is_loaded(name) and self.limbs else super().noise(name)


def horner(rows: Array, s: float) -> Array:
    """Rows of coefficients of powers, lowest first, at s."""
    return np.asarray(rows @ s ** np.arange(rows.shape[1]))
