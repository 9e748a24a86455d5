"""The links of a planar arm: their numbers, and where they put the joints and the tip.

Joint angles are relative: q[0] to the x axis, q[i] to the link before. All methods are elementwise, on floats and on
the expressions of a model (see `trajopt.axes.dynamics`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from math import isfinite
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from trajopt.axes.dynamics import Joints
from trajopt.elementwise import cos, sin
from trajopt.errors import BadInput

_FIELDS = ("lengths", "masses", "centres", "inertias")


@dataclass(frozen=True)
class Links:
    """``lengths`` (m), ``masses`` (kg), ``centres``: from the joint to the centre of mass (m), ``inertias`` about the
    centres of mass (kg m²), a number a link each; ``payload`` at the tip (kg).

    Raises BadInput for a length or mass that is not positive, a negative inertia or payload, and unequal counts.
    """

    lengths: tuple[float, ...]
    masses: tuple[float, ...]
    centres: tuple[float, ...]
    inertias: tuple[float, ...]
    payload: float = 0.0

    def __post_init__(self) -> None:
        for name in _FIELDS:
            values = tuple(float(x) for x in getattr(self, name))
            object.__setattr__(self, name, values)
            if len(values) != len(self.lengths) or not values:
                raise BadInput(f"{name}: needs a value a link, {len(self.lengths)}, got {len(values)}")
            least = "> 0" if name in ("lengths", "masses") else "0 or more"
            if name != "centres" and not all(x > 0 or (x == 0 and least != "> 0") for x in values):
                raise BadInput(f"{name}: every one must be {least}, got {list(values)}")
            if not all(map(isfinite, values)):
                raise BadInput(f"{name}: must be finite, got {list(values)}")
        if not (isfinite(self.payload) and self.payload >= 0):
            raise BadInput(f"payload: must be 0 or more, got {self.payload!r}")

    @property
    def joints(self) -> int:
        """How many there are."""
        return len(self.lengths)

    @property
    def reach(self) -> tuple[float, float]:
        """The smallest and the largest distance of the tip from the first joint, m."""
        longest = max(self.lengths)
        return max(2 * longest - sum(self.lengths), 0.0), sum(self.lengths)

    def elbows(self, q: Joints) -> list[tuple[Any, Any]]:
        """The ends of all links, x and y in m; the last is the tip."""
        found, x, y = [], 0.0 * q[0], 0.0 * q[0]
        for length, angle in zip(self.lengths, accumulate(q), strict=True):
            x, y = x + length * cos(angle), y + length * sin(angle)
            found.append((x, y))
        return found

    def tip(self, q: Joints) -> tuple[Any, Any]:
        """Where the tip is, x and y in m."""
        return self.elbows(q)[-1]

    def tip_velocity(self, q: Joints, w: Joints) -> tuple[Any, Any]:
        """How fast the tip moves, x and y in m/s."""
        vx, vy = 0.0, 0.0
        for length, angle, rate in zip(self.lengths, accumulate(q), accumulate(w), strict=True):
            vx, vy = vx - length * sin(angle) * rate, vy + length * cos(angle) * rate
        return vx, vy

    def tip_acceleration(self, q: Joints, w: Joints, a: Joints) -> tuple[Any, Any]:
        """The acceleration of the tip, x and y in m/s²."""
        ax, ay = 0.0, 0.0
        for length, angle, rate, gain in zip(self.lengths, *map(accumulate, (q, w, a)), strict=True):
            c, s = length * cos(angle), length * sin(angle)
            ax, ay = ax - s * gain - c * rate * rate, ay + c * gain - s * rate * rate
        return ax, ay

    def jacobian(self, q: Joints) -> NDArray[np.float64]:
        """(2, joints) the tip velocity per joint speed, of one pose in floats."""
        columns = [self.tip_velocity(q, list(row)) for row in np.eye(self.joints)]
        return np.array(columns, dtype=np.float64).T

    def loaded(self, payload: float) -> Self:
        """The same arm with another payload (kg)."""
        return type(self)(self.lengths, self.masses, self.centres, self.inertias, payload)
