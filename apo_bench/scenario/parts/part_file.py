"""Read a part file as convex pieces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, Box, Cylinder, Piece, all_boxes, make_cylinder_hull
from apo_bench.scenario.parts.allowed import (
    DENSITY,
    LARGEST_M,
    MOST_PIECES,
    THINNEST_M,
    WIDEST_M,
    is_name,
)
from apo_bench.scenario.parts.meshes import make_hull
from apo_bench.scenario.parts.stated import StatedPart, read_stated_part

if TYPE_CHECKING:
    from apo_bench.mjcf.part_file import PartGeom, PartModel

_FIT_CLASS = "fit"
_SHORTEST_AXIS = 1e-3
_AUTOMATIC = "auto_"
"""What names of faces without a name begin with."""


@final
@dataclass(frozen=True, eq=False)
class NamedSite:
    """A site: the face on which it lies gets its name."""

    name: str
    point: Array
    """(3,), frame of the part, [m]."""
    fit: bool


@final
@dataclass(frozen=True, eq=False)
class PartFile:
    """What a part file says, with the file next to it."""

    path: Path
    pieces: tuple[Piece, ...]
    """Named and ordered as the geoms."""
    marks: tuple[NamedSite, ...]
    """Of boxes alone."""
    stated: StatedPart | None
    """What stands next to it; None of boxes alone."""
    density: float
    """[kg/m^3]."""
    model: "PartModel"
    """Surfaces, sites and picture, for a simulator."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the part is made of: its part file, the picture that this names, and the file next to it."""
        pictures = () if self.model.picture is None else (self.model.picture.file,)
        return self.path, *pictures, *(() if self.stated is None else (self.path.with_suffix(".toml"),))


def read_part(path: Path) -> PartFile:
    """Read a part file; once, as long as it and the file next to it stay as they are.

    Raises:
        InputError: The file cannot be read, or is not one body of named pieces; or so the one next to it.
    """
    return _kept(path, _stamp(path), _stamp(path.with_suffix(".toml")))


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Time, size and number of a file; None if there is none."""
    try:
        stat = path.stat()
    except (OSError, ValueError):
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino


@lru_cache(maxsize=64)
def _kept(path: Path, *stamps: tuple[int, int, int] | None) -> PartFile:
    from apo_bench.mjcf.part_file import read_part_model

    model = read_part_model(path)
    require(0 < len(model.geoms) <= MOST_PIECES, f"{path}: a part has 1 to {MOST_PIECES} geoms, named pieces.")
    for name in (*(geom.name for geom in model.geoms), *(site.name for site in model.sites)):
        require(is_name(name), f"{path}: '{name[:64]}' is no name: a letter, then letters, digits and _.")
    pieces = tuple(_piece(path, geom) for geom in model.geoms)
    if all_boxes(pieces):
        return _of_boxes(path, model, pieces)
    require(not model.sites, f"{path}: sites name faces of boxes alone; state faces in {path.stem}.toml.")
    stated = read_stated_part(path.with_suffix(".toml"))
    geoms = []
    for geom in model.geoms:
        sliding, turning, rolling = (*stated.friction, *geom.friction[len(stated.friction) :])
        geoms.append(replace(geom, density=stated.density, friction=(sliding, turning, rolling)))
    return PartFile(path, pieces, (), stated, stated.density, replace(model, geoms=tuple(geoms)))


def _of_boxes(path: Path, model: "PartModel", pieces: Sequence[Piece]) -> PartFile:
    """A part of boxes alone."""
    densities = {geom.density for geom in model.geoms}
    require(
        len(densities) == 1 and DENSITY[0] <= min(densities) <= DENSITY[1],
        f"{path}: all geoms need one density from {DENSITY[0]:g} to {DENSITY[1]:g} kg/m^3.",
    )
    for site in model.sites:
        require(not site.name.startswith(_AUTOMATIC), f"{path}: site '{site.name}': {_AUTOMATIC} is kept for others.")
    marks = tuple(NamedSite(site.name, site.pos, site.default == _FIT_CLASS) for site in model.sites)
    return PartFile(path, tuple(pieces), marks, None, min(densities), model)


def _piece(path: Path, geom: "PartGeom") -> Piece:
    """The piece of a geom."""
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
