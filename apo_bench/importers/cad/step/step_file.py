"""Read a STEP file as raw solids, each shape once with the places of all copies."""

import re
from dataclasses import replace
from importlib.util import find_spec
from itertools import chain
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.importers.cad.faces.regions import find_regions
from apo_bench.importers.cad.joined_solids import join_near_solids, number_solids
from apo_bench.importers.cad.meshes.mesh_file import CadFile, check_size, check_triangles, read_cad_bytes
from apo_bench.importers.cad.solids import RawSolid, make_hull_solid, merge_copies, name_regions
from apo_bench.importers.cad.step.from_brep import raw_of
from apo_bench.importers.cad.step.surfaces import BrepSolid

STEP_SUFFIXES = (".step", ".stp")
_MOST_SOLIDS = 200  # in one file
_PREFIXES = {"": "m", "MILLI": "mm", "CENTI": "cm", "MICRO": "um"}  # SI prefix of a metre -> unit
# Name of another unit -> unit.
_UNIT_NAMES = {
    "INCH": "in",
    "FOOT": "ft",
    "FEET": "ft",
    "METRE": "m",
    "CENTIMETRE": "cm",
    "MILLIMETRE": "mm",
}


def read_step(path: Path, unit: str | None, lenient: bool = False) -> tuple[CadFile, list[RawSolid]]:
    """Read the solids of a STEP file, each shape once with the places of all copies.

    Args:
        lenient: Whether the convex hull stands for a solid whose faces do not close.

    Raises:
        InputError: The extra is missing, the file cannot be read, or it holds no closed solid of a size for a part.
    """
    require(unit is None, f"--unit {unit} was given, and a STEP file states its own; leave --unit out.")
    raw = read_cad_bytes(path, "STEP")
    require(b"ISO-10303-21" in raw[:2000], f"{path}: this is no STEP file; save the part again.")
    require(find_spec("OCP"), f"{path}: reading STEP needs the extra cad; run: pip install 'apo_bench[cad]'")
    from apo_bench.importers.cad.step.brep import read_solids

    own_unit = _unit(raw)
    try:
        solids = read_solids(path)
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"{path}: the file cannot be read as STEP; save the part again.") from error
    require(solids, f"{path}: the file holds no solid; save the part as a solid, not as curves or a drawing.")
    count = sum(len(face.triangles) for solid in solids for face in solid.faces)
    require(len(solids) <= _MOST_SOLIDS, f"{path}: the file has {len(solids)} solids; {_MOST_SOLIDS} are the most.")
    check_triangles(path, count)
    for solid in solids:
        size = float(np.ptp(np.concatenate([face.corners for face in solid.faces]), axis=0).max())
        check_size(path, size, f"of a solid in it; unit {own_unit}, stated in the file")
    components: dict[int, list[RawSolid]] = {}
    left_out = list[str]()
    for solid in solids:
        try:
            raw_solid = _read_solid(path, solid, lenient)
        except InputError as error:
            if lenient or len(solids) == 1:
                raise
            left_out.append(f"{solid.name}: {str(error).removeprefix(f'{path}: ')}")
            continue
        components.setdefault(solid.component, []).append(raw_solid)
    several = solids[0].component != solids[-1].component
    joined = (join_near_solids(raws) if several else number_solids(raws) for raws in components.values())
    raws = merge_copies(map(_find_faces, chain.from_iterable(joined)))
    return CadFile(own_unit, "stated in the file", tuple(left_out)), raws


def _read_solid(path: Path, solid: BrepSolid, lenient: bool) -> RawSolid:
    """Return a solid with its faces, or if allowed its convex hull where its faces do not close."""
    try:
        return raw_of(path, solid)
    except InputError as error:
        if not lenient:
            raise
        corners = np.concatenate([face.corners for face in solid.faces])
        return make_hull_solid(solid.name, corners, solid.places, str(error).removeprefix(f"{path}: "))


def _find_faces(raw: RawSolid) -> RawSolid:
    """Return a solid with its faces: those of the file, else fitted to its triangles."""
    return raw if raw.regions else replace(raw, regions=name_regions(raw.mesh, find_regions(raw.mesh)))


def _unit(raw: bytes) -> str:
    """Return the unit of lengths that the file states; mm if it states none."""
    text = raw.decode("latin-1")
    lengths = re.findall(r"=\s*\(([^;]*?LENGTH_UNIT[^;]*?)\)\s*;", text)
    named = re.findall(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'", ";".join(lengths))
    if named:
        return _UNIT_NAMES.get(named[0].strip().upper(), named[0].strip().lower())
    si = re.search(r"LENGTH_UNIT[^;]*?SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.", text)
    return _PREFIXES.get(si[1] or "", f"{si[1]}metre".lower()) if si else "mm"
