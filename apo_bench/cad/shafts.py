"""Shafts: pieces with as many corners around the axis as the wall needs, or as true cylinders, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.cad.corners import SAME_MM, once
from apo_bench.cad.raw import Region
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Cylinder, Hull, cylinder_hull, sides_of
from apo_bench.parts.allowed import THINNEST_M, WIDEST_M


def rounded(corners: Array, shafts: Sequence[Region]) -> Array:
    """A piece with as many corners on a shaft as its wall needs: new ones on whole circles, more on other ones."""
    from scipy.spatial import ConvexHull

    added = [corners]
    dropped = np.zeros(len(corners), dtype=bool)
    for shaft in sorted(shafts, key=lambda shaft: -int(_on_wall(corners, shaft).sum())):
        height, _, angle = shaft.polar(corners)
        on = _on_wall(corners, shaft) & ~dropped
        if on.sum() < 3:
            continue
        count = sides_of(1e-3 * max(shaft.radii))
        for h in np.unique(np.round(height[on], 3)):
            mine = on & (np.abs(height - h) < 2e-3)
            a, whole = _around_axis(np.sort(angle[mine]), count)
            if whole:
                dropped |= mine
            if len(a):
                added.append(_ring(shaft, float(height[mine].mean()), a))
    if len(added) == 1:
        return corners
    added[0] = corners[~dropped]
    every = once(np.concatenate(added))
    return np.asarray(every[np.sort(ConvexHull(every).vertices)])


def _on_wall(corners: Array, shaft: Region) -> Any:
    height, distance, _ = shaft.polar(corners)
    on = np.abs(distance - shaft.radius_at(height)) < max(1e-5 * max(shaft.radii), SAME_MM)
    return on & (height > shaft.span[0] - SAME_MM) & (height < shaft.span[1] + SAME_MM) & (distance > SAME_MM)


def _around_axis(ring: Array, count: int) -> tuple[Array, bool]:
    """Angles of corners that a wall of so many sides needs beside those of a ring; whether they stand for all of it."""
    if len(ring) < 3:
        return ring[:0], False
    gaps = np.diff(np.append(ring, ring[0] + 2.0 * np.pi))
    usual = float(np.median(gaps))
    if len(ring) >= 6 and gaps.max() < 1.6 * usual:
        return 2.0 * np.pi * (np.arange(count) + 0.5) / count, True
    step = 2.0 * np.pi / count
    fresh = [
        a + gap * np.arange(1, n) / n
        for a, gap in zip(ring, gaps, strict=True)
        if gap < 1.6 * usual and (n := int(np.ceil(gap / step - 1e-9))) > 1
    ]
    return np.concatenate([ring[:0], *fresh]), False


def _ring(shaft: Region, height: float, angles: Array) -> Array:
    assert shaft.point is not None
    assert shaft.axis is not None
    x, y = shaft.across
    out = np.outer(np.cos(angles), x) + np.outer(np.sin(angles), y)
    return np.asarray(shaft.point + height * shaft.axis + shaft.radius_at(height) * out)


def as_cylinders(pieces: list[Hull], shafts: Sequence[Region]) -> Iterator[Hull]:
    """Pieces, as true cylinders where all of their corners are on the ends of one."""
    for piece in pieces:
        corners = 1e3 * piece.corners
        for shaft in shafts:
            if shaft.kind != "cylinder" or not THINNEST_M <= 1e-3 * shaft.radii[0] <= WIDEST_M:
                continue
            height, distance, _ = shaft.polar(corners)
            low = float(height.min())
            high = float(height.max())
            level = 5e-4 * (high - low) >= THINNEST_M and (np.minimum(height - low, high - height) < SAME_MM).all()
            if (
                level
                and len(corners) >= 16
                and (np.abs(distance - shaft.radii[0]) < 1e-5 * shaft.radii[0] + 1e-5).all()
            ):
                assert shaft.point is not None
                assert shaft.axis is not None
                center = 1e-3 * (shaft.point + (low + high) / 2.0 * shaft.axis)
                piece = cylinder_hull("", Cylinder(center, shaft.axis, 1e-3 * shaft.radii[0], 5e-4 * (high - low)))
                break
        yield piece
