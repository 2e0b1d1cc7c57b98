"""Residuals of a pose estimator: match its estimates to the truth, and express errors in the frames of camera rays."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError
from apo_bench.formats.bop import PoseRows
from apo_bench.formats.bop_models import ObjectSymmetry
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import Camera

INLIER_MM = 50.0
"""An estimate with a larger position error is an outlier."""
TURNED_DEG = 30.0
"""An estimate with a larger rotation error is turned: the part is symmetric, or the estimate is wrong. Only the
symmetries of the models could tell which."""
_GAP_DEG = 55.0
"""Symmetries of 60 degrees or more leave few rotation errors between `TURNED_DEG` and this angle."""
_IN_GAP = 1.0 / 30.0
"""An object is round if a larger fraction of its estimates lies in that gap; it is 14 % for uniform angles."""
_FEWEST_ALIKE = 5
"""Least number of gross estimates of an object that have to agree on a fixed point."""
_ALIKE = 0.1
"""At least this fraction of the estimates of an object has to agree on it."""
_NEAR = 4.0
"""They agree within so many times the median position error of upright estimates."""
_MOST_POINTS = 500
"""Number of estimates whose fixed points are tried, at most."""
MOST_PAIRS = 10_000_000
"""Pairs of estimates and true parts of one object in one image, at most."""
_MOST_IN_ONE_IMAGE = "at most 3000 estimates of one object in one image can be matched; leave out those of low score"


@final
@dataclass(frozen=True, eq=False)
class Residuals:
    """The errors of the estimates, one row per part in the truth; NaN for a part without an estimate."""

    where: NDArray[np.int64]
    """(n, 3): scene, image, object."""
    shift_mm: Array
    """(n, 3), from the true to the estimated position: x, y, along the ray; see `turned_in_place` for the reference
    point."""
    turn_deg: Array
    """(n, 3), rotation vector from the true to the estimated rotation: about x, about y, about the ray."""
    trace_deg: Array
    """(n,), rotation angle from the trace of the matrices as written in the files."""
    score: Array
    """(n,), confidence of the estimate."""
    surplus: int = 0
    """Number of estimates in images of the truth that no part was matched to."""
    absent: int = 0
    """Number of surplus estimates whose object is not in the image."""
    distance_mm: float = float("nan")
    """Median distance from the camera."""
    turned_in_place: int = 0
    """Number of gross estimates that only turn a part about a fixed point off its origin; their shift is that of this
    point."""

    @cached_property
    def is_estimated(self) -> NDArray[np.bool_]:
        return np.isfinite(self.shift_mm[:, 0])

    @cached_property
    def is_inlier(self) -> NDArray[np.bool_]:
        return np.nan_to_num(self.distance_from_truth_mm, nan=np.inf) < INLIER_MM

    @cached_property
    def is_upright(self) -> NDArray[np.bool_]:
        """(n,), inliers that are not turned. Turned ones are left out, since a symmetry axis off the origin of a part
        makes their shift meaningless."""
        return self.is_inlier & (np.nan_to_num(self.angle_deg, nan=np.inf) < TURNED_DEG)

    @cached_property
    def round_objects(self) -> tuple[int, ...]:
        """Objects that seem to be rotationally symmetric: fewer than half of their inliers are upright, and rotation
        errors of all sizes occur."""
        parts = list[int]()
        for part in np.unique(self.where[self.is_inlier, 2]).tolist():
            angle = self.angle_deg[self.is_inlier & (self.where[:, 2] == part)]
            between = (angle >= TURNED_DEG) & (angle < _GAP_DEG)
            if np.mean(angle < TURNED_DEG) < 0.5 and between.mean() > _IN_GAP:
                parts.append(part)
        return tuple(parts)

    @cached_property
    def has_rotation_error(self) -> NDArray[np.bool_]:
        """(n,), upright estimates of objects that are not round, so that their rotation error is known."""
        return self.is_upright & ~np.isin(self.where[:, 2], self.round_objects)

    @cached_property
    def distance_from_truth_mm(self) -> Array:
        return np.asarray(np.linalg.norm(self.shift_mm, axis=1))

    @cached_property
    def across_mm(self) -> Array:
        return np.asarray(np.linalg.norm(self.shift_mm[:, :2], axis=1))

    @cached_property
    def along_mm(self) -> Array:
        return np.abs(self.shift_mm[:, 2])

    @cached_property
    def angle_deg(self) -> Array:
        return np.asarray(np.linalg.norm(self.turn_deg, axis=1))


def match_residuals(
    estimates: PoseRows, truth: PoseRows, symmetries: Mapping[int, ObjectSymmetry] | None = None
) -> Residuals:
    """Match estimates to the truth and compute their errors; estimates in images without truth are ignored.

    Per image and object, parts and estimates are assigned with the least sum of distances (Hungarian method). There is
    no limit of distance, and scores are ignored; `INLIER_MM` marks outliers afterwards. Matrices in the files are
    replaced by the nearest rotations.

    Args:
        symmetries: Object -> displacements after which it looks the same; estimates become the images nearest to the
            truth. None: symmetries are found from the estimates where possible.
    """
    from scipy.spatial.transform import Rotation

    partner = match_rows(estimates, truth, symmetries or {})
    is_estimated = partner >= 0
    n = len(partner)
    in_images = _occurs_in(estimates.where[:, :2], truth.where[:, :2])
    # BOP poses are in the frame of the camera, so its own pose is the identity. F^t takes errors into the ray's frame.
    there = np.tile(np.eye(4), (n, 1, 1))
    there[:, :3, 3] = truth.t_mm * 1e-3
    F = Camera(np.eye(4)).frames(there)[is_estimated]
    R = truth.R[is_estimated]
    R_obs, t_obs = _fold(estimates, partner[is_estimated], R, symmetries or {})
    right = pose.nearest_rotations(R)
    turn = Rotation.from_matrix(pose.nearest_rotations(R_obs) @ np.swapaxes(right, 1, 2)).as_rotvec(degrees=True)
    shift = np.full((n, 3), np.nan)
    turned = np.full((n, 3), np.nan)
    moved = t_obs - truth.t_mm[is_estimated]
    turned_in_place, moved = _find_turned_in_place(
        truth.where[is_estimated, 2], moved, right, pose.nearest_rotations(R_obs)
    )
    shift[is_estimated] = np.einsum("nji,nj->ni", F, moved)
    turned[is_estimated] = np.einsum("nji,nj->ni", F, turn)
    # trace(R_obs R^t) = 1 + 2 cos(angle).
    trace = np.full(n, np.nan)
    trace[is_estimated] = np.degrees(np.arccos(np.clip((np.einsum("nij,nij->n", R_obs, R) - 1.0) / 2.0, -1.0, 1.0)))
    return Residuals(
        where=truth.where,
        shift_mm=shift,
        turn_deg=turned,
        trace_deg=trace,
        score=np.where(is_estimated, estimates.score[partner], np.nan),
        surplus=int(in_images.sum() - is_estimated.sum()),
        absent=int(np.sum(in_images & ~_occurs_in(estimates.where, truth.where))),
        distance_mm=float(np.median(np.linalg.norm(truth.t_mm, axis=1))),
        turned_in_place=int(turned_in_place.sum()),
    )


def _find_turned_in_place(
    objects: NDArray[np.int64], moved: Array, R: Array, R_obs: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Find gross estimates that only turn a part about a fixed point, and compute their shifts at that point.

    A symmetry about an axis off the origin displaces the estimated origin although the shape is where it was. Every
    symmetry keeps a point c, so the turned estimates of one object agree on it: (R - I) c + t is as small as the errors
    of upright estimates.

    Args:
        objects: (n,), object of each estimate.
        moved: (n, 3), from the true to the estimated origin, camera axes, [mm].
        R: (n, 3, 3), true rotations.
        R_obs: (n, 3, 3), estimated rotations.

    Returns:
        Mask (n,) of these estimates; and shifts (n, 3), [mm], those of the others unchanged.
    """
    off = np.linalg.norm(moved, axis=1)
    D = np.swapaxes(R, 1, 2) @ R_obs - np.eye(3)
    t = np.einsum("nji,nj->ni", R, moved)
    # |R - I| = 2 sqrt(2) sin(angle / 2) for the Frobenius norm.
    is_turned = np.linalg.norm(D, axis=(1, 2)) >= 2.0 * np.sqrt(2.0) * np.sin(np.radians(TURNED_DEG) / 2.0)
    turned_in_place = np.zeros(len(off), dtype=np.bool_)
    shifts = np.array(moved)
    for each in np.unique(objects).tolist():
        of_it = objects == each
        is_upright = of_it & (off < INLIER_MM) & ~is_turned
        left = np.flatnonzero(of_it & (off >= INLIER_MM) & is_turned)
        fewest = max(_FEWEST_ALIKE, _ALIKE * of_it.sum())
        near = _NEAR * float(np.median(off[is_upright])) if is_upright.any() else 0.0
        while len(left) >= fewest:
            few = left[:_MOST_POINTS]
            points = -np.einsum("nij,nj->ni", np.linalg.pinv(D[few], rcond=1e-6), t[few])
            kept = np.array([_shift_of_point(D[left], t[left], c) < near for c in points])
            agree = left[kept[np.argmax(kept.sum(axis=1))]]
            if len(agree) < fewest:
                break
            c = np.linalg.lstsq(D[agree].reshape(-1, 3), -t[agree].reshape(-1), rcond=0.1)[0]
            stands = left[_shift_of_point(D[left], t[left], c) < INLIER_MM]
            shifts[stands] = moved[stands] + (R_obs[stands] - R[stands]) @ c
            turned_in_place[stands] = True
            left = np.setdiff1d(left, np.union1d(stands, agree))
    return turned_in_place, shifts


def _shift_of_point(D: Array, t: Array, c: Array) -> Array:
    """The distance (n,) by which displacements move a point c (3,) of a part.

    Args:
        D: (n, 3, 3), rotations less the identity.
        t: (n, 3), shifts.
    """
    return np.asarray(np.linalg.norm(D @ c + t, axis=1))


def _occurs_in(rows: Any, known: Any) -> NDArray[np.bool_]:
    """(n,), True for each row that also occurs in `known`."""
    _, key = np.unique(np.concatenate([known, rows]), axis=0, return_inverse=True)
    key = key.reshape(-1)
    return np.isin(key[len(known) :], key[: len(known)])


def _fold(
    estimates: PoseRows, rows: NDArray[np.int64], R: Array, symmetries: Mapping[int, ObjectSymmetry]
) -> tuple[Array, Array]:
    """Return rotations and positions, [mm], of estimates, each at the image that is turned least from the truth.

    Args:
        rows: (n,), rows of the estimates.
        R: (n, 3, 3), true rotations.
    """
    R_obs = np.array(estimates.R[rows])
    t_obs = np.array(estimates.t_mm[rows])
    for i, row in enumerate(rows):
        known = symmetries.get(int(estimates.where[row, 2]))
        if known is not None:
            g = known.images[np.einsum("ji,jk,mki->m", R[i], R_obs[i], known.images[:, :3, :3]).argmax()]
            t_obs[i] = R_obs[i] @ g[:3, 3] + t_obs[i]
            R_obs[i] = R_obs[i] @ g[:3, :3]
    return R_obs, t_obs


def _distances(estimates: PoseRows, seen: NDArray[np.int64], truth: Array, symmetry: ObjectSymmetry | None) -> Array:
    """Return the distances of true positions, (n, 3), to the nearest images of estimates, (n, k), [mm]."""
    places = estimates.t_mm[seen][:, None]
    if symmetry is not None:
        places = places + np.einsum("kij,mj->kmi", estimates.R[seen], symmetry.images[:, :3, 3])
    return np.asarray(np.linalg.norm(truth[:, None, None] - places[None], axis=3).min(axis=2))


def match_rows(
    estimates: PoseRows, truth: PoseRows, symmetries: Mapping[int, ObjectSymmetry] | None = None
) -> NDArray[np.int64]:
    """The index (n,) of the estimate matched to each row of the truth, -1 if there is none."""
    from scipy.optimize import linear_sum_assignment

    partner = np.full(len(truth.where), -1, dtype=np.int64)
    for there, seen in _group_rows(truth.where, estimates.where):
        if len(there) * len(seen) > MOST_PAIRS:
            raise InputError(f"{estimates.spot(int(seen[0]))}: {_MOST_IN_ONE_IMAGE}, {len(seen)} were given.")
        symmetry = (symmetries or {}).get(int(truth.where[there[0], 2]))
        i, j = linear_sum_assignment(_distances(estimates, seen, truth.t_mm[there], symmetry))
        partner[there[i]] = seen[j]
    return partner


def _group_rows(truth: Any, estimates: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the row indices of truth and estimates for each image and object that both contain."""
    _, key = np.unique(np.concatenate([truth, estimates]), axis=0, return_inverse=True)
    there, seen = (_rows_by_key(keys) for keys in np.split(key.reshape(-1), [len(truth)]))
    yield from ((there[each], seen[each]) for each in sorted(there.keys() & seen.keys()))


def _rows_by_key(keys: Any) -> dict[int, Any]:
    """Key -> indices of the rows with this key, ascending."""
    order = np.argsort(keys, kind="stable")
    each, first = np.unique(keys[order], return_index=True)
    return dict(zip(each.tolist(), np.split(order, first[1:]), strict=True)) if len(keys) else {}
