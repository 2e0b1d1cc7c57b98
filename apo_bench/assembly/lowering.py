"""Contacts of round faces as contacts of planes, which is all that the face contact equations know.

A contact says that points of one part lie on planes of another one (Eq. 1). Of round faces these are points and planes
of the axis: two points of the axis of a hole on two planes through the axis of its shaft, say. Which two planes does
not matter, as long as they are perpendicular. Here every contact of round faces becomes contacts of sheets, flat faces
that no part has: a plane that goes through the axis or stands on it, or a few points of it.

| contact | points | planes | fixes |
|---|---|---|---|
| shaft in hole | two of the one axis | two through the other axis | 4 |
| shaft on plane | two of the axis | the plane, a radius in front of the face | 2 |
| cone in cone | two of the one axis | two through the other axis, one across it where the radii are the same | 5 |
| cone on rim | the middle of the rim | two through the axis of the cone, one across it where it is as wide | 3 |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.kinds import contact_kind
from apo_bench.assembly.topology import Assembly, Contact, Gap, PartFace
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.remembered import remembered
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face, Solid

_BEHIND = "|"
"""Between the name of a face and what a sheet adds to it: no name of a face has it."""
_WALLS = 8
"""Planes through the axis where play is a disc: sixteen walls, whose corners lie on its circle."""


class Lowered(NamedTuple):
    """An assembly in which all contacts are of planes."""

    assembly: Assembly
    contacts: Mapping[Contact, Contact]
    """Each of its contacts -> the one that it is part of."""


@remembered
def lowered(assembly: Assembly) -> Lowered:
    """An assembly with sheets for round faces; the same object if it has no contact of round faces."""
    if not any(assembly.is_round(contact) for operation in assembly.operations for contact in operation.contacts):
        return Lowered(assembly, {relation.contact: relation.contact for relation in assembly.relations()})
    sheets: dict[PartFace, Face] = {}
    gaps, origin, operations = dict(assembly.gaps), dict[Contact, Contact](), []
    for operation in assembly.operations:
        made = []
        for contact in operation.contacts:
            for low in _sheets(assembly, contact, sheets):
                made.append(low)
                origin[low] = contact
                if contact in assembly.gaps:
                    gaps[low] = assembly.gaps[contact]
        operations.append(replace(operation, contacts=tuple(made)))
    solids = {name: _with_sheets(solid, name, sheets) for name, solid in assembly.solids.items()}
    return Lowered(replace(assembly, solids=solids, operations=tuple(operations), gaps=gaps), origin)


def _with_sheets(solid: Solid, part: str, sheets: Mapping[PartFace, Face]) -> Solid:
    own = {of.face: face for of, face in sheets.items() if of.part == part}
    return replace(solid, faces={**solid.faces, **own}) if own else solid


def _sheets(assembly: Assembly, contact: Contact, sheets: dict[PartFace, Face]) -> list[Contact]:
    """The contacts of sheets that a contact stands for; new sheets are added to those there are."""
    a, b = (assembly.face_of(of) for of in contact)
    if isinstance(a, Face) and isinstance(b, Face):
        return [contact]
    fit = a.fit or b.fit
    kind = contact_kind(a, b)

    def sheet(of: PartFace, tail: str, points: Array, normal: Array) -> PartFace:
        named = PartFace(of.part, f"{of.face}{_BEHIND}{tail}")
        sheets[named] = Face(named.face, points, fit=fit, stated_normal=normal)
        return named

    if kind == "shaft on plane":
        flat, wall = (contact[0], contact[1]) if isinstance(a, Face) else (contact[1], contact[0])
        plane, shaft = assembly.face(flat), assembly.round_face(wall)
        tail = f"{1e6 * shaft.radius:.3f}"
        raised = sheet(flat, tail, plane.outline + shaft.radius * plane.normal, plane.normal)
        return [Contact(raised, sheet(wall, "axis", shaft.ends, -shaft.frame[:3, 0]))]
    if kind == "cone on rim":
        rim_first = assembly.round_face(contact[0]).kind == "rim"
        cone_of, rim_of = (contact[1], contact[0]) if rim_first else (contact[0], contact[1])
        cone, rim = assembly.round_face(cone_of), assembly.round_face(rim_of)
        points = sheet(rim_of, "middle", rim.ends[:1], rim.axis)
        planes = [*_through(cone, 2), _across(cone, rim.radius)]
    else:
        cone_of, other_of = contact
        cone, other = assembly.round_face(cone_of), assembly.round_face(other_of)
        ends = _two_points(other, cone)
        points = sheet(other_of, f"axis {1e6 * min(other.length, cone.length):.3f}", ends, other.frame[:3, 0])
        count = _WALLS if assembly.gaps.get(contact, Gap()).kind == "clearance" else 2
        planes = list(_through(cone, count))
    made = [Contact(sheet(cone_of, tail, at[None], n), points) for tail, at, n in planes]
    if kind == "cone in cone":
        cone, other = assembly.round_face(contact[0]), assembly.round_face(contact[1])
        middle = sheet(contact[1], "middle", other.middle[None], other.axis)
        tail, at, n = _across(cone, other.radius)
        made.append(Contact(sheet(contact[0], tail, at[None], n), middle))
    return made


def _through(face: RoundFace, count: int) -> list[tuple[str, Array, Array]]:
    """Planes through the axis, evenly turned: what each is called, a point on it, its normal."""
    x, y = face.frame[:3, 0], face.frame[:3, 1]
    turns = np.pi * np.arange(count) / count
    names = ("x", "y") if count == 2 else tuple(f"{i}" for i in range(count))
    return [(name, face.middle, np.cos(t) * x + np.sin(t) * y) for name, t in zip(names, turns, strict=True)]


def _across(face: RoundFace, radius: float) -> tuple[str, Array, Array]:
    """The plane across the axis of a cone where it has a radius."""
    height = face.span[0] + (radius - face.radii[0]) / face.slope
    return f"{1e6 * radius:.3f}", face.point + height * face.axis, face.axis


def _two_points(face: RoundFace, other: RoundFace) -> Array:
    """Two points of the axis, (2, 3), about its middle, as far apart as the shorter of two faces is long."""
    reach = min(face.length, other.length) / 2
    return np.asarray(face.middle + np.outer((-reach, reach), face.axis))
