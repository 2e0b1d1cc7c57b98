"""Errors that operations share: their joint covariance is the one of errors that are drawn so."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench.assembly import SharedError, compute_joint_covariance, correlate_first_order
from apo_bench.geometry import pose
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from tests import scenes

GOALS = np.array(
    [
        pose.at((0.1, 0.02, 0.0), (20.0, -35.0, 70.0)),
        pose.at((0.2, -0.05, 0.03), (0.0, 15.0, -160.0)),
        pose.at((0.15, 0.1, 0.2), (90.0, 0.0, 45.0)),
    ]
)
C = np.diag(np.repeat([2e-3, 0.03], 3) ** 2)
P = pose.at((0.3, -0.1, 0.8), (160.0, 10.0, 25.0))


def test_what_is_shared_stands_beside_the_diagonal() -> None:
    own = np.tile(np.diag(np.repeat([1e-3, 0.01], 3) ** 2), (3, 1, 1))
    camera = SharedError("camera", (0, 2), C, P)
    stated = own.copy()
    stated[[0, 2]] += camera.covariances(GOALS)
    joint = compute_joint_covariance(GOALS, stated, [camera]).reshape(3, 6, 3, 6)
    A = camera.jacobians(GOALS)
    assert_allclose(joint[0, :, 2], A[0] @ C @ A[1].T, atol=1e-18)
    assert not joint[1, :, [0, 2]].any()
    assert_allclose(joint[np.arange(3), :, np.arange(3)], stated, atol=1e-18)
    drift = SharedError("drift", (0, 1, 2), C, correlation=correlate_first_order(3, 0.9))
    joint = compute_joint_covariance(GOALS, own + C, [drift]).reshape(3, 6, 3, 6)
    assert_allclose(joint[0, :, 2], 0.81 * C, atol=1e-18)


@pytest.mark.parametrize("name", ["bias-view", "correlated"])
def test_models_state_the_joint_covariance_of_what_they_draw(name: str) -> None:
    """Over 600 seeds, squared lengths of all errors together are chi-square of 6 n degrees of freedom."""
    scene = scenes.subassembly_on_castles()
    noise = make_noise(name, NoiseLevel(2.0, 2.0))
    shown = scenes.shown(scene)
    square = []
    for seed in range(600):
        seen = noise(shown.assembly, shown, np.random.default_rng(seed))
        xi = pose.log(pose.inverse(seen.poses) @ shown.poses).ravel()
        joint = compute_joint_covariance(seen.poses, seen.covariance, seen.shared)
        square.append(xi @ np.linalg.solve(joint, xi))
    freedom = 6 * len(scene.nominal_poses)
    assert np.mean(square) == pytest.approx(freedom, abs=5 * np.sqrt(2 * freedom / 600) + 0.02 * freedom)
    assert np.var(square) == pytest.approx(2 * freedom, rel=0.25)
