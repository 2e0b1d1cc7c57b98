"""Sources of wrong contacts, to test how robust a corrector is.

`omit_contact`  one contact is missing
`add_contact`   one contact too many: two faces that only come near each other
`FaceOffset`    one face lies off the face of the part's model, along its normal

Only the input of the corrector is wrong. Demonstration, robot and judge keep the right contacts.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Gap,
    Observation,
    PartFace,
    Poses,
    build_relation_graph,
    classify_contact,
    compute_placements,
    faces_oppose,
    find_round_pairs,
    measure_height,
    measure_round_pair,
)
from apo_bench.errors import RAISED, InputError, failed, require
from apo_bench.geometry import Array, Face, RoundFace, Solid, compute_overlap
from apo_bench.names import resolve
from apo_bench.records import FACE_OFFSET_MM, GIVEN, WRONG_CONTACTS, normalise_contact_source, parse_face_offset

ContactSource = Callable[[Assembly, Poses, Array, np.random.Generator], Assembly]
"""Any function `(assembly, start, poses, rng) -> Assembly`: right contacts and poses in, wrong contacts out."""

_OPPOSED_RAD = math.radians(10.0)
"""Two faces oppose each other if one normal is within this angle of the opposite of the other."""
TOUCHING_M = 0.5e-3
"""Faces with a smaller gap touch, or nearly, so they make no false contact."""
NEAR_FACES_M = 15e-3
"""Faces with a smaller gap are near enough to be mistaken for a contact."""
_LEAST_OVERLAP_M2 = 25e-6
"""Flat faces overlap if the area is larger, (5 mm)^2."""
_SHARED = 0.15
"""Round faces overlap if they share a larger fraction of their length."""


def make_contacts(given: Any) -> ContactSource | None:
    """Return the contact source of a name; None for `given`, which keeps the right contacts.

    Args:
        given: A name as in `apo_bench.records.contact_sources`, `"package.module:name"`, or the function itself.

    Raises:
        InputError: The name is unknown, or the object is not a function.
    """
    name = (
        normalise_contact_source(given) if isinstance(given, str) else getattr(given, "__name__", type(given).__name__)
    )
    if name == GIVEN:
        return None
    if isinstance(given, str) and name.startswith("face-offset:"):
        return FaceOffset(parse_face_offset(name) * 1e-3)
    source = resolve(name, WRONG_CONTACTS, "source of contacts") if isinstance(given, str) else given
    require(
        callable(source) and not isinstance(source, type),
        f"the source of contacts '{name}' is no function; give (assembly, start, poses, rng) -> Assembly.",
    )
    return source


def replace_contacts(
    observation: Observation, source: ContactSource | None, truth: Array, rng: np.random.Generator
) -> Observation:
    """Return an observation with wrong contacts in place of the right ones.

    Args:
        truth: (n, 4, 4), the true poses, world frame, [m].

    Raises:
        InputError: The function raised an error, or returned something other than an assembly of the same operations.
    """
    if source is None:
        return observation
    name = f"the source of contacts '{getattr(source, '__name__', type(source).__name__)}'"
    try:
        wrong = source(observation.assembly, observation.start, truth, rng)
        complaint = _find_fault(observation.assembly, wrong)
    except InputError:
        raise
    except RAISED as error:
        raise failed(name, error) from error
    require(not complaint, f"{name} {complaint}.")
    return replace(observation, assembly=wrong)


def _find_fault(right: Assembly, wrong: Any) -> str:
    """Return the fault of the value that a contact source returned, as the end of an error message; empty if valid."""
    if not isinstance(wrong, Assembly):
        return f"returned {type(wrong).__name__}; return an Assembly"
    operations, before = ([replace(each, contacts=()) for each in of.operations] for of in (wrong, right))
    if operations != before or set(wrong.solids) != set(right.solids):
        return "changed parts or operations; change nothing but contacts and faces"
    for relation in wrong.relations():
        for part, face in relation.contact:
            if part not in wrong.solids or face not in {**wrong.solids[part].faces, **wrong.solids[part].rounds}:
                return f"returned a contact of {part}.{face}, which is no face; name faces that the solids have"
        if classify_contact(*(wrong.face_of(of) for of in relation.contact)) is None:
            return f"returned the contact {relation.contact}, which faces of these kinds cannot make; name others"
    return ""


def find_wrong_relation(right: Assembly, wrong: Assembly) -> str | None:
    """The first relation (R1, R2, ...) of the wrong relation graph that contains a wrong contact; None if none does."""
    arcs = build_relation_graph(wrong).arcs
    return next((arc.name for arc in arcs if not set(arc.contacts) <= set(right.operations[arc.made].contacts)), None)


def omit_contact(assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
    """Remove one contact, chosen at random."""
    k, contact = _draw_contact(assembly, rng)
    return _replace_contacts_of_operation(
        assembly, k, tuple(c for c in assembly.operations[k].contacts if c != contact)
    )


def add_contact(assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
    """Add one false contact between two opposed faces that overlap and are less than 15 mm apart, chosen at random.

    If there are none, the nearest overlapping pair is taken, else the nearest opposed pair. An assembly without opposed
    faces is returned unchanged.
    """
    pairs = list(_list_opposed_pairs(assembly, start, poses))
    near = [pair for pair in pairs if pair.covered and pair.apart_m < NEAR_FACES_M]
    if near:
        chosen = near[int(rng.integers(len(near)))]
    elif pairs:
        chosen = min(pairs, key=lambda pair: (not pair.covered, pair.apart_m))
    else:
        return assembly
    return _replace_contacts_of_operation(
        assembly, chosen.made, (*assembly.operations[chosen.made].contacts, chosen.contact)
    )


@final
@dataclass(frozen=True)
class FaceOffset:
    """Displace the environment face of one contact, chosen at random, along its normal, outwards or inwards.

    A round face is displaced across its axis, in a random direction.
    """

    size_m: float = FACE_OFFSET_MM * 1e-3
    """Length of the displacement."""

    def __call__(self, assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
        k, contact = _draw_contact(assembly, rng)
        part, old = contact.environment
        sign = (1.0, -1.0)[int(rng.integers(2))]
        new = _move_face(assembly.face_of(contact.environment), f"{old}_shifted", self.size_m * sign, rng)
        instead = Contact(contact.manipulated, PartFace(part, new.name))
        solids = {**assembly.solids, part: _add_face(assembly.solids[part], new)}
        contacts = tuple(instead if c == contact else c for c in assembly.operations[k].contacts)
        gaps = {**assembly.gaps, instead: assembly.gaps.get(contact, Gap())}
        return _replace_contacts_of_operation(replace(assembly, solids=solids, gaps=gaps), k, contacts)


class _OpposedPair(NamedTuple):
    """Two opposed flat faces, or two round faces with nearly parallel axes, that do not touch."""

    made: int
    """The operation after which they are so near, counted from 0."""
    contact: Contact
    apart_m: float
    """Distance of flat faces, or gap of round ones."""
    covered: bool
    """True if the faces overlap."""


def _draw_contact(assembly: Assembly, rng: np.random.Generator) -> tuple[int, Contact]:
    """Draw one of all contacts with equal probability; return the operation that makes it, and the contact."""
    relations = assembly.relations()
    require(relations, "the assembly has no contact that could be wrong; use `given`.")
    chosen = relations[int(rng.integers(len(relations)))]
    return chosen.made, chosen.contact


def _list_opposed_pairs(assembly: Assembly, start: Poses, poses: Array) -> Iterator[_OpposedPair]:
    """Yield the opposed pairs that do not touch, of moved parts and parts in place, after each operation."""
    standing = dict.fromkeys(part for part in assembly.solids if part in assembly.fixed)
    for k, stage in enumerate(compute_placements(assembly, start, poses)):
        moves = assembly.operations[k].moves
        standing |= dict.fromkeys(moves)
        for part in moves:
            for other in (p for p in standing if p not in moves):
                for a, b in product(assembly.solids[part].faces.values(), assembly.solids[other].faces.values()):
                    contact = Contact(PartFace(part, a.name), PartFace(other, b.name))
                    apart = measure_height(a, stage[part], b, stage[other])
                    near = apart > TOUCHING_M and faces_oppose(a, stage[part], b, stage[other], _OPPOSED_RAD)
                    if near and contact not in assembly.operations[k].contacts:
                        area = compute_overlap(a, stage[part], b, stage[other]).area
                        yield _OpposedPair(k, contact, apart, area > _LEAST_OVERLAP_M2)
                for c, d in find_round_pairs(assembly.solids[part], assembly.solids[other]):
                    contact = Contact(PartFace(part, c.name), PartFace(other, d.name))
                    measured = measure_round_pair(c, stage[part], d, stage[other])
                    near = measured.angle_rad < _OPPOSED_RAD and measured.gap_m > TOUCHING_M
                    if near and contact not in assembly.operations[k].contacts:
                        yield _OpposedPair(k, contact, measured.gap_m, measured.share > _SHARED)


def _move_face(face: Face | RoundFace, name: str, size_m: float, rng: np.random.Generator) -> Face | RoundFace:
    """Move a flat face along its normal, or a round one across its axis in a random direction; rename it."""
    if isinstance(face, RoundFace):
        turn = rng.uniform(0.0, 2.0 * math.pi)
        across = math.cos(turn) * face.frame[:3, 0] + math.sin(turn) * face.frame[:3, 1]
        return replace(face, name=name, point=face.point + across * size_m)
    by = face.normal * size_m
    return Face(name, face.outline + by, tuple(hole + by for hole in face.holes), face.fit)


def _add_face(solid: Solid, face: Face | RoundFace) -> Solid:
    """The solid with one more face."""
    if isinstance(face, RoundFace):
        return replace(solid, rounds={**solid.rounds, face.name: face})
    return replace(solid, faces={**solid.faces, face.name: face})


def _replace_contacts_of_operation(assembly: Assembly, k: int, contacts: tuple[Contact, ...]) -> Assembly:
    """The assembly with these contacts for operation k."""
    operations = list(assembly.operations)
    operations[k] = replace(operations[k], contacts=contacts)
    return replace(assembly, operations=tuple(operations))
