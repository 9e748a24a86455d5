"""Pareto fronts: known within the asked error, which nothing that we can find contradicts; as files, checked again."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved, table_i, term
from tests.test_cli import TABLE_I, run
from trajopt.fronts import geometry
from trajopt.fronts.blends import blend
from trajopt.fronts.geometry import Outside
from trajopt.fronts.output import FORMAT
from trajopt.fronts.plot import plot_front
from trajopt.fronts.scalarise import Answer, Plane
from trajopt.fronts.search import halvings
from trajopt.fronts.tracing import prepare
from trajopt.workers import Here

EXACT_FRONT = {.83: 5.307679, .91: 2.984933, 1.15: 1.903022, 1.55: 1.683335}  # J: W, computed independently
CONTINUOUS_FRONT = {.82: 6.218145347, .90: 3.111852280, 1.00: 2.305870291, 1.20: 1.836031137, 1.50: 1.687165811}
SMALL = table_i("energy", intervals=40)
QUICK = axis("jerk", "l2", limits={"velocity": (0.0, 2.0), "jerk": 200.0}, intervals=30)


@pytest.fixture(scope="module")
def table_i_front() -> trajopt.Front:
    return trajopt.pareto(table_i("energy"), "energy,peak_power", error=0.005)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("front")
    trajopt.pareto(SMALL, "energy,peak_power", error=0.03).save(folder)
    return folder


def test_table_i_is_known_within_half_a_per_cent_by_twenty_solves(table_i_front: trajopt.Front) -> None:
    front = table_i_front
    assert front.status is trajopt.Verdict.SOLVED and front.error is not None
    assert front.error <= 0.005 and front.solves <= 20 and not front.convex
    assert all(point.status.solved and point.solution.audit["passed"] for point in front.points)
    least, gentlest = front.points[front.anchors[0]], front.points[front.anchors[1]]
    assert least.values == pytest.approx((0.811147924, 4.8614 * 1.681929422), rel=1e-4)
    assert gentlest.values == pytest.approx((1.9609 * 0.811147924, 1.68200675), rel=1e-4)
    assert front.knee not in (None, *front.anchors) and 0.89 < front.hypervolume < 0.92


def test_the_continuous_front_lies_within_the_certified_band(table_i_front: trajopt.Front) -> None:
    front = table_i_front
    reference = np.array(list(CONTINUOUS_FRONT.items()))
    size = np.array(front.nadir) - np.array(front.ideal)
    for values in reference:
        behind = np.min(np.max((front.values - values) / size, axis=1))  # of the points alone, without blends
        assert behind <= 0.08
        for plane in front.planes:
            assert np.dot(plane.weights, values) >= plane.value * (1 - 1e-3)  # the mesh costs less than that
    assert front.distance(reference) <= 0.02


def test_epsilon_points_are_those_of_the_reference() -> None:
    problem = table_i("power", "linf")
    for energy, power in list(EXACT_FRONT.items())[::2]:
        ceiling = trajopt.Ceiling(of="energy", at_most=energy)
        objective = trajopt.Objective(terms=problem.objective.terms, ceilings=(ceiling,))
        solution = solved(problem.replace(objective=objective))
        assert solution.objective == pytest.approx(power, rel=1e-6)
        assert solution.metrics["energy"] <= energy * (1 + 1e-6)
        price = next(row for row in solution.prices if row["name"] == "energy.at_most")
        assert price["per_unit"] < 0 and price["unit"] == "J"


def test_prices_are_the_slope_of_the_front(table_i_front: trajopt.Front) -> None:
    front = table_i_front
    for before, point, after in zip(front.points, front.points[1:], front.points[2:], strict=False):
        (price,) = point.prices
        assert price is not None
        left, right = (
            -(b.values[1] - a.values[1]) / (b.values[0] - a.values[0]) for a, b in ((before, point), (point, after))
        )
        assert right * 0.98 <= price <= left * 1.02


def test_a_ceiling_that_cannot_be_kept_is_named() -> None:
    problem = table_i("power", "linf", intervals=40)
    ceiling = trajopt.Ceiling(of="energy", at_most=0.8)
    objective = trajopt.Objective(terms=problem.objective.terms, ceilings=(ceiling,))
    solution = trajopt.solve(problem.replace(objective=objective))
    assert solution.status is trajopt.Verdict.IMPOSSIBLE_ON_GRID
    assert "energy at most 0.8" in solution.message and solution.objective is None


def test_ceilings_hold_convex_norms_and_the_checker_sees_one_broken() -> None:
    free = solved(QUICK)
    peak = 0.9 * free.metrics["peak_velocity"]
    ceiling = trajopt.Ceiling(of="velocity", norm="linf", at_most=peak)
    solution = solved(QUICK.replace(objective=trajopt.Objective(terms=QUICK.objective.terms, ceilings=(ceiling,))))
    assert solution.status is trajopt.Verdict.SOLVED and solution.objective > free.objective
    assert np.max(solution.frame["velocity"]) <= peak * (1 + 1e-6)
    result = json.loads(json.dumps(solution.to_dict()))
    assert trajopt.check(result).passed
    result["problem"]["objective"]["ceilings"][0]["at_most"] = 0.99 * peak
    assert any("ceiling velocity" in str(check) for check in trajopt.check(result).failed)


def test_no_weighted_sum_is_better_than_a_convex_front_says() -> None:
    front = trajopt.pareto(QUICK, ["peak velocity", "jerk_l2"], error=0.02)
    assert front.status is trajopt.Verdict.SOLVED and front.convex and front.error is not None
    size = np.array(front.nadir) - np.array(front.ideal)
    for share in (0.13, 0.5, 0.87):
        weights = np.array([share, 1 - share]) / size
        terms = [term("velocity", "linf", weights[0]), term("jerk", "l2", weights[1])]
        best = solved(QUICK.replace(objective=trajopt.Objective(terms=tuple(terms)))).objective
        assert best is not None and np.min(front.values @ weights) <= best + front.error + 1e-9
        assert all(np.dot(plane.weights, front.values.T).min() >= plane.value * (1 - 1e-9) for plane in front.planes)


def test_three_objectives(tmp_path: Path) -> None:
    front = trajopt.pareto(QUICK, "peak_velocity,rms_jerk,peak_acceleration", error=0.1)
    assert front.status is trajopt.Verdict.SOLVED and front.values.shape[1] == 3 and front.error <= 0.1  # type: ignore[operator]
    assert len(set(front.anchors)) == 3
    front.save(tmp_path)
    assert (report := trajopt.check_file(tmp_path / "front.json")).passed, report.summary()
    assert plot_front(front).figure.axes[0].get_xlabel().startswith("peak velocity")


def test_time_against_energy_never_rises(tmp_path: Path) -> None:
    front = trajopt.pareto(SMALL, "time,energy", points=5)
    assert front.status is trajopt.Verdict.SOLVED and len(front.points) == 5 and front.error is not None
    assert np.all(np.diff(front.values[:, 0]) > 0) and np.all(np.diff(front.values[:, 1]) < 0)
    least = solved(SMALL.replace(move=SMALL.move.model_copy(update={"time": "free"}),
                                 objective=trajopt.Objective(terms=(term("time"),))))  # fmt: skip
    assert front.values[0, 0] == pytest.approx(least.duration, rel=1e-9) and front.values[-1, 0] == 1.0
    front.save(tmp_path)
    assert (report := trajopt.check_file(tmp_path / "front.json")).passed, report.summary()
    exact = 10 * np.square(front.points[2].solution.metrics["peak_velocity"])
    assert front.values[2, 1] == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("mended", [True, False])
def test_a_cost_that_rises_with_time_is_solved_again_or_flagged(mended: bool) -> None:
    class Liar(Here):
        """Claims too much energy for the middle time, by one solver or by all."""

        def run(self, work: Any, jobs: Any) -> Any:
            for k, found in super().run(work, jobs):
                again = found.task.problem.transcription.solver == "ipopt"
                wrong = found.task.kind == "time" and not (again and mended)
                yield k, replace(found, values=(found.values[0], 5.0)) if wrong else found

    coarse = table_i("energy", intervals=20)
    front = prepare(coarse, "time,energy", points=3)(Liar(), lambda *_: None).run()
    if mended:
        assert front.status is trajopt.Verdict.SOLVED and len(front.points) == 3
        assert front.points[1].solution.route.solver == "ipopt"
    else:
        assert front.status is trajopt.Verdict.UNDECIDED and len(front.points) == 2
        assert "a faster move" in front.message and front.unsolved[0].objective is None


def test_workers_change_nothing() -> None:
    here, apart = (trajopt.pareto(QUICK, "peak_velocity,jerk_l2", error=0.1, workers=k) for k in (1, 2))
    assert np.array_equal(here.values, apart.values) and here.planes == apart.planes and here.error == apart.error


def test_blends_keep_limits_and_ends() -> None:
    problem = SMALL.replace(objective=trajopt.Objective(terms=(term("energy"), term("power", "linf", 0.1))))
    first, second = (solved(x).trajectory for x in (SMALL, problem))
    assert first is not None and second is not None
    mixed = blend(first, second, 0.3)
    assert mixed.chain[0][-1] == pytest.approx(0.254, rel=1e-12)
    result = solved(problem).to_dict()
    value = mixed.measure(problem.objective)
    result |= {"trajectory": mixed.to_dict(), "objective": value, "metrics": {}, "certificate": None}
    assert trajopt.check(result).passed


def test_bounds_that_are_missing_are_not_made_up() -> None:
    problem = table_i("energy", intervals=20, scheme="euler")
    front = trajopt.pareto(problem, "energy,peak_power", error=0.3)
    assert front.status is trajopt.Verdict.UNDECIDED and front.error is None
    assert "no lower bound" in front.message and len(front.points) == 2


class Sphere(Here):
    """Answers every weighted sum over the ball around (1, …, 1), whose front is an eighth of a sphere."""

    def __init__(self) -> None:
        self.still = solved(QUICK)

    def run(self, work: Any, jobs: Any) -> Any:
        for k, task in enumerate(jobs):
            size = len(task.terms)
            weights = np.array(task.weights) if task.weights else np.eye(size)[task.minimized]
            length = float(np.linalg.norm(weights))
            plane = Plane(tuple(weights), float(np.sum(weights)) - length)
            yield k, Answer(task, self.still, tuple(1 - weights / length), (plane,), weights=tuple(weights))


@pytest.mark.parametrize(("size", "error", "most"), [(2, 0.005, 17), (3, 0.05, 40)])
def test_the_search_on_a_sphere_certifies_no_less_than_its_error(size: int, error: float, most: int) -> None:
    names = ["peak_velocity", "jerk_l2", "peak_acceleration"][:size]
    front = prepare(QUICK, names, error=error)(Sphere(), lambda *_: None).run()
    assert front.status is trajopt.Verdict.SOLVED and front.solves <= most and front.error <= error
    rays = np.abs(np.random.default_rng(1).normal(size=(300, size)))
    best = 1 - rays / np.linalg.norm(rays, axis=1)[:, None]  # on the true front
    behind = [geometry.below_hull(front.values, place).error for place in best]
    assert max(behind) <= front.error + 1e-9 and max(behind) > front.error / 20


class TestGeometry:
    """The front f2 = (1 - sqrt f1)², of which the tangents are known."""

    x = np.linspace(0.0, 1.0, 9)
    points = np.column_stack([x, (1 - np.sqrt(x)) ** 2])

    def outside(self, at: Any) -> Outside:
        at = np.asarray(at, dtype=float)
        rows = np.column_stack([1 / np.sqrt(at) - 1, np.ones(len(at))])
        values = rows[:, 0] * at + (1 - np.sqrt(at)) ** 2
        rows, values = np.vstack([rows, np.eye(2)]), np.append(values, [0.0, 0.0])
        total = rows.sum(axis=1)
        return Outside(rows / total[:, None], values / total, np.empty((0, 2)))

    def truth(self, outside: Outside) -> float:
        """The error, by brute force: how far each place that no bound excludes is from the hull."""
        grid = np.linspace(-0.05, 1.05, 221)
        places = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        places = places[np.all(places @ outside.weights.T >= outside.values, axis=1)]
        hull = np.column_stack([grid, np.interp(grid, *self.points.T)])[(grid >= 0) & (grid <= 1)]
        return max(float(np.min(np.max(hull - place, axis=1))) for place in places)

    def test_hull(self) -> None:
        outside = self.outside([0.05, 0.3, 0.6])
        gaps = geometry.hull_gaps(self.points, outside)
        assert gaps[0].error == pytest.approx(self.truth(outside), abs=6e-3)
        assert np.all(gaps[0].weights >= 0) and np.sum(gaps[0].weights) == pytest.approx(1.0)

    def test_staircase_of_blends_comes_near_the_hull(self) -> None:
        outside = self.outside([0.05, 0.3, 0.6])
        hull = geometry.hull_gaps(self.points, outside)[0].error
        shares = np.linspace(0, 1, 300)[1:-1, None]
        between = [(1 - shares) * p + shares * q for p, q in zip(self.points, self.points[1:], strict=False)]
        found = geometry.staircase_gaps(self.points, between, outside)[0].error
        alone = geometry.staircase_gaps(self.points, [np.empty((0, 2))] * 8, outside)[0].error
        assert hull <= found <= hull + 2e-3 < alone

    def test_points_alone_agree_in_both_forms(self) -> None:
        outside = self.outside([0.1, 0.5])
        alone = geometry.staircase_gaps(self.points, [np.empty((0, 2))] * 8, outside)[0].error
        assert geometry.point_gaps(self.points, outside)[0].error == pytest.approx(alone, rel=1e-12)

    def test_a_corner_excludes_what_it_says(self) -> None:
        nothing = Outside(np.empty((0, 2)), np.empty(0), np.array([[0.5, 0.2]]))
        assert nothing.depth(np.array([0.6, 0.25])) == pytest.approx(0.1)
        half = Outside(np.empty((0, 2)), np.empty(0), np.array([[np.inf, 0.2]]))
        assert half.depth(np.array([np.inf, 0.25])) == pytest.approx(0.05)

    @pytest.mark.parametrize("seed", range(5))
    def test_upper_bounds_by_brute_force(self, seed: int) -> None:
        points = np.random.default_rng(seed).integers(0, 6, (7, 3)).astype(float)
        bounds = geometry.upper_bounds(points)
        places = np.random.default_rng(seed + 100).uniform(-1, 7, (400, 3))
        free = ~np.any(np.all(points[None] <= places[:, None], axis=2), axis=1)
        assert np.array_equal(free, np.any(np.all(places[:, None] < bounds[None], axis=2), axis=1))


def test_a_written_front_is_checked_again(written: Path) -> None:
    assert {path.name for path in written.iterdir()} == {"front.json", "front.csv", "front.png", "points"}
    assert len(list(written.glob("points/*/trajectory.csv"))) == len(list(written.glob("points/*/result.json"))) > 3
    assert (written / "front.csv").read_text().startswith("energy [J],peak_power [W],")
    report = trajopt.check_file(written / "front.json")
    assert report.passed, report.summary()
    assert {"error", "points above the half-planes", "bounds", "values energy"} <= {x.name for x in report.checks}


def _tighter(data: dict[str, Any]) -> None:
    data["error"] *= 0.9


def _moved(data: dict[str, Any]) -> None:
    data["points"][1]["values"][0] *= 1 - 1e-4


def _raised(data: dict[str, Any]) -> None:
    data["planes"][2]["value"] *= 1.01


def _outside(data: dict[str, Any]) -> None:
    data["points"][0]["result"] = "points/../../result.json"


def _uncertified(data: dict[str, Any]) -> None:
    data["error"] = None


def _fewer_blends(data: dict[str, Any]) -> None:
    data["blends"] = [1] * len(data["blends"])


def _one_number(data: dict[str, Any]) -> None:
    data["blends"] = 64


def _missing_blends(data: dict[str, Any]) -> None:
    del data["blends"][0]


@pytest.mark.parametrize(
    ("edit", "word"),
    [(_tighter, "error"), (_moved, "values energy"), (_raised, "bounds"), (_outside, "structure"),
     (_uncertified, "error"), (_fewer_blends, "error"),
     (_one_number, "structure"), (_missing_blends, "structure")],
)  # fmt: skip
def test_a_front_that_claims_more_is_caught(written: Path, tmp_path: Path, edit: Any, word: str) -> None:
    shutil.copytree(written, tmp_path / "front")
    path = tmp_path / "front" / "front.json"
    data = json.loads(path.read_text())
    edit(data)
    path.write_text(json.dumps(data))
    names = {check.name for check in trajopt.check_file(path).failed}
    assert {"seal", word} <= names


@pytest.fixture
def move(tmp_path: Path) -> Path:
    path = tmp_path / "move.toml"
    path.write_text(TABLE_I)
    return path


def test_the_command(move: Path, tmp_path: Path) -> None:
    words = ["pareto", move, "--objectives", "energy,peak_power", "--error", "10%"]
    done = run(*words, "-o", tmp_path / "out", "--explore", "--json")
    page = (tmp_path / "out" / "front.html").read_text()
    assert "plotly_click" in page and "of energy saves" in page
    assert "give --output" in run(*words, "--explore").stderr
    front = json.loads(done.stdout)
    assert done.returncode == 0 and front["format"] == FORMAT and front["status"] == "SOLVED"
    assert front["error"] <= 0.1 == front["asked"] and done.stderr == ""
    assert run("check", tmp_path / "out" / "front.json").returncode == 0
    people = run("pareto", move, "--objectives", "energy,peak_power", "--points", "3", "--method", "epsilon")
    assert people.returncode == 0
    for word in ("energy [J]", "peak power [W]", "least energy", "known within", "hypervolume"):
        assert word in people.stdout


def test_an_interrupt_keeps_what_is_finished(move: Path, tmp_path: Path) -> None:
    words = ["pareto", str(move), "--objectives", "energy,peak_power", "--error", "0.01%", "-o", str(tmp_path / "out")]
    child = subprocess.Popen(
        [sys.executable, "-c", "from trajopt.cli import main; main()", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    time.sleep(4)
    child.send_signal(signal.SIGINT)
    _, error = child.communicate(timeout=30)
    assert child.returncode == 130 and error.strip() == "trajopt: stopped by the user"
    front = json.loads((tmp_path / "out" / "front.json").read_text())
    assert front["status"] == "INTERRUPTED" and front["solves"] >= 2
    assert trajopt.check_file(tmp_path / "out" / "front.json").passed


BAD: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"objectives": "energy,peek_power"}, ("peek_power", "did you mean 'peak_power'")),
    ({"objectives": "energy"}, ("two or three", "got 1")),
    ({"objectives": "energy,power"}, ("'power'", "did you mean")),
    ({"objectives": "energy,energy"}, ("twice",)),
    ({"objectives": "energy,peak_power,jerk_l2,time"}, ("two or three", "got 4")),
    ({"points": 1}, ("points", "2 to")),
    ({"points": 2.5}, ("points", "2 to")),
    ({"points": 10, "error": 0.01}, ("either points or error",)),
    ({"error": 0.0}, ("error", "0.001 % to 50 %")),
    ({"error": 2.0}, ("error", "0.001 % to 50 %")),
    ({"error": float("nan")}, ("error", "0.001 % to 50 %")),
    ({"method": "epsilom"}, ("epsilom", "did you mean 'epsilon'")),
    ({"method": "epsilon", "objectives": "energy,peak_power,jerk_l2"}, ("two objectives",)),
    ({"objectives": "time,energy", "method": "epsilon"}, ("time by time",)),
    ({"objectives": "energy,copper_loss"}, ("torque_constant", "missing")),
]


@pytest.mark.parametrize(("asked", "words"), BAD)
def test_bad_requests_are_refused_in_one_line(asked: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(trajopt.BadInput) as refused:
        prepare(SMALL, **{"objectives": "energy,peak_power", **asked})
    assert all(word in str(refused.value) for word in words) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("words", "message"),
    [(("--error", "half"), "0.5%"), (("--workers", "0"), "workers"), (("--points", "1"), "2 to 200"),
     (("--set", 'move.time="free"', "--set", "objective.minimize=time"), "move.time")],
)  # fmt: skip
def test_bad_options_exit_2(move: Path, words: tuple[str, ...], message: str) -> None:
    done = run("pareto", move, "--objectives", "energy,peak_power", *words)
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1 and message in done.stderr


CEILINGS = [
    ('{ of = "energy", at_most = "0.9 W" }', ("objective.ceilings[0].at_most", "energy", "1 J")),
    ('{ of = "energy", at_most = "0 J" }', ("at_most", "> 0")),
    ('{ of = "energie", at_most = "1 J" }', ("objective.ceilings[0].of", "did you mean 'energy'")),
    ('{ of = "time", at_most = "1 s" }', ("of", "move.time")),
    ('{ of = "power", at_most = "1 W" }', ("norm", "is missing")),
    ('{ of = "energy" }', ("objective.ceilings[0].at_most", "is missing")),
    ('{ off = "energy", at_most = "1 J" }', ("objective.ceilings[0].off", "did you mean 'of'")),
    ('"energy"', ("objective.ceilings[0]", "of, norm, at_most")),
    ('{ of = "position", norm = "l1", at_most = "1 m" }', ("no unit in files",)),
]


@pytest.mark.parametrize(("ceiling", "words"), CEILINGS)
def test_bad_ceilings_are_refused_in_one_line(ceiling: str, words: tuple[str, ...]) -> None:
    from trajopt.problem_file import parse

    with pytest.raises(trajopt.BadInput) as refused:
        parse(TABLE_I.replace('norm     = "l2"', f'norm = "l2"\nceilings = [{ceiling}]'))
    assert all(word in str(refused.value) for word in words)


@pytest.mark.parametrize("count", [0, 1, 2, 9, 49])
def test_halvings_reach_every_place_once_and_neighbours_come_first(count: int) -> None:
    known, widest = [0.0, 1.0], count + 1
    for shares in halvings(count):
        known = sorted([*known, *shares])
        widest = (widest + 1) // 2
        assert max(np.diff(known)) * (count + 1) == pytest.approx(widest)
    assert known == pytest.approx(np.linspace(0, 1, count + 2), abs=1e-15)
