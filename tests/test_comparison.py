"""Savings against trapezoid, S-curve and quintic: closed forms of the profiles, and what is said of limits."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np
import pytest

from tests.conftest import axis, solved, table_i, term
from trajopt import comparison
from trajopt.comparison import QUINTIC, Profile, broken_limits, measured, s_curve, trapezoid

MASS = {"load": {"inertia": 2.0}, "distance": 0.3, "time": 0.5}
UNIT = 2.0 * 0.3 / 0.5**2  # N


@pytest.mark.parametrize(
    ("profile", "rms"),
    [(trapezoid(1 / 3), 4.5 * sqrt(2 / 3)), (trapezoid(0.5), 4.0), (QUINTIC, sqrt(120 / 7))],
    ids=["thirds", "triangle", "quintic"],
)
def test_rms_force_of_the_profiles(profile: Profile, rms: float) -> None:
    assert measured(axis("force", "l2", **MASS), profile) == pytest.approx(rms * UNIT, rel=1e-5)


@pytest.mark.parametrize("profile", [trapezoid(0.2), s_curve(0.3), s_curve(0.3, 120.0), QUINTIC])
def test_stroke_and_peaks_are_those_of_the_velocity(profile: Profile) -> None:
    t = np.linspace(0.0, 1.0, 200_001)
    velocity = profile.velocity(t)
    assert np.trapezoid(velocity, t) == pytest.approx(1.0, abs=1e-8)
    acceleration = np.gradient(velocity, t)
    found = (velocity.max(), np.abs(acceleration).max(), np.abs(np.gradient(acceleration, t)).max())
    finite = [k for k, peak in enumerate(profile.peaks) if peak < inf]
    assert [found[k] for k in finite] == pytest.approx([profile.peaks[k] for k in finite], rel=2e-4)


def test_energy_is_that_of_the_peak_speed() -> None:
    problem = axis("energy", **MASS)
    for profile in (trapezoid(0.2), s_curve(0.4, 200.0), QUINTIC):
        assert profile is not None
        assert measured(problem, profile) == pytest.approx(2.0 * (profile.peaks[0] * 0.6) ** 2, rel=1e-4)


def test_too_little_jerk_makes_no_s_curve() -> None:
    assert s_curve(0.2, 4 / 0.8 / 0.2**2 * 0.999) is None
    assert s_curve(0.5, 32.0) is not None and s_curve(0.5, 31.99) is None


def test_the_optimum_beats_every_profile_that_keeps_the_limits() -> None:
    for minimize, norm in (("power", "linf"), ("power", "l2"), ("force", "l2")):
        solution = solved(table_i(minimize, norm))
        rows = {row["profile"]: row for row in solution.comparison()}
        assert list(rows) == ["best trapezoid", "trapezoid 1/3-1/3-1/3", "best S-curve", "quintic"]
        assert rows["best S-curve"]["breaks"] == [] and rows["best trapezoid"]["breaks"] == ["jerk"]
        for row in rows.values():
            assert row["saving"] == pytest.approx(1 - solution.objective / row["objective"])
            assert row["saving"] > 0
    force = {row["profile"]: row["objective"] for row in solution.comparison()}
    assert force["best S-curve"] < 1.01 * force["quintic"]


def test_limits_are_kept_by_the_best_and_named_for_the_others() -> None:
    tight: dict[str, Any] = {"velocity": 1.3 * 0.6, "acceleration": 6.0 * 1.2, "jerk": 2000.0}
    problem = axis("energy", limits=tight, **MASS)
    assert broken_limits(problem, QUINTIC) == ["velocity"]
    rows = {row["profile"]: row for row in comparison.compare_with_profiles(problem, 1.0)}
    assert rows["best S-curve"]["breaks"] == []
    stiff = axis("energy", limits={"velocity": 1.05 * 0.6, "acceleration": 6.0 * 1.2}, **MASS)
    rows = {row["profile"]: row for row in comparison.compare_with_profiles(stiff, 1.0)}
    assert rows["best trapezoid"]["objective"] is None and rows["best trapezoid"]["saving"] is None


@pytest.mark.parametrize(
    "problem",
    [
        axis("jerk", "l2", **MASS),
        axis("energy", start={"velocity": 0.1}, **MASS),
        axis([term("energy"), term("jerk", "l2")], **MASS),
        axis("energy", scheme="euler", **MASS),
    ],
    ids=["jerk", "moving", "mixed", "euler"],
)
def test_no_comparison_where_it_means_nothing(problem: Any) -> None:
    assert comparison.compare_with_profiles(problem, 1.0) == []


def test_backwards_saves_as_much() -> None:
    given: dict[str, Any] = {"load": {"inertia": 1.0}, "limits": {"jerk": 60.0}}
    rows = [comparison.compare_with_profiles(axis("power", "linf", distance=d, **given), 1.0) for d in (0.5, -0.5)]
    assert [r["objective"] for r in rows[0]] == pytest.approx([r["objective"] for r in rows[1]], rel=1e-12)
