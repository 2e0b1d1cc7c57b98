"""Match the ids of a log to parts: several tags on a part, one id for identical parts, ids that were swapped."""

from collections.abc import Mapping, Sequence
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from apo_bench.errors import one_line, require
from apo_bench.geometry import Array, Ints, Solid, pose
from apo_bench.importers.recording.averaging import average, per_axis
from apo_bench.importers.recording.folding import are_alike, fold_track, list_images, measure_distances
from apo_bench.importers.recording.objects_file import ObjectsFile, TrackedPart
from apo_bench.importers.recording.tracks import Log, PoseTrack, best_poses, span_of

_GATE_M = 0.05  # a pose farther from the last one of a part is none of it at first
_FASTEST_M_S = 1.5  # speed of a part, by which it may be farther
_FORGET_S = 0.3  # longest time for which the speed counts
_SWITCH_M = 0.008  # cost of another id than before
_MOST_CHOICES = 120  # ways in which identical parts are told apart, at most
_FEWEST_COMMON = 3  # frames that show two tags, from which their offset is solved
_FRAMES_BESIDE = 4  # frames of each id, before and after one follows another
_TURNS = 24  # turns about an axis of revolution that are compared
_SAME_M = 0.008  # an id that goes on within this, and a step of the part, is another name of the one before
_SAME_RAD = 0.3  # the same for a turn
_NEAR_S = 0.5  # largest time between the last frame of an id and the first of the id that follows it
_MOST_IDS = 12  # ids that an error names


class TagOffset(NamedTuple):
    """The uncertainty of the place of a tag on its part."""

    t: Array
    """(n,), times at which this tag gives the pose, [s]."""
    covariance: Array
    """(6, 6), body twist of the part, [m, rad]."""


class MatchedTracks(NamedTuple):
    """The track of each part, with what was done to find it."""

    tracks: Mapping[str, PoseTrack]
    """Camera from part."""
    identical: Sequence[Sequence[str]]
    """Groups of parts with one id, whose tracks may belong to one another."""
    lost: Mapping[str, int]
    """Kind of lost frame -> number of frames that were left out."""
    offsets: Mapping[str, Sequence["TagOffset"]]
    """Part -> tags whose place on it was solved."""
    notes: Sequence[str]
    doubts: Sequence[str]
    """What may be wrong, one sentence each."""


def match_tracks(log: Log, objects: ObjectsFile, solids: Mapping[str, Solid]) -> MatchedTracks:
    """Return the track of each part, camera from part.

    Args:
        solids: Shapes of parts by name, for their symmetries; a part that is missing has none.

    Raises:
        InputError: No id of a part is in the log.
    """
    ids = {part: [_find_id(name, log) for name in tracked.ids] for part, tracked in objects.parts.items()}
    notes: list[str] = []
    doubts: list[str] = []
    for part, found in ids.items():
        missing = [name for name, known in zip(objects.parts[part].ids, found, strict=True) if known is None]
        if missing:
            doubts.append(f"the id {', '.join(missing)} of '{part}' is not in the log")
    require(
        any(known is not None for found in ids.values() for known in found),
        f"{log.file}: no id of {objects.file} is in the log; its ids are {_listed(log.candidates)}.",
    )
    used = {known for found in ids.values() for known in found if known is not None}
    for name in log.candidates.keys() - used:
        if name not in objects.ignored and name.rpartition("/")[2] not in objects.ignored:
            poses = log.candidates[name]
            doubts.append(
                f"the id '{one_line(name, 60)}' is no part, so its {len(poses.t)} poses from {poses.t[0]:.2f} s on are "
                "left out; name its part, or list it under `ignore`, in the objects file"
            )
    tracks: dict[str, PoseTrack] = {}
    offsets: dict[str, list[TagOffset]] = {}
    by_ids: dict[tuple[str, ...], list[str]] = {}
    for part, found in ids.items():
        known_ids = tuple(known for known in found if known is not None)
        if known_ids:
            by_ids.setdefault(known_ids, []).append(part)
    identical = []
    for known_ids, parts in by_ids.items():
        if len(parts) == 1:
            tracks[parts[0]] = _join_tags(
                log, parts[0], objects.parts[parts[0]], known_ids, solids, offsets, notes, doubts
            )
            continue
        require(len(known_ids) == 1, f"{objects.file}: parts that share an id have that id alone.")
        frames = [objects.parts[part].T_model_part for part in parts]
        poses = log.candidates[known_ids[0]]
        labels = follow_parts(poses.t, poses.T @ frames[0], None, len(parts), solids.get(parts[0]))
        for i, part in enumerate(parts):
            mine = labels == i
            require(
                mine.any(), f"{log.file}: the id '{known_ids[0]}' is that of {len(parts)} parts, and {i} are there."
            )
            tracks[part] = PoseTrack(poses.t[mine], poses.T[mine] @ frames[i])
        identical.append(parts)
        notes.append(f"id {known_ids[0]} followed as {len(parts)} parts ({', '.join(parts)})")
    notes += _undo_swaps(tracks, [part for parts in identical for part in parts], objects, solids)
    lost: dict[str, int] = {}
    for name in used:
        for kind, n in log.candidates[name].lost.items():
            lost[kind] = lost.get(kind, 0) + n
    return MatchedTracks(tracks, identical, lost, offsets, notes, doubts)


def _find_id(name: str, log: Log) -> str | None:
    """Return the id of the log that an id of the objects file means: itself, or the only one with it in its path."""
    if name in log.candidates:
        return name
    among = [known for known in log.candidates if name.strip("/") in (known, *known.split("/"))]
    among = among or [known for known in log.candidates if known.lower() == name.lower()]
    return among[0] if len(among) == 1 else None


def _listed(names: Mapping[str, object]) -> str:
    return ", ".join(f"'{one_line(name, 60)}'" for name in [*names][:_MOST_IDS])


def list_matchings(identical: Sequence[Sequence[str]]) -> Sequence[Mapping[str, str]]:
    """Return the ways in which tracks of identical parts may belong to them: part -> part whose track is its own."""
    each = [[dict(zip(parts, order, strict=True)) for order in permutations(parts)] for parts in identical]
    ways = [{k: v for one in way for k, v in one.items()} for way in product(*each)]
    return ways[:_MOST_CHOICES]


def follow_parts(t: Array, T: Array, labels: Ints | None, k: int, solid: Solid | None) -> Ints:
    """Return which of k identical parts each pose is of, (n,), -1 for none.

    The poses of one image are assigned to the last poses of the parts by least distance, where no distance counts for
    more than a gate (Hungarian method).

    Args:
        t: (n,), not decreasing, [s].
        T: (n, 4, 4), [m].
        labels: (n,), part that the id of the log names; None: the log does not tell. Another part costs a little.
    """
    own = np.full(len(t), -1)
    last = np.full((k, 4, 4), np.nan)
    seen = np.zeros(k)  # time of the last pose, [s]
    unsure = np.full(k, -1)  # a pose that was too far away, until the next one is near it
    named = np.arange(k)
    span = span_of(PoseTrack(np.unique(t), np.zeros((0, 4, 4))))
    images = np.cumsum(np.concatenate([[0], np.diff(t) > (0.5 * span if labels is not None else 1e-9)]))
    for at in np.split(np.arange(len(t)), np.flatnonzero(np.diff(images)) + 1):
        if labels is not None:
            at = _one_for_each(at, labels)
        known = ~np.isnan(last[:, 0, 0])
        gate = _GATE_M + _FASTEST_M_S * np.minimum(t[at[0]] - seen, _FORGET_S)
        off = np.full((k, len(at)), _GATE_M)
        if known.any():
            off[known] = measure_distances(solid, last[known][:, None], T[at][None])
        cost = np.minimum(off, gate[:, None]) + 1e-3 * off
        if labels is not None:
            cost = cost + _SWITCH_M * (named[:, None] != labels[None, at])
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            i = int(at[column])
            far = known[row] and off[row, column] > gate[row]
            if far and not (unsure[row] >= 0 and measure_distances(solid, T[unsure[row]], T[i]) < gate[row]):
                unsure[row] = i
                own[i] = -1 if labels is None else row
                continue
            if far:
                own[unsure[row]] = row
            own[i], last[row], seen[row], unsure[row] = row, T[i], t[i], -1
            if labels is not None:
                named[row] = labels[i]
    return own


def _one_for_each(at: Ints, labels: Ints) -> Ints:
    """Return the last index of each label among indices."""
    return np.array(sorted({int(labels[i]): int(i) for i in at}.values()))


def _undo_swaps(
    tracks: dict[str, PoseTrack], apart: Sequence[str], objects: ObjectsFile, solids: Mapping[str, Solid]
) -> list[str]:
    """Give poses of parts with the same shape back to the part that was there, where a tracker swapped ids.

    Args:
        tracks: Changed in place.
        apart: Parts with one id, which were followed already.

    Returns:
        A note for each pair of parts that were swapped.
    """
    groups: list[list[str]] = []
    for part in (part for part in tracks if part in solids and part not in apart):
        same = [
            group
            for group in groups
            if are_alike(solids[group[0]], solids[part])
            and np.allclose(objects.parts[group[0]].T_model_part, objects.parts[part].T_model_part, atol=1e-5)
        ]
        if same:
            same[0].append(part)
        else:
            groups.append([part])
    notes = []
    for group in (group for group in groups if len(group) > 1):
        t = np.concatenate([tracks[part].t for part in group])
        T = np.concatenate([tracks[part].T for part in group])
        labels = np.repeat(np.arange(len(group)), [len(tracks[part].t) for part in group])
        order = np.argsort(t, kind="stable")
        t, T, labels = t[order], T[order], labels[order]
        own = follow_parts(t, T, labels, len(group), solids[group[0]])
        swapped = (own != labels) & (own >= 0)
        if not swapped.any():
            continue
        for i, part in enumerate(group):
            mine = own == i
            tracks[part] = PoseTrack(t[mine], T[mine])
        notes.append(
            f"ids of {' and '.join(group)} swapped in {int(swapped.sum())} frames from "
            f"{t[swapped][0]:.2f} s on, and put right"
        )
    return notes


def _join_tags(
    log: Log,
    part: str,
    tracked: TrackedPart,
    ids: Sequence[str],
    solids: Mapping[str, Solid],
    offsets: dict[str, list[TagOffset]],
    notes: list[str],
    doubts: list[str],
) -> PoseTrack:
    """Return the track of a part from all its ids, camera from part; places of tags are solved.

    Args:
        offsets, notes, doubts: Extended by what was done.
    """
    first = best_poses(log.candidates[ids[0]])
    track = PoseTrack(first.t, first.T @ tracked.T_model_part)
    for name in ids[1:]:
        other = best_poses(log.candidates[name])
        if name in tracked.others:
            own = PoseTrack(other.t, other.T @ tracked.others[name])
            notes.append(f"id {name} is another tag of {part}, with its frame as stated")
        else:
            folded = track if part not in solids else fold_track(track, solids[part]).track
            other = PoseTrack(other.t, other.T @ tracked.T_model_part)
            solved = _solve_offset(folded, other, solids.get(part))
            own = PoseTrack(other.t, other.T @ solved.T)
            offsets.setdefault(part, []).append(TagOffset(other.t, solved.covariance))
            (doubts if solved.is_doubtful else notes).append(f"id {name} is another tag of {part}, {solved.source}")
        track = _merge(track, own)
    return track


class _Offset(NamedTuple):
    """The pose of a part in the frame of another tag."""

    T: Array
    covariance: Array
    source: str
    is_doubtful: bool = False


def _solve_offset(track: PoseTrack, other: PoseTrack, solid: Solid | None) -> _Offset:
    """Return the pose of a part in the frame of another tag, from common frames or from where it follows the first."""
    span = min(span_of(track), span_of(other))
    near = np.clip(np.searchsorted(other.t, track.t - 0.5 * span), 0, len(other.t) - 1)
    common = np.abs(other.t[near] - track.t) <= 0.5 * span
    if common.sum() >= _FEWEST_COMMON:
        mean = average(pose.inverse(other.T[near[common]]) @ track.T[common])
        text = f"its frame solved from {int(common.sum())} common frames within {_size_text(mean.covariance)}"
        return _Offset(mean.T, mean.covariance, text)
    gaps = np.abs(track.t[:, None] - other.t[None, :])
    i, j = (int(x) for x in np.unravel_index(int(np.argmin(gaps)), gaps.shape))
    between = pose.inverse(other.T[j]) @ track.T[i]
    images = between[None] if solid is None else list_images(solid, between, _TURNS)
    off = pose.log(images)
    step_m = max(
        np.linalg.norm(np.diff(each, axis=0), axis=1).mean()
        for each in (track.T[max(0, i - 3) : i + 3, :3, 3], other.T[max(0, j - 3) : j + 3, :3, 3])
    )
    is_same = bool(
        np.any(
            (np.linalg.norm(off[:, :3], axis=1) < _SAME_M + step_m * gaps[i, j] / span)
            & (np.linalg.norm(off[:, 3:], axis=1) < _SAME_RAD)
        )
    )
    if is_same or gaps[i, j] > _NEAR_S:
        text = "taken for another name of the first id, since it goes on where that ends"
        if not is_same:
            text = (
                f"taken for another name of the first id, though it begins {gaps[i, j]:.1f} s apart; state its `frame`"
            )
        return _Offset(np.eye(4), np.zeros((6, 6)), text, not is_same)
    # The part moves smoothly from the last frames of one id to the first of the other: a parabola, and a step between.
    sides = (track, other) if track.t[i] < other.t[j] else (other, track)
    before = np.flatnonzero(sides[0].t <= min(track.t[i], other.t[j]))[-_FRAMES_BESIDE:]
    after = np.flatnonzero(sides[1].t >= max(track.t[i], other.t[j]))[:_FRAMES_BESIDE]
    t = np.concatenate([sides[0].t[before], sides[1].t[after]]) - track.t[i]
    poses = [
        (each.T @ between if each is other else each.T)[at] for each, at in zip(sides, (before, after), strict=True)
    ]
    xi = pose.log(pose.inverse(track.T[i]) @ np.concatenate(poses))
    is_other = np.repeat([each is other for each in sides], [len(before), len(after)])
    A = np.column_stack([np.ones(len(t)), t, t**2, is_other])
    x, _, rank, _ = np.linalg.lstsq(A, xi, rcond=None)
    left = xi - A @ x
    variance = (left**2).sum(axis=0) / max(len(t) - rank, 1) * np.linalg.pinv(A.T @ A)[3, 3]
    text = (
        f"its frame solved within {_size_text(np.diag(variance))} from {len(t)} frames where it follows the first id, "
        "since no frame shows both; state its `frame`"
    )
    return _Offset(between @ pose.exp(-x[3]), np.diag(variance), text, True)


def _size_text(C: Array) -> str:
    """Return the standard deviations along and about an axis of a covariance, (6, 6), as text."""
    m, rad = per_axis(C)
    return f"{1e3 * m:.2f} mm {np.degrees(rad):.2f} deg"


def _merge(track: PoseTrack, other: PoseTrack) -> PoseTrack:
    """Return the poses of two tags of a part as one track; of poses at one time, the mean if they agree."""
    t = np.concatenate([track.t, other.t])
    T = np.concatenate([track.T, other.T])
    order = np.argsort(t, kind="stable")
    t, T = t[order], T[order]
    span = 0.5 * span_of(track)
    times, poses = [float(t[0])], [T[0]]
    for when, M in zip(t[1:].tolist(), T[1:], strict=True):
        off = pose.log(pose.inverse(poses[-1]) @ M)
        if when - times[-1] > span:
            times.append(when)
            poses.append(M)
        elif np.linalg.norm(off[:3]) < _GATE_M and np.linalg.norm(off[3:]) < 0.5:
            poses[-1] = poses[-1] @ pose.exp(0.5 * off)
    return PoseTrack(np.array(times), np.array(poses))
