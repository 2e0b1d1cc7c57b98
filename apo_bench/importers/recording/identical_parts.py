"""Follow identical parts from image to image, as trackers give them one id, or swap their ids."""

from collections.abc import Mapping, Sequence
from itertools import permutations, product

import numpy as np
from scipy.optimize import linear_sum_assignment

from apo_bench.geometry import Array, Ints, Solid
from apo_bench.importers.recording.folding import are_alike, measure_distances
from apo_bench.importers.recording.tracks import PoseTrack, span_of

_FAR_M = 0.03  # a farther pose is as unlikely to be of a part as any other
_SWITCH = 0.4
"""Cost of another id than before; a distance of `_FAR_M` costs 1."""
_GATE_M = 0.05  # a pose farther from the last one of a part is none of it
_FASTEST_M_S = 1.5  # speed of a part, by which it may be farther
_SAME_IMAGE = 0.3  # poses within this share of the usual step of a track are of one image
_MOST_CHOICES = 120  # ways in which identical parts are told apart, at most


def list_matchings(identical: Sequence[Sequence[str]]) -> Sequence[Mapping[str, str]]:
    """Return the ways in which tracks of identical parts may belong to them: part -> part whose track is its own."""
    each = [[dict(zip(parts, order, strict=True)) for order in permutations(parts)] for parts in identical]
    ways = [{k: v for one in way for k, v in one.items()} for way in product(*each)]
    return ways[:_MOST_CHOICES]


def follow_parts(t: Array, T: Array, labels: Ints, k: int, solid: Solid | None) -> Ints:
    """Return which of k identical parts each pose is of, (n,), -1 for none.

    The poses of one image are assigned to the last poses of the parts by least cost (Hungarian method). A distance
    beyond `_FAR_M` costs no more, since a hidden part may reappear anywhere while another one rests.

    Args:
        t: (n,), not decreasing, [s].
        T: (n, 4, 4), [m].
        labels: (n,), number of the id in the log.
    """
    own = np.full(len(t), -1)
    last = np.full((k, 4, 4), np.nan)
    seen = np.zeros(k)  # time of the last pose, [s]
    named = np.arange(k)
    step = span_of(PoseTrack(np.unique(t[labels == labels[0]]), T[:0]))
    for at in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > _SAME_IMAGE * step) + 1):
        known = ~np.isnan(last[:, 0, 0])
        off = np.full((k, len(at)), _GATE_M)
        off[known] = measure_distances(solid, last[known][:, None], T[at][None])
        cost = np.minimum(off / _FAR_M, 1.0) + 1e-3 * off + _SWITCH * (named[:, None] != labels[None, at])
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            i = int(at[column])
            if not known[row] or off[row, column] <= _GATE_M + _FASTEST_M_S * (t[i] - seen[row]):
                own[i], last[row], seen[row], named[row] = row, T[i], t[i], labels[i]
    return own


def undo_swaps(tracks: dict[str, PoseTrack], groups: Sequence[Sequence[str]], solids: Mapping[str, Solid]) -> list[str]:
    """Give poses of identical parts back to the part that was there, where a tracker swapped ids.

    Args:
        tracks: Changed in place.
        groups: Parts that look the same.

    Returns:
        A note for each group of which ids were swapped.
    """
    notes = []
    for group in groups:
        t = np.concatenate([tracks[part].t for part in group])
        order = np.argsort(t, kind="stable")
        t, T = t[order], np.concatenate([tracks[part].T for part in group])[order]
        labels = np.repeat(np.arange(len(group)), [len(tracks[part].t) for part in group])[order]
        own = follow_parts(t, T, labels, len(group), solids[group[0]])
        swapped = (own != labels) & (own >= 0)
        if swapped.any():
            tracks.update({part: PoseTrack(t[own == i], T[own == i]) for i, part in enumerate(group)})
            notes.append(
                f"ids of {' and '.join(group)} swapped in {int(swapped.sum())} frames from "
                f"{t[swapped][0]:.2f} s on, and put right"
            )
    return notes


def group_identical(parts: Sequence[str], models: Mapping[str, Array], solids: Mapping[str, Solid]) -> list[list[str]]:
    """Return the groups of parts that look the same to a tracker.

    Args:
        models: Part -> pose of its frame in the tracker's model.
    """
    groups: list[list[str]] = []
    for part in (part for part in parts if part in solids):
        for group in groups:
            if are_alike(solids[group[0]], solids[part]) and np.allclose(models[group[0]], models[part], atol=1e-5):
                group.append(part)
                break
        else:
            groups.append([part])
    return [group for group in groups if len(group) > 1]
