"""Find where a part rests: the frames between two changes of its pose.

A frame is still if the medians of the frames just before and just after it agree within the noise of the track itself;
a stretch of still frames is a rest. Small shifts that no such window shows, such as those of a part that is adjusted by
two millimetres, split a rest in two where its two sides differ by more than chance.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar, final

import numpy as np

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.importers.recording.averaging import Mean, average, common_scatter, pool_mean
from apo_bench.importers.recording.tracks import PoseTrack

LEAST_REST_S = 0.3
"""Least duration of a rest."""
_FEWEST = 4
"""Frames of a rest."""
_ENOUGH_HZ = 30.0
"""Frames a second in which rests are searched."""
_LEAST = copy_frozen(np.repeat([2e-4, 1.7e-3], 3), 6)
"""Noise per axis below which changes are not looked for: 0.2 mm, 0.1 deg."""
_STILL = 5.3
"""sqrt of the 99.99 % quantile of chi-square with 6 degrees of freedom."""
_MEDIAN = 1.77
"""Standard deviation of the difference of two medians of m numbers, times sqrt(m)."""
_SHIFTED = 60.0
"""Chi-square with 6 degrees of freedom beyond which a rest is two: no chance, over all frames of a log."""
_SAME_M = 3e-4
_SAME_RAD = 5e-3
"""Rests that differ by less are one."""
_EDGE = 16.8
"""The 99 % quantile of chi-square with 6 degrees of freedom: frames at the ends of a rest that are farther off move."""
_Item = TypeVar("_Item")
_Span = tuple[int, int]
"""First and last frame."""


@final
@dataclass(frozen=True, eq=False)
class Rest:
    """A stretch of a track in which the part rests."""

    first: int
    last: int
    """Frames of the track."""
    begins: float
    ends: float
    """[s]."""
    gone: float
    """When the part may have been there last, [s]: later than `ends` where it was hidden then."""
    mean: Mean

    @property
    def T(self) -> Array:
        return self.mean.T


def find_rests(track: PoseTrack) -> tuple[Rest, ...]:
    """Return the rests of a track, in order of time: found in frames that are new, averaged over all frames."""
    stride = _stride(track)
    t = track.t[::stride]
    T = track.T[::stride]
    if len(t) < _FEWEST:
        return ()
    noise = np.maximum(_noise(T), _LEAST)
    period_s = max(float(np.median(np.diff(t))), 1e-6)
    half_window = max(3, round(0.5 * LEAST_REST_S / period_s))
    spans = list[_Span]()
    for span in _still_spans(T, noise, half_window):
        a, b = _trim(T, *span, noise)
        if b - a + 1 >= _FEWEST and t[b] - t[a] >= 0.5 * LEAST_REST_S:
            spans += _split(T, a, b, noise)
    # Neighbouring spans of one pose become one, unless the part left and returned.
    groups = group_consecutive(
        spans, lambda group, span: _is_one_rest(T, (group[0][0], group[-1][1]), span, noise, half_window)
    )
    ends = [(group[0][0], group[-1][1]) for group in groups]
    spans = [(stride * a, stride * b) for a, b in ends if t[b] - t[a] >= 0.5 * LEAST_REST_S]
    means = [average(track.T[a : b + 1]) for a, b in spans]
    common = common_scatter(means)
    hidden_s = max(LEAST_REST_S, (2 * _FEWEST - 1) * period_s)
    last_seen = np.flatnonzero(np.diff(track.t) > hidden_s)
    rests = []
    for (a, b), mean in zip(spans, means, strict=True):
        # The last frames of a rest may be off by chance, so that it ends a few frames before the part was hidden.
        seen_again = [float(track.t[i + 1]) for i in last_seen if b <= i <= b + 2 * stride]
        begins, ends_s = float(track.t[a]), float(track.t[b])
        rests.append(Rest(a, b, begins, ends_s, max(seen_again, default=ends_s), pool_mean(mean, common)))
    return tuple(rests)


def _stride(track: PoseTrack) -> int:
    """Every how many frames one is new: trackers repeat a pose until there is another, or smooth over many a second."""
    if len(track.t) < 2:
        return 1
    changes = np.flatnonzero((np.diff(track.T, axis=0) != 0.0).any(axis=(1, 2)))
    repeated = float(np.median(np.diff(changes))) if len(changes) > 1 else 1.0
    rate = 1.0 / max(float(np.median(np.diff(track.t))), 1e-6)
    return max(1, round(repeated), round(rate / _ENOUGH_HZ))


def _noise(T: Array) -> Array:
    """Standard deviation of one frame along and about each axis, (6,), from differences of neighbours.

    Parts rest most of the time, so the median of the differences is that of a part that rests.
    """
    # 1.4826 times the median of |x| is the deviation of a Gaussian; a difference of two frames has sqrt(2) times it.
    d = pose.log(pose.inverse(T[:-1]) @ T[1:])
    return np.asarray(1.4826 * np.median(np.abs(d), axis=0) / np.sqrt(2.0))


def _still_spans(T: Array, noise: Array, m: int) -> list[_Span]:
    """First and last frame of each stretch of still frames, with the half windows at its ends."""
    n = len(T)
    if n <= 2 * m:
        return [(0, n - 1)]
    # Twists of the m frames before each frame and of the m after it, from its own pose: (n - 2 m, 2 m + 1, 6).
    window = np.arange(n - 2 * m)[:, None] + np.arange(2 * m + 1)
    xi = pose.log(pose.inverse(T[m : n - m])[:, None] @ T[window])
    change = np.median(xi[:, m + 1 :], axis=1) - np.median(xi[:, :m], axis=1)
    still = np.linalg.norm(change / noise, axis=1) < _STILL * _MEDIAN / np.sqrt(m)
    # First and last index of each run; where the half windows of two overlap, each gets half of what they share.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    first, last = np.add(edges.reshape(-1, 2), (0, 2 * m - 1)).T
    shared = first[1:] <= last[:-1]
    half = (first[1:] + last[:-1]) // 2
    last[:-1] = np.where(shared, half, last[:-1])
    first[1:] = np.where(shared, half + 1, first[1:])
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _trim(T: Array, a: int, b: int, noise: Array) -> tuple[int, int]:
    """Without frames at the ends that still move: three in a row of them belong to the rest."""
    quarter = (b - a + 1) // 4
    off = pose.log(pose.inverse(average(T[a + quarter : b + 1 - quarter]).T) @ T[a : b + 1])
    near = ((off / noise) ** 2).sum(axis=1) < _EDGE
    good = np.flatnonzero(np.convolve(near, np.ones(3), "valid") == 3)
    return (a + int(good[0]), a + int(good[-1]) + 2) if len(good) else (a + quarter, b - quarter)


def _split(T: Array, a: int, b: int, noise: Array) -> list[_Span]:
    """The stretch, or its parts between small shifts."""
    n = b - a + 1
    if n < 2 * _FEWEST:
        return [(a, b)]
    xi = np.clip(pose.log(pose.inverse(average(T[a : b + 1]).T) @ T[a : b + 1]) / noise, -4.0, 4.0)
    sums = np.cumsum(xi, axis=0)
    # With the frame before which it is cut after k of n: the squared difference of the two means in units of its
    # variance 1/k + 1/(n - k) is chi-square with 6 degrees of freedom if there is no shift.
    k = np.arange(1, n)
    gap = sums[:-1] / k[:, None] - (sums[-1] - sums[:-1]) / (n - k)[:, None]
    chi = (gap**2).sum(axis=1) * k * (n - k) / n / _alike(xi)
    chi[: _FEWEST - 1] = 0.0
    chi[n - _FEWEST :] = 0.0
    at = int(np.argmax(chi))
    size = np.abs(gap[at] * noise)
    if chi[at] < _SHIFTED or (size[:3].max() < _SAME_M and size[3:].max() < _SAME_RAD):
        return [(a, b)]
    return _split(T, a, a + at, noise) + _split(T, a + at + 1, b, noise)


def _alike(xi: Array) -> float:
    """How many times the variance of a mean is that of independent frames: errors of neighbours may be correlated.

    It follows from differences, which a shift of the mean does not change: their mean square is 2 (1 - r) times the
    variance.
    """
    # Neighbours differ by 2 (1 - r) v in the mean square, frames that are far apart by 2 v. The variance of a mean of
    # errors with correlation r from frame to frame is (1 + r) / (1 - r) times that of independent ones.
    far = max(1, min(len(xi) // 4, 8))
    near = float(np.median(np.abs(np.diff(xi, axis=0))))
    wide = float(np.median(np.abs(xi[far:] - xi[:-far])))
    r = 1.0 - min(1.0, (near / max(wide, 1e-12)) ** 2)
    return (1.0 + r) / (1.0 - min(r, 0.99))


def group_consecutive(items: Iterable[_Item], belongs: Callable[[Sequence[_Item], _Item], bool]) -> list[list[_Item]]:
    """Items in their order, in groups: each with those just before it, if it belongs to them."""
    groups: list[list[_Item]] = []
    for item in items:
        if groups and belongs(groups[-1], item):
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups


def _is_one_rest(T: Array, before: _Span, after: _Span, noise: Array, m: int) -> bool:
    mean, mean_after = (average(T[a : b + 1]) for a, b in (before, after))
    off = pose.log(pose.inverse(mean.T) @ mean_after.T)
    deviation = noise * np.sqrt(1.0 / mean.independent + 1.0 / mean_after.independent)
    chi = float(((off / deviation) ** 2).sum())
    if chi > _SHIFTED and (np.abs(off[:3]).max() > _SAME_M or np.abs(off[3:]).max() > _SAME_RAD):
        return False
    between = pose.log(pose.inverse(mean.T) @ T[before[1] + 1 : after[0]]) / noise
    return len(between) <= m or bool((np.abs(np.median(between, axis=0)) < 3.0).all())
