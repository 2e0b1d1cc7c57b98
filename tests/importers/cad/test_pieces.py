"""Pieces keep out of the space beside their solid: others that fit into it as it is drawn fit into them."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from apo_bench.geometry import Hull
from apo_bench.importers.cad.faces.regions import find_regions
from apo_bench.importers.cad.near_points import find_near_points, sample_surface_points
from apo_bench.importers.cad.pieces.convex_cutting import cut_solid
from apo_bench.importers.cad.pieces.hollow_parts import measure_depths
from apo_bench.importers.cad.solids import RawSolid, SolidPlace, convert_to_mesh, name_regions
from tests.importers.cad.made import block


def raw_of(name: str, body: Manifold) -> RawSolid:
    mesh = convert_to_mesh(body)
    return RawSolid(name, mesh, (SolidPlace(name, np.eye(4)),), (), name_regions(mesh, find_regions(mesh)))


def rounded(x: float, y: float, r: float) -> CrossSection:
    return CrossSection.square((2 * x, 2 * y), True).offset(r, circular_segments=40)


def tapered(x: float, y: float, r: float, z: float, top: float, at: float) -> Manifold:
    """Rounded, and wider at its top."""
    return Manifold.extrude(rounded(x, y, r), z, scale_top=(top, top)).translate((0, 0, at))


SOCKET = block(50, 40, 20) - tapered(11, 6, 4.2, 16, 1.05, 5)
PLUG = tapered(11, 6, 4, 15, 1.05, 5.5) + block(50, 40, 8, (0, 0, 20.4))
BOWL = block(40, 40, 12) - Manifold.sphere(20, 48).translate((0, 0, 26))


def misfit(raw: RawSolid, pieces: tuple[Hull, ...]) -> tuple[float, float]:
    """How deep the surface lies inside of a piece at most, and how far off every piece, [mm]."""
    points = sample_surface_points(raw.mesh, 0.5)
    deepest = np.max([measure_depths(points, piece.planes * [1.0, 1.0, 1.0, 1e3]) for piece in pieces], axis=0)
    return float(deepest.max()), float(-deepest.min())


@pytest.mark.parametrize("body", [SOCKET, BOWL], ids=["socket", "bowl"])
def test_pieces_lie_inside_of_a_hollow_solid(body: Manifold) -> None:
    raw = raw_of("part", body)
    out, left = misfit(raw, cut_solid(raw).pieces)
    assert out < 0.025
    assert left < 0.2


def test_what_fits_as_drawn_fits_as_pieces() -> None:
    raws = [raw_of("socket", SOCKET), raw_of("plug", PLUG)]
    near = find_near_points(raws)
    bodies = [
        sum((Manifold.hull_points(1e3 * piece.corners) for piece in cut_solid(raw, others).pieces), Manifold())
        for raw, others in zip(raws, near, strict=True)
    ]
    assert (SOCKET ^ PLUG).volume() == 0.0
    assert (bodies[0] ^ bodies[1]).volume() < 0.01
