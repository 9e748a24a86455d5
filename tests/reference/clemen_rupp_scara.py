"""The arm of Clemen & Rupp 2023, section V, as its authors' code has it, in the dynamics interface.

Their torques are those of an arm in absolute link angles, written with relative ones; they obey no balance of power,
and leave the payload out. The facts are those listed in ../shared/reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import trajopt
from scara.links import Links

LENGTHS, MASSES, INERTIA = (0.6, 0.4), (3.0, 2.0), 1.0


class PublishedArm:
    """Their torque expressions, and their kinematics of the tip, which are right."""

    joints = 2

    def __init__(self) -> None:
        self._links = Links(LENGTHS, MASSES, (0.3, 0.2), (INERTIA, INERTIA))
        self.lengths = LENGTHS

    def torque(self, q: Sequence[Any], w: Sequence[Any], a: Sequence[Any]) -> list[Any]:
        (l1, l2), (m1, m2) = LENGTHS, MASSES
        first = m1 * l1**2 / 4 + INERTIA + m2 * l1**2
        second, coupling = m2 * l2**2 / 4 + INERTIA, m2 * l1 * l2 / 2
        c, s = coupling * trajopt.cos(q[1] - q[0]), coupling * trajopt.sin(q[1] - q[0])
        elbow = second * a[1] + c * a[0] + s * w[0] * w[0]
        return [first * a[0] + c * a[1] - s * w[1] * w[1] + elbow, elbow]

    def tip(self, q: Sequence[Any]) -> tuple[Any, Any]:
        return self._links.tip(q)

    def tip_velocity(self, q: Sequence[Any], w: Sequence[Any]) -> tuple[Any, Any]:
        return self._links.tip_velocity(q, w)
