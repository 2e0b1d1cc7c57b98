"""Give play to parts that go in between walls of two different parts without any."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from apo_bench.assembly import Contact
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Face, Solid, shrink_pieces
from apo_bench.importers.assembly.order_search import Placement
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.scenario.parts.fit_faces import mark_fit_faces

_ALONG = 0.1
"""A wall runs along the direction of insertion if the cosine of its normal with it is at most this."""
_OPPOSITE = 1e-6  # cosines of opposite normals differ from -1 by less


def add_clearance_between(
    parts: Sequence[PosedPart], order: Sequence[Placement], clearance_mm: float
) -> tuple[tuple[PosedPart, ...], tuple[str, ...]]:
    """Return the parts with the faces marked as fit that go in between walls of two other parts, and a note for each.

    Args:
        order: The operations in their order.
    """
    changed = {each.name: each for each in parts}
    notes = list[str]()
    solids = {each.name: each.solid for each in parts}
    for placing in order if clearance_mm else ():
        faces = dict.fromkeys(_list_enclosed_faces(solids, placing), 0.0)
        own = changed.get(placing.moves[0])
        if not faces or own is None:
            continue
        try:
            solid = mark_fit_faces(own.solid, faces)
            shrink_pieces(solid, 1e-3 * clearance_mm)
        except InputError as error:
            notes.append(f"'{own.name}' gets no play between its neighbours: {str(error).rstrip('.')}")
            continue
        changed[own.name] = replace(own, solid=solid, fit={**own.fit, **faces})
        notes.append(
            f"'{own.name}' was drawn without play between two other parts: {', '.join(faces)} recede by "
            f"{clearance_mm:g} mm, as stated under [parts.{own.name}.fit]"
        )
    return tuple(changed.values()), tuple(notes)


def _list_enclosed_faces(solids: Mapping[str, Solid], placing: Placement) -> Iterator[str]:
    """Yield the flat faces of a moved part that touch opposite walls of two other parts, none marked as fit."""
    main = placing.moves[0]
    R = placing.at[:3, :3]
    walls: list[tuple[Contact, Array]] = []
    for contact in placing.contacts:
        own, other = (solids[of.part].face(of.face) if of.part in solids else None for of in contact)
        if contact.manipulated.part != main or not isinstance(own, Face) or not isinstance(other, Face):
            continue
        if not (own.fit or other.fit) and abs(R @ own.normal @ placing.way) < _ALONG:
            walls.append((contact, R @ own.normal))
    for (a, n), (b, m) in combinations(walls, 2):
        if a.environment.part != b.environment.part and np.dot(n, m) < -1.0 + _OPPOSITE:
            yield from (a.manipulated.face, b.manipulated.face)
