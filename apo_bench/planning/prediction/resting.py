"""Where a part comes to rest that is put down with a small error: what is found by touch ends in touch.

Weight lays a part flat on what carries it. A part that is slid against another one stops at the first corner that
touches and keeps its turn. Faces that fit into one another are left as they are planned, shafts in holes and cones too.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Assembly,
    Contact,
    Meeting,
    Meetings,
    Operation,
    Poses,
    list_alternatives,
    measure_contact,
)
from apo_bench.geometry import Array, Face, Mate, RoundFace, pose

_LEVEL = 0.5
"""A face whose normal makes a larger cosine with the vertical is a support, any other one a side."""
_ROUNDS = 10
"""A shaft between two sides of a groove comes to rest on both, each time a little nearer."""


def resting_poses(assembly: Assembly, operation: Operation, poses: Poses) -> Poses:
    """The poses of all parts once what the operation moves has come to rest, as one body.

    Args:
        poses: Every part, what the operation moves where it is brought to, world frame, [m]; several alternatives,
            (r, 4, 4), come to rest at once.
    """
    touched = [contact for contact in operation.contacts if not enters(assembly, contact)]
    carries = {contact: np.asarray(is_support(assembly, contact, poses)) for contact in touched}
    if any(each.any() != each.all() for each in carries.values()):
        alone = [resting_poses(assembly, operation, each) for each in list_alternatives(poses)]
        return MappingProxyType({part: np.array([each[part] for each in alone]) for part in poses})
    now = dict(poses)
    supports = [contact for contact in touched if carries[contact].all()]
    for contact in supports * (_ROUNDS if any(map(assembly.is_round, supports)) else 1):
        _displace(now, operation, _flat(assembly, contact, now))
    for contact in (contact for contact in touched if contact not in supports):
        first = [n * e.min() for ((e, n),) in residuals(Meetings(assembly), [contact], now)]
        _displace(now, operation, _shift(np.array(first).reshape(*_lead(now, operation), 3)))
    return MappingProxyType(now)


def enters(assembly: Assembly, contact: Contact) -> bool:
    """Whether a face goes into another one, so that play decides and nothing is found by touch."""
    on_plane = any(isinstance(assembly.face_of(of), Face) for of in contact)
    return assembly.is_fit(contact) or not on_plane


def residuals(known: Meetings, contacts: Sequence[Contact], poses: Poses) -> list[tuple[tuple[Array, Array], ...]]:
    """e of each contact at the corners of its overlap, (k,), [m], positive where the faces are apart, and the normal.

    Of faces that miss each other, or meet in less than an area, the corners of the whole environment face count; of a
    shaft on a plane the ends of the line of contact. The normal, (3,), is that of the flat face, world.

    Args:
        known: The contacts, with what is measured already.
        poses: World frame, [m]; there may be several alternatives, (r, 4, 4).

    Returns:
        For each alternative those of the contacts.
    """
    alternatives = list_alternatives(poses)
    lies = iter(known.measure((contact, each) for each in alternatives for contact in contacts))
    return [tuple(residual(known.assembly, contact, next(lies), each) for contact in contacts) for each in alternatives]


def residual(assembly: Assembly, contact: Contact, lie: Meeting, poses: Poses) -> tuple[Array, Array]:
    """`residuals` of one contact whose faces lie so to each other."""
    m, e = contact
    if isinstance(lie, Mate):
        up = _up(assembly, contact, poses)
        return lie.off @ up, up * (-1.0 if m.face in assembly.solids[m.part].rounds else 1.0)
    T_m = poses[m.part]
    plane = assembly.face(m).plane
    corners = lie.corners if len(lie.corners) else pose.apply(poses[e.part], assembly.face(e).outline)
    n = T_m[:3, :3] @ plane[:3]
    return (corners - T_m[:3, 3]) @ n + plane[3], n


def is_support(assembly: Assembly, contact: Contact, poses: Poses) -> NDArray[np.bool_]:
    """Whether weight closes the contact, (*,)."""
    return np.asarray(np.abs(_up(assembly, contact, poses)[..., 2]) > _LEVEL) & (not enters(assembly, contact))


def _up(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The normal of the flat face of a contact, that of the second part if both are, (*, 3), world."""
    flat = next(of for of in reversed(contact) if isinstance(assembly.face_of(of), Face))
    return np.asarray(poses[flat.part][..., :3, :3] @ assembly.face(flat).normal)


def _flat(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The displacement of the world that lays the manipulated face flat on the other one, (*, 4, 4).

    The least turn, about the middle of the face, and then straight down or up.
    """
    m, e = contact
    if assembly.is_round(contact):
        laid = np.array([_laid(assembly, contact, each) for each in list_alternatives(poses)])
        return laid if any(T.ndim == 3 for T in poses.values()) else np.asarray(laid[0])
    # S = shift to the plane * least turn that makes the normals opposite * shift of the middle to the origin.
    middle = _place(poses[m.part], assembly.face(m).outline.mean(axis=0))
    up = poses[e.part][..., :3, :3] @ assembly.face(e).normal
    height = ((middle - _place(poses[e.part], assembly.face(e).outline[0])) * up).sum(axis=-1)
    turned = _turn(poses[m.part][..., :3, :3] @ assembly.face(m).normal, -up)
    return np.asarray(_shift(middle - height[..., None] * up) @ turned @ _shift(-middle))


def _laid(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The same for a shaft on a plane, or a plane on a shaft: the least turn that makes them parallel, and a shift."""
    touch = measure_contact(assembly, contact, poses)
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
    """The least turn that takes directions, (*, 3), to other ones, about the origin, (*, 4, 4)."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    turn = axis * np.divide(np.arcsin(np.minimum(1.0, sine)), sine, out=np.zeros_like(sine), where=sine > 0.0)
    return pose.exp(np.concatenate([np.zeros_like(turn), turn], axis=-1))


def _shift(d: Array) -> Array:
    """The displacements by (*, 3), [m]."""
    return pose.rigid(np.broadcast_to(np.eye(3), (*d.shape, 3)), d)


def _place(T: Array, point: Array) -> Array:
    """Where a point, (3,), of a frame at poses (*, 4, 4) is, (*, 3)."""
    return np.asarray(T[..., :3, :3] @ point + T[..., :3, 3])


def _lead(poses: Mapping[str, Array], operation: Operation) -> tuple[int, ...]:
    """How many alternatives there are of the poses of what an operation moves, if there are several."""
    return poses[operation.main].shape[:-2]


def _displace(poses: dict[str, Array], operation: Operation, S: Array) -> None:
    """Move all that the operation moves by a displacement of the world."""
    poses.update({part: S @ poses[part] for part in operation.moves})
