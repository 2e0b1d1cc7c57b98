"""Cut a solid by planes until its parts are convex: along flat faces, then along sides of free-form shapes, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.corners import list_body_corners
from apo_bench.importers.cad.pieces.cut_part import SLIVER, CutPart, cut_through
from apo_bench.importers.cad.pieces.hollow_parts import HollowSpace, refine_pieces
from apo_bench.importers.cad.solids import Region, convert_to_mesh

_MOST_CUTS = 400  # in one solid
_TRIES = 6  # planes that are tried for one cut
HAIR = 2e-6
"""Distance of a cut from its plane, as a share of the size of the solid."""
_MOST_FREE_PLANES = 80
"""A free-form shape with more planes at reflex edges is bisected instead of cut along them."""
_MOST_BISECTED = 40  # parts of a shape that is bisected
_ROUGH = 0.01  # volume that hulls may add, as a share of the solid's
_FINE_TRIANGLES = 4000  # a shape with more triangles is simplified before it is bisected


def cut_into_convex_parts(solid: Any, beside: HollowSpace) -> Iterator[CutPart]:
    """Yield parts that are convex, or whose hulls stand for a hollow shape."""
    volume = solid.volume()
    parts = _cut_flats(solid, beside, volume) if beside.others is None else _cut_near_flats(solid, beside, volume)
    yield from refine_pieces(parts, beside, volume, HAIR * beside.size)


def _cut_near_flats(solid: Any, beside: HollowSpace, volume: float) -> Iterator[CutPart]:
    """Yield the parts of a solid after cuts along the flat faces that other solids come near."""
    yield from cut_at_reflex_edges(
        CutPart(solid, np.zeros((0, 4))), beside.size, beside.flats, True, [_MOST_CUTS], volume
    )


def _cut_flats(solid: Any, beside: HollowSpace, volume: float) -> Iterator[CutPart]:
    """Yield the parts of a solid after cuts along its flat faces, then through free-form shapes.

    Args:
        volume: Of the whole solid.
    """
    size, flats = beside.size, beside.flats
    cuts = [_MOST_CUTS]  # cuts left, in a list because `cut_at_reflex_edges` counts it down
    for part in cut_at_reflex_edges(CutPart(solid, np.zeros((0, 4))), size, flats, True, cuts, volume):
        planes = _list_reflex_planes(part.body, size)
        if not len(planes) or (
            part.body.num_tri() > _FINE_TRIANGLES and _measure_hull_excess(part) < 1e-3 * part.body.volume()
        ):
            yield part
        elif len(planes) <= _MOST_FREE_PLANES:
            yield from cut_at_reflex_edges(part, size, flats, False, cuts, volume)
        else:
            yield from bisect_hollow_part(part, size, volume)


def cut_at_reflex_edges(
    part: CutPart, size: float, flats: Array, only_flats: bool, cuts: list[int], volume: float
) -> Iterator[CutPart]:
    """Cut a part along planes of reflex edges while cuts are left, and yield what needs or allows no more cuts.

    Args:
        size, volume: Of the whole solid, for tolerances.
        flats: Planes n . x = d of flat faces, (k, 4).
        only_flats: Whether to cut only along planes of flat faces.
        cuts: One number, the cuts left; counted down here.
    """
    to_cut = [part]
    least = SLIVER * volume
    while to_cut:
        whole, along = to_cut.pop()  # the body, and the planes of its cuts
        # Cut its connected bodies, or the whole if one is a cavity, of negative volume; tiny ones are rounding.
        bodies = whole.decompose()
        for body in [whole] if any(each.volume() < -least for each in bodies) else bodies:
            if body.volume() < least:
                continue
            each = CutPart(body, along)
            # Take the first of the best planes that leaves volume on both sides. A cavity is also cut through its
            # middle, since planes of reflex edges may miss it.
            planes = _list_cut_planes(body, size, flats, only_flats) if cuts[0] > 0 else []
            for n, d in [*planes[:_TRIES], *_list_cavity_planes(body, least)]:
                halves = each.cut_in_halves(n, d, HAIR * size)
                if min(half.body.volume() for half in halves) > least:
                    cuts[0] -= 1
                    to_cut += halves
                    break
            else:
                yield each


def _list_cavity_planes(body: Any, least: float) -> Iterator[tuple[Array, float]]:
    """Yield planes (n, d) through the middle of a cavity, across its shortest side first; none without a cavity.

    Args:
        least: Bodies of less volume are rounding, [mm^3].
    """
    for each in body.decompose():
        if each.volume() < -least:
            low, high = np.array(each.bounding_box()).reshape(2, 3)
            for axis in np.argsort(high - low):
                yield np.eye(3)[axis], float(low[axis] + high[axis]) / 2.0


def _list_cut_planes(body: Any, size: float, flats: Array, only_flats: bool) -> list[tuple[Array, float]]:
    """Return the planes (n, d) of reflex edges, those with the longest edges first.

    A plane within tolerance of a flat face is replaced by the exact plane of that face.

    Args:
        flats: Planes n . x = d of flat faces, (k, 4).
        only_flats: Whether to leave out planes that are no flat faces.
    """
    planes = []
    for plane in _list_reflex_planes(body, size):
        # Sides of a cut body are rounded, the planes of the original faces are not.
        cosine = flats[:, :3] @ plane[:3]
        same = (np.abs(cosine) > 1.0 - 1e-6) & (np.abs(flats[:, 3] * np.sign(cosine) - plane[3]) < HAIR * size)
        planes += [*flats[same], *([] if only_flats else [plane])][:1]
    return [(plane[:3], float(plane[3])) for plane in planes]


def _measure_hull_excess(part: CutPart) -> float:
    """Return the volume that the hull of a part adds to the part, [mm^3]."""
    return float(part.body.hull().volume() - part.body.volume())


def bisect_hollow_part(part: CutPart, size: float, volume: float, most: int = _MOST_BISECTED) -> list[CutPart]:
    """Bisect a hollow free-form shape until its hulls add little volume.

    Args:
        size, volume: Of the whole solid, for tolerances.
        most: Largest number of parts.
    """
    body = part.body.simplify(min(1e-3 * size, 0.01)) if part.body.num_tri() > _FINE_TRIANGLES else part.body
    parts = [CutPart(each, part.planes) for each in body.decompose()]
    spare = [_measure_hull_excess(each) for each in parts]
    while parts and len(parts) < most and max(spare) > _ROUGH * volume / len(parts):
        # Take the part whose hull adds most; a part that no cut improves counts as done.
        k = int(np.argmax(spare))
        low, high = np.reshape(parts[k].body.bounding_box(), (2, 3))
        halves = cut_through(parts[k], (low + high) / 2.0, np.eye(3), SLIVER * volume, HAIR * size)
        parts[k : k + 1] = halves
        spare[k : k + 1] = (
            [_measure_hull_excess(each) for each in halves] if len(halves) > 1 else [0.0]
        )  # 0 marks it as done
    return parts


def cut_at_shoulders(parts: Iterator[CutPart], shafts: Sequence[Region], size: float) -> Iterator[CutPart]:
    """Cut parts where one round wall ends at another, so that a cylinder and its chamfer are two pieces.

    Args:
        shafts: Round walls of the solid that are no holes.
        size: Of the whole solid, [mm].
    """
    for part in parts:
        # A part with at least six corners on the wall of a shaft is a part of that shaft.
        corners = list_body_corners(part.body)
        mine = [shaft for shaft in shafts if shaft.is_on_wall(corners, 1e-3).sum() >= 6]
        slices = [part]
        if len(mine) > 1:
            # Plane of each end.
            for n, d in ((s.direction, float(s.point @ s.direction) + end) for s in mine for end in s.span):
                slices = [half for each in slices for half in _cut_if_crossed(each, n, d, HAIR * size)]
        yield from slices


def _cut_if_crossed(part: CutPart, n: Array, d: float, hair: float) -> Sequence[CutPart]:
    """Return both halves of a part, or the part alone where the plane misses it.

    Args:
        hair: Distance of a cut from its plane, [mm].
    """
    height = list_body_corners(part.body) @ n - d
    is_beside = height.min() > -10.0 * hair or height.max() < 10.0 * hair
    return (part,) if is_beside else part.cut_in_halves(n, d, hair)


def snap_to_planes(corners: Array, planes: Array, size: float) -> Array:
    """Return corners with those near planes of cuts moved onto these planes."""
    corners = corners.copy()
    # A corner on several planes is projected onto each in turn, repeatedly, as each step moves it off the others a bit.
    for _ in range(4):
        for n, d in zip(planes[:, :3], planes[:, 3], strict=True):
            off = corners @ n - d
            off[np.abs(off) > 3.0 * HAIR * size] = 0.0
            corners -= np.outer(off, n)
    return corners


def _list_reflex_planes(body: Any, size: float) -> Array:
    """Return planes n . x = d of sides at reflex edges, (k, 4), those with the longest edges first.

    Args:
        size: Of the whole solid, for tolerances, [mm].
    """
    mesh = convert_to_mesh(body)
    length = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(length, 1e-300)[:, None]
    # An edge is reflex if the opposite corner of one triangle is above the plane of the other.
    i, k = mesh.neighbours.T
    points = mesh.corners[mesh.triangles[k]] - mesh.corners[mesh.edges[:, 0]][:, None]
    above = (points * normals[i][:, None]).sum(axis=2).max(axis=1)
    sound = (length[i] > 1e-9 * size**2) & (length[k] > 1e-9 * size**2)
    reflex = sound & (above > max(1e-6 * size, 1e-4)) & ((normals[i] * normals[k]).sum(axis=1) < 1.0 - 1e-7)
    if not reflex.any():
        return np.zeros((0, 4))
    ends = mesh.corners[mesh.edges[reflex]]
    sides = np.concatenate([i[reflex], k[reflex]])
    n = normals[sides]
    planes = np.column_stack([n, (n * mesh.corners[mesh.triangles[sides, 0]]).sum(axis=1)])
    # Remove duplicates up to rounding. The score of a plane is the total length of reflex edges in it; at equal scores
    # planes square to an axis of the frame come first.
    _, first = np.unique(np.round(planes * [1e5, 1e5, 1e5, 1e5 / size]), axis=0, return_index=True)
    planes = planes[np.sort(first)][:400]
    inside = (np.abs(ends @ planes[:, :3].T - planes[:, 3]) < 2e-6 * size).all(axis=1)
    score = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) @ inside
    aligned = np.abs(planes[:, :3]).max(axis=1) > 1.0 - 1e-9
    return np.asarray(planes[np.lexsort((~aligned, -np.round(score / size, 6)))])
