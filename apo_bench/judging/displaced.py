"""How far parts moved after they were put: in the room, against each other, and where fixed parts say where to."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Meetings,
    Poses,
    ReachedState,
    Snapshot,
    find_touch_points,
    find_touched_contacts,
)
from apo_bench.geometry import Array, Solid, find_least_turned, pose

_ONE_WAY = 0.999
"""Cosine between the normals of faces that look the same way: together they are a plain support."""
_HELD = 1e-3
"""A motion of all corners by 1 m is held by contacts that it would open by more, [m]."""
_PASSES = 4
"""Turns of two parts of revolution are undone in turn; one pass is exact where their axes are parallel or square."""


def last_moves(assembly: Assembly) -> dict[str, int]:
    """Part -> the last operation that moves it, counted from 0."""
    return {part: k for k, operation in enumerate(assembly.operations) for part in operation.moves}


def displacements(assembly: Assembly, reached: ReachedState, away: Collection[str]) -> dict[str, float]:
    """How far a corner of each part lies at most at the end from where it was after the part's last operation, [m].

    A part of revolution may have turned about its axis.

    Args:
        away: Parts that do not count.
    """
    moved = dict[str, float]()
    if reached.final is None:
        return moved
    for part, k in last_moves(assembly).items():
        put = reached.after[k]
        if put is not None and part not in away:
            solid = assembly.solids[part]
            at = _corners(solid)
            T = find_least_turned(solid, reached.final.poses[part], put.poses[part])
            moved[part] = _farthest(pose.apply(T, at) - pose.apply(put.poses[part], at))
    return moved


def faults_of_place(
    known: Meetings,
    after: Sequence[Snapshot | None],
    final: Snapshot,
    displaced: Mapping[str, float],
    away: Collection[str],
    seen: Poses,
    allowed_mm: float,
) -> Iterator[tuple[str, float]]:
    """What moved and shows in the finished assembly: two parts in words, and how far a corner of either moved, [m].

    Two movable parts that touch at the end: against each other, along what their contacts leave free, since the later
    of their last operations; but no farther than one of them moved in the room since its own. A part whose contacts
    with fixed parts are more than a plain support (a pocket, a hole, a groove, a wall beside the floor): against
    these, as they say where it belongs. A whole on a plain support may stand anywhere.

    Args:
        known: The contacts, with what is measured already.
        displaced: From `displacements`, [m].
        away: Parts that do not count.
        seen: The final poses, each part turned by the symmetry by which its contacts are judged.
        allowed_mm: Parts are passed over that moved no farther in the room.
    """
    assembly = known.assembly
    last = last_moves(assembly)
    for parts, contacts in _standing(assembly, away).items():
        a, b = parts
        moved = max(displaced.get(a, 0.0), displaced.get(b, 0.0))
        if 1e3 * moved <= allowed_mm:
            continue
        if a in assembly.fixed:
            if b in displaced and _is_mate(assembly, contacts, b, seen):
                yield f"{b} against {a}", displaced[b]
            continue
        put = after[max(last.get(a, 0), last.get(b, 0))]
        if put is not None:
            held = _held(known, contacts, (a, b), final.poses[a], seen)
            slid = _slid(assembly, (a, b), put.poses, final.poses, held)
            yield f"{b} against {a}", min(slid, moved)


def _standing(assembly: Assembly, away: Collection[str]) -> dict[tuple[str, str], list[Contact]]:
    """The contacts that stand at the end, by the two parts that touch; all fixed parts count as one, the first."""
    standing = dict[tuple[str, str], list[Contact]]()
    ground = min(assembly.fixed, default="")
    for contact, _, lost in assembly.relations():
        m, e = (ground if end.part in assembly.fixed else end.part for end in contact)
        if lost is None and not {m, e} & set(away):
            pair = (m, e) if m == ground or (m, e) in standing else (e, m)
            standing.setdefault(pair, []).append(contact)
    return standing


def _is_mate(assembly: Assembly, contacts: Sequence[Contact], part: str, seen: Poses) -> bool:
    """Whether contacts with fixed parts hold a part in more than one direction."""
    normals = np.array([touched.normal for touched in find_touched_contacts(assembly, contacts, [part], seen)])
    return len(normals) > 0 and float((normals @ normals[0]).min()) < _ONE_WAY


def _slid(assembly: Assembly, parts: tuple[str, str], put: Poses, final: Poses, held: Array) -> float:
    """How far a corner of either of two parts moved against the other one, along what contacts leave free, [m].

    The motion is a twist; what contacts hold is taken out of it where this moves the corners of both parts the least.
    """
    a, b = (assembly.solids[part] for part in parts)
    before, now = (pose.inverse(poses[parts[0]]) @ poses[parts[1]] for poses in (put, final))
    # The motion of b in the frame of a, as a twist of that frame: now = exp(twist) before.
    twist = pose.log(_turned_back(a, b, now, before) @ pose.inverse(before))
    at = np.concatenate([_corners(a), pose.apply(before, _corners(b))])
    return _farthest(pose.apply(pose.exp(_free(twist, held, at)), at) - at)


def _turned_back(a: Solid, b: Solid, now: Array, before: Array) -> Array:
    """The pose of b in the frame of a, as it looks, with parts of revolution turned about their axes the least."""
    for _ in range(_PASSES):
        now = find_least_turned(b, now, before)
        now = pose.inverse(find_least_turned(a, pose.inverse(now), pose.inverse(before)))
    return now


def _held(known: Meetings, contacts: Sequence[Contact], parts: tuple[str, str], T: Array, seen: Poses) -> Array:
    """By how much twists (v, w) of the second part open contacts with the first one: rows of n (v + w x p), (k, 6).

    Args:
        T: The pose of the first part, in whose frame the twists are.
    """
    points, normals = find_touch_points(
        known.assembly, find_touched_contacts(known.assembly, contacts, [parts[1]], seen), seen, known
    )
    p = pose.apply(pose.inverse(T), points)
    n = normals @ T[:3, :3]
    return np.concatenate([n, np.cross(p, n)], axis=1)


def _free(twist: Array, held: Array, at: Array) -> Array:
    """What is left of a twist, (6,), if rows hold some of it: the free motion that is nearest to it at points, (k, 3).

    With K the motion of the points by a twist and K^T K = L L^T, distances are those of L^T twist.
    """
    # The points move by K xi; |K xi|^2 = xi^t L L^t xi, so in y = L^t xi the least motion is the shortest y.
    K = np.concatenate([np.broadcast_to(np.eye(3), (len(at), 3, 3)), -pose.hat(at)], axis=2).reshape(-1, 6)
    L = np.linalg.cholesky(K.T @ K / len(at))
    # Rows of which a unit motion opens contacts span what is held; the twist is projected onto what is left.
    # R of rows = Q R has their singular values and right vectors, and at most six rows.
    _, sizes, ways = np.linalg.svd(np.linalg.qr(np.linalg.solve(L, held.T).T, mode="r"), full_matrices=True)
    loose = ways[int((sizes > _HELD).sum()) :]
    return np.asarray(np.linalg.solve(L.T, loose.T @ (loose @ (L.T @ twist))))


def _farthest(moved: Array) -> float:
    return float(np.linalg.norm(moved, axis=1).max())


def _corners(solid: Solid) -> Array:
    """The corners of all pieces, (k, 3), in the frame of the solid, [m]."""
    return np.concatenate([piece.corners for piece in solid.pieces])
