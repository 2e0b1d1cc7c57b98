"""Find the pose of the camera: as stated, or solved from the first rests of parts at known places."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.errors import require, require_known
from apo_bench.geometry import Array, Solid, copy_frozen, find_nearest_equivalent_pose, pose
from apo_bench.importers.recording.averaging import Mean
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.folding import free_twist, list_images
from apo_bench.importers.recording.rest_intervals import RestIntervals

_ROUNDS = 50  # largest number of Gauss-Newton iterations
_TURNS = 24  # turns about the axis of a known part of revolution from which the solution is searched
_AS_LIKELY = 20.0  # difference of costs for each part below which camera poses are equally likely
_OTHER_RAD = 0.2  # camera poses that differ less are the same
_MOST_CAMERAS = 8
_SINGULAR = 1e12  # condition of normal equations that leave a direction open
_PLACE_DEVIATION = copy_frozen(np.repeat([2e-4, 2e-3], 3), 6)
"""Standard deviation of a known place along and about each axis, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class CameraPose:
    """The pose of a camera in the world, and its uncertainty."""

    T_world_camera: Array
    """(4, 4), [m]."""
    residuals: Mapping[str, Array] = field(default_factory=dict)
    """Part -> body twist from its known place to the observed pose, (6,), [m, rad]; empty for a stated camera pose."""
    covariance: Array | None = None
    """(6, 6), covariance of the body twist of the error, [m, rad]; None for a stated camera pose."""

    @property
    def off_mm(self) -> float:
        """The largest distance between a part and its known place, [mm]."""
        return max((1e3 * float(np.linalg.norm(r[:3])) for r in self.residuals.values()), default=0.0)

    @property
    def off_deg(self) -> float:
        """The largest angle between a part and its known place, [deg]."""
        return max((float(np.degrees(np.linalg.norm(r[3:]))) for r in self.residuals.values()), default=0.0)


def find_cameras(
    intervals: RestIntervals,
    camera: CameraFile,
    planned: Poses,
    fixed: Collection[str] = (),
    solids: Mapping[str, Solid] | None = None,
) -> list[CameraPose]:
    """Return the camera pose as stated, or those that are as likely from the first rests of parts at known places.

    Args:
        planned: Start of the parts in the scenario, world, [m].
        fixed: Parts that never move; they may have a known place though they are not tracked.
        solids: Shapes of parts, whose symmetric images are observed too.

    Raises:
        InputError: Neither is stated, or a known part that may move is not tracked.
    """
    for part in camera.known:
        require_known("tracked part", part, {*intervals, *fixed}, place="the camera file, known")
    if camera.T_world_camera is not None:
        return [CameraPose(camera.T_world_camera)]
    places = {part: T for part, T in camera.places(planned).items() if intervals.get(part)}
    require(
        places,
        "the camera file states neither where the camera stands nor the place of a part that rests in the log; add a "
        'table [pose], or [known] with parts such as castle1 = "start", which is a place of a scenario.',
    )
    # A part that was hidden when the log began may have left its known place.
    sure = {part: T for part, T in places.items() if part in fixed or not intervals[part][0].rests[0].hidden}
    places = sure or places
    means = {part: intervals[part][0].rests[0].mean for part in places}
    return solve_cameras(places, means, rest_error(camera, next(iter(means.values()))), solids or {})


def rest_error(camera: CameraFile, mean: Mean) -> Array:
    """Return the covariance of the error that is constant while a part rests, (6, 6), [m, rad].

    It is that of the camera file, or if none is stated, the covariance of one frame.
    """
    return mean.scatter if camera.stays is None else np.diag(np.repeat(camera.stays, 3) ** 2)


def solve_cameras(
    known: Mapping[str, Array], observed: Mapping[str, Mean], constant: Array, solids: Mapping[str, Solid] | None = None
) -> list[CameraPose]:
    """Solve for the camera poses X that put observed parts at their known places: weighted least squares on SE(3).

    X exp(d) M = K exp(r): residuals r of parts observed at M and standing at K change by Ad(M^-1) d.

    Args:
        known: Part -> its pose in the world, K, (4, 4), [m].
        observed: Part -> its mean pose in the camera, M.
        constant: (6, 6), covariance of the error that is constant while a part rests, [m, rad].
        solids: Shapes of parts. A few symmetric parts may fit at several camera poses; those with the parts as they
            were reported come first.
    """
    parts = tuple(known)
    shapes = [None if solids is None else solids.get(p) for p in parts]
    K = np.array([known[p] for p in parts])
    M = np.array([observed[p].T for p in parts])
    W = np.array([np.linalg.inv(observed[p].covariance + constant + np.diag(_PLACE_DEVIATION**2)) for p in parts])
    for i, shape in enumerate(shapes):
        free = None if shape is None else free_twist(shape)
        if free is not None:  # no weight along the turn that is not observed
            W[i] -= np.outer(W[i] @ free, W[i] @ free) / (free @ W[i] @ free)
    # Each part alone gives X = K M^-1, at each of its images; start from those with the least total cost.
    begun = [
        K[i] @ pose.inverse(image)
        for i, shape in enumerate(shapes)
        for image in ([M[i]] if shape is None else list_images(shape, M[i], _TURNS))
    ]
    costs = np.array([_cost(_residuals(X, K, _fold_all(X, K, M, shapes)), W) for X in begun])
    kept: list[Array] = []
    for i in np.argsort(np.round(costs / _AS_LIKELY), kind="stable"):
        is_new = all(np.linalg.norm(pose.log(pose.inverse(X) @ begun[i])[3:]) > _OTHER_RAD for X in kept)
        if costs[i] < costs.min() + _AS_LIKELY * len(parts) and is_new and len(kept) < _MOST_CAMERAS:
            kept.append(begun[i])
    return [_refine(X, parts, K, _fold_all(X, K, M, shapes), W) for X in kept]


def _refine(X: Array, parts: Sequence[str], K: Array, M: Array, W: Array) -> CameraPose:
    """Return the camera pose nearest to X with the least cost, by Gauss-Newton steps."""
    # Normal equations of r + A d = 0, the sum of A^t W A over parts; A hardly depends on X, so it is computed once.
    A = pose.adjoint(pose.inverse(M))
    normal = np.einsum("kji,kjl,klm->im", A, W, A)
    require(
        np.linalg.cond(normal) < _SINGULAR,
        f"the camera file: {', '.join(parts)} alone leave a turn of the camera about an axis of revolution open; add "
        "another part to [known].",
    )
    for _ in range(_ROUNDS):
        r = _residuals(X, K, M)
        step = -np.linalg.solve(normal, np.einsum("kji,kjl,kl->i", A, W, r))
        X = X @ pose.exp(step)
        if np.abs(step).max() < 1e-12:
            break
    r = _residuals(X, K, M)
    # Chi-square over its degrees of freedom estimates by how much the stated variances are too small.
    excess = max(1.0, _cost(r, W) / max(6 * len(parts) - 6, 1)) if len(parts) > 1 else 1.0
    return CameraPose(X, MappingProxyType(dict(zip(parts, r, strict=True))), excess * np.linalg.inv(normal))


def _fold_all(X: Array, K: Array, M: Array, shapes: Sequence[Solid | None]) -> Array:
    """Return the images of observed poses M nearest to known poses K, (k, 4, 4), for a camera pose X."""
    expected = pose.inverse(X) @ K
    known = zip(shapes, M, expected, strict=True)
    return np.array([T if shape is None else find_nearest_equivalent_pose(shape, T, E) for shape, T, E in known])


def _residuals(X: Array, K: Array, M: Array) -> Array:
    """Return the body twists from known to observed poses, (k, 6).

    Args:
        X: (4, 4), world from camera.
        K: (k, 4, 4), known poses in the world.
        M: (k, 4, 4), observed poses in the camera.
    """
    return pose.log(pose.inverse(K) @ X @ M)


def _cost(r: Array, W: Array) -> float:
    """Return the sum of squared residuals, weighted by W, (k, 6, 6)."""
    return float(np.einsum("ki,kij,kj->", r, W, r))
