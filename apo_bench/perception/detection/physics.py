"""Physical constraints on contacts: parts are not inside each other, and what is released rests on something.

Each is a surprise, -2 log of how likely it is that a set of contacts gives no offence, given how uncertain
poses still are. Where parts are inside each other by 3 mm, give or take 5, that is little; give or take 0.1, it is
out of the question.
"""

from collections.abc import Collection
from math import exp, hypot, log, sqrt

import numpy as np
from scipy.special import log_ndtr, ndtr

from apo_bench.geometry import Array, Overlap, compute_overlap, find_ways_out, measure_face_area, pose
from apo_bench.perception.detection.candidate import Candidate
from apo_bench.perception.detection.situation import Situation
from apo_bench.perception.detection.thresholds import Rules

IMPOSSIBLE = 40.0
"""The largest surprise."""
_OUT_OF_QUESTION = 30.0
"""Ways out that are less likely are none."""
_UNSUPPORTED = 18.0
"""Of a part that rests on nothing: once in 8,000 operations."""
_SOFT_M = 0.3e-3
"""Parts may be so deep in each other."""
_DEEP_M = 2e-3
"""Where parts that touch are deeper in each other than this, they must still touch once apart."""
_UPRIGHT = 0.5
"""A face whose normal has a larger upward part carries weight."""
_OPPOSITE = -0.9
"""Cosine between the normals of two walls with a part between them, at most."""
_BALANCED_M = 2e-3
"""How well it is known where weight acts."""


def physical_surprise(at: Situation, rules: Rules, taken: Collection[Candidate], near: Collection[Candidate]) -> float:
    """How surprising a set of contacts is that one operation made.

    Args:
        taken: The contacts.
        near: Pairs of faces that are near, and are said not to touch.
    """
    if not all(_covers(at, rules, c, np.zeros(3)) for c in taken):
        return IMPOSSIBLE
    apart = 0.0
    for pair in at.pairs():
        apart += max([inside(at, rules, taken, *pair), *(refusal(c, near) for c in near if c.parts == pair)])
    return min(apart + _hanging(at, taken), IMPOSSIBLE)


def refusal(c: Candidate, near: Collection[Candidate]) -> float:
    """How surprising it is that two faces do not touch: they are in front of each other, and between walls is room.

    Args:
        near: Pairs of faces that were not taken; of those between the same parts that look the other way none touches
            either where there is no room between.
    """
    worst = _unlikely(c.pair.gap_m, _soft(c))
    for other in near:
        if other.parts == c.parts and other.normal @ c.normal < _OPPOSITE:
            # At least so likely is it that both gaps are there at once (Bonferroni): P(A) + P(B) - 1.
            room = sum(float(ndtr((wall.pair.gap_m + _SOFT_M) / _soft(wall))) for wall in (c, other)) - 1.0
            worst = max(worst, -2.0 * log(max(room, exp(-IMPOSSIBLE / 2))))
    return worst


def inside(at: Situation, rules: Rules, taken: Collection[Candidate], a: str, b: str) -> float:
    """Of two parts that are inside each other, the least unlikely way out on which those that touch still do so."""
    solids = at.seen.assembly.solids
    worst = 0.0
    mine = [c for c in taken if c.parts == (a, b)]
    for directions, lengths, middle in find_ways_out(solids[a], at.now.poses[a], solids[b], at.now.poses[b], _SOFT_M):
        deviations = np.sqrt(at.variances(a, b, directions, middle) + _SOFT_M**2 + at.seen.play_m**2)
        worst = max(worst, _least_unlikely(at, rules, mine, directions, lengths, deviations))
    return worst


def _least_unlikely(
    at: Situation, rules: Rules, mine: Collection[Candidate], directions: Array, lengths: Array, deviations: Array
) -> float:
    for i in np.argsort(lengths / deviations):
        # Of ways of no length, which are as likely as not, nothing is surprising.
        penalty = _unlikely(-lengths[i], deviations[i]) - _unlikely(0.0, 1.0)
        far = lengths[i] > _DEEP_M + 2.0 * at.seen.play_m
        if penalty > _OUT_OF_QUESTION:
            break
        if not far or all(_covers(at, rules, c, lengths[i] * directions[i]) for c in mine):
            return penalty
    return IMPOSSIBLE


def _covers(at: Situation, rules: Rules, c: Candidate, moved: Array) -> bool:
    """Whether the faces of a contact cover each other, with the manipulated part moved by (3,), [m].

    Round faces always do.
    """
    if at.seen.assembly.is_round(c.contact):
        return True
    least = rules.share if moved.any() else rules.share / 2
    return _overlap(at, c, moved).area >= least * min(
        measure_face_area(at.seen.assembly.face(face)) for face in c.contact
    )


def _overlap(at: Situation, c: Candidate, moved: Array | None = None) -> Overlap:
    m, e = c.contact
    there = np.array(at.now.poses[m.part])
    there[:3, 3] += 0.0 if moved is None else moved
    return compute_overlap(at.seen.assembly.face(m), there, at.seen.assembly.face(e), at.now.poses[e.part])


def _hanging(at: Situation, taken: Collection[Candidate]) -> float:
    """Negative log-likelihood that a released part stays: larger if nothing supports it, or if its weight acts outside
    its support polygon. It is 0 for round parts, for parts that a face above holds down, and for unobserved operations.
    """
    solids = at.seen.assembly.solids
    if not at.seen.observed[at.k] or any(solids[part].rounds for part in at.moves):
        return 0.0
    level = [c for c in taken if abs(c.normal[2]) > _UPRIGHT]
    if not any(c.normal[2] > 0.0 for c in level):
        return _UNSUPPORTED
    if any(c.normal[2] < 0.0 for c in level):
        return 0.0
    # The centre of mass of all parts that were moved, as of one density, off the hull of the corners they stand on.
    volumes = np.array([solids[part].volume for part in at.moves])
    middles = [pose.apply(at.now.poses[part], solids[part].centroid[None])[0] for part in at.moves]
    weight = volumes @ np.array(middles) / volumes.sum()
    off = _beside(np.concatenate([_overlap(at, c).corners for c in level]), weight)
    far = float(np.linalg.norm(off))
    if far <= _BALANCED_M / 2:
        return 0.0
    variance = at.variances(*level[0].parts, off[None] / far, weight)[0]
    return _unlikely(-far, sqrt(variance + _BALANCED_M**2)) - _unlikely(0.0, 1.0)


def _beside(feet: Array, weight: Array) -> Array:
    """The level way from a weight to the nearest point between its feet, (3,), [m]."""
    from shapely import MultiPoint, Point
    from shapely.ops import nearest_points

    nearest = nearest_points(MultiPoint(feet[:, :2]).convex_hull, Point(weight[:2]))[0]
    return np.array([nearest.x - weight[0], nearest.y - weight[1], 0.0])


def _soft(c: Candidate) -> float:
    return hypot(c.deviation_m, _SOFT_M)


def _unlikely(apart: float, deviation: float) -> float:
    """-2 log of the chance that a Gaussian with this mean is above zero."""
    return min(-2.0 * float(log_ndtr(apart / deviation)), IMPOSSIBLE)
