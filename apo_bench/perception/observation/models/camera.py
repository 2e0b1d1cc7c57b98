"""A camera of a noise model: the frames of its rays to the parts, and errors stated in these frames.

The camera's axes are those of OpenCV: x to the right, y down, z along the optical axis. The frame of a ray is that of
the camera after the smallest rotation that takes z to the ray. Errors in it are (x, y, along; rx, ry, about).
"""

from dataclasses import dataclass, field
from typing import final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, copy_frozen, is_rigid, pose

WORKSPACE_MIDDLE_M = copy_frozen([0.12, 0.0, 0.03], 3)
"""The point that the default camera looks at, world, [m]: the middle of the area of assemblies on the table."""
CAMERA_DISTANCE_M = 0.9
"""Distance of the default camera from that point."""
CAMERA_ELEVATION_DEG = 40.0
"""Its elevation above the table."""
CAMERA_AZIMUTH_DEG = 25.0
"""Its azimuth from the x axis of the world."""
_LEAST_COSINE = 1e-9
"""A ray whose cosine with the optical axis is this near to -1 has no unique smallest rotation."""


def _default_pose() -> Array:
    """T_world_camera (4, 4) of the default camera, which looks obliquely down; its x axis is horizontal, [m]."""
    up = np.radians(CAMERA_ELEVATION_DEG)
    round_z = np.radians(CAMERA_AZIMUTH_DEG)
    z = -np.array([np.cos(up) * np.cos(round_z), np.cos(up) * np.sin(round_z), np.sin(up)])
    x = np.array([-np.sin(round_z), np.cos(round_z), 0.0])
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = WORKSPACE_MIDDLE_M - CAMERA_DISTANCE_M * z
    return T


@final
@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: its pose in the world, and the rays from it to the parts."""

    T_world_camera: Array = field(default_factory=_default_pose)
    """(4, 4), axes of OpenCV, [m]."""

    def __post_init__(self) -> None:
        T = copy_frozen(self.T_world_camera, 4, 4)
        require(
            is_rigid(T[None])[0],
            "the pose of a camera was given that is not rigid; give a rotation and a place in metres.",
        )
        object.__setattr__(self, "T_world_camera", T)

    def rays(self, poses: Array) -> Array:
        """Unit vectors (n, 3), world frame, from the camera to the origins of poses (n, 4, 4).

        For an origin at the camera itself it is the optical axis.
        """
        to = poses[:, :3, 3] - self.T_world_camera[:3, 3]
        length = np.linalg.norm(to, axis=1, keepdims=True)
        return np.where(length > 0.0, to / np.where(length > 0.0, length, 1.0), self.T_world_camera[:3, 2])

    def frames(self, poses: Array) -> Array:
        """Rotations (n, 3, 3) from the frames of the rays to the world; the third column is the ray."""
        R = self.T_world_camera[:3, :3]
        # The shortest turn from z to the ray r is about k = z x r, with |k| = sin and r_z = cos: Rodrigues' formula
        # I + K + K^2 (1 - cos) / sin^2, where (1 - cos) / sin^2 = 1 / (1 + cos).
        ray = self.rays(poses) @ R
        K = pose.hat(np.stack([-ray[:, 1], ray[:, 0], np.zeros(len(ray))], axis=1))
        cosine = ray[:, 2, None, None]
        behind = cosine < _LEAST_COSINE - 1.0
        shortest = np.eye(3) + K + K @ K / np.where(behind, 1.0, 1.0 + cosine)
        return np.asarray(R @ np.where(behind, np.diag([1.0, -1.0, -1.0]), shortest))

    def twists(self, poses: Array, errors: Array) -> Array:
        """Body twists (n, 6) of errors that are stated in the frames of the rays.

        The rotation comes first, then the shift in the observed frame: xi = (R_obs^t F d, R^t F w), with
        R_obs = R exp(R^t F w). So the twist is linear in the error. Its covariance is exactly that of `covariance` for
        the same ray, since a rotation keeps its own axis.

        Args:
            poses: (n, 4, 4), true poses, world frame, [m].
            errors: (n, 6), (x, y, along; rx, ry, about), [m, rad].
        """
        frames = self.frames(poses)
        turn = np.zeros((len(poses), 6))
        turn[:, 3:] = np.einsum("nji,njk,nk->ni", poses[:, :3, :3], frames, errors[:, 3:])
        R_obs = (poses @ pose.exp(turn))[:, :3, :3]
        shift = np.einsum("nji,njk,nk->ni", R_obs, frames, errors[:, :3])
        return np.concatenate([shift, turn[:, 3:]], axis=1)

    def covariance(self, seen: Array, errors: Array) -> Array:
        """The covariance (n, 6, 6) of body twists, for a covariance stated in the frames of the rays.

        It uses the rays to the observed poses, so it contains nothing of the truth. They differ from the true rays by
        the error across over the distance, about a thousandth for a millimetre.

        Args:
            seen: (n, 4, 4), observed poses, world frame, [m].
            errors: (6, 6) or (n, 6, 6), covariance of (x, y, along; rx, ry, about), [m, rad].
        """
        turned = np.swapaxes(seen[:, :3, :3], 1, 2) @ self.frames(seen)
        Q = np.zeros((len(seen), 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = turned
        C = Q @ errors @ np.swapaxes(Q, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)
