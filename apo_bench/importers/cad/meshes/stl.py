"""STL: the triangles that a file holds, in text or binary, as programs write wrong counts and more bytes.

Read here and not by trimesh 5.2, which takes a binary file whose count is wrong for text, and finds nothing in it.
"""

import re
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.importers.cad.solids.raw_solid import Mesh

_HEADER = 80
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
_TEXT_BEGINS = 10_000
"""Bytes in which a text file names its first facet."""
_PACKED = {b"\x1f\x8b": "gzip", b"PK\3\4": "zip", b"7z\xbc\xaf": "7z", b"\xfd7zX": "xz", b"BZh": "bzip2"}
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(path: Path, raw: bytes) -> tuple[Mesh, tuple[str, ...]]:
    """The mesh of a file, and a sentence where its count of triangles was wrong.

    Raises:
        InputError: It is no STL file, or ends within its triangles.
    """
    packed = next((name for magic, name in _PACKED.items() if raw.startswith(magic)), "")
    require(not packed, f"{path}: the file is packed with {packed}; unpack it, and give the STL file in it.")
    begin = raw[:_TEXT_BEGINS].lower()
    if begin.lstrip().startswith(b"solid") and b"facet" in begin:
        return _as_mesh(_read_text(path, raw)), ()
    stated = int.from_bytes(raw[_HEADER : _HEADER + 4], "little")
    held, rest = divmod(len(raw) - _HEADER - 4, _ROW.itemsize)
    require(held >= 1, f"{path}: the file holds no triangles; save the part as a mesh.")
    known = f"{path}: the file states {stated:,} triangles and holds {held:,}"
    require(not rest or 0 < stated <= held, f"{known} and a part of one; save the part again.")
    said = (f"{known.removeprefix(f'{path}: ')}, which were read",) if stated != held and not rest else ()
    corners = np.frombuffer(raw, _ROW, stated if rest else held, _HEADER + 4)["corners"]
    return _as_mesh(corners), said


def _as_mesh(corners: np.ndarray) -> Mesh:
    """Three corners of its own for each triangle."""
    every = corners.reshape(-1, 3).astype(np.float64)
    return Mesh(every, np.arange(len(every)).reshape(-1, 3))


def _read_text(path: Path, raw: bytes) -> np.ndarray:
    """Corners of triangles, (3 t, 3)."""
    words = _VERTEX.findall(raw)
    try:
        return np.array(words, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise InputError(f"{path}: this is no STL file that can be read; save the part again.") from error
