"""A planar arm of any number of links, by the recursive Newton-Euler algorithm.

Outwards go the accelerations of the joints and of the centres of mass, inwards the forces and moments that each link
hands to the one before (Luh, Walker & Paul 1980). In the plane all angular quantities are numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from scara.links import Links
from trajopt.axes.dynamics import Joints
from trajopt.elementwise import cos, sin


@dataclass(frozen=True)
class PlanarArm(Links):
    """Links in a plane without gravity; see `Links` for the numbers."""

    def torque(self, q: Joints, w: Joints, a: Joints) -> list[Any]:
        """The torque at every joint, N m."""
        bars, (x, y) = [], (0.0, 0.0)  # acceleration of the joint at hand
        for k, (angle, rate, gain) in enumerate(zip(*map(accumulate, (q, w, a)), strict=True)):
            c, s = cos(angle), sin(angle)
            along, across = -rate * rate, gain  # acceleration per length, in the link's own directions
            unit = (along * c - across * s, along * s + across * c)
            centre = (x + self.centres[k] * unit[0], y + self.centres[k] * unit[1])
            bars.append((c, s, gain, centre))
            x, y = x + self.lengths[k] * unit[0], y + self.lengths[k] * unit[1]
        fx, fy, moment = self.payload * x, self.payload * y, 0.0  # on the tip
        torques: list[Any] = []
        for k in reversed(range(self.joints)):
            c, s, gain, (cx, cy) = bars[k]
            gx, gy = self.masses[k] * cx, self.masses[k] * cy
            moment = moment + self.inertias[k] * gain
            moment = moment + self.centres[k] * (c * gy - s * gx) + self.lengths[k] * (c * fy - s * fx)
            fx, fy = fx + gx, fy + gy
            torques.insert(0, moment)
        return torques

    def energy(self, q: Joints, w: Joints) -> Any:
        """The kinetic energy, J."""
        total, vx, vy = 0.0, 0.0, 0.0
        for k, (angle, rate) in enumerate(zip(accumulate(q), accumulate(w), strict=True)):
            dx, dy = -sin(angle) * rate, cos(angle) * rate
            cx, cy = vx + self.centres[k] * dx, vy + self.centres[k] * dy
            total = total + 0.5 * self.masses[k] * (cx * cx + cy * cy) + 0.5 * self.inertias[k] * rate * rate
            vx, vy = vx + self.lengths[k] * dx, vy + self.lengths[k] * dy
        return total + 0.5 * self.payload * (vx * vx + vy * vy)
