"""Where a part comes to rest that is put down a little wrongly: what is found by touch ends in touch.

Weight lays a part flat on what carries it. A part that is slid against another one stops at the first corner that
touches and keeps its turn. Faces that fit into one another are left as they are planned.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.assembly.topology import Assembly, Contact, Operation
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import overlap

_LEVEL = 0.5
"""A face whose normal makes a larger cosine with the vertical is a support, any other one a side."""


def resting_poses(assembly: Assembly, operation: Operation, poses: Poses) -> Poses:
    """The poses of all parts once what the operation moves has come to rest, as one body.

    Args:
        poses: Every part, what the operation moves where it is brought to, world frame, [m].
    """
    now = dict(poses)
    touched = [contact for contact in operation.contacts if not assembly.is_fit(contact)]
    supports = [contact for contact in touched if is_support(assembly, contact, poses)]
    for contact in supports:
        _displace(now, operation, _flat(assembly, contact, now))
    for contact in (contact for contact in touched if contact not in supports):
        e, n = residual(assembly, contact, now)
        _displace(now, operation, _shift(n * e.min()))
    return MappingProxyType(now)


def residual(assembly: Assembly, contact: Contact, poses: Poses) -> tuple[Array, Array]:
    """e at the corners of the overlap, (k,), [m], positive where the faces are apart, and the normal, (3,), world.

    Of faces that miss each other, or meet in less than an area, the corners of the whole environment face count.
    """
    m, e = contact
    T_m, T_e, plane = poses[m.part], poses[e.part], assembly.face(m).plane
    found = overlap(assembly.face(m), T_m, assembly.face(e), T_e)
    corners = found.corners if found and len(found.corners) else pose.apply(T_e, assembly.face(e).outline)
    n = T_m[:3, :3] @ plane[:3]
    return (corners - T_m[:3, 3]) @ n + plane[3], n


def is_support(assembly: Assembly, contact: Contact, poses: Poses) -> bool:
    """Whether weight closes the contact."""
    e = contact.environment
    return bool(abs((poses[e.part][:3, :3] @ assembly.face(e).normal)[2]) > _LEVEL)


def _flat(assembly: Assembly, contact: Contact, poses: Poses) -> Array:
    """The displacement of the world that lays the manipulated face flat on the other one, (4, 4).

    The least turn, about the middle of the face, and then straight down or up.
    """
    m, e = contact
    middle = pose.apply(poses[m.part], assembly.face(m).outline).mean(axis=0)
    up = poses[e.part][:3, :3] @ assembly.face(e).normal
    axis = np.cross(poses[m.part][:3, :3] @ assembly.face(m).normal, -up)
    sine = float(np.linalg.norm(axis))
    turn = axis * (np.arcsin(min(1.0, sine)) / sine if sine > 0.0 else 0.0)
    height = (middle - pose.apply(poses[e.part], assembly.face(e).outline[:1])[0]) @ up
    turned = pose.exp(np.concatenate([np.zeros(3), turn]))
    return np.asarray(_shift(middle - height * up) @ turned @ _shift(-middle))


def _shift(d: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = d
    return T


def _displace(poses: dict[str, Array], operation: Operation, S: Array) -> None:
    """Move all that the operation moves by a displacement of the world."""
    poses.update({part: S @ poses[part] for part in operation.moves})
