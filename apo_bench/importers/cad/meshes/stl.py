"""Read STL in text or binary form; a wrong count of triangles and trailing bytes are accepted.

trimesh 5.2 reads a binary file with a wrong count as text, and then finds no triangle.
"""

import re
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.importers.cad.solids import Mesh

_HEADER = 84  # bytes before the first triangle of a binary file; the last four hold the count
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])  # one triangle of a binary file
_TEXT_BEGINS = 10_000
"""A text file names its first facet within this many bytes."""
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)  # a corner in a text file


def read_stl(path: Path, raw: bytes) -> Mesh:
    """Read the triangles of a file; each has its own three corners.

    Raises:
        InputError: It is no STL file, or ends within its triangles.
    """
    begin = raw[:_TEXT_BEGINS].lower()
    if begin.lstrip().startswith(b"solid") and b"facet" in begin:
        try:
            corners = np.array(_VERTEX.findall(raw), dtype=np.float64).reshape(-1, 3, 3)
        except ValueError as error:
            raise InputError(f"{path}: this is no STL file that can be read; save the part again.") from error
    else:
        stated = int.from_bytes(raw[_HEADER - 4 : _HEADER], "little")
        held, rest = divmod(len(raw) - _HEADER, _ROW.itemsize)  # whole triangles, and the bytes left over
        require(held >= 1, f"{path}: the file holds no triangles; save the part as a mesh.")
        require(
            not rest or 0 < stated <= held,
            f"{path}: the file states {stated:,} triangles and holds {held:,} and a part of one; save the part again.",
        )
        corners = np.frombuffer(raw, _ROW, stated if rest else held, _HEADER)["corners"]
    every = corners.reshape(-1, 3).astype(np.float64)
    return Mesh(every, np.arange(len(every)).reshape(-1, 3))
