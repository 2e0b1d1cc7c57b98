"""Draws of stated tails have the covariance and the tails that are stated."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench.assembly import Tails
from apo_bench.geometry import pose

FRAMES = np.array([pose.at((0.0, 0.0, 0.0), turn)[:3, :3] for turn in ((20.0, -30.0, 70.0), (0.0, 90.0, 10.0))])
SCALES = np.array([1e-3, 4e-3, 0.02, 0.01])
FREEDOM = np.array([5.0, 8.0, 1e9, 6.0])
TAILS = Tails(FRAMES, SCALES, FREEDOM, SCALES**2 * FREEDOM / (FREEDOM - 2.0), np.array([1e6, 1e6]))


def joint(tails: Tails, more: float = 1.0) -> np.ndarray:
    Q = np.zeros((12, 12))
    for k in range(2):
        for row in (0, 3):
            Q[6 * k + row : 6 * k + row + 3, 6 * k + row : 6 * k + row + 3] = tails.frames[k]
    own = Q @ np.diag(np.tile(tails.variances[[0, 0, 1, 2, 2, 3]], 2)) @ Q.T
    shared = np.tile(np.diag(np.repeat([1e-3, 0.01], 3) ** 2), (2, 2))
    return own * more + shared


def test_the_covariance_is_the_stated_one_and_draws_are_always_the_same() -> None:
    """More is stated than the tails: the rest, some of it shared by both operations, is Gaussian."""
    stated = joint(TAILS, 1.5)
    xi = TAILS.draws(stated, 40_000)
    assert_array_equal(xi, TAILS.draws(stated, 40_000))
    found = np.cov(xi.reshape(-1, 12).T)
    size = np.sqrt(np.diag(stated))
    assert_allclose(found / np.outer(size, size), stated / np.outer(size, size), atol=0.06)


def test_tails_are_those_of_student_in_their_own_directions() -> None:
    """The fourth moment of Student t is 3 (nu - 2) / (nu - 4) times the square of the second."""
    nu = 9.0
    heavy = Tails(FRAMES, SCALES, np.full(4, nu), SCALES**2 * nu / (nu - 2.0), np.array([1e6, 1e6]))
    e = np.einsum("kji,mkj->mki", FRAMES, heavy.draws(np.zeros((12, 12)), 100_000)[..., :3])
    for column in range(3):
        x = e[:, :, column].ravel()
        assert np.var(x) == pytest.approx(heavy.variances[0 if column < 2 else 1], rel=0.03)
        assert np.mean(x**4) / np.var(x) ** 2 == pytest.approx(3.0 * (nu - 2.0) / (nu - 4.0), rel=0.25)


def test_no_error_is_longer_than_the_limit_and_joined_ones_are_large_together() -> None:
    near = Tails(FRAMES, SCALES, np.full(4, 1.0), SCALES**2, np.array([5e-3, 0.05]))
    own = np.zeros((12, 12))
    xi = near.draws(own, 5000)
    assert np.linalg.norm(xi[..., :3], axis=2).max() <= 5e-3 * (1.0 + 1e-9)
    assert np.linalg.norm(xi[..., 3:], axis=2).max() <= 0.05 * (1.0 + 1e-9)

    def together(joined: bool) -> float:
        made = Tails(FRAMES, SCALES, np.full(4, 6.0), SCALES**2 * 1.5, np.array([1e6, 1e6]), joined).draws(own, 20_000)
        shift, turn = (np.log(np.linalg.norm(made[..., half], axis=2)).ravel() for half in (slice(0, 3), slice(3, 6)))
        return float(np.corrcoef(shift, turn)[0, 1])

    assert together(True) > 0.15 > 0.05 > abs(together(False))
