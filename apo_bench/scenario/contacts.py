"""Read the contacts of an operation from a scenario file, with the gaps between their faces.

A contact is a pair of faces, flat or round, `["bottom", "table.top"]`, or a table with more keys:

    { faces = ["py", "castle1.spy"], kind = "clearance", gap_mm = [-0.2, 0.3] }

`kind` is `centred` (the default), `contact` or `clearance`, see `apo_bench.assembly.topology.Gap`. `gap_mm` belongs to
`clearance`; without it, the interval is the whole play of parts that fit.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from apo_bench.assembly import Contact, Gap, PartFace, classify_contact, compute_geometric_play
from apo_bench.errors import require, require_known
from apo_bench.geometry import Face, RoundFace, Solid
from apo_bench.scenario.tables import ContactTable

ContactGaps = Mapping[Contact, Gap]
"""The gap of each contact, in the order of the file."""


def read_contacts(
    entries: Sequence[tuple[str, str] | ContactTable],
    place: str,
    moves: tuple[str, ...],
    solids: Mapping[str, Solid],
    there: set[str],
) -> ContactGaps:
    """Read the contacts that one operation makes.

    Args:
        place: File and operation, for messages.
        moves: Parts that move, the main part first; its faces may be named without the part.
        solids: Part -> solid.
        there: Parts that are in place before the operation.

    Raises:
        InputError: A contact is unknown, repeated or impossible.
    """
    contacts: dict[Contact, Gap] = {}
    for i, entry in enumerate(entries, start=1):
        at = f"{place}, contacts, contact {i}"
        table = entry if isinstance(entry, ContactTable) else ContactTable(faces=entry)
        contact = Contact(
            _find_face(table.faces[0], f"{at}, first", solids, moves[0]),
            _find_face(table.faces[1], f"{at}, second", solids),
        )
        _check_contact(contact, at, moves, solids, there)
        require(contact not in contacts, f"{at}: '{contact}' stands here twice; keep one.")
        contacts[contact] = _read_gap(table, at, contact, solids)
    return contacts


def check_kinds(place: str, gaps: Sequence[ContactGaps]) -> None:
    """Raise an `InputError` if the last operation repeats a contact of an earlier one with another gap.

    Args:
        gaps: The contacts of each operation up to the last.
    """
    for contact, gap in gaps[-1].items():
        for k, earlier in enumerate(gaps[:-1], start=1):
            wanted = earlier.get(contact, gap)
            require(
                wanted == gap,
                f"{place}, contacts: '{contact}' is to be {gap} here and {wanted} in operation {k}; state the "
                "same in both.",
            )


def _find_face(name: str, place: str, solids: Mapping[str, Solid], main: str | None = None) -> PartFace:
    """The face of a name `part.face`, or of `face` alone, which is a face of the main part."""
    part, dot, face = name.rpartition(".")
    require(dot or main, f"{place}: a face as 'part.face' is needed, '{name}' was given.")
    part = part if dot or main is None else main
    require_known("part", part, solids, place=place)
    require_known(f"face of part '{part}'", face, {**solids[part].faces, **solids[part].rounds}, place=place)
    return PartFace(part, face)


def _check_contact(
    contact: Contact, place: str, moves: tuple[str, ...], solids: Mapping[str, Solid], there: set[str]
) -> None:
    """Raise an `InputError` unless a moved part touches a resting one, with faces that can make a contact."""
    above = contact.manipulated.part
    below = contact.environment.part
    require(above in moves, f"{place}, first: '{above}' does not move here; name a face of '{moves[0]}'.")
    require(below not in moves, f"{place}, second: '{below}' moves in this operation; name a part that rests.")
    require(below in there, f"{place}, second: '{below}' is not there yet; name a fixed part or one moved before.")
    a, b = (solids[of.part].face(of.face) for of in contact)
    require(
        classify_contact(a, b) is not None,
        f"{place}: '{contact}': {_describe_face(a)} and {_describe_face(b)} make no contact.",
    )


def _describe_face(face: Face | RoundFace) -> str:
    """The kind of a face in words, such as `a hole of 10 mm`."""
    if isinstance(face, Face):
        return "a flat face"
    if face.kind == "cone":
        angle = np.degrees(2.0 * np.arctan(abs(face.slope)))
        return f"a {'countersink' if face.hole else 'cone'} of {angle:.3g} degrees"
    what = "the rim of a " if face.kind == "rim" else "a "
    return f"{what}{'hole' if face.hole else 'shaft'} of {2e3 * face.radius:g} mm"


def _read_gap(table: ContactTable, place: str, contact: Contact, solids: Mapping[str, Solid]) -> Gap:
    """Return the gap of a contact: its kind, and the stated interval in [m]."""
    a, b = (solids[of.part].face(of.face) for of in contact)
    if table.gap_mm is None:
        has_play = a.fit or b.fit or compute_geometric_play(a, b) > 0.0
        require(
            table.kind != "clearance" or has_play,
            f"{place}: '{contact}': faces without play have no clearance; say gap_mm = [lowest, highest].",
        )
        return Gap(table.kind)
    low, high = table.gap_mm
    require(table.kind == "clearance", f'{place}, gap_mm: "{table.kind}" has no interval; say kind = "clearance".')
    require(
        low <= 0.0 <= high and low < high,
        f"{place}, gap_mm: a lowest number up to 0 and a higher one from 0 are needed.",
    )
    return Gap(table.kind, 1e-3 * low, 1e-3 * high)
