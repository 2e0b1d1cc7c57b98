"""Convert between MuJoCo's rotations (nine numbers, or quaternions with w first) and poses, (4, 4)."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import Array


def frame(R: ArrayLike, position: ArrayLike) -> Array:
    """The pose of a rotation, (3, 3) or (9,), and a position, (3,); as (4, 4)."""
    T = np.zeros((4, 4))
    T[:3, :3] = np.asarray(R).reshape(3, 3)
    T[:3, 3] = position
    T[3, 3] = 1.0
    return T


def rotation(quaternion: Any) -> Array:
    """The rotation matrix, (9,), of a quaternion, w first."""
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R


def quaternion(T: Array) -> Array:
    """The rotation of a pose, (4, 4), or of a rotation matrix, (3, 3), as a quaternion, w first."""
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(T[:3, :3]).ravel())
    return q


def rotation_vector(R: Array) -> Array:
    """The rotation vector, (3,), [rad], of a rotation matrix, (3, 3); at most a half turn long."""
    vector = np.zeros(3)
    mujoco.mju_quat2Vel(vector, quaternion(R), 1.0)
    return vector


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors, (3,); `np.cross` is slow on a single pair."""
    product = np.zeros(3)
    mujoco.mju_cross(product, a, b)
    return product


def body_frame(data: Any, body: int) -> Array:
    """The world pose of a body, (4, 4)."""
    return frame(data.xmat[body], data.xpos[body])
