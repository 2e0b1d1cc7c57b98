"""Penalties for physically impossible contacts: parts do not overlap, and a released part is supported.

Each penalty is a surprise: -2 log of the probability that the constraint holds, given how uncertain the poses still
are. An overlap of 3 mm with a standard deviation of 5 mm costs little; with 0.1 mm it is impossible.
"""

from collections.abc import Collection
from math import exp, hypot, log, sqrt

import numpy as np
from scipy.special import log_ndtr, ndtr

from apo_bench.geometry import Array, Overlap, compute_overlap, find_escapes, measure_face_area, pose
from apo_bench.perception.detection.candidate import Candidate
from apo_bench.perception.detection.situation import Situation
from apo_bench.perception.detection.thresholds import Rules

IMPOSSIBLE = 40.0
"""The largest surprise."""
_IMPOSSIBLE_OVERLAP = 30.0
"""Displacements out of an overlap with a larger surprise are not tried."""
_UNSUPPORTED = 18.0
"""Surprise of a part that nothing supports: once in 8,000 operations."""
_OVERLAP_DEVIATION_M = 0.3e-3
"""Overlap of this depth is tolerated."""
_TOLERATED_OVERLAP_M = 2e-3
"""If an overlap is deeper, the displacement that resolves it must keep the contacts of the two parts."""
_UPRIGHT = 0.5
"""A face can carry weight if the absolute vertical component of its normal is larger."""
_OPPOSITE = -0.9
"""Two walls enclose a part if the cosine between their normals is smaller."""
_BALANCED_M = 2e-3
"""Standard deviation of the point at which the weight acts."""


def compute_physical_penalty(
    at: Situation, rules: Rules, taken: Collection[Candidate], near: Collection[Candidate]
) -> float:
    """The surprise of a set of contacts of one operation, 0 to `IMPOSSIBLE`.

    Args:
        at: The poses estimated with these contacts.
        taken: The contacts.
        near: Pairs of faces that are near and assumed not to touch.
    """
    if not all(_still_overlaps(at, rules, c, np.zeros(3)) for c in taken):
        return IMPOSSIBLE
    apart = 0.0
    for pair in at.list_part_pairs():
        apart += max(
            [
                compute_overlap_penalty(at, rules, taken, *pair),
                *(compute_refusal_penalty(c, near) for c in near if c.parts == pair),
            ]
        )
    return min(apart + _support_penalty(at, taken), IMPOSSIBLE)


def compute_refusal_penalty(c: Candidate, near: Collection[Candidate]) -> float:
    """The surprise that two near faces do not touch, which requires that their gap is positive.

    If a pair on the opposite side of the same part does not touch either, both gaps must be positive at once.

    Args:
        near: Pairs of faces that are assumed not to touch.
    """
    worst = _surprise_of_positive(c.pair.gap_m, _gap_deviation(c))
    for other in near:
        if other.parts == c.parts and other.normal @ c.normal < _OPPOSITE:
            # Lower bound of the probability that both gaps are positive (Bonferroni): P(A) + P(B) - 1.
            room = (
                sum(float(ndtr((wall.pair.gap_m + _OVERLAP_DEVIATION_M) / _gap_deviation(wall))) for wall in (c, other))
                - 1.0
            )
            worst = max(worst, -2.0 * log(max(room, exp(-IMPOSSIBLE / 2))))
    return worst


def compute_overlap_penalty(at: Situation, rules: Rules, taken: Collection[Candidate], a: str, b: str) -> float:
    """The surprise of the overlap of parts a and b; 0 if they do not overlap.

    For each overlap the likeliest displacement counts that resolves it and keeps the contacts of the two parts. The
    largest surprise of all overlaps is returned.
    """
    solids = at.seen.assembly.solids
    worst = 0.0
    mine = [c for c in taken if c.parts == (a, b)]
    for directions, lengths, middle in find_escapes(
        solids[a], at.poses_now.poses[a], solids[b], at.poses_now.poses[b], _OVERLAP_DEVIATION_M
    ):
        deviations = np.sqrt(at.point_variances(a, b, directions, middle) + _OVERLAP_DEVIATION_M**2 + at.seen.play_m**2)
        worst = max(worst, _find_cheapest_displacement(at, rules, mine, directions, lengths, deviations))
    return worst


def _find_cheapest_displacement(
    at: Situation, rules: Rules, mine: Collection[Candidate], directions: Array, lengths: Array, deviations: Array
) -> float:
    """The surprise of the likeliest displacement that resolves an overlap; `IMPOSSIBLE` if there is none.

    Args:
        mine: Contacts between the two parts.
        directions: (k, 3), unit vectors of the displacements, world.
        lengths: (k,), [m].
        deviations: (k,), standard deviation of the position along each direction, [m].
    """
    for i in np.argsort(lengths / deviations):
        # Subtract the surprise of a displacement of length 0, which has the probability 1/2, so that it costs nothing.
        penalty = _surprise_of_positive(-lengths[i], deviations[i]) - _surprise_of_positive(0.0, 1.0)
        far = lengths[i] > _TOLERATED_OVERLAP_M + 2.0 * at.seen.play_m
        if penalty > _IMPOSSIBLE_OVERLAP:
            break
        if not far or all(_still_overlaps(at, rules, c, lengths[i] * directions[i]) for c in mine):
            return penalty
    return IMPOSSIBLE


def _still_overlaps(at: Situation, rules: Rules, c: Candidate, moved: Array) -> bool:
    """True if the faces of a contact overlap enough after a displacement of the manipulated part; round ones always do.

    Args:
        moved: (3,), displacement, world, [m].
    """
    if at.seen.assembly.is_round(c.contact):
        return True
    # The estimate may have moved the faces since they became candidates, so half of the share is enough.
    least = rules.share if moved.any() else rules.share / 2
    return _overlap_after_displacement(at, c, moved).area >= least * min(
        measure_face_area(at.seen.assembly.face(face)) for face in c.contact
    )


def _overlap_after_displacement(at: Situation, c: Candidate, moved: Array | None = None) -> Overlap:
    """The overlap of two flat faces, with the manipulated part displaced by `moved`, (3,), world, [m]."""
    m, e = c.contact
    there = np.array(at.poses_now.poses[m.part])
    there[:3, 3] += 0.0 if moved is None else moved
    return compute_overlap(at.seen.assembly.face(m), there, at.seen.assembly.face(e), at.poses_now.poses[e.part])


def _support_penalty(at: Situation, taken: Collection[Candidate]) -> float:
    """The surprise that a released part stays: `_UNSUPPORTED` without support, else by how far its weight tips over.

    It is 0 if the weight acts inside the support polygon. It is also 0 for parts with round faces, for parts that a
    face above holds down, and for unobserved operations.
    """
    solids = at.seen.assembly.solids
    if not at.seen.observed[at.k] or any(solids[part].rounds for part in at.moves):
        return 0.0
    level = [c for c in taken if abs(c.normal[2]) > _UPRIGHT]
    if not any(c.normal[2] > 0.0 for c in level):
        return _UNSUPPORTED
    if any(c.normal[2] < 0.0 for c in level):
        return 0.0
    # The distance of the centre of mass of all moved parts, with equal densities, from the support polygon.
    volumes = np.array([solids[part].volume for part in at.moves])
    middles = [pose.apply(at.poses_now.poses[part], solids[part].centroid[None])[0] for part in at.moves]
    weight = volumes @ np.array(middles) / volumes.sum()
    off = _vector_to_polygon(np.concatenate([_overlap_after_displacement(at, c).corners for c in level]), weight)
    far = float(np.linalg.norm(off))
    if far <= _BALANCED_M / 2:
        return 0.0
    variance = at.point_variances(*level[0].parts, off[None] / far, weight)[0]
    return _surprise_of_positive(-far, sqrt(variance + _BALANCED_M**2)) - _surprise_of_positive(0.0, 1.0)


def _vector_to_polygon(feet: Array, weight: Array) -> Array:
    """The horizontal vector from a point to the support polygon, (3,), [m]; zero inside.

    Args:
        feet: (k, 3), points whose convex hull, seen from above, is the support polygon.
        weight: (3,), the point.
    """
    from shapely import MultiPoint, Point
    from shapely.ops import nearest_points

    nearest = nearest_points(MultiPoint(feet[:, :2]).convex_hull, Point(weight[:2]))[0]
    return np.array([nearest.x - weight[0], nearest.y - weight[1], 0.0])


def _gap_deviation(c: Candidate) -> float:
    """Standard deviation of the gap of a pair, with the tolerated overlap included, [m]."""
    return hypot(c.deviation_m, _OVERLAP_DEVIATION_M)


def _surprise_of_positive(apart: float, deviation: float) -> float:
    """-2 log of the probability that a Gaussian with this mean and deviation is positive, at most `IMPOSSIBLE`."""
    return min(-2.0 * float(log_ndtr(apart / deviation)), IMPOSSIBLE)
