"""Poses of missing or rejected operations, inferred from their contacts with parts whose poses are known.

A contact states that two normals oppose, a point lies in a plane, and two faces overlap, so their middles are near each
other; or that two axes are one line. If all other poses in its equations are known, it constrains the pose of one
operation. The most constrained operation is inferred first; then it counts as known for the others.
"""

from collections.abc import Collection, Sequence
from itertools import product as pairs
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Observation, classify_contact, evaluate_odl, find_equation_pattern
from apo_bench.geometry import Array, list_quarter_turns, pose, remember

_APART = 0.1
"""Relative singular value below which directions count as coplanar or parallel."""
_PLANE_M = 1e-3
"""Standard deviation of a point in its plane, [m], when weighed against the distance of the middles of faces."""
_SAME_WAY = 0.99
"""Cosine above which two directions are the same."""


_Lie = Literal["opposite", "along", "across"]
"""Relation of two directions: opposite normals, axes along each other in either sense, an axis across a normal."""
_MOST_AXES = 6
"""Number of axes whose senses are tried in all combinations; of more, each keeps its observed sense."""


class Ends(NamedTuple):
    """The directions and middles of the two faces of a contact, each in the frame of its own part."""

    directions: tuple[Array, Array]
    """(3,) each, of the manipulated and of the environment part: normals, or axes of round faces."""
    middles: tuple[Array, Array]
    """(3,) each, [m], in the same order."""
    reach_m: float
    """Largest distance of the middles of touching faces: half the size of the larger face."""
    lie: _Lie = "opposite"
    seated: bool = False
    """Whether the middles coincide, as those of a seated cone."""


class _Condition(NamedTuple):
    """The constraint of one contact on the pose (R, t) of an operation: R own = way, u . (R at + t - there) = 0 for
    some u.
    """

    own: Array
    """A normal or an axis in the frame of the main part, (3,)."""
    at: Array
    """The middle of its face, in the frame of the main part, (3,), [m]."""
    way: Array
    """The direction that `own` must have: the opposite of the other normal, or the other axis, (3,), world."""
    there: Array
    """The middle of the other face, (3,), world, [m]."""
    beside: Array
    """The orientation of the other part, (3, 3), world."""
    ends: Ends
    of_first: bool
    """Whether the main part has the manipulated face."""

    def exact(self, R: Array) -> Array:
        """The directions u in which the two middles must coincide, (k, 3), world, at orientation R, (3, 3)."""
        if self.ends.seated:
            return np.eye(3)
        if self.ends.lie == "along":
            return np.asarray(np.linalg.svd(self.way[None])[2][1:])
        return (R @ self.own if self.ends.lie == "across" and self.of_first else self.way)[None]


class InferredPoses(NamedTuple):
    """The result of `infer_poses`."""

    poses: Array
    """(n, 4, 4)."""
    baseless: tuple[int, ...]
    """Operations without any contact to infer from; their poses are as given."""


def infer_poses(observation: Observation, unknown: Collection[int]) -> InferredPoses:
    """Replace the poses of `unknown` operations, counted from 0, by what their contacts imply."""
    poses = np.array(observation.poses)
    left = set(unknown)
    baseless = list[int]()
    start = np.array([observation.start[part] for part in observation.assembly.solids]).reshape(-1, 4, 4)
    for k in left:
        if not np.isfinite(poses[k]).all():
            poses[k] = np.eye(4)
    while left:
        conditions = {k: _conditions(observation.assembly, start, poses, k, left) for k in sorted(left)}
        # The most constrained operation first, since its pose then constrains the others.
        k = max(conditions, key=lambda k: (_rank(conditions[k]), len(conditions[k]), -k))
        if conditions[k]:
            poses[k] = _place(conditions[k], poses[k])
        else:
            baseless.append(k)
        left.discard(k)
    return InferredPoses(poses, tuple(sorted(baseless)))


@remember
def contact_ends(assembly: Assembly) -> tuple[Ends | None, ...]:
    """The faces of every contact, in the order of `relations()`; None for contacts of sheets that add nothing.

    Args:
        assembly: As `project_round_faces` makes it.
    """
    ends_of_each = list[Ends | None]()
    seen_contacts = set[tuple[int, Contact]]()
    for contact, made, _ in assembly.relations():
        stated = assembly.given(contact)
        ends = _flat_ends(assembly, contact) if stated is contact else _round_ends(assembly, contact, stated)
        new = ends is not None and (stated is contact or (made, stated) not in seen_contacts)
        ends_of_each.append(ends if new else None)
        if new:
            seen_contacts.add((made, stated))
    return tuple(ends_of_each)


def _flat_ends(assembly: Assembly, contact: Contact) -> Ends:
    """The faces of a contact of two flat faces or sheets."""
    a, b = (assembly.face(of) for of in contact)
    reach = max(float(np.ptp(face.outline, axis=0).max()) for face in (a, b)) / 2
    return Ends((a.normal, b.normal), (a.outline.mean(axis=0), b.outline.mean(axis=0)), reach)


def _round_ends(assembly: Assembly, contact: Contact, stated: Contact) -> Ends | None:
    """The faces of a contact of sheets that stands for one of round faces (`stated`).

    For cones only the sheet that states the seat is used; None for the others.
    """
    kind = classify_contact(*map(assembly.face_of, stated))
    ends = _flat_ends(assembly, contact)
    own = {of.part: of.face for of in stated}
    a, b = (assembly.solids[of.part].rounds.get(own[of.part]) for of in contact)
    assert b is not None
    if a is None:
        return ends._replace(directions=(ends.directions[0], b.axis), lie="across")
    if kind == "shaft in hole":
        return Ends((a.axis, b.axis), (a.middle, b.middle), max(a.length, b.length) / 2, "along")
    seats = assembly.face(contact.manipulated).opposes
    return ends._replace(reach_m=max(a.radius, b.radius), seated=True) if seats else None


def _conditions(assembly: Assembly, start: Array, poses: Array, k: int, left: Collection[int]) -> list[_Condition]:
    """The constraints on operation k from contacts that depend on no other unknown operation, `left`.

    Args:
        start: Start poses of the parts, (p, 4, 4).
        poses: Current poses of the operations, (n, 4, 4).
    """
    p = len(start)
    stack = np.concatenate([start, poses])
    conditions = list[_Condition]()
    others = {p + other for other in left if other != k}
    for word, ends in zip(find_equation_pattern(assembly).words, contact_ends(assembly), strict=True):
        letters = [letter for letter, _ in word]
        if ends is None or letters.count(p + k) != 1 or others.intersection(letters):
            continue
        j = letters.index(p + k)
        before = pose.inverse(evaluate_odl(word[:j], stack))
        behind = evaluate_odl(word[j + 1 :], stack)
        inverse = word[j].inverse
        a = before[:3, :3] @ ends.directions[0], pose.apply(before, ends.middles[0][None])[0]
        b = behind[:3, :3] @ ends.directions[1], pose.apply(behind, ends.middles[1][None])[0]
        (own, at), (other, there) = (a, b) if inverse else (b, a)
        beside = behind[:3, :3] if inverse else before[:3, :3]
        way = -other if ends.lie == "opposite" else other
        conditions.append(_Condition(own, at, way, there, beside, ends, inverse))
    return conditions


def _rank(conditions: Sequence[_Condition]) -> int:
    """Number of independent directions in the constraints, 0 to 3."""
    return _directions(np.array([condition.own for condition in conditions])) if conditions else 0


def _directions(own: Array) -> int:
    """Number of independent directions among unit vectors, (k, 3), within a few degrees."""
    return int((np.linalg.svd(own, compute_uv=False) > _APART).sum())


def _place(conditions: Sequence[_Condition], seen: Array) -> Array:
    """The pose that best satisfies the constraints; unconstrained rotations stay as observed.

    Args:
        seen: The observed pose, (4, 4).
    """
    T = np.eye(4)
    T[:3, :3] = R = _turn(conditions, seen[:3, :3])
    # The position minimises the squared residuals of the constraints: weight 1 / _PLANE_M^2 in the directions that a
    # contact fixes, weight 1 / reach^2 in all directions for the distance of the middles.
    exact = [condition.exact(R) for condition in conditions]
    A = np.zeros((3, 3))
    b = np.zeros(3)
    fixed = _across(np.concatenate(exact))
    for condition, known in zip(conditions, exact, strict=True):
        off = condition.there - R @ condition.at
        across = 1.0 / condition.ends.reach_m**2
        along = 1.0 / _PLANE_M**2
        ways = [fixed @ way for way in known]
        A += sum(along * np.outer(way, way) for way in ways) + across * np.eye(3)
        b += sum(along * way * (way @ off) for way in ways) + across * off
    T[:3, 3] = np.linalg.solve(A, b)
    return T


def _across(ways: Array) -> Array:
    """The projection, (3, 3), onto the directions in which planes determine a point.

    Nearly parallel planes intersect far away, so small singular values are dropped.
    """
    _, w, Vt = np.linalg.svd(ways)
    known = Vt[: np.count_nonzero(w > _APART * w[0])]
    return np.asarray(known.T @ known)


def _turn(conditions: Sequence[_Condition], seen: Array) -> Array:
    """The orientation, (3, 3): normals oppose and axes align; the rest is turned as little as possible from the
    observed one.
    """
    sure = [condition for condition in conditions if condition.ends.lie != "across"]
    R = _choose_senses(sure, seen) if sure else seen
    if len(sure) == len(conditions) or _rank(sure) > 1:
        return R
    own = np.array([condition.own for condition in conditions])
    way = np.array(
        [
            _beside(R @ condition.own, condition.way) if condition.ends.lie == "across" else R @ condition.own
            for condition in conditions
        ]
    )
    return _nearest(way.T @ own + _PLANE_M * R)


def _beside(direction: Array, way: Array) -> Array:
    """The unit vector perpendicular to `way` that is nearest to a direction, (3,)."""
    across = direction - (direction @ way) * way
    size = np.sqrt(across @ across)
    return across / size if size > _APART else np.asarray(np.linalg.svd(way[None])[2][1])


def _choose_senses(conditions: Sequence[_Condition], seen: Array) -> Array:
    """The orientation, (3, 3), with the best senses of all axes; ties go to the one nearest to the observed
    orientation.
    """
    own, way = (np.array([getattr(condition, name) for condition in conditions]) for name in ("own", "way"))
    axes = [i for i, condition in enumerate(conditions) if condition.ends.lie == "along"]
    if not axes:
        return _fit(own, way, conditions[0].beside, seen)
    tried = list[tuple[float, float, Array]]()
    likely = tuple(np.where(np.einsum("ki,ij,kj->k", way[axes], seen, own[axes]) < 0.0, -1.0, 1.0))
    for signs in pairs((1.0, -1.0), repeat=len(axes)) if len(axes) <= _MOST_AXES else (likely,):
        ways = np.array(way)
        ways[axes] *= np.array(signs)[:, None]
        R = _fit(own, ways, conditions[0].beside, seen)
        tried.append((round(float((ways * (own @ R.T)).sum()), 3), float(np.trace(R.T @ seen)), R))
    return max(tried, key=lambda condition: condition[:2])[2]


def _fit(own: Array, way: Array, beside: Array, seen: Array) -> Array:
    """The orientation, (3, 3), for which R own = way fits best.

    If all directions are parallel, the turn about them is free: a multiple of 90 degrees relative to the other part is
    taken, the nearest to the observed one.
    """
    # One direction leaves the turn about it: of the quarter turns of the other part the nearest one is taken.
    rank = _directions(own)
    if rank == 1:
        square = beside @ list_quarter_turns()
        square = square[square @ own[0] @ way[0] > _SAME_WAY]
        if len(square):
            return np.asarray(square[np.einsum("kij,ij->k", square, seen).argmax()])
        return _nearest(np.outer(way[0], own[0]) + _PLANE_M * seen)
    H = way.T @ own
    if rank == 2:
        # Two directions: their cross product is the third, so that the fit is a rotation and no reflection.
        i, j = divmod(int(np.linalg.norm(np.cross(own[:, None], own), axis=2).argmax()), len(own))
        H = H + np.outer(np.cross(way[i], way[j]), np.cross(own[i], own[j]))
    return _nearest(H)


def _nearest(H: Array) -> Array:
    """The rotation R with the largest trace of R^t H (Kabsch, 1976)."""
    U, _, Vt = np.linalg.svd(H)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
