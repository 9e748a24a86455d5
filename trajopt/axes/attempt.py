"""One nonconvex program of coupled axes solved once, from one start, and read back as a motion."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from trajopt.attempt import Clock, free_duration
from trajopt.axes.motion import Motion, driven, loads
from trajopt.axes.objective import lower
from trajopt.axes.starts import Guess
from trajopt.axes.transcription import AxesSetting, AxesTranscript, fractions_of, transcribe
from trajopt.mesh import Floats, Mesh
from trajopt.model import Claim, Outcome
from trajopt.rebuild import rebuild
from trajopt.trajectory import Trajectory


@dataclass(frozen=True)
class AxesAttempt:
    """What came of one run: the outcome, the motion read from it, and the objective of that, SI."""

    outcome: Outcome
    motion: Motion | None = None
    value: float = np.nan


class AxesProgram:
    """The program of a setting, built once, for any number of starts."""

    def __init__(self, setting: AxesSetting, clock: Clock) -> None:
        from trajopt.model_pyomo import NonconvexModel

        since = perf_counter()
        self._setting, self._clock, self._model = setting, clock, NonconvexModel(coupled=True)
        duration, self._free = setting.problem.fixed_time, None
        if duration is None:
            self._free = free_duration(setting.axes[0], self._model, setting.axes[0].sizes.duration)
        self._transcript = transcribe(setting, self._model, duration if self._free is None else self._free[0])
        self._model.minimize(lower(self._transcript.axes, setting.problem.objective).expression)
        clock.charge("model", since)

    def run(self, start: Guess, rung: str = "ipopt") -> AxesAttempt:
        """A local optimum by Ipopt, from a start; ``rung``: one of `trajopt.model_pyomo.RUNGS`."""
        since, model = perf_counter(), self._model
        model.afresh()
        if self._free is not None:
            model.start(self._free, np.array([start.duration]))
        _begin(self._setting, model, self._transcript, start)
        outcome = model.run(rung, self._clock.left())
        self._clock.charge("solve", since)
        if outcome.claim is not Claim.OPTIMAL:
            return AxesAttempt(outcome)
        motion = _read(self._setting, model, self._transcript)
        return AxesAttempt(outcome, motion, motion.objective)


def _begin(setting: AxesSetting, model: Any, transcript: AxesTranscript, start: Guess) -> None:
    """Start every variable: the chains, the torques that belong to them, and the durations of the phases."""
    chains = start.chains(setting)
    for axis, chain in zip(transcript.axes, chains, strict=True):
        for x, values in zip(axis.chain, chain, strict=True):
            model.start(x, values)
    if transcript.torques:
        axes = [
            Trajectory(s.problem, s.mesh, s.scheme, s.sizes, start.duration, 0.0, tuple(chain)).transcript
            for s, chain in zip(setting.axes, chains, strict=True)
        ]
        for variables, ends in zip(transcript.torques, loads(setting.problem.dynamics, axes), strict=True):
            for x, values in zip(variables, ends, strict=True):
                model.start(x, values)
    if transcript.parameters is not None:
        model.start(transcript.parameters, _nearest(setting, chains))
    if transcript.parts and start.release is not None:
        for part, seconds in zip(transcript.parts, (start.release, start.duration - start.release), strict=True):
            model.start(part, np.array([seconds]))


def _nearest(setting: AxesSetting, chains: list[list[Floats]]) -> Floats:
    """The path parameters of the points of a curve that are nearest to the tip at the inner nodes, growing."""
    problem, grid = setting.problem, np.linspace(0.0, 1.0, 2001)
    assert problem.tip is not None and problem.tip.curve is not None
    x, y = problem.tip.curve.point(grid)
    axes = zip(chains, setting.axes, strict=True)
    q = [chain[0][1:-1] + (axis.problem.move.start_position or 0.0) for chain, axis in axes]
    tip = problem.dynamics.tip(q)
    found = grid[np.argmin(np.hypot(tip[0][:, None] - x, tip[1][:, None] - y), axis=1)]
    return np.asarray(np.maximum.accumulate(found))


def _read(setting: AxesSetting, model: Any, transcript: AxesTranscript) -> Motion:
    """The motion that follows from the top derivatives, re-integrated."""
    found, problem = transcript.axes[0].duration, setting.problem
    duration = found if isinstance(found, float) else float(model.value(found))
    mesh = setting.mesh
    if transcript.parts:
        mesh = Mesh(fractions_of([float(model.value(part[0])) for part in transcript.parts], setting))
    axes = []
    for own, axis in zip(setting.axes, transcript.axes, strict=True):
        values = [model.value(x) for x in axis.chain]
        first = np.array([x[0] for x in values[:-1]])
        axes.append(rebuild(own.problem, mesh, own.scheme, own.sizes, duration, first, values[-1]))
    at = None
    if setting.release is not None:
        at = float(axes[0].time[setting.release])
        at = problem.release if isinstance(problem.release, float) else at
    return Motion(problem, driven(problem, axes), at)


def on_mesh(setting: AxesSetting, intervals: int) -> AxesSetting:
    """The setting of the same problem on another number of intervals."""
    transcription = setting.problem.transcription.model_copy(update={"intervals": intervals})
    return AxesSetting.of(setting.problem.replace(transcription=transcription))
