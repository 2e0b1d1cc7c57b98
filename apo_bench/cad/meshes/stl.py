"""STL: text by trimesh; binary by the triangles that the file holds, as programs write wrong counts and more bytes."""

import logging
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.errors import InputError

_HEADER = 80
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
_TEXT_BEGINS = 10_000
"""Bytes in which a text file names its first facet."""
_PACKED = {b"\x1f\x8b": "gzip", b"PK\3\4": "zip", b"7z\xbc\xaf": "7z", b"\xfd7zX": "xz", b"BZh": "bzip2"}


def read_stl(path: Path, raw: bytes) -> tuple[Mesh, tuple[str, ...]]:
    """The mesh of a file, and a sentence where its count of triangles was wrong.

    Raises:
        InputError: It is no STL file, or ends within its triangles.
    """
    packed = next((name for magic, name in _PACKED.items() if raw.startswith(magic)), "")
    if packed:
        raise InputError(f"{path}: the file is packed with {packed}; unpack it, and give the STL file in it.")
    begin = raw[:_TEXT_BEGINS].lower()
    if begin.lstrip().startswith(b"solid") and b"facet" in begin:
        return _read_text(path, raw), ()
    stated = int.from_bytes(raw[_HEADER : _HEADER + 4], "little")
    held, rest = divmod(len(raw) - _HEADER - 4, _ROW.itemsize)
    if held < 1:
        raise InputError(f"{path}: the file holds no triangles; save the part as a mesh.")
    said: tuple[str, ...] = ()
    used = min(stated, held)
    if stated != held and not rest:
        used = held
        said = (f"the file states {stated:,} triangles and holds {held:,}, which were read",)
    elif stated > held or not stated:
        raise InputError(
            f"{path}: the file states {stated:,} triangles and holds {held:,} and a part of one; save the part again."
        )
    corners = np.frombuffer(raw, _ROW, used, _HEADER + 4)["corners"].reshape(-1, 3).astype(np.float64)
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3)), said


def _read_text(path: Path, raw: bytes) -> Mesh:
    import trimesh

    log = logging.getLogger("trimesh")
    before = log.level
    log.setLevel(logging.CRITICAL)  # its modules print the tracebacks of errors that they then handle
    try:
        mesh: Any = trimesh.load(BytesIO(raw), file_type="stl_ascii", force="mesh", process=False)
        return Mesh(
            np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3),
            np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3),
        )
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: this is no STL file that can be read; save the part again.") from error
    finally:
        log.setLevel(before)
