"""Random linear plants of two to seven states: the switching function proves every command."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from trajopt.plant import Command, Plant, time_optimal


@dataclass(frozen=True)
class Case:
    """A plant with input limits and a final value."""

    plant: Plant
    umin: float
    umax: float
    y_f: float

    def command(self) -> Command:
        """Its minimum-time command."""
        return time_optimal(self.plant, self.umin, self.umax, y_f=self.y_f)


def random_case(seed: int) -> Case:
    """Real poles, pairs with damping ratio 0 to 0.9, up to two poles at zero, some of them repeated; time unit, input
    unit and output unit over six decades; asymmetric limits, moves from short to long."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(2, 8))
    rigid = int(rng.integers(0, 3))
    rate = 10 ** rng.uniform(-3, 3)
    poles: list[complex] = [0j] * min(rigid, order)
    while len(poles) < order:
        room = order - len(poles)
        if room >= 2 and rng.random() < 0.6:
            w, damping = (
                rate * 10 ** rng.uniform(-0.7, 0.7),
                rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform(0, 0.9)]),
            )
            p = complex(-damping * w, w * np.sqrt(1 - damping**2))
            block = [p, p.conjugate()]
        else:
            block = [complex(-rate * 10 ** rng.uniform(-0.7, 0.7))]
        copies = 2 if rng.random() < 0.2 and room >= 2 * len(block) else 1
        poles += block * copies
    plant = Plant.from_poles(poles, gain=10 ** rng.uniform(-3, 3))
    unit = 10 ** rng.uniform(-3, 3)
    umin, umax = -unit * rng.uniform(0.3, 1.0), unit * rng.uniform(0.3, 1.0)
    if plant.rigid:
        y_f = plant.limit * unit / rate**plant.rigid * rng.choice([-1, 1]) * 10 ** rng.uniform(-1.5, 1.5)
    else:
        y_f = plant.limit * rng.uniform(0.95 * umin, 0.95 * umax)
    return Case(plant, umin, umax, float(y_f))


def check(seed: int) -> Command:
    """The command of a random case, verified: sign of sigma, equations, simulated end."""
    command = random_case(seed).command()
    assert command.optimal, f"seed {seed}: margin {command.margin:g}"
    assert max(abs(x) for x in command.residuals) <= 1e-11, f"seed {seed}"
    assert command.end_error <= 1e-9, f"seed {seed}: end error {command.end_error:g}"
    return command


@pytest.mark.parametrize("seed", range(60))
def test_switching_function_of_random_plants(seed: int) -> None:
    check(seed)
