"""The most probable unknowns: those of the least squares as another solver has them, and which touches are refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from apo_bench.correction.calibration import Touch
from apo_bench.correction.calibration.robot_model import Places, compute_part_poses
from apo_bench.correction.calibration.robust_estimate import NumberedTouch, robust_estimate
from apo_bench.geometry import Array, pose

pytestmark = pytest.mark.numeric

JOINTS = 6
MIDDLE = np.array([0.5, 0.0, 0.0])
SIGMAS = np.concatenate([np.repeat([1e-3, 3e-3], 3), [5e-4] * 3, [1e-3] * 6, [0.0, 5e-4, 5e-4, 0.02, 0.0, 0.0]])
SIGMA_M = 5e-5


def felt(rng: np.random.Generator, truth: Array, n: int) -> tuple[NumberedTouch, ...]:
    """Touches of planes of any normal, half of them with a part in the hand."""
    touches = []
    for i in range(n):
        normal = rng.standard_normal(3)
        normal /= np.linalg.norm(normal)
        B = pose.at(MIDDLE + rng.uniform(-0.2, 0.2, 3), rng.uniform(-180.0, 180.0, 3))
        J = rng.uniform(-0.5, 0.5, (6, JOINTS))
        held = pose.at(rng.uniform(-0.03, 0.03, 3), rng.uniform(-180.0, 180.0, 3))
        grasp = (0, held) if i % 2 else (None, None)
        v = rng.uniform(-0.05, 0.05, 3)
        touch = Touch(B, normal, 0.0, v, SIGMA_M, J, *grasp)
        one = NumberedTouch(touch, 0 if i % 2 else -1)
        touches.append(moved(one, heights([one], truth)[0] + SIGMA_M * rng.standard_normal()))
    return tuple(touches)


def heights(felt: Sequence[NumberedTouch], unknowns: Array) -> Array:
    """How far above its plane the point of each touch is, (t,)."""
    held = [np.eye(4) if t.T_tip_part is None else t.T_tip_part for t, _ in felt]
    jacobians = [t.jacobian for t, _ in felt]
    tips = [t.T_world_tip for t, _ in felt]
    places = Places(*map(np.array, (tips, jacobians, held, [grasp for _, grasp in felt])))
    T = compute_part_poses(unknowns, MIDDLE, places)[0]
    return np.array(
        [t.normal @ (Ti[:3, :3] @ t.point + Ti[:3, 3]) - t.offset for Ti, (t, _) in zip(T, felt, strict=True)]
    )


def moved(one: NumberedTouch, by_m: float) -> NumberedTouch:
    t = one.touch
    return NumberedTouch(
        Touch(t.T_world_tip, t.normal, t.offset + by_m, t.point, t.sigma_m, t.jacobian, t.grasp, t.T_tip_part),
        one.grasp,
    )


@settings(deadline=None, max_examples=5)
@given(seed=st.integers(0, 10**6), times=st.sampled_from([1.0, 20.0]), n=st.integers(1, 12))
def test_it_is_the_least_squares_of_another_solver(seed: int, times: float, n: int) -> None:
    """Also where a robot is twenty times as wrong as any is."""
    rng = np.random.default_rng(seed)
    sigmas = times * SIGMAS
    touches = felt(rng, sigmas * rng.standard_normal(len(SIGMAS)), n)

    def residuals(z: Array) -> Array:
        return np.concatenate([heights(touches, sigmas * z) / SIGMA_M, z])

    mean, covariance, taken = robust_estimate(touches, sigmas, JOINTS, MIDDLE)
    other = least_squares(residuals, np.zeros(len(sigmas)), jac="3-point", xtol=1e-12, ftol=1e-12, gtol=1e-9)
    assert taken.all()
    # In prior standard deviations; the other solver has its derivatives from differences.
    free = np.flatnonzero(sigmas)
    assert_allclose(mean[free] / sigmas[free], other.x[free], atol=1e-5)
    information = other.jac.T @ other.jac
    units = np.outer(sigmas, sigmas)[np.ix_(free, free)]
    assert_allclose(covariance[np.ix_(free, free)] / units, np.linalg.inv(information[np.ix_(free, free)]), atol=1e-5)
    exact = sigmas == 0.0
    assert not mean[exact].any()
    assert not covariance[exact].any()


@settings(deadline=None, max_examples=3)
@given(seed=st.integers(0, 10**6), by_mm=st.sampled_from([-50.0, -20.0, 20.0, 50.0]), wrong=st.integers(0, 11))
def test_a_touch_of_something_else_bends_nothing(seed: int, by_mm: float, wrong: int) -> None:
    """20 mm are more than five standard deviations of what the priors alone foretell of any touch here."""
    rng = np.random.default_rng(seed)
    touches = felt(rng, SIGMAS * rng.standard_normal(len(SIGMAS)), 12)
    bent = tuple(moved(one, 1e-3 * by_mm) if i == wrong else one for i, one in enumerate(touches))
    mean, covariance, taken = robust_estimate(bent, SIGMAS, JOINTS, MIDDLE)
    assert taken.tolist() == [i != wrong for i in range(12)]
    rest = robust_estimate(touches[:wrong] + touches[wrong + 1 :], SIGMAS, JOINTS, MIDDLE)
    assert_allclose(mean, rest.mean, atol=1e-12)
    assert_allclose(covariance, rest.covariance, atol=1e-15)


def above(at: tuple[float, float], height_m: float) -> NumberedTouch:
    """The hand touched a table at z = 0 when the robot believed its tip at this height."""
    return NumberedTouch(Touch(pose.at((*at, height_m)), (0.0, 0.0, 1.0), 0.0, (0.0, 0.0, 0.0), SIGMA_M), -1)


def test_a_refused_touch_counts_once_others_agree() -> None:
    """A robot that is more wrong than is stated: the second touch says that the first one was right."""
    far = [above((0.5, 0.0), 8e-3), above((0.51, 0.0), 8.1e-3)]
    assert robust_estimate((far[0],), SIGMAS, JOINTS, MIDDLE).taken.tolist() == [False]
    assert robust_estimate(tuple(far), SIGMAS, JOINTS, MIDDLE).taken.tolist() == [True, True]
