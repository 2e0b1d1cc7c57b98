"""Predict the rest pose of a part that is put down with a small error: supports and sides end in contact.

Weight lays a part flat on its supports. A part that slides against a side stops at the first corner that touches, and
keeps its rotation. Faces that fit into one another, shafts in holes and cones stay as planned.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
    Operation,
    OverlapOrMate,
    Poses,
    list_alternatives,
    measure_round_contact,
)
from apo_bench.geometry import Array, Face, Mate, RoundFace, pose

_LEVEL = 0.5
"""A face is a support if the cosine of its normal with the vertical is larger, else a side."""
_ROUNDS = 10
"""Iterations for round supports: laying a shaft on one side of a groove, then on the other, converges."""


def predict_rest_poses(assembly: Assembly, operation: Operation, poses: Poses) -> Poses:
    """The poses of all parts once the moved ones, as one body, have come to rest.

    Args:
        poses: Of every part, the moved ones where the robot releases them, world frame, [m]; (4, 4), or (r, 4, 4) for r
            alternatives, which come to rest independently.
    """
    touched = [contact for contact in operation.contacts if not is_insertion(assembly, contact)]
    carries = {contact: np.asarray(is_support(assembly, contact, poses)) for contact in touched}
    # A contact that is a support in some alternatives only: each alternative is solved alone.
    if any(each.any() != each.all() for each in carries.values()):
        alone = [predict_rest_poses(assembly, operation, each) for each in list_alternatives(poses)]
        return MappingProxyType({part: np.array([each[part] for each in alone]) for part in poses})
    now = dict(poses)
    supports = [contact for contact in touched if carries[contact].all()]
    for contact in supports * (_ROUNDS if any(map(assembly.is_round, supports)) else 1):
        _displace_parts(now, operation, _lay_flat(assembly, contact, now))
    for contact in (contact for contact in touched if contact not in supports):
        # Sides: move until the first corner touches.
        first = [n * e.min() for ((e, n),) in list_residuals(ContactMeasurements(assembly), [contact], now)]
        _displace_parts(now, operation, _translations(np.array(first).reshape(*_leading_shape(now, operation), 3)))
    return MappingProxyType(now)


def is_insertion(assembly: Assembly, contact: Contact) -> bool:
    """Whether a contact is an insertion: its error is bounded by the play, and no guarded motion closes it."""
    on_plane = any(isinstance(assembly.face_of(of), Face) for of in contact)
    return assembly.is_fit(contact) or not on_plane


def list_residuals(
    known: ContactMeasurements, contacts: Sequence[Contact], poses: Poses
) -> list[tuple[tuple[Array, Array], ...]]:
    """The errors e of contacts at their overlap corners, (k,), [m], positive if the faces are apart; and normals.

    Flat faces that do not overlap in an area are measured at the corners of the whole environment face. A shaft on a
    plane is measured at the ends of the line of contact. The normal, (3,), is that of the flat face, world frame.

    Args:
        known: Cache of measured contacts.
        poses: World frame, [m], (4, 4), or (r, 4, 4) for r alternatives.

    Returns:
        For each alternative the pairs (e, normal), one per contact.
    """
    alternatives = list_alternatives(poses)
    lies = iter(known.measure((contact, each) for each in alternatives for contact in contacts))
    return [
        tuple(compute_residual(known.assembly, contact, next(lies), each) for contact in contacts)
        for each in alternatives
    ]


def compute_residual(assembly: Assembly, contact: Contact, lie: OverlapOrMate, poses: Poses) -> tuple[Array, Array]:
    """(e, normal) of one contact, as in `list_residuals`, from the measured position of its faces.

    Args:
        lie: The contact as measured by `ContactMeasurements`.
    """
    m, e = contact
    if isinstance(lie, Mate):
        up = _flat_normal(assembly, contact, poses)
        # The normal points the other way if the moved part has the round face.
        return lie.offsets @ up, up * (-1.0 if m.face in assembly.solids[m.part].rounds else 1.0)
    T_m = poses[m.part]
    plane = assembly.face(m).plane
    corners = lie.corners if len(lie.corners) else pose.apply(poses[e.part], assembly.face(e).outline)
    n = T_m[:3, :3] @ plane[:3]
    # Distance of the corners from the plane of the moved face, (k,), n x + d.
    return (corners - T_m[:3, 3]) @ n + plane[3], n


def is_support(assembly: Assembly, contact: Contact, poses: Poses) -> NDArray[np.bool_]:
    """Whether weight closes the contact, (*,), one per alternative."""
    return np.asarray(np.abs(_flat_normal(assembly, contact, poses)[..., 2]) > _LEVEL) & (
        not is_insertion(assembly, contact)
    )


def _flat_normal(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The normal of the flat face of a contact, (*, 3), world frame; of the environment's if both are flat."""
    flat = next(of for of in reversed(contact) if isinstance(assembly.face_of(of), Face))
    return np.asarray(poses[flat.part][..., :3, :3] @ assembly.face(flat).normal)


def _lay_flat(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The world displacement that lays the moved face flat on the other one, (*, 4, 4).

    It is the least rotation about the middle of the face, then a shift along the normal of the other face.
    """
    m, e = contact
    if assembly.is_round(contact):
        laid = np.array([_lay_flat_round(assembly, contact, each) for each in list_alternatives(poses)])
        return laid if any(T.ndim == 3 for T in poses.values()) else np.asarray(laid[0])
    # S = shift to the plane * least turn that makes the normals opposite * shift of the middle to the origin.
    middle = _transform_point(poses[m.part], assembly.face(m).outline.mean(axis=0))
    up = poses[e.part][..., :3, :3] @ assembly.face(e).normal
    height = ((middle - _transform_point(poses[e.part], assembly.face(e).outline[0])) * up).sum(axis=-1)
    turned = _least_rotations(poses[m.part][..., :3, :3] @ assembly.face(m).normal, -up)
    return np.asarray(_translations(middle - height[..., None] * up) @ turned @ _translations(-middle))


def _lay_flat_round(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """`_lay_flat` of one alternative for a shaft on a plane, or a plane on a shaft: rotate to parallel, then shift."""
    touch = measure_round_contact(assembly, contact, poses)
    up = _flat_normal(assembly, contact, poses)
    middle = touch.points.mean(axis=0)
    off = touch.offsets.mean(axis=0)
    if isinstance(assembly.face_of(contact.manipulated), RoundFace):
        turned = _least_rotations(touch.axis, _perpendicular_unit_vector(touch.axis, up))
        return np.asarray(_translations(middle - off) @ turned @ _translations(-middle))
    turned = _least_rotations(up, _perpendicular_unit_vector(up, touch.axis))
    return np.asarray(_translations(middle + off) @ turned @ _translations(-middle))


def _perpendicular_unit_vector(a: Array, b: Array) -> Array:
    """The unit vector perpendicular to b that is nearest to a; a itself if a is along b."""
    across = a - (a @ b) * b
    size = float(np.linalg.norm(across))
    return np.asarray(across / size) if size > 0.0 else a


def _least_rotations(a: Array, b: Array) -> Array:
    """The least rotations about the origin that take directions a to b, (*, 3) each, as (*, 4, 4)."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    turn = axis * np.divide(np.arcsin(np.minimum(1.0, sine)), sine, out=np.zeros_like(sine), where=sine > 0.0)
    return pose.exp(np.concatenate([np.zeros_like(turn), turn], axis=-1))


def _translations(d: Array) -> Array:
    """Translations by d, (*, 3), [m], as (*, 4, 4)."""
    return pose.rigid(np.broadcast_to(np.eye(3), (*d.shape, 3)), d)


def _transform_point(T: Array, point: Array) -> Array:
    """The world positions, (*, 3), of a point, (3,), given in a frame at poses T, (*, 4, 4)."""
    return np.asarray(T[..., :3, :3] @ point + T[..., :3, 3])


def _leading_shape(poses: Mapping[str, Array], operation: Operation) -> tuple[int, ...]:
    """The leading shape of the poses of the moved parts: (r,) for r alternatives, () for one."""
    return poses[operation.main].shape[:-2]


def _displace_parts(poses: dict[str, Array], operation: Operation, S: Array) -> None:
    """Displace the moved parts by S, (*, 4, 4), world frame, in place."""
    poses.update({part: S @ poses[part] for part in operation.moves})
