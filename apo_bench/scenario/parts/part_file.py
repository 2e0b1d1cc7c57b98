"""Read a part file (MJCF) and the TOML file next to it into convex pieces, marks and stated properties."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, Box, Cylinder, Piece, all_boxes, make_cylinder_hull
from apo_bench.scenario.parts.limits import (
    DENSITY,
    LARGEST_M,
    MOST_PIECES,
    THINNEST_M,
    WIDEST_M,
    is_name,
)
from apo_bench.scenario.parts.meshes import make_hull
from apo_bench.scenario.parts.stated_properties import StatedPart, read_stated_part

if TYPE_CHECKING:
    from apo_bench.mjcf.part_file import PartGeom, PartModel

_FIT_CLASS = "fit"
"""MJCF default class of sites that mark a face as fit."""
_SHORTEST_AXIS = 1e-3
"""Least length of a `zaxis` attribute."""
_AUTOMATIC = "auto_"
"""Prefix of automatic names of faces."""


@final
@dataclass(frozen=True, eq=False)
class NamedSite:
    """A site, which gives its name to the face on which it lies."""

    name: str
    point: Array
    """(3,), frame of the part, [m]."""
    fit: bool
    """The face recedes by the clearance."""


@final
@dataclass(frozen=True, eq=False)
class PartFile:
    """The content of a part file and of the TOML file next to it."""

    path: Path
    pieces: tuple[Piece, ...]
    """In the order and with the names of the geoms."""
    marks: tuple[NamedSite, ...]
    """Names of faces, for a part of boxes; else empty."""
    stated: StatedPart | None
    """Content of the TOML file; None for a part of boxes."""
    density: float
    """[kg/m^3]."""
    model: "PartModel"
    """Geoms, sites and picture, for a simulator."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The paths of the part file, of its picture if it has one, and of the TOML file if there is one."""
        pictures = () if self.model.picture is None else (self.model.picture.file,)
        return self.path, *pictures, *(() if self.stated is None else (self.path.with_suffix(".toml"),))


def read_part(path: Path) -> PartFile:
    """Read a part file; an unchanged file, with an unchanged TOML file, is read only once.

    Raises:
        InputError: The file cannot be read or is not one body of named pieces, or the TOML file is not valid.
    """
    return _read_cached(path, _get_file_stamp(path), _get_file_stamp(path.with_suffix(".toml")))


def _get_file_stamp(path: Path) -> tuple[int, int, int] | None:
    """Modification time, size and inode of a file; None if there is none."""
    try:
        stat = path.stat()
    except (OSError, ValueError):
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino


@lru_cache(maxsize=64)
def _read_cached(path: Path, *stamps: tuple[int, int, int] | None) -> PartFile:
    """Read a part file; `stamps` are only keys of the cache."""
    from apo_bench.mjcf.part_file import read_part_model

    model = read_part_model(path)
    require(0 < len(model.geoms) <= MOST_PIECES, f"{path}: a part has 1 to {MOST_PIECES} geoms, named pieces.")
    for name in (*(geom.name for geom in model.geoms), *(site.name for site in model.sites)):
        require(is_name(name), f"{path}: '{name[:64]}' is no name: a letter, then letters, digits and _.")
    pieces = tuple(_make_piece(path, geom) for geom in model.geoms)
    if all_boxes(pieces):
        return _read_boxes(path, model, pieces)
    require(not model.sites, f"{path}: sites name faces of boxes alone; state faces in {path.stem}.toml.")
    stated = read_stated_part(path.with_suffix(".toml"))
    geoms = []
    for geom in model.geoms:
        sliding, turning, rolling = (*stated.friction, *geom.friction[len(stated.friction) :])
        geoms.append(replace(geom, density=stated.density, friction=(sliding, turning, rolling)))
    return PartFile(path, pieces, (), stated, stated.density, replace(model, geoms=tuple(geoms)))


def _read_boxes(path: Path, model: "PartModel", pieces: Sequence[Piece]) -> PartFile:
    """The part file of a part that consists of boxes only."""
    densities = {geom.density for geom in model.geoms}
    require(
        len(densities) == 1 and DENSITY[0] <= min(densities) <= DENSITY[1],
        f"{path}: all geoms need one density from {DENSITY[0]:g} to {DENSITY[1]:g} kg/m^3.",
    )
    for site in model.sites:
        require(not site.name.startswith(_AUTOMATIC), f"{path}: site '{site.name}': {_AUTOMATIC} is kept for others.")
    marks = tuple(NamedSite(site.name, site.pos, site.default == _FIT_CLASS) for site in model.sites)
    return PartFile(path, tuple(pieces), marks, None, min(densities), model)


def _make_piece(path: Path, geom: "PartGeom") -> Piece:
    """The piece of a geom; an `InputError` if its size is not allowed."""
    place = f"{path}: geom '{geom.name}'"
    if geom.kind == "mesh":
        require(len(geom.corners) >= 4 and np.abs(geom.corners).max() <= LARGEST_M, f"{place} needs 4 corners or more.")
        return make_hull(path, geom.name, geom.corners)
    size = geom.size if geom.kind == "box" else geom.size[:2]
    thick = size.min() >= THINNEST_M and size.max() <= LARGEST_M
    require(
        thick and np.abs(geom.pos).max() <= LARGEST_M,
        f"{place} needs half sizes from {THINNEST_M:g} m, and none farther away than {LARGEST_M:g} m.",
    )
    if geom.kind == "box":
        return Box(geom.name, geom.pos, geom.size)
    require(size[0] <= WIDEST_M, f"{place} has a radius of {size[0]:g} m; {WIDEST_M:g} is the most allowed.")
    length = float(np.linalg.norm(geom.axis))
    require(length >= _SHORTEST_AXIS, f"{place} has a zaxis= of no length; give a direction.")
    return make_cylinder_hull(geom.name, Cylinder(geom.pos, geom.axis / length, float(size[0]), float(size[1])))
