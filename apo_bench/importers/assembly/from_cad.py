"""CAD files become parts at their final poses: one file of several solids, or several files and where each is."""

from collections.abc import Container, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.assembled import coming_near
from apo_bench.importers.cad.importing import import_part, raw_solids
from apo_bench.importers.cad.meshes.mesh_file import CadFile
from apo_bench.importers.cad.places import named_places, write_places
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.naming import clean_title, part_name
from apo_bench.importers.cad.solids.raw_solid import RawSolid, SolidPlace
from apo_bench.importers.cad.solids.region import Region

_UPRIGHT = 1.0 - 1e-9
_NEAR = 0.005
"""A part of the width of the box."""


class ImportedSolid(NamedTuple):
    """A part that was written."""

    name: str
    places: list[SolidPlace]
    """Of its frame, [mm]."""
    said: list[str]
    """What is to be known of it, one sentence each."""


def import_assembly(files: Sequence[Path], folder: Path, unit: str | None = None) -> tuple[Path, tuple[str, ...]]:
    """Write the parts of an assembly, each shape of a file once, and where every copy of them is.

    Args:
        files: One of several solids, or several that were drawn in one frame.

    Returns:
        The file of poses, and what was imported, one sentence each.

    Raises:
        InputError: A file cannot be read, a solid makes no part, or there is one alone.
    """
    found: list[tuple[str, RawSolid]] = []
    of_files: list[str] = []
    for file in files:
        source, solids = _solids_of(file, unit)
        of_files += (f"{file.name}: {each}" for each in source.warnings)
        found += [(file.name, raw) for raw in solids]
    if sum(len(raw.places) for _, raw in found) < 2:
        raise InputError(
            f"{files[0]}: the file holds one solid; an assembly of at least two is needed, in this file or in further "
            "ones."
        )
    parts: dict[str, ImportedSolid] = {}
    raws = [raw for _, raw in found]
    for (name, raw), others in zip(found, coming_near(raws), strict=True):
        part = import_solid(raw, others, folder, name, parts)
        parts[part.name] = part
    copies = named_places({name: part.places for name, part in parts.items()})
    sources = ", ".join(file.name for file in files)
    of_parts = [said for part in parts.values() for said in part.said]
    return write_places(copies, folder, sources), (*of_files, *of_parts)


def solids_at(file: Path, unit: str | None = None, places: Sequence[Array] = (np.eye(4),)) -> list[RawSolid]:
    """All solids of a file that is at some places of an assembly, (4, 4), [mm], each with all of its places there.

    Raises:
        InputError: The file cannot be read, or a solid of it makes no part.
    """
    return [
        replace(raw, places=tuple(place._replace(T=T @ place.T) for T in places for place in raw.places))
        for raw in _solids_of(file, unit)[1]
    ]


def _solids_of(file: Path, unit: str | None) -> tuple[CadFile, list[RawSolid]]:
    source, raws = raw_solids(file, unit)
    if source.left_out:
        raise InputError(f"{file}: {len(source.left_out)} of its solids can be no parts: {' '.join(source.left_out)}")
    return source, raws


def import_solid(raw: RawSolid, others: Array, folder: Path, source: str, used: Container[str]) -> ImportedSolid:
    """Write one solid of an assembly as a part.

    Its frame lies at the part, wherever the file has its origin: a pose that is seen turned a little turns a part about
    its own frame.

    Args:
        others: What comes near to it, as `coming_near` has it.
        used: Names that it cannot have.

    Raises:
        InputError: It makes no part.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = part_name(raw.name, used)
    foot = _foot(raw)
    called = clean_title(raw.name)
    part = import_part(_shifted(raw, -foot), name, folder, f"{source}, {called}", others=others - foot)
    title = f" ({called})" if raw.name != name else ""
    said = [f"{name}{title}: {len(part.solid.faces)} flat and {len(part.solid.rounds)} round faces"]
    said += [f"{name}.{face} can make no contact: {why}" for face, why in part.refused.items()]
    return ImportedSolid(name, [place._replace(T=place.T @ pose.at(foot)) for place in raw.places], said)


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
    return replace(raw, mesh=mesh, regions=tuple(_moved(region, by) for region in raw.regions))


def _moved(region: Region, by: Array) -> Region:
    """A plane is known by one of its points, an axis by the foot of the origin on it."""
    point = region.point + by
    along = float(point @ region.direction) if region.is_round else 0.0
    low, high = region.span
    return replace(region, point=point - along * region.direction, span=(low + along, high + along))
