"""What an import of a CAD file did, as one JSON object: the same as in the lines, in mm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from apo_bench.cad.raw import Place, Region

if TYPE_CHECKING:
    from apo_bench.cad.importing import Imported
    from apo_bench.cad.reading import CadFile


def report_form(file: CadFile, path: Path, parts: Sequence[Imported], poses: Path | None) -> dict[str, Any]:
    """All of a file."""
    return {
        "file": str(path),
        "unit": file.unit,
        "unit_from": file.said,
        "parts": [part_form(each) for each in parts],
        "poses": None if poses is None else str(poses),
    }


def part_form(done: Imported) -> dict[str, Any]:
    """One part."""
    raw = done.raw
    corners = [region for region in raw.regions if region.is_round and not region.name]
    return {
        "part": done.path.stem,
        "written": str(done.path),
        "size_mm": _list(np.ptp(raw.mesh.corners, axis=0)),
        "triangles": len(raw.mesh.triangles),
        "watertight": True,
        "mended": list(raw.said),
        "places": [_place(each) for each in raw.places],
        "faces": {
            name: {**_face(region), "no_contact": done.refused.get(name), "share": done.shares.get(name, 1.0)}
            for name, region in raw.named().items()
        },
        "without_contact": {
            "partly_round_radii_mm": sorted(max(region.radii) for region in corners),
            "other_surfaces": sum(region.kind == "other" for region in raw.regions),
        },
        "free_radius_mm": {
            name: {"free": radius, "of_wall": min(raw.named()[name].radii)} for name, radius in done.free_mm.items()
        },
        "volume_mm3": {
            "before": raw.mesh.volume if raw.moments is None else raw.moments.size,
            "after": 1e9 * done.solid.volume,
        },
        "pieces": len(done.solid.pieces),
        "pieces_for_hollow_or_free_shapes": done.cut.hulls,
        "grown_mm3": done.cut.grown,
    }


def _place(place: Place) -> dict[str, Any]:
    return {"name": place.name, "matrix_mm": [_list(row) for row in place.T], "color": place.color}


def _face(region: Region) -> dict[str, Any]:
    assert region.point is not None
    found: dict[str, Any] = {"kind": region.kind, "residual_um": 1e3 * region.residual}
    if region.normal is not None:
        return {**found, "normal": _list(region.normal), "offset_mm": float(region.normal @ region.point)}
    assert region.axis is not None
    ends = [_list(region.point + h * region.axis) for h in region.span]
    return {
        **found,
        "hole": region.hole,
        "axis": _list(region.axis),
        "ends_mm": ends,
        "radii_mm": [float(r) for r in region.radii],
    }


def _list(values: Any) -> list[float]:
    return [float(x) for x in values]
