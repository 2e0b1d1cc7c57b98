"""Report the import of a CAD file as plain data in mm, and as lines for the terminal."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.importers.cad.meshes.mesh_file import CadFile
from apo_bench.importers.cad.part_import import ImportedPart
from apo_bench.importers.cad.solids import Region, clean_title


def report_file(file: CadFile, path: Path, parts: Sequence[ImportedPart], poses: Path | None) -> dict[str, Any]:
    """Return the report of a file as plain data, for JSON.

    Args:
        poses: The file of poses, if one was written.
    """
    return {
        "file": str(path),
        "unit": file.unit,
        "unit_from": file.unit_from,
        "warnings": list(file.warnings),
        "parts": [report_part(each) for each in parts],
        "poses": None if poses is None else str(poses),
    }


def report_part(part: ImportedPart) -> dict[str, Any]:
    """Return the report of one part as plain data: size, faces, volume, pieces."""
    raw = part.raw
    return {
        "part": part.path.stem,
        "title": clean_title(raw.name),
        "written": str(part.path),
        "size_mm": np.ptp(raw.mesh.corners, axis=0).tolist(),
        "triangles": len(raw.mesh.triangles),
        "repairs": list(raw.repairs),
        "places": [{"name": name, "matrix_mm": T.tolist(), "color": color} for name, T, color, _ in raw.places],
        "faces": {name: _report_face(part, name, region) for name, region in raw.named().items()},
        "kinds": dict(Counter(region.kind for region in raw.regions)),
        "volume_mm3": {"before": raw.mesh.volume, "after": 1e9 * part.solid.volume},
        "pieces": len(part.solid.pieces),
        "pieces_for_free_shapes": part.cut.hulls,
    }


def _report_face(part: ImportedPart, name: str, region: Region) -> dict[str, Any]:
    """Return the report of one face as plain data, [mm]."""
    report: dict[str, Any] = {
        "kind": region.kind,
        "no_contact": part.refused.get(name),
        "share": part.shares.get(name, 1.0),
    }
    if region.kind == "plane":
        return {**report, "normal": region.direction.tolist(), "offset_mm": float(region.direction @ region.point)}
    return {
        **report,
        "hole": region.hole,
        "ends_mm": region.ends.tolist(),
        "radii_mm": [float(r) for r in region.radii],
        "free_radius_mm": part.free_mm.get(name),
        "sides": region.sides or None,
    }


def format_file_report(file: CadFile, path: Path) -> Iterator[str]:
    """Yield `part.stl: unit mm, taken from the size; the file states none`, and the warnings."""
    yield f"{path}: unit {file.unit}, {file.unit_from}"
    yield from (f"{path}: {warning}" for warning in file.warnings)


def format_part_report(report: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report of one part as lines."""
    yield f"{report['part']}: {_format_numbers(report['size_mm'], ' x ')} mm, {report['triangles']:,} triangles"
    if report["title"] != report["part"]:
        yield f"  title: {report['title']}"
    yield from (f"  repaired: {repair}" for repair in report["repairs"])
    if len(report["places"]) > 1:
        yield f"  places in the file: {len(report['places'])}"
    yield f"  faces: {', '.join(f'{count} {kind}' for kind, count in report['kinds'].items())}"
    for name, face in report["faces"].items():
        yield f"    {name}: {_format_face(face)}"
    before, after = report["volume_mm3"].values()
    yield f"  volume: {before:.6g} mm^3 in the file, {after:.6g} mm^3 with round walls as fitted"
    yield f"  pieces: {report['pieces']} convex ones, {report['pieces_for_free_shapes']} of them for free shapes"


def _format_face(face: Mapping[str, Any]) -> str:
    """Return the line of one face, from its report."""
    if face["kind"] == "plane":
        text = f"flat, normal ({_format_numbers(face['normal'])}), {face['offset_mm']:.6g} mm from the origin"
    else:
        low, high = map(_format_numbers, face["ends_mm"])
        sides = f" of {face['sides']} sides" if face["sides"] else ""
        radii = _format_numbers(dict.fromkeys(face["radii_mm"]))
        text = f"{'hole' if face['hole'] else 'shaft'}, {face['kind']}{sides}, radius {radii} mm"
        text += f", axis from ({low}) to ({high}) mm"
        if face["free_radius_mm"]:
            text += f", free radius {face['free_radius_mm']:.4f} mm"
    if face["no_contact"]:
        return f"{text}; NO CONTACT: {face['no_contact']}"
    return text if face["share"] == 1.0 else f"{text}; {100.0 * face['share']:.3g} % of it can touch"


def _format_numbers(values: Iterable[float], between: str = ", ") -> str:
    """Return numbers without rounding noise, as text."""
    return between.join(f"{round(float(x), 4) + 0.0:g}" for x in values)
