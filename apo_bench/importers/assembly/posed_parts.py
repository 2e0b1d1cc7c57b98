"""Read parts at their final poses from a file with one `[[pose]]` table per copy of a part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, final

import msgspec
import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, Solid, measure_world_bounds, pose
from apo_bench.importers.cad.solids import find_free_name
from apo_bench.io import FileTable, read_typed
from apo_bench.scenario.parts import find_part_path, load_part
from apo_bench.scenario.parts.limits import FACE_OR_PART_NAME

TABLE = "table"  # name of the part that stands for the table
_TAKEN = (TABLE, "arm")
"""Names that no part of a scenario may have."""
_MOST = 49  # parts in a file
_Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]  # a color component
# Axis of the poses that is up -> index and sign.
UPS = {"x": (0, 1), "y": (1, 1), "z": (2, 1), "-x": (0, -1), "-y": (1, -1), "-z": (2, -1)}


@final
@dataclass(frozen=True, eq=False)
class PosedPart:
    """One copy of a part at its pose in the finished assembly."""

    name: str
    file: Path
    solid: Solid
    T: Array
    """(4, 4), pose in the frame of the assembly, [m]."""
    color: tuple[float, ...] | None = None
    fit: Mapping[str, float] = field(default_factory=dict)
    """Faces to mark as fit beyond those of the part file -> depth by which each recedes before the clearance, [mm]."""
    title: str = ""
    """The name in the CAD file, if a part cannot have that name in a scenario."""
    held: bool = False
    """Whether a fastener that is no part of the scenario holds it."""


class _Pose(FileTable, frozen=True):
    """One `[[pose]]` table of a file of poses; an empty name means the name of the part."""

    part: str
    at_mm: tuple[float, float, float]
    name: Annotated[str, msgspec.Meta(pattern=f"^({FACE_OR_PART_NAME.pattern})?$")] = ""
    title: str = ""
    quaternion_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    color: tuple[_Share, _Share, _Share] | None = None
    held: bool = False


class _PoseFile(FileTable, frozen=True):
    """A file of poses."""

    pose: list[_Pose]


def read_posed(poses: Path, files: Sequence[str] = (), checked: bool = True) -> tuple[PosedPart, ...]:
    """Read every copy of a part that a file of poses names, each with a unique name.

    Args:
        files: Part files, or names of packaged parts. Other parts are read from part files next to the file of poses.
        checked: As in `load_part`.

    Raises:
        InputError: A file cannot be read, a part is missing, or has no pose.
    """
    stated = read_typed(poses, _PoseFile, "file of poses").pose
    paths = {find_part_path(file).stem: find_part_path(file) for file in files}
    solids: dict[Path, Solid] = {}
    parts: list[PosedPart] = []
    used = {*_TAKEN}
    for each in stated:
        file = paths.get(each.part, poses.parent / f"{each.part}.xml")
        solids[file] = solids[file] if file in solids else load_part(file, checked)
        name = find_free_name(each.name or each.part, used)
        used.add(name)
        T = pose.unpack(np.array([*np.multiply(1e-3, each.at_mm), *each.quaternion_wxyz]))
        parts.append(PosedPart(name, file, solids[file], T, each.color, title=each.title, held=each.held))
    require(2 <= len(parts) <= _MOST, f"{poses}: {len(parts)} poses were given; 2 to {_MOST} parts make an assembly.")
    left = [name for name, file in paths.items() if file not in solids]
    require(not left, f"{poses}: {', '.join(left)} has no pose; add [[pose]] part = ..., or leave the part out.")
    return tuple(parts)


def place_on_table(parts: Sequence[PosedPart], up: str = "z") -> tuple[PosedPart, ...]:
    """Return the assembly turned upright, its lowest point on the table, the middle of its box over the origin.

    Args:
        up: The axis of the poses that points up, of `UPS`.
    """
    axis, sign = UPS[up]
    # The rotation, in degrees about x, y and z, that turns the axis up.
    turned = pose.at(np.zeros(3), ((0, -90 * sign, 0), (90 * sign, 0, 0), (0 if sign > 0 else 180, 0, 0))[axis])
    low, high = measure_world_bounds([(each.solid, turned @ each.T) for each in parts])
    shift = pose.at([-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
    return tuple(replace(each, T=shift @ turned @ each.T) for each in parts)
