"""Files of triangles become meshes: STL and OBJ by trimesh, 3MF by the objects that its build names."""

import logging
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

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
    stated, meshes = (
        read_3mf(path, raw, MOST_CAD_TRIANGLES)
        if suffix == ".3mf"
        else (None, [(path.stem, _by_trimesh(path, raw, suffix[1:]))])
    )
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
    file = _with_unit(path, unit, stated, float(size))
    scale = _UNITS_MM[file.unit]
    return file, [(name, Mesh(mesh.corners * scale, mesh.triangles)) for name, mesh in meshes]


def _with_unit(path: Path, unit: str | None, stated: str | None, size: float) -> CadFile:
    """Which unit the numbers of a file are in, and who says so."""
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
    return CadFile(used, unit_from)


def _by_trimesh(path: Path, raw: bytes, kind: str) -> Mesh:
    import trimesh

    log = logging.getLogger("trimesh")
    before = log.level
    log.setLevel(logging.CRITICAL)  # its modules print the tracebacks of errors that they then handle
    try:
        options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
        mesh: Any = trimesh.load(BytesIO(raw), file_type=kind, force="mesh", process=False, **options)
        return Mesh(
            np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3),
            np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3),
        )
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: this is no {kind.upper()} file that can be read; save the part again.") from error
    finally:
        log.setLevel(before)
