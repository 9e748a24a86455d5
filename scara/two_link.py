"""The two-link SCARA: Lagrange's equations in relative joint angles, with a payload; its inverse kinematics.

Without gravity and friction, with A = I1 + m1 c1² + m2 l1², B = I2 + m2 c2², C = m2 l1 c2, to which a payload m adds
m l1², m l2² and m l1 l2:

    tau1 = (A + B + 2 C cos q2) a1 + (B + C cos q2) a2 - C sin q2 (2 w1 w2 + w2²)
    tau2 = (B + C cos q2) a1 + B a2 + C sin q2 w1²

The arm of Clemen & Rupp 2023, section V, whose own expressions mix absolute and relative angles (see docs/arms.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, cos, hypot, sin
from typing import Any, Literal

from scara.links import Links
from trajopt import elementwise as on
from trajopt.axes.dynamics import Joints
from trajopt.errors import BadInput


@dataclass(frozen=True)
class TwoLinkArm(Links):
    """Two links; see `Links` for the numbers."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.joints != 2:
            raise BadInput(f'lengths: a scara has two links, got {self.joints}; kind = "planar" takes any number')

    @property
    def constants(self) -> tuple[float, float, float]:
        """A, B and C of the equations above, kg m²."""
        (l1, l2), (m1, m2), (c1, c2), (i1, i2), m = *(getattr(self, x) for x in _NUMBERS), self.payload
        return i1 + m1 * c1**2 + (m2 + m) * l1**2, i2 + m2 * c2**2 + m * l2**2, (m2 * c2 + m * l2) * l1

    def torque(self, q: Joints, w: Joints, a: Joints) -> list[Any]:
        """The torque at both joints, N m."""
        inertia1, inertia2, coupling = self.constants
        c, s = coupling * on.cos(q[1]), coupling * on.sin(q[1])
        both = inertia2 + c
        return [
            (inertia1 + inertia2 + 2.0 * c) * a[0] + both * a[1] - s * (2.0 * w[0] * w[1] + w[1] * w[1]),
            both * a[0] + inertia2 * a[1] + s * w[0] * w[0],
        ]

    def energy(self, q: Joints, w: Joints) -> Any:
        """The kinetic energy, J."""
        inertia1, inertia2, coupling = self.constants
        c = coupling * on.cos(q[1])
        first = 0.5 * (inertia1 + inertia2 + 2.0 * c) * w[0] * w[0]
        return first + (inertia2 + c) * w[0] * w[1] + 0.5 * inertia2 * w[1] * w[1]

    def power(self, q: Joints, w: Joints, a: Joints) -> list[Any]:
        """The power at both joints, W."""
        return [torque * speed for torque, speed in zip(self.torque(q, w, a), w, strict=True)]

    def inverse(self, x: float, y: float, elbow: Literal["up", "down"] = "up") -> tuple[float, float]:
        """The joint angles (rad) that put the tip at x, y (m); ``elbow`` up: q2 <= 0, with the elbow on the left of the
        line to the tip, down: q2 >= 0. Raises BadInput out of reach."""
        l1, l2 = self.lengths
        distance, (nearest, farthest) = hypot(x, y), self.reach
        if not nearest * (1 - 1e-12) <= distance <= farthest * (1 + 1e-12):
            raise BadInput(
                f"tip: ({x:g}, {y:g}) m is {distance:.6g} m from the first joint, out of reach: {nearest:.6g} to"
                f" {farthest:.6g} m; move it inside"
            )
        bend = acos(min(max((distance**2 - l1**2 - l2**2) / (2 * l1 * l2), -1.0), 1.0))
        q2 = -bend if elbow == "up" else bend
        return atan2(y, x) - atan2(l2 * sin(q2), l1 + l2 * cos(q2)), q2


_NUMBERS = ("lengths", "masses", "centres", "inertias")
