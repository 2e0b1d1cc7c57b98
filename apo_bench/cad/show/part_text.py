"""What an import of a CAD file did, in lines: unit, size, faces, volume, free radii, pieces, what can touch nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from apo_bench.cad.raw import RawSolid, Region

if TYPE_CHECKING:
    from apo_bench.cad.importing import Imported
    from apo_bench.cad.reading import CadFile

_KINDS = (("plane", "flat", "flat"), ("cylinder", "cylinder", "cylinders"), ("cone", "cone", "cones"))


def unit_line(file: CadFile) -> str:
    """`unit mm, taken from the size; the file states none`."""
    return f"unit {file.unit}, {file.said}"


def import_lines(done: Imported) -> Iterator[str]:
    """One part."""
    raw = done.raw
    low = raw.mesh.corners.min(axis=0)
    high = raw.mesh.corners.max(axis=0)
    yield f"{done.path.stem}: {_numbers(high - low, ' x ')} mm, {len(raw.mesh.triangles):,} triangles, watertight"
    for said in raw.said:
        yield f"  mended: {said}"
    for k, (_, T, _) in enumerate(raw.places, start=1):
        turn = np.degrees(np.arccos(np.clip((np.trace(T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
        if len(raw.places) > 1 or turn or T[:3, 3].any():
            yield f"  place {k} of it in the file: shifted by ({_numbers(T[:3, 3])}) mm, turned by {turn:.4g} degrees"
    yield f"  faces: {_counts(raw)}"
    for name, region in raw.named().items():
        reason = done.refused.get(name)
        less = (
            f"; {100.0 * done.shares[name]:.3g} % of it can touch, its border is coarser" if name in done.shares else ""
        )
        yield f"    {name}: {_region(region)}" + (f"; NO CONTACT: {reason}" if reason else less)
    corners = [r for r in raw.regions if r.is_round and not r.name]
    if corners:
        radii = sorted({f"{max(r.radii):.4g}" for r in corners}, key=float)
        yield (
            f"  without contact: {len(corners)} round walls that do not go all the way round, such as fillets "
            f"(radius {', '.join(radii[:8])} mm)"
        )
    free = sum(r.kind == "other" for r in raw.regions)
    if free:
        yield f"  without contact: {free} surfaces that are neither flat, nor cylinders, nor cones"
    for name, radius in done.free_mm.items():
        fitted = min(raw.named()[name].radii)
        yield f"  free radius of {name}: {radius:.4f} mm, {1e3 * (radius - fitted):+.1f} um from the fitted wall"
    stated = 1e9 * done.solid.volume
    if raw.moments is not None:
        yield f"  volume: {raw.moments.size:.6g} mm^3 in the file, {stated:.6g} mm^3 as written"
    else:
        yield f"  volume: {raw.mesh.volume:.6g} mm^3 as tessellated, {stated:.6g} mm^3 with round walls as fitted"
    loss = (
        f"; {done.cut.hulls} of them stand for hollow or free shapes, which changes what collides by "
        f"{done.cut.grown:+.3g} mm^3 ({100.0 * done.cut.grown / (1e9 * done.solid.volume):+.2g} %)"
        if done.cut.hulls
        else ""
    )
    yield f"  pieces: {len(done.solid.pieces)} convex ones{loss}"


def _counts(raw: RawSolid) -> str:
    found = []
    for kind, one, many in _KINDS:
        count = sum(r.kind == kind for r in raw.regions)
        if count:
            found.append(f"{count} {one if count == 1 else many}")
    other = sum(r.kind == "other" for r in raw.regions)
    return ", ".join([*found, *([f"{other} other"] if other else [])])


def _region(region: Region) -> str:
    assert region.point is not None
    if region.kind == "plane":
        assert region.normal is not None
        return f"flat, looks along ({_numbers(region.normal)}), {region.normal @ region.point:.6g} mm from the origin"
    assert region.axis is not None
    ends = [region.point + h * region.axis for h in region.span]
    wide = " to ".join(f"{r:.5g}" for r in dict.fromkeys(round(float(r), 6) for r in region.radii))
    return (
        f"{'hole' if region.hole else 'shaft'}, {region.kind}, radius {wide} mm, axis from ({_numbers(ends[0])}) to "
        f"({_numbers(ends[1])}) mm, residual {1e3 * region.residual:.2g} um"
    )


def _numbers(values: np.ndarray, between: str = ", ") -> str:
    return between.join(f"{round(float(x), 4) + 0.0:g}" for x in values)
