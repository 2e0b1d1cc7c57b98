"""Residuals of a pose estimator in the frames of the rays of its camera."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError
from apo_bench.formats.bop import PoseRows
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import Camera

INLIER_MM = 50.0
"""An estimate that is farther off than this is of something else."""
TURNED_DEG = 30.0
"""An estimate that is turned more than this is of a part that looks the same when turned, or is upside down;
which of the two, only the symmetries of the models would show."""
_GAP_DEG = 55.0
_IN_GAP = 1.0 / 30.0
"""Where a part looks the same only when turned by 60 degrees or more, few turns are between `TURNED_DEG` and this: less
than this part of all, where 14 % are if any turn about an axis is as likely."""
_FEWEST_ALIKE = 5
_ALIKE = 0.1
"""So many gross estimates of an object, and so large a part of those found, have to agree on a point."""
_NEAR = 4.0
"""They agree within so many times the median error of estimates that are upright."""
_MOST_POINTS = 500
"""Points of so many estimates are tried."""
MOST_PAIRS = 10_000_000
_MOST_IN_ONE_IMAGE = "at most 3000 estimates of one object in one image can be matched; leave out those of low score"


@final
@dataclass(frozen=True, eq=False)
class Residuals:
    """One row for every part that was there; what nothing was found for is NaN."""

    where: NDArray[np.int64]
    """(n, 3): scene, image, object."""
    shift_mm: Array
    """(n, 3), from the true to the estimated place: x, y, along the ray; of one that is `beside`, of that point."""
    turn_deg: Array
    """(n, 3), rotation vector from the true to the estimated rotation: about x, about y, about the ray."""
    trace_deg: Array
    """(n,), the angle that the trace of the two matrices says as they are written."""
    score: Array
    """(n,), of the estimate."""
    surplus: int = 0
    """Estimates, in images of the truth, that were left when every part had one."""
    absent: int = 0
    """Those of them whose object is not in the image at all."""
    distance_mm: float = float("nan")
    """Median distance from the camera."""
    beside: int = 0
    """Estimates that are turned about a point of the part 25 mm and more from its origin, and else right."""

    @cached_property
    def found(self) -> NDArray[np.bool_]:
        return np.isfinite(self.shift_mm[:, 0])

    @cached_property
    def inlier(self) -> NDArray[np.bool_]:
        return np.nan_to_num(self.off_mm, nan=np.inf) < INLIER_MM

    @cached_property
    def upright(self) -> NDArray[np.bool_]:
        """Inliers that are not turned, whose shift is known: the axis of a symmetry may lie off the origin of a part,
        so that even the shift of one that is turned says nothing."""
        return self.inlier & (np.nan_to_num(self.angle_deg, nan=np.inf) < TURNED_DEG)

    @cached_property
    def round_objects(self) -> tuple[int, ...]:
        """Objects that seem to look the same turned by any angle about an axis: fewer than half of their inliers are
        upright, and turns are everywhere."""
        parts = list[int]()
        for part in np.unique(self.where[self.inlier, 2]).tolist():
            angle = self.angle_deg[self.inlier & (self.where[:, 2] == part)]
            between = (angle >= TURNED_DEG) & (angle < _GAP_DEG)
            if np.mean(angle < TURNED_DEG) < 0.5 and between.mean() > _IN_GAP:
                parts.append(part)
        return tuple(parts)

    @cached_property
    def turn_known(self) -> NDArray[np.bool_]:
        """Upright ones of objects that are not round."""
        return self.upright & ~np.isin(self.where[:, 2], self.round_objects)

    @cached_property
    def off_mm(self) -> Array:
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


def match_residuals(estimates: PoseRows, truth: PoseRows) -> Residuals:
    """Match estimates to the truth and say how far off they are; those of images without truth do not count.

    Per image and object, every part that was there gets its own estimate so that the distances add up to the
    least (the Hungarian method), however far off: `INLIER_MM` marks what is gross afterwards. Scores do not count.
    Rotations are the nearest ones to the matrices as written.
    """
    from scipy.spatial.transform import Rotation

    partner = match_rows(estimates, truth)
    found = partner >= 0
    n = len(partner)
    in_images = _among(estimates.where[:, :2], truth.where[:, :2])
    # BOP poses are in the frame of the camera, so its own pose is the identity. F^t takes errors into the ray's frame.
    there = np.tile(np.eye(4), (n, 1, 1))
    there[:, :3, 3] = truth.t_mm * 1e-3
    F = Camera(np.eye(4)).frames(there)[found]
    R = truth.R[found]
    R_obs = estimates.R[partner[found]]
    right = pose.nearest_rotations(R)
    turn = Rotation.from_matrix(pose.nearest_rotations(R_obs) @ np.swapaxes(right, 1, 2)).as_rotvec(degrees=True)
    shift = np.full((n, 3), np.nan)
    turned = np.full((n, 3), np.nan)
    moved = estimates.t_mm[partner[found]] - truth.t_mm[found]
    beside, moved = _about_fixed_points(truth.where[found, 2], moved, right, pose.nearest_rotations(R_obs))
    shift[found] = np.einsum("nji,nj->ni", F, moved)
    turned[found] = np.einsum("nji,nj->ni", F, turn)
    # trace(R_obs R^t) = 1 + 2 cos(angle).
    trace = np.full(n, np.nan)
    trace[found] = np.degrees(np.arccos(np.clip((np.einsum("nij,nij->n", R_obs, R) - 1.0) / 2.0, -1.0, 1.0)))
    return Residuals(
        where=truth.where,
        shift_mm=shift,
        turn_deg=turned,
        trace_deg=trace,
        score=np.where(found, estimates.score[partner], np.nan),
        surplus=int(in_images.sum() - found.sum()),
        absent=int(np.sum(in_images & ~_among(estimates.where, truth.where))),
        distance_mm=float(np.median(np.linalg.norm(truth.t_mm, axis=1))),
        beside=int(beside.sum()),
    )


def _about_fixed_points(
    objects: NDArray[np.int64], moved: Array, R: Array, R_obs: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Which gross estimates only turn a part about a point that is fixed in it, and all shifts, of theirs that point.

    A part that looks the same when turned about an axis off its origin is observed with its origin far off, though it
    stands where it is. Every symmetry keeps a point c, so the turned estimates of one object agree on it: (R - I) c + t
    is as small as the errors of those that are upright.

    Args:
        objects: (n,), of each estimate.
        moved: (n, 3), from the true to the estimated origin, camera axes, mm.
        R: (n, 3, 3), true rotations; R_obs are the estimated ones.

    Returns:
        (n,) and (n, 3), mm.
    """
    off = np.linalg.norm(moved, axis=1)
    D = np.swapaxes(R, 1, 2) @ R_obs - np.eye(3)
    t = np.einsum("nji,nj->ni", R, moved)
    # |R - I| = 2 sqrt(2) sin(angle / 2) for the Frobenius norm.
    is_turned = np.linalg.norm(D, axis=(1, 2)) >= 2.0 * np.sqrt(2.0) * np.sin(np.radians(TURNED_DEG) / 2.0)
    beside = np.zeros(len(off), dtype=np.bool_)
    shifts = np.array(moved)
    for each in np.unique(objects).tolist():
        of_it = objects == each
        upright = of_it & (off < INLIER_MM) & ~is_turned
        left = np.flatnonzero(of_it & (off >= INLIER_MM) & is_turned)
        fewest = max(_FEWEST_ALIKE, _ALIKE * of_it.sum())
        near = _NEAR * float(np.median(off[upright])) if upright.any() else 0.0
        while len(left) >= fewest:
            few = left[:_MOST_POINTS]
            points = -np.einsum("nij,nj->ni", np.linalg.pinv(D[few], rcond=1e-6), t[few])
            kept = np.array([_point_off(D[left], t[left], c) < near for c in points])
            agree = left[kept[np.argmax(kept.sum(axis=1))]]
            if len(agree) < fewest:
                break
            c = np.linalg.lstsq(D[agree].reshape(-1, 3), -t[agree].reshape(-1), rcond=0.1)[0]
            stands = left[_point_off(D[left], t[left], c) < INLIER_MM]
            shifts[stands] = moved[stands] + (R_obs[stands] - R[stands]) @ c
            beside[stands] = True
            left = np.setdiff1d(left, np.union1d(stands, agree))
    return beside, shifts


def _point_off(D: Array, t: Array, c: Array) -> Array:
    """How far a point c of a part is moved, (n,), by rotations less the identity (n, 3, 3) and shifts (n, 3)."""
    return np.asarray(np.linalg.norm(D @ c + t, axis=1))


def _among(rows: Any, known: Any) -> NDArray[np.bool_]:
    """Whether each row stands among those that are known, (n,)."""
    _, key = np.unique(np.concatenate([known, rows]), axis=0, return_inverse=True)
    key = key.reshape(-1)
    return np.isin(key[len(known) :], key[: len(known)])


def match_rows(estimates: PoseRows, truth: PoseRows) -> NDArray[np.int64]:
    """The row of the estimates that belongs to each row of the truth, or -1, (n,)."""
    from scipy.optimize import linear_sum_assignment

    partner = np.full(len(truth.where), -1, dtype=np.int64)
    for there, seen in _groups(truth.where, estimates.where):
        if len(there) * len(seen) > MOST_PAIRS:
            raise InputError(f"{estimates.spot(int(seen[0]))}: {_MOST_IN_ONE_IMAGE}, {len(seen)} were given.")
        i, j = linear_sum_assignment(np.linalg.norm(truth.t_mm[there][:, None] - estimates.t_mm[seen][None], axis=2))
        partner[there[i]] = seen[j]
    return partner


def _groups(truth: Any, estimates: Any) -> Iterator[tuple[Any, Any]]:
    """Rows of the truth and of the estimates that are of one object in one image, where there are both."""
    _, key = np.unique(np.concatenate([truth, estimates]), axis=0, return_inverse=True)
    there, seen = (_rows_by_key(keys) for keys in np.split(key.reshape(-1), [len(truth)]))
    yield from ((there[each], seen[each]) for each in sorted(there.keys() & seen.keys()))


def _rows_by_key(keys: Any) -> dict[int, Any]:
    """Key -> the rows that have it, in their order."""
    order = np.argsort(keys, kind="stable")
    each, first = np.unique(keys[order], return_index=True)
    return dict(zip(each.tolist(), np.split(order, first[1:]), strict=True)) if len(keys) else {}
