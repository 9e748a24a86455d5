"""Motions, measured or simulated: time, position and torque, with a polynomial through the positions.

Differences of samples would amplify their noise; the polynomial gives velocity and acceleration, and the residual
chooses its degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.polynomial import Chebyshev, chebyshev

from trajopt.columns import Columns
from trajopt.curve import LEAST
from trajopt.errors import BadInput
from trajopt.mesh import Floats

_MOST: Final = 25  # degree of the polynomial through positions
_ROUNDING: Final = 1e-14  # of the stroke: a residual this small says nothing more


@dataclass(frozen=True)
class Motion:
    """A motion: time s, position m or rad, force N or N m, and the polynomial through the positions."""

    time: Floats
    position: Floats
    force: Floats
    smooth: Chebyshev
    rotary: bool = True
    name: str = "motion"

    @classmethod
    def of(cls, time: Any, position: Any, force: Any, rotary: bool = True, name: str = "motion") -> Motion:
        """A motion from its samples. Raises BadInput for too few, or for times that do not increase."""
        time, position, force = (np.asarray(x, dtype=float) for x in (time, position, force))
        if len(time) < 4 * LEAST:
            raise BadInput(f"{name}: {len(time)} samples are too few; record {4 * LEAST} or more")
        if not len(time) == len(position) == len(force) or np.any(np.diff(time) <= 0):
            raise BadInput(f"{name}: time must increase, and every sample needs a position and a torque")
        return cls(time, position, force, smoothed(time, position), rotary, name)

    @classmethod
    def read(cls, path: Path) -> Motion:
        """A motion from a CSV whose header has units. Raises BadInput."""
        try:
            table = Columns.read(path)
            rotary = table.has("position", True)
            time, position, force = (table.get(kind, rotary) for kind in ("time", "position", "force"))
            return cls.of(time, position, force, rotary, str(path))
        except ValueError as error:
            raise BadInput(str(error)) from None

    @property
    def velocity(self) -> Floats:
        """(n,) m/s or rad/s."""
        return np.asarray(self.smooth.deriv()(self.time))

    @property
    def acceleration(self) -> Floats:
        """(n,) m/s² or rad/s²."""
        return np.asarray(self.smooth.deriv(2)(self.time))


def smoothed(time: Floats, position: Floats) -> Chebyshev:
    """The polynomial through noisy positions, of the degree that Bayes' criterion prefers for its residual."""
    best, least, size = 1, np.inf, float(np.ptp(position)) or 1.0
    domain = [float(time[0]), float(time[-1])]
    x = (2 * time - domain[0] - domain[1]) / (domain[1] - domain[0])
    base, triangle = np.linalg.qr(chebyshev.chebvander(x, min(_MOST, len(time) // 3)))
    shares, left = base.T @ position, position.copy()
    for degree, share in enumerate(shares):
        left = left - share * base[:, degree]
        mean_square = float(np.mean(left**2)) / size**2
        score = bayes(mean_square, len(time), degree + 1)
        if degree and score < least:
            best, least = degree, score
        if mean_square <= _ROUNDING**2:
            break
    kept = slice(best + 1)
    return Chebyshev(np.linalg.solve(triangle[kept, kept], shares[kept]), domain=domain)


def bayes(mean_square: float, samples: int, unknowns: int) -> float:
    """Bayes' criterion, up to what does not matter: the less, the better."""
    return samples * log(max(mean_square, 1e-32)) + unknowns * log(samples)
