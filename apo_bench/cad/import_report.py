"""What an import of a CAD file did: in lines for a person, as JSON with the same, in mm, and as a file of poses."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.importing import Imported
from apo_bench.cad.meshes.mesh_file import CadFile
from apo_bench.cad.solids.naming import part_name, title_of
from apo_bench.cad.solids.raw_solid import RawSolid, Region, SolidPlace
from apo_bench.geometry import pose
from apo_bench.io import write_file
from apo_bench.parts.making import quoted

_KIND_WORDS = {
    "plane": ("flat", "flat"),
    "cylinder": ("cylinder", "cylinders"),
    "cone": ("cone", "cones"),
    "other": ("other", "other"),
}


def file_lines(path: Path, file: CadFile) -> Iterator[str]:
    """`part.stl: unit mm, taken from the size; the file states none`, and what a user must know of how it was read."""
    yield f"{path}: unit {file.unit}, {file.unit_from}"
    yield from (f"{path}: {each}" for each in file.said)


def import_lines(part: Imported) -> Iterator[str]:
    """One part: size, faces, what can touch nothing, free radii, volume, pieces."""
    raw = part.raw
    size = np.ptp(raw.mesh.corners, axis=0)
    yield f"{part.path.stem}: {_numbers(size, ' x ')} mm, {len(raw.mesh.triangles):,} triangles, watertight"
    if part.path.stem != raw.name:
        yield f"  title: {title_of(raw.name)}"
    for mended in raw.mended:
        yield f"  mended: {mended}"
    for k, (_, T, _) in enumerate(raw.places, start=1):
        turn = np.degrees(np.arccos(np.clip((np.trace(T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
        if len(raw.places) > 1 or turn or T[:3, 3].any():
            yield f"  place {k} of it in the file: shifted by ({_numbers(T[:3, 3])}) mm, turned by {turn:.4g} degrees"
    counts: Counter[str] = Counter(region.kind for region in raw.regions)
    words = (f"{counts[kind]} {each[counts[kind] > 1]}" for kind, each in _KIND_WORDS.items() if counts[kind])
    yield f"  faces: {', '.join(words)}"
    for name, region in raw.named().items():
        less = (
            f"; {100.0 * part.shares[name]:.3g} % of it can touch, its border is coarser" if name in part.shares else ""
        )
        no_contact = f"; NO CONTACT: {part.refused[name]}" if name in part.refused else less
        yield f"    {name}: {_region_words(region)}{no_contact}"
    partly_round, free = _without_contact(raw)
    if partly_round:
        radii = dict.fromkeys(f"{radius:.4g}" for radius in partly_round)
        yield (
            f"  without contact: {len(partly_round)} round walls that do not go all the way round, such as fillets "
            f"(radius {', '.join([*radii][:8])} mm)"
        )
    if free:
        yield f"  without contact: {free} surfaces that are neither flat, nor cylinders, nor cones"
    for name, radius in part.free_mm.items():
        fitted = min(raw.named()[name].radii)
        yield f"  free radius of {name}: {radius:.4f} mm, {1e3 * (radius - fitted):+.1f} um from the fitted wall"
    written = 1e9 * part.solid.volume
    if raw.moments is not None:
        yield f"  volume: {raw.moments.size:.6g} mm^3 in the file, {written:.6g} mm^3 as written"
    else:
        yield f"  volume: {raw.mesh.volume:.6g} mm^3 as tessellated, {written:.6g} mm^3 with round walls as fitted"
    hulls = (
        f"; {part.cut.hulls} of them stand for hollow or free shapes, which changes what collides by "
        f"{part.cut.grown:+.3g} mm^3 ({100.0 * part.cut.grown / written:+.2g} %)"
    )
    yield f"  pieces: {len(part.solid.pieces)} convex ones{hulls if part.cut.hulls else ''}"


def _without_contact(raw: RawSolid) -> tuple[list[float], int]:
    """Radii of walls that do not go all the way round, ascending, [mm]; how many other surfaces."""
    radii = sorted(float(max(region.radii)) for region in raw.regions if region.is_round and not region.name)
    return radii, sum(region.kind == "other" for region in raw.regions)


def _region_words(region: Region) -> str:
    if region.kind == "plane":
        offset = region.direction @ region.point
        return f"flat, looks along ({_numbers(region.direction)}), {offset:.6g} mm from the origin"
    wide = " to ".join(f"{r:.5g}" for r in dict.fromkeys(round(float(r), 6) for r in region.radii))
    sides = f" of {region.sides} sides" if region.sides else ""
    return (
        f"{'hole' if region.hole else 'shaft'}, {region.kind}{sides}, radius {wide} mm, axis from "
        f"({_numbers(region.ends[0])}) to ({_numbers(region.ends[1])}) mm, residual {1e3 * region.residual:.2g} um"
    )


def _numbers(values: Iterable[float], between: str = ", ") -> str:
    return between.join(f"{round(float(x), 4) + 0.0:g}" for x in values)


def report_form(file: CadFile, path: Path, parts: Sequence[Imported], poses: Path | None) -> dict[str, Any]:
    """All of a file, as JSON."""
    return {
        "file": str(path),
        "unit": file.unit,
        "unit_from": file.unit_from,
        "warnings": list(file.said),
        "parts": [_part_form(each) for each in parts],
        "poses": None if poses is None else str(poses),
    }


def _part_form(part: Imported) -> dict[str, Any]:
    raw = part.raw
    return {
        "part": part.path.stem,
        "title": title_of(raw.name),
        "written": str(part.path),
        "size_mm": np.ptp(raw.mesh.corners, axis=0).tolist(),
        "triangles": len(raw.mesh.triangles),
        "watertight": True,
        "mended": list(raw.mended),
        "places": [{"name": name, "matrix_mm": T.tolist(), "color": color} for name, T, color in raw.places],
        "faces": {
            name: {**_face_form(region), "no_contact": part.refused.get(name), "share": part.shares.get(name, 1.0)}
            for name, region in raw.named().items()
        },
        "without_contact": dict(zip(("partly_round_radii_mm", "other_surfaces"), _without_contact(raw), strict=True)),
        "free_radius_mm": {
            name: {"free": radius, "of_wall": min(raw.named()[name].radii)} for name, radius in part.free_mm.items()
        },
        "volume_mm3": {
            "before": raw.mesh.volume if raw.moments is None else raw.moments.size,
            "after": 1e9 * part.solid.volume,
        },
        "pieces": len(part.solid.pieces),
        "pieces_for_hollow_or_free_shapes": part.cut.hulls,
        "grown_mm3": part.cut.grown,
    }


def _face_form(region: Region) -> dict[str, Any]:
    form: dict[str, Any] = {"kind": region.kind, "residual_um": 1e3 * region.residual}
    if region.kind == "plane":
        return {**form, "normal": region.direction.tolist(), "offset_mm": float(region.direction @ region.point)}
    return {
        **form,
        "hole": region.hole,
        "axis": region.direction.tolist(),
        "ends_mm": region.ends.tolist(),
        "radii_mm": [float(r) for r in region.radii],
        "sides": region.sides or None,
    }


def named_places(parts: Mapping[str, Iterable[SolidPlace]]) -> list[tuple[str, str, SolidPlace]]:
    """Part, name and place of each copy: as the file calls it, with a number where that is taken.

    Args:
        parts: Places of each part file.
    """
    used: set[str] = set()
    copies = []
    for part, places in parts.items():
        for place in places:
            name = part_name(place.name, used)
            used.add(name)
            copies.append((part, name, place))
    return copies


def write_places(places: Iterable[tuple[str, str, SolidPlace]], folder: Path, source: str) -> Path:
    """Write `poses.toml`, which `scenario new` reads beside the part files."""
    lines = [f"# where {source} has its parts".replace("\n", " ")]
    for part, name, place in places:
        packed = pose.pack(place.T)
        lines += ["", "[[pose]]", f'part = "{part}"', f'name = "{name}"']
        lines += [f"title = {quoted(title_of(place.name))}"] * (name != place.name)
        lines.append(f"at_mm = {_list(packed[:3])}")
        lines.append(f"quaternion_wxyz = {_list(packed[3:])}")
        if place.color is not None:
            lines.append(f"color = {_list(np.round(place.color, 4))}")
    path = folder / "poses.toml"
    write_file(path, "\n".join(lines) + "\n")
    return path


def _list(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{round(float(x), 12) + 0.0:.12g}" for x in values) + "]"
