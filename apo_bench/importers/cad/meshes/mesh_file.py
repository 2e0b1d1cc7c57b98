"""Files of triangles become meshes in mm: STL, OBJ and 3MF, with the unit that is stated or taken."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import require
from apo_bench.importers.cad.meshes.obj import read_obj
from apo_bench.importers.cad.meshes.stl import read_stl
from apo_bench.importers.cad.meshes.three_mf import read_3mf
from apo_bench.importers.cad.solids.raw_solid import Mesh
from apo_bench.io import read_bytes

_SUFFIXES = (".stl", ".obj", ".3mf")
_UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
_LARGEST_BYTES = 60_000_000
MOST_CAD_TRIANGLES = 400_000
SMALLEST_PART_MM = 1.0
LARGEST_PART_MM = 2000.0
"""Of the longest side of what a file holds: smaller and larger ones are no parts."""
_OPEN_BELOW_MM = 10.0
"""Where a file states no unit, mm is taken from this size on."""
_UNUSUAL_BELOW_MM = 30.0
"""Below this size mm are taken with a warning."""


class CadFile(NamedTuple):
    """What is known of a file."""

    unit: str
    unit_from: str
    """Who says so."""
    left_out: tuple[str, ...] = ()
    """Why some of its solids are not read."""
    said: tuple[str, ...] = ()
    """What a user must know of how it was read, one sentence each."""


def read_cad_bytes(path: Path, kind: str) -> bytes:
    """What stands in a CAD file.

    Raises:
        InputError: There is no such file, it is too large, or empty.
    """
    raw = read_bytes(path, f"{kind} file", _LARGEST_BYTES)
    require(raw, f"{path}: the file is empty; save the part again.")
    return raw


def read_meshes(path: Path, unit: str | None = None) -> tuple[CadFile, list[tuple[str, Mesh]]]:
    """Read a file of triangles: its objects by name, [mm].

    Args:
        unit: Of the numbers in it; None: what it states, else mm where its size leaves that open to nothing else.

    Raises:
        InputError: No such file, another kind of file, no triangles, or a size that leaves the unit open.
    """
    suffix = path.suffix.lower()
    require(suffix in _SUFFIXES, f"{path}: a file that ends in {', '.join(_SUFFIXES)}, .step or .stp is needed.")
    require(unit is None or unit in _UNITS_MM, f"--unit {unit} was given; {', '.join(_UNITS_MM)} are allowed.")
    stated, meshes, said = _read(path, read_cad_bytes(path, suffix[1:].upper()), suffix)
    count = sum(len(mesh.triangles) for _, mesh in meshes)
    require(count, f"{path}: the file holds no triangles; save the part as a mesh.")
    require(
        count <= MOST_CAD_TRIANGLES, f"{path}: the file has {count:,} triangles; {MOST_CAD_TRIANGLES:,} are the most."
    )
    corners = np.concatenate([mesh.corners[mesh.triangles.ravel()] for _, mesh in meshes])
    require(np.isfinite(corners).all(), f"{path}: a corner is no finite number; save the part again.")
    file = _with_unit(path, unit, stated, float(np.ptp(corners, axis=0).max()), said)
    scale = _UNITS_MM[file.unit]
    return file, [(name, Mesh(mesh.corners * scale, mesh.triangles)) for name, mesh in meshes]


def _read(path: Path, raw: bytes, suffix: str) -> tuple[str | None, list[tuple[str, Mesh]], tuple[str, ...]]:
    """The unit that a file states, its objects by name, and what a user must know of how they were read."""
    if suffix == ".3mf":
        package = read_3mf(path, raw)
        other = f"{package.left_out} meshes of the build are supports or other objects that are no parts: left out"
        return package.unit, package.meshes, (other,) * (package.left_out > 0)
    if suffix == ".obj":
        return None, [(path.stem, read_obj(path, raw))], ()
    mesh, said = read_stl(path, raw)
    return None, [(path.stem, mesh)], said


def _with_unit(path: Path, unit: str | None, stated: str | None, size: float, said: tuple[str, ...]) -> CadFile:
    """Which unit the numbers of a file are in, who says so, and a warning where mm are only one of several guesses."""
    used = unit or stated or "mm"
    unit_from = "as asked" if unit else "stated in the file" if stated else "taken from the size; the file states none"
    longest = size * _UNITS_MM[used]
    guesses = ", ".join(f"{name} ({size * _UNITS_MM[name]:.4g} mm)" for name in ("mm", "cm", "in", "m"))
    if unit is None and stated is None:
        require(
            _OPEN_BELOW_MM <= longest <= LARGEST_PART_MM,
            f"{path}: the file states no unit, and {size:.4g} may be {guesses}; say which with --unit.",
        )
        warning = f"WARNING: the longest side is {size:.4g} mm if the numbers are mm; else give --unit cm or --unit in"
        said = (*said, f"{warning}: it may be {guesses}") if longest < _UNUSUAL_BELOW_MM else said
    check_size(path, longest, f"unit {used}, {unit_from}")
    return CadFile(used, unit_from, said=said)


def check_size(path: Path, longest_mm: float, unit: str) -> None:
    """Raise an `InputError` unless the longest side of a file is that of a part."""
    allowed = f"{SMALLEST_PART_MM:g} mm to {LARGEST_PART_MM / 1000:g} m"
    require(
        SMALLEST_PART_MM <= longest_mm <= LARGEST_PART_MM,
        f"{path}: its longest side is {longest_mm:.4g} mm ({unit}); parts of {allowed} are allowed.",
    )
