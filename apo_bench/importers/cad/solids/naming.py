"""Names of faces: from what they are and where, so that one file gives the same ones each time."""

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from unicodedata import combining, normalize

import numpy as np

from apo_bench.errors import require, require_known
from apo_bench.importers.cad.solids.raw_solid import Mesh, RawSolid, Region
from apo_bench.io import clean
from apo_bench.scenario.parts.allowed import FACE_OR_PART_NAME, LONGEST_FACE_NAME

_LONGEST_PART_NAME = 48
_LONGEST_TITLE = 200
_GRID = 1e-4
"""Places that differ by less, in parts of the size, are in the order of the other ones."""


def with_names(mesh: Mesh, regions: Sequence[Region]) -> tuple[Region, ...]:
    """Regions with names: `pz`, the outermost face that looks along +z, `pz2` ..., `flat1`, `hole1`, `shaft1`, `cone1`.

    Of one kind the outermost one comes first, then by place; of round ones the widest. Faces on free surfaces and
    walls that do not go all the way round have none.
    """
    by_stem: dict[str, list[int]] = {}
    for k, region in enumerate(regions):
        by_stem.setdefault(_stem(region), []).append(k)
    by_stem.pop("", None)
    named = list(regions)
    for stem, members in by_stem.items():
        members.sort(key=lambda k: _order(mesh, regions[k]))
        for number, k in enumerate(members, start=1):
            is_outermost_side = len(stem) == 2 and number == 1
            named[k] = replace(regions[k], name=stem if is_outermost_side else f"{stem}{number}")
    return tuple(named)


def renamed(raw: RawSolid, names: Mapping[str, str]) -> RawSolid:
    """With other names for some faces; `+z` stands for `pz`, `-z` for `nz`.

    Raises:
        InputError: No face has the name, or two would have one.
    """
    signs = {"+": "p", "-": "n"}
    new_names = {signs.get(old[:1], old[:1]) + old[1:]: new for old, new in names.items()}
    have = list(raw.named())
    rule = f"a letter, then letters, digits and underscores, {LONGEST_FACE_NAME} at most, not beginning with auto_"
    for old, new in new_names.items():
        require_known("face", old, have)
        is_name = FACE_OR_PART_NAME.fullmatch(new) and len(new) <= LONGEST_FACE_NAME and not new.startswith("auto_")
        require(is_name, f"--name {old}={new} was given; the new name of a face is {rule}.")
    after = Counter(new_names.get(name, name) for name in have)
    twice = [name for name, count in after.items() if count > 1]
    require(not twice, f"--name gives two faces the name {', '.join(twice)}; give each its own.")
    regions = (replace(region, name=new_names.get(region.name, region.name)) for region in raw.regions)
    return replace(raw, regions=tuple(regions))


def part_name(text: str, used: Container[str]) -> str:
    """A name that a part may have, from any text, and that nothing else has.

    Letters with accents become plain ones. A text with letters that have no Latin form gives `part_1`, `part_2`, ...
    """
    plain = _in_latin(text)
    if plain is None:
        return next(free for free in (f"part_{n}" for n in count(1)) if free not in used)
    return free_name(plain if plain[:1].isalpha() else f"part_{plain}", used)


def _in_latin(text: str) -> str | None:
    """A text in letters, digits and underscores; None if a letter has no Latin form, or no letter or digit is left."""
    plain = ""
    for c in normalize("NFKD", text):
        folded = c if c.isascii() else c.casefold()
        if not folded.isascii() and c.isalnum():
            return None
        if not combining(c):
            plain += "".join(each if each.isascii() and each.isalnum() else "_" for each in folded)
    return plain[:_LONGEST_PART_NAME] if plain.strip("_") else None


def title_of(text: str) -> str:
    """A name of a CAD file as one line that can be printed."""
    return clean(text)[:_LONGEST_TITLE]


def free_name(name: str, used: Container[str]) -> str:
    """The name, or with a number behind it that makes it one that nothing else has."""
    return next(free for free in chain([name], (f"{name}_{n}" for n in count(2))) if free not in used)


def _stem(region: Region) -> str:
    """What a name begins with; empty for what has none."""
    if region.kind == "plane":
        axis = int(np.abs(region.direction).argmax())
        side = ("p" if region.direction[axis] > 0.0 else "n") + "xyz"[axis]
        return "flat" if abs(region.direction[axis]) < 1.0 - 1e-9 else side
    whole = "cone" if region.kind == "cone" else "hole" if region.hole else "shaft"
    return whole if region.is_whole else ""


def _order(mesh: Mesh, region: Region) -> tuple[float, ...]:
    """How far out a plane is, or how wide a wall, then its lowest corner; on a grid that hides rounding."""
    low = mesh.corners[np.unique(mesh.triangles[region.triangles])].min(axis=0)
    first = float(region.direction @ region.point) if region.kind == "plane" else max(region.radii)
    grid = _GRID * mesh.extent
    return (-float(round(first / grid)), *(float(round(x / grid)) for x in low))
