"""Where a part comes to rest that is put down a little wrongly: what is found by touch ends in touch.

Weight lays a part flat on what carries it. A part that is slid against another one stops at the first corner that
touches and keeps its turn. Faces that fit into one another are left as they are planned, shafts in holes and cones too.

Parts that a plan puts into one another: at the goal, on the way in, and where that way begins.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from apo_bench.assembly import Assembly, Contact, Operation, Poses
from apo_bench.geometry import (
    Array,
    Face,
    Mate,
    RoundFace,
    Solid,
    ball_around,
    intrusion_depths,
    mate,
    overlap,
    physical_pieces,
    pose,
    remembered,
)
from apo_bench.planning.insertion.arrival import Attach

_LEVEL = 0.5
"""A face whose normal makes a larger cosine with the vertical is a support, any other one a side."""
_ROUNDS = 10
"""A shaft between two sides of a groove comes to rest on both, each time a little nearer."""


def resting_poses(assembly: Assembly, operation: Operation, poses: Poses) -> Poses:
    """The poses of all parts once what the operation moves has come to rest, as one body.

    Args:
        poses: Every part, what the operation moves where it is brought to, world frame, [m].
    """
    now = dict(poses)
    touched = [contact for contact in operation.contacts if not enters(assembly, contact)]
    supports = [contact for contact in touched if is_support(assembly, contact, poses)]
    for contact in supports * (_ROUNDS if any(map(assembly.is_round, supports)) else 1):
        _displace(now, operation, _flat(assembly, contact, now))
    for contact in (contact for contact in touched if contact not in supports):
        e, n = residual(assembly, contact, now)
        _displace(now, operation, _shift(n * e.min()))
    return MappingProxyType(now)


def enters(assembly: Assembly, contact: Contact) -> bool:
    """Whether a face goes into another one, so that play decides and nothing is found by touch."""
    on_plane = any(isinstance(assembly.face_of(of), Face) for of in contact)
    return assembly.is_fit(contact) or not on_plane


def between(assembly: Assembly, contact: Contact, poses: Poses) -> Mate:
    """How the faces of a contact of round ones lie to each other."""
    m, e = contact
    return mate(assembly.face_of(m), poses[m.part], assembly.face_of(e), poses[e.part])


def residual(assembly: Assembly, contact: Contact, poses: Poses) -> tuple[Array, Array]:
    """e at the corners of the overlap, (k,), [m], positive where the faces are apart, and the normal, (3,), world.

    Of faces that miss each other, or meet in less than an area, the corners of the whole environment face count; of a
    shaft on a plane the ends of the line of contact.
    """
    m, e = contact
    T_m = poses[m.part]
    T_e = poses[e.part]
    if assembly.is_round(contact):
        up = _up(assembly, contact, poses)
        return between(assembly, contact, poses).off @ up, up * (
            -1.0 if m.face in assembly.solids[m.part].rounds else 1.0
        )
    plane = assembly.face(m).plane
    common = overlap(assembly.face(m), T_m, assembly.face(e), T_e)
    corners = common.corners if common and len(common.corners) else pose.apply(T_e, assembly.face(e).outline)
    n = T_m[:3, :3] @ plane[:3]
    return (corners - T_m[:3, 3]) @ n + plane[3], n


def is_support(assembly: Assembly, contact: Contact, poses: Poses) -> bool:
    """Whether weight closes the contact."""
    return bool(not enters(assembly, contact) and abs(_up(assembly, contact, poses)[2]) > _LEVEL)


def _up(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The normal of the flat face of a contact, that of the second part if both are, (3,), world."""
    flat = next(of for of in reversed(contact) if isinstance(assembly.face_of(of), Face))
    return np.asarray(poses[flat.part][:3, :3] @ assembly.face(flat).normal)


def _flat(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The displacement of the world that lays the manipulated face flat on the other one, (4, 4).

    The least turn, about the middle of the face, and then straight down or up.
    """
    m, e = contact
    if assembly.is_round(contact):
        return _laid(assembly, contact, poses)
    # S = shift to the plane * least turn that makes the normals opposite * shift of the middle to the origin.
    middle = pose.apply(poses[m.part], assembly.face(m).outline).mean(axis=0)
    up = poses[e.part][:3, :3] @ assembly.face(e).normal
    height = (middle - pose.apply(poses[e.part], assembly.face(e).outline[:1])[0]) @ up
    turned = _turn(poses[m.part][:3, :3] @ assembly.face(m).normal, -up)
    return np.asarray(_shift(middle - height * up) @ turned @ _shift(-middle))


def _laid(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The same for a shaft on a plane, or a plane on a shaft: the least turn that makes them parallel, and a shift."""
    touch = between(assembly, contact, poses)
    up = _up(assembly, contact, poses)
    middle = touch.points.mean(axis=0)
    off = touch.off.mean(axis=0)
    if isinstance(assembly.face_of(contact.manipulated), RoundFace):
        turned = _turn(touch.axis, _across(touch.axis, up))
        return np.asarray(_shift(middle - off) @ turned @ _shift(-middle))
    turned = _turn(up, _across(up, touch.axis))
    return np.asarray(_shift(middle + off) @ turned @ _shift(-middle))


def _across(a: Array, b: Array) -> Array:
    """The direction across b that is nearest to a; a itself where it lies along b."""
    across = a - (a @ b) * b
    size = float(np.linalg.norm(across))
    return np.asarray(across / size) if size > 0.0 else a


def _turn(a: Array, b: Array) -> Array:
    """The least turn that takes a direction to another one, about the origin, (4, 4)."""
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    turn = axis * (np.arcsin(min(1.0, sine)) / sine if sine > 0.0 else 0.0)
    return pose.exp(np.concatenate([np.zeros(3), turn]))


def _shift(d: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = d
    return T


def _displace(poses: dict[str, Array], operation: Operation, S: Array) -> None:
    """Move all that the operation moves by a displacement of the world."""
    poses.update({part: S @ poses[part] for part in operation.moves})


_SPACING_M = 0.02
"""The way in is looked at this densely, and at `_MOST` places at most."""
_MOST = 8
_ABOVE_M = np.linspace(0.0, 0.04, 9)
"""A part comes down from above to where a level way in begins: it is looked at this far above it."""
"""A way in is level if its cosine with the vertical is smaller."""
FAR_M = 0.01
"""Parts that are further apart count as so far apart."""
Solids = Mapping[str, Solid]


@remembered
def physical_solids(assembly: Assembly, clearance_mm: float) -> Solids:
    """The parts as they are made, fit faces receded; the same ones each time."""
    made = {
        name: replace(solid, pieces=physical_pieces(solid, clearance_mm * 1e-3))
        for name, solid in assembly.solids.items()
    }
    return MappingProxyType(made)


def depths_on_way(operation: Operation, planned: Poses, how: Attach | None, physical: Solids) -> list[float]:
    """How deep each part that moves comes into each one that rests and that it should not touch, [m].

    Args:
        planned: Every part where the plan has it after the operation.
        how: The way in; without it the goal alone is looked at.

    Returns:
        Negative: how far off they stay.
    """
    touching = {frozenset((m.part, e.part)) for m, e in operation.contacts}
    back = _way_back(planned[operation.main], how)
    pairs = [pair for pair in _pairs(operation, physical) if frozenset(pair) not in touching]
    return [_deepest(physical[a], planned[a], physical[b], planned[b], back) for a, b in pairs]


def depths_from_above(operation: Operation, planned: Poses, how: Attach | None, physical: Solids) -> list[float]:
    """How deep each part comes into each one that rests while it comes down to where a level way in begins, [m].

    Parts that it touches in the end count, too: there it has not come into them yet.

    Returns:
        As `depths_on_way`; `-FAR_M` of any other way in.
    """
    pairs = _pairs(operation, physical)
    way = np.array([0.0, 0.0, 1.0]) if how is None else planned[operation.main][:3, :3] @ how.direction
    if how is None or abs(way[2]) >= _LEVEL:
        return [-FAR_M] * len(pairs)
    down = _ABOVE_M[:, None] * np.array([0.0, 0.0, 1.0]) - how.travel_m * way
    return [_deepest(physical[a], planned[a], physical[b], planned[b], down) for a, b in pairs]


def _pairs(operation: Operation, physical: Solids) -> list[tuple[str, str]]:
    return [(a, b) for a in operation.moves for b in physical if b not in operation.moves]


def _deepest(a: Solid, T_a: Array, b: Solid, T_b: Array, shifts: Array) -> float:
    """The deepest intrusion over all displacements (k, 3) of a, [m]; far off ones are skipped."""
    middle, radius = ball_around(a.pieces)
    seen_from_b = pose.apply(pose.inverse(T_b), pose.apply(T_a, middle[None]) + shifts)
    near = np.linalg.norm(seen_from_b - np.clip(seen_from_b, *b.bounds), axis=1) < radius + FAR_M
    if not near.any():
        return -FAR_M
    depths = intrusion_depths(a.pieces, T_a[:3, :3], T_a[:3, 3] + shifts[near], b.pieces, T_b, FAR_M)
    return max(-FAR_M, float(depths.max()))


def _way_back(goal: Array, how: Attach | None) -> Array:
    """From the goal back along the way in, (k, 3), world, [m]."""
    if how is None:
        return np.zeros((1, 3))
    k = min(_MOST, 1 + int(np.ceil(how.travel_m / _SPACING_M)))
    return -np.outer(np.linspace(0.0, how.travel_m, k), goal[:3, :3] @ how.direction)
