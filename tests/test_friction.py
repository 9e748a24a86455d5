"""Friction at rest: when a program without a solution is a verdict on the move, and what a bound then is about."""

from __future__ import annotations

from typing import Any

import pytest

import trajopt
from tests.conftest import axis
from trajopt.attempt import Clock
from trajopt.friction import is_charged, is_settled
from trajopt.transcribe import Setting

LOAD = {"inertia": 1.0, "coulomb": 5.0}
WEAK = {"velocity": (0.0, 2.0), "force": (-10.0, 2.0)}  # brakes from 1 m/s within 0.05 to 0.17 m, and stays


def coasting(distance: float, **changes: Any) -> Setting:
    given = {"limits": WEAK, "load": LOAD, "start": {"velocity": 1.0}, "distance": distance, **changes}
    return Setting.of(axis("acceleration", "l2", **given))


def test_limits_that_allow_a_crawl_settle_it_without_another_program() -> None:
    clock = Clock()
    assert is_settled(coasting(0.1, limits=WEAK | {"force": (-10.0, 5.0)}), clock)
    assert is_settled(coasting(0.1, load={"inertia": 1.0}), clock)
    assert not clock.spent


@pytest.mark.parametrize(("distance", "settled"), [(0.03, True), (0.1, False), (1.2, True)])
def test_a_motor_too_weak_to_crawl_is_judged_by_what_no_pause_can_break(distance: float, settled: bool) -> None:
    assert is_settled(coasting(distance), Clock()) is settled


def test_a_bound_says_that_it_counts_friction_at_rest_as_in_motion() -> None:
    limits = {"velocity": (0.0, 2.0), "force": 20.0}
    assert is_charged(Setting.of(axis("force", "l1", limits=limits, load=LOAD)))
    assert not is_charged(Setting.of(axis("acceleration", "l2", limits=limits, load=LOAD)))
    assert is_charged(coasting(0.1))
    solution = trajopt.solve(axis("force", "l1", limits=limits, load=LOAD, intervals=10))
    assert "friction at rest as in motion" in solution.certificate["bounds"]
