"""STEP files become raw solids: read in a process of its own, as what a file makes of the reader is its own affair."""

import os
import pickle
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from apo_bench.cad.meshes.mesh_file import (
    LARGEST_PART_MM,
    MOST_CAD_TRIANGLES,
    SMALLEST_PART_MM,
    CadFile,
    read_cad_bytes,
)
from apo_bench.cad.solids.raw_solid import RawSolid, without_copies
from apo_bench.cad.step.from_brep import raw_of
from apo_bench.cad.step.surfaces import READER_BYTES, READER_S, BrepSolid
from apo_bench.errors import InputError

STEP_SUFFIXES = (".step", ".stp")
_MOST_SOLIDS = 200
_WALL_S = 120
_START = (
    "import sys; path, *sys.path = sys.argv[1:]; "
    "from apo_bench.cad.step.open_cascade import write_solids; write_solids(path)"
)
_ENDS_CPU = -24
_PREFIXES = {"": "m", "MILLI": "mm", "CENTI": "cm", "MICRO": "um"}
_UNIT_NAMES = {
    "INCH": "in",
    "FOOT": "ft",
    "FEET": "ft",
    "METRE": "m",
    "CENTIMETRE": "cm",
    "MILLIMETRE": "mm",
}


def read_step(path: Path, unit: str | None) -> tuple[CadFile, list[RawSolid]]:
    """The solids of a STEP file, each once, with all of its places.

    Raises:
        InputError: The extra is missing, the file cannot be read, or it holds no closed solid of a size for a part.
    """
    if unit is not None:
        raise InputError(f"--unit {unit} was given, and a STEP file states its own; leave --unit out.")
    raw = read_cad_bytes(path, "STEP")
    if b"ISO-10303-21" not in raw[:2000]:
        raise InputError(f"{path}: this is no STEP file (it does not begin with ISO-10303-21); save the part again.")
    if find_spec("OCP") is None:
        raise InputError(f"{path}: reading STEP needs the extra cad; run: pip install 'apo_bench[cad]'")
    own_unit = _unit(raw)
    solids = _read_apart(path)
    if not solids:
        raise InputError(f"{path}: the file holds no solid; save the part as a solid, not as curves or a drawing.")
    count = sum(len(face.triangles) for solid in solids for face in solid.faces)
    if len(solids) > _MOST_SOLIDS or count > MOST_CAD_TRIANGLES:
        raise InputError(
            f"{path}: the file has {len(solids)} solids with {count:,} triangles; {_MOST_SOLIDS} and "
            f"{MOST_CAD_TRIANGLES:,} are the most, so save less of it."
        )
    sizes = [np.ptp(np.concatenate([face.corners for face in solid.faces]), axis=0).max() for solid in solids]
    for size in (min(sizes), max(sizes)):
        if not SMALLEST_PART_MM <= size <= LARGEST_PART_MM:
            raise InputError(
                f"{path}: a solid in it is {size:.4g} mm long (unit {own_unit}, stated in the file); parts of "
                f"{SMALLEST_PART_MM:g} mm to {LARGEST_PART_MM / 1000:g} m are allowed, so save it in its true unit, or "
                "scale it."
            )
    raws = list[RawSolid]()
    left_out = list[str]()
    for solid in solids:
        try:
            raws.append(raw_of(path, solid))
        except InputError as error:
            if len(solids) == 1:
                raise
            left_out.append(f"{solid.name}: {str(error).removeprefix(f'{path}: ')}")
    return CadFile(own_unit, "stated in the file", tuple(left_out)), without_copies(raws)


def _read_apart(path: Path) -> list[BrepSolid]:
    """What the reader finds, in a process of its own."""
    command = [sys.executable, "-P", "-c", _START, str(path.absolute()), *sys.path]
    # One thread for numbers, as each thread takes memory.
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=_WALL_S, check=False, env=env
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{path}: reading the file takes more than {_WALL_S} s; save less of it.") from error
    if done.returncode:
        *_, last_words = ["", *done.stderr.decode(errors="replace").strip().splitlines()]
        fault = "the file cannot be read as STEP; save the part again from where it was drawn"
        if done.returncode == _ENDS_CPU:
            fault = f"reading the file takes more than {READER_S} s; save less of it"
        elif "MemoryError" in last_words or "bad_alloc" in last_words:
            fault = f"reading the file takes more than {READER_BYTES / 1e9:g} GB; save less of it"
        raise InputError(f"{path}: {fault}.")
    solids: list[BrepSolid] = pickle.loads(done.stdout)
    return solids


def _unit(raw: bytes) -> str:
    """The unit of lengths, as the file names it."""
    text = raw.decode("latin-1")
    lengths = re.findall(r"=\s*\(([^;]*?LENGTH_UNIT[^;]*?)\)\s*;", text)
    named = re.findall(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'", ";".join(lengths))
    if named:
        return _UNIT_NAMES.get(named[0].strip().upper(), named[0].strip().lower())
    si = re.search(r"LENGTH_UNIT[^;]*?SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.", text)
    return _PREFIXES.get(si[1] or "", f"{si[1]}metre".lower()) if si else "mm"
