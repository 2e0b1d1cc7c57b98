"""Files of triangles become meshes: STL and OBJ by trimesh, 3MF by the objects that its build names."""

import logging
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.raw import Mesh
from apo_bench.cad.three_mf import read_3mf
from apo_bench.errors import InputError
from apo_bench.io.reading import read_bytes

KINDS = (".stl", ".obj", ".3mf")
UNITS_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
LARGEST_BYTES = 60_000_000
MOST_TRIANGLES = 400_000
SMALLEST_MM = 1.0
OPEN_BELOW_MM = 10.0
LARGEST_MM = 2000.0
"""Of the longest side of what a file holds: smaller and larger ones are no parts; where a file states no unit, mm is
taken between the last two."""


class Shape(NamedTuple):
    """What a file holds as one object, and where."""

    name: str
    mesh: Mesh
    """[mm]."""


class CadFile(NamedTuple):
    """What a file holds."""

    shapes: tuple[Shape, ...]
    unit: str
    said: str
    """Where the unit is from."""
    left_out: tuple[str, ...] = ()
    """Why some of its solids are not read."""


def read_meshes(path: Path, unit: str | None = None) -> CadFile:
    """Read a file of triangles.

    Args:
        unit: Of the numbers in it; None: what it states, else mm where its size leaves that open to nothing else.

    Raises:
        InputError: No such file, another kind of file, no triangles, or a size that leaves the unit open.
    """
    ending = path.suffix.lower()
    if ending not in KINDS:
        raise InputError(
            f"{path}: a file that ends in {', '.join(KINDS)}, .step or .stp is needed; save the part as one of them."
        )
    if unit is not None and unit not in UNITS_MM:
        raise InputError(f"--unit {unit} was given; {', '.join(UNITS_MM)} are allowed.")
    raw = read_bytes(path, f"{ending[1:].upper()} file", LARGEST_BYTES)
    if not raw:
        raise InputError(f"{path}: the file is empty; save the part again.")
    if ending == ".3mf":
        stated, found = read_3mf(path, raw, MOST_TRIANGLES)
    else:
        stated = None
        found = [(path.stem, _by_trimesh(path, raw, ending[1:]))]
    count = sum(len(mesh.triangles) for _, mesh in found)
    if not count:
        raise InputError(f"{path}: the file holds no triangles; save the part as a mesh.")
    if count > MOST_TRIANGLES:
        raise InputError(
            f"{path}: the file has {count:,} triangles; {MOST_TRIANGLES:,} are the most, so save it with a coarser one."
        )
    if not all(np.isfinite(mesh.corners).all() for _, mesh in found):
        raise InputError(f"{path}: a corner is no finite number; save the part again.")
    given = np.ptp(np.concatenate([mesh.corners[mesh.triangles.ravel()] for _, mesh in found]), axis=0).max()
    used, said = _unit(path, unit, stated, float(given))
    return CadFile(tuple(Shape(n, Mesh(m.corners * UNITS_MM[used], m.triangles)) for n, m in found), used, said)


def _unit(path: Path, asked: str | None, stated: str | None, size: float) -> tuple[str, str]:
    """Which unit the numbers of a file are in, and who says so."""
    used = asked or stated or "mm"
    said = "as asked" if asked else "stated in the file" if stated else "taken from the size; the file states none"
    long = size * UNITS_MM[used]
    if not long:
        raise InputError(f"{path}: all corners are in one place; save the part again.")
    if asked is None and stated is None and not OPEN_BELOW_MM <= long <= LARGEST_MM:
        raise InputError(
            f"{path}: the file states no unit, and {size:.4g} may be {size:.4g} mm, {size * 25.4:.4g} mm (inch) or "
            f"{size * 1000.0:.4g} mm (metre); say which with --unit mm, in, m, cm, ft or um."
        )
    if not SMALLEST_MM <= long <= LARGEST_MM:
        raise InputError(
            f"{path}: its longest side is {long:.4g} mm (unit {used}, {said}); parts of {SMALLEST_MM:g} mm to "
            f"{LARGEST_MM / 1000:g} m are allowed, so give another --unit, or scale the part."
        )
    return used, said


def _by_trimesh(path: Path, raw: bytes, kind: str) -> Mesh:
    import trimesh

    log = logging.getLogger("trimesh")
    before = log.level
    log.setLevel(logging.CRITICAL)  # its modules print the tracebacks of errors that they then handle
    try:
        more: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
        mesh: Any = trimesh.load(BytesIO(raw), file_type=kind, force="mesh", process=False, **more)
        corners = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: this is no {kind.upper()} file that can be read; save the part again.") from error
    finally:
        log.setLevel(before)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(corners)):
        raise InputError(f"{path}: a triangle has a corner that the file does not hold; save the part again.")
    return Mesh(corners, triangles)
