"""The tip pose of a grasp, and the width of the part between the fingers."""

from functools import lru_cache

import numpy as np

from apo_bench.geometry import Array, Piece, all_boxes, holds_whole_width, measure_extent, measure_held_width
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.frames import cross, frame

_AXES = np.eye(3)
_SQUARE = 1e-12  # cosine above which two directions are not taken as perpendicular
_UPRIGHT = float(np.cos(np.radians(10.0)))
"""A part whose axis is observed within 10 degrees of the vertical is taken as upright."""


def make_tip_frame(grasp: Grasp, T_part: Array) -> Array:
    """Return the pose of the tip in the frame of the part, (4, 4).

    Its z axis points down for a part at `T_part`, or along `grasp.ahead`; its x axis, the closing direction, is
    `grasp.across`.
    """
    ahead = T_part[:3, :3].T @ np.array([0.0, 0.0, -1.0]) if grasp.ahead is None else grasp.ahead
    across = grasp.across
    along = float(across @ ahead)
    if abs(along) > _SQUARE:  # the part is tilted: make the closing direction perpendicular to the z axis
        across = across - along * ahead
        across = across / np.linalg.norm(across)
    return frame(np.array([across, cross(ahead, across), ahead]).T, grasp.point)


def half_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """Return half the width of the part between the fingers, [m].

    For a part of boxes whose full width the fingers hold, this is half the extent of the part. The same extent is used
    if the width at the grasp cannot be measured.

    Args:
        T: Pose of the part, (4, 4), from which a grasp without `ahead` has its vertical.
    """
    up = upwards(T) if grasp.ahead is None else -grasp.ahead
    return _half_width(pieces, *(tuple(axis.tolist()) for axis in (grasp.point, grasp.across, up)))


@lru_cache(maxsize=4096)
def _half_width(
    pieces: tuple[Piece, ...], point: tuple[float, ...], across: tuple[float, ...], up: tuple[float, ...]
) -> float:
    """Return half the width of a part between the fingers, [m]; arguments are tuples, so that the result is cached."""
    own = measure_held_width(pieces, point, across, up)
    closing = np.array(across)
    if own is None or (all_boxes(pieces) and holds_whole_width(pieces, np.array(point), closing, np.array(up))):
        low, high = measure_extent(pieces, closing)
        return (high - low) / 2
    return own


def known_half_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """Return the half width stored with the grasp, computed only if it is missing."""
    return half_width(pieces, grasp, T) if grasp.half_width is None else grasp.half_width


def upwards(T: Array) -> Array:
    """Return the vertical in the frame of a part at T, (3,), rounded to an axis within 10 degrees of it."""
    up = T[2, :3]
    k = int(np.abs(up).argmax())
    return np.asarray(np.sign(up[k]) * _AXES[k] if abs(up[k]) > _UPRIGHT else up)
