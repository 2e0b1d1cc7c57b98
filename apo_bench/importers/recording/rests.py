"""Find the rests of a part in its track: the stretches of frames between changes of its pose.

A frame is still if the medians of the frames just before and just after it agree within the noise of the track. A
stretch of still frames is a rest. Smaller shifts, such as an adjustment by two millimetres, do not show in such a
window; they split a rest where its two sides differ by more than chance.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar, final

import numpy as np

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.importers.recording.averaging import Mean, average, common_scatter, pool_mean
from apo_bench.importers.recording.tracks import PoseTrack, span_of

LEAST_REST_S = 0.3
"""Shortest rest."""
_FEWEST = 4
"""Smallest number of frames of a rest."""
_ENOUGH_HZ = 30.0
"""Frame rate at which rests are searched; faster tracks are thinned out."""
_LEAST = copy_frozen(np.repeat([2e-4, 1.7e-3], 3), 6)
"""Smallest noise per axis that is assumed: 0.2 mm, 0.1 deg."""
_STILL = 5.3
"""A frame is still below this: sqrt of the 99.99 % quantile of chi-square with 6 degrees of freedom."""
_MEDIAN = 1.77
"""Standard deviation of the difference of two medians of m unit Gaussian numbers, times sqrt(m)."""
_SHIFTED = 60.0
"""A rest is split beyond this chi-square with 6 degrees of freedom, which chance does not reach in a whole log."""
_SAME_M = 3e-4  # smallest shift that splits a rest
_SAME_RAD = 5e-3  # the same for a rotation
_EDGE = 16.8
"""Frames at the ends of a rest beyond this 99 % quantile of chi-square with 6 degrees of freedom are in motion."""
_Item = TypeVar("_Item")
_Span = tuple[int, int]
"""First and last frame of a stretch."""


@final
@dataclass(frozen=True, eq=False)
class Rest:
    """A stretch of a track in which the part rests, with its mean pose."""

    first: int  # first frame of the track
    last: int
    """Last frame of the track."""
    begins: float  # [s]
    ends: float
    """[s]."""
    gone: float
    """The time until which the part may have been there, [s]: later than `ends` if it was hidden afterwards."""
    mean: Mean
    came: float = -np.inf
    """The time from which on the part may have been there, [s]: earlier than `begins` if it was hidden before."""
    hidden: bool = False
    """Whether the part was hidden at some time since its rest before."""

    @property
    def T(self) -> Array:
        return self.mean.T


def find_rests(track: PoseTrack) -> tuple[Rest, ...]:
    """Return the rests of a track in order of time; they are found in thinned-out frames and averaged over all."""
    stride = max(1, round(1.0 / (span_of(track) * _ENOUGH_HZ)))  # trackers smooth poses at high rates
    t = track.t[::stride]
    T = track.T[::stride]
    if len(t) < _FEWEST:
        return ()
    noise = np.maximum(_noise(T), _LEAST)
    period_s = span_of(PoseTrack(t, T))
    half_window = max(3, round(0.5 * LEAST_REST_S / period_s))
    spans = list[_Span]()
    for span in _still_spans(T, noise, half_window):
        a, b = _trim(T, *span, noise)
        if b - a + 1 >= _FEWEST and t[b] - t[a] >= 0.5 * LEAST_REST_S:
            spans += _split(T, a, b, noise)
    spans = [(stride * a, stride * b) for a, b in spans if t[b] - t[a] >= 0.5 * LEAST_REST_S]
    means = [average(track.T[a : b + 1]) for a, b in spans]
    common = common_scatter(means)
    hidden_s = max(LEAST_REST_S, (2 * _FEWEST - 1) * period_s)
    # Gaps in which the part was not tracked, from frame to frame; the log begins at 0 s.
    left = np.flatnonzero(np.diff(track.t, prepend=0.0) > hidden_s) - 1
    rests: list[Rest] = []
    for (a, b), mean in zip(spans, means, strict=True):
        # The outer frames of a rest may be trimmed by chance, so a gap may lie a few frames apart from it.
        gone = [float(track.t[i + 1]) for i in left if b <= i <= b + 2 * stride]
        came = [float(track.t[i]) if i >= 0 else -np.inf for i in left if a - 2 * stride <= i + 1 <= a]
        begins, ends_s = float(track.t[a]), float(track.t[b])
        hidden = bool(np.any((left < a) & (left >= (rests[-1].last if rests else -1))))
        gone_s, came_s = max(gone, default=ends_s), min(came, default=begins)
        rests.append(Rest(a, b, begins, ends_s, gone_s, pool_mean(mean, common), came_s, hidden))
    return tuple(rests)


def _noise(T: Array) -> Array:
    """Return the standard deviation of one frame along and about each axis, (6,), from successive differences.

    Parts rest most of the time, so the median of the differences is that of a resting part.
    """
    # 1.4826 times the median of |x| is the deviation of a Gaussian; a difference of two frames has sqrt(2) times it.
    d = pose.log(pose.inverse(T[:-1]) @ T[1:])
    return np.asarray(1.4826 * np.median(np.abs(d), axis=0) / np.sqrt(2.0))


def _still_spans(T: Array, noise: Array, m: int) -> list[_Span]:
    """Return first and last frame of each stretch of still frames, extended by half a window at both ends.

    Args:
        noise: (6,), standard deviation of one frame per axis.
        m: Frames in half a window.
    """
    n = len(T)
    if n <= 2 * m:
        return [(0, n - 1)]
    # Twists of the m frames before each frame and of the m after it, from its own pose: (n - 2 m, 2 m + 1, 6).
    window = np.arange(n - 2 * m)[:, None] + np.arange(2 * m + 1)
    xi = pose.log(pose.inverse(T[m : n - m])[:, None] @ T[window])
    change = np.median(xi[:, m + 1 :], axis=1) - np.median(xi[:, :m], axis=1)
    still = np.linalg.norm(change / noise, axis=1) < _STILL * _MEDIAN / np.sqrt(m)
    # First and last frame of each run; where the half windows of two runs overlap, they are divided in the middle.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    first, last = np.add(edges.reshape(-1, 2), (0, 2 * m - 1)).T
    shared = first[1:] <= last[:-1]
    half = (first[1:] + last[:-1]) // 2
    last[:-1] = np.where(shared, half, last[:-1])
    first[1:] = np.where(shared, half + 1, first[1:])
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _trim(T: Array, a: int, b: int, noise: Array) -> tuple[int, int]:
    """Remove frames at the ends that still move, until three good frames in a row; return first and last frame.

    Args:
        T: (n, 4, 4), poses of all frames.
        a, b: First and last frame of the stretch.
        noise: (6,), standard deviation of one frame per axis.
    """
    quarter = (b - a + 1) // 4  # the mean is taken over the middle half of the stretch
    off = pose.log(pose.inverse(average(T[a + quarter : b + 1 - quarter]).T) @ T[a : b + 1])
    near = ((off / noise) ** 2).sum(axis=1) < _EDGE
    good = np.flatnonzero(np.convolve(near, np.ones(3), "valid") == 3)
    return (a + int(good[0]), a + int(good[-1]) + 2) if len(good) else (a + quarter, b - quarter)


def _split(T: Array, a: int, b: int, noise: Array) -> list[_Span]:
    """Split a stretch at small shifts, recursively, and return the parts.

    Args:
        T: (n, 4, 4), poses of all frames.
        a, b: First and last frame of the stretch.
        noise: (6,), standard deviation of one frame per axis.
    """
    n = b - a + 1
    if n < 2 * _FEWEST:
        return [(a, b)]
    xi = np.clip(pose.log(pose.inverse(average(T[a : b + 1]).T) @ T[a : b + 1]) / noise, -4.0, 4.0)
    sums = np.cumsum(xi, axis=0)
    # For a cut after k of n frames: the squared difference of the two means, over its variance 1/k + 1/(n - k), is
    # chi-square with 6 degrees of freedom if there is no shift.
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
    """Return the variance of a mean relative to that of independent frames, as errors of neighbouring frames correlate.

    The correlation is estimated from differences, which a shift of the mean does not change.
    """
    # Neighbours differ by 2 (1 - r) v in the mean square, frames that are far apart by 2 v. The variance of a mean of
    # errors with correlation r from frame to frame is (1 + r) / (1 - r) times that of independent ones.
    far = max(1, min(len(xi) // 4, 8))
    near = float(np.median(np.abs(np.diff(xi, axis=0))))
    wide = float(np.median(np.abs(xi[far:] - xi[:-far])))
    r = 1.0 - min(1.0, (near / max(wide, 1e-12)) ** 2)
    return (1.0 + r) / (1.0 - min(r, 0.99))


def group_consecutive(items: Iterable[_Item], belongs: Callable[[Sequence[_Item], _Item], bool]) -> list[list[_Item]]:
    """Group consecutive items.

    Args:
        belongs: Whether an item belongs to the group just before it.
    """
    groups: list[list[_Item]] = []
    for item in items:
        if groups and belongs(groups[-1], item):
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups
