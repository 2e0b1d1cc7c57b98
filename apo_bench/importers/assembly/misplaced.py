"""Find parts that overlap another one on one side only, so that a small shift frees them: their place may be wrong."""

import numpy as np

from apo_bench.geometry import (
    Array,
    Hull,
    Piece,
    Solid,
    find_separating_axes,
    measure_intrusion,
    measure_intrusion_depths,
    pose,
    project_on_axes,
)
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.scenario.layout_checks import DEEP_M

_FURTHER_M = 1e-5  # beyond the depth of the overlap


def describe_misplaced(a: PosedPart, b: PosedPart) -> str:
    """Return a sentence if a shift by the depth of their overlap would free two parts; empty if it would not."""
    deepest = find_deepest_pieces(a.solid, a.T, b.solid, b.T)
    if deepest is None:
        return ""
    p, q, depth_m = deepest
    n, _ = find_least_overlap(p, Hull(q.name, pose.apply(pose.inverse(a.T) @ b.T, q.corners)))
    way = -(a.T[:3, :3] @ n)
    T = np.array(a.T)
    T[:3, 3] += (depth_m + _FURTHER_M) * way
    if measure_intrusion(a.solid, T, b.solid, b.T) > DEEP_M:
        return ""
    along = ", ".join(f"{x:.2g}" for x in np.round(way, 2) + 0.0)
    return (
        f"'{a.name}' is {1e3 * depth_m:.2g} mm inside '{b.name}' on one side only: shifted by this along ({along}) it "
        "would be free, so its place in the file may be wrong"
    )


def find_deepest_pieces(a: Solid, T_a: Array, b: Solid, T_b: Array) -> tuple[Piece, Piece, float] | None:
    """Return the two pieces of posed solids that are deepest inside each other, and the depth, [m]; None if none is."""
    own = [(measure_depth(T_a, (piece,), T_b, b.pieces), k) for k, piece in enumerate(a.pieces)]
    depth_m, k = max(own)
    if depth_m <= DEEP_M:
        return None
    p = a.pieces[k]
    return p, max(b.pieces, key=lambda piece: measure_depth(T_a, (p,), T_b, (piece,))), depth_m


def measure_depth(T_a: Array, own: tuple[Piece, ...], T_b: Array, other: tuple[Piece, ...]) -> float:
    """Return how deep posed pieces are inside each other, [m]."""
    return float(measure_intrusion_depths(own, T_a[:3, :3], T_a[None, :3, 3], other, T_b, 0.0)[0])


def find_least_overlap(p: Piece, q: Hull) -> tuple[Array, float]:
    """Return the direction from p to q across which they overlap least, (3,), and where q begins along it, [m]."""
    axes = find_separating_axes(p, np.eye(3), q, np.eye(3))
    at_p, reach_p = project_on_axes(p, np.eye(3), axes)
    at_q, reach_q = project_on_axes(q, np.eye(3), axes)
    k = int((reach_p + reach_q - np.abs(at_p - at_q)).argmin())
    sign = 1.0 if at_q[k] >= at_p[k] else -1.0
    return sign * axes[k], float(sign * at_q[k] - reach_q[k])
