"""Read a file of triangles, STL, OBJ or 3MF, as meshes in mm, in the unit that is stated or fits the size."""

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
_UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}  # unit -> mm
_LARGEST_BYTES = 60_000_000  # of a file
MOST_CAD_TRIANGLES = 400_000  # in a file
SMALLEST_PART_MM = 1.0  # shortest allowed longest side of a part
LARGEST_PART_MM = 2000.0  # longest allowed longest side of a part
_OPEN_BELOW_MM = 10.0
"""Without a stated unit, a longest side of at least this is taken to be in mm."""
_UNUSUAL_BELOW_MM = 30.0
"""Below this longest side the assumption of mm comes with a warning."""


class CadFile(NamedTuple):
    """The unit and the warnings of a CAD file that was read."""

    unit: str
    unit_from: str
    """How the unit is known, as a phrase."""
    left_out: tuple[str, ...] = ()
    """Why some of the solids of the file are not read, one sentence each."""
    warnings: tuple[str, ...] = ()


def read_cad_bytes(path: Path, kind: str) -> bytes:
    """Read the bytes of a CAD file.

    Raises:
        InputError: There is no such file, it is too large, or empty.
    """
    raw = read_bytes(path, f"{kind} file", _LARGEST_BYTES)
    require(raw, f"{path}: the file is empty; save the part again.")
    return raw


def read_meshes(path: Path, unit: str | None = None) -> tuple[CadFile, list[tuple[str, Mesh]]]:
    """Read a file of triangles.

    Args:
        unit: Unit of its numbers; None: the stated one, else mm if the size leaves no doubt.

    Returns:
        The unit with warnings, and the objects as pairs of name and mesh, [mm].

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
    """Choose the unit of a file; warn if mm is only one of several units that fit.

    Args:
        unit: The unit that the user gave.
        stated: The unit that the file states.
        size: Longest side in the numbers of the file.
    """
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
    """Raise InputError for a file without triangles, or with too many."""
    require(count, f"{path}: the file holds no triangles; save the part as a mesh.")
    most = f"{MOST_CAD_TRIANGLES:,} are the most"
    require(count <= MOST_CAD_TRIANGLES, f"{path}: the file has {count:,} triangles; {most}.")


def check_size(path: Path, longest_mm: float, unit: str) -> None:
    """Raise InputError if the longest side is not that of a part.

    Args:
        unit: The unit and its origin, for the message.
    """
    allowed = f"{SMALLEST_PART_MM:g} mm to {LARGEST_PART_MM / 1000:g} m"
    require(
        SMALLEST_PART_MM <= longest_mm <= LARGEST_PART_MM,
        f"{path}: its longest side is {longest_mm:.4g} mm ({unit}); parts of {allowed} are allowed.",
    )
