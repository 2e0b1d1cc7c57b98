"""Fold the poses of a track to the nearest image under the symmetries of its part.

A tracker cannot tell poses apart at which a part looks the same, so it reports any of them: another in each frame, in
blocks, or from some frame on. Folding follows the part: each pose becomes the image that is turned least from the poses
just before it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import (
    Array,
    Solid,
    find_nearest_equivalent_pose,
    find_revolution,
    find_symmetries,
    make_rotation_about_axis,
    pose,
)
from apo_bench.importers.recording.tracks import PoseTrack

_BEFORE = 5
"""A pose is folded to the one of so many poses before it from which the others are turned least."""
_AROUND = 4  # frames before and after one that tell whether it is gross
_FEW = 0.03  # a smaller share of gross frames is left to the robust means of rests
_GROSS_M = 0.03  # smallest distance of a gross frame
_M_PER_RAD = 0.03  # a turn by a radian counts like this distance
_TURNED = np.cos(np.radians(3.0))
"""A pose counts as folded if its image is turned by more than this, as a cosine."""


class FoldedTrack(NamedTuple):
    """A track whose poses are images of those in the log."""

    track: PoseTrack
    turned: NDArray[np.bool_]
    """(n,), frames that are turned by more than 3 degrees to another image than that of most frames."""


def find_gross(track: PoseTrack, solid: Solid) -> NDArray[np.bool_]:
    """Return which frames, (n,), are far from the frames around them (Hampel filter); images count as one pose.

    A frame is gross if it is farther than 30 mm, where a radian counts like 30 mm, and than four times the median
    distance of the frames around, from the one among them that is nearest to all.
    """
    n = len(track.t)
    if n < 2 * _AROUND + 1:
        return np.zeros(n, dtype=np.bool_)
    window = np.clip(np.arange(n)[:, None] + np.arange(-_AROUND, _AROUND + 1), 0, n - 1)
    T = track.T[window]
    apart = measure_distances(solid, T[:, :, None], T[:, None])
    middle = np.median(apart, axis=2).argmin(axis=1)
    rows = np.arange(n)
    usual = np.median(apart[rows, middle], axis=1)
    gross = apart[rows, middle, _AROUND] > np.maximum(_GROSS_M, 4.0 * usual)
    return np.asarray(gross & (gross.mean() > _FEW))


def fold_track(track: PoseTrack, solid: Solid) -> FoldedTrack:
    """Return the track with each pose folded to the nearest image under the exact symmetries of the part.

    Args:
        track: Camera from part.
    """
    symmetric = find_symmetries(solid)
    T = np.array(track.T)
    if len(symmetric) > 1 or find_revolution(solid) is not None:
        for i in range(1, len(T)):
            before = T[max(0, i - _BEFORE) : i]
            near = np.einsum("aij,bij->ab", before[:, :3, :3], before[:, :3, :3]).sum(axis=1).argmax()
            T[i] = find_nearest_equivalent_pose(solid, track.T[i], before[near])
        images = (pose.inverse(track.T) @ T)[:, :3, :3]
        chosen = np.einsum("nij,mij->nm", images, symmetric[:, :3, :3]).argmax(axis=1)
        T = T @ pose.inverse(symmetric[np.bincount(chosen).argmax()])  # the image of most frames stays as reported
    cosine = (np.einsum("nij,nij->n", T[:, :3, :3], track.T[:, :3, :3]) - 1.0) / 2.0
    return FoldedTrack(PoseTrack(track.t, T), cosine < _TURNED)


def list_images(solid: Solid, T: Array, turns: int = 1) -> Array:
    """Return the poses at which a part looks as it does at T, (m, 4, 4), T first.

    Args:
        turns: Number of turns about an axis of revolution, from 0 on.
    """
    images = T @ find_symmetries(solid)
    about = find_revolution(solid)
    if about is None:
        return np.asarray(images)
    angles = 2.0 * np.pi * np.arange(turns) / turns
    return np.concatenate([images @ make_rotation_about_axis(about.point, about.axis, angle) for angle in angles])


def free_twist(solid: Solid) -> Array | None:
    """Return the body twist of a turn about the axis of revolution of a part, (6,); None if it has no such axis."""
    about = find_revolution(solid)
    return None if about is None else np.concatenate([np.cross(about.point, about.axis), about.axis])


def forget_turn(solid: Solid, C: Array) -> Array:
    """Return a covariance of a body twist, (6, 6), with the variance about an axis of revolution, which folding hides.

    It becomes the mean of the variances about the axes across, since no measurement tells it.
    """
    about = find_revolution(solid)
    if about is None:
        return C
    a = about.axis
    across = np.eye(3) - np.outer(a, a)
    R = across @ C[3:, 3:] @ across
    out = np.array(C)
    out[3:, 3:] = R + np.outer(a, a) * np.trace(R) / 2.0
    out[:3, 3:] = C[:3, 3:] @ across
    out[3:, :3] = out[:3, 3:].T
    return out


def turn_as_reported(solid: Solid, T: Array, reported: Array) -> Array:
    """Return a pose with the mean turn about its axis of revolution of reported poses, (n, 4, 4); T for other parts."""
    about = find_revolution(solid)
    if about is None:
        return T
    M = T[:3, :3].T @ reported[:, :3, :3]
    # Of a turn about a, the sum of M * hat(a) is 2 sin, and trace(M) - a . M a is 2 cos.
    sine = (M * pose.hat(about.axis)).sum()
    cosine = (np.trace(M, axis1=1, axis2=2) - np.einsum("i,nij,j->n", about.axis, M, about.axis)).sum()
    return np.asarray(T @ make_rotation_about_axis(about.point, about.axis, float(np.arctan2(sine, cosine))))


def are_alike(a: Solid, b: Solid) -> bool:
    """Return whether two parts have the same shape in their own frames, so that a tracker confuses them."""
    if len(a.pieces) != len(b.pieces):
        return False
    corners = [np.sort(np.concatenate([piece.corners for piece in solid.pieces]).round(6), axis=0) for solid in (a, b)]
    return corners[0].shape == corners[1].shape and bool(np.abs(corners[0] - corners[1]).max() < 1e-5)


def measure_distances(solid: Solid | None, T: Array, other: Array) -> Array:
    """Return distances between poses, [m], to which the turn between their images adds; poses broadcast.

    Args:
        solid: Shape of the part; None: no symmetry is known.
    """
    centre = np.append(np.zeros(3) if solid is None else solid.centroid, 1.0)  # the point that no symmetry moves
    apart = np.linalg.norm((T @ centre - other @ centre)[..., :3], axis=-1)
    return np.asarray(apart + _M_PER_RAD * _turn_between(solid, T, other))


def _turn_between(solid: Solid | None, T: Array, other: Array) -> Array:
    """Return the least angle between images of two poses, [rad]; arguments as of `measure_distances`."""
    D = pose.inverse(T) @ other
    if solid is None:
        return np.asarray(np.linalg.norm(pose.log(D)[..., 3:], axis=-1))
    about = find_revolution(solid)
    if about is not None:  # only the tilt of the axis counts
        tilt = np.abs if about.reversible else (lambda x: x)
        return np.asarray(
            np.arccos(np.clip(tilt(np.einsum("i,...ij,j->...", about.axis, D[..., :3, :3], about.axis)), -1, 1))
        )
    images = D[..., None, :, :] @ find_symmetries(solid)
    traces = np.trace(images[..., :3, :3], axis1=-2, axis2=-1)
    return np.asarray(np.arccos(np.clip((traces.max(axis=-1) - 1.0) / 2.0, -1.0, 1.0)))
