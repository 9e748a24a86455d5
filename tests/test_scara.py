"""Planar arms: kinematics and dynamics against the reference point, against each other, and by the balance of power."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from scara import PlanarArm, TwoLinkArm

NUMBERS = {"lengths": (0.4, 0.3), "masses": (4.0, 2.0), "centres": (0.2, 0.15), "inertias": (0.06, 0.02)}
ARM = TwoLinkArm(**NUMBERS)
Q, W, A = (0.3, -1.0), (5.0, -9.0), (20.0, -40.0)


@pytest.mark.parametrize("arm", [ARM, PlanarArm(**NUMBERS)])
def test_the_reference_point(arm: TwoLinkArm | PlanarArm) -> None:
    assert arm.torque(Q, W, A) == pytest.approx((8.591211336407472, -2.5276874203401545), rel=1e-13)
    assert arm.tip_velocity(Q, W) == pytest.approx((-1.3641016380, 0.9928623535), abs=1e-10)
    assert arm.energy(Q, W) == pytest.approx(5.9732744659, abs=1e-10)


def random_motion(joints: int, count: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return tuple(rng.normal(scale=s, size=(joints, count)) for s in (2.0, 6.0, 50.0))  # type: ignore[return-value]


@pytest.mark.parametrize("payload", [0.0, 0.7])
def test_lagrange_and_newton_euler_agree(payload: float) -> None:
    motion = random_motion(2)
    lagrange, newton = (arm.loaded(payload) for arm in (ARM, PlanarArm(**NUMBERS)))
    np.testing.assert_allclose(lagrange.torque(*motion), newton.torque(*motion), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(lagrange.energy(*motion[:2]), newton.energy(*motion[:2]), rtol=1e-12)


THREE = PlanarArm((0.4, 0.3, 0.2), (4.0, 2.0, 1.0), (0.2, 0.15, 0.1), (0.06, 0.02, 0.01), 0.3)


@pytest.mark.parametrize("arm", [ARM.loaded(0.5), THREE])
def test_power_is_the_rate_of_energy(arm: TwoLinkArm | PlanarArm) -> None:
    q, w, a = random_motion(arm.joints)
    power = np.sum([t * x for t, x in zip(arm.torque(q, w, a), w, strict=True)], axis=0)
    h = 1e-5
    after, before = (arm.energy(q + s * h * w + h**2 / 2 * a, w + s * h * a) for s in (1, -1))
    np.testing.assert_allclose((after - before) / (2 * h), power, rtol=1e-5, atol=1e-4)


def test_a_payload_is_a_point_mass_on_the_last_link() -> None:
    mass, motion = 0.5, random_motion(2)
    centre = (2.0 * 0.15 + mass * 0.3) / (2.0 + mass)
    inertia = 0.02 + 2.0 * (centre - 0.15) ** 2 + mass * (0.3 - centre) ** 2
    merged = TwoLinkArm((0.4, 0.3), (4.0, 2.0 + mass), (0.2, centre), (0.06, inertia))
    np.testing.assert_allclose(merged.torque(*motion), ARM.loaded(mass).torque(*motion), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("arm", [ARM, THREE])
def test_tip_velocity_and_acceleration_are_derivatives_of_the_tip(arm: TwoLinkArm | PlanarArm) -> None:
    q, w, a = random_motion(arm.joints)
    h = 1e-4

    def tip(t: float) -> np.ndarray:
        return np.array(arm.tip(q + t * w + t**2 / 2 * a))

    np.testing.assert_allclose((tip(h) - tip(-h)) / (2 * h), arm.tip_velocity(q, w), rtol=1e-4, atol=1e-3)
    second = (tip(h) - 2 * tip(0.0) + tip(-h)) / h**2
    np.testing.assert_allclose(second, arm.tip_acceleration(q, w, a), rtol=1e-4, atol=1e-2)
    pose = q[:, 0]
    np.testing.assert_allclose(arm.jacobian(pose) @ w[:, 0], np.array(arm.tip_velocity(pose, w[:, 0])))


@pytest.mark.parametrize("elbow", ["up", "down"])
def test_the_inverse_puts_the_tip_where_it_is_asked(elbow: str) -> None:
    for x, y in ((0.5, 0.2), (-0.3, 0.4), (0.1, -0.05), (0.7, 0.0), (0.0, 0.1)):
        q = ARM.inverse(x, y, elbow)  # type: ignore[arg-type]
        assert ARM.tip(q) == pytest.approx((x, y), abs=1e-9)
        assert q[1] <= 0 if elbow == "up" else q[1] >= 0
    with pytest.raises(trajopt.BadInput, match=r"0.8.* m from the first joint, out of reach: 0.1 to 0.7 m"):
        ARM.inverse(0.8, 0.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"lengths": (0.4, 0.0)}, "lengths: every one must be > 0"),
        ({"masses": (0.0, 1.0)}, "masses: every one must be > 0"),
        ({"inertias": (0.0, -1.0)}, "inertias: every one must be 0 or more"),
        ({"centres": (0.1,)}, "centres: needs a value a link, 2, got 1"),
        ({"payload": -1.0}, "payload: must be 0 or more"),
    ],
)
def test_an_arm_that_cannot_be_is_refused(change: dict[str, object], words: str) -> None:
    for arm in (TwoLinkArm, PlanarArm):
        with pytest.raises(trajopt.BadInput, match=words):
            arm(**{**NUMBERS, **change})  # type: ignore[arg-type]
    with pytest.raises(trajopt.BadInput, match="two links, got 3"):
        TwoLinkArm(THREE.lengths, THREE.masses, THREE.centres, THREE.inertias)
