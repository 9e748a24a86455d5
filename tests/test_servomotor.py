"""The servomotor: published energies, both ways to solve, closed forms, limits at their edge, and symmetries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved, term
from trajopt.model_cvxpy import ConvexModel
from trajopt.motor import Intake, implied, power

MOTOR = {  # like an HF-MP43K; the paper prints none
    "inertia": 4.142e-4,
    "viscous": 2e-4,
    "coulomb": 0.02,
    "torque_constant": 0.57,
    "resistance": 3.0,
    "switching": 4.0,
}
IRON = {"eddy": 1e-4, "hysteresis": 5e-3, "hysteresis_exponent": 1.6}
LIMITS: dict[str, Any] = {"velocity": {"min": 0.0}, "acceleration": 1500.0, "jerk": 5e4}
BRISK: dict[str, Any] = {"velocity": (0.0, 90.0), "acceleration": 1500.0}
ENVELOPE = {"speed": [0.0, 40.0, 100.0], "torque": [0.5, 0.5, 0.05]}


def motor(minimize: Any, norm: Any = None, **changes: Any) -> trajopt.Problem:
    """Twenty radians in 0.4 s, one way, with limited jerk."""
    given = {"distance": 20.0, "time": 0.4, "limits": LIMITS, "load": MOTOR, "intervals": 60} | changes
    return axis(minimize, norm, **given)


# --- the reference ---------------------------------------------------------------------------------------------------

REFERENCE = [  # ready-made problem, least energy in continuous time (J), peak speed (rad/s)
    ("servomotor_case_1", 0.2187656327, 20.7507933),
    ("servomotor_case_3", 6.3348573325, 150.0),
    ("servomotor_iron_losses", 0.21921483, None),
]


@pytest.mark.parametrize(("name", "energy", "peak"), REFERENCE)
def test_the_energies_of_the_reference(name: str, energy: float, peak: float | None) -> None:
    solution = solved(trajopt.load(name))
    assert solution.route.model == "cvxpy"
    found = solution.metrics["electrical_energy"]  # exact between the nodes: no move takes less than the optimum
    assert energy * (1 - 2e-8) <= found <= energy * (1 + 5e-4)
    assert solution.objective == pytest.approx(energy, rel=6e-4)  # by trapezoids
    assert solution.certificate["lower_bound"] <= solution.objective
    assert solution.certificate["gap"] <= 2.5e-3
    if peak is not None:
        assert solution.metrics["peak_velocity"] == pytest.approx(peak, rel=2e-4)


@pytest.mark.parametrize(("name", "energy", "peak"), REFERENCE)
def test_ipopt_agrees_on_the_reference(name: str, energy: float, peak: float | None) -> None:
    ours = solved(trajopt.load(name))
    ipopt = solved(trajopt.load(name, ["transcription.solver=ipopt"]))
    assert ours.objective == pytest.approx(ipopt.objective, rel=1e-7)


def test_the_pick_and_place_axis_is_bound_by_heat_and_voltage() -> None:
    solution = solved(trajopt.load("servomotor_pick_and_place"))
    problem, found = solution.problem, solution.metrics
    cycle = found["rms_force"] * math.sqrt(0.25 / (0.25 + problem.move.dwell))
    assert cycle == pytest.approx(2.4, rel=1e-6)
    assert found["peak_voltage"] == pytest.approx(72.0, rel=1e-6)
    assert found["peak_current"] < 13.9
    assert {price["name"] for price in solution.prices[:4]} >= {"rms_force.max", "voltage"}


# --- cones, sequential convex programs and Ipopt ---------------------------------------------------------------------

AGREE: dict[str, dict[str, Any]] = {
    "current-l1": {"minimize": "current", "norm": "l1"},
    "current-l2": {"minimize": "current", "norm": "l2"},
    "voltage-linf": {"minimize": "voltage", "norm": "linf"},
    "copper": {"minimize": "copper_loss"},
    "copper-current-limit": {"minimize": "copper_loss", "limits": {**LIMITS, "current": 0.59}},
    "copper-voltage-limit": {"minimize": "copper_loss", "limits": {**LIMITS, "voltage": 42.0}},
    "envelope": {"minimize": "jerk", "norm": "l2", "limits": {**LIMITS, "envelope": ENVELOPE}},
    "rms": {"minimize": "velocity", "norm": "linf", "limits": {**LIMITS, "rms_force": 0.2}},
    "rms-euler": {"minimize": "velocity", "norm": "linf", "limits": {**LIMITS, "rms_force": 0.2}, "scheme": "euler"},
    "energy": {"minimize": "electrical_energy"},
    "energy-recovery": {"minimize": "electrical_energy", "load": {**MOTOR, "recovery": 0.6}},
    "energy-iron": {"minimize": "electrical_energy", "load": {**MOTOR, **IRON}},
    "energy-voltage-limit": {"minimize": "electrical_energy", "limits": {**LIMITS, "voltage": 39.0}},
    "energy-order-2": {"minimize": "electrical_energy", "limits": {"velocity": {"min": 0.0}, "acceleration": 1500.0}},
    "sum": {"minimize": [term("electrical_energy"), term("copper_loss", weight=3.0), term("jerk", "l2", 1e-6)]},
    "power-l1-order-2": {"minimize": "power", "norm": "l1", "limits": BRISK},
    "power-l2-order-2": {"minimize": "power", "norm": "l2", "limits": BRISK},
}


@pytest.mark.parametrize("case", AGREE)
def test_the_routes_agree(case: str) -> None:
    given = dict(AGREE[case])
    minimize, norm = given.pop("minimize"), given.pop("norm", None)
    ours, ipopt = (solved(motor(minimize, norm, **given, solver=solver)) for solver in ("auto", "ipopt"))
    assert (ours.route.model, ipopt.route.model) == ("cvxpy", "pyomo")
    assert ours.objective == pytest.approx(ipopt.objective, rel=1e-6)
    assert ours.certificate["lower_bound"] <= min(ours.objective, ipopt.objective) * (1 + 1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_the_bound_lies_below_what_ipopt_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time, distance = rng.uniform(0.2, 1.0), rng.uniform(1.0, 40.0)
    load = {**MOTOR, "recovery": float(rng.choice([0.0, 0.5, 1.0])), "coulomb": 0.02 * rng.uniform()}
    load |= {"switching": float(rng.choice([0.0, 4.0])), "resistance": rng.uniform(0.5, 5.0)}
    limits = {"velocity": {"min": 0.0}, "acceleration": distance / time**2 * rng.uniform(6.0, 20.0)}
    limits |= {"jerk": distance / time**3 * rng.uniform(60.0, 600.0)} if seed % 2 else {}
    given = {"distance": distance, "time": time, "load": load, "limits": limits, "intervals": 40}
    ours, ipopt = (solved(motor("electrical_energy", **given, solver=solver)) for solver in ("auto", "ipopt"))
    assert ours.certificate["lower_bound"] <= ipopt.objective * (1 + 1e-8)
    assert ours.objective <= ipopt.objective * (1 + 1e-6)
    assert ours.certificate["gap"] <= 0.05


@pytest.mark.parametrize(("minimize", "norm", "gap"), [("energy", None, 1e-8), ("power", "l2", 3e-3)])
def test_without_a_jerk_limit_power_is_bounded_too(minimize: str, norm: str | None, gap: float) -> None:
    """Energy of a one-way, single-hump move is m v_peak²: least peak velocity, D/T·2/(1 + sqrt(1 - 4 D/(a T²)))."""
    limits = {"velocity": (0.0, 5.0), "acceleration": 6.0}
    solution = solved(axis(minimize, norm, limits=limits, load={"inertia": 3.0}, intervals=60))
    assert solution.route.model == "cvxpy"
    assert solution.certificate["gap"] <= gap
    if minimize == "energy":
        peak = 2 / (1 + math.sqrt(1 - 4 / 6))
        assert solution.objective == pytest.approx(3.0 * peak**2, rel=2e-3)


# --- closed forms ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("intervals", [20, 100])
def test_least_copper_loss_without_friction(intervals: int) -> None:
    """12 R (I/Kt)² D²/T³ for the parabola of velocity; N²/(N² - 1) times that on N intervals of one acceleration."""
    load = {"inertia": 2e-3, "torque_constant": 0.4, "resistance": 1.5}
    solution = solved(axis("copper_loss", distance=5.0, time=0.3, load=load, intervals=intervals))
    least = 12 * 1.5 * (2e-3 / 0.4) ** 2 * 5.0**2 / 0.3**3
    assert solution.status is trajopt.Verdict.SOLVED
    assert solution.objective == pytest.approx(least * intervals**2 / (intervals**2 - 1), rel=1e-9)
    assert solution.metrics["copper_loss"] == pytest.approx(solution.objective, rel=1e-9)


def test_with_full_recovery_energy_is_what_friction_and_losses_take() -> None:
    solution = solved(motor("electrical_energy", load={**MOTOR, "recovery": 1.0}))
    found, trajectory = solution.metrics, solution.trajectory
    fine = np.linspace(0.0, 0.4, 200_001)
    states = trajectory.at(fine)
    force = MOTOR["inertia"] * states["acceleration"] + MOTOR["viscous"] * states["velocity"] + MOTOR["coulomb"]
    switching = MOTOR["switching"] * np.trapezoid(np.abs(force), fine) / MOTOR["torque_constant"]
    friction = MOTOR["coulomb"] * 20.0 + MOTOR["viscous"] * found["rms_velocity"] ** 2 * 0.4
    assert found["electrical_energy"] == pytest.approx(found["copper_loss"] + switching + friction, rel=1e-8)
    drawn = power(solution.problem.load, force, states["velocity"])
    assert found["electrical_energy"] == pytest.approx(np.trapezoid(drawn, fine), rel=1e-8)
    assert found["brake_energy"] == pytest.approx(np.trapezoid(np.maximum(-drawn, 0.0), fine), rel=1e-7)


@pytest.mark.parametrize("exponent", [1.3, 2.0])
@pytest.mark.parametrize("intervals", [4, 41])
def test_energies_between_the_nodes(exponent: float, intervals: int) -> None:
    """Against dense sampling: there and back, with all losses."""
    load = {**MOTOR, **IRON, "hysteresis_exponent": exponent, "recovery": 0.3}
    ends = {"start": {"velocity": 30.0}, "end": {"velocity": -20.0}}
    solution = solved(motor("jerk", "l2", distance=1.0, limits={}, **ends, load=load, intervals=intervals))
    fine = np.linspace(0.0, 0.4, 400_001)
    states = solution.trajectory.at(fine)
    v = states["velocity"]
    force = MOTOR["inertia"] * states["acceleration"] + MOTOR["viscous"] * v + MOTOR["coulomb"] * np.sign(v)
    drawn = power(solution.problem.load, force, v)
    assert np.min(drawn) < 0 < np.max(drawn)
    fed_back = np.trapezoid(np.maximum(-drawn, 0.0), fine)
    assert solution.metrics["brake_energy"] == pytest.approx(fed_back, rel=1e-6)
    counted = np.trapezoid(np.maximum(drawn, 0.0), fine) - 0.3 * fed_back
    assert solution.metrics["electrical_energy"] == pytest.approx(counted, rel=1e-6)
    assert solution.metrics["peak_current"] == pytest.approx(np.max(np.abs(force)) / 0.57, rel=1e-5)
    assert solution.metrics["peak_voltage"] == pytest.approx(np.max(np.abs(3 * force / 0.57 + 0.57 * v)), rel=1e-5)


@pytest.mark.parametrize("limits", [{"acceleration": 800.0}, {"acceleration": 800.0, "jerk": 2e4}], ids=["a", "j"])
@pytest.mark.parametrize(("minimize", "norm"), [("electrical_energy", None), ("copper_loss", None), ("force", "l2")])
def test_friction_turns_with_the_axis(minimize: str, norm: str | None, limits: dict[str, Any]) -> None:
    """There and back: the check knows only the velocity's own sign at every sample."""
    for start, end, distance in ((30.0, -20.0, 1.0), (0.0, 10.0, -3.0)):
        ends = {"start": {"velocity": start}, "end": {"velocity": end}}
        solution = solved(motor(minimize, norm, distance=distance, limits=limits, **ends, intervals=41))
        velocity = solution.trajectory.chain[1]
        assert np.min(velocity) < 0 < np.max(velocity)
        assert solution.certificate["lower_bound"] is None


@pytest.mark.parametrize("minimize", ["electrical_energy", "copper_loss"])
def test_standing_still_takes_nothing(minimize: str) -> None:
    solution = solved(motor(minimize, distance=0.0))
    assert solution.status is trajopt.Verdict.SOLVED and solution.objective == 0.0
    assert solution.metrics["copper_loss"] == solution.metrics["electrical_energy"] == 0.0


def test_coasting_is_not_best_where_braking_earns() -> None:
    """The load grows heavier on the way: braking it gives back more than speeding it up has taken."""
    inertia = {"time": [0.0, 0.2, 0.4], "value": [1e-3, 1e-3, 4e-3]}
    load = {"inertia": inertia, "torque_constant": 0.57, "resistance": 0.1, "recovery": 1.0}
    ends = {"start": {"velocity": 50.0}, "end": {"velocity": 50.0}}
    solution = solved(motor("electrical_energy", limits={"acceleration": 200.0}, load=load, **ends))
    assert solution.objective < -0.1


@pytest.mark.parametrize("recovery", [0.0, 0.3, 1.0])
def test_what_is_drawn_is_lowered_as_it_is_measured(recovery: float) -> None:
    x, weights = np.array([1.0, -2.0, 0.5, -0.1]), np.array([0.1, 0.2, 0.3, 0.4])
    intake, model = Intake(recovery), ConvexModel()
    value = intake.lower(model, x + 0.0 * model.variable(4), weights, 2.0)
    model.minimize(value)
    model.run("clarabel")
    measured = intake.measure(x, weights, 2.0)
    assert measured == pytest.approx(2.0 * (0.25 - recovery * 0.44), rel=1e-12)
    assert model.value(value).item() == pytest.approx(measured, abs=1e-8)
    assert intake.measure(3.0 * x, weights, 2.0) == pytest.approx(3.0 * measured, rel=1e-12)  # scaling relies on it


# --- limits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "limit", "metric"),
    [("current", 0.58, "peak_current"), ("voltage", 42.0, "peak_voltage"), ("brake_energy", 0.6, "brake_energy")],
)
def test_a_limit_is_reached_and_has_its_price(name: str, limit: float, metric: str) -> None:
    free = solved(motor("copper_loss"))
    held, wider = (solved(motor("copper_loss", limits={**LIMITS, name: x})) for x in (limit, limit * 1.001))
    assert free.metrics[metric] > limit and held.objective > free.objective
    assert held.metrics[metric] <= limit * (1 + 1e-7)
    assert held.metrics[metric] >= limit * (1 - 2e-3)
    price = next(price for price in held.prices if price["name"].partition(".")[0] == name)
    assert price["per_percent"] == pytest.approx(10 * (wider.objective / held.objective - 1), rel=2e-2)


def test_dwell_lets_the_motor_cool() -> None:
    """The RMS over move and dwell: a limit r with a dwell is the limit r·sqrt((T + dwell)/T) without."""
    dwell = 0.5
    with_dwell = solved(motor("velocity", "linf", dwell=dwell, limits={**LIMITS, "rms_force": 0.133}))
    without = solved(motor("velocity", "linf", limits={**LIMITS, "rms_force": 0.133 * math.sqrt(0.9 / 0.4)}))
    assert with_dwell.objective == pytest.approx(without.objective, rel=1e-9)
    assert with_dwell.metrics["rms_force"] * math.sqrt(0.4 / 0.9) == pytest.approx(0.133, rel=1e-7)
    assert trajopt.solve(motor("velocity", "linf", limits={**LIMITS, "rms_force": 0.133})).status.exit_code == 3


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("one_way", [True, False])
def test_the_envelope_is_kept_at_every_instant_and_reached(way: float, one_way: bool) -> None:
    velocity = {"velocity": {"min": 0.0} if way > 0 else {"max": 0.0}} if one_way else {}
    limits = {"jerk": 5e4, "envelope": ENVELOPE, **velocity}
    load = {**MOTOR, "coulomb": 0.0}
    solution = solved(motor("jerk", "l2", distance=20.0 * way, limits=limits, load=load))
    states = solution.at(np.linspace(0.0, 0.4, 20_001))
    force = np.abs(MOTOR["inertia"] * states["acceleration"] + MOTOR["viscous"] * states["velocity"])
    room = np.interp(np.abs(states["velocity"]), ENVELOPE["speed"], ENVELOPE["torque"]) - force
    assert -1e-7 <= np.min(room) <= 1e-3
    free = solved(motor("jerk", "l2", distance=20.0 * way, limits={"jerk": 5e4, **velocity}, load=load))
    assert solution.objective > free.objective * (1 + 1e-3)


def test_nothing_is_faster_than_the_last_speed_of_the_envelope() -> None:
    envelope = {"speed": [0.0, 63.0], "torque": [0.6, 0.6]}
    solution = solved(motor("jerk", "l2", limits={**LIMITS, "envelope": envelope}))
    assert solution.metrics["peak_velocity"] == pytest.approx(63.0, rel=1e-6)


def test_least_time_under_current_and_voltage() -> None:
    limits = {**LIMITS, "current": 0.8, "voltage": 60.0, "rms_force": 0.35}
    solution = solved(motor("time", time="free", limits=limits))
    assert solution.status is trajopt.Verdict.SOLVED
    assert solution.metrics["peak_voltage"] == pytest.approx(60.0, rel=1e-6)
    assert solution.metrics["peak_current"] == pytest.approx(0.8, rel=1e-6)
    slower = trajopt.solve(motor("jerk", "l2", time=solution.duration * (1 - 1e-4), limits=limits))
    assert not slower.status.solved  # undecided: a pause without friction lowers the RMS by more than that
    slower = trajopt.solve(motor("jerk", "l2", time=solution.duration * 0.97, limits=limits))
    assert slower.status in (trajopt.Verdict.IMPOSSIBLE, trajopt.Verdict.IMPOSSIBLE_ON_GRID)


@pytest.mark.parametrize(
    ("limits", "status"),
    [
        ({"envelope": {"speed": [0.0, 40.0, 70.0], "torque": [0.3, 0.3, 0.05]}}, "IMPOSSIBLE"),
        ({"current": 0.6, "velocity": (0.0, 56.0)}, "IMPOSSIBLE"),
        ({"rms_force": 0.16}, "IMPOSSIBLE_ON_GRID"),
    ],
    ids=["envelope", "current", "rms"],
)
def test_cures_of_impossible_moves_work(limits: dict[str, Any], status: str) -> None:
    problem = motor("jerk", "l2", limits={**LIMITS, **limits}, time=0.37)
    solution = trajopt.solve(problem)
    assert solution.status.value == status
    cures = {name: cure["value"] for name, cure in solution.explanation["limits"].items() if cure["value"] is not None}
    assert cures
    for name, value in cures.items():
        assert trajopt.solve(problem.with_limit(name, value)).status.solved, name


def test_motor_limits_imply_acceleration_and_velocity() -> None:
    """a = (F - b v - c)/I with F <= Kt u, F <= (U - Kt v) Kt/R at v = 0, and the envelope."""
    cases = {"current": (0.5, 0.57 * 0.5), "voltage": (6.0, 6.0 * 0.57 / 3.0), "envelope": (ENVELOPE, 0.5)}
    for name, (limit, force) in cases.items():
        found = implied(motor("copper_loss", time=5.0, limits={"velocity": {"min": 0.0}, name: limit})).limits
        assert found.acceleration.highest == pytest.approx((force - 0.02) / 4.142e-4, rel=1e-12)
    assert found.velocity.highest == 100.0
    plain = motor("copper_loss")
    assert implied(plain) is plain


# --- symmetries ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("minimize", ["electrical_energy", "copper_loss"])
@pytest.mark.parametrize(("length", "clock"), [(1e-6, 1.0), (1e3, 1e-3), (1.0, 1e3)])
def test_units_do_not_matter(minimize: str, length: float, clock: float) -> None:
    """Lengths and times in other units, the mass in the same: forces by L/T², powers by L²/T³, current as it was."""
    force, watt = length / clock**2, length**2 / clock**3

    def move(length: float, clock: float, force: float, watt: float) -> trajopt.Problem:
        load = {
            "inertia": 2.0, "coulomb": 3.0 * force, "viscous": 1.5 * force * clock / length, "recovery": 0.4,
            "torque_constant": 8.0 * force, "resistance": 2.0 * watt, "switching": 1.5 * watt,
            "eddy": 0.05 * watt * clock**2 / length**2, "hysteresis": 0.2 * watt * clock / length,
            "hysteresis_exponent": 1.5,
        }  # fmt: skip
        limits = {
            "velocity": (0.0, 1.7 * length / clock), "acceleration": 9.0 * length / clock**2,
            "jerk": 150.0 * length / clock**3, "current": 2.4, "voltage": 17.0 * watt, "rms_force": 14.0 * force,
        }  # fmt: skip
        speed, torque = (0.0, length / clock, 2 * length / clock), (20 * force, 19 * force, force)
        limits["envelope"] = trajopt.Envelope(speed=speed, force=torque)
        return axis(minimize, distance=length, time=clock, dwell=0.3 * clock, load=load, limits=limits, intervals=24)

    plain, other = solved(move(1.0, 1.0, 1.0, 1.0)), solved(move(length, clock, force, watt))
    assert other.objective == pytest.approx(plain.objective * watt * clock, rel=1e-7)
    assert other.metrics["peak_current"] == pytest.approx(plain.metrics["peak_current"], rel=1e-5)


@pytest.mark.parametrize("minimize", ["electrical_energy", "copper_loss"])
def test_mirror(minimize: str) -> None:
    there = solved(motor(minimize, limits={**LIMITS, "voltage": (-60.0, 40.5)}, load={**MOTOR, **IRON}))
    limits = {**LIMITS, "velocity": {"max": 0.0}, "voltage": (-40.5, 60.0)}
    back = solved(motor(minimize, distance=-20.0, limits=limits, load={**MOTOR, **IRON}))
    assert back.objective == pytest.approx(there.objective, rel=1e-7)
    assert back.certificate["lower_bound"] == pytest.approx(there.certificate["lower_bound"], rel=1e-7)


def test_the_table_and_the_panels_of_a_motor() -> None:
    solution = solved(motor("copper_loss"))
    frame = solution.frame
    assert {name: frame.attrs["units"][name] for name in ("current", "voltage", "electrical_power")} == {
        "current": "A", "voltage": "V", "electrical_power": "W",
    }  # fmt: skip
    assert frame["current"].abs().max() == pytest.approx(solution.metrics["peak_current"], rel=1e-3)
    force, v = frame["force"].to_numpy(), frame["velocity"].to_numpy()
    np.testing.assert_allclose(frame["electrical_power"], power(solution.problem.load, force, v), rtol=1e-12)
    labels = [axes.get_ylabel() for axes in solution.plot()]
    assert [label.partition("\n")[0] for label in labels[-3:]] == ["current", "voltage", "electrical power"]
