"""Mechanical power and energy under a jerk limit, over speed: published optima, closed forms, never above a move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trajopt.velocity_domain import (
    Axis,
    least_energy,
    least_peak_power,
    least_square_power,
    minimum_time,
    over_time,
    power_within,
)

TABLE_I = Axis(10.0, 0.254, 1.0, velocity=0.5, acceleration=4.905, jerk=98.1)
FREE = Axis(10.0, 0.254, 1.0)
FRONT = {
    0.82: 6.218145347,
    0.90: 3.111852280,
    1.00: 2.305870291,
    1.10: 1.991610141,
    1.20: 1.836031137,
    1.30: 1.752570106,
    1.40: 1.708115973,
    1.50: 1.687165811,
}


def test_optima_on_the_axis_of_table_i() -> None:
    assert least_energy(TABLE_I) == pytest.approx(0.810949200133, rel=1e-11)
    assert minimum_time(TABLE_I) == pytest.approx(0.6599367992, rel=1e-9)
    lowest = least_peak_power(TABLE_I)
    assert lowest.power == pytest.approx(1.681495190894, rel=1e-11)
    assert lowest.energy == pytest.approx(1.591403924, rel=1e-9)
    assert least_square_power(TABLE_I).value == pytest.approx(1.8564080358, rel=1e-10)


def test_the_moves_of_optima_over_time() -> None:
    time = np.linspace(0.0, TABLE_I.duration, 20_001)
    lowest, square = least_peak_power(TABLE_I), least_square_power(TABLE_I)
    for ramps, peak in ((TABLE_I.shortest(lowest.peak, lowest.power), lowest.peak), (square.ramps, square.peak)):
        v, a = over_time(ramps, TABLE_I.duration, time)
        assert np.trapezoid(v, time) == pytest.approx(TABLE_I.distance, rel=2e-4)
        assert np.max(v) == pytest.approx(peak, rel=1e-4) and v[0] == v[-1] == 0.0
        assert np.max(np.abs(np.cumsum(a) * time[1] - v)) < 1e-3 * peak
        power = TABLE_I.mass * np.abs(a * v)
        if ramps is square.ramps:
            assert np.trapezoid(power**2, time) == pytest.approx(square.value, rel=1e-3)
        else:
            assert np.max(power) == pytest.approx(lowest.power, rel=1e-4)


def test_the_front_of_energy_and_peak_power() -> None:
    for energy, power in FRONT.items():
        assert power_within(TABLE_I, energy).power == pytest.approx(power, rel=1e-8)


def test_the_front_is_convex_and_ends_at_the_least_peak_power() -> None:
    lowest = least_peak_power(TABLE_I)
    powers = [power_within(TABLE_I, e).power for e in np.linspace(0.85, lowest.energy, 9)]
    assert (np.diff(powers) < 0).all() and (np.diff(powers, 2) > 0).all()
    assert powers[-1] == pytest.approx(lowest.power, rel=1e-12)
    assert power_within(TABLE_I, 3.0) == lowest


def test_closed_forms_without_limits() -> None:
    mass, distance, time = 3.0, 0.7, 1.3
    axis = Axis(mass, distance, time)
    assert least_peak_power(axis).power == pytest.approx(9 / 4 * mass * distance**2 / time**3, rel=1e-12)
    assert least_square_power(axis).value == pytest.approx(125 / 36 * mass**2 * distance**4 / time**5, rel=1e-10)
    assert least_energy(axis) == pytest.approx(mass * (distance / time) ** 2, rel=1e-12)
    assert minimum_time(axis) == 0


@pytest.mark.parametrize(("distance", "time"), [(0.254, 0.6599367992), (0.05, 0.2580257669), (0.005, 0.1177109844)])
def test_minimum_times_of_s_curves(distance: float, time: float) -> None:
    assert minimum_time(replace(TABLE_I, distance=distance)) == pytest.approx(time, rel=1e-9)


def test_minimum_time_of_an_uneven_trapezoid() -> None:
    axis = Axis(1.0, 2.0, 9.0, velocity=0.5, acceleration=1.0, deceleration=0.25)
    assert minimum_time(axis) == pytest.approx(2.0 / 0.5 + 0.5 / 2 * (1 / 1.0 + 1 / 0.25), rel=1e-12)
    assert minimum_time(replace(axis, velocity=9.0)) == pytest.approx(np.sqrt(2 * 2.0 * (1 + 4)), rel=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_no_optimum_lies_above_a_move_within_the_limits(seed: int) -> None:
    """A smooth random move whose own peaks are the limits: all of them are tight for it."""
    rng = np.random.default_rng(seed)
    rise, fall = rng.uniform(2, 5, 2)
    mass, time = rng.uniform(0.1, 20), rng.uniform(0.2, 4)
    x = np.linspace(0, 1, 40001)
    speed = rng.uniform(0.1, 3) * x**rise * (1 - x) ** fall
    acceleration = np.gradient(speed, x * time)
    jerk = np.gradient(acceleration, x * time)
    power = mass * acceleration * speed
    axis = Axis(
        mass,
        float(np.trapezoid(speed, x * time)),
        time,
        float(speed.max()),
        float(acceleration.max()),
        float(-acceleration.min()),
        float(np.abs(jerk).max()),
    )
    slack = 1 + 1e-5
    assert minimum_time(axis) < time * slack
    assert least_energy(axis) <= mass * speed.max() ** 2 * slack
    assert least_peak_power(axis).power <= np.abs(power).max() * slack
    assert least_square_power(axis).value <= np.trapezoid(power**2, x * time) * slack
    assert power_within(axis, mass * float(speed.max()) ** 2 * slack).power <= np.abs(power).max() * slack


@pytest.mark.parametrize("tighter", [{"velocity": 0.36}, {"acceleration": 1.5}, {"jerk": 20.0}, {"deceleration": 1.2}])
def test_a_tighter_limit_costs_more_and_a_looser_one_nothing_more(tighter: dict[str, float]) -> None:
    axis = replace(TABLE_I, **tighter)
    for value in (least_energy, lambda a: least_peak_power(a).power, lambda a: least_square_power(a).value):
        assert value(axis) > value(TABLE_I) * (1 - 1e-12) or "velocity" in tighter
    assert least_peak_power(axis).power > least_peak_power(TABLE_I).power
    assert least_square_power(axis).value > least_square_power(FREE).value


def test_least_values_relate_as_they_must() -> None:
    """Mean square below peak square, energy below peak power times time, for one and the same duration."""
    for axis in (TABLE_I, FREE, replace(TABLE_I, deceleration=2.0), replace(TABLE_I, duration=0.67)):
        peak, square = least_peak_power(axis), least_square_power(axis)
        assert square.value < peak.power**2 * axis.duration
        assert least_energy(axis) < peak.energy < peak.power * axis.duration * (1 + 1e-12)
        assert least_energy(axis) ** 2 < square.value * axis.duration


def test_units_do_not_matter() -> None:
    micro = Axis(10.0, 254e3, 1.0, 500e3, 4905e3, None, 98100e3)
    assert least_peak_power(micro).power == pytest.approx(1e12 * 1.681495190894, rel=1e-10)
    assert least_square_power(micro).value == pytest.approx(1e24 * 1.8564080358, rel=1e-9)


def test_durations_just_above_the_least() -> None:
    axis = replace(TABLE_I, duration=minimum_time(TABLE_I) * (1 + 1e-6))
    assert least_energy(axis) == pytest.approx(2.5, rel=1e-3)  # at the speed limit
    assert least_peak_power(axis).power == pytest.approx(18.510244, rel=2e-2)


def test_impossible_questions() -> None:
    short = replace(TABLE_I, duration=0.6)
    for ask in (least_energy, least_peak_power, least_square_power):
        with pytest.raises(ValueError, match=r"takes 0\.659936799 s, not 0\.6 s"):
            ask(short)
    with pytest.raises(ValueError, match=r"at least 0\.8109492 J"):
        power_within(TABLE_I, 0.8)
    with pytest.raises(ValueError, match="distance must be positive"):
        replace(TABLE_I, distance=-1.0)
    with pytest.raises(ValueError, match="limit of jerk"):
        replace(TABLE_I, jerk=0.0)
