"""Files of triangles become meshes in mm: STL, OBJ and 3MF, with the unit that is stated or taken."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.cad.meshes.obj import read_obj
from apo_bench.cad.meshes.stl import read_stl
from apo_bench.cad.meshes.three_mf import read_3mf
from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.errors import InputError
from apo_bench.io import read_bytes

_SUFFIXES = (".stl", ".obj", ".3mf")
_UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
_LARGEST_BYTES = 60_000_000
MOST_CAD_TRIANGLES = 400_000
SMALLEST_PART_MM = 1.0
_OPEN_BELOW_MM = 10.0
_UNUSUAL_BELOW_MM = 30.0
"""Of the longest side of all parts of a file: below this mm are taken with a warning."""
LARGEST_PART_MM = 2000.0
"""Of the longest side of what a file holds: smaller and larger ones are no parts; where a file states no unit, mm is
taken between the last two."""


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
    if not raw:
        raise InputError(f"{path}: the file is empty; save the part again.")
    return raw


def read_meshes(path: Path, unit: str | None = None) -> tuple[CadFile, list[tuple[str, Mesh]]]:
    """Read a file of triangles: its objects by name, [mm].

    Args:
        unit: Of the numbers in it; None: what it states, else mm where its size leaves that open to nothing else.

    Raises:
        InputError: No such file, another kind of file, no triangles, or a size that leaves the unit open.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise InputError(
            f"{path}: a file that ends in {', '.join(_SUFFIXES)}, .step or .stp is needed; save the part as one of "
            "them."
        )
    if unit is not None and unit not in _UNITS_MM:
        raise InputError(f"--unit {unit} was given; {', '.join(_UNITS_MM)} are allowed.")
    raw = read_cad_bytes(path, suffix[1:].upper())
    stated, meshes, said = _read(path, raw, suffix)
    count = sum(len(mesh.triangles) for _, mesh in meshes)
    is_finite = all(np.isfinite(mesh.corners).all() for _, mesh in meshes)
    most = f"{MOST_CAD_TRIANGLES:,} are the most, so save it with a coarser one"
    for is_wrong, sentence in (
        (count == 0, "the file holds no triangles; save the part as a mesh"),
        (count > MOST_CAD_TRIANGLES, f"the file has {count:,} triangles; {most}"),
        (not is_finite, "a corner is no finite number; save the part again"),
    ):
        if is_wrong:
            raise InputError(f"{path}: {sentence}.")
    size = np.ptp(np.concatenate([mesh.corners[mesh.triangles.ravel()] for _, mesh in meshes]), axis=0).max()
    file = _with_unit(path, unit, stated, float(size), said)
    scale = _UNITS_MM[file.unit]
    return file, [(name, Mesh(mesh.corners * scale, mesh.triangles)) for name, mesh in meshes]


def _read(path: Path, raw: bytes, suffix: str) -> tuple[str | None, list[tuple[str, Mesh]], tuple[str, ...]]:
    """The unit that a file states, its objects by name, and what a user must know of how they were read."""
    if suffix == ".3mf":
        package = read_3mf(path, raw, MOST_CAD_TRIANGLES)
        other = f"{package.left_out} meshes of the build are supports or other objects that are no parts: left out"
        return package.unit, package.meshes, (other,) * (package.left_out > 0)
    if suffix == ".obj":
        return None, [(path.stem, read_obj(path, raw, MOST_CAD_TRIANGLES))], ()
    mesh, said = read_stl(path, raw)
    return None, [(path.stem, mesh)], said


def _with_unit(path: Path, unit: str | None, stated: str | None, size: float, said: tuple[str, ...]) -> CadFile:
    """Which unit the numbers of a file are in, who says so, and a warning where mm are only one of several guesses."""
    used = unit or stated or "mm"
    unit_from = "as asked" if unit else "stated in the file" if stated else "taken from the size; the file states none"
    longest = size * _UNITS_MM[used]
    if not longest:
        raise InputError(f"{path}: all corners are in one place; save the part again.")
    if unit is None and stated is None and not _OPEN_BELOW_MM <= longest <= LARGEST_PART_MM:
        raise InputError(
            f"{path}: the file states no unit, and {size:.4g} may be {size:.4g} mm, {size * 25.4:.4g} mm (inch) or "
            f"{size * 1000.0:.4g} mm (metre); say which with --unit mm, in, m, cm, ft or um."
        )
    if not SMALLEST_PART_MM <= longest <= LARGEST_PART_MM:
        raise InputError(
            f"{path}: its longest side is {longest:.4g} mm (unit {used}, {unit_from}); parts of "
            f"{SMALLEST_PART_MM:g} mm to {LARGEST_PART_MM / 1000:g} m are allowed, so give another --unit, or scale "
            "the part."
        )
    if unit is None and stated is None and longest < _UNUSUAL_BELOW_MM:
        said = (*said, _doubt(size))
    return CadFile(used, unit_from, said=said)


def _doubt(size: float) -> str:
    """Which units the numbers of a file may be in that states none."""
    options = [f"{name} ({size * _UNITS_MM[name]:.4g} mm)" for name in ("cm", "in")]
    return (
        f"WARNING: the longest side is {size:.4g} mm if the numbers are mm, which is small for a part that a robot "
        f"grasps; if they are {' or '.join(options)}, import again with --unit cm or --unit in"
    )
