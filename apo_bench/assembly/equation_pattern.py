"""Pose-independent part of the contact equations of an assembly, and the test of which faces fail to oppose.

The equations state that vertices of one face lie in the plane of the other, whichever way the faces look. A cube upside
down inside the table satisfies them as well as one that stands on it, so `find_faces_away` tests the normals. A cone on
a rim may tilt by up to a right angle. Planes through an axis have two equal sides and pass always.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.contact_kinds import OPPOSING, classify_contact
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.round_contacts_as_planes import project_round_faces
from apo_bench.assembly.topology import ODL, Assembly, Contact, Operation, invert, simplify_odl
from apo_bench.geometry import Array, Face, remember

_MOST_CORNERS = 8
"""Most corners of an outline that are used; of more, such as a circle, the outermost ones in so many directions."""


@final
@dataclass(frozen=True, eq=False)
class EquationPattern:
    """The pose-independent part of the equations of an assembly: c contacts with m vertices."""

    words: tuple[ODL, ...]
    """D_a^-1 D_b of each contact, simplified; term k stands for the start of part k, then for the operations."""
    letters: NDArray[np.intp]
    """(c, w), as in `Equations`."""
    inverse: NDArray[np.bool_]
    """(c, w), as in `Equations`."""
    made: NDArray[np.intp]
    """(c,), as in `Equations`."""
    contact: NDArray[np.intp]
    """(m,), as in `Equations`."""
    begin: NDArray[np.intp]
    """(c + 1,): contact i has the vertices begin[i] .. begin[i + 1] - 1."""
    plane: Array
    """(c, 4): n of Eq. 1, frame of the manipulated part."""
    onto: Array
    """(c, 4): the plane of the other face, frame of the environment part."""
    corners: Array
    """(m, 4): the corners of the smaller face, homogeneous, in the frame of its own part."""
    laid: NDArray[np.bool_]
    """(c,): whether the corners are those of the manipulated face, which are projected onto the environment face at the
    poses."""
    freed: tuple[int, ...]
    """The operations whose motion parameters occur, the most recent first."""
    opposing: Array
    """(c,): the largest cosine between normals that oppose; infinite for planes through an axis."""


@remember
def find_equation_pattern(assembly: Assembly) -> EquationPattern:
    """The pose-independent part of the equations; contacts are those of `project_round_faces(assembly)`."""
    if (low := project_round_faces(assembly)) is not assembly:
        return find_equation_pattern(low)
    parts = tuple(assembly.solids)
    chosen = _list_words(assembly, parts)
    c = len(chosen)
    width = max((len(word) for _, _, word in chosen), default=0)
    padding = (len(parts) + len(assembly), False)  # index of the identity, not inverted
    padded = [[*word, *[padding] * (width - len(word))] for _, _, word in chosen]
    table = np.array(padded, dtype=np.intp).reshape(c, width, 2)
    flats = {of: _describe_flat_face(assembly.face(of)) for contact, _, _ in chosen for of in contact}
    pairs = [(flats[contact.manipulated], flats[contact.environment]) for contact, _, _ in chosen]
    # The corners are those of the smaller face; True: that is the manipulated one.
    laid = [environment.area > manipulated.area * (1 + 1e-9) for manipulated, environment in pairs]
    corners = [(a if own else b).corners for (a, b), own in zip(pairs, laid, strict=True)]
    begin = np.cumsum([0, *map(len, corners)])
    return EquationPattern(
        words=tuple(word for _, _, word in chosen),
        letters=np.array(table[..., 0]),
        inverse=table[..., 1].astype(np.bool_),
        made=np.array([made for _, made, _ in chosen], dtype=np.intp),
        contact=np.repeat(np.arange(c), np.diff(begin)).astype(np.intp),
        begin=begin.astype(np.intp),
        plane=np.array([a.plane for a, _ in pairs]).reshape(-1, 4),
        onto=np.array([b.plane for _, b in pairs]).reshape(-1, 4),
        corners=np.concatenate([np.zeros((0, 4)), *(np.column_stack([v, np.ones(len(v))]) for v in corners)]),
        laid=np.array(laid, dtype=np.bool_),
        freed=tuple(
            sorted({k - len(parts) for _, _, word in chosen for k, _ in word if k >= len(parts)}, reverse=True)
        ),
        opposing=np.array([_limit_opposing_cosine(assembly, contact) for contact, _, _ in chosen]),
    )


def _limit_opposing_cosine(assembly: Assembly, contact: Contact) -> float:
    """The largest cosine between the normals of the faces of a contact at which they oppose."""
    if not assembly.face(contact.manipulated).opposes:
        return math.inf
    tilts = (
        contact in assembly.origin
        and classify_contact(*map(assembly.face_of, assembly.origin[contact])) == "cone on rim"
    )
    return 0.0 if tilts else OPPOSING


def find_faces_away(assembly: Assembly, start: Poses, poses: Array) -> NDArray[np.bool_]:
    """Which contacts have faces that do not oppose when they are made, (*, c), in the order of `relations()`.

    Contacts of round faces are those of `project_round_faces`.

    Args:
        poses: (*, n, 4, 4), world frame, [m].
    """
    known = find_equation_pattern(assembly)
    constant = np.array([start[part] for part in assembly.solids]).reshape(-1, 4, 4)[:, :3, :3]
    lead = poses.shape[:-3]
    R = np.concatenate(
        [
            np.broadcast_to(constant, (*lead, *constant.shape)),
            poses[..., :3, :3],
            np.broadcast_to(np.eye(3), (*lead, 1, 3, 3)),
        ],
        axis=-3,
    )
    # The normal of a is carried along the word D_a^-1 D_b into the frame of b: n F_1 .. F_w, of the rotations alone.
    turned = np.concatenate([R, np.swapaxes(R, -1, -2)], axis=-3)
    rows = known.letters + known.inverse * R.shape[-3]
    n = np.broadcast_to(known.plane[:, None, :3], (*lead, len(rows), 1, 3))
    for j in range(rows.shape[1]):
        n = n @ turned[..., rows[:, j], :, :]
    return np.asarray((n[..., 0, :] * known.onto[:, :3]).sum(axis=-1) > known.opposing)


def _list_words(assembly: Assembly, parts: tuple[str, ...]) -> list[tuple[Contact, int, ODL]]:
    """Every contact ever made, the operation that made it, and its word D_a^-1 D_b, simplified.

    Term k of a word is the start pose of part k, or after those of all parts the pose of an operation.
    """
    # One operation per part in front, which puts the part at its start: so start poses are letters too.
    rooted = Assembly(assembly.solids, (*map(Operation, parts), *assembly.operations), assembly.fixed)
    return [
        (contact, k - len(parts), simplify_odl((*invert(D[contact.manipulated.part]), *D[contact.environment.part])))
        for k, (operation, D) in enumerate(zip(rooted.operations, rooted.walk(), strict=True))
        for contact in operation.contacts
    ]


class _FlatFace(NamedTuple):
    """Corners, plane and area of a face, as the equations need them."""

    corners: Array
    """(k, 3), [m]."""
    plane: Array
    """(4,), as of Eq. 1."""
    area: float
    """[m^2]; 0 for a sheet."""


def _describe_flat_face(face: Face) -> _FlatFace:
    """Measure a face: corners, plane and area inside the outline (Newell's formula)."""
    corners = face.outline
    if face.stated_normal is not None:
        return _FlatFace(corners, face.plane, 0.0)
    # Newell: the sum of c_i x c_i+1 over the corners is twice the area along the normal.
    twice = cross_rows(corners, np.concatenate([corners[1:], corners[:1]])).sum(axis=0)
    size = math.sqrt(twice @ twice)
    n = twice / size
    return _FlatFace(_outermost_corners(corners, n), np.append(n, -(corners @ n).sum() / len(corners)), size / 2)


def _outermost_corners(corners: Array, n: Array) -> Array:
    """At most `_MOST_CORNERS` corners of an outline, in its order.

    Args:
        n: The unit normal, (3,).
    """
    if len(corners) <= _MOST_CORNERS:
        return corners
    x = corners[1] - corners[0]
    x = x / math.sqrt(x @ x)
    turn = 2.0 * np.pi * np.arange(_MOST_CORNERS) / _MOST_CORNERS
    # Directions in the plane, evenly turned; the corner that is farthest out along each of them is kept.
    ways = np.outer(np.cos(turn), x) + np.outer(np.sin(turn), np.cross(n, x))
    return np.asarray(corners[np.unique((corners @ ways.T).argmax(axis=0))])


def cross_rows(a: Array, b: Array) -> Array:
    """Cross products, (m, 3): as `np.cross`, quicker on few rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
