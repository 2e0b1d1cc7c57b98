"""Name the faces and parts of CAD files, so that a file gives the same names each time."""

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from unicodedata import combining, normalize

import numpy as np

from apo_bench.errors import require, require_known
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.raw_solid import RawSolid
from apo_bench.importers.cad.solids.region import Region
from apo_bench.io import clean
from apo_bench.scenario.parts.limits import FACE_OR_PART_NAME, LONGEST_FACE_NAME

_LONGEST_PART_NAME = 48  # characters
_LONGEST_TITLE = 200  # characters
_GRID = 1e-4
"""Grid on which positions are compared, as a share of the size, to hide rounding."""


def name_regions(mesh: Mesh, regions: Sequence[Region]) -> tuple[Region, ...]:
    """Name regions: `pz`, the outermost face along +z, `pz2` ..., `flat1`, `hole1`, `shaft1`, `cone1`.

    Faces of one kind are numbered from the outermost plane or the widest wall, then by place. Free-form surfaces and
    walls that do not go all the way round get no name.
    """
    stems = [_name_stem(region) for region in regions]
    numbers = Counter[str]()
    named = list(regions)
    for k in sorted(range(len(regions)), key=lambda k: _sort_key(mesh, regions[k])):
        stem = stems[k]
        numbers[stem] += 1
        is_outermost_side = len(stem) == 2 and numbers[stem] == 1
        name = stem if is_outermost_side or not stem else f"{stem}{numbers[stem]}"
        named[k] = replace(regions[k], name=name)
    return tuple(named)


def rename_faces(raw: RawSolid, names: Mapping[str, str]) -> RawSolid:
    """Rename some faces; `+z` stands for `pz`, `-z` for `nz`.

    Args:
        names: Present name -> new name.

    Raises:
        InputError: No face has the name, or two would have one.
    """
    signs = {"+": "p", "-": "n"}  # as in the options of commands
    new_names = {signs.get(old[:1], old[:1]) + old[1:]: new for old, new in names.items()}
    have = list(raw.named())
    rule = f"a letter, then letters, digits and underscores, {LONGEST_FACE_NAME} at most, not beginning with auto_"
    for old, new in new_names.items():
        require_known("face", old, have)
        is_name = FACE_OR_PART_NAME.fullmatch(new) and len(new) <= LONGEST_FACE_NAME and not new.startswith("auto_")
        require(is_name, f"--name {old}={new} was given; the new name of a face is {rule}.")
    after = [new_names.get(name, name) for name in have]
    require(len(set(after)) == len(after), "--name gives two faces one name; give each its own.")
    regions = (replace(region, name=new_names.get(region.name, region.name)) for region in raw.regions)
    return replace(raw, regions=tuple(regions))


def make_part_name(text: str, used: Container[str]) -> str:
    """Return an unused name that a part may have, from any text.

    Letters with accents become plain ones. A text with letters that have no Latin form gives `part_1`, `part_2`, ...
    """
    plain = _to_latin(text)
    if not plain.strip("_"):
        return next(free for free in (f"part_{n}" for n in count(1)) if free not in used)
    return find_free_name(plain if plain[:1].isalpha() else f"part_{plain}", used)


def _to_latin(text: str) -> str:
    """Return a text in ASCII letters, digits and underscores; empty if a letter has no Latin form."""
    plain = ""
    for c in normalize("NFKD", text):
        folded = c if c.isascii() else c.casefold()
        if not folded.isascii() and c.isalnum():
            return ""
        if not combining(c):  # accents are dropped
            plain += "".join(each if each.isascii() and each.isalnum() else "_" for each in folded)
    return plain[:_LONGEST_PART_NAME]


def clean_title(text: str) -> str:
    """Return a name of a CAD file as one printable line."""
    return clean(text)[:_LONGEST_TITLE]


def find_free_name(name: str, used: Container[str]) -> str:
    """Return the name, or if it is taken, the name with the first free number."""
    return next(free for free in chain([name], (f"{name}_{n}" for n in count(2))) if free not in used)


def _name_stem(region: Region) -> str:
    """Return the name of a region without its number; empty for a region that gets no name."""
    if region.kind == "plane":
        axis = int(np.abs(region.direction).argmax())
        side = ("p" if region.direction[axis] > 0.0 else "n") + "xyz"[axis]
        return "flat" if abs(region.direction[axis]) < 1.0 - 1e-9 else side
    whole = "cone" if region.kind == "cone" else "hole" if region.hole else "shaft"
    return whole if region.is_whole else ""


def _sort_key(mesh: Mesh, region: Region) -> tuple[float, ...]:
    """Return the sort key of a region: outermost plane or widest wall first, then by its lowest corner."""
    low = mesh.corners[np.unique(mesh.triangles[region.triangles])].min(axis=0)
    first = float(region.direction @ region.point) if region.kind == "plane" else max(region.radii)
    grid = _GRID * mesh.extent
    return (-float(round(first / grid)), *(float(round(x / grid)) for x in low))
