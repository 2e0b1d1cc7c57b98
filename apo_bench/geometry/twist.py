"""Exponential map of SE(3) and its right Jacobian for many twists at once, by matrix polynomials."""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.pose import hat

_TERMS = 24
"""Terms of the series in the squared angle: exact to rounding for up to two whole turns."""
_SHORT = 9
"""The same for angles up to one radian."""


def _list_generators() -> Array:
    """The matrices of the six unit twists, (6, 4, 4)."""
    G = np.zeros((6, 4, 4))
    G[range(3), range(3), 3] = 1.0
    G[3:, :3, :3] = hat(np.eye(3)) + 0.0
    return G


def _list_adjoints() -> Array:
    """The adjoint matrices of the six unit twists, (6, 6, 6)."""
    G = np.zeros((6, 6, 6))
    G[3:, :3, :3] = G[3:, 3:, 3:] = G[:3, :3, 3:] = hat(np.eye(3)) + 0.0
    return G


def _list_series_coefficients() -> Array:
    """Coefficients of X^2 and X^3 in exp(X), and of ad, .., ad^4 in J_r, by powers of the squared angle q, (TERMS, 6).

    With x = -q: X^4 = x X^2, and odd powers of ad are ad^(2k+1) = k x^(k-1) ad^3 - (k-1) x^k ad. Even powers follow
    from these by multiplying by ad.
    """
    C = np.zeros((_TERMS, 6))
    for k in range(_TERMS):
        sign = (-1.0) ** k
        even = 1.0 / factorial(2 * k + 2)
        odd = 1.0 / factorial(2 * k + 3)
        C[k, :2] = sign * even, sign * odd
        C[k, 2:4] = (k - 1) * sign * even, -(k - 1) * sign * odd
        if k > 0:
            C[k - 1, 4:] = k * sign * even, -k * sign * odd
    return C


GENERATORS = _list_generators()
"""A twist xi is the matrix X = sum_i xi_i GENERATORS[i], (6, 4, 4)."""
_TO_MATRIX = np.ascontiguousarray(GENERATORS[:, :3].reshape(6, 12))
"""The first three rows of the generators, flattened: a twist times this is X without its zero row, (6, 12)."""
ADJOINTS = _list_adjoints()
"""The adjoint matrix of a twist xi is sum_i xi_i ADJOINTS[i], (6, 6, 6)."""
_TO_ADJOINT = ADJOINTS.reshape(6, 36)
"""The adjoints, flattened: a twist times this is its adjoint matrix, (6, 36)."""
_COEFFICIENTS = _list_series_coefficients()
"""Series coefficients, (TERMS, 6), from `_list_series_coefficients`."""
_ONE4 = np.eye(4)
_ONE6 = np.eye(6)
_SUM = np.ones(3)
"""Sums three components by a matrix product."""
_POWERS = np.arange(float(_TERMS))
"""Exponents of the squared angle."""


def compute_exp_and_jacobian(twist: ArrayLike) -> tuple[Array, Array]:
    """exp(xi), (*, 4, 4), and J_r in exp(xi + d) = exp(xi) exp(J_r d + O(d^2)), (*, 6, 6), of twists (*, 6).

    The adjoint matrix of a twist satisfies a polynomial of degree five, so four powers of it suffice (Bullo and Murray,
    "Proportional derivative (PD) control on the Euclidean group", 1995); exp(xi) = 1 + A^t X, with A the rotational
    block of J_r. Twists of more than two whole turns are beyond the series.
    """
    xi = np.asarray(twist, dtype=np.float64)
    lead = xi.shape[:-1]
    # The coefficients of the powers of ad are power series in the squared angle q.
    q = (xi[..., 3:] * xi[..., 3:]) @ _SUM
    series = _COEFFICIENTS[: _SHORT if (q < 1.0).all() else _TERMS]
    f = ((q[..., None] ** _POWERS[: len(series)]) @ series[:, 2:])[..., None, None]
    a, b, c, d = (f[..., i, :, :] for i in range(4))
    X = (xi @ _TO_MATRIX).reshape(*lead, 3, 4)
    ad = (xi @ _TO_ADJOINT).reshape(*lead, 6, 6)
    ad2 = ad @ ad
    # J_r = 1 + a ad + b ad^2 + c ad^3 + d ad^4, by two products of 6 x 6 matrices.
    J = a * ad + (b * _ONE6 + c * ad + d * ad2) @ ad2
    J += _ONE6
    # exp(X) = 1 + A^t X, A the upper left block of J_r.
    T = np.zeros((*lead, 4, 4))
    np.matmul(np.swapaxes(J[..., :3, :3], -1, -2), X, out=T[..., :3, :])
    T += _ONE4
    return T, J


def compute_right_jacobian(twist: ArrayLike) -> Array:
    """The right Jacobian J_r of `compute_exp_and_jacobian` alone, (*, 6) -> (*, 6, 6)."""
    return compute_exp_and_jacobian(twist)[1]
