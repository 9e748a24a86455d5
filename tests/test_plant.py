"""Minimum-time commands for linear plants: reference rows, closed forms, robust variants, refusals."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, exp, log, pi, sqrt

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

from trajopt.plant import Command, Plant, band, residual_vibration, response, time_optimal
from trajopt.plant.minimum_time import Move
from trajopt.plant.polish import Structure, costate_of, settled_sign, sign_margin

TWO_MASSES = [1.0, 0.0, 2.0, 0.0, 0.0]
ROWS = {  # numerator, denominator, u_ss, y_f, robust, switches, T (computed independently)
    "rigid": ([1], [1, 0, 0], 0.0, 1.0, (), [1.0], 2.0),
    "undamped": ([1], [1, 0, 1], 0.5, 0.5, (), [0.812755561369], 1.318116071653),
    "damped": ([1], [1, 0.2, 1], 0.5, 0.5, (), [0.871670660364], 1.335006098281),
    "two masses": ([1], TWO_MASSES, 0.0, 1.0, (), [1.002678430378, 2.108933255226, 3.215188080073], 4.217866510451),
    "motor": ([2], [1, 2, 0], 0.0, 1.0, (), [1.328727227077], 1.657454454153),
    "third order": ([1], [1, 3.4, 17.2, 48], 0.6, 0.0125, (), [0.328576710622, 0.500920813693], 0.816184438836),
    "two masses, ZVD": (
        [1],
        TWO_MASSES,
        0.0,
        1.0,
        "zvd",
        [0.712398632602, 1.656345132577, 2.932979219508, 4.209613306438, 5.153559806413],
        5.865958439015,
    ),
}


def verified(command: Command) -> Command:
    """The command, whose proof and simulation hold."""
    assert command.optimal and max(map(abs, command.residuals)) <= 1e-11 and command.end_error <= 1e-9
    return command


@pytest.mark.parametrize("row", ROWS)
def test_reference_rows(row: str) -> None:
    numerator, denominator, u_ss, y_f, robust, switches, duration = ROWS[row]
    plant = Plant.from_polynomials(numerator, denominator)
    command = verified(time_optimal(plant, -1, 1, u_ss, y_f, robust))
    assert command.duration == pytest.approx(duration, rel=1e-11)
    assert command.switches == pytest.approx(switches, abs=1e-11)
    assert command.first == 1 and set(command.levels) <= {-1, 1}


@pytest.mark.parametrize("row", ROWS)
def test_output_rests_at_its_end_by_an_ode_solver(row: str) -> None:
    numerator, denominator, u_ss, y_f, robust, _, _ = ROWS[row]
    command = time_optimal(Plant.from_polynomials(numerator, denominator), -1, 1, u_ss, y_f, robust)
    a, b, c, _ = signal.tf2ss(numerator, denominator)
    times, levels = [*command.impulses[0], command.duration + 3.0], [*command.levels, u_ss]
    x, after = np.zeros(len(a)), np.empty(0)
    for start, end, u in zip(times[:-1], times[1:], levels, strict=True):
        dynamics: Callable[[float, np.ndarray], np.ndarray] = lambda _, x, u=u: a @ x + b[:, 0] * u  # noqa: E731
        flow = solve_ivp(dynamics, (start, end), x, rtol=1e-11, atol=1e-12, t_eval=np.linspace(start, end, 20))
        x, after = flow.y[:, -1], (c @ flow.y)[0]
    assert after == pytest.approx(np.full(20, y_f), abs=1e-7)


def test_rigid_body_between_uneven_limits() -> None:
    mass, move, low, high = 3.0, 0.7, 2.0, 5.0
    command = verified(time_optimal(Plant.from_polynomials([1], [mass, 0, 0]), -low, high, y_f=move))
    assert command.duration == pytest.approx(sqrt(2 * move * mass * (low + high) / (low * high)), rel=1e-12)


def test_first_order_pole() -> None:
    command = verified(time_optimal(Plant.from_poles([-4.0], gain=8.0), -1, 2, u_ss=1.7))
    assert command.duration == pytest.approx(log(2 / (2 - 1.7)) / 4, rel=1e-12)
    assert command.y_f == pytest.approx(3.4) and command.switches == ()


@pytest.mark.parametrize("y_f", [0.01, 1.0, -6.0])
def test_motor(y_f: float) -> None:
    gain, tau, limit = 1.5, 0.2, 3.0
    command = verified(time_optimal(Plant.from_polynomials([gain], [tau, 1, 0]), -limit, limit, y_f=y_f))
    drift = abs(y_f) / (gain * limit)
    e = exp(-drift / tau)
    first = tau * log((1 + sqrt(1 - e)) / e)
    assert command.switches == pytest.approx([first], rel=1e-11)
    assert command.duration == pytest.approx(2 * first - drift, rel=1e-11)
    assert command.first == np.sign(y_f)


@pytest.mark.parametrize(("low", "high", "final"), [(-1.0, 1.0, 0.3), (-0.4, 2.0, 1.9), (-1.0, 1.0, 1.0)])
def test_undamped_mode_between_uneven_limits(low: float, high: float, final: float) -> None:
    w = 7.0
    command = verified(time_optimal(Plant.from_polynomials([w**2], [1, 0, w**2]), low, high, u_ss=final))
    first = acos((low * (final - high) + high**2 - final**2 / 2) / (high * (high - low))) / w
    whole = acos((low * (high - final) + final**2 / 2) / (high * (low - final))) / w
    assert command.switches == pytest.approx([first], rel=1e-11)
    assert command.duration == pytest.approx(whole, rel=1e-11)


@pytest.mark.parametrize("periods", [1, 2, 5])
def test_whole_periods_need_one_switch_alone(periods: int) -> None:
    half = 2 * pi * periods / sqrt(2)
    command = verified(time_optimal(Plant.from_polynomials([1], TWO_MASSES), -1, 1, y_f=half**2 / 2))
    assert command.duration == pytest.approx(2 * half, rel=1e-11)


def test_arcs_too_short_for_a_mesh_are_found() -> None:
    half = 2 * pi / sqrt(2)
    command = verified(time_optimal(Plant.from_polynomials([1], TWO_MASSES), -1, 1, y_f=half**2 / 2 * (1 + 1e-4)))
    assert len(command.switches) == 3 and command.switches[2] - command.switches[0] < 1e-3


def test_oscillatory_plant_needs_more_switches_than_states() -> None:
    poles = [0, 0, -1, -0.1 + 1j, -0.1 - 1j, -0.05 + 2.2j, -0.05 - 2.2j, 3.7j, -3.7j]
    command = verified(time_optimal(Plant.from_poles(poles), -1, 1, y_f=2.0))
    assert len(command.switches) > len(poles) - 1


def test_units_do_not_matter() -> None:
    poles = np.array([0, 0, -1.0, -0.2 + 3j, -0.2 - 3j])
    plain = time_optimal(Plant.from_poles(poles), -1, 0.6, y_f=0.4)
    for time, force, length in [(1e-6, 1e4, 1e-7), (1e5, 1e-6, 1e8)]:
        plant = Plant.from_poles(poles / time, gain=length / force / time**5)
        scaled = verified(time_optimal(plant, -force, 0.6 * force, y_f=0.4 * length))
        assert scaled.duration / time == pytest.approx(plain.duration, rel=1e-11)
        assert np.array(scaled.switches) / time == pytest.approx(plain.switches, rel=1e-10)


def test_three_descriptions_of_one_plant_agree() -> None:
    zeros, poles, gain = [-5.0, -0.3 + 2j, -0.3 - 2j], [0, 0, -2, -2, -1 + 4j, -1 - 4j], 3.0
    numerator, denominator = gain * np.poly(zeros).real, np.poly(poles).real
    a, b, c, d = signal.tf2ss(numerator, denominator)
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((6, 6)))[0]
    plants = [
        Plant.from_poles(poles, zeros, gain),
        Plant.from_polynomials(numerator, denominator),
        Plant.from_state_space(turn @ a @ turn.T, turn @ b, c @ turn.T, float(d[0, 0])),
    ]
    for plant in plants:
        assert [m for _, m in plant.modes] == [2, 2, 1, 1] and plant.rigid == 2
        assert plant.limit == pytest.approx(3 * 5 * 4.09 / (4 * 17), rel=1e-9)
        assert sorted(plant.zeros, key=lambda z: (round(z.real, 6), z.imag)) == pytest.approx(
            [-5, -0.3 - 2j, -0.3 + 2j], rel=1e-7
        )
    durations = [verified(time_optimal(plant, -1, 1, y_f=1.0)).duration for plant in plants]
    assert durations[1:] == pytest.approx(durations[:1] * 2, rel=1e-9)


@pytest.mark.parametrize("count", [3, 5])
def test_repeated_roots_of_a_polynomial_are_one_pole(count: int) -> None:
    plant = Plant.from_polynomials([1], np.poly([-1.3] * count))
    assert [m for _, m in plant.modes] == [count] and plant.poles[0] == pytest.approx(-1.3, rel=1e-12)
    rotated = Plant.from_state_space(*signal.tf2ss([1], np.poly([-1.3] * count))[:3])
    assert [m for _, m in rotated.modes] == [count]


def test_neighbouring_poles_keep_all_digits() -> None:
    durations = [
        verified(time_optimal(Plant.from_poles([-1, -1 - gap, -1 + gap]), -1, 1, u_ss=0.5)).duration
        for gap in (0.0, 1e-5, 1e-2)
    ]
    assert durations[1] == pytest.approx(durations[0], rel=1e-9)  # the change is of second order
    assert 1e-6 < abs(durations[2] / durations[0] - 1) < 1e-3


def test_sigma_has_the_sign_of_the_input_and_vanishes_at_the_switches() -> None:
    command = time_optimal(Plant.from_polynomials([1], TWO_MASSES), -1, 1, y_f=1.0)
    ends = np.array([0.0, *command.switches, command.duration])
    middles = (ends[1:] + ends[:-1]) / 2
    assert np.all(np.sign(command.sigma(middles)) == command.levels)
    assert command.sigma(command.switches) == pytest.approx(np.zeros(3), abs=1e-11)


def test_a_command_that_is_not_the_shortest_fails_the_sign_test() -> None:
    plant = Plant.from_polynomials([1], TWO_MASSES)
    robust = time_optimal(plant, -1, 1, y_f=1.0, robust="zvd")
    basis = Move(plant.poles, -1.0, 1.0, 0.0, 2.0).basis(robust.duration)
    structure = Structure(1.0, 1 - np.array([0.0, *robust.switches]) / robust.duration)
    assert not settled_sign(sign_margin(basis, structure, costate_of(basis, structure)))


def test_robust_commands_stay_flat_about_the_mode() -> None:
    plant, w = Plant.from_polynomials([1], TWO_MASSES), sqrt(2)
    copies: list[complex] = [w * 1j]
    commands = [time_optimal(plant, -1, 1, y_f=1.0, robust=added) for added in ((), copies, copies * 2)]
    errors = np.array([verified(c).residual_vibration(w * np.array([1.01, 1.001])) for c in commands])
    orders = np.log10(errors[:, 0] / errors[:, 1])
    assert orders == pytest.approx([1, 2, 3], abs=0.05)
    assert commands[1].duration == pytest.approx(ROWS["two masses, ZVD"][-1], rel=1e-11)


def test_band_of_frequencies_holds_the_vibration_down() -> None:
    plant = Plant.from_polynomials([1], TWO_MASSES)
    command = verified(time_optimal(plant, -1, 1, y_f=1.0, robust=band(1.2, 1.6)))
    plain = time_optimal(plant, -1, 1, y_f=1.0)
    inside = np.linspace(1.2, 1.6, 50)
    assert command.residual_vibration(np.array([1.2, 1.4, 1.6])) == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.max(command.residual_vibration(inside)) < 0.05 * np.max(plain.residual_vibration(inside))


def test_feedthrough_and_limits_that_exclude_zero() -> None:
    plant = Plant.from_poles([-1, -2], [-3, -5], 2.0)
    command = verified(time_optimal(plant, 0.2, 1.0, u_ss=0.5))
    assert command.y_f == pytest.approx(2 * 15 / 2 * 0.5)


def test_a_zero_at_the_origin_needs_u_ss() -> None:
    plant = Plant.from_poles([-1, -2], [0.0], 3.0)
    command = verified(time_optimal(plant, -1, 1, u_ss=0.5))
    assert command.y_f == 0
    lag = time_optimal(Plant.from_poles([-1, -2]), -1, 1, u_ss=0.5)
    assert command.duration == pytest.approx(lag.duration, rel=1e-12)
    with pytest.raises(ValueError, match="does not follow from y_f"):
        time_optimal(plant, -1, 1, y_f=0.1)


def test_response_of_the_motor() -> None:
    plant = Plant.from_polynomials([2], [1, 2, 0])
    command = time_optimal(plant, -1, 1, y_f=1.0)
    times = np.linspace(0, 3, 301)
    y = response(plant, command, times)
    rising = times < command.switches[0]
    assert y[rising] == pytest.approx((times + (np.exp(-2 * times) - 1) / 2)[rising], abs=1e-13)
    assert y[times >= command.duration] == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(ValueError, match="from 0 on"):
        response(plant, command, np.array([-1.0]))


def test_vibration_of_the_command_is_that_of_its_impulses() -> None:
    command = time_optimal(Plant.from_polynomials([1], [1, 0.2, 1]), -1, 1, 0.5)
    times, amplitudes = command.impulses
    assert np.sum(amplitudes) == pytest.approx(0.5)
    assert command.residual_vibration(1.7, 0.1) == residual_vibration(times, amplitudes, 1.7, 0.1)
    assert command.residual_vibration(1.0, 0.1) == pytest.approx(0.0, abs=1e-10)


RIGID, LAG = Plant.from_poles([0, 0]), Plant.from_poles([-1])
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "unstable": (lambda: Plant.from_poles([1, -2]), "unstable"),
    "unstable polynomial": (lambda: Plant.from_polynomials([1], [1, -0.1, 1]), "unstable"),
    "improper": (lambda: Plant.from_polynomials([1, 0, 0], [1, 1]), "improper"),
    "no dynamics": (lambda: Plant.from_polynomials([3], [2]), "without dynamics"),
    "zero numerator": (lambda: Plant.from_polynomials([0], [1, 1]), "not all zero"),
    "not finite": (lambda: Plant.from_poles([float("nan")]), "finite"),
    "lone complex pole": (lambda: Plant.from_poles([-1 + 1j]), "conjugate"),
    "cancellation": (lambda: Plant.from_poles([-1, -2], [-2]), "cancels"),
    "cancellation in polynomials": (lambda: Plant.from_polynomials([1, 2], [1, 3, 2]), "cancels"),
    "cancellation at zero": (lambda: Plant.from_polynomials([1, 0], [1, 1, 0]), "cancels"),
    "uncontrollable": (lambda: Plant.from_state_space(np.diag([-1.0, -2]), np.r_[1.0, 0], np.r_[1.0, 1]), "uncontroll"),
    "two equal modes": (lambda: Plant.from_state_space(-np.eye(2), np.ones(2), np.ones(2)), "uncontrollable"),
    "unobservable": (lambda: Plant.from_state_space(np.diag([-1.0, -2]), np.ones(2), np.r_[1.0, 0]), "unobservable"),
    "shapes": (lambda: Plant.from_state_space(np.eye(2), np.ones(3), np.ones(2)), "one input and one output"),
    "u_ss outside": (lambda: time_optimal(LAG, -1, 1, u_ss=1.2), "outside the input limits"),
    "u_ss at the limit": (lambda: time_optimal(LAG, -1, 1, u_ss=1.0), "infinite time"),
    "u_ss and y_f disagree": (lambda: time_optimal(LAG, -1, 1, u_ss=0.5, y_f=0.6), "leave it out"),
    "no final value": (lambda: time_optimal(LAG, -1, 1), "u_ss: missing"),
    "no y_f": (lambda: time_optimal(RIGID, -1, 1), "y_f: missing"),
    "u_ss of a rigid body": (lambda: time_optimal(RIGID, -1, 1, u_ss=0.1, y_f=1), "moving"),
    "zero move": (lambda: time_optimal(RIGID, -1, 1, y_f=0), "zero length"),
    "zero move of a lag": (lambda: time_optimal(LAG, -1, 1, y_f=0), "zero length"),
    "limits reversed": (lambda: time_optimal(LAG, 1, -1, y_f=0.1), "umin < umax"),
    "one-sided": (lambda: time_optimal(RIGID, 0, 1, y_f=1), "allow both signs"),
    "zvd without a mode": (lambda: time_optimal(RIGID, -1, 1, y_f=1, robust="zvd"), "no oscillatory pole"),
    "unknown robustness": (lambda: time_optimal(RIGID, -1, 1, y_f=1, robust="ei"), "zvd"),
    "robust at zero": (lambda: time_optimal(RIGID, -1, 1, y_f=1, robust=[0j]), "not zero"),
    "band": (lambda: band(2.0, 1.0), "low <= high"),
    "too many periods": (lambda: time_optimal(Plant.from_poles([0, 0, 1e5j, -1e5j], gain=1e10), -1, 1, y_f=1), "damp"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_name_the_fault_in_one_line(case: str) -> None:
    ask, words = REFUSED[case]
    with pytest.raises(ValueError, match=words) as refusal:
        ask()
    assert "\n" not in str(refusal.value)
