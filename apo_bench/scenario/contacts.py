"""The contacts of an operation in a scenario file: faces on faces, and how far apart they are asked to be.

A contact is a pair of faces, flat or round, `["bottom", "table.top"]`, or a table that says more:

    { faces = ["py", "castle1.spy"], kind = "clearance", gap_mm = [-0.2, 0.3] }

`kind` is `centred` (the default), `contact` or `clearance`, see `apo_bench.assembly.topology.Gap`; `gap_mm` goes
with the last, and stands for all the play of parts that fit if it is left out.

What a value in a scenario file may be: poses, axes, spans.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NoReturn, get_args

import numpy as np

from apo_bench.assembly import CONTACT_KINDS, Contact, Gap, GapKind, PartFace, contact_kind, geometric_play
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array, Face, RoundFace, Solid, pose
from apo_bench.io import JsonNode

LARGEST_LENGTH_MM = 2000.0
"""No length in a scenario is larger: the room of an arm on a table."""
_FARTHEST_MM = 1e5
_AXES = {f"{sign}{'xyz'[i]}": value for sign, value in (("", 1.0), ("+", 1.0), ("-", -1.0)) for i in range(3)}


def refuse(node: JsonNode, sentence: str) -> NoReturn:
    """Raise the error of a key."""
    raise InputError(f"{node.place}: {sentence}.")


def refuse_unless(holds: object, node: JsonNode, sentence: str) -> None:
    """Raise the error of a key unless something holds."""
    if not holds:
        refuse(node, sentence)


def refuse_name(node: JsonNode, kind: str, given: str, allowed: Iterable[str]) -> NoReturn:
    raise InputError(f"{node.file}, {node.key}: {unknown(kind, given, allowed)}")


def read_pose(node: JsonNode) -> Array:
    """`{ at_mm = [x, y, z], turn_deg = [rx, ry, rz] }` as (4, 4), [m]."""
    keys = node.fields(("at_mm",), ("turn_deg",))
    at = read_point(keys["at_mm"])
    turn = keys["turn_deg"].numbers(3) if "turn_deg" in keys else np.zeros(3)
    keys.get("turn_deg", node).require(np.abs(turn).max() <= 360, "three angles from -360 to 360 degrees are needed")
    return pose.at(at, turn)


def read_point(node: JsonNode) -> Array:
    """`[x, y, z]` in mm, (3,), [m]."""
    at_mm = node.numbers(3)
    node.require(
        np.abs(at_mm).max() <= LARGEST_LENGTH_MM,
        f"three lengths from -{LARGEST_LENGTH_MM:g} to {LARGEST_LENGTH_MM:g} mm are needed",
    )
    return 1e-3 * at_mm


def read_any_pose(node: JsonNode) -> Array:
    """`at_mm` with `turn_deg`, `quaternion_wxyz` or `quaternion_xyzw`, as (4, 4), [m]."""
    keys = node.fields(("at_mm",), ("turn_deg", "quaternion_wxyz", "quaternion_xyzw"))
    stated = [key for key in keys if key != "at_mm"]
    refuse_unless(len(stated) <= 1, node, f"{' and '.join(stated)} state the same; keep one")
    if stated in ([], ["turn_deg"]):
        return read_pose(node)
    at = keys["at_mm"].numbers(3)
    keys["at_mm"].require(np.abs(at).max() <= _FARTHEST_MM, f"lengths of at most {_FARTHEST_MM:g} mm are needed")
    q = keys[stated[0]].quaternion()
    return pose.unpack(np.concatenate([at * 1e-3, q if stated[0].endswith("wxyz") else np.roll(q, 1)]))


def read_unit_axis(node: JsonNode) -> Array:
    """`"x"`, `"+x"`, `"-x"` ... or three numbers, as a unit vector (3,)."""
    if isinstance(node.value, str):
        node.require(node.value in _AXES, "an axis is needed: x, y, z with or without a sign, or three numbers")
        return _AXES[node.value] * np.eye(3)["xyz".index(node.value[-1])]
    vector = node.numbers(3)
    length = float(np.linalg.norm(vector / max(1.0, np.abs(vector).max())))
    node.require(
        length >= 1e-9, "an axis is needed: x, y, z with or without a sign, or three numbers that are not all zero"
    )
    return vector / np.linalg.norm(vector)


def read_span(node: JsonNode, low: float, high: float) -> tuple[float, float]:
    """`[lowest, highest]` within bounds."""
    a, b = node.numbers(2)
    node.require(low <= a <= b <= high, f"a lowest and a highest number between {low:g} and {high:g} are needed")
    return float(a), float(b)


ContactGaps = Mapping[Contact, Gap]
"""What is asked of each contact, in the order of the file."""
_KINDS: tuple[GapKind, ...] = get_args(GapKind)
_EXAMPLE = '["bottom", "table.top"]'
_POSSIBLE = f"possible are {', '.join(CONTACT_KINDS[:-1])} and {CONTACT_KINDS[-1]}, of which cones have the same angle"
_TABLE = '{ faces = ["py", "castle1.spy"], kind = "clearance" }'


def read_contacts(
    nodes: tuple[JsonNode, ...], main: str, carries: tuple[str, ...], solids: Mapping[str, Solid], there: set[str]
) -> ContactGaps:
    """The contacts that one operation makes.

    Args:
        main: The part whose faces need no name before them.
        there: Parts that stand there before the operation.
    """
    contacts: dict[Contact, Gap] = {}
    for node in nodes:
        contact, gap = _contact(node, main, solids)
        _check(contact, node, (main, *carries), there)
        refuse_unless(contact not in contacts, node, f"'{contact}' stands here twice; keep one")
        contacts[contact] = gap
    return contacts


def check_kinds(node: JsonNode, gaps: Sequence[ContactGaps]) -> None:
    """A contact that the last of some operations makes again is asked for in the same way as before."""
    for contact, gap in gaps[-1].items():
        for k, earlier in enumerate(gaps[:-1], start=1):
            wanted = earlier.get(contact, gap)
            refuse_unless(
                wanted == gap,
                node,
                f"'{contact}' is asked to be {gap} here and {wanted} in operation {k}; ask for the same in both",
            )


def _contact(node: JsonNode, main: str, solids: Mapping[str, Solid]) -> tuple[Contact, Gap]:
    keys = node.fields(("faces",), ("kind", "gap_mm")) if isinstance(node.value, dict) else {"faces": node}
    pair = keys["faces"]
    pair.require(
        isinstance(pair.value, list) and len(pair.value) == 2,
        f"a pair is needed, such as {_EXAMPLE}, or a table, such as {_TABLE}",
    )
    above, below = (pair.child(value, name) for value, name in zip(pair.value, ("first", "second"), strict=True))
    contact = Contact(_face(above, main, solids), _face(below, None, solids))
    a, b = (solids[of.part].face(of.face) for of in contact)
    refuse_unless(
        contact_kind(a, b) is not None,
        node,
        f"'{contact}': {_described(a)} and {_described(b)} make no contact; {_POSSIBLE}",
    )
    return contact, _gap(keys, node, contact, a.fit or b.fit or geometric_play(a, b) > 0.0)


def _described(face: Face | RoundFace) -> str:
    """What kind of face it is, such as `a hole of 10 mm`."""
    if isinstance(face, Face):
        return "a flat face"
    if face.kind == "cylinder":
        return f"a {'hole' if face.hole else 'shaft'} of {2e3 * face.radius:g} mm"
    if face.kind == "rim":
        return f"the rim of a {'hole' if face.hole else 'shaft'} of {2e3 * face.radius:g} mm"
    angle = np.degrees(2.0 * np.arctan(abs(face.slope)))
    return f"a {'countersink' if face.hole else 'cone'} of {angle:.3g} degrees"


def _gap(keys: Mapping[str, JsonNode], node: JsonNode, contact: Contact, fits: bool) -> Gap:
    kind: GapKind = keys["kind"].value if "kind" in keys else Gap().kind
    keys.get("kind", node).require(kind in _KINDS, f"{', '.join(_KINDS[:-1])} or {_KINDS[-1]} is needed")
    if "gap_mm" not in keys:
        refuse_unless(
            kind != "clearance" or fits,
            node,
            f"'{contact}': faces without play have no clearance; say gap_mm = [lowest, highest]",
        )
        return Gap(kind)
    refuse_unless(
        kind == "clearance", keys["gap_mm"], f'"{kind}" has no interval; say kind = "clearance", or take gap_mm out'
    )
    low, high = read_span(keys["gap_mm"], -LARGEST_LENGTH_MM, LARGEST_LENGTH_MM)
    keys["gap_mm"].require(
        low <= 0.0 <= high and low < high,
        "a lowest number up to 0 and a higher one from 0 are needed",
        "the faces of the goals coincide",
    )
    return Gap(kind, 1e-3 * low, 1e-3 * high)


def _check(contact: Contact, node: JsonNode, moves: tuple[str, ...], there: set[str]) -> None:
    """The first face is of a part that moves, the second of one that rests where it was put."""
    above = node.child(None, "first")
    below = node.child(None, "second")
    a = contact.manipulated.part
    b = contact.environment.part
    refuse_unless(a in moves, above, f"'{a}' does not move here; name a face of '{moves[0]}' or a carried part")
    refuse_unless(b not in moves, below, f"'{b}' moves in this operation; name a face of a part that rests")
    refuse_unless(b in there, below, f"'{b}' is not there yet; name a fixed part or one that was moved before")


def _face(node: JsonNode, main: str | None, solids: Mapping[str, Solid]) -> PartFace:
    """`part.face`, or a face of the main part."""
    name, dot, face = node.text().rpartition(".")
    node.require(dot or main is not None, "a face as 'part.face' is needed")
    part = name if dot or main is None else main
    if part not in solids:
        refuse_name(node, "part", part, solids)
    faces = {**solids[part].faces, **solids[part].rounds}
    if face not in faces:
        refuse_name(node, f"face of part '{part}'", face, faces)
    return PartFace(part, face)
