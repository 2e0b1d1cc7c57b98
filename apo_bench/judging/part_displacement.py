"""Measure how far parts moved after they were placed: in the world, against each other, and against fixed parts."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
    Poses,
    ReachedState,
    Snapshot,
    find_touch_points,
    find_touched_contacts,
)
from apo_bench.geometry import Array, Solid, find_least_rotated_pose, pose

_PARALLEL_NORMALS = 0.999
"""Faces whose normals have at least this cosine are parallel: together they are a plain support."""
_CONSTRAINED = 1e-3
"""Contacts constrain a motion of all corners by 1 m if it would open them by more than this, [m]."""
_PASSES = 4
"""Passes in which the rotations of two parts of revolution are removed alternately.

One pass is exact for parallel or perpendicular axes.
"""


def list_last_moves(assembly: Assembly) -> dict[str, int]:
    """Part -> the last operation that moves it, counted from 0."""
    return {part: k for k, operation in enumerate(assembly.operations) for part in operation.moves}


def measure_displacements(assembly: Assembly, reached: ReachedState, away: Collection[str]) -> dict[str, float]:
    """The largest displacement of a corner of each part between its last operation and the end, [m].

    The rotation of a part of revolution about its axis does not count.

    Args:
        away: Parts that do not count (fixtures).
    """
    moved = dict[str, float]()
    if reached.final is None:
        return moved
    for part, k in list_last_moves(assembly).items():
        placed = reached.after[k]
        if placed is not None and part not in away:
            solid = assembly.solids[part]
            corners = _list_corners(solid)
            T = find_least_rotated_pose(solid, reached.final.poses[part], placed.poses[part])
            moved[part] = _largest_length(pose.apply(T, corners) - pose.apply(placed.poses[part], corners))
    return moved


def find_displaced_pairs(
    known: ContactMeasurements,
    after: Sequence[Snapshot | None],
    final: Snapshot,
    displaced: Mapping[str, float],
    away: Collection[str],
    inspected: Poses,
    allowed_mm: float,
) -> Iterator[tuple[str, float]]:
    """Displacements that spoil the finished assembly: the two parts in words, and how far a corner moved, [m].

    - Two movable parts in contact at the end: their relative motion along free directions, since the later of their
    last
      operations. At most the displacement of one of them in the world counts.
    - A part and fixed parts that locate it by more than a plain support (pocket, hole, groove, wall beside the floor):
    the
      displacement of the part in the world. A whole assembly on a plain support may stand anywhere.

    Args:
        known: Cache of measured contacts.
        after: Snapshots after each operation.
        final: The snapshot at the end.
        displaced: From `measure_displacements`, [m].
        away: Parts that do not count (fixtures).
        inspected: The final poses, each part rotated by the symmetry by which its contacts are judged.
        allowed_mm: Parts that moved no farther in the world are skipped.
    """
    assembly = known.assembly
    placing = list_last_moves(assembly)
    for parts, contacts in _list_closed_contacts(assembly, away).items():
        a, b = parts
        moved = max(displaced.get(a, 0.0), displaced.get(b, 0.0))
        if 1e3 * moved <= allowed_mm:
            continue
        if a in assembly.fixed:
            if b in displaced and _locates_part(assembly, contacts, b, inspected):
                yield f"{b} against {a}", displaced[b]
            continue
        placed_after = after[max(placing.get(a, 0), placing.get(b, 0))]  # when the later of both was placed
        if placed_after is not None:
            held = _constraint_rows(known, contacts, (a, b), final.poses[a], inspected)
            shift_m = _measure_free_motion(assembly, (a, b), placed_after.poses, final.poses, held)
            yield f"{b} against {a}", min(shift_m, moved)


def _list_closed_contacts(assembly: Assembly, away: Collection[str]) -> dict[tuple[str, str], list[Contact]]:
    """The contacts closed at the end, by the pair of parts; all fixed parts count as one, the first by name."""
    standing = dict[tuple[str, str], list[Contact]]()
    ground = min(assembly.fixed, default="")
    for contact, _, lost in assembly.relations():
        m, e = (ground if end.part in assembly.fixed else end.part for end in contact)
        if lost is None and not {m, e} & set(away):
            # The fixed part comes first; of two movable parts either order is one pair.
            pair = (m, e) if m == ground or (m, e) in standing else (e, m)
            standing.setdefault(pair, []).append(contact)
    return standing


def _locates_part(assembly: Assembly, contacts: Sequence[Contact], part: str, seen: Poses) -> bool:
    """Whether the contacts of a part with fixed parts have different normals, so that they locate it."""
    normals = np.array([touched.normal for touched in find_touched_contacts(assembly, contacts, [part], seen)])
    return len(normals) > 0 and float((normals @ normals[0]).min()) < _PARALLEL_NORMALS


def _measure_free_motion(
    assembly: Assembly, parts: tuple[str, str], placed_after: Poses, final: Poses, constraints: Array
) -> float:
    """The largest relative motion of a corner of two parts along directions that their contacts leave free, [m]."""
    a, b = (assembly.solids[part] for part in parts)
    before, now = (pose.inverse(poses[parts[0]]) @ poses[parts[1]] for poses in (placed_after, final))
    # The motion of b in the frame of a, as a twist of that frame: now = exp(twist) before.
    twist = pose.log(_undo_free_rotation(a, b, now, before) @ pose.inverse(before))
    corners = np.concatenate([_list_corners(a), pose.apply(before, _list_corners(b))])
    return _largest_length(pose.apply(pose.exp(_project_to_free_twist(twist, constraints, corners)), corners) - corners)


def _undo_free_rotation(a: Solid, b: Solid, relative: Array, reference: Array) -> Array:
    """The pose `relative` of b in the frame of a, with rotations about axes of revolution made nearest to
    `reference`."""
    for _ in range(_PASSES):
        relative = find_least_rotated_pose(b, relative, reference)
        relative = pose.inverse(find_least_rotated_pose(a, pose.inverse(relative), pose.inverse(reference)))
    return relative


def _constraint_rows(
    known: ContactMeasurements, contacts: Sequence[Contact], parts: tuple[str, str], T: Array, seen: Poses
) -> Array:
    """Rows of n (v + w x p), (k, 6): how much a twist (v, w) of the second part opens each contact with the first one.

    Args:
        T: World pose of the first part, in whose frame the twists are.
    """
    points, normals = find_touch_points(
        known.assembly, find_touched_contacts(known.assembly, contacts, [parts[1]], seen), seen, known
    )
    point = pose.apply(pose.inverse(T), points)
    normal = normals @ T[:3, :3]
    return np.concatenate([normal, np.cross(point, normal)], axis=1)


def _project_to_free_twist(twist: Array, constraints: Array, points: Array) -> Array:
    """The free twist, (6,), nearest to `twist` by the motion of the points `points`, (k, 3); `constraints` has the
    constraints.

    With K the motion of the points by a twist and K^T K = L L^T, distances are those of L^T twist.
    """
    # The points move by K xi; |K xi|^2 = xi^t L L^t xi, so in y = L^t xi the least motion is the shortest y.
    K = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -pose.hat(points)], axis=2).reshape(-1, 6)
    L = np.linalg.cholesky(K.T @ K / len(points))
    # Rows of which a unit motion opens contacts span what is held; the twist is projected onto what is left.
    # R of rows = Q R has their singular values and right vectors, and at most six rows.
    _, sizes, free_basis = np.linalg.svd(
        np.linalg.qr(np.linalg.solve(L, constraints.T).T, mode="r"), full_matrices=True
    )
    free_directions = free_basis[int((sizes > _CONSTRAINED).sum()) :]
    # Projection onto the rows without singular value, in y, then back to a twist.
    return np.asarray(np.linalg.solve(L.T, free_directions.T @ (free_directions @ (L.T @ twist))))


def _largest_length(moved: Array) -> float:
    """The largest length of displacements, (k, 3)."""
    return float(np.linalg.norm(moved, axis=1).max())


def _list_corners(solid: Solid) -> Array:
    """The corners of all pieces, (k, 3), in the frame of the solid, [m]."""
    return np.concatenate([piece.corners for piece in solid.pieces])
