"""Noise with camera failures: some observed poses are false, but state the covariance of right ones.

Failures are drawn separately from the noise, so that a reobservation can repeat them although a model keeps no state.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, compute_placements, make_measured_model
from apo_bench.errors import require
from apo_bench.geometry import Array, find_approximate_symmetries, pose
from apo_bench.perception.observation.models.camera import CAMERA_DISTANCE_M, CAMERA_ELEVATION_DEG, Camera
from apo_bench.perception.observation.models.displacement import observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

RATE = 0.3
"""Default fraction of operations that fail."""
NEAREST_M = 0.02
"""Smallest error along the ray."""
FARTHEST_M = 0.06
"""Largest error along the ray."""
VIEW_SHIFT_M = 0.02
"""Standard deviation of the displacement of a view along each axis."""
VIEW_TURN_RAD = float(np.radians(5.0))
"""Standard deviation of the displacement of a view about each axis."""
LAG_M = (0.003, 0.03)
"""Smallest and largest distance by which a moving part is observed too early on its way."""
DEPTH_SCALE = 0.01
"""Standard deviation of the error of a depth over the depth, at the distance of the middle of the workspace."""
CAD_SCALE = 0.03
"""Largest error of the size of a part's model; half of it is the smallest."""
_MOST_REPEAT = 0.999
"""Largest probability of a repeated failure that an observation states."""


class FalseViews(NamedTuple):
    """The failures in one observation of n operations."""

    false: NDArray[np.bool_]
    """(n,), True for an operation that failed."""
    poses: Array
    """(n, 4, 4), false poses of failed operations and true poses of the others, without noise, world frame, [m]."""


class Failure(NamedTuple):
    """One kind of camera failure, with its rate."""

    displace: Callable[[Array, Demonstration, Camera, float, np.random.Generator], None]
    """(poses (n, 4, 4), shown, camera, rate, rng): draws the failed operations and replaces their poses in place."""
    title: str
    formula: str
    notes: tuple[str, ...] = ()
    rate: float = RATE
    """Fraction of operations that fail."""
    by_part: bool = True
    """True if operations on different parts fail independently of each other."""


@final
@dataclass(frozen=True, eq=False)
class CameraFailures:
    """Isotropic noise about poses, some of which are false; several kinds of failures can be combined.

    At level 0 nothing fails.
    """

    noise_level: NoiseLevel
    failures: tuple[Failure, ...]
    """Applied one after the other."""
    repeat: float = 0.0
    """Probability that a reobservation repeats a failure of the first observation."""
    camera: Camera = field(default_factory=Camera)

    def __post_init__(self) -> None:
        shares = [("failures", failure.rate) for failure in self.failures]
        for name, share in (*shares, ("repeated failures", self.repeat)):
            require(0.0 <= share <= 1.0, f"a share of {name} of {share:g} was given; give a number from 0 to 1.")

    @property
    def FACTS(self) -> Facts:
        """The facts that its sheet prints."""
        formula = ", or ".join(failure.formula for failure in self.failures)
        notes = [note for failure in self.failures for note in failure.notes]
        return Facts(
            title=", or ".join(failure.title for failure in self.failures),
            formula=(f"T_obs = S exp(L e); S = T, but of a failure {formula}",),
            frame="of the observed part, isotropic",
            parameters=(
                f"p = {RATE:g} by default: share of operations that fail",
                "r = 0 by default: probability that a reobservation repeats the failure",
            ),
            states="L^2, the covariance without failures, with p, r and the place of the camera",
            notes=(*notes, "At level 0 nothing fails; the size of a failure does not depend on the level"),
        )

    @property
    def by_part(self) -> bool:
        """True if operations on different parts fail independently of each other."""
        return all(failure.by_part for failure in self.failures)

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        return self._observe(demonstration, rng, self.draw_false(demonstration, rng))

    def reobserve(
        self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator, first: np.random.Generator
    ) -> Observation:
        """Draw a reobservation, which can repeat failures of the first observation.

        Args:
            first: A fresh copy of the generator that the first observation was drawn from.
        """
        before = self.draw_false(demonstration, first)
        now = self.draw_false(demonstration, rng)
        repeated = before.false & (rng.random(len(assembly)) < self.repeat)
        poses = np.where(repeated[:, None, None], before.poses, now.poses)
        return self._observe(demonstration, rng, FalseViews(repeated | now.false, poses))

    def draw_false(self, demonstration: Demonstration, rng: np.random.Generator) -> FalseViews:
        """Draw the failures; these are the first draws of `__call__`, so its generator reproduces them."""
        poses = demonstration.poses.copy()
        if max(self.noise_level) > 0.0 and len(poses):
            for failure in self.failures:
                failure.displace(poses, demonstration, self.camera, failure.rate, rng)
        return FalseViews(np.abs(poses - demonstration.poses).max(axis=(1, 2), initial=0.0) > 0.0, poses)

    def _observe(self, demonstration: Demonstration, rng: np.random.Generator, views: FalseViews) -> Observation:
        """Add isotropic noise to the poses of `views`, and state rates of failures."""
        sigma = self.noise_level.sigma()
        xi = rng.standard_normal((len(views.poses), 6)) * sigma
        seeming = replace(demonstration, poses=views.poses)
        seen = observe_displaced(demonstration.assembly, seeming, xi, np.diag(sigma**2))
        x, y, z = self.camera.T_world_camera[:3, 3].tolist()
        gross = min(1.0, sum(failure.rate for failure in self.failures))
        rates = replace(make_measured_model(gross, 0.0), repeat=min(self.repeat, _MOST_REPEAT), camera_m=(x, y, z))
        return replace(seen, outliers=rates)


def draw_failed_operations(n: int, rate: float, rng: np.random.Generator) -> list[int]:
    """Draw the failed ones of n operations, counted from 0, each with probability `rate`."""
    return [int(k) for k in np.flatnonzero(rng.random(n) < rate)]


def _flip_parts(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Turn parts by one of their approximate symmetries, T F; a part without one is observed correctly."""
    assembly = shown.assembly
    for k in draw_failed_operations(len(poses), rate, rng):
        turns = find_approximate_symmetries(assembly.solids[assembly.operations[k].main]).turns
        if len(turns):
            poses[k] = poses[k] @ turns[rng.integers(len(turns))]


def _keep_stale_poses(
    poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator
) -> None:
    """Replace poses by those before the operation."""
    before = (shown.start, *compute_placements(shown.assembly, shown.start, shown.poses))
    for k in draw_failed_operations(len(poses), rate, rng):
        poses[k] = before[k][shown.assembly.operations[k].main]


def _swap_poses(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Exchange the poses of two operations on parts of equal shape, or of any two parts if there are none."""
    assembly = shown.assembly
    parts = [operation.main for operation in assembly.operations]
    free = set(range(len(parts)))
    for k in range(len(parts)):
        # Both operations of a pair fail, so each one starts an exchange with half the rate.
        starts = rng.random() < rate / 2.0
        others = [i for i in sorted(free - {k}) if parts[i] != parts[k]]
        like = [i for i in others if assembly.solids[parts[i]] is assembly.solids[parts[k]]] or others
        if starts and k in free and like:
            i = like[int(rng.integers(len(like)))]
            poses[[k, i]] = shown.poses[[i, k]]
            free -= {i, k}


def _shift_along_ray(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Shift parts by 20 to 60 mm along the camera ray, towards the camera or away."""
    rays = camera.rays(poses)
    for k in draw_failed_operations(len(poses), rate, rng):
        poses[k, :3, 3] += rays[k] * rng.choice((-1.0, 1.0)) * rng.uniform(NEAREST_M, FARTHEST_M)


def _displace_view(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Displace consecutive operations, a fraction `rate` of all and at least two, by one common displacement."""
    many = min(len(poses), max(2, round(rate * len(poses)))) if rate > 0.0 else 0
    first = int(rng.integers(len(poses) - many + 1))
    error = rng.standard_normal(6) * np.repeat([VIEW_SHIFT_M, VIEW_TURN_RAD], 3)
    # T -> P exp(e) P^-1 T, P the axes of the camera in the middle of the displaced poses.
    view = slice(first, first + many)
    if many:
        P = camera.T_world_camera.copy()
        P[:3, 3] = poses[view, :3, 3].mean(axis=0)
        poses[view] = P @ pose.exp(error) @ pose.inverse(P) @ poses[view]


def _lag(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Shift parts back along the straight way from where they were before the operation."""
    before = (shown.start, *compute_placements(shown.assembly, shown.start, shown.poses))
    for k in draw_failed_operations(len(poses), rate, rng):
        way = before[k][shown.assembly.operations[k].main][:3, 3] - poses[k, :3, 3]
        lag = rng.uniform(*LAG_M)
        poses[k, :3, 3] += way * min(1.0, lag / max(float(np.linalg.norm(way)), lag))


def _scale_depth(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Shift all parts along their rays by one error of the scale of depth, which grows with the distance."""
    distance = np.linalg.norm(poses[:, :3, 3] - camera.T_world_camera[:3, 3], axis=1)
    shift = rng.standard_normal() * DEPTH_SCALE * distance**2 / CAMERA_DISTANCE_M * (rate > 0.0)
    poses[:, :3, 3] += camera.rays(poses) * shift[:, None]


def _merge(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Shift a part to the middle between it and the nearest part that was placed before."""
    for k in draw_failed_operations(len(poses), rate, rng):
        own = shown.assembly.operations[k].main
        placed = [i for i in range(k) if shown.assembly.operations[i].main != own]
        if placed:
            apart = shown.poses[placed, :3, 3] - shown.poses[k, :3, 3]
            poses[k, :3, 3] += 0.5 * apart[np.argmin(np.linalg.norm(apart, axis=1))]


def _misjudge_size(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Shift parts along their rays in the ratio of the size of a wrong model, the same in all operations of a part."""
    mains = [operation.main for operation in shown.assembly.operations]
    parts = list(dict.fromkeys(mains))
    rays = camera.rays(poses)
    distance = np.linalg.norm(poses[:, :3, 3] - camera.T_world_camera[:3, 3], axis=1)
    for i in draw_failed_operations(len(parts), rate, rng):
        scale = rng.choice((-1.0, 1.0)) * rng.uniform(0.5 * CAD_SCALE, CAD_SCALE)
        own = np.array([main == parts[i] for main in mains])
        poses[own, :3, 3] += scale * distance[own, None] * rays[own]


def _mirror(poses: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Turn parts about the vertical, so that their angle to the view of the camera has the wrong sign."""
    elevation = np.radians(CAMERA_ELEVATION_DEG)
    up = camera.T_world_camera[:3, :3] @ np.array([0.0, -np.cos(elevation), -np.sin(elevation)])
    view = camera.T_world_camera[:3, 2]
    for k in draw_failed_operations(len(poses), rate, rng):
        x = poses[k, :3, 0]
        # the angle from the view to the x axis of the part, about the vertical
        yaw = np.arctan2(up @ np.cross(view, x), view @ x - (view @ up) * (x @ up))
        # an angle from -45 to 45 degrees to the nearest axis of the view
        nearest = yaw - 0.5 * np.pi * np.round(yaw / (0.5 * np.pi))
        turn = pose.exp(np.concatenate([np.zeros(3), -2.0 * nearest * up]))
        poses[k, :3, :3] = turn[:3, :3] @ poses[k, :3, :3]


PRESETS: Mapping[str, Failure] = MappingProxyType(
    {
        "flips": Failure(
            _flip_parts,
            "parts that look nearly the same after a turn are observed turned",
            "S = T F, F one of the turns after which the part nearly fills the same space",
            ("A part without such a turn is observed correctly",),
        ),
        "stale": Failure(
            _keep_stale_poses,
            "parts are observed where they were before the operation",
            "S the pose of the part before the operation",
        ),
        "swaps": Failure(
            _swap_poses,
            "two parts are confused",
            "S the pose of another operation, which gets this one's",
            ("Operations on parts of one shape are exchanged, or of any two parts if there are none",),
            by_part=False,
        ),
        "rays": Failure(
            _shift_along_ray,
            "parts are observed too near or too far",
            f"S = T shifted by {1e3 * NEAREST_M:g} to {1e3 * FARTHEST_M:g} mm towards the camera or away",
        ),
        "displaced-view": Failure(
            _displace_view,
            "consecutive operations are displaced together",
            "S = P exp(c) P^-1 T, P the axes of the camera in the middle of them, one c",
            (
                f"c: {1e3 * VIEW_SHIFT_M:g} mm and {np.degrees(VIEW_TURN_RAD):g} deg along and about each axis",
                "A share p of the operations, at least two",
            ),
            by_part=False,
        ),
        "latency": Failure(
            _lag,
            "moving parts are observed too early",
            f"S = T shifted back by {1e3 * LAG_M[0]:g} to {1e3 * LAG_M[1]:g} mm on the straight way of the part",
        ),
        "depth-scale": Failure(
            _scale_depth,
            "depths have an error of scale that grows with the distance",
            f"S = T shifted by s d^2 / {CAMERA_DISTANCE_M:g} m along the ray, d its length, one s of all operations",
            (f"s: {DEPTH_SCALE:g}", "All operations fail, whatever p is"),
            by_part=False,
        ),
        "merged": Failure(
            _merge,
            "two parts are detected as one",
            "S = T shifted to the middle between the part and the nearest one that was placed before",
            by_part=False,
        ),
        "cad-scale": Failure(
            _misjudge_size,
            "the model of a part has the wrong size",
            f"S = T shifted by s d along the ray, d its length, s of {0.5 * CAD_SCALE:g} to {CAD_SCALE:g} or negative",
            ("One s of a part in all operations", "p: share of parts whose model is wrong"),
        ),
        "mirrored-yaw": Failure(
            _mirror,
            "parts are observed with a mirrored turn about the vertical",
            "S = T turned about the vertical, so that the angle to the nearest axis of the view has the wrong sign",
        ),
    }
)
"""Name of a failure model -> its kind of failure."""


def make_failures(name: str, noise_level: NoiseLevel, rate: float = RATE, repeat: float = 0.0) -> CameraFailures:
    """Make the camera with one kind of failure, a key of `PRESETS`."""
    return CameraFailures(noise_level, (PRESETS[name]._replace(rate=rate),), repeat)
