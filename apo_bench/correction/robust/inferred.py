"""Where operations led whose observation is missing or not believed: inferred from their contacts and what is around.

A contact says that two normals oppose, that a point lies in a plane, and that two faces cover each other, so their
middles are not far apart. With the poses of all other operations in its equations known, a contact of an operation
says this of its goal alone. The operation of which most is said is inferred first; then it is known to the others.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import permutations
from itertools import product as pairs
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.equations import pattern
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly, product
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.remembered import remembered

_APART = 0.1
"""Normals with a smaller singular value are in one plane, or along one line."""
_PLANE_M = 1e-3
"""How exactly a contact says where its plane is, beside how far middles of faces may be apart, [m]."""
_SAME_WAY = 0.99


class Ends(NamedTuple):
    """The two faces of a contact, each in the frame of its own part."""

    normals: tuple[Array, Array]
    """(3,) each: of the manipulated part, of the environment part."""
    middles: tuple[Array, Array]
    """(3,) each, [m]."""
    reach_m: float
    """How far apart the middles of faces that touch may be: half the larger face."""


class _Said(NamedTuple):
    """What one contact says of the pose T of an operation: R own = way, and way . (R at + t - there) = 0."""

    own: Array
    """A normal in the frame of the main part, (3,)."""
    at: Array
    """The middle of the face there, (3,), [m]."""
    way: Array
    """The opposite of the other normal, (3,), world."""
    there: Array
    """The middle of the other face, (3,), world, [m]."""
    beside: Array
    """The orientation of the other part, (3, 3), world."""
    reach_m: float


class Inferred(NamedTuple):
    """Goals of which some were inferred."""

    goals: Array
    """(n, 4, 4)."""
    baseless: tuple[int, ...]
    """Operations of which no contact says anything: they are as they were given."""


def inferred_goals(observation: Observation, unknown: Collection[int]) -> Inferred:
    """The goals of an observation, those of `unknown` operations, counted from 0, replaced by what contacts say."""
    goals, left, baseless = np.array(observation.goals), set(unknown), list[int]()
    start = np.array([observation.start[part] for part in observation.assembly.solids]).reshape(-1, 4, 4)
    for k in left:
        if not np.isfinite(goals[k]).all():
            goals[k] = np.eye(4)
    while left:
        told = {k: _said(observation.assembly, start, goals, k, left) for k in sorted(left)}
        k = max(told, key=lambda k: (_rank(told[k]), len(told[k]), -k))
        if told[k]:
            goals[k] = _placed(told[k], goals[k])
        else:
            baseless.append(k)
        left.discard(k)
    return Inferred(goals, tuple(sorted(baseless)))


@remembered
def contact_ends(assembly: Assembly) -> tuple[Ends, ...]:
    """The faces of every contact, in the order of `relations()`."""
    found = []
    for relation in assembly.relations():
        a, b = (assembly.face(of) for of in relation.contact)
        reach = max(float(np.ptp(face.outline, axis=0).max()) for face in (a, b)) / 2
        found.append(Ends((a.normal, b.normal), (a.outline.mean(axis=0), b.outline.mean(axis=0)), reach))
    return tuple(found)


def _said(assembly: Assembly, start: Array, goals: Array, k: int, left: Collection[int]) -> list[_Said]:
    """What contacts say of operation k that depend on no other operation of those left."""
    p, poses, found = len(start), np.concatenate([start, goals]), list[_Said]()
    others = {p + other for other in left if other != k}
    for word, ends in zip(pattern(assembly).words, contact_ends(assembly), strict=True):
        letters = [letter for letter, _ in word]
        if letters.count(p + k) != 1 or others.intersection(letters):
            continue
        j = letters.index(p + k)
        before, behind, inverted = (
            pose.inverse(product(word[:j], poses)),
            product(word[j + 1 :], poses),
            word[j].inverse,
        )
        a = before[:3, :3] @ ends.normals[0], pose.apply(before, ends.middles[0][None])[0]
        b = behind[:3, :3] @ ends.normals[1], pose.apply(behind, ends.middles[1][None])[0]
        (own, at), (other, there) = (a, b) if inverted else (b, a)
        beside = behind[:3, :3] if inverted else before[:3, :3]
        found.append(_Said(own, at, -other, there, beside, ends.reach_m))
    return found


def _rank(told: Sequence[_Said]) -> int:
    """In how many directions normals look."""
    return int((np.linalg.svd(np.array([one.own for one in told]), compute_uv=False) > _APART).sum()) if told else 0


def _placed(told: Sequence[_Said], seen: Array) -> Array:
    """The pose that agrees best with what is said; what is not said of its orientation is as it was seen."""
    T = np.eye(4)
    T[:3, :3] = R = _turned(told, seen[:3, :3])
    A, b, fixed = np.zeros((3, 3)), np.zeros(3), _across(np.array([one.way for one in told]))
    for one in told:
        off, across, along = one.there - R @ one.at, 1.0 / one.reach_m**2, 1.0 / _PLANE_M**2
        way = fixed @ one.way
        A += along * np.outer(way, way) + across * np.eye(3)
        b += along * way * (way @ off) + across * off
    T[:3, 3] = np.linalg.solve(A, b)
    return T


def _across(ways: Array) -> Array:
    """The projection (3, 3) onto the directions in which planes say where a point is.

    Planes that are parallel but for noise meet somewhere, far away; that says nothing.
    """
    _, w, Vt = np.linalg.svd(ways)
    known = Vt[: np.count_nonzero(w > _APART * w[0])]
    return np.asarray(known.T @ known)


def _turned(told: Sequence[_Said], seen: Array) -> Array:
    """(3, 3): normals oppose. Where they look along one line, parts stand square to each other, as near as can be."""
    own, way = (np.array([getattr(one, name) for one in told]) for name in ("own", "way"))
    rank = _rank(told)
    if rank == 1:
        beside = told[0].beside
        square = [beside @ Q for Q in _quarter_turns() if (beside @ Q @ own[0]) @ way[0] > _SAME_WAY]
        if square:
            return max(square, key=lambda R: float(np.trace(R.T @ seen)))
        return _nearest(np.outer(way[0], own[0]) + _PLANE_M * seen)
    H = way.T @ own
    if rank == 2:
        i, j = max(permutations(range(len(own)), 2), key=lambda ij: float(np.linalg.norm(np.cross(*own[list(ij)]))))
        H = H + np.outer(np.cross(way[i], way[j]), np.cross(own[i], own[j]))
    return _nearest(H)


def _nearest(H: Array) -> Array:
    """The rotation R with the largest trace of R^t H (Kabsch, 1976)."""
    U, _, Vt = np.linalg.svd(H)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _quarter_turns() -> list[Array]:
    """The 24 rotations of a cube."""
    found = []
    for order, signs in pairs(permutations(range(3)), pairs((1.0, -1.0), repeat=3)):
        Q = np.zeros((3, 3))
        Q[range(3), order] = signs
        if np.linalg.det(Q) > 0.0:
            found.append(Q)
    return found
