"""Parts at their final poses: a file of poses is read, one table per copy of a part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.cad.solids.naming import free_name
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Solid, pose, world_bounds
from apo_bench.io import JsonNode, read_toml
from apo_bench.parts import load_part, part_path
from apo_bench.parts.allowed import FACE_OR_PART_NAME

TABLE = "table"
_TAKEN = (TABLE, "arm")
"""What a part of the scenario cannot be called: these are there already."""
_MOST = 49
UPS = {"x": (0, 1), "y": (1, 1), "z": (2, 1), "-x": (0, -1), "-y": (1, -1), "-z": (2, -1)}


@final
@dataclass(frozen=True, eq=False)
class PosedPart:
    """One copy of a part, where it is in the finished assembly."""

    name: str
    file: Path
    solid: Solid
    T: Array
    """(4, 4), in the frame of the assembly, [m]."""
    color: tuple[float, ...] | None = None
    fit: Mapping[str, float] = field(default_factory=dict)
    """Faces that recede although the file does not say so, and by how much before the clearance, [mm]."""
    title: str = ""
    """What the CAD file calls it, where that cannot be its name."""


def read_posed(poses: Path, files: Sequence[str] = ()) -> tuple[PosedPart, ...]:
    """Every copy of a part that a file of poses names.

    Args:
        files: Part files, or names of parts of the package. What is not among them is looked for beside the poses.

    Raises:
        InputError: A file cannot be read, a part is missing, or has no pose.
    """
    nodes = read_toml(poses, "file of poses").fields(("pose",))["pose"].items("pose")
    paths = {part_path(file).stem: part_path(file) for file in files}
    solids: dict[Path, Solid] = {}
    parts: list[PosedPart] = []
    for node in nodes:
        parts.append(_posed(node, paths, poses.parent, solids, {each.name for each in parts}))
    if not 2 <= len(parts) <= _MOST:
        raise InputError(f"{poses}: {len(parts)} poses were given; 2 to {_MOST} parts make an assembly.")
    left = [name for name, file in paths.items() if file not in solids]
    if left:
        raise InputError(f"{poses}: '{left[0]}' has no pose; add [[pose]] part = \"{left[0]}\", or leave the part out.")
    return tuple(parts)


def _posed(
    node: JsonNode, paths: dict[str, Path], folder: Path, solids: dict[Path, Solid], used: set[str]
) -> PosedPart:
    """One table of the file.

    Args:
        solids: Those that were read before; is added to.
        used: Names that other parts have.
    """
    keys = node.fields(("part", "at_mm"), ("name", "title", "quaternion_wxyz", "color"))
    part = keys["part"].text()
    file = paths.get(part, folder / f"{part}.xml")
    if file not in solids:
        solids[file] = load_part(file)
    own_name = keys.get("name", keys["part"])
    name = free_name(own_name.text(), {*used, *_TAKEN})
    if not FACE_OR_PART_NAME.fullmatch(name):
        own_name.fail("a letter, then letters, digits and underscores are needed")
    turn = keys["quaternion_wxyz"].quaternion() if "quaternion_wxyz" in keys else (1.0, 0.0, 0.0, 0.0)
    T = pose.unpack(np.concatenate([1e-3 * keys["at_mm"].numbers(3), turn]))
    color = tuple(np.clip(keys["color"].numbers(3), 0.0, 1.0).tolist()) if "color" in keys else None
    title = keys["title"].text() if "title" in keys else ""
    return PosedPart(name, file, solids[file], T, color, title=title)


def on_the_table(parts: Sequence[PosedPart], up: str = "z") -> tuple[PosedPart, ...]:
    """The same assembly, upright, its lowest point on the table, the middle of the box around it over the origin.

    Args:
        up: The axis of the poses that looks up, of `UPS`.
    """
    axis, sign = UPS[up]
    turned = pose.at(np.zeros(3), ((0, -90 * sign, 0), (90 * sign, 0, 0), (0 if sign > 0 else 180, 0, 0))[axis])
    low, high = world_bounds([(each.solid, turned @ each.T) for each in parts])
    shift = pose.at([-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
    return tuple(replace(each, T=shift @ turned @ each.T) for each in parts)
