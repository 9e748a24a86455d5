"""The checker's own planar arm: torques by d'Alembert's principle, with points of the plane as complex numbers.

Link k points along exp(i θ_k), θ the sum of the joint angles up to it. A mass m at p does the virtual work
m Re(conj(∂p/∂q_j) p''), a link of inertia I the work I θ'' at every joint up to its own; the torque of joint j is the
sum. It needs neither Lagrange's equations of two links nor the recursion of Newton and Euler, which the optimiser uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.checker.case import Array
from trajopt.checker.values import Malformed, mapping, vector

_KEYS = ("kind", "lengths", "masses", "centres", "inertias", "payload")


@dataclass(frozen=True)
class Limbs:
    """(n,) lengths (m), masses (kg), centres (m), inertias (kg m²); payload (kg)."""

    lengths: Array
    masses: Array
    centres: Array
    inertias: Array
    payload: float

    @classmethod
    def read(cls, arm: Mapping[str, Any]) -> Limbs:
        """From the section of a problem. Raises Malformed."""
        arm = mapping(arm, "problem.arm", _KEYS)
        lengths = vector(arm.get("lengths"), "arm.lengths")
        given = arm.get("centres")
        centres = lengths / 2 if given is None else vector(given, "arm.centres")
        masses, inertias = (vector(arm.get(key), f"arm.{key}") for key in ("masses", "inertias"))
        payload = float(vector([arm.get("payload", 0.0)], "arm.payload")[0])
        if len({len(x) for x in (lengths, masses, centres, inertias)}) > 1 or not len(lengths):
            raise Malformed("arm needs as many masses, centres and inertias as lengths")
        if not (np.all(lengths > 0) and np.all(masses > 0) and np.all(inertias >= 0) and payload >= 0):
            raise Malformed("arm has a length or mass that is not positive, or a negative inertia or payload")
        return cls(lengths, masses, centres, inertias, payload)

    def points(self, q: Array, ends: Array) -> tuple[Any, Any, Any]:
        """Of the points at lengths ``ends`` (n, n), a row a point, along the links: place, and the columns
        ∂p/∂q (point, joint, sample) and the directions of the links."""
        along = np.exp(1j * np.cumsum(q, axis=0))
        bars = ends[:, :, None] * along[None, :, :]
        slopes = 1j * np.cumsum(bars[:, ::-1], axis=1)[:, ::-1]
        return bars.sum(axis=1), slopes, along

    def _ends(self) -> tuple[Array, Array]:
        """How far along every link the masses lie, a row a mass, the payload last; and the masses."""
        count = len(self.lengths)
        rows = np.tril(np.tile(self.lengths, (count, 1)), -1) + np.diag(self.centres)
        return np.vstack([rows, self.lengths]), np.append(self.masses, self.payload)

    def torque(self, q: Array, w: Array, a: Array) -> Array:
        """(n, samples) torques of all joints, N m, from (n, samples) angles, speeds and accelerations."""
        ends, masses = self._ends()
        _, slopes, along = self.points(q, ends)
        rate, gain = np.cumsum(w, axis=0), np.cumsum(a, axis=0)
        pull = np.einsum("pk,kt->pt", ends, (1j * gain - rate**2) * along)
        work = np.einsum("p,pjt,pt->jt", masses, np.conj(slopes), pull).real
        return np.asarray(work + np.cumsum((self.inertias[:, None] * gain)[::-1], axis=0)[::-1])

    def energy(self, q: Array, w: Array) -> Array:
        """(samples,) kinetic energy, J."""
        ends, masses = self._ends()
        _, slopes, _ = self.points(q, ends)
        speed = np.einsum("pjt,jt->pt", slopes, w)
        turning = self.inertias @ np.cumsum(w, axis=0) ** 2
        return np.asarray((masses @ np.abs(speed) ** 2 + turning) / 2)

    def tip(self, q: Array, w: Array) -> tuple[Array, Array]:
        """(samples,) place (m) and velocity (m/s) of the tip, as complex numbers."""
        place, slopes, _ = self.points(q, self.lengths[None, :])
        return place[0], np.einsum("jt,jt->t", slopes[0], w)
