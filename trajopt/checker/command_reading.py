"""A result of the format "trajopt command 1" read without trust: the plant, the command, and what is claimed of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from trajopt.checker.case import Array
from trajopt.checker.linear_system import System, chain
from trajopt.checker.reading import certificate_of
from trajopt.checker.values import Malformed, is_solved, mapping, number, shown, vector

FORMAT: Final = "trajopt command 1"
_CLAIMED: Final = ("objective", "duration", "metrics", "command")
_PLANT: Final = (
    "numerator", "denominator", "poles", "zeros", "gain", "A", "B", "C", "D",
    "input", "final_value", "final_input", "robust",
)  # fmt: skip
_MOST_STATES: Final = 100
_MOST_JUMPS: Final = 20_000
_ONE: Final = 1e-3  # of their size: computed poles nearer than this are one


@dataclass(frozen=True)
class Commanded:
    """A command and its plant, in times of its duration: ``added`` poles are those that robustness asks for
    besides the plant's."""

    plant: System
    poles: tuple[complex, ...]
    added: tuple[complex, ...]
    modes: tuple[complex, ...]
    low: float
    high: float
    final_value: float
    wanted_input: float | None
    time: Array
    levels: Array
    final_input: float
    sigma: tuple[Array, Array] | None
    solved: bool
    objective: float
    duration: float
    metrics: dict[str, float]
    lower_bound: float | None
    gap: float | None
    has_certificate: bool

    @property
    def backward(self) -> Array:
        """(m + 2,) how long before the end the input jumps, falling from 1 to 0."""
        result: Array = (self.time[-1] - self.time) / self.time[-1]
        return result


def read_command(result: Mapping[str, Any], notes: list[str]) -> Commanded | None:
    """The result as a command, None when its status is one without a solution. Raises Malformed."""
    required = ("trajopt", "status", "problem_hash", "problem", *_CLAIMED)
    if not is_solved(result, required, _CLAIMED):
        return None
    problem = mapping(result["problem"], "problem")
    notes += [f"problem.{key}" for key in problem if key not in ("plant", "title", "source", "moral")]
    stated = mapping(problem.get("plant"), "problem.plant", _PLANT)
    command = mapping(result["command"], "command", ("times", "levels", "final_input", "sigma"))
    time, levels = vector(command.get("times"), "command.times"), vector(command.get("levels"), "command.levels")
    if len(time) < 2 or time[0] != 0 or not np.all(np.diff(time) > 0):
        raise Malformed("command.times must start at 0 and increase")
    if len(time) > _MOST_JUMPS:
        raise Malformed(f"command.times has {len(time)} jumps; at most {_MOST_JUMPS} are checked")
    if len(levels) != len(time) - 1:
        raise Malformed(f"command.levels has {len(levels)} values where {len(time) - 1} belong")
    try:
        plant, poles = _plant(stated, float(time[-1]))
        added = _added(stated.get("robust"), poles, float(time[-1]))
    except np.linalg.LinAlgError as error:
        raise Malformed(f"problem.plant: {error}") from None
    low, high = _pair(stated.get("input"), "plant.input")
    wanted = stated.get("final_input")
    metrics = {
        str(name): number(value, f"metrics.{name}") for name, value in mapping(result["metrics"], "metrics").items()
    }
    return Commanded(
        plant=plant, poles=tuple(poles), added=added, modes=_upper(poles), low=low, high=high,
        final_value=number(stated.get("final_value"), "plant.final_value"),
        wanted_input=None if wanted is None else number(wanted, "plant.final_input"),
        time=time, levels=levels, final_input=number(command.get("final_input"), "command.final_input"),
        sigma=_sigma(command.get("sigma")), solved=result["status"] == "SOLVED",
        objective=number(result["objective"], "objective"), duration=number(result["duration"], "duration"),
        metrics=metrics, **certificate_of(result.get("certificate")),
    )  # fmt: skip


def _plant(stated: Mapping[str, Any], duration: float) -> tuple[System, list[complex]]:
    """The plant of a problem and its poles, in times of ``duration`` (s)."""
    if stated.get("A") is not None:
        b, c = (vector(stated.get(key), f"plant.{key}") for key in ("B", "C"))
        rows = [vector(row, "plant.A") for row in (stated["A"] if isinstance(stated["A"], list | tuple) else ())]
        a = np.array(rows) if len({len(row) for row in rows}) == 1 else np.empty(0)
        if not 0 < len(b) <= _MOST_STATES or a.shape != (len(b), len(b)) or len(c) != len(b):
            raise Malformed("plant: A, B and C do not fit together")
        system = System(a * duration, b * duration, c, number(stated.get("D", 0.0), "plant.D")).balanced()
        return system, _eigenvalues(system.a)
    if stated.get("poles") is not None:
        poles, zeros = (_roots(stated.get(key, ()), f"plant.{key}") for key in ("poles", "zeros"))
        gain = number(stated.get("gain", 1.0), "plant.gain")
    else:
        upper, lower = (
            np.trim_zeros(vector(stated.get(key), f"plant.{key}"), "f") for key in ("numerator", "denominator")
        )
        if not len(upper) or not len(lower):
            raise Malformed("plant: numerator and denominator must not vanish")
        poles, zeros = ([complex(p) for p in np.roots(x)] for x in (lower, upper))
        gain = float(upper[0] / lower[0])
    if not 0 < len(poles) <= _MOST_STATES or len(zeros) > len(poles):
        raise Malformed("plant: it must have poles, and not more zeros")
    poles, zeros = ([p * duration for p in roots] for roots in (poles, zeros))
    return chain(poles, zeros, gain * duration ** (len(poles) - len(zeros))).balanced(), poles


def _eigenvalues(a: Array) -> list[complex]:
    """The eigenvalues by size; those that rounding tells from a repeated one at zero only are zero."""
    found = sorted((complex(p) for p in np.linalg.eigvals(a)), key=abs)
    rounding = 64 * len(a) * np.finfo(float).eps
    for count in range(len(a), 0, -1):
        sizes = np.linalg.norm(a) ** np.arange(1, count + 1)
        if np.all(np.abs(np.poly(found[:count])[1:]) <= rounding * sizes):
            return [0j] * count + found[count:]
    return found


def _added(robust: Any, poles: list[complex], duration: float) -> tuple[complex, ...]:
    """The poles that robustness adds, in times of the duration, with their conjugates."""
    if robust is None:
        return ()
    if robust == "zvd":
        return tuple(x for p in _upper(poles) for x in (p, p.conjugate()))
    stated = mapping(robust, "plant.robust", ("band", "damping", "count", "poles"))
    if stated.get("poles") is not None:
        return tuple(p * duration for p in _roots(stated["poles"], "plant.robust.poles"))
    low, high = _pair(stated.get("band"), "plant.robust.band")
    damping, count = number(stated.get("damping", 0.0), "damping"), number(stated.get("count", 3), "count")
    if not 0 <= damping < 1 or not 1 <= count <= _MOST_STATES:
        raise Malformed("plant.robust: damping must be 0 to 1, count from 1 on")
    rates = 2 * np.pi * duration * np.linspace(low, high, int(count))
    upper = [complex(-damping * w, w * np.sqrt(1 - damping**2)) for w in rates]
    return tuple(x for p in upper for x in (p, p.conjugate()))


def _upper(poles: list[complex]) -> tuple[complex, ...]:
    """The distinct oscillatory poles above the real axis, by size; those computed as a cluster count as their mean."""
    left = sorted((p for p in poles if p.imag > _ONE * abs(p)), key=abs)
    found = []
    while left:
        near = [p for p in left if abs(p - left[0]) <= _ONE * abs(p)]
        found.append(complex(np.mean(near)))
        left = [p for p in left if p not in near]
    return tuple(found)


def _roots(value: Any, where: str) -> list[complex]:
    """Roots written as numbers or [re, im]."""
    if not isinstance(value, list | tuple):
        raise Malformed(f"{where} is not a list")
    found = []
    for root in value:
        parts = vector(root if isinstance(root, list | tuple) else [root, 0.0], where)
        if len(parts) != 2:
            raise Malformed(f"{where} holds {shown(root)}, neither a number nor [re, im]")
        found.append(complex(*parts))
    for p in found:
        if found.count(p) != found.count(p.conjugate()):
            raise Malformed(f"{where} lacks a conjugate")
    return found


def _pair(value: Any, where: str) -> tuple[float, float]:
    if len(pair := vector(value, where)) != 2:
        raise Malformed(f"{where} is no pair")
    return float(pair[0]), float(pair[1])


def _sigma(value: Any) -> tuple[Array, Array] | None:
    """Samples of the switching function: times (s) and values."""
    if value is None:
        return None
    stated = mapping(value, "command.sigma", ("time", "value"))
    time, values = (vector(stated.get(key), f"command.sigma.{key}") for key in ("time", "value"))
    if len(time) != len(values):
        raise Malformed("command.sigma needs as many values as times")
    return time, values
