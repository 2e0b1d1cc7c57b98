"""What an import of a CAD file did, as plain data, in mm; and in lines for a person."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.importers.cad.importing import Imported
from apo_bench.importers.cad.meshes.mesh_file import CadFile
from apo_bench.importers.cad.solids.naming import title_of
from apo_bench.importers.cad.solids.raw_solid import Region


def report_file(file: CadFile, path: Path, parts: Sequence[Imported], poses: Path | None) -> dict[str, Any]:
    """All of a file."""
    return {
        "file": str(path),
        "unit": file.unit,
        "unit_from": file.unit_from,
        "warnings": list(file.said),
        "parts": [report_part(each) for each in parts],
        "poses": None if poses is None else str(poses),
    }


def report_part(part: Imported) -> dict[str, Any]:
    """One part: size, faces, what can touch nothing, free radii, volume, pieces."""
    raw = part.raw
    partly_round = sorted(float(max(region.radii)) for region in raw.regions if region.is_round and not region.name)
    return {
        "part": part.path.stem,
        "title": title_of(raw.name),
        "written": str(part.path),
        "size_mm": np.ptp(raw.mesh.corners, axis=0).tolist(),
        "triangles": len(raw.mesh.triangles),
        "watertight": True,
        "mended": list(raw.mended),
        "places": [{"name": name, "matrix_mm": T.tolist(), "color": color} for name, T, color in raw.places],
        "faces": {name: _report_face(part, name, region) for name, region in raw.named().items()},
        "kinds": dict(Counter(region.kind for region in raw.regions)),
        "without_contact": {
            "partly_round_radii_mm": partly_round,
            "other_surfaces": sum(region.kind == "other" for region in raw.regions),
        },
        "volume_mm3": {"before": raw.mesh.volume, "after": 1e9 * part.solid.volume},
        "pieces": len(part.solid.pieces),
        "pieces_for_hollow_or_free_shapes": part.cut.hulls,
        "grown_mm3": part.cut.grown,
    }


def _report_face(part: Imported, name: str, region: Region) -> dict[str, Any]:
    form: dict[str, Any] = {
        "kind": region.kind,
        "residual_um": 1e3 * region.residual,
        "no_contact": part.refused.get(name),
        "share": part.shares.get(name, 1.0),
    }
    if region.kind == "plane":
        return {**form, "normal": region.direction.tolist(), "offset_mm": float(region.direction @ region.point)}
    return {
        **form,
        "hole": region.hole,
        "axis": region.direction.tolist(),
        "ends_mm": region.ends.tolist(),
        "radii_mm": [float(r) for r in region.radii],
        "free_radius_mm": part.free_mm.get(name),
        "sides": region.sides or None,
    }


def file_lines(file: CadFile, path: Path) -> Iterator[str]:
    """`part.stl: unit mm, taken from the size; the file states none`, and what a user must know of how it was read."""
    yield f"{path}: unit {file.unit}, {file.unit_from}"
    for each in file.said:
        yield f"{path}: {each}"


def part_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """The report of one part in lines."""
    yield f"{report['part']}: {_numbers(report['size_mm'], ' x ')} mm, {report['triangles']:,} triangles, watertight"
    if report["title"] != report["part"]:
        yield f"  title: {report['title']}"
    for mended in report["mended"]:
        yield f"  mended: {mended}"
    if len(report["places"]) > 1:
        yield f"  places in the file: {len(report['places'])}"
    yield f"  faces: {', '.join(f'{count} {kind}' for kind, count in report['kinds'].items())}"
    for name, face in report["faces"].items():
        less = f"; {100.0 * face['share']:.3g} % of it can touch" if face["share"] < 1.0 else ""
        no_contact = f"; NO CONTACT: {face['no_contact']}" if face["no_contact"] else less
        yield f"    {name}: {_face_words(face)}{no_contact}"
    for what, value in report["without_contact"].items():
        if value:
            yield f"  without contact, {what.replace('_', ' ')}: {_numbers(np.unique(np.round(value, 3)))}"
    before, after = report["volume_mm3"].values()
    yield f"  volume: {before:.6g} mm^3 in the file, {after:.6g} mm^3 with round walls as fitted"
    free = f", {report['pieces_for_hollow_or_free_shapes']} of them for free shapes, {report['grown_mm3']:+.3g} mm^3"
    yield f"  pieces: {report['pieces']} convex ones{free if report['pieces_for_hollow_or_free_shapes'] else ''}"


def _face_words(face: Mapping[str, Any]) -> str:
    if face["kind"] == "plane":
        return f"flat, looks along ({_numbers(face['normal'])}), {face['offset_mm']:.6g} mm from the origin"
    sides = f" of {face['sides']} sides" if face["sides"] else ""
    wide = " to ".join(f"{r:.5g}" for r in dict.fromkeys(face["radii_mm"]))
    low, high = map(_numbers, face["ends_mm"])
    words = f"{'hole' if face['hole'] else 'shaft'}, {face['kind']}{sides}, radius {wide} mm"
    words += f", axis from ({low}) to ({high}) mm, residual {face['residual_um']:.2g} um"
    return f"{words}, free radius {face['free_radius_mm']:.4f} mm" if face["free_radius_mm"] else words


def _numbers(values: Iterable[float], between: str = ", ") -> str:
    return between.join(f"{round(float(x), 4) + 0.0:g}" for x in values)
