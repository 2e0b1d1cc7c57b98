"""What an import of a CAD file did: in lines for a person, and as one JSON object with the same, in mm."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.importing import Imported
from apo_bench.cad.meshes.mesh_file import CadFile
from apo_bench.cad.solids.raw_solid import RawSolid, Region, SolidPlace

_KIND_WORDS = {"plane": ("flat", "flat"), "cylinder": ("cylinder", "cylinders"), "cone": ("cone", "cones")}


def unit_line(file: CadFile) -> str:
    """`unit mm, taken from the size; the file states none`."""
    return f"unit {file.unit}, {file.unit_from}"


def import_lines(part: Imported) -> Iterator[str]:
    """One part: size, faces, what can touch nothing, free radii, volume, pieces."""
    raw = part.raw
    size = np.ptp(raw.mesh.corners, axis=0)
    yield f"{part.path.stem}: {_numbers(size, ' x ')} mm, {len(raw.mesh.triangles):,} triangles, watertight"
    for mended in raw.mended:
        yield f"  mended: {mended}"
    for k, (_, T, _) in enumerate(raw.places, start=1):
        turn = np.degrees(np.arccos(np.clip((np.trace(T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
        if len(raw.places) > 1 or turn or T[:3, 3].any():
            yield f"  place {k} of it in the file: shifted by ({_numbers(T[:3, 3])}) mm, turned by {turn:.4g} degrees"
    yield f"  faces: {_counts(raw)}"
    for name, region in raw.named().items():
        line = f"    {name}: {_region_words(region)}"
        if name in part.refused:
            line += f"; NO CONTACT: {part.refused[name]}"
        elif name in part.shares:
            line += f"; {100.0 * part.shares[name]:.3g} % of it can touch, its border is coarser"
        yield line
    partly_round = _partly_round(raw)
    if partly_round:
        radii = sorted({f"{max(r.radii):.4g}" for r in partly_round}, key=float)
        yield (
            f"  without contact: {len(partly_round)} round walls that do not go all the way round, such as fillets "
            f"(radius {', '.join(radii[:8])} mm)"
        )
    free = _other_surfaces(raw)
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
    line = f"  pieces: {len(part.solid.pieces)} convex ones"
    if part.cut.hulls:
        line += (
            f"; {part.cut.hulls} of them stand for hollow or free shapes, which changes what collides by "
            f"{part.cut.grown:+.3g} mm^3 ({100.0 * part.cut.grown / written:+.2g} %)"
        )
    yield line


def _partly_round(raw: RawSolid) -> list[Region]:
    return [region for region in raw.regions if region.is_round and not region.name]


def _other_surfaces(raw: RawSolid) -> int:
    return sum(region.kind == "other" for region in raw.regions)


def _counts(raw: RawSolid) -> str:
    words = []
    for kind, (singular, plural) in _KIND_WORDS.items():
        count = sum(region.kind == kind for region in raw.regions)
        if count:
            words.append(f"{count} {singular if count == 1 else plural}")
    other = _other_surfaces(raw)
    return ", ".join([*words, *([f"{other} other"] if other else [])])


def _region_words(region: Region) -> str:
    if region.kind == "plane":
        offset = region.direction @ region.point
        return f"flat, looks along ({_numbers(region.direction)}), {offset:.6g} mm from the origin"
    wide = " to ".join(f"{r:.5g}" for r in dict.fromkeys(round(float(r), 6) for r in region.radii))
    return (
        f"{'hole' if region.hole else 'shaft'}, {region.kind}, radius {wide} mm, axis from "
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
        "parts": [_part_form(each) for each in parts],
        "poses": None if poses is None else str(poses),
    }


def _part_form(part: Imported) -> dict[str, Any]:
    raw = part.raw
    return {
        "part": part.path.stem,
        "written": str(part.path),
        "size_mm": _list(np.ptp(raw.mesh.corners, axis=0)),
        "triangles": len(raw.mesh.triangles),
        "watertight": True,
        "mended": list(raw.mended),
        "places": [_place_form(place) for place in raw.places],
        "faces": {
            name: {**_face_form(region), "no_contact": part.refused.get(name), "share": part.shares.get(name, 1.0)}
            for name, region in raw.named().items()
        },
        "without_contact": {
            "partly_round_radii_mm": sorted(max(region.radii) for region in _partly_round(raw)),
            "other_surfaces": _other_surfaces(raw),
        },
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


def _place_form(place: SolidPlace) -> dict[str, Any]:
    return {"name": place.name, "matrix_mm": [_list(row) for row in place.T], "color": place.color}


def _face_form(region: Region) -> dict[str, Any]:
    form: dict[str, Any] = {"kind": region.kind, "residual_um": 1e3 * region.residual}
    if region.kind == "plane":
        return {**form, "normal": _list(region.direction), "offset_mm": float(region.direction @ region.point)}
    return {
        **form,
        "hole": region.hole,
        "axis": _list(region.direction),
        "ends_mm": [_list(end) for end in region.ends],
        "radii_mm": [float(r) for r in region.radii],
    }


def _list(values: Any) -> list[float]:
    return [float(x) for x in values]
