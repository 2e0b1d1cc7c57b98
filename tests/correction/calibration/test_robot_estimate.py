"""What touches tell of a robot: laws of the belief, of its commands, and of how sure it is."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench.correction.calibration import UNKNOWN, RobotEstimate, Touch, make_prior_estimate
from apo_bench.geometry import pose
from apo_bench.records.robot_error import Sigmas

DOWN = pose.at((0.5, 0.1, 0.3), (180.0, 0.0, 90.0))
"""The tip above the middle of the goals, looking down."""
MIDDLE = np.array([0.5, 0.1, 0.02])
UP = np.array([0.0, 0.0, 1.0])
ONLY_HAND_EYE = Sigmas(hand_eye=(1.0, 0.2))
FREE = np.repeat([1e-3, np.radians(1.0)], 3)
"""A part that may have moved any way in the hand."""
HELD = pose.at((0.0, 0.01, 0.02), (0.0, 90.0, 20.0))


def jacobian(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (6, 6)) + np.repeat([[0.0], [1.0]], 3, axis=0) * np.eye(6)


def touch_of(
    error: np.ndarray, at: tuple[float, float], sigma_m: float, normal: np.ndarray = UP, off_m: float = 0.0
) -> Touch:
    """A touch of the hand on a plane through the place where the tip of a robot of this displacement really is."""
    B = pose.at((*at, 0.0), (180.0, 0.0, 0.0))
    return Touch(B, normal, normal @ (error @ B)[:3, 3] + off_m, np.zeros(3), sigma_m)


def displaced(xi: np.ndarray, middle: np.ndarray = MIDDLE) -> np.ndarray:
    M = pose.rigid(np.eye(3), middle)
    return M @ pose.exp(xi) @ pose.inverse(M)


def around() -> list[tuple[float, float]]:
    return [(0.6, 0.1), (0.42, 0.18), (0.43, 0.0)]


def taught(seed: int = 0) -> RobotEstimate:
    """A belief of which every unknown is other than zero."""
    rng = np.random.default_rng(seed)
    belief = make_prior_estimate(UNKNOWN, 6, MIDDLE).grasp(3, FREE)
    for _ in range(12):
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        B = pose.at(MIDDLE + rng.uniform(-0.2, 0.2, 3), rng.uniform(-180.0, 180.0, 3))
        v = rng.uniform(-0.05, 0.05, 3)
        off = n @ pose.apply(B @ HELD, v[None])[0] + 1e-3 * rng.standard_normal()
        belief = belief.touch(Touch(B, n, off, v, 1e-4, jacobian(1), 3, HELD))
    assert not belief.refused
    assert np.abs(belief.mean).min() > 0.0
    return belief


def test_what_is_commanded_really_comes_to_be() -> None:
    belief = taught()
    for J in (None, jacobian()):
        assert_allclose(belief.real(belief.command(DOWN, J), J), DOWN, atol=1e-14)
        assert_allclose(belief.command(belief.real(DOWN, J), J), DOWN, atol=1e-14)
        tip = belief.goal_tip(DOWN, 3, HELD, J)
        assert_allclose(belief.real(tip, J) @ belief.held(3, HELD), DOWN, atol=1e-14)


def test_three_touches_of_a_plane_tell_height_and_both_tilts() -> None:
    xi = np.array([0.8e-3, -1.1e-3, 1.7e-3, 4e-3, -6e-3, 3e-3])
    E = displaced(xi)
    belief = make_prior_estimate(ONLY_HAND_EYE, 0, MIDDLE).touch(*(touch_of(E, at, 1e-9) for at in around()))
    # the plane as felt: what lies in it comes to where it really is in height, wherever
    for at in [(0.5, 0.1), (0.3, -0.2)]:
        B = pose.at((*at, 0.0), (180.0, 0.0, 0.0))
        assert belief.real(B)[2, 3] == pytest.approx((E @ B)[2, 3], abs=1e-7)
    assert_allclose(belief.real(DOWN)[2, :3], (E @ DOWN)[2, :3], atol=1e-6)
    # of the tip, along and about the axes of the world
    turn = np.kron(np.eye(2), belief.real(DOWN)[:3, :3])
    deviations = np.sqrt(np.diag(turn @ belief.covariance_of(DOWN) @ turn.T))
    assert deviations[2:5].max() < 2e-8
    assert deviations[[0, 1]].min() > 0.99e-3
    assert deviations[5] == pytest.approx(np.radians(0.2), rel=1e-3)


def test_the_order_of_touches_does_not_matter() -> None:
    E = displaced(np.array([0.3e-3, 0.5e-3, -0.9e-3, 2e-3, 3e-3, -1e-3]))
    touches = [touch_of(E, at, 5e-5) for at in around()] + [touch_of(E, (0.5, 0.1), 5e-5, off_m=3e-3)]
    prior = make_prior_estimate(UNKNOWN, 6, MIDDLE)
    first = prior.touch(*touches)
    assert [one.offset for one in first.refused] == [touches[3].offset]
    for order in permutations(touches):
        one_by_one = prior
        for touch in order:
            one_by_one = one_by_one.touch(touch)
        for belief in (prior.touch(*order), one_by_one):
            assert_allclose(belief.mean, first.mean, atol=1e-12)
            assert_allclose(belief.covariance, first.covariance, atol=1e-16)
            assert belief.refused == first.refused


def test_joints_are_told_through_the_jacobian() -> None:
    """Touches of a robot whose encoders alone are off: with its Jacobians the touched heights are explained."""
    rng = np.random.default_rng(4)
    delta = np.radians(0.05) * rng.standard_normal(6)
    prior = make_prior_estimate(Sigmas(joints_deg=0.05), 6, MIDDLE)
    touches = []
    for seed in range(8):
        B = pose.at(MIDDLE + rng.uniform(-0.2, 0.2, 3), (180.0, 0.0, rng.uniform(-180.0, 180.0)))
        n = np.eye(3)[seed % 3]
        touches.append(
            Touch(B, n, n @ (B @ pose.exp(jacobian(seed) @ delta))[:3, 3], np.zeros(3), 1e-7, jacobian(seed))
        )
    assert_allclose(prior.touch(*touches).mean[9:15], delta, atol=1e-6)
