"""Parts at their final poses: a file of poses is read, one table per copy of a part, or made from a CAD file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.cad.assembled import coming_near, in_common
from apo_bench.cad.import_report import named_places, write_places
from apo_bench.cad.importing import import_part, raw_solids
from apo_bench.cad.solids.naming import free_name, part_name
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region, SolidPlace
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Solid, pose, world_bounds
from apo_bench.io.documents import JsonNode, read_toml
from apo_bench.parts import load_part, part_path
from apo_bench.parts.allowed import FACE_OR_PART_NAME

TABLE = "table"
_TAKEN = (TABLE, "arm")
"""What a part of the scenario cannot be called: these are there already."""
_MOST = 49
_UPRIGHT = 1.0 - 1e-9
_NEAR = 0.005
"""A part of the width of the box."""
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


def read_posed(poses: Path, files: Sequence[str] = (), fewest: int = 2) -> tuple[PosedPart, ...]:
    """Every copy of a part that a file of poses names.

    Args:
        files: Part files, or names of parts of the package. What is not among them is looked for beside the poses.
        fewest: Poses that are needed.

    Raises:
        InputError: A file cannot be read, a part is missing, or has no pose.
    """
    nodes = read_toml(poses, "file of poses").fields(("pose",))["pose"].items("pose")
    paths = {part_path(file).stem: part_path(file) for file in files}
    solids: dict[Path, Solid] = {}
    parts: list[PosedPart] = []
    for node in nodes:
        parts.append(_posed(node, paths, poses.parent, solids, {each.name for each in parts}))
    if not fewest <= len(parts) <= _MOST:
        raise InputError(f"{poses}: {len(parts)} poses were given; {fewest} to {_MOST} parts make an assembly.")
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
    keys = node.fields(("part", "at_mm"), ("name", "quaternion_wxyz", "color"))
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
    return PosedPart(name, file, solids[file], T, color)


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


def import_assembly(file: Path, folder: Path, unit: str | None = None, fewest: int = 2) -> tuple[Path, tuple[str, ...]]:
    """Write the parts of an assembly, each shape once, and where every copy of them is.

    Frames of parts lie at the parts, wherever the file has its origin: a pose that is seen turned a little turns a part
    about its own frame.

    Args:
        fewest: Solids that the file must hold.

    Returns:
        The file of poses, and what was imported, one sentence each.

    Raises:
        InputError: The file cannot be read, a solid makes no part, or there are too few.
    """
    source, raws = raw_solids(file, unit)
    if source.left_out:
        raise InputError(f"{file}: {len(source.left_out)} of its solids can be no parts: {' '.join(source.left_out)}")
    if sum(len(raw.places) for raw in raws) < fewest:
        raise InputError(f"{file}: the file holds one solid; an assembly of at least two is needed.")
    folder.mkdir(parents=True, exist_ok=True)
    places = dict[str, list[SolidPlace]]()
    sentences = list[str]()
    for raw, others in zip(raws, coming_near(raws), strict=True):
        name = free_name(part_name(raw.name), places)
        foot = _foot(raw)
        part = import_part(_shifted(raw, -foot), name, folder, f"{file.name}, {raw.name}", others=others - foot)
        sentences.append(f"{name}: {len(part.solid.faces)} flat and {len(part.solid.rounds)} round faces")
        sentences += [f"{name}.{face} can make no contact: {why}" for face, why in part.refused.items()]
        places[name] = [place._replace(T=place.T @ pose.at(foot)) for place in raw.places]
    copies = named_places(places)
    drawn = [(raw, place) for raw in raws for place in raw.places]
    sentences += [
        f"{copies[i][1]} and {copies[k][1]} have {size:.3g} mm^3 in common as they are drawn"
        for i, k, size in in_common(*zip(*drawn, strict=True))
    ]
    return write_places(copies, folder, file.name), tuple(sentences)


def _foot(raw: RawSolid) -> Array:
    """The middle of the lower side of the box around a solid, (3,), to a micrometre, [mm].

    An upright axis that goes by near there takes its place: the box around facets is off by a part of their sagitta.
    """
    low = raw.mesh.corners.min(axis=0)
    high = raw.mesh.corners.max(axis=0)
    middle = (low + high)[:2] / 2
    near = _NEAR * (high - low)[:2].max()
    upright = [r.point[:2] for r in raw.regions if r.is_round and abs(r.direction[2]) > _UPRIGHT]
    middle = next((at for at in upright if np.linalg.norm(at - middle) < near), middle)
    return np.round([*middle, low[2]], 3)


def _shifted(raw: RawSolid, by: Array) -> RawSolid:
    """The same solid elsewhere, [mm]."""
    mesh = Mesh(raw.mesh.corners + by, raw.mesh.triangles)
    moments = None if raw.moments is None else raw.moments.moved(np.eye(3), by)
    return replace(raw, mesh=mesh, regions=tuple(_moved(region, by) for region in raw.regions), moments=moments)


def _moved(region: Region, by: Array) -> Region:
    """A plane is known by one of its points, an axis by the foot of the origin on it."""
    point = region.point + by
    along = float(point @ region.direction) if region.is_round else 0.0
    low, high = region.span
    return replace(region, point=point - along * region.direction, span=(low + along, high + along))
