"""Noise of a camera whose position errors are larger along its line of sight."""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import (
    CAMERA_AZIMUTH_DEG,
    CAMERA_DISTANCE_M,
    CAMERA_ELEVATION_DEG,
    WORKSPACE_MIDDLE_M,
    Camera,
)
from apo_bench.perception.observation.models.displacement import displace_poses, observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

ALONG_SIGHT = 3.0
"""Factor on the level: position along the line of sight."""
ACROSS_SIGHT = 0.5
"""Factor on the level: position across the line of sight."""
OUT_OF_IMAGE = 2.0**0.5
"""Factor on the level: rotation about axes in the image plane."""
IN_IMAGE = 0.5
"""Factor on the level: rotation about the line of sight."""


@final
@dataclass(frozen=True)
class AnisotropicNoise:
    """Gaussian noise with principal axes along and across one line of sight, which is fixed in the world.

    A camera measures depth less well than the position in the image, and tilts out of the image less well than
    rotations in it. The geometric means of the factors are 0.91 for positions and 1 for rotations, comparable with
    `isotropic`; the root mean square of a position is 1.8 times as large.

    The covariance in the body frame is R^t S R, with S fixed in the world and R the observed rotation. It is exact: a
    rotation keeps its own axis, so it is drawn first, and the position is drawn in the observed frame.
    """

    noise_level: NoiseLevel

    FACTS: ClassVar[Facts] = Facts(
        title="worse along one line of sight, the same for all parts",
        formula=(
            "T_obs = T exp(xi), xi = (R_obs^t S1 e, R^t S2 e')",
            f"S1 = L ({ACROSS_SIGHT:g} (I - s s^t) + {ALONG_SIGHT:g} s s^t)",
            f"S2 = L ({OUT_OF_IMAGE:.3g} (I - s s^t) + {IN_IMAGE:g} s s^t)",
        ),
        frame="of the world, in which the line of sight s is fixed",
        parameters=(
            f"s = down from {CAMERA_ELEVATION_DEG:g} deg above the table, {CAMERA_AZIMUTH_DEG:g} deg from the x axis",
            f"{ALONG_SIGHT:g} and {ACROSS_SIGHT:g}: position over the level, along s and across it",
            f"{OUT_OF_IMAGE:.3g} and {IN_IMAGE:g}: turn over the level, about axes across s and about s",
        ),
        states="R^t S S R with the observed R, exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        # First the rotation, w = R^t S2 e'; then the shift in the observed frame, R_obs^t S1 e.
        sight = get_line_of_sight()
        unit = rng.standard_normal((len(assembly), 6))
        place = self.noise_level.mm * 1e-3 * _scaling_along(sight, ALONG_SIGHT, ACROSS_SIGHT)
        turn = np.radians(self.noise_level.deg) * _scaling_along(sight, IN_IMAGE, OUT_OF_IMAGE)
        rotation = np.zeros((len(assembly), 6))
        rotation[:, 3:] = np.einsum("nji,nj->ni", demonstration.poses[:, :3, :3], unit[:, 3:] @ turn)
        R = (demonstration.poses @ pose.exp(rotation))[:, :3, :3]
        xi = np.concatenate([np.einsum("nji,nj->ni", R, unit[:, :3] @ place), rotation[:, 3:]], axis=1)
        covariance = np.zeros((len(assembly), 6, 6))
        covariance[:, :3, :3] = _to_body_frame(R, place @ place)
        covariance[:, 3:, 3:] = _to_body_frame(R, turn @ turn)
        return observe_displaced(assembly, demonstration, xi, covariance)


@final
@dataclass(frozen=True, eq=False)
class CameraNoise:
    """Gaussian noise with principal axes along and across the camera ray to each part.

    The factors on the level are those of `anisotropic`, whose rays are parallel as for a camera at infinity. Rays of a
    camera 0.9 m away to parts half a metre apart differ by some 30 degrees.
    """

    noise_level: NoiseLevel
    camera: Camera = field(default_factory=Camera)
    across: float = ACROSS_SIGHT
    """Factor on the level: position across the ray, per axis."""
    along: float = ALONG_SIGHT
    """Factor on the level: position along the ray."""
    tilt: float = OUT_OF_IMAGE
    """Factor on the level: rotation about axes across the ray, per axis."""
    about: float = IN_IMAGE
    """Factor on the level: rotation about the ray."""

    FACTS: ClassVar[Facts] = Facts(
        title="a camera at a place: errors along, across and about the ray to each part",
        formula=(
            "T_obs = T exp(xi), xi = (R_obs^t F d, R^t F w)",
            f"d = L ({ACROSS_SIGHT:g} e1, {ACROSS_SIGHT:g} e2, {ALONG_SIGHT:g} e3), w = L ({OUT_OF_IMAGE:.3g} e4, "
            f"{OUT_OF_IMAGE:.3g} e5, {IN_IMAGE:g} e6)",
        ),
        frame="F of the ray from the camera to the origin of the part: the axes of the camera (OpenCV), turned the "
        "shortest way until z is the ray",
        parameters=(
            f"camera = {CAMERA_DISTANCE_M:g} m from ({', '.join(f'{x:g}' for x in WORKSPACE_MIDDLE_M)}) m in the "
            f"world, at which it looks, {CAMERA_ELEVATION_DEG:g} deg above the table and {CAMERA_AZIMUTH_DEG:g} deg "
            "from the x axis",
            f"across = {ACROSS_SIGHT:g}, along = {ALONG_SIGHT:g}: of the position over the level, per axis",
            f"tilt = {OUT_OF_IMAGE:.3g}, about = {IN_IMAGE:g}: of the turn over the level, per axis out of the image, "
            "and in it",
        ),
        states="the covariance in the frame of the observed ray, turned into the part; the angle between that and "
        "the true ray is a thousandth at 1 mm",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        mm = self.noise_level.mm * 1e-3
        rad = np.radians(self.noise_level.deg)
        sigma = np.array([mm * self.across] * 2 + [mm * self.along] + [rad * self.tilt] * 2 + [rad * self.about])
        xi = self.camera.twists(demonstration.poses, rng.standard_normal((len(assembly), 6)) * sigma)
        stated = self.camera.covariance(displace_poses(demonstration.poses, xi), np.diag(sigma**2))
        return observe_displaced(assembly, demonstration, xi, stated)


def get_line_of_sight() -> Array:
    """Unit vector (3,), world frame, of the optical axis of the default camera, obliquely down."""
    return Camera().T_world_camera[:3, 2]


def _scaling_along(axis: Array, along: float, across: float) -> Array:
    """The symmetric matrix (3, 3) that scales by these factors along a unit vector and across it."""
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)


def _to_body_frame(R: Array, S: Array) -> Array:
    """R^t S R for rotations (n, 3, 3) and one matrix (3, 3); made exactly symmetric."""
    turned = np.einsum("nji,jk,nkl->nil", R, S, R)
    return np.asarray((turned + np.swapaxes(turned, 1, 2)) / 2)
