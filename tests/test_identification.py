"""Identification: three motions give the load back, one smooth fit does better, friction with its standard error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trajopt
from problems import slider_crank
from tests.test_cli import run
from trajopt.identification import friction_of, identify, joint, pointwise
from trajopt.identification.motions import Motion

STROKE = np.deg2rad(175.0)
AT = np.linspace(*np.deg2rad([1.0, 174.0]), 300)
TRUTH = (slider_crank.load_torque, slider_crank.inertia_slope, slider_crank.inertia)


def torque(q: Any, v: Any, a: Any) -> Any:
    return slider_crank.load_torque(q) + slider_crank.inertia_slope(q) * v**2 / 2 + slider_crank.inertia(q) * a


def three(noise: float = 0.0, seed: int = 0, count: int = 1500) -> list[Motion]:
    """A quasi-static motion, one of constant speed, one of constant acceleration."""
    rng, found = np.random.default_rng(seed), []
    for name, speed, rate in (("slow", 0.01, 0.0), ("steady", 20.0, 0.0), ("speeding up", 2.0, 300.0)):
        duration = (np.sqrt(speed**2 + 2 * rate * STROKE) - speed) / rate if rate else STROKE / speed
        t = np.linspace(0.0, duration, count)
        q, v = speed * t + rate * t**2 / 2, speed + rate * t
        force = torque(q, v, np.full(count, rate)) + noise * rng.standard_normal(count)
        found.append(Motion.of(t, q, force, name=name))
    return found


def errors(found: Any) -> Any:
    return np.array([np.sqrt(np.mean((x - truth(AT)) ** 2)) for x, truth in zip(found, TRUTH, strict=True)])


def fitted(motions: list[Motion]) -> Any:
    curves = joint(motions).load.curves
    return curves["force"].at(AT), curves["inertia"].at(AT, 1), curves["inertia"].at(AT)


def test_three_motions_give_the_load_back() -> None:
    sizes = np.array([np.max(np.abs(truth(AT))) for truth in TRUTH])
    assert np.max(errors(pointwise(three(), AT)) / sizes) < 1e-8
    assert np.max(errors(fitted(three())) / sizes) < 1e-8


@pytest.mark.parametrize("seed", range(3))
def test_one_smooth_fit_of_all_samples_does_better(seed: int) -> None:
    """In inertia at least fifty times, at 20,000 samples a motion; in its slope and the load more than twenty times."""
    motions = three(0.05, seed, 20_000)
    better = errors(pointwise(motions, AT)) / errors(fitted(motions))
    assert better[2] > 50 and np.min(better) > 20


def test_friction_of_a_noisy_measurement() -> None:
    """Mean and spread over 200 seeds as in the reference: μ = .025, .02499 ± .00015."""
    count = round(slider_crank.DURATION * 20_000) + 1
    t = np.arange(count) / 20_000
    x, load = t / slider_crank.DURATION, slider_crank.load()
    q = slider_crank.TURN * x**3 * (10 - 15 * x + 6 * x**2)
    v = slider_crank.TURN / slider_crank.DURATION * 30 * x**2 * (1 - x) ** 2
    a = slider_crank.TURN / slider_crank.DURATION**2 * 60 * x * (1 - x) * (1 - 2 * x)
    clean, found = torque(q, v, a) + 0.025 * v, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noisy = q + 2e-4 * rng.standard_normal(count), clean + 0.3 * rng.standard_normal(count)
        found.append(friction_of(load, Motion.of(t, *noisy)))
    viscous = np.array([friction.viscous for friction in found])
    assert np.mean(viscous) == pytest.approx(0.02499, abs=1.5e-5)
    assert np.std(viscous, ddof=1) == pytest.approx(0.00015, abs=1e-5)
    assert np.mean([friction.error for friction in found]) == pytest.approx(np.std(viscous), rel=0.1)
    assert {friction.degree for friction in found} == {5}
    exact = friction_of(load, Motion.of(t, q, clean))
    assert exact.viscous == pytest.approx(0.025, abs=1e-9) and exact.error < 1e-9


def written(folder: Path, motions: list[Motion], header: str = "t [s],theta [deg],T [N m]") -> list[Path]:
    paths = []
    for motion in motions:
        path = folder / f"{motion.name}.csv"
        columns = np.stack([motion.time, np.rad2deg(motion.position), motion.force], axis=1)
        lines = [",".join(f"{x:.17g}" for x in row) for row in columns]
        path.write_text("\n".join([header, *lines]) + "\n")
        paths.append(path)
    return paths


def test_what_is_identified_is_a_load_for_a_problem_file(tmp_path: Path) -> None:
    found = identify(written(tmp_path, three(count=600)), rows=91)
    paths = found.save(tmp_path / "out")
    assert [path.name for path in paths] == ["load.csv", "identification.json", "identification.png"]
    (tmp_path / "out" / "move.toml").write_text(
        '[move]\ntime = "80 ms"\nend = { position = "170 deg" }\n[load]\ninertia = { csv = "load.csv" }\n'
        'torque = { csv = "load.csv" }\n[objective]\nminimize = "force"\nnorm = "l2"\n'
    )
    problem = trajopt.load(tmp_path / "out" / "move.toml")
    assert isinstance(problem, trajopt.Problem) and problem.rotary
    np.testing.assert_allclose(problem.load.curves["inertia"].at(AT), slider_crank.inertia(AT), rtol=1e-6)
    assert "inertia from 0.00274" in found.sentences()[0]


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t [s],theta,T [N m]", ("theta", "does not say its unit", "brackets")),
        ("t [s],theta [degrees],T [N m]", ("unknown unit", "deg")),
        ("t [s],theta [deg],T [N]", ("no column measures a torque", "N m")),
        ("t [s],theta [deg],theta [rad]", ("two columns have the name",)),
        ("t [s],a [deg],b [rad]", ("2 columns measure a position", "column =")),
    ],
)  # fmt: skip
def test_a_motion_that_cannot_be_meant_is_refused(tmp_path: Path, header: str, words: tuple[str, ...]) -> None:
    paths = written(tmp_path, three(count=60), header)
    with pytest.raises(trajopt.BadInput) as refused:
        identify(paths)
    assert all(word in str(refused.value) for word in words), str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("attempt", "words"),
    [
        (lambda: Motion.of([0, 1], [0, 1], [0, 1]), ("too few", "24 or more")),
        (lambda: Motion.of(np.zeros(50), np.zeros(50), np.zeros(50)), ("time must increase",)),
        (lambda: pointwise(three()[:2], AT), ("fewer equations than unknowns", "three")),
        (lambda: pointwise([three()[1]] * 3, AT), ("too alike",)),
        (lambda: pointwise(three(), np.array([4.0])), ("only", "same range")),
        (lambda: joint([three()[0]]), ("do not determine",)),
        (lambda: friction_of(slider_crank.load(high=90.0), three()[1]), ("leaves the table",)),
    ],
)  # fmt: skip
def test_what_determines_nothing_is_refused(attempt: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(trajopt.BadInput) as refused:
        attempt()
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_the_command_writes_a_load_and_says_its_friction(tmp_path: Path) -> None:
    motions = written(tmp_path, three(count=400))
    speed = motions[1].read_text().splitlines()
    rubbing = [",".join([*row.split(",")[:2], f"{float(row.split(',')[2]) + 0.5:.17g}"]) for row in speed[1:]]
    measured = tmp_path / "measured.csv"
    measured.write_text("\n".join([speed[0], *rubbing]) + "\n")
    done = run("identify", *motions, "--friction", measured, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "viscous friction 0.025 " in done.stdout and (tmp_path / "out" / "load.csv").exists()
    refused = run("identify", tmp_path / "none.csv")
    assert refused.returncode == 2 and "cannot be read" in refused.stderr and refused.stderr.count("\n") == 1
