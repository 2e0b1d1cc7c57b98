"""A CAD file of several solids becomes part files and a file of poses beside them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from apo_bench.cad.importing import import_part, raw_solids
from apo_bench.cad.poses_file import named_places, write_places
from apo_bench.cad.solids.naming import free_name, part_name
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region, SolidPlace
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose

_UPRIGHT = 1.0 - 1e-9
_NEAR = 0.005
"""A part of the width of the box."""


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
    for raw in raws:
        name = free_name(part_name(raw.name), places)
        foot = _foot(raw)
        part = import_part(_shifted(raw, -foot), name, folder, f"{file.name}, {raw.name}")
        sentences.append(f"{name}: {len(part.solid.faces)} flat and {len(part.solid.rounds)} round faces")
        sentences += [f"{name}.{face} can make no contact: {why}" for face, why in part.refused.items()]
        places[name] = [place._replace(T=place.T @ pose.at(foot)) for place in raw.places]
    return write_places(named_places(places), folder, file.name), tuple(sentences)


def _foot(raw: RawSolid) -> Array:
    """The middle of the lower side of the box around a solid, (3,), to a micrometre, [mm].

    An upright axis that goes by near there takes its place: the box around facets is off by a part of their sagitta.
    """
    low = raw.mesh.corners.min(axis=0)
    high = raw.mesh.corners.max(axis=0)
    middle = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    for region in raw.regions:
        if region.is_round and abs(region.direction[2]) > _UPRIGHT:
            beside = region.point[:2] - middle[:2]
            if np.linalg.norm(beside) < _NEAR * np.ptp([low, high], axis=0)[:2].max():
                middle[:2] += beside
                break
    return np.round(middle, 3)


def _shifted(raw: RawSolid, by: Array) -> RawSolid:
    """The same solid elsewhere, [mm]."""
    mesh = Mesh(raw.mesh.corners + by, raw.mesh.triangles)
    moments = None if raw.moments is None else raw.moments.moved(np.eye(3), by)
    return replace(raw, mesh=mesh, regions=tuple(_moved(region, by) for region in raw.regions), moments=moments)


def _moved(region: Region, by: Array) -> Region:
    """A plane is known by one of its points, an axis by the foot of the origin on it."""
    point = region.point + by
    if not region.is_round:
        return replace(region, point=point)
    along = float(point @ region.direction)
    span = (region.span[0] + along, region.span[1] + along)
    return replace(region, point=point - along * region.direction, span=span)
