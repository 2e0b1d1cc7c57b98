"""Round contacts as contacts of planes: sheets, which are planes and points of axes, replace round faces.

A contact equation says that points of one part lie on planes of another one (Eq. 1). For round faces these are points
and planes of axes: for example, two points of the axis of a hole on two planes through the axis of its shaft. Every
contact of round faces becomes contacts of sheets. A sheet is a flat face that no part has: a plane through the axis or
perpendicular to it, or a few points of it.

| contact | points | planes | fixes |
|---|---|---|---|
| shaft in hole | both ends of the axis of the shorter face | two through the axis of the longer one | 4 |
| shaft on plane | both ends of the axis | the plane, a radius in front of the face | 2 |
| cone in cone | as shaft in hole, and the middle of the shorter | and one across it where the radii are the same | 5 |
| cone on rim | the middle of the rim | two through the axis of the cone, one across it where it is as wide | 3 |

Any two perpendicular planes through an axis serve; they follow the axes of the frame of the face (`RoundFace.frame`).
The equations of the paper use these sheets as well. The play of a shaft is a disc: where it may be anywhere within
that, `WALLS` planes replace the two.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly.contact_kinds import WALLS, classify_contact
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.topology import Assembly, Contact, Gap, PartFace
from apo_bench.errors import require
from apo_bench.geometry import Array, Face, RoundFace, remember

_SEPARATOR = "|"
"""Separator between the name of a face and the suffix of its sheet; no name of a face contains it."""
_EQUAL_M = 1e-9
"""Length difference up to which two faces count as equally long, [m]."""


def project_round_faces(assembly: Assembly) -> Assembly:
    """Replace all contacts of round faces by contacts of sheets; an assembly without round contacts is returned as it
    is.

    Operations, ODLs, arcs and solids stay the same. `Assembly.given` returns the contact that a contact of sheets
    stands for.

    Raises:
        InputError: A contact of round faces asks for a gap that it cannot have.
    """
    return _project_assembly(assembly) or assembly


def project_observation(observation: Observation) -> Observation:
    """The observation with its assembly projected by `project_round_faces`; unchanged if it has no round contacts."""
    projected = project_round_faces(observation.assembly)
    return observation if projected is observation.assembly else replace(observation, assembly=projected)


def project_observations(observations: Sequence[Observation]) -> Sequence[Observation]:
    """Apply `project_observation` to observations of one assembly."""
    unchanged = bool(observations) and project_round_faces(observations[0].assembly) is observations[0].assembly
    return observations if unchanged else [project_observation(observation) for observation in observations]


@remember
def _project_assembly(assembly: Assembly) -> Assembly | None:
    """The projected assembly; None without round contacts, since a cached result must not keep its own key alive."""
    if not any(assembly.is_round(contact) for operation in assembly.operations for contact in operation.contacts):
        return None
    gaps = dict(assembly.gaps)
    operations = []
    sheets = _Sheets(assembly)
    for operation in assembly.operations:
        contacts = tuple(projected for contact in operation.contacts for projected in sheets.of(contact))
        operations.append(replace(operation, contacts=contacts))
    gaps.update({projected: gaps[contact] for projected, contact in sheets.origin.items() if contact in gaps})
    return replace(assembly, operations=tuple(operations), gaps=gaps, sheets=sheets.sheets, origin=sheets.origin)


class _Sheets:
    """Builds the sheets of an assembly, contact by contact."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self.sheets: dict[PartFace, Face] = {}
        self.origin: dict[Contact, Contact] = {}

    def of(self, contact: Contact) -> list[Contact]:
        """The contacts of sheets that replace a contact; a flat contact replaces itself."""
        if not self._assembly.is_round(contact):
            return [contact]
        kind = classify_contact(*map(self._assembly.face_of, contact))
        gap = self._assembly.gaps.get(contact, Gap())
        _check_gap(contact, kind, gap)
        if kind == "shaft on plane":
            projected_contacts = [self._shaft_on_plane(contact)]
        elif kind == "cone on rim":
            cone_of, rim_of = _order_faces(contact, self._assembly.round_face(contact.manipulated).kind == "cone")
            projected_contacts = [*self._coaxial_contacts(cone_of, rim_of, 2), self._cone_seat(cone_of, rim_of)]
        else:
            lengths = [self._assembly.round_face(of).length for of in contact]
            long, short = _order_faces(contact, lengths[0] >= lengths[1] - _EQUAL_M)
            projected_contacts = self._coaxial_contacts(long, short, WALLS if gap.kind == "clearance" else 2)
            projected_contacts += [self._cone_seat(long, short)] if kind == "cone in cone" else []
        swapped = projected_contacts[0].manipulated.part != contact.manipulated.part
        projected_contacts = [self._swap_roles(projected) if swapped else projected for projected in projected_contacts]
        self.origin.update(dict.fromkeys(projected_contacts, contact))
        return projected_contacts

    def _shaft_on_plane(self, contact: Contact) -> Contact:
        """The contact of a shaft on a plane: its axis lies in the plane raised by the radius."""
        flat, wall = _order_faces(
            contact, contact.environment.face in self._assembly.solids[contact.environment.part].rounds
        )
        face = self._assembly.face(flat)
        shaft = self._assembly.round_face(wall)
        raised = face.outline + shaft.radius * face.normal
        plane = self._add_sheet(flat, f"{1e6 * shaft.radius:.3f}", raised, face.normal, face.fit, opposes=False)
        return Contact(plane, self._add_axis_sheet(wall, "1 of 1", 0.0))

    def _coaxial_contacts(self, planes_of: PartFace, points_of: PartFace, count: int) -> list[Contact]:
        """The contacts of the axis of one face, or the centre of a rim, with `count` planes through the axis of another
        one.
        """
        face = self._assembly.round_face(planes_of)
        contacts = []
        for i in range(count):
            suffix = f"{i + 1} of {count}"
            n = face.around(np.pi * i / count)
            sheet = self._add_sheet(planes_of, suffix, face.middle[None], n, face.fit, opposes=False)
            contacts.append(Contact(sheet, self._add_axis_sheet(points_of, suffix, np.pi * i / count)))
        return contacts

    def _cone_seat(self, cone_of: PartFace, other_of: PartFace) -> Contact:
        """The contact of the middle of a face with the plane across a cone where the cone has the radius of that
        face.
        """
        cone = self._assembly.round_face(cone_of)
        other = self._assembly.round_face(other_of)
        at = cone.where_wide(other.radius)[None]
        plane = self._add_sheet(cone_of, f"{1e6 * other.radius:.3f}", at, _outward_axis(cone), cone.fit)
        return Contact(plane, self._add_sheet(other_of, "middle", other.middle[None], _outward_axis(other), other.fit))

    def _add_axis_sheet(self, of: PartFace, suffix: str, angle: float) -> PartFace:
        """A sheet of the ends of the axis of a face, or of the centre of a rim; each plane gets its own sheet.

        Args:
            suffix: Suffix of the name.
            angle: Angle of the normal about the axis, [rad].
        """
        face = self._assembly.round_face(of)
        points = face.ends[:1] if face.kind == "rim" else face.ends
        return self._add_sheet(of, f"axis {suffix}", points, face.around(angle), face.fit, opposes=False)

    def _add_sheet(
        self, of: PartFace, suffix: str, points: Array, normal: Array, fit: bool, opposes: bool = True
    ) -> PartFace:
        """Add a sheet to the part of a face, named after the face with a suffix."""
        part_face = PartFace(of.part, f"{of.face}{_SEPARATOR}{suffix}")
        self.sheets[part_face] = Face(part_face.face, points, fit=fit, stated_normal=normal, opposes=opposes)
        return part_face

    def _swap_roles(self, projected: Contact) -> Contact:
        """Rename the plane of a contact whose manipulated part is the environment of the original contact."""
        part_face = projected.manipulated._replace(face=f"{projected.manipulated.face}, turned round")
        self.sheets[part_face] = replace(self.sheets[projected.manipulated], name=part_face.face)
        return Contact(part_face, projected.environment)


def _order_faces(contact: Contact, manipulated: bool) -> tuple[PartFace, PartFace]:
    """Both faces of a contact; the manipulated one first, or last if `manipulated` is False."""
    return (contact.manipulated, contact.environment) if manipulated else (contact.environment, contact.manipulated)


def _outward_axis(face: RoundFace) -> Array:
    """The outward direction of a cone or a rim along its axis: a countersink where it widens, a taper where it
    narrows.
    """
    if face.kind == "rim":
        return face.axis
    return face.axis * (np.sign(face.slope) if face.hole else -np.sign(face.slope))


def _check_gap(contact: Contact, kind: str | None, gap: Gap) -> None:
    """Reject gaps that contacts of round faces cannot have."""
    require(kind is not None, f"{contact}: these two faces make no contact; name a shaft and its hole, say.")
    require(
        kind not in ("cone in cone", "cone on rim") or gap.kind == "centred",
        f"{contact} is a {kind} and asks for '{gap}'; only 'centred' is allowed, so leave it out.",
    )
    require(
        kind != "shaft in hole" or gap.kind != "contact",
        f"{contact} is a shaft in a hole and asks for 'contact', which does not say where on the wall; "
        "use 'centred' or 'clearance'.",
    )
    require(
        kind != "shaft in hole" or gap.low_m is None or gap.high_m is None or gap.low_m == -gap.high_m,
        f"{contact} is a shaft in a hole and asks for '{gap}'; the play of a shaft is a disc, so state the same "
        "length twice, from minus it to it.",
    )
