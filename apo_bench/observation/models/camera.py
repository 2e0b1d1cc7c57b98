"""A camera, and errors along and across the rays on which it sees parts.

The camera's axes are those of OpenCV: x to the right, y down, z along the optical axis. The frame of a ray is that of
the camera, turned the shortest way so that its third axis is the ray: errors in it are (x, y, along; rx, ry, about).

Noise of a camera that is worse along its line of sight: infinitely far away, or at a place of its own.
"""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, frozen, is_rigid, pose
from apo_bench.observation.models.isotropic import Facts, Level, displaced, observe_displaced

WORKSPACE_MIDDLE_M = frozen([0.12, 0.0, 0.03], 3)
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
    """A camera: its pose in the world, and the rays on which it sees parts."""

    T_world_camera: Array = field(default_factory=_default_pose)
    """(4, 4), axes of OpenCV, [m]."""

    def __post_init__(self) -> None:
        try:
            T = frozen(self.T_world_camera, 4, 4)
        except (TypeError, ValueError) as error:
            raise InputError(f"the pose of a camera was given as something else: {error}.") from error
        require(
            is_rigid(T[None])[0],
            "the pose of a camera was given that is not rigid; give a rotation and a place in metres.",
        )
        object.__setattr__(self, "T_world_camera", T)

    def rays(self, goals: Array) -> Array:
        """Unit vectors (n, 3) from the camera to the origin of each part, world frame; on its very place, the axis."""
        to = goals[:, :3, 3] - self.T_world_camera[:3, 3]
        length = np.linalg.norm(to, axis=1, keepdims=True)
        return np.where(length > 0.0, to / np.where(length > 0.0, length, 1.0), self.T_world_camera[:3, 2])

    def frames(self, goals: Array) -> Array:
        """The frames of the rays, (n, 3, 3), world from ray: the third column is the ray."""
        R = self.T_world_camera[:3, :3]
        # The shortest turn from z to the ray r is about k = z x r, with |k| = sin and r_z = cos: Rodrigues' formula
        # I + K + K^2 (1 - cos) / sin^2, where (1 - cos) / sin^2 = 1 / (1 + cos).
        ray = self.rays(goals) @ R
        K = pose.hat(np.stack([-ray[:, 1], ray[:, 0], np.zeros(len(ray))], axis=1))
        cosine = ray[:, 2, None, None]
        behind = cosine < _BEHIND - 1.0
        shortest = np.eye(3) + K + K @ K / np.where(behind, 1.0, 1.0 + cosine)
        return np.asarray(R @ np.where(behind, np.diag([1.0, -1.0, -1.0]), shortest))

    def twists(self, goals: Array, errors: Array) -> Array:
        """Body twists (n, 6) of errors that are given in the frames of the rays.

        Turn first, then shift in the frame that is seen: xi = (R_seen^t F d, R^t F w), R_seen = R exp(R^t F w). The
        twist is thus linear in the error, and with covariance S in the frame of the ray its own is exactly that of
        `covariance` for that ray, since a turn leaves its own axis where it is.

        Args:
            goals: (n, 4, 4), where the parts are, world frame, [m].
            errors: (n, 6), (x, y, along; rx, ry, about), [m, rad].
        """
        frames = self.frames(goals)
        turn = np.zeros((len(goals), 6))
        turn[:, 3:] = np.einsum("nji,njk,nk->ni", goals[:, :3, :3], frames, errors[:, 3:])
        R_seen = (goals @ pose.exp(turn))[:, :3, :3]
        shift = np.einsum("nji,njk,nk->ni", R_seen, frames, errors[:, :3])
        return np.concatenate([shift, turn[:, 3:]], axis=1)

    def covariance(self, seen: Array, errors: Array) -> Array:
        """The body covariance (n, 6, 6) of errors whose covariance in the frames of the rays is known.

        Computed for the rays on which parts are seen, so that nothing of the truth is in it. Those differ from the
        true ones by the error across over the distance, a thousandth for a millimetre.

        Args:
            seen: (n, 4, 4), where the parts are seen, world frame, [m].
            errors: (6, 6) or (n, 6, 6), of (x, y, along; rx, ry, about), [m, rad].
        """
        turned = np.swapaxes(seen[:, :3, :3], 1, 2) @ self.frames(seen)
        Q = np.zeros((len(seen), 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = turned
        C = Q @ errors @ np.swapaxes(Q, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)


ALONG_SIGHT = 3.0
ACROSS_SIGHT = 0.5
"""Standard deviation of a position over the level, along the line of sight and across it."""
OUT_OF_IMAGE = 2.0**0.5
IN_IMAGE = 0.5
"""Standard deviation of a turn over the level: about axes of the image plane, and about the line of sight."""


@final
@dataclass(frozen=True)
class Anisotropic:
    """Every goal is seen at `T exp(xi)`; turned into the world, xi is Gaussian with axes along and across the sight.

    A camera finds depth less well than the place in the image, and a turn that tilts a part out of the image less
    well than one within it. The geometric means of the factors, 0.91 for positions and 1 for turns, keep a level
    comparable with that of `isotropic`; the root mean square of a position is 1.8 times as large.

    The body covariance is R^t S R with S fixed in the world and R the rotation that was seen. That is exact: a turn
    leaves its own axis where it is, so the turn can be drawn first and the position then in the frame that is seen.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="worse along one line of sight, the same for all parts",
        formula=(
            "T_seen = T exp(xi), xi = (R_seen^t S1 e, R^t S2 e')",
            f"S1 = L ({ACROSS_SIGHT:g} (I - s s^t) + {ALONG_SIGHT:g} s s^t)",
            f"S2 = L ({OUT_OF_IMAGE:.3g} (I - s s^t) + {IN_IMAGE:g} s s^t)",
        ),
        frame="of the world, in which the line of sight s is fixed",
        parameters=(
            f"s = down from {CAMERA_ELEVATION_DEG:g} deg above the table, {CAMERA_AZIMUTH_DEG:g} deg from the x axis",
            f"{ALONG_SIGHT:g} and {ACROSS_SIGHT:g}: position over the level, along s and across it",
            f"{OUT_OF_IMAGE:.3g} and {IN_IMAGE:g}: turn over the level, about axes across s and about s",
        ),
        states="R^t S S R with R as seen, which is exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        # As in the docstring: first the turn, w = R^t S2 e'; then the shift in the frame that is seen, R_seen^t S1 e.
        sight = line_of_sight()
        unit = rng.standard_normal((len(assembly), 6))
        place = self.level.mm * 1e-3 * _stretch(sight, ALONG_SIGHT, ACROSS_SIGHT)
        turn = np.radians(self.level.deg) * _stretch(sight, IN_IMAGE, OUT_OF_IMAGE)
        rotation = np.zeros((len(assembly), 6))
        rotation[:, 3:] = np.einsum("nji,nj->ni", demonstration.goals[:, :3, :3], unit[:, 3:] @ turn)
        R = (demonstration.goals @ pose.exp(rotation))[:, :3, :3]
        xi = np.concatenate([np.einsum("nji,nj->ni", R, unit[:, :3] @ place), rotation[:, 3:]], axis=1)
        covariance = np.zeros((len(assembly), 6, 6))
        covariance[:, :3, :3] = _in_body(R, place @ place)
        covariance[:, 3:, 3:] = _in_body(R, turn @ turn)
        return observe_displaced(assembly, demonstration, xi, covariance)


@final
@dataclass(frozen=True, eq=False)
class Sighted:
    """Every part errs about its own ray: along it, across it, about it, and by tilting towards it.

    The factors on the level are those of `anisotropic`, which is this seen from infinitely far away: there all rays are
    parallel, while those of a camera 0.9 m away to parts half a metre apart differ by some 30 degrees.
    """

    level: Level
    camera: Camera = field(default_factory=Camera)
    across: float = ACROSS_SIGHT
    along: float = ALONG_SIGHT
    tilt: float = OUT_OF_IMAGE
    about: float = IN_IMAGE

    FACTS: ClassVar[Facts] = Facts(
        title="a camera with a place: errors along, across and about the ray to each part",
        formula=(
            "T_seen = T exp(xi), xi = (R_seen^t F d, R^t F w)",
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
        states="the covariance in the frame of the ray on which the part is seen, turned into the part; it differs "
        "from the one drawn by the angle between the two rays, a thousandth at 1 mm",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        mm = self.level.mm * 1e-3
        rad = np.radians(self.level.deg)
        sigma = np.array([mm * self.across] * 2 + [mm * self.along] + [rad * self.tilt] * 2 + [rad * self.about])
        xi = self.camera.twists(demonstration.goals, rng.standard_normal((len(assembly), 6)) * sigma)
        stated = self.camera.covariance(displaced(demonstration.goals, xi), np.diag(sigma**2))
        return observe_displaced(assembly, demonstration, xi, stated)


def line_of_sight() -> Array:
    """The direction in which the camera looks, world frame, (3,), of length 1: obliquely down."""
    return Camera().T_world_camera[:3, 2]


def _stretch(axis: Array, along: float, across: float) -> Array:
    """The symmetric matrix (3, 3) that stretches by these factors along an axis and across it."""
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)


def _in_body(R: Array, S: Array) -> Array:
    """R^t S R of every part, (n, 3, 3), symmetric to the last bit."""
    turned = np.einsum("nji,jk,nkl->nil", R, S, R)
    return np.asarray((turned + np.swapaxes(turned, 1, 2)) / 2)
