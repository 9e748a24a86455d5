"""Energy-optimal moves of a servomotor in the velocity domain: published cases, arcs, conditions, comparisons."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from trajopt.velocity_domain import (
    Limits,
    Servomotor,
    ServoOptimum,
    conditions,
    optimum,
)

MOTOR = Servomotor(0.57, 3.0, 4.142e-4, 2e-4, 0.02, 4.0)
MAGNETIC = replace(MOTOR, eddy=1e-4, hysteresis=5e-3, exponent=1.6)
CASE_1 = (5.0, 0.4, Limits(acceleration=275.0))
CASE_3 = (60.0, 0.5, Limits(velocity=150.0, acceleration=3000.0))
SEVEN = (7.0, 0.4, Limits(acceleration=450.0))
MOVES: dict[str, tuple[Servomotor, float, float, Limits, Literal["energy", "copper"]]] = {
    "case 1": (MOTOR, *CASE_1, "energy"),
    "case 3": (MOTOR, *CASE_3, "energy"),
    "magnetic": (MAGNETIC, *CASE_1, "energy"),
    "seven arcs": (MOTOR, *SEVEN, "energy"),
    "recovery": (replace(MOTOR, recovery=0.6), 7.0, 0.4, Limits(25.0, 450.0), "energy"),
    "no friction": (replace(MOTOR, viscous=0.0, coulomb=0.0), 7.0, 0.4, Limits(acceleration=450.0), "energy"),
    "no limits": (MOTOR, 5.0, 0.4, Limits(), "energy"),
    "drive": (MOTOR, 20.0, 0.4, Limits(100.0, 3000.0, 2000.0, current=1.0, voltage=60.0), "energy"),
    "linger": (replace(MOTOR, viscous=2e-3), 20.0, 4.0, Limits(acceleration=450.0), "energy"),
    "copper": (MOTOR, *CASE_1, "copper"),
}


@cache
def move(name: str) -> ServoOptimum:
    motor, distance, duration, limits, objective = MOVES[name]
    return optimum(motor, distance, duration, limits, objective)


@pytest.mark.parametrize(
    ("name", "energy", "peak", "sequence", "switches"),
    [
        ("case 1", 0.2187656327, 20.7507933, "PA-PU-Z-NU-NA", (0.05305068, 0.10894992, 0.36615178, 0.39199477)),
        (
            "case 3",
            6.3348573325,
            150.0,
            "PA-PU-PV-PU-Z-NA",
            (0.01602446, 0.08760647, 0.10858089, 0.11177943, 0.46305523),
        ),
    ],
)
def test_the_cases_of_the_reference(
    name: str, energy: float, peak: float, sequence: str, switches: tuple[float, ...]
) -> None:
    found = move(name)
    assert found.energy == pytest.approx(energy, rel=1e-9)
    assert found.peak == pytest.approx(peak, rel=1e-8)
    assert found.sequence == sequence
    assert found.switch_times == pytest.approx(switches, abs=1e-8)


def test_eddy_and_hysteresis_losses() -> None:
    assert move("magnetic").energy == pytest.approx(0.21921483, rel=2e-8)


def test_a_move_of_seven_arcs_near_the_case_of_the_paper() -> None:
    found = move("seven arcs")
    assert found.sequence == "PA-PU-Z-NA-NU-NU-NA"
    assert [part.name for part in found.subtrajectories] == ["S11", "S2", "S12"]
    assert found.subtrajectories[2].start == found.arcs[5].start  # the two NU lie on either side of P = 0


@pytest.mark.parametrize("name", MOVES)
def test_the_move_obeys_its_dynamics_and_limits_and_costs_what_it_says(name: str) -> None:
    motor, distance, duration, limits, objective = MOVES[name]
    found = move(name)
    ends = found.at([0.0, duration])
    assert ends.position == pytest.approx([0.0, distance], abs=1e-9 * distance)
    assert ends.velocity == pytest.approx([0.0, 0.0], abs=1e-9 * found.peak)
    x, w = np.polynomial.legendre.leggauss(5)
    edges = np.linspace(0, duration, 4001)
    time = (edges[:-1, None] + np.diff(edges)[:, None] * (x + 1) / 2).ravel()
    weight = (np.diff(edges)[:, None] * w / 2).ravel()
    state = found.at(time)
    torque = motor.torque_constant * state.current - motor.coulomb - motor.viscous * state.velocity
    assert motor.inertia * state.acceleration == pytest.approx(torque, abs=1e-12)
    assert weight @ state.velocity == pytest.approx(distance, rel=1e-6)
    assert weight[:10000] @ state.acceleration[:10000] == pytest.approx(found.at(duration / 2).velocity[0], rel=1e-4)
    power = motor.resistance * state.current**2
    if objective == "energy":
        power = (
            power
            + motor.eddy * state.velocity**2 * state.current**2
            + motor.hysteresis * state.velocity * np.abs(state.current) ** motor.exponent
            + motor.switching * np.abs(state.current)
            + motor.torque_constant * state.current * state.velocity
        )
    cost = np.maximum(power, 0) - motor.recovery * np.maximum(-power, 0)
    assert weight @ cost == pytest.approx(found.energy, rel=1e-5)
    assert state.velocity.min() >= 0 and state.velocity.max() <= limits.velocity * (1 + 1e-12)
    assert state.acceleration.max() <= limits.acceleration * (1 + 1e-12)
    assert state.acceleration.min() >= -(limits.deceleration or limits.acceleration) * (1 + 1e-12)
    assert np.abs(state.current).max() <= limits.current * (1 + 1e-9)


@pytest.mark.parametrize("name", MOVES)
def test_necessary_conditions(name: str) -> None:
    found = conditions(move(name))
    assert found.hamiltonian_spread < 1e-9
    assert found.costate_jump < 1e-7 and found.stationarity < 1e-7
    assert found.minimum_principle < 1e-9
    assert min(found.acceleration_multiplier, found.speed_multiplier, found.power_multiplier) > -1e-9
    if found.theorems_apply:
        assert found.subtrajectory_order and found.s11_order and found.s2_order and found.s12_order


def test_conditions_notice_a_move_that_is_not_optimal() -> None:
    found = move("case 1")
    other = optimum(MOTOR, 5.0, 0.4, Limits(acceleration=260.0))
    looser = replace(other.law, envelope=found.law.envelope)
    report = conditions(replace(other, law=looser))
    assert max(report.hamiltonian_spread, report.minimum_principle) > 1e-3


@pytest.mark.parametrize("name", ["case 1", "case 3", "recovery", "drive", "linger", "copper"])
def test_prices_are_the_derivatives_of_the_cost(name: str) -> None:
    motor, distance, duration, limits, objective = MOVES[name]
    found, step = move(name), 1e-4

    def energy(stretch: float, delay: float) -> float:
        return optimum(motor, distance * (1 + stretch), duration * (1 + delay), limits, objective).energy

    by_distance = (energy(step, 0) - energy(-step, 0)) / (2 * step * distance)
    by_time = (energy(0, step) - energy(0, -step)) / (2 * step * duration)
    assert found.distance_price == pytest.approx(by_distance, rel=1e-5)
    assert found.time_price == pytest.approx(by_time, rel=1e-5)


@pytest.mark.parametrize("name", ["case 1", "seven arcs", "no friction", "recovery", "copper", "linger"])
def test_no_move_towards_another_profile_is_cheaper(name: str) -> None:
    """Between two speed profiles of the same duration and distance within the limits lie only such profiles."""
    motor, distance, duration, limits, objective = MOVES[name]
    found, rng = move(name), np.random.default_rng(0)
    time = np.linspace(0, duration, 4001)
    base, x, step = found.at(time).velocity, time / duration, np.diff(time)
    compared = 0
    for _ in range(200):
        other = x ** rng.uniform(1, 3) * (1 - x) ** rng.uniform(1, 3)
        other = np.minimum(other, rng.uniform(0.3, 1) * other.max())
        other *= distance / np.trapezoid(other, time)
        if np.abs(np.diff(other) / step).max() > limits.acceleration or other.max() > limits.velocity:
            continue
        for share in (0.01, 0.1, 0.5, 1.0):
            speed = base + share * (other - base)
            middle, slope = (speed[1:] + speed[:-1]) / 2, np.diff(speed) / step
            current = (motor.inertia * slope + motor.coulomb + motor.viscous * middle) / motor.torque_constant
            power = motor.resistance * current**2
            if objective == "energy":
                power += motor.switching * np.abs(current) + motor.torque_constant * current * middle
            cost = np.maximum(power, 0) - motor.recovery * np.maximum(-power, 0)
            assert cost @ step >= found.energy * (1 - 1e-6)
            compared += 1
    assert compared >= 40


def test_a_long_move_lingers_at_the_speed_at_which_friction_makes_it_cheapest_to_go_on() -> None:
    found = move("linger")
    middle = found.at(np.linspace(1.0, 3.0, 50)).velocity
    assert np.ptp(middle) < 1e-3 * found.peak
    assert found.sequence == "PU-Z"
    assert found.time_price > 0  # the move would be cheaper in less time


@pytest.mark.parametrize("limits", [Limits(acceleration=450.0), Limits(60.0, 900.0, 300.0), Limits(80.0, current=0.5)])
def test_too_little_time_names_the_least(limits: Limits) -> None:
    with pytest.raises(ValueError, match="takes more than") as told:
        optimum(MOTOR, 20.0, 1e-3, limits)
    least = float(str(told.value).split("more than ")[1].split(" s")[0])
    found = optimum(MOTOR, 20.0, least * (1 + 1e-5), limits)
    assert found.duration == pytest.approx(least, rel=1e-4)
    with pytest.raises(ValueError, match="takes more than"):
        optimum(MOTOR, 20.0, least * (1 - 1e-6), limits)


def test_least_time_of_a_trapezoid() -> None:
    with pytest.raises(ValueError, match=r"more than 0\.466666667 s"):
        optimum(MOTOR, 20.0, 0.1, Limits(60.0, 900.0, 300.0))  # 20/60 + 60/2 (1/900 + 1/300)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"exponent": 1.0}, "exponent"),
        ({"exponent": 2.1}, "exponent"),
        ({"switching": -1.0}, "switching"),
        ({"eddy": float("nan")}, "eddy"),
        ({"inertia": 0.0}, "inertia"),
        ({"recovery": 1.1}, "recovery"),
    ],
)
def test_motors_that_do_not_exist(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(MOTOR, **change)


def test_moves_and_limits_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match="cannot move the load"):
        optimum(MOTOR, 5.0, 0.4, Limits(current=0.03))
    with pytest.raises(ValueError, match="distance"):
        optimum(MOTOR, -5.0, 0.4)
    with pytest.raises(ValueError, match="duration"):
        optimum(MOTOR, 5.0, float("inf"))
    with pytest.raises(ValueError, match="velocity"):
        Limits(velocity=0.0)
    with pytest.raises(ValueError, match="objective"):
        optimum(MOTOR, 5.0, 0.4, objective="heat")  # type: ignore[arg-type]
