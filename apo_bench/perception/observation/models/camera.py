"""A camera: the frames of the rays from it to the parts.

The camera's axes are those of OpenCV: x to the right, y down, z along the optical axis. The frame of a ray is that of
the camera, turned the shortest way so that its third axis is the ray: errors in it are (x, y, along; rx, ry, about).
"""

from dataclasses import dataclass, field
from typing import final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, copy_frozen, is_rigid, pose

WORKSPACE_MIDDLE_M = copy_frozen([0.12, 0.0, 0.03], 3)
"""What the default camera looks at, in the world, [m]: the middle of where assemblies stand on the table."""
CAMERA_DISTANCE_M = 0.9
CAMERA_ELEVATION_DEG = 40.0
CAMERA_AZIMUTH_DEG = 25.0
"""How far from there it stands, how high above the table, and how far from the x axis of the world."""
_BEHIND = 1e-9
"""A ray whose cosine with the optical axis is this near to -1 has no shortest turn."""


def _default_pose() -> Array:
    """T_world_camera of the default camera, (4, 4): obliquely from above, its x axis level."""
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
        """Unit vectors (n, 3) from the camera to the origin of each part, world frame; on its very place, the axis."""
        to = poses[:, :3, 3] - self.T_world_camera[:3, 3]
        length = np.linalg.norm(to, axis=1, keepdims=True)
        return np.where(length > 0.0, to / np.where(length > 0.0, length, 1.0), self.T_world_camera[:3, 2])

    def frames(self, poses: Array) -> Array:
        """The frames of the rays, (n, 3, 3), world from ray: the third column is the ray."""
        R = self.T_world_camera[:3, :3]
        # The shortest turn from z to the ray r is about k = z x r, with |k| = sin and r_z = cos: Rodrigues' formula
        # I + K + K^2 (1 - cos) / sin^2, where (1 - cos) / sin^2 = 1 / (1 + cos).
        ray = self.rays(poses) @ R
        K = pose.hat(np.stack([-ray[:, 1], ray[:, 0], np.zeros(len(ray))], axis=1))
        cosine = ray[:, 2, None, None]
        behind = cosine < _BEHIND - 1.0
        shortest = np.eye(3) + K + K @ K / np.where(behind, 1.0, 1.0 + cosine)
        return np.asarray(R @ np.where(behind, np.diag([1.0, -1.0, -1.0]), shortest))

    def twists(self, poses: Array, errors: Array) -> Array:
        """Body twists (n, 6) of errors that are given in the frames of the rays.

        Turn first, then shift in the frame that is observed: xi = (R_obs^t F d, R^t F w), R_obs = R exp(R^t F w). The
        twist is thus linear in the error, and with covariance S in the frame of the ray its own is exactly that of
        `covariance` for that ray, since a turn leaves its own axis where it is.

        Args:
            poses: (n, 4, 4), where the parts are, world frame, [m].
            errors: (n, 6), (x, y, along; rx, ry, about), [m, rad].
        """
        frames = self.frames(poses)
        turn = np.zeros((len(poses), 6))
        turn[:, 3:] = np.einsum("nji,njk,nk->ni", poses[:, :3, :3], frames, errors[:, 3:])
        R_obs = (poses @ pose.exp(turn))[:, :3, :3]
        shift = np.einsum("nji,njk,nk->ni", R_obs, frames, errors[:, :3])
        return np.concatenate([shift, turn[:, 3:]], axis=1)

    def covariance(self, seen: Array, errors: Array) -> Array:
        """The body covariance (n, 6, 6) of errors whose covariance in the frames of the rays is known.

        Computed for the rays on which parts are observed, so that nothing of the truth is in it. Those differ from the
        true ones by the error across over the distance, a thousandth for a millimetre.

        Args:
            seen: (n, 4, 4), where the parts are observed, world frame, [m].
            errors: (6, 6) or (n, 6, 6), of (x, y, along; rx, ry, about), [m, rad].
        """
        turned = np.swapaxes(seen[:, :3, :3], 1, 2) @ self.frames(seen)
        Q = np.zeros((len(seen), 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = turned
        C = Q @ errors @ np.swapaxes(Q, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)
