"""Join the tracks of several tags of one part, of which the places on the part are stated or solved."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, Solid, pose
from apo_bench.importers.recording.averaging import average, per_axis
from apo_bench.importers.recording.folding import fold_track, list_images
from apo_bench.importers.recording.objects_file import TrackedPart
from apo_bench.importers.recording.tracks import PoseTrack, span_of

_FEWEST_COMMON = 3  # frames that show two tags, from which their offset is solved
_FRAMES_BESIDE = 4  # frames of each id, before and after one follows another
_TURNS = 24  # turns about an axis of revolution that are compared
_NEAR_S = 0.5  # largest time between the last frame of an id and the first of the id that follows it
_SAME_M = 0.008  # an id that goes on within this, and three standard deviations, is another name of the one before
_SAME_RAD = 0.3  # the same for a turn


class TagOffset(NamedTuple):
    """The place of a tag on its part."""

    t: Array
    """(n,), times at which this tag gives the pose, [s]."""
    T: Array
    """(4, 4), pose of the part in the frame of the tag, [m]."""
    covariance: Array
    """(6, 6), body twist of the part, [m, rad]."""
    source: str
    """How it was found."""
    is_doubtful: bool = False


def join_tags(
    tags: Sequence[tuple[str, PoseTrack]], tracked: TrackedPart, solid: Solid | None
) -> tuple[PoseTrack, list[tuple[str, TagOffset]]]:
    """Return the track of a part from all its ids, camera from part, and the place of each tag but the first.

    Args:
        tags: Id and track of each tag, camera from model.
    """
    (_, first), *others = tags
    track = PoseTrack(first.t, first.T @ tracked.T_model_part)
    offsets = []
    for name, other in others:
        if name in tracked.others:
            offset = TagOffset(other.t, tracked.others[name], np.zeros((6, 6)), "with its frame as stated")
        else:
            folded = track if solid is None else fold_track(track, solid).track
            offset = _solve_offset(folded, PoseTrack(other.t, other.T @ tracked.T_model_part), solid)
            offset = offset._replace(T=tracked.T_model_part @ offset.T)
        offsets.append((name, offset))
        track = _merge(track, PoseTrack(other.t, other.T @ offset.T))
    return track, offsets


def _solve_offset(track: PoseTrack, other: PoseTrack, solid: Solid | None) -> TagOffset:
    """Return the place of another tag, from common frames or from where it follows the first."""
    apart = np.abs(track.t[:, None] - other.t)
    near = apart.argmin(axis=1)
    common = apart.min(axis=1) <= 0.5 * min(span_of(track), span_of(other))
    if common.sum() >= _FEWEST_COMMON:
        mean = average(pose.inverse(other.T[near[common]]) @ track.T[common])
        text = f"its frame solved from {int(common.sum())} common frames within {_size_text(mean.covariance)}"
        return TagOffset(other.t, mean.T, mean.covariance, text)
    i = int(apart.min(axis=1).argmin())
    j = int(near[i])
    same = TagOffset(other.t, np.eye(4), np.zeros((6, 6)), "taken for another name of the first id")
    if apart[i, j] > _NEAR_S:
        text = f"{same.source}, though it begins {apart[i, j]:.1f} s apart; state its `frame`"
        return same._replace(source=text, is_doubtful=True)
    T, C, n = _solve_step(track, other, i, j)
    images = pose.log(T[None] if solid is None else list_images(solid, T, _TURNS))
    size = 3.0 * np.sqrt(np.trace(C[:3, :3]))
    is_near = np.linalg.norm(images[:, :3], axis=1) < _SAME_M + size
    if (is_near & (np.linalg.norm(images[:, 3:], axis=1) < _SAME_RAD)).any():
        return same._replace(source=f"{same.source}, since it goes on where that ends")
    text = (
        f"its frame solved within {_size_text(C)} from {n} frames where it follows the first id, "
        "since no frame shows both; state its `frame`"
    )
    return TagOffset(other.t, T, C, text, True)


def _solve_step(track: PoseTrack, other: PoseTrack, i: int, j: int) -> tuple[Array, Array, int]:
    """Return the place of a tag that follows another, its covariance, and the number of frames.

    A part moves smoothly from the last frames of one tag to the first of the other: least squares for a parabola and a
    step between.

    Args:
        i, j: The frames of both that are nearest in time.
    """
    between = pose.inverse(other.T[j]) @ track.T[i]
    mine = slice(max(0, i + 1 - _FRAMES_BESIDE), i + 1) if track.t[i] < other.t[j] else slice(i, i + _FRAMES_BESIDE)
    its = slice(j, j + _FRAMES_BESIDE) if track.t[i] < other.t[j] else slice(max(0, j + 1 - _FRAMES_BESIDE), j + 1)
    t = np.concatenate([track.t[mine], other.t[its]]) - track.t[i]
    xi = pose.log(pose.inverse(track.T[i]) @ np.concatenate([track.T[mine], other.T[its] @ between]))
    is_other = np.arange(len(t)) >= len(track.t[mine])
    A = np.column_stack([np.ones(len(t)), t, t**2, is_other])
    x, _, rank, _ = np.linalg.lstsq(A, xi, rcond=None)
    variance = ((xi - A @ x) ** 2).sum(axis=0) / max(len(t) - rank, 1) * np.linalg.pinv(A.T @ A)[3, 3]
    return between @ pose.exp(-x[3]), np.diag(variance), len(t)


def _size_text(C: Array) -> str:
    """Return the standard deviations along and about an axis of a covariance, (6, 6), as text."""
    m, rad = per_axis(C)
    return f"{1e3 * m:.2f} mm {np.degrees(rad):.2f} deg"


def _merge(track: PoseTrack, other: PoseTrack) -> PoseTrack:
    """Return the poses of two tags of a part as one track: those of the second where the first has none."""
    alone = np.abs(track.t[:, None] - other.t).min(axis=0) > 0.5 * span_of(track)
    t = np.concatenate([track.t, other.t[alone]])
    order = np.argsort(t, kind="stable")
    return PoseTrack(t[order], np.concatenate([track.T, other.T[alone]])[order])
