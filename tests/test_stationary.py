"""Conditions of a sequence of arcs as functions of its switching times: values, gradients, multipliers."""

from __future__ import annotations

import numpy as np
import pytest

from trajopt.switching.polynomials import states
from trajopt.switching.stationary import Condition, _System, prices_of, shortest_sequence

START = (0.0, 0.1, -0.2, 0.3)
TOPS = (1.0, -1.0, 1.0, -1.0, 0.0, 1.0, -1.0, 1.0, -1.0)
TIMES = np.cumsum([0.5, 0.9, 0.7, 0.4, 0.8, 0.6, 0.5, 0.9, 0.3])


def conditions(known: bool) -> list[Condition]:
    """A touch, a plateau, a touch, and the end; ``known``: as they are at the times above."""
    places = [(3, 1), (3, 2), (4, 1), (4, 2), (4, 3), (7, 1), (7, 2), (9, 0), (9, 1), (9, 2), (9, 3)]
    seen = states(START, TOPS, np.diff(TIMES, prepend=0.0).tolist())
    return [Condition(arcs, i, seen[arcs][i] if known else 0.1 * arcs + i) for arcs, i in places]


@pytest.mark.parametrize("local", [True, False])
def test_gradient_and_hessian_are_those_of_differences(local: bool) -> None:
    system = _System(np.array(START), np.array(TOPS), conditions(False), local)
    prices, h = np.linspace(-1.0, 1.3, 11), 1e-5
    _, slope, bend = system.evaluate(TIMES, prices)
    for k, step in enumerate(h * np.eye(len(TIMES))):
        ahead, back = (system.evaluate(TIMES + way * step, prices) for way in (1, -1))
        np.testing.assert_allclose((ahead[0] - back[0]) / (2 * h), slope[:, k], atol=1e-8)
        np.testing.assert_allclose(prices @ (ahead[1] - back[1]) / (2 * h), bend[:, k], atol=1e-7)


def test_conditions_seen_from_any_border_are_the_same() -> None:
    """Backwards from the plateau, or forwards from the start."""
    systems = [_System(np.array(START), np.array(TOPS), conditions(True), local) for local in (True, False)]
    assert systems[0].base[0] == 4 and systems[0].base[5] == 9 and not systems[1].base.any()
    for system in systems:
        value, _, _ = system.evaluate(TIMES, np.zeros(11))
        np.testing.assert_allclose(value, 0.0, atol=1e-13)


def test_prices_are_those_of_moved_values() -> None:
    """A velocity held on the way, and the end: what the duration changes by, per unit of each."""
    start, tops = (0.0, 0.0), (1.0, 0.0, -1.0)
    wanted = [Condition(1, 1, 1.0), Condition(3, 0, 3.0), Condition(3, 1, 0.0)]
    durations = shortest_sequence(start, tops, wanted, (0.9, 2.0, 0.9))
    assert durations is not None and sum(durations) == pytest.approx(4.0)
    prices = prices_of(start, tops, wanted, durations)
    for k, price in enumerate(prices):
        moved = [c if i != k else Condition(c.arcs, c.derivative, c.value + 1e-5) for i, c in enumerate(wanted)]
        again = shortest_sequence(start, tops, moved, durations)
        assert again is not None and (sum(again) - 4.0) / 1e-5 == pytest.approx(price, abs=1e-4)
