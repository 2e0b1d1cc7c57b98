"""Read a file of triangles, STL, OBJ or 3MF, into meshes in mm, by the unit that is stated or fits."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import require
from apo_bench.importers.cad.meshes.obj import read_obj
from apo_bench.importers.cad.meshes.stl import read_stl
from apo_bench.importers.cad.meshes.three_mf import read_3mf
from apo_bench.importers.cad.solids import Mesh
from apo_bench.io import read_bytes

_SUFFIXES = (".stl", ".obj", ".3mf")
_UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
_LARGEST_BYTES = 60_000_000
MOST_CAD_TRIANGLES = 400_000
SMALLEST_PART_MM = 1.0
LARGEST_PART_MM = 2000.0
"""Limits of the longest side of a part."""
_OPEN_BELOW_MM = 10.0
"""Where a file states no unit, it is mm from this size on."""
_UNUSUAL_BELOW_MM = 30.0
"""Below this size mm are assumed with a warning."""


class CadFile(NamedTuple):
    """What is known of a file."""

    unit: str
    unit_from: str
    """How the unit is known."""
    left_out: tuple[str, ...] = ()
    """Why some of its solids are not read."""
    warnings: tuple[str, ...] = ()


def read_cad_bytes(path: Path, kind: str) -> bytes:
    """Read a CAD file.

    Raises:
        InputError: There is no such file, it is too large, or empty.
    """
    raw = read_bytes(path, f"{kind} file", _LARGEST_BYTES)
    require(raw, f"{path}: the file is empty; save the part again.")
    return raw


def read_meshes(path: Path, unit: str | None = None) -> tuple[CadFile, list[tuple[str, Mesh]]]:
    """Read a file of triangles: its objects by name, [mm].

    Args:
        unit: Of the numbers in it; None: the stated one, else mm if no other unit fits the size.

    Raises:
        InputError: No such file, another kind of file, no triangles, or a size that leaves the unit open.
    """
    suffix = path.suffix.lower()
    require(suffix in _SUFFIXES, f"{path}: a file that ends in {', '.join(_SUFFIXES)}, .step or .stp is needed.")
    require(unit is None or unit in _UNITS_MM, f"--unit {unit} was given; {', '.join(_UNITS_MM)} are allowed.")
    raw = read_cad_bytes(path, suffix[1:].upper())
    stated: str | None = None
    warnings: tuple[str, ...] = ()
    if suffix == ".3mf":
        stated, meshes, left_out = read_3mf(path, raw)
        if left_out:
            warnings = (f"{left_out} meshes of the build are supports or other objects that are no parts: left out",)
    else:
        meshes = [(path.stem, read_obj(path, raw) if suffix == ".obj" else read_stl(path, raw))]
    check_triangles(path, sum(len(mesh.triangles) for _, mesh in meshes))
    corners = np.concatenate([mesh.corners[mesh.triangles.ravel()] for _, mesh in meshes])
    require(np.isfinite(corners).all(), f"{path}: a corner is no finite number; save the part again.")
    file = _choose_unit(path, unit, stated, float(np.ptp(corners, axis=0).max()))
    scale = _UNITS_MM[file.unit]
    scaled = [(name, Mesh(mesh.corners * scale, mesh.triangles)) for name, mesh in meshes]
    return file._replace(warnings=(*warnings, *file.warnings)), scaled


def _choose_unit(path: Path, unit: str | None, stated: str | None, size: float) -> CadFile:
    """Return the unit of the numbers of a file, with a warning where mm are only one of several that fit."""
    used = unit or stated or "mm"
    source = "as asked" if unit else "stated in the file" if stated else "taken from the size; the file states none"
    longest = size * _UNITS_MM[used]
    warnings: tuple[str, ...] = ()
    if unit is None and stated is None:
        guesses = ", ".join(f"{name} ({size * _UNITS_MM[name]:.4g} mm)" for name in ("mm", "cm", "in", "m"))
        require(
            _OPEN_BELOW_MM <= longest <= LARGEST_PART_MM,
            f"{path}: the file states no unit, and {size:.4g} may be {guesses}; state it with --unit.",
        )
        if longest < _UNUSUAL_BELOW_MM:
            warnings = (
                f"WARNING: the longest side is {size:.4g} mm if --unit cm or --unit in is not given: {guesses}",
            )
    check_size(path, longest, f"unit {used}, {source}")
    return CadFile(used, source, warnings=warnings)


def check_triangles(path: Path, count: int) -> None:
    """Refuse a file without triangles, or with too many."""
    require(count, f"{path}: the file holds no triangles; save the part as a mesh.")
    most = f"{MOST_CAD_TRIANGLES:,} are the most"
    require(count <= MOST_CAD_TRIANGLES, f"{path}: the file has {count:,} triangles; {most}.")


def check_size(path: Path, longest_mm: float, unit: str) -> None:
    """Refuse a file whose longest side is not that of a part."""
    allowed = f"{SMALLEST_PART_MM:g} mm to {LARGEST_PART_MM / 1000:g} m"
    require(
        SMALLEST_PART_MM <= longest_mm <= LARGEST_PART_MM,
        f"{path}: its longest side is {longest_mm:.4g} mm ({unit}); parts of {allowed} are allowed.",
    )
