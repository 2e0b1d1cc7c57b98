"""The exponential as a matrix polynomial and its derivative: against the closed form and the series."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench.geometry import Array, compute_exp_and_jacobian, compute_right_jacobian, pose

pytestmark = pytest.mark.numeric

SEEDS = st.integers(0, 10**6)
ANGLES = st.one_of(st.floats(0.0, 6.0), st.floats(-12, -1).map(lambda power: 10.0**power), st.just(np.pi))


def twist(seed: int, angle: float) -> Array:
    """A twist of this angle, any axis, half a metre long at most."""
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    return np.concatenate([rng.uniform(-0.3, 0.3, 3), angle * axis / np.linalg.norm(axis)])


def ad(xi: Array) -> Array:
    """The matrix of [xi, .], written down from the Lie bracket."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = pose.hat(xi[3:])
    out[:3, 3:] = pose.hat(xi[:3])
    return out


@given(SEEDS, ANGLES)
@settings(max_examples=60, deadline=None)
def test_the_exponential_is_that_of_poses(seed: int, angle: float) -> None:
    """Just above 1e-4 rad, 1 - cos in `pose.exp` keeps 1e-16 of 5e-9: up to 1.1e-12 of the length that is moved."""
    xi = twist(seed, angle)
    assert_allclose(compute_exp_and_jacobian(xi)[0], pose.exp(xi), rtol=0, atol=2e-12)


@given(SEEDS, ANGLES)
@settings(max_examples=50, deadline=None)
def test_the_jacobian_is_its_power_series(seed: int, angle: float) -> None:
    xi = twist(seed, angle)
    minus = -ad(xi)
    power = np.eye(6)
    series = np.zeros((6, 6))
    for k in range(60):
        series = series + power / factorial(k + 1)
        power = power @ minus
    assert_allclose(compute_right_jacobian(xi), series, rtol=0, atol=1e-12)
