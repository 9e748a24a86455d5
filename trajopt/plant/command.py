"""A minimum-time command: switching times, levels, the proof that none is shorter, and what it leaves vibrating."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from trajopt.plant.basis import Basis
from trajopt.plant.exponentials import Floats
from trajopt.plant.vibration import residual_vibration


@dataclass(frozen=True)
class Command:
    """The input is ``levels[i]`` between ``switches[i - 1]`` and ``switches[i]`` (s), from 0 to ``duration``, and
    ``u_ss`` after it.

    ``poles`` (1/s) are those whose equations hold, with the ones added for robustness; ``residuals`` the errors of
    these equations, in units of the larger input limit and of each equation's largest function value; ``end_error`` the
    worst state and output at the duration against the new equilibrium, each relative to its largest value, from a
    simulation by matrix exponentials. ``optimal``: sigma(t) has the sign of the arc throughout, so that no command is
    shorter (Pontryagin; sufficient since the plant is linear); ``margin`` is the worst of sign·sigma relative to the
    sum of its terms, zero but for rounding if so.
    """

    umin: float
    umax: float
    u_ss: float
    y_f: float
    switches: tuple[float, ...]
    levels: tuple[float, ...]
    duration: float
    poles: tuple[complex, ...]
    residuals: tuple[float, ...]
    end_error: float
    optimal: bool
    margin: float
    costate: tuple[float, ...]
    basis: Basis = field(repr=False)
    horizon: float = field(repr=False)

    @property
    def first(self) -> int:
        """+1 if the command begins at ``umax``, -1 at ``umin``."""
        return 1 if self.levels[0] == self.umax else -1

    @property
    def impulses(self) -> tuple[Floats, Floats]:
        """(m + 2,) times (s) and amplitudes of the jumps of the input, the last to ``u_ss`` at the duration."""
        times = np.array([0.0, *self.switches, self.duration])
        return times, np.diff([0.0, *self.levels, self.u_ss])

    def sigma(self, t: ArrayLike) -> Floats:
        """The switching function at times (s) from 0 to the duration, positive where the input is ``umax``; its largest
        value over the arcs' ends and middles is about one."""
        ends = np.array([0.0, *self.switches, self.duration])
        marks = np.concatenate([ends, (ends[1:] + ends[:-1]) / 2])
        value: Floats = self._sigma(np.asarray(t, float)) / np.max(np.abs(self._sigma(marks)))
        return value

    def residual_vibration(self, frequency: ArrayLike, damping: float = 0.0) -> Floats:
        """What vibration a mode of ``frequency`` (rad/s) keeps, in percent; see `vibration.residual_vibration`."""
        return residual_vibration(*self.impulses, frequency, damping)

    def _sigma(self, t: Floats) -> Floats:
        h = (self.duration - t.ravel()) / self.horizon
        value: Floats = np.array(self.costate) @ self.basis.tables(np.maximum(h, 0.0))[1]
        return value.reshape(t.shape)
