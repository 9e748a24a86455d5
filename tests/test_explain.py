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
        for name, limit in problem.limits.given.items():
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


OFF_THE_ORIGIN = {  # (limit, what it must be), shrunk from random problems
    "a limit of zero, on a second rung": (
        ('move={time="363.63 s", start={acceleration="-1.3077e-4 m/s^2"}, end={position="0 m"}}',
         'limits={velocity=["0 m/s", "0.0832 m/s"]}', "transcription.intervals=16"), "velocity.min"),
    "a position counted from a start that is not zero": (
        ('move={time="347 s", start={position="0.134 mm", velocity="4.8e-8 m/s", acceleration="-2e-10 m/s^2"},'
         ' end={position="0.1354 mm", velocity="-4.4e-8 m/s"}}',
         'limits={position=["0.1338 mm", "0.1354 mm"]}', "transcription.intervals=5"), "position.max"),
}  # fmt: skip


@pytest.mark.parametrize("case", OFF_THE_ORIGIN)
def test_the_least_change_of_a_limit_is_told_in_its_own_unit(case: str) -> None:
    overrides, name = OFF_THE_ORIGIN[case]
    problem = clemen_rupp(*overrides, 'objective={minimize="acceleration", norm="linf"}')
    cure = trajopt.solve(problem).explanation["limits"][name]
    by = cure["value"] - cure["now"]
    assert possible(problem.with_limit(name, cure["now"] + by))
    assert not possible(problem.with_limit(name, cure["now"] + by * 0.99))


def test_a_least_time_far_below_the_scale_of_the_move_is_found() -> None:
    """From 1 m/s to 1.4 m/s over 100 m with 1000 m/s² to speed up with: 0.44 s, where the move would take 83 s."""
    problem = clemen_rupp(
        'move={time="0.1 s", start={velocity="1 m/s"}, end={position="100 m", velocity="1.4 m/s"}}',
        'limits={velocity={min="0 m/s"}, force={max="1e6 N"}}',
        'load={mass="1000 kg", coulomb="1 N"}',
        'objective={minimize="force", norm="linf"}',
        "transcription.intervals=20",
    )
    least = trajopt.solve(problem).explanation["least_time"]
    assert not possible(problem.replace(move=problem.move.model_copy(update={"time": least * 0.999})))
    assert possible(problem.replace(move=problem.move.model_copy(update={"time": least})))


def test_a_cure_that_leads_to_no_move_is_not_offered() -> None:
    """Widened, the velocity limit would let the axis turn back against a friction that no force here overcomes."""
    problem = clemen_rupp(
        'move={time="0.1668 s", start={velocity="-0.124 m/s"}, end={position="0 m", velocity="-0.034 m/s"}}',
        'limits={acceleration=["-15.7 m/s^2", "23.1 m/s^2"], force="365 N", velocity=["-1e3 m/s", "0 m/s"]}',
        'load={mass="25.5 kg", coulomb="66.8 N"}',
        'objective={minimize="power", norm="l1"}',
        "transcription.intervals=16",
    )
    solution = trajopt.solve(problem)
    assert solution.status is Verdict.IMPOSSIBLE
    cure = solution.explanation["limits"]["velocity.max"]
    assert cure["value"] is None and not cure["never"]
    assert not any("alone is enough" in line for line in solution.explanation["text"] if not line.startswith("no "))
