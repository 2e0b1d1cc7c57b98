"""Rigid poses, SE(3), as the paper writes them: 4 x 4 homogeneous matrices, [m].

`T_world_cube` takes cube coordinates to world coordinates, so neighbouring names cancel:
`T_world_table @ T_table_cube` is `T_world_cube`. A twist is `(x, y, z, rx, ry, rz)`, [m] and [rad], in the
body's own frame, and acts from the right: `T @ exp(twist)`. Leading axes broadcast.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from apo_bench.geometry.arrays import Array

FARTHEST_M = 1e4
"""Largest distance from the origin, [m]; beyond it rounding is no longer small."""
_IDENTITY = np.eye(4)
"""The identity pose."""
_NOT_ORTHOGONAL = 1e-6
"""Largest entry of R R^t - 1 of a rotation."""
_ROUNDING = 1e-9
"""A component of a quaternion closer to zero than this has no sign."""


def rigid(R: ArrayLike, t: ArrayLike) -> Array:
    """The pose with a rotation, (*, 3, 3), and a shift, (*, 3), [m] -> (*, 4, 4)."""
    R = np.asarray(R)
    T = np.zeros((*R.shape[:-2], 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def exp(twist: ArrayLike) -> Array:
    """The displacement a body twist makes, (*, 6) -> (*, 4, 4). A zero twist gives exactly the identity."""
    twist = np.asarray(twist, dtype=np.float64)
    K = hat(twist[..., 3:])
    # Rodrigues: R = 1 + A K + B K^2, and the shift is V v with V = 1 + B K + C K^2, A = sin a / a and so on.
    A, B, C = _rodrigues_coefficients(np.sqrt((twist[..., 3:] * twist[..., 3:]).sum(axis=-1))[..., None, None])
    K2 = K @ K
    one = _IDENTITY[:3, :3]
    V = one + B * K + C * K2
    return rigid(one + A * K + B * K2, (V @ twist[..., :3, None])[..., 0])


def log(T: ArrayLike) -> Array:
    """The shortest body twist that makes the displacement, (*, 4, 4) -> (*, 6); inverse of `exp`."""
    from scipy.spatial.transform import Rotation

    T = np.asarray(T, dtype=np.float64)
    w = Rotation.from_matrix(T[..., :3, :3].reshape(-1, 3, 3)).as_rotvec().reshape(*T.shape[:-2], 3)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    # V^-1 = 1 - K / 2 + D K^2 with D = (1 - a sin a / (2 (1 - cos a))) / a^2; near zero the series of D.
    near = angle < 1e-4
    a = np.where(near, 1.0, angle)
    D = np.where(near, 1 / 12 + angle**2 / 720, (1 - a * np.sin(a) / (2 * (1 - np.cos(a)))) / a**2)
    K = hat(w)
    v = ((np.eye(3) - K / 2 + D * K @ K) @ T[..., :3, 3, None])[..., 0]
    return np.concatenate([v, w], axis=-1)


def inverse(T: ArrayLike) -> Array:
    """The inverse displacement, (*, 4, 4) -> (*, 4, 4)."""
    T = np.asarray(T, dtype=np.float64)
    R_inverse = T[..., :3, :3].swapaxes(-1, -2)
    return rigid(R_inverse, -(R_inverse @ T[..., :3, 3, None])[..., 0])


def hat(w: ArrayLike) -> Array:
    """The cross-product matrix, (*, 3) -> (*, 3, 3)."""
    w = np.asarray(w, dtype=np.float64)
    out = np.zeros((*w.shape[:-1], 3, 3))
    out[..., 0, 1] = -w[..., 2]
    out[..., 0, 2] = w[..., 1]
    out[..., 1, 2] = -w[..., 0]
    return out - out.swapaxes(-1, -2)


def adjoint(T: ArrayLike) -> Array:
    """The matrix Ad in T exp(xi) T^-1 = exp(Ad xi), (*, 4, 4) -> (*, 6, 6)."""
    T = np.asarray(T, dtype=np.float64)
    R = T[..., :3, :3]
    out = np.zeros((*T.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    out[..., :3, 3:] = hat(T[..., :3, 3]) @ R
    return out


def at(position: ArrayLike, turn_deg: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """A pose from a position [m] and turns about the fixed x, then y, then z axis [degrees].

    Quarter turns are exact, so that parts that stand upright stand exactly upright.
    """
    rx, ry, rz = (
        _rotation_about_axis(axis, angle) for axis, angle in enumerate(np.asarray(turn_deg, dtype=np.float64))
    )
    return rigid(rz @ ry @ rx, position)


def turn_deg(T: ArrayLike) -> Array:
    """The turns about the fixed x, then y, then z axis of a pose (4, 4), (3,), [degrees]; inverse of `at`.

    Quarter turns are exact up to rounding. With y at 90 degrees x and z turn about one axis: z is 0.
    """
    # Of R = Rz Ry Rx the first column is (cos y cos z, cos y sin z, -sin y), the last row (-sin y, sin x cos y,
    # cos x cos y).
    R = np.asarray(T, dtype=np.float64)[:3, :3]
    down = float(np.hypot(R[0, 0], R[1, 0]))
    x = np.arctan2(R[2, 1], R[2, 2])
    y = np.arctan2(-R[2, 0], down)
    z = np.arctan2(R[1, 0], R[0, 0])
    if down <= 1e-9:
        x = np.arctan2(-R[1, 2], R[1, 1])
        z = 0.0
    turn = np.degrees([x, y, z])
    quarter = 90.0 * np.round(turn / 90.0)
    return np.where(np.abs(turn - quarter) < 1e-7, quarter, turn) + 0.0


def pack(T: ArrayLike) -> Array:
    """Poses as `(x, y, z, qw, qx, qy, qz)`, (*, 4, 4) -> (*, 7).

    Of q and -q, which are the same rotation, the one whose first component is positive is taken. Components that are
    zero up to rounding do not count, so a half turn has one sign however it was computed.
    """
    from scipy.spatial.transform import Rotation

    T = np.asarray(T, dtype=np.float64)
    q = Rotation.from_matrix(T[..., :3, :3].reshape(-1, 3, 3)).as_quat(scalar_first=True)
    # q and -q are one turn: the first component that is not zero up to rounding decides the sign; + 0.0 makes -0 a 0.
    first = np.argmax(np.abs(q) > _ROUNDING, axis=1)
    q = q * np.where(q[np.arange(len(q)), first] < 0.0, -1.0, 1.0)[:, None] + 0.0
    return np.concatenate([T[..., :3, 3], q.reshape(*T.shape[:-2], 4)], axis=-1)


def unpack(pose: ArrayLike) -> Array:
    """Inverse of `pack`, (*, 7) -> (*, 4, 4); the quaternion is normalised.

    Raises:
        ValueError: A quaternion is zero.
    """
    from scipy.spatial.transform import Rotation

    pose = np.asarray(pose, dtype=np.float64)
    R = Rotation.from_quat(pose[..., 3:].reshape(-1, 4), scalar_first=True).as_matrix()
    return rigid(R.reshape(*pose.shape[:-1], 3, 3), pose[..., :3])


def nearest_rotations(R: Array) -> Array:
    """The orthonormal matrices nearest to matrices, (n, 3, 3), in the sense of least squares.

    With R = U S V^t, U V^t minimises the sum of squared differences among all orthonormal matrices (Schoenemann, 1966).
    The determinant may be -1.
    """
    U, _, Vt = np.linalg.svd(R)
    return np.asarray(U @ Vt)


def is_rigid(T: ArrayLike) -> NDArray[np.bool_]:
    """Whether each matrix, (n, 4, 4), is a rigid displacement, not a reflection, (n,); False if a number is not
    finite.
    """
    T = np.asarray(T, dtype=np.float64)
    n = len(T)
    finite = np.isfinite(T).reshape(n, 16).all(axis=1)
    if not finite.all():
        T = np.where(finite[:, None, None], T, 0.0)
    R = T[:, :3, :3]
    orthogonal = np.abs(R @ np.swapaxes(R, 1, 2) - _IDENTITY[:3, :3]).reshape(n, 9).max(axis=1) < _NOT_ORTHOGONAL
    last_row = np.abs(T[:, 3] - _IDENTITY[3]).max(axis=1) < _NOT_ORTHOGONAL
    return np.asarray(finite & orthogonal & last_row & (np.linalg.det(R) > 0.0))


def apply(T: ArrayLike, points: ArrayLike) -> Array:
    """Points, (k, 3), transformed by one pose, (4, 4): (k, 3)."""
    T = np.asarray(T, dtype=np.float64)
    return np.asarray(points, dtype=np.float64) @ T[:3, :3].T + T[:3, 3]


def apply_all(T: ArrayLike, points: ArrayLike) -> Array:
    """Points, (k, 3), transformed by each of several poses, (n, 4, 4): (n, k, 3)."""
    T = np.asarray(T, dtype=np.float64)
    return np.asarray(points, dtype=np.float64) @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3]


def _rodrigues_coefficients(angle: Array) -> tuple[Array, Array, Array]:
    """sin(a)/a, (1-cos a)/a^2 and (a-sin a)/a^3, also at zero."""
    # Below 1e-4 two terms of each series are exact to rounding, where the quotients lose digits.
    near = angle < 1e-4
    a = np.where(near, 1.0, angle)
    A = np.where(near, 1.0 - angle**2 / 6, np.sin(a) / a)
    B = np.where(near, 0.5 - angle**2 / 24, (1 - np.cos(a)) / a**2)
    C = np.where(near, 1 / 6 - angle**2 / 120, (a - np.sin(a)) / a**3)
    return A, B, C


def _rotation_about_axis(axis: int, degrees: float) -> Array:
    """The rotation about axis 0, 1 or 2 (x, y, z), (3, 3); exact for multiples of 90 degrees."""
    quarter = round(degrees / 90.0)
    if degrees == 90.0 * quarter:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    else:
        c = np.cos(np.radians(degrees))
        s = np.sin(np.radians(degrees))
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = c
    R[i, j] = -s
    R[j, i] = s
    return R
