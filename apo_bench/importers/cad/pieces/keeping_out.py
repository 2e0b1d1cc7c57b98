"""Parts of a solid whose hulls reach into others where these are, cut on along the faces of those, [mm].

What is drawn line to line has no room for a hull that fills a hollow. The faces of what lies in the hollow say where to
cut: beyond one of them there is nothing of it.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import manifold3d
import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.cut_part import SLIVER, CutPart, bodies_of
from apo_bench.importers.cad.solids.bodies import mesh_of

_DEEP_MM = 0.005
"""Where what hulls have in common with others is less thick, they only touch."""
_MOST_MORE = 200
"""So many pieces more than without others at most."""
_TRIES = 8
_BETTER = 0.8
_FREE = 0.05
"""A cut is worth it that leaves so much less in others, or so much of the part free of them."""
_MOST_LOST = 0.05
_LEFT = 0.01
"""Of a part so much may be trimmed, if no more than this part of what reaches into others is left then."""


def keeping_out(parts: Iterable[CutPart], solid: Any, mates: Any, hair: float) -> Iterator[CutPart]:
    """Parts that are cut on until their hulls reach into no others, as long as there are not too many.

    Args:
        solid: The whole one: where others are inside of that as drawn, nothing is cut.
        mates: All others at their places, as one body.
    """
    least = SLIVER * solid.volume()
    more = _MOST_MORE
    to_cut = [*parts][::-1]
    while to_cut:
        part = to_cut.pop()
        pieces = _apart(part, solid, mates, hair, least) if more > 0 else [part]
        if len(pieces) < 2:
            yield _trimmed(part, solid, mates, hair)
        else:
            more -= len(pieces) - 1
            to_cut += pieces


def _apart(part: CutPart, solid: Any, mates: Any, hair: float, least: float) -> list[CutPart]:
    """A part cut along the face of others that leaves the least of its hulls in them; the part if it is in none."""
    hull = part.body.hull()
    near, own = (_beside(body, hull) for body in (mates, solid))
    into = (hull ^ near) - own
    # A sheet of area A on either side and thickness t has the volume A t and the surface 2 A.
    if into.is_empty() or 2.0 * into.volume() < _DEEP_MM * into.surface_area():
        return [part]
    whole = CutPart(part.body ^ own, part.planes)
    best, smallest = [part], _BETTER * into.volume()
    for n, d in _sides(into):
        bodies = bodies_of(whole.halves(n, d, hair), least)
        left = [((each.body.hull() ^ near) - own).volume() for each in bodies]
        # Around others the first cut takes a side off that is free, and no more.
        free = sum(each.body.volume() for each, more in zip(bodies, left, strict=True) if more < least)
        worth = sum(left) - (free > _FREE * whole.body.volume()) * into.volume() / 2.0
        if len(bodies) > 1 and worth < smallest:
            best, smallest = bodies, worth
    return best


def _trimmed(part: CutPart, solid: Any, mates: Any, hair: float) -> CutPart:
    """The hull of a part less what it reaches into others, if a plane that takes that away takes little else."""
    hull = part.body.hull()
    near, own = (_beside(body, hull) for body in (mates, solid))
    into = (hull ^ near) - own
    if into.is_empty():
        return part
    least = (1.0 - _MOST_LOST) * hull.volume()
    for n, d in _sides(into):
        body = hull.trim_by_plane(n, d + hair)
        if body.volume() > least and ((body ^ near) - own).volume() < _LEFT * into.volume():
            return CutPart(body, part.planes)
    return part


def _beside(body: Any, hull: Any) -> Any:
    """What of a body lies in the box around a hull."""
    low, high = np.reshape(hull.bounding_box(), (2, 3))
    return body ^ manifold3d.Manifold.cube(high - low).translate(low)


def _sides(body: Any) -> Iterator[tuple[Array, float]]:
    """Planes of the sides of a body, each once, those with most of its surface in them first."""
    mesh = mesh_of(body)
    length = np.linalg.norm(mesh.across, axis=1)
    known = length > 0.0
    n = mesh.across[known] / length[known, None]
    planes = np.column_stack([n, (n * mesh.corners[mesh.triangles[known, 0]]).sum(axis=1)])
    _, first, which = np.unique(np.round(planes, 3), axis=0, return_index=True, return_inverse=True)
    size = np.bincount(which.ravel(), length[known])
    yield from ((planes[k, :3], float(planes[k, 3])) for k in first[np.argsort(-size, kind="stable")][:_TRIES])
