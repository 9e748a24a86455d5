"""Every cure offered works when applied, and a thousandth less does not; blocked times are blocked."""

from __future__ import annotations

import pytest

import trajopt
from tests.conftest import axis
from trajopt.problem import Problem
from trajopt.verdict import Verdict


def clemen_rupp(*overrides: str) -> Problem:
    """The axis of Table I, minimum jerk, with overrides."""
    return trajopt.load("clemen_rupp_jerk_l2", overrides)


TOO_FAST = {
    "asymmetric": ('move.time="0.55 s"',),
    "symmetric": ('move.time="0.5 s"', 'limits.velocity="0.5 m/s"'),
    "backwards": ('move.time="0.6 s"', 'move.end.position="-0.254 m"', 'limits.velocity="0.5 m/s"'),
    "second order": (
        'move.time="0.55 s"',
        'limits={velocity="0.6 m/s", acceleration="4 m/s^2"}',
        'objective={minimize="acceleration", norm="linf"}',
    ),
    "friction": (
        'move.time="0.5 s"',
        'limits={force="20 N", velocity=["0 m/s", "2 m/s"]}',
        'load.coulomb="5 N"',
        'objective={minimize="force", norm="l2"}',
    ),
    "snap": ('move.time="0.6 s"', 'limits.snap="3000 m/s^4"'),
}


@pytest.fixture(params=TOO_FAST, scope="module")
def impossible(request: pytest.FixtureRequest) -> tuple[Problem, trajopt.Solution]:
    problem = clemen_rupp(*TOO_FAST[request.param], "transcription.intervals=60")
    return problem, trajopt.solve(problem)


def possible(problem: Problem) -> bool:
    return trajopt.solve(problem).status.solved


def test_is_impossible_in_continuous_time_and_releases_no_numbers(impossible: tuple[Problem, trajopt.Solution]) -> None:
    _, solution = impossible
    assert solution.status is Verdict.IMPOSSIBLE
    assert solution.explanation["continuous"]
    assert solution.objective is None and solution.trajectory is None and not solution.metrics


def test_least_time(impossible: tuple[Problem, trajopt.Solution]) -> None:
    problem, solution = impossible
    least = solution.explanation["least_time"]
    assert possible(problem.replace(move=problem.move.model_copy(update={"time": least})))
    assert not possible(problem.replace(move=problem.move.model_copy(update={"time": least * 0.999})))


def test_farthest(impossible: tuple[Problem, trajopt.Solution]) -> None:
    problem, solution = impossible
    low, high = solution.explanation["reachable"]
    target = float(problem.move.end.position)  # type: ignore[arg-type]
    edge = high if target > 0 else low

    def to(position: float) -> Problem:
        end = problem.move.end.model_copy(update={"position": position})
        return problem.replace(move=problem.move.model_copy(update={"end": end}))

    assert possible(to(edge))
    assert not possible(to(edge * 1.001))


def test_each_limit_alone(impossible: tuple[Problem, trajopt.Solution]) -> None:
    problem, solution = impossible
    cures = solution.explanation["limits"]
    assert set(cures)
    for name, cure in cures.items():
        if cure["value"] is None:
            assert not possible(problem.with_limit(name, 1e3 * cure["now"] if cure["now"] else -1e3))
            continue
        assert possible(problem.with_limit(name, cure["value"])), name
        less = cure["now"] + (cure["value"] - cure["now"]) * 0.999
        assert not possible(problem.with_limit(name, less)), name


def test_all_limits_together(impossible: tuple[Problem, trajopt.Solution]) -> None:
    problem, solution = impossible

    def scaled(factor: float) -> Problem:
        changed = problem
        for name, limit in problem.limits.given().items():
            for side in ("min", "max"):
                if getattr(limit, side):
                    changed = changed.with_limit(f"{name}.{side}", getattr(limit, side) * factor)
        return changed

    factor = solution.explanation["all_limits_factor"]
    assert possible(scaled(factor))
    assert not possible(scaled(1 + (factor - 1) * 0.999))


def test_conflict_lies_within_the_move(impossible: tuple[Problem, trajopt.Solution]) -> None:
    problem, solution = impossible
    assert solution.explanation["conflict"]
    for where in solution.explanation["conflict"]:
        assert 0 <= where["from"] <= where["to"] <= problem.move.fixed_time  # type: ignore[operator]


@pytest.mark.parametrize(("slowest", "last"), [("-1.2", None), ("0", 1.28344)])
def test_blocked_times_of_moving_ends(slowest: str, last: float | None) -> None:
    """v0 = vf = 1, D = 1, |v| <= 1.2, |a| <= 1, j = 5: possible for T in [0.9, 1.28344] and from 3.11709 on; without
    going backwards only in the first (computed independently)."""
    problem = clemen_rupp(
        'move={time="2 s", start={velocity="1 m/s"}, end={position="1 m", velocity="1 m/s"}}',
        f'limits={{velocity=["{slowest} m/s", "1.2 m/s"], acceleration="1 m/s^2", jerk="5 m/s^3"}}',
        "transcription.intervals=200",
    )
    solution = trajopt.solve(problem)
    assert solution.status is Verdict.IMPOSSIBLE
    times = solution.explanation["possible_times"]
    assert times[0] == pytest.approx((0.9, 1.28344), rel=2e-4)
    if last is None:
        assert len(times) == 2 and times[1][1] is None
        assert times[1][0] == pytest.approx(3.11709, rel=2e-4)
    else:
        assert len(times) == 1


def test_words_of_the_reference_case() -> None:
    """The text for t_f = 0.55 s on the Clemen & Rupp axis, as measured independently."""
    text = " ".join(trajopt.solve(clemen_rupp('move.time="0.55 s"')).explanation["text"])
    for words in ("0.71859", "0.6599", "0.19901", "27.6", "no value of velocity.min or acceleration or jerk alone"):
        assert words in text


def test_the_least_time_is_that_of_the_scheme_that_the_objective_asks_for() -> None:
    """Without a jerk limit, minimum jerk has a mesh of constant jerk: its least time is longer than that of constant
    accelerations, and that is the one that helps."""
    problem = axis("jerk", "l2", time=1.0, limits={"velocity": 1.2, "acceleration": 3.0}, intervals=10)
    explanation = trajopt.solve(problem).explanation
    assert explanation["least_time_continuous"] < explanation["least_time"]
    at_least = problem.move.model_copy(update={"time": explanation["least_time"]})
    assert trajopt.solve(problem.replace(move=at_least)).status.solved
