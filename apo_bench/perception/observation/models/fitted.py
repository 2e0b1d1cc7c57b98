"""Noise with tails, outliers and misses that were fitted to a pose estimator.

It can be drawn, or its covariance can be stated for an existing observation (`restate_covariance`).
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, Tails, make_measured_model
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import displace_poses, floor_covariance, observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel
from apo_bench.perception.observation.models.outliers import UNOBSERVED_DEVIATION, find_last_observed_poses
from apo_bench.perception.observation.models.truncated_tails import TruncatedTails

SMALLEST_SCALE = 1e-4
"""Least scale of a tail, relative to the limit."""
LEAST_FREEDOM = 0.5
"""Least degrees of freedom of a tail."""
LEVEL_UNITS = np.repeat([1e-3, np.radians(1.0)], 3)
"""[m] per mm and [rad] per degree."""
_GAUSSIAN = 1e9
"""Degrees of freedom that are stated for a Gaussian, in place of infinity."""
_AS_MEASURED = NoiseLevel(1.0, 1.0)
LARGEST_M = 0.4
"""Largest standard deviation of a position per axis that a level may give."""
LARGEST_RAD = 2.0
"""Largest standard deviation of a rotation per axis that a level may give."""


@final
@dataclass(frozen=True)
class MeasuredNoise:
    """The measured noise of a pose estimator, as in a noise file."""

    source: str
    """The estimator, the data and the origin of the numbers."""
    shift_mm: TruncatedTails
    """Distribution of the position errors of inliers."""
    turn_deg: TruncatedTails
    """Distribution of the rotation errors of inliers."""
    missed: float
    """Fraction of parts without an estimate."""
    outliers: float
    """Fraction of estimates that are off by more than the limit of the shift."""
    farthest_mm: float
    """Largest distance of an outlier; distances are log-uniform from the limit of the shift to this."""


@final
@dataclass(frozen=True, eq=False)
class FittedNoise:
    """Noise drawn from a fitted distribution of errors (x, y, along; rx, ry, about) in the frame of the camera ray.

    Level 1 is as measured: its mm are a factor on every shift and its degrees on every turn, also those of outliers.
    The level does not change which operations are outliers or missed, but at level 0 all are observed exactly. The
    stated covariance is that of inliers; an observation states how often outliers occur, not which ones they are.
    """

    measured: MeasuredNoise
    noise_level: NoiseLevel
    camera: Camera = field(default_factory=Camera)

    FACTS: ClassVar[Facts] = Facts(
        title="tails, outliers and misses fitted to a pose estimator",
        formula=(
            "T_obs = T exp(xi), xi = (R_obs^t F d, R^t F w)",
            "d = L (s1 t1 / sqrt(c1 / n1), s2 e3 / sqrt(c2 / n2)), t1 = (e1, e2); w likewise",
            "no |d|, |w| above its limit",
            "of an outlier: |d| log-uniform from the limit to the farthest, any direction, any turn; times L",
        ),
        frame="F of the ray from the camera to the origin of the part, as of the model `camera`",
        parameters=("all in the file: scales s, degrees of freedom n, limits, shares of outliers and misses, source",),
        states="the covariance of inliers within the limits, in the frame of the part, and the tails",
        notes=("Level 1 is as measured", "At level 0 nothing is missed"),
        measured=True,
    )

    def __post_init__(self) -> None:
        check_measured_level(self.noise_level, self.covariance)

    @property
    def covariance(self) -> Array:
        """(6, 6), covariance of inliers at level 1 in the frame of the ray, [m, rad]."""
        across, along = self.measured.shift_mm.variances
        out, about = self.measured.turn_deg.variances
        return np.diag(np.array([across, across, along, out, out, about]) * LEVEL_UNITS**2)

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        n = len(assembly)
        measured = self.measured
        errors = np.concatenate([measured.shift_mm.draw(n, rng), measured.turn_deg.draw(n, rng)], axis=1)
        gross = _draw_gross_errors(measured, n, rng)
        chance = rng.random((n, 2))
        errors = np.where(chance[:, :1] < measured.outliers, gross, errors)
        missed = chance[:, 1] < measured.missed
        seen = observe_in_ray_frames(
            self.camera, self.noise_level, demonstration, assembly, errors * LEVEL_UNITS, self.covariance, missed
        )
        tails = (
            list_stated_tails(measured, self.noise_level, self.camera, seen.poses)
            if min(self.noise_level) > 0.0
            else None
        )
        return replace(seen, outliers=make_measured_model(measured.outliers), tails=tails)


def restate_covariance(observation: Observation, measured: MeasuredNoise, camera: Camera) -> Observation:
    """Return an observation with the covariances of measured noise in place of its own.

    Operations that were not observed keep their covariance.
    """
    stated = floor_covariance(
        camera.covariance(observation.poses, FittedNoise(measured, _AS_MEASURED, camera).covariance)
    )
    stated = np.where(observation.observed[:, None, None], stated, observation.covariance)
    tails = list_stated_tails(measured, _AS_MEASURED, camera, observation.poses)
    return replace(observation, covariance=stated, shared=(), tails=tails)


def list_stated_tails(measured: MeasuredNoise, noise_level: NoiseLevel, camera: Camera, poses: Array) -> Tails:
    """The tails that an observation states: those of inliers, in the frames of the rays to observed poses (n, 4, 4)."""
    shift = measured.shift_mm
    turn = measured.turn_deg
    units = np.repeat(LEVEL_UNITS[[0, 3]] * noise_level, 2)
    each = (shift.across, shift.along, turn.across, turn.along)
    return Tails(
        frames=np.swapaxes(poses[:, :3, :3], 1, 2) @ camera.frames(poses),
        scales=np.array([tail.scale for tail in each]) * units,
        freedom=np.minimum([tail.freedom for tail in each], _GAUSSIAN),
        variances=np.array([*shift.variances, *turn.variances]) * units**2,
        limits=np.array([shift.limit, turn.limit]) * units[[0, 2]],
    )


def check_measured_level(noise_level: NoiseLevel, covariance: Array) -> None:
    """Raise an `InputError` if the standard deviation at this level exceeds `LARGEST_M` or `LARGEST_RAD`.

    Args:
        covariance: (6, 6), at level 1, [m, rad].
    """
    worst = np.sqrt(np.diagonal(covariance).reshape(2, 3).max(axis=1))
    for value, deviation, largest, unit in zip(
        noise_level, worst, (LARGEST_M, LARGEST_RAD), ("mm", "degrees"), strict=True
    ):
        if value * deviation > largest:
            raise InputError(
                f"a level of {value:g} {unit} was given for noise that is measured, where 1 is as measured; at most "
                f"{np.floor(10.0 * largest / deviation) / 10.0:g} is allowed, else parts are seen outside the room."
            )


def observe_in_ray_frames(
    camera: Camera,
    noise_level: NoiseLevel,
    demonstration: Demonstration,
    assembly: Assembly,
    errors: Array,
    covariance: Array,
    missed: NDArray[np.bool_],
) -> Observation:
    """Make the observation of a camera with these errors.

    Args:
        errors: (n, 6), at level 1, in the frames of the rays: (x, y, along; rx, ry, about), [m, rad].
        covariance: (6, 6), of inliers at level 1, in the frame of the ray.
        missed: (n,), True for an operation that is not observed.
    """
    scale = np.repeat([noise_level.mm, noise_level.deg], 3)
    xi = camera.twists(demonstration.poses, errors * scale)
    stated = camera.covariance(displace_poses(demonstration.poses, xi), covariance * np.outer(scale, scale))
    seen = observe_displaced(assembly, demonstration, xi, stated)
    missed = missed & (max(noise_level) > 0.0)  # at level 0 nothing is missed
    poses = seen.poses.copy()
    stated = seen.covariance.copy()
    poses[missed] = find_last_observed_poses(assembly, demonstration.start, poses, ~missed)[missed]
    stated[missed] = np.diag(UNOBSERVED_DEVIATION**2)
    return replace(seen, poses=poses, covariance=stated, observed=~missed)


def _draw_gross_errors(measured: MeasuredNoise, n: int, rng: np.random.Generator) -> Array:
    """Draw errors (n, 6) of outliers, [mm, deg]: log-uniform distances, uniform directions, uniform rotations."""
    # Normalised Gaussian vectors are uniform directions, normalised Gaussian quaternions uniform rotations.
    direction = rng.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    size = measured.shift_mm.limit * (measured.farthest_mm / measured.shift_mm.limit) ** rng.random((n, 1))
    q = rng.standard_normal((n, 4))
    turned = pose.log(pose.unpack(np.concatenate([np.zeros((n, 3)), q], axis=1)))[:, 3:]
    return np.concatenate([direction * size, np.degrees(turned)], axis=1)
