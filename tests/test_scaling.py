"""Symmetries of the problem that the answer must share: units, mirror, time reversal, origin; and size of the mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved, term
from trajopt.scaling import sizes_of

METRES = {"nm": 1e-9, "mm": 1e-3, "km": 1e3}  # factor on every length
SECONDS = {"ms": 1e-3, "ks": 1e3}  # factor on every time
SAME = 1e-9  # relative

# objective -> (terms, power of length, power of time in the objective)
OBJECTIVES: dict[str, tuple[str, str | None, int, int]] = {
    "jerk-l2": ("jerk", "l2", 1, -3),
    "velocity-linf": ("velocity", "linf", 1, -1),
    "acceleration-l1": ("acceleration", "l1", 1, -1),
    "velocity-l2": ("velocity", "l2", 1, -1),
    "energy": ("energy", None, 2, -2),
    "power-linf": ("power", "linf", 2, -3),
    "time": ("time", None, 0, 1),
}


def move(name: str, length: float = 1.0, time: float = 1.0, **changes: Any) -> trajopt.Problem:
    """The move of Clemen & Rupp's Table I, in other units; the mass stays."""
    minimize, norm, *_ = OBJECTIVES[name]
    limits = {
        "velocity": (0.0, 0.5 * length / time),
        "acceleration": 4.905 * length / time**2,
        "jerk": 98.1 * length / time**3,
    }
    return axis(
        minimize,
        norm,
        **{
            "time": "free" if name == "time" else time,
            "distance": 0.254 * length,
            "limits": limits,
            "load": {"inertia": 10.0},
            "intervals": 24,
            **changes,
        },
    )


@pytest.mark.parametrize("name", list(OBJECTIVES))
def test_units_do_not_matter(name: str) -> None:
    """Metres to kilometres, milliseconds to kiloseconds: the same verdict, the objective by known powers."""
    *_, lengths, times = OBJECTIVES[name]
    plain = solved(move(name))
    factors = [(length, 1.0) for length in METRES.values()] + [(1.0, time) for time in SECONDS.values()]
    factors.append((1e-9, 1e-3))
    for length, time in factors:
        other = trajopt.solve(move(name, length, time))
        assert other.status is plain.status, (length, time)
        expected = plain.objective * length**lengths * time**times
        assert other.objective == pytest.approx(expected, rel=SAME), (length, time)
        assert other.duration == pytest.approx(plain.duration * time, rel=SAME)


def test_the_profile_scales_too() -> None:
    plain, nano = solved(move("jerk-l2")), solved(move("jerk-l2", 1e-9, 1e-3))
    for i, (a, b) in enumerate(zip(plain.trajectory.chain, nano.trajectory.chain, strict=True)):
        assert np.max(np.abs(a - b * 1e9 / 1e3**i)) <= 1e-7 * np.max(np.abs(a))


def test_mass_scales_force_power_and_energy() -> None:
    light, heavy = solved(move("energy")), solved(move("energy", load={"inertia": 1e4}))
    assert heavy.objective == pytest.approx(light.objective * 1e3, rel=SAME)


def test_a_weighted_sum_scales_when_its_weights_do() -> None:
    terms = [term("jerk", "l2", 0.01), term("velocity", "linf", 1.0)]
    micro = [term("jerk", "l2", 0.01e6), term("velocity", "linf", 1e6)]
    plain = solved(move("jerk-l2").replace(objective=trajopt.Objective(terms=tuple(terms))))
    small = solved(move("jerk-l2", 1e-6).replace(objective=trajopt.Objective(terms=tuple(micro))))
    assert small.objective == pytest.approx(plain.objective, rel=SAME)


def test_an_impossible_move_is_impossible_in_all_units() -> None:
    """0.254 m at 0.2 m/s need more than a second."""
    for length in (1.0, *METRES.values()):
        solution = trajopt.solve(axis("jerk", "l2", distance=0.254 * length, limits={"velocity": 0.2 * length}))
        assert solution.status in (trajopt.Verdict.IMPOSSIBLE, trajopt.Verdict.IMPOSSIBLE_ON_GRID)


# --- symmetries of one move, with nothing symmetric about it ---------------------------------------------------------

LIMITS = {"velocity": (-0.3, 1.9), "acceleration": (-12.0, 9.0), "jerk": (-150.0, 110.0)}
START = {"position": 0.1, "velocity": 0.2, "acceleration": 1.0}
END = {"position": 0.9, "velocity": -0.1, "acceleration": -2.0}


def lopsided(minimize: str, norm: str, **changes: Any) -> trajopt.Problem:
    """Other limits forth than back, and moving ends."""
    return axis(minimize, norm, **{"start": START, "end": END, "limits": LIMITS, "intervals": 40, **changes})


def flipped(limit: tuple[float, float]) -> tuple[float, float]:
    """The limit of the negated signal."""
    return (-limit[1], -limit[0])


PAIRS = [("jerk", "l2"), ("velocity", "l2"), ("acceleration", "l1"), ("jerk", "linf")]


@pytest.mark.parametrize("minimize, norm", PAIRS)
def test_mirror(minimize: str, norm: str) -> None:
    plain = solved(lopsided(minimize, norm))
    negated = [{k: -x for k, x in state.items()} for state in (START, END)]
    limits = {name: flipped(limit) for name, limit in LIMITS.items()}
    mirrored = solved(lopsided(minimize, norm, start=negated[0], end=negated[1], limits=limits))
    assert mirrored.objective == pytest.approx(plain.objective, rel=SAME)
    velocity = plain.trajectory.chain[1]
    assert np.max(np.abs(velocity + mirrored.trajectory.chain[1])) <= 1e-5 * np.max(np.abs(velocity))


@pytest.mark.parametrize("minimize, norm", PAIRS)
def test_time_reversal(minimize: str, norm: str) -> None:
    """Backwards in time: ends change places, velocity and jerk their sign."""
    plain = solved(lopsided(minimize, norm))
    ends = [{k: -x if k == "velocity" else x for k, x in state.items()} for state in (END, START)]
    limits = {name: limit if name == "acceleration" else flipped(limit) for name, limit in LIMITS.items()}
    backwards = solved(lopsided(minimize, norm, start=ends[0], end=ends[1], limits=limits))
    assert backwards.objective == pytest.approx(plain.objective, rel=SAME)
    position = plain.at(np.linspace(0.0, 1.0, 101))["position"]
    assert backwards.at(np.linspace(0.0, 1.0, 101))["position"][::-1] == pytest.approx(position, abs=1e-5)


@pytest.mark.parametrize("origin", [1.0, -1000.0])
@pytest.mark.parametrize("minimize, norm", PAIRS)
def test_translation_of_the_origin(minimize: str, norm: str, origin: float) -> None:
    """Only displacements matter: also with position limits and a via point, far from the origin."""

    def at(origin: float) -> trajopt.Problem:
        start, end = ({**state, "position": state["position"] + origin} for state in (START, END))
        limits = {**LIMITS, "position": (origin, origin + 1.0)}
        via = (trajopt.Via(time=0.5, position=origin + 0.6),)
        return lopsided(minimize, norm, start=start, end=end, limits=limits, via=via)

    plain, moved = solved(at(0.0)), solved(at(origin))
    assert moved.objective == pytest.approx(plain.objective, rel=SAME)
    t = np.linspace(0.0, 1.0, 101)
    assert moved.at(t)["position"] - origin == pytest.approx(plain.at(t)["position"], abs=1e-5)


def test_looser_limits_and_more_time_never_cost_more() -> None:
    tight = solved(lopsided("acceleration", "linf")).objective
    looser = {name: (1.2 * low, 1.2 * high) for name, (low, high) in LIMITS.items()}
    assert solved(lopsided("acceleration", "linf", limits=looser)).objective <= tight * (1 + 3e-8)
    short, long = (solved(axis("jerk", "linf", time=t, limits=LIMITS)).objective for t in (1.0, 1.1))
    assert long <= short * (1 + 3e-8)


def test_no_norm_is_beaten_at_its_own_game() -> None:
    """Evaluated in one norm, the optimum of that norm is the least."""
    solutions = {norm: solved(lopsided("jerk", norm)) for norm in ("l1", "l2", "linf")}
    for norm, own in solutions.items():
        objective = trajopt.Objective(terms=(term("jerk", norm),))
        for other in solutions.values():
            assert own.objective <= other.trajectory.measure(objective) * (1 + 3e-8)


@pytest.mark.parametrize("name", ["jerk-l2", "velocity-linf", "acceleration-l1"])
def test_five_thousand_intervals(name: str) -> None:
    """As solvable as fifty, and close to what two hundred give."""
    fine, coarse = solved(move(name, intervals=5000)), solved(move(name, intervals=200))
    assert fine.status is trajopt.Verdict.SOLVED
    assert fine.certificate["gap"] <= 1e-6
    assert fine.objective <= coarse.objective * (1 + 3e-8)
    assert fine.objective == pytest.approx(coarse.objective, rel=2e-4)


def test_a_start_left_out_is_scaled_as_the_zero_it_means() -> None:
    """The way from it to a via state close by asks for as much."""
    via = (trajopt.Via(time=0.02, position=0.9),)
    stated, implied = (axis("jerk", "l2", via=via, start={"position": start}) for start in (0.0, None))
    assert sizes_of(implied) == sizes_of(stated)
    assert sizes_of(stated).derivative[1] == pytest.approx(4 * 0.9 / 0.02)
