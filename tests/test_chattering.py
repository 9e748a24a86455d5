"""Fourth order between rests: the self-similar constants, published rows, truncation, short moves, certified bounds."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isinf

import numpy as np
import pytest

from tests.test_switching import FREE, reachable, verified
from trajopt.switching import Arcs, Chain, Unresolved, audit, s_curve, shortest
from trajopt.switching.chatter import chattering, first_arc

ALPHA = 0.1660686593560346  # this and all that follow: computed independently, by Newton against a fine linear program
ROWS = [  # distance, velocity, acceleration, jerk, snap, least time, time of the S-curve
    (10.0, 1.0, inf, inf, 1.0, 13.170782519490599, 13.174802103936399),
    (0.3, 1.0, 20.0, 1000.0, 1e5, 0.37998685322106738, 0.38),
    (40.0, 4.0, 1.5, 1.0, 1.0, 15.164534602867765, 15.166666666666667),
]
SHORT = [  # distance under the limits of the second row, least time, touches of the velocity limit
    (0.01, 0.08034787028105636, 0),
    (0.03, 0.11, 0),
    (0.075, 0.15496819608929144, 1),
    (0.085, 0.164983866354571, 2),
    (0.095, 0.17498677759523187, 3),
]


def between_rests(distance: float, *limits: float, start: float = 0.0) -> Chain:
    """``limits``: velocity, acceleration, jerk, snap."""
    rest = (0.0, 0.0, 0.0)
    return Chain(4, (FREE, *((-x, x) for x in limits)), (start, *rest), (start + distance, *rest))


def limited(chain: Chain, **options: float) -> Arcs:
    arcs = shortest(chain, **options)  # type: ignore[arg-type]
    verdict = audit(chain, arcs.tops, arcs.durations)
    assert verdict.accepted and verdict.residual < 1e-11 and verdict.excess < 1e-11
    assert min(arcs.durations) > 0 and 0 < arcs.lowest <= arcs.duration
    return arcs


def test_constants_of_the_self_similar_approach() -> None:
    law = chattering()
    assert law.alpha == pytest.approx(ALPHA, rel=1e-12)
    assert law.switches == pytest.approx((0.4698574403083731, 0.8716996119056096, 1.0283609608773876), rel=1e-12)
    assert law.period == pytest.approx(4.247910504000552, rel=1e-12)
    assert law.limit_time == pytest.approx(5.093837222522777, rel=1e-12)
    assert law.cost == pytest.approx(1.345220186532028, rel=1e-12)
    assert law.greedy_cost == pytest.approx(1.346762637932618, rel=1e-12)


def test_constants_of_the_approach_from_rest() -> None:
    first = first_arc()
    assert first.durations == pytest.approx((0.794919230108325, 1.599743839379702, 0.626801749543686), rel=1e-12)
    assert first.limit_time == pytest.approx(3.928284288372577, rel=1e-12)
    assert first.cost == pytest.approx(1.585391259745299, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.01, 0.4, 3.0, 200.0])
def test_unequal_snaps_have_constants_too(ratio: float) -> None:
    """The self-similar cost is the least among neighbouring contractions of the same three arcs."""
    law = chattering(ratio)
    assert law.cost == pytest.approx(_cost_of_contraction(law.alpha, ratio, law.arcs), rel=1e-9)
    for alpha in (law.alpha * 0.9, law.alpha * 1.1):
        assert _cost_of_contraction(alpha, ratio, law.arcs) > law.cost
    assert law.cost < law.greedy_cost


def _cost_of_contraction(alpha: float, ratio: float, guess: tuple[float, float, float]) -> float:
    """∫ y3 dt from (1, 0, 0) if every touch has alpha times the jerk of the last."""
    d = np.array(guess)
    for _ in range(50):
        end, cost, slope = _three_arcs(d, ratio)
        d = d - np.linalg.solve(slope, end - np.array([alpha, 0.0, 0.0]))
    return float(cost / (1 - alpha**4))


def _three_arcs(d: np.ndarray, ratio: float) -> tuple[np.ndarray, float, np.ndarray]:
    """State at the end, ∫ y3 dt, and the state's gradient by central differences."""

    def run(d: np.ndarray) -> np.ndarray:
        y = np.array([1.0, 0.0, 0.0, 0.0])
        for rate, t in zip((-1.0, ratio, -1.0), d, strict=True):
            powers = t ** np.arange(1, 5) / np.array([1, 2, 6, 24])
            y = np.array(
                [y[i] + sum(y[i - k] * powers[k - 1] for k in range(1, i + 1)) + rate * powers[i] for i in range(4)]
            )
        return y

    steps = 1e-6 * np.diag(d)
    slope = np.array([(run(d + s)[:3] - run(d - s)[:3]) / (2 * s.sum()) for s in steps]).T
    return run(d)[:3], float(run(d)[3]), slope


@pytest.mark.parametrize("row", ROWS)
def test_long_moves_chatter(row: tuple[float, ...]) -> None:
    *given, least, ordinary = row
    arcs = limited(between_rests(*given))
    assert arcs.chatters and "velocity.max" in arcs.active
    assert arcs.lowest == pytest.approx(least, rel=1e-12)
    assert least * (1 - 1e-13) <= arcs.duration <= least * (1 + 1e-10)
    assert arcs.ordinary == pytest.approx(ordinary, rel=1e-12)


def test_the_s_curve_loses_three_hundredths_of_a_percent() -> None:
    arcs = limited(between_rests(*ROWS[0][:5]))
    assert arcs.ordinary is not None
    assert f"{arcs.ordinary / arcs.lowest - 1:.4%}" == "0.0305%"


@pytest.mark.parametrize("distance", [-10.0, 0.5, 10.0])
def test_the_s_curve_is_offered_beside(distance: float) -> None:
    chain = between_rests(distance, 1.0, inf, inf, 1.0)
    best, curve = limited(chain), s_curve(chain)
    assert audit(chain, curve.tops, curve.durations).accepted
    assert curve.duration == pytest.approx(best.ordinary, rel=1e-14) and curve.bracket[0] == best.lowest
    assert curve.loss == pytest.approx((512 / 384) ** 0.25 - 1 if distance == 0.5 else 3.0519e-4, rel=1e-4)


def test_each_touch_divides_the_loss_by_the_fourth_power_of_the_contraction() -> None:
    chain = between_rests(*ROWS[0][:5])
    losses = [limited(chain, touches=k).loss for k in range(4)]
    assert [len(limited(chain, touches=k).touches) for k in range(4)] == [0, 2, 4, 6]
    assert losses[1] < 1e-6
    assert losses[2] / losses[1] == pytest.approx(ALPHA**4, rel=1e-6)
    assert losses[3] / losses[2] == pytest.approx(ALPHA**4, rel=1e-2)
    assert losses[0] * ROWS[0][5] == pytest.approx(4e-3, rel=0.01)


@pytest.mark.parametrize(("dwell", "ends"), [(0.5, 0), (0.1, 1), (0.01, 2)])
def test_a_least_spacing_of_switches_cuts_the_chattering(dwell: float, ends: int) -> None:
    arcs = limited(between_rests(*ROWS[0][:5]), min_dwell=dwell)
    assert arcs.least_dwell >= dwell and len(arcs.touches) == 2 * ends
    assert arcs.lowest == pytest.approx(ROWS[0][5], rel=1e-12)


def test_short_moves_with_fewer_touches_know_what_they_lose() -> None:
    chain = between_rests(0.095, *ROWS[1][1:5])
    none, one = limited(chain, touches=0), limited(chain, touches=1)
    assert (len(none.touches), len(one.touches)) == (0, 3)
    assert none.loss == pytest.approx(0.175 / SHORT[4][1] - 1, rel=1e-5)
    spaced = limited(chain, min_dwell=1e-3)
    assert spaced.duration == none.duration and spaced.least_dwell >= 1e-3


def test_a_spacing_longer_than_every_arc_is_refused() -> None:
    with pytest.raises(Unresolved, match="least spacing"):
        shortest(between_rests(*ROWS[0][:5]), min_dwell=5.0)


@pytest.mark.parametrize(("distance", "least", "touches"), SHORT)
def test_short_moves_touch_the_limit_a_few_times(distance: float, least: float, touches: int) -> None:
    arcs = limited(between_rests(distance, *ROWS[1][1:5]))
    assert arcs.duration == pytest.approx(least, rel=1e-9)
    assert len(arcs.touches) == touches and not arcs.chatters
    assert arcs.loss < 1e-12


def test_more_touches_towards_the_distance_of_the_first_plateau() -> None:
    found = [limited(between_rests(d, *ROWS[1][1:5])) for d in np.linspace(0.0701, 0.0995, 50)]
    counts = [len(arcs.touches) for arcs in found]
    assert counts == sorted(counts) and counts[-1] >= 4
    assert max(arcs.loss for arcs in found) < 1e-9


def test_the_s_curve_is_the_shortest_where_its_plateau_begins() -> None:
    arcs = limited(between_rests(0.08, *ROWS[1][1:5]))
    assert arcs.duration == pytest.approx(0.16, rel=1e-13) and arcs.loss < 1e-9
    assert arcs.ordinary == pytest.approx(arcs.duration, rel=1e-13)


def test_snap_alone_has_a_closed_form() -> None:
    arcs = limited(between_rests(2.0, inf, inf, inf, 3.0))
    assert arcs.duration == pytest.approx((384 * 2 / 3) ** 0.25, rel=1e-14)
    assert arcs.ordinary == pytest.approx((512 * 2 / 3) ** 0.25, rel=1e-14)
    assert arcs.active == ("snap.max", "snap.min", "snap.max", "snap.min") and arcs.loss < 1e-13


@pytest.mark.parametrize("length", [1e-9, 1e3])
@pytest.mark.parametrize("row", [ROWS[0], ROWS[1], (0.085, 1.0, 20.0, 1000.0, 1e5, 0.164983866354571)])
def test_units_do_not_matter(row: tuple[float, ...], length: float) -> None:
    arcs = limited(between_rests(*(x * length for x in row[:5]), start=3 * length))
    assert arcs.duration == pytest.approx(row[5], rel=1e-10)


@pytest.mark.parametrize("distance", [0.03, 0.095, 0.3])
def test_backwards_mirrors_forwards(distance: float) -> None:
    there, back = (limited(between_rests(sign * distance, *ROWS[1][1:5])) for sign in (1, -1))
    assert back.durations == there.durations and back.tops == tuple(-u for u in there.tops)
    assert back.active[:2] == ("snap.min", "jerk.min") and len(back.touches) == len(there.touches)


def random_limits(rng: np.random.Generator, skew: float) -> Chain:
    """Any subset of limits, on the scale of the move; ``skew``: how far the two sides may differ."""
    distance = 10 ** rng.uniform(-1, 2)
    limits = [FREE]
    for i in (1, 2, 3):
        size = inf if rng.uniform() < 0.3 else 10 ** rng.uniform(-1.3, 0.3) * distance ** (1 - i / 4)
        limits.append((-size, size * rng.uniform(1 / skew, skew)))
    limits.append((-1.0, rng.uniform(1 / skew, skew)))
    return Chain(4, tuple(limits), (0.0,) * 4, (distance, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_any_subset_of_limits_is_certified(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        chain = random_limits(rng, 1.0)
        assert limited(chain).loss < 1e-9, chain


@pytest.mark.parametrize("seed", range(2))
def test_unequal_limits_are_certified_and_run_backwards_alike(seed: int) -> None:
    rng = np.random.default_rng(50 + seed)
    chains = [random_limits(rng, 2.0) for _ in range(50)]
    found = [limited(chain) for chain in chains]
    assert all(arcs.loss < 0.01 for arcs in found)
    assert sum(arcs.loss < 1e-9 for arcs in found) >= 49
    for chain, arcs in zip(chains[:25], found, strict=False):
        assert limited(chain.reversed()).duration == pytest.approx(arcs.duration, rel=1e-9 + arcs.loss)


def test_limits_that_do_not_matter_change_nothing() -> None:
    chain = between_rests(1.0, inf, inf, inf, 1.0)
    loose = replace(chain, limits=(FREE, (-1.0, 2.0), (-3.0, 5.0), (-9.0, 7.0), (-1.0, 1.0)))
    assert limited(loose).duration == pytest.approx(limited(chain).duration, rel=1e-13)


@pytest.mark.parametrize("seed", range(4))
def test_a_linear_program_finds_nothing_shorter(seed: int) -> None:
    rng = np.random.default_rng(300 + seed)
    chain = random_limits(rng, 1.5)
    unit = chain.distance**0.25 / 2
    scaled = chain.scaled(chain.distance, unit)
    arcs = limited(chain)
    assert reachable(scaled, arcs.duration / unit * 1.01, 120)
    assert not reachable(scaled, arcs.lowest / unit * 0.99, 120)


def test_options_that_mean_nothing() -> None:
    chain = between_rests(1.0, inf, inf, inf, 1.0)
    for options in ({"min_dwell": -1.0}, {"touches": -1}):
        with pytest.raises(ValueError, match="negative"):
            limited(chain, **options)
    assert isinf(chain.limits[1][1]) and verified(chain).touches == ()
