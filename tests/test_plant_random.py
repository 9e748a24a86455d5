"""Random linear plants of two to seven states: the independent check proves every command the shortest."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.plant import Plant
from trajopt.plant.problem import PlantProblem


def random_problem(seed: int) -> PlantProblem:
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
    gain = 10 ** rng.uniform(-3, 3)
    plant = Plant.from_poles(poles, gain=gain)
    unit = 10 ** rng.uniform(-3, 3)
    umin, umax = -unit * rng.uniform(0.3, 1.0), unit * rng.uniform(0.3, 1.0)
    if plant.rigid:
        y_f = plant.limit * unit / rate**plant.rigid * rng.choice([-1, 1]) * 10 ** rng.uniform(-1.5, 1.5)
    else:
        y_f = plant.limit * rng.uniform(0.95 * umin, 0.95 * umax)
    return PlantProblem(plant={"poles": poles, "gain": gain, "input": (umin, umax), "final_value": float(y_f)})


def fault(seed: int) -> str:
    """What is wrong with the solution of a random plant; empty when the switching function, found twice, proves it, its
    equations hold and both simulations end at rest."""
    try:
        solution = trajopt.solve(random_problem(seed))
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    command = solution.command
    if solution.status is not trajopt.Verdict.SOLVED:
        return f"{solution.status.value}: {solution.message}"
    if not abs(solution.certificate["gap"]) <= 1e-7 or solution.audit["not_checked"]:
        return f"gap {solution.certificate['gap']:.2g}, not checked: {solution.audit['not_checked']}"
    residual = max(abs(x) for x in command.residuals)
    exact = residual <= 1e-11 and command.end_error <= 1e-9
    return "" if exact else f"residual {residual:.2g}, end off by {command.end_error:.2g}"


@pytest.mark.parametrize("seed", range(60))
def test_random_plants_are_proven(seed: int) -> None:
    assert fault(seed) == ""


@pytest.mark.parametrize("seed", [4, 17, 18, 46])  # stiff, repeated, at zero: hard on eigenvalues and on the proof
def test_matrices_and_doubled_poles_are_proven(seed: int) -> None:
    plant = random_problem(seed).plant
    a, b, c, d = plant.model.matrices
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((len(a), len(a))))[0]
    stated = {"A": turn @ a @ turn.T, "B": turn @ b, "C": c @ turn.T, "D": d, "robust": "zvd"}
    turned = PlantProblem(plant=stated | {"input": plant.input, "final_value": plant.final_value})
    given = PlantProblem(plant=plant.model_copy(update={"robust": "zvd"}))
    solutions = [trajopt.solve(problem) for problem in (given, turned)]
    assert all(solution.status is trajopt.Verdict.SOLVED for solution in solutions)
    assert solutions[1].duration == pytest.approx(solutions[0].duration, rel=1e-7)


def test_switches_that_meet_are_left_out() -> None:
    solution = trajopt.solve(random_problem(99))  # sigma touches zero: an arc of no length
    times = np.array([0.0, *solution.command.switches, solution.duration])
    assert solution.status.solved and np.min(np.diff(times)) > 1e-6 * solution.duration
