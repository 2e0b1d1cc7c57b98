"""Group laws of poses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench.geometry import Array, is_rigid, pose

pytestmark = pytest.mark.numeric

SHAPES = [(), (3, 1, 2)]
SCALES = [0.0, 1e-9, 1e-5, 1e-3, 1.0, 3.0]


def twists(shape: tuple[int, ...], angle: float, seed: int = 0) -> Array:
    """Twists with rotations of exactly that angle [rad]."""
    xi = np.random.default_rng(seed).standard_normal((*shape, 6))
    xi[..., 3:] *= angle / np.linalg.norm(xi[..., 3:], axis=-1, keepdims=True)
    return xi


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("angle", SCALES)
def test_log_inverts_exp(shape: tuple[int, ...], angle: float) -> None:
    xi = twists(shape, angle)
    assert_allclose(pose.log(pose.exp(xi)), xi, atol=1e-9)


@pytest.mark.parametrize("angle", SCALES)
def test_exp_is_the_matrix_exponential(angle: float) -> None:
    from scipy.linalg import expm

    xi = twists((), angle)
    generator = np.zeros((4, 4))
    generator[:3, :3] = pose.hat(xi[3:])
    generator[:3, 3] = xi[:3]
    assert_allclose(pose.exp(xi), expm(generator), atol=1e-12)


@given(st.integers(0, 10**6), st.floats(0.0, 3.1), st.floats(0.0, 3.1))
@settings(max_examples=40, deadline=None)
def test_group_laws(seed: int, a: float, b: float) -> None:
    A = pose.exp(twists((), a, seed))
    B = pose.exp(twists((), b, seed + 1))
    assert_allclose(A @ pose.inverse(A), np.eye(4), atol=1e-12)
    assert_allclose(pose.inverse(A @ B), pose.inverse(B) @ pose.inverse(A), atol=1e-12)
    assert_allclose(pose.exp(-twists((), a, seed)), pose.inverse(A), atol=1e-12)
    assert is_rigid((A @ B)[None]).all()


def test_the_adjoint_takes_a_twist_to_another_frame() -> None:
    """T exp(xi) T^-1 = exp(Ad xi), for several T at once."""
    rng = np.random.default_rng(0)
    T = pose.exp(rng.standard_normal((4, 6)))
    xi = rng.standard_normal((4, 6))
    there = (pose.adjoint(T) @ xi[..., None])[..., 0]
    assert_allclose(T @ pose.exp(xi) @ pose.inverse(T), pose.exp(there), atol=1e-12)
    assert_allclose(pose.adjoint(T[0] @ T[1]), pose.adjoint(T[0]) @ pose.adjoint(T[1]), atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_pack_round_trip(shape: tuple[int, ...]) -> None:
    T = pose.exp(twists(shape, 2.5))
    packed = pose.pack(T)
    assert packed.shape == (*shape, 7)
    assert (packed[..., 3] >= 0).all()
    assert_allclose(pose.unpack(packed), T, atol=1e-12)


@pytest.mark.parametrize("T", [np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, 1.0, 1.1, 1.0]), np.full((4, 4), np.nan)])
def test_what_is_not_rigid(T: Array) -> None:
    assert not is_rigid(T[None]).any()
