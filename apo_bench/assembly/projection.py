"""Contacts of round faces as contacts of planes, which is all that the face contact equations know.

A contact says that points of one part lie on planes of another one (Eq. 1). Of round faces these are points and planes
of the axis: two points of the axis of a hole on two planes through the axis of its shaft, say. Here every contact of
round faces becomes contacts of sheets, flat faces that no part has: a plane that goes through the axis or stands on it,
or a few points of it.

| contact | points | planes | fixes |
|---|---|---|---|
| shaft in hole | both ends of the axis of the shorter face | two through the axis of the longer one | 4 |
| shaft on plane | both ends of the axis | the plane, a radius in front of the face | 2 |
| cone in cone | as shaft in hole, and the middle of the shorter | and one across it where the radii are the same | 5 |
| cone on rim | the middle of the rim | two through the axis of the cone, one across it where it is as wide | 3 |

Which two planes through an axis does not matter, as long as they are perpendicular; they follow the axes of the frame
of the face (`RoundFace.frame`), and the equations of the paper take these as well. Play of a shaft is a disc: where
anything within it is allowed, there are `WALLS` planes in place of two.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly.contact_kinds import WALLS, classify_contact
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.topology import Assembly, Contact, Gap, PartFace
from apo_bench.errors import require
from apo_bench.geometry import Array, Face, RoundFace, remember

_BEHIND = "|"
"""Between the name of a face and what a sheet adds to it: no name of a face has it."""
_SAME_M = 1e-9


def project_round_faces(assembly: Assembly) -> Assembly:
    """An assembly in which all contacts are of planes, with sheets for round faces; the same if it has none.

    Operations, ODLs and arcs are the same, solids too. `Assembly.given` says what each contact is part of.

    Raises:
        InputError: A contact of round faces asks for a gap that it cannot have.
    """
    return _project(assembly) or assembly


def project_observation(observation: Observation) -> Observation:
    """An observation of such an assembly; the same if nothing is round."""
    low = project_round_faces(observation.assembly)
    return observation if low is observation.assembly else replace(observation, assembly=low)


def project_observations(observations: Sequence[Observation]) -> Sequence[Observation]:
    """Observations of one assembly, each as `project_observation` has it."""
    alike = bool(observations) and project_round_faces(observations[0].assembly) is observations[0].assembly
    return observations if alike else [project_observation(one) for one in observations]


@remember
def _project(assembly: Assembly) -> Assembly | None:
    """None of an assembly without round contacts: what is remembered of an object must not keep it alive."""
    if not any(assembly.is_round(contact) for operation in assembly.operations for contact in operation.contacts):
        return None
    gaps = dict(assembly.gaps)
    operations = []
    sheets = _Sheets(assembly)
    for operation in assembly.operations:
        lower = tuple(low for contact in operation.contacts for low in sheets.of(contact))
        operations.append(replace(operation, contacts=lower))
    gaps.update({low: gaps[contact] for low, contact in sheets.origin.items() if contact in gaps})
    return replace(assembly, operations=tuple(operations), gaps=gaps, sheets=sheets.sheets, origin=sheets.origin)


class _Sheets:
    """The sheets of an assembly, as they are asked for."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self.sheets: dict[PartFace, Face] = {}
        self.origin: dict[Contact, Contact] = {}

    def of(self, contact: Contact) -> list[Contact]:
        """The contacts that one stands for."""
        if not self._assembly.is_round(contact):
            return [contact]
        kind = classify_contact(*map(self._assembly.face_of, contact))
        gap = self._assembly.gaps.get(contact, Gap())
        _check_gap(contact, kind, gap)
        if kind == "shaft on plane":
            lower = [self._on_plane(contact)]
        elif kind == "cone on rim":
            cone_of, rim_of = _first(contact, self._assembly.round_face(contact.manipulated).kind == "cone")
            lower = [*self._coaxial(cone_of, rim_of, 2), self._seat(cone_of, rim_of)]
        else:
            lengths = [self._assembly.round_face(of).length for of in contact]
            long, short = _first(contact, lengths[0] >= lengths[1] - _SAME_M)
            lower = self._coaxial(long, short, WALLS if gap.kind == "clearance" else 2)
            lower += [self._seat(long, short)] if kind == "cone in cone" else []
        swapped = lower[0].manipulated.part != contact.manipulated.part
        lower = [self._mark(low) if swapped else low for low in lower]
        self.origin.update(dict.fromkeys(lower, contact))
        return lower

    def _on_plane(self, contact: Contact) -> Contact:
        """A shaft on a plane: its axis, in the plane a radius in front."""
        flat, wall = _first(contact, contact.environment.face in self._assembly.solids[contact.environment.part].rounds)
        face = self._assembly.face(flat)
        shaft = self._assembly.round_face(wall)
        raised = face.outline + shaft.radius * face.normal
        plane = self._sheet(flat, f"{1e6 * shaft.radius:.3f}", raised, face.normal, face.fit, opposes=False)
        return Contact(plane, self._axis(wall, "1 of 1", 0.0))

    def _coaxial(self, planes_of: PartFace, points_of: PartFace, count: int) -> list[Contact]:
        """The axis of one face, or its point of a rim, in planes through the axis of another one, evenly turned."""
        face = self._assembly.round_face(planes_of)
        contacts = []
        for i in range(count):
            tail = f"{i + 1} of {count}"
            n = face.around(np.pi * i / count)
            sheet = self._sheet(planes_of, tail, face.middle[None], n, face.fit, opposes=False)
            contacts.append(Contact(sheet, self._axis(points_of, tail, np.pi * i / count)))
        return contacts

    def _seat(self, cone_of: PartFace, other_of: PartFace) -> Contact:
        """The middle of a face in the plane across a cone where both are as wide."""
        cone = self._assembly.round_face(cone_of)
        other = self._assembly.round_face(other_of)
        at = cone.where_wide(other.radius)[None]
        plane = self._sheet(cone_of, f"{1e6 * other.radius:.3f}", at, _outward(cone), cone.fit)
        return Contact(plane, self._sheet(other_of, "middle", other.middle[None], _outward(other), other.fit))

    def _axis(self, of: PartFace, tail: str, turn: float) -> PartFace:
        """The ends of the axis of a face, a single point of a rim; each of several planes has points of its own."""
        face = self._assembly.round_face(of)
        points = face.ends[:1] if face.kind == "rim" else face.ends
        return self._sheet(of, f"axis {tail}", points, face.around(turn), face.fit, opposes=False)

    def _sheet(
        self, of: PartFace, tail: str, points: Array, normal: Array, fit: bool, opposes: bool = True
    ) -> PartFace:
        named = PartFace(of.part, f"{of.face}{_BEHIND}{tail}")
        self.sheets[named] = Face(named.face, points, fit=fit, stated_normal=normal, opposes=opposes)
        return named

    def _mark(self, low: Contact) -> Contact:
        """A contact whose plane belongs to the environment of the given one, under a name that says so."""
        named = low.manipulated._replace(face=f"{low.manipulated.face}, turned round")
        self.sheets[named] = replace(self.sheets[low.manipulated], name=named.face)
        return Contact(named, low.environment)


def _first(contact: Contact, manipulated: bool) -> tuple[PartFace, PartFace]:
    """Both faces of a contact, beginning with the manipulated one or with the other."""
    return (contact.manipulated, contact.environment) if manipulated else (contact.environment, contact.manipulated)


def _outward(face: RoundFace) -> Array:
    """Which way a cone or a rim looks out of its part: a countersink where it widens, a taper where it narrows."""
    if face.kind == "rim":
        return face.axis
    return face.axis * (np.sign(face.slope) if face.hole else -np.sign(face.slope))


def _check_gap(contact: Contact, kind: str | None, gap: Gap) -> None:
    """Refuse what cannot be asked of round faces."""
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
