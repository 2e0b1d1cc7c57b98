"""Read a STEP file as raw solids, each shape once with the places of all copies."""

import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.importers.cad.faces.regions import find_regions
from apo_bench.importers.cad.meshes.mesh_file import CadFile, check_size, check_triangles, read_cad_bytes
from apo_bench.importers.cad.solids import RawSolid, make_hull_solid, merge_copies, name_regions
from apo_bench.importers.cad.step.from_brep import raw_of

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
    raws = list[RawSolid]()
    left_out = list[str]()
    for solid in solids:
        try:
            raws.append(raw_of(path, solid))
        except InputError as error:
            why = str(error).removeprefix(f"{path}: ")
            if lenient:
                corners = np.concatenate([face.corners for face in solid.faces])
                hull = make_hull_solid(solid.name, corners, solid.places, why)
                raws.append(replace(hull, regions=name_regions(hull.mesh, find_regions(hull.mesh))))
            elif len(solids) == 1:
                raise
            else:
                left_out.append(f"{solid.name}: {why}")
    return CadFile(own_unit, "stated in the file", tuple(left_out)), merge_copies(raws)


def _unit(raw: bytes) -> str:
    """Return the unit of lengths that the file states; mm if it states none."""
    text = raw.decode("latin-1")
    lengths = re.findall(r"=\s*\(([^;]*?LENGTH_UNIT[^;]*?)\)\s*;", text)
    named = re.findall(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'", ";".join(lengths))
    if named:
        return _UNIT_NAMES.get(named[0].strip().upper(), named[0].strip().lower())
    si = re.search(r"LENGTH_UNIT[^;]*?SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.", text)
    return _PREFIXES.get(si[1] or "", f"{si[1]}metre".lower()) if si else "mm"
