"""Chebyshev profiles: the rows of the reference, bounds by linear programs, the comparison with the best move known."""

from __future__ import annotations

import copy
import json
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.optimize import linprog

import trajopt
from problems import slider_crank
from tests.test_cli import run
from tests.test_mechanism import crank
from trajopt import checker
from trajopt.profiles import Profiles, compare_profiles
from trajopt.profiles.chebyshev import Family, bound, search, search_box
from trajopt.profiles.laws import Laid, trapezoid

ROWS = {  # N m RMS, of the reference
    ("poly5", 5, "JF"): 20.633836, ("cheb7", 7, "JF"): 11.270833, ("cheb9", 9, "JF"): 10.017414,
    ("poly7J0", 7, "J0"): 26.222118, ("cheb9J0", 9, "J0"): 13.292360,
}  # fmt: skip


@pytest.mark.parametrize(("name", "degree", "ends"), ROWS)
def test_the_rows_of_the_reference(name: str, degree: int, ends: Any) -> None:
    problem, family = crank(), Family(degree, ends)
    free = search(problem, family)
    assert family.name == name
    assert Laid(problem, family.law(free)).measure() == pytest.approx(ROWS[name, degree, ends], rel=1e-6)
    if name == "cheb7":
        np.testing.assert_allclose(free, [0.001742, 0.011397], atol=6e-7)
    if degree < 9:
        box = search_box(problem, family)
        assert Laid(problem, family.law(box)).measure() == pytest.approx(ROWS[name, degree, ends], rel=1e-6)


def test_the_trapezoid_of_the_reference() -> None:
    assert Laid(crank(), trapezoid()).measure() == pytest.approx(15.315633, rel=1e-6)


def test_more_degrees_come_closer_and_none_below_the_free_profile() -> None:
    costs = [Laid(crank(), Family(n).law(search(crank(), Family(n)))).measure() for n in (7, 9, 11, 13)]
    assert costs == sorted(costs, reverse=True) and costs[-1] > 9.593082


@pytest.mark.parametrize(("degree", "ends", "derivatives"), [(7, "JF", 2), (9, "JF", 2), (9, "J0", 3), (13, "J0", 3)])
def test_the_end_conditions_hold_for_any_free_coefficients(degree: int, ends: Any, derivatives: int) -> None:
    family = Family(degree, ends)
    law = family.law(np.random.default_rng(0).uniform(-0.01, 0.01, family.free))
    ends_at = np.array([0.0, 1.0])
    np.testing.assert_allclose(law.at(ends_at), [-1, 1], atol=1e-13)
    for i in range(1, derivatives + 1):
        np.testing.assert_allclose(law.at(ends_at, i), 0.0, atol=1e-9)


@pytest.mark.parametrize("degree", [7, 9])
def test_bounds_by_linear_programs(degree: int) -> None:
    """The largest p_k of any polynomial within -1 to 1 on a fine grid; and of those that never go back."""
    x = np.cos(np.linspace(0.0, pi, 600))
    table = chebyshev.chebvander(x, degree)
    slopes = chebyshev.chebvander(x, degree - 1) @ chebyshev.chebder(np.eye(degree + 1))
    largest = []
    for k in range(degree + 1):
        aim = -np.eye(degree + 1)[k]
        within = linprog(aim, np.vstack([table, -table]), np.ones(2 * len(x)), bounds=(None, None))
        largest.append(-within.fun)
        assert largest[k] <= bound(k, degree) * (1 + 1e-4)
        if k:
            ends = np.vstack([np.ones(degree + 1), (-1.0) ** np.arange(degree + 1)])
            one_way = linprog(aim, -slopes, np.full(len(x), 1e-9), A_eq=ends, b_eq=[1, -1], bounds=(None, None))
            assert -one_way.fun <= bound(k, degree, monotone=True) * (1 + 1e-4)
    for k in range(degree + 1):
        if 3 * k > degree or k == 0:
            assert largest[k] == pytest.approx(1.0, rel=1e-4)  # and T_k itself reaches it
    assert 1.01 < largest[1] < 4 / pi


@pytest.fixture(scope="session")
def profiles() -> Profiles:
    problem = trajopt.load("slider_crank", ["limits.torque=20 N m"])
    assert isinstance(problem, trajopt.Problem)
    return compare_profiles(problem, [7, 9])


def test_how_far_from_the_best_possible(profiles: Profiles) -> None:
    text = "\n".join(profiles.sentences())
    assert "cheb9 10.0174145: 4.42 % above the best known" in text
    assert "3 starts, of which 3 agree; no bound is known" in text
    assert [row.law.name for row in profiles.rows] == ["trapezoid 1/3", "poly5", "poly7J0", "cheb7", "cheb9"]
    assert {row.law.name: row.breaks for row in profiles.rows}["poly5"] == ("force",)
    assert all((profiles.above(row) or -1) > 0 for row in profiles.rows)


def test_the_file_of_profiles_is_checked(profiles: Profiles, tmp_path: Path) -> None:
    written = profiles.save(tmp_path)
    assert all(path.exists() for path in written) and (tmp_path / "cheb9.csv").read_text().count("\n") == 1003
    assert checker.check_file(tmp_path / "profiles.json").passed
    data = json.loads((tmp_path / "profiles.json").read_text())
    for edit, word in (
        (lambda law: law.update(objective=law["objective"] * (1 - 2e-6)), "objective"),
        (lambda law: law["pieces"][0]["coefficients"].__setitem__(1, 0.9), "start"),
        (lambda law: law.update(breaks=["force"]), "limits"),
        (lambda law: law.update(above=0.01), "above"),
    ):
        wrong = copy.deepcopy(data)
        edit(wrong["laws"][-1])
        report = checker.check(wrong)
        assert not report.passed and any(word in check.name for check in report.failed)


def test_other_objectives_have_their_own_best_profile() -> None:
    problem, family = crank("force", "linf"), Family(7)
    found = Laid(problem, family.law(search(problem, family))).measure()
    assert found < Laid(problem, family.law(search(crank(), family))).measure()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda: Family(4), ("degree", "5 to 30")),
        (lambda: Family(6, "J0"), ("degree", "7 to 30", "J0")),
        (lambda: Family(31), ("degree", "5 to 30")),
        (lambda: Family(9, "XX"), ("ends", "JF", "J0")),  # type: ignore[arg-type]
        (lambda: compare_profiles(crank(time=(0.05, 0.1), force=30.0), [9]), ("move.time", "fixed")),
        (lambda: compare_profiles(crank("position", "l2"), [9]), ("objective.minimize",)),
        (lambda: compare_profiles(crank("jerk", "l2", load=trajopt.Load()), [9]), ("load.inertia",)),
    ],
)  # fmt: skip
def test_what_no_profile_fits_is_refused(change: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(trajopt.BadInput) as refused:
        change()
    assert all(word in str(refused.value) for word in words), str(refused.value)
    assert slider_crank.TURN > 3


def test_the_command_says_how_far_from_the_best_and_writes_what_can_be_checked(tmp_path: Path) -> None:
    coarse = ("--set", "transcription.intervals=20")
    done = run("profiles", "slider_crank", "--degree", "7", *coarse, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "cheb7 11.2708331: 17.5 % above the best known" in done.stdout
    assert run("check", tmp_path / "out" / "profiles.json").returncode == 0
    assert checker.check_file(tmp_path / "out" / "best" / "result.json").passed
    refused = run("profiles", "slider_crank", "--degree", "4")
    assert refused.returncode == 2 and "degree: 4" in refused.stderr and refused.stderr.count("\n") == 1
