"""What a value in a scenario file may be: poses, axes, spans."""

from collections.abc import Iterable
from typing import NoReturn

import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array, pose
from apo_bench.io.documents import JsonNode

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
