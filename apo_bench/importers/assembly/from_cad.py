"""Import the parts of an assembly from CAD files with one common frame, with the pose of every copy."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.near_points import find_near_points
from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from apo_bench.importers.cad.pose_file import name_places, write_places
from apo_bench.importers.cad.solids import Mesh, RawSolid, Region, SolidPlace, clean_title, make_part_name

_UPRIGHT = 1.0 - 1e-9  # cosine between axis and z of an upright round face
_NEAR = 0.005
"""An axis this near to the middle of the box counts as the middle; a share of the box's larger horizontal side."""


@contextmanager
def remove_on_failure(folder: Path) -> Iterator[Path]:
    """Yield the folder for the parts; if the import fails, remove the folder unless it existed before."""
    existed = folder.exists()
    try:
        yield folder
    except BaseException:
        if not existed:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def import_parts(files: Sequence[Path], folder: Path, unit: str | None = None) -> tuple[Path, tuple[str, ...]]:
    """Write the parts of an assembly, each shape of a file once, and the place of every copy.

    The frame of a part is at its foot, wherever the file has its origin: a small error of an observed rotation then
    turns the part about its own frame.

    Args:
        files: One file of several solids, or several files with one common frame.
        unit: Unit of the files; None: as they state.

    Returns:
        The file of poses, and a sentence for each part, warning, and face that can make no contact.

    Raises:
        InputError: A file cannot be read, a solid makes no part, or there is one alone.
    """
    lines: list[str] = []
    found: list[tuple[str, RawSolid]] = []
    for file in files:
        source, solids = read_raw_solids(file, unit)
        left_out = source.left_out
        require(not left_out, f"{file}: {len(left_out)} of its solids can be no parts: {' '.join(left_out)}")
        lines += (f"{file.name}: {warning}" for warning in source.warnings)
        found += [(file.name, raw) for raw in solids]
    require(
        sum(len(raw.places) for _, raw in found) > 1,
        f"{files[0]}: the file holds one solid; give a file of at least two, or further files.",
    )
    folder.mkdir(parents=True, exist_ok=True)
    places: dict[str, list[SolidPlace]] = {}
    for (file_name, raw), others in zip(found, find_near_points([raw for _, raw in found]), strict=True):
        name = make_part_name(raw.name, places)
        foot = _find_foot(raw)
        title = clean_title(raw.name)
        part = import_solid(_shift_solid(raw, -foot), name, folder, f"{file_name}, {title}", others=others - foot)
        places[name] = [place._replace(T=place.T @ pose.at(foot)) for place in raw.places]
        called = f" ({title})" if raw.name != name else ""
        lines.append(f"{name}{called}: {len(part.solid.faces)} flat and {len(part.solid.rounds)} round faces")
        lines += (f"{name}.{face} can make no contact: {why}" for face, why in part.refused.items())
    return write_places(name_places(places), folder, ", ".join(file.name for file in files)), tuple(lines)


def _find_foot(raw: RawSolid) -> Array:
    """Return the middle of the lower side of the solid's bounding box, (3,), rounded to a micrometre, [mm].

    If the axis of an upright round face passes near this middle, the axis is used: a coarse mesh of a round face has an
    asymmetric box.
    """
    low = raw.mesh.corners.min(axis=0)
    high = raw.mesh.corners.max(axis=0)
    middle = (low + high)[:2] / 2
    near = _NEAR * (high - low)[:2].max()
    upright = [r.point[:2] for r in raw.regions if r.is_round and abs(r.direction[2]) > _UPRIGHT]
    middle = next((at for at in upright if np.linalg.norm(at - middle) < near), middle)
    return np.round([*middle, low[2]], 3)


def _shift_solid(raw: RawSolid, by: Array) -> RawSolid:
    """Move a solid by a vector, (3,), [mm]."""
    mesh = Mesh(raw.mesh.corners + by, raw.mesh.triangles)
    return replace(raw, mesh=mesh, regions=tuple(_shift_region(region, by) for region in raw.regions))


def _shift_region(region: Region, by: Array) -> Region:
    """Move a region by a vector, (3,), [mm].

    The point of an axis stays the foot of the origin on the axis, so the span along the axis shifts instead.
    """
    point = region.point + by
    along = float(point @ region.direction) if region.is_round else 0.0
    low, high = region.span
    return replace(region, point=point - along * region.direction, span=(low + along, high + along))
