"""Pieces keep out of the space beside their solid: others that fit into it as it is drawn fit into them."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from scipy.spatial import ConvexHull

from apo_bench.cad.assembled import coming_near
from apo_bench.cad.faces.regions import regions_of
from apo_bench.cad.pieces import refining
from apo_bench.cad.pieces.cut_part import CutPart
from apo_bench.cad.pieces.cutting import cut
from apo_bench.cad.pieces.misfit import Misfit, misfit, surface_points
from apo_bench.cad.solids.bodies import mesh_of
from apo_bench.cad.solids.naming import with_names
from apo_bench.cad.solids.raw_solid import RawSolid, SolidPlace
from apo_bench.geometry import Hull
from tests.cad.made import block, rod


def raw_of(name: str, body: Manifold) -> RawSolid:
    mesh = mesh_of(body)
    regions, facets = regions_of(mesh)
    return RawSolid(name, mesh, (SolidPlace(name, np.eye(4)),), (), with_names(mesh, regions), facets)


def rounded(x: float, y: float, r: float) -> CrossSection:
    return CrossSection.square((2 * x, 2 * y), True).offset(r, circular_segments=40)


def tapered(x: float, y: float, r: float, z: float, top: float, at: float) -> Manifold:
    """Rounded, and wider at its top."""
    return Manifold.extrude(rounded(x, y, r), z, scale_top=(top, top)).translate((0, 0, at))


SOCKET = block(50, 40, 20) - tapered(11, 6, 4.2, 16, 1.05, 5)
PLUG = tapered(11, 6, 4, 15, 1.05, 5.5) + block(50, 40, 8, (0, 0, 20.4))
BOWL = block(40, 40, 12) - Manifold.sphere(20, 48).translate((0, 0, 26))


def cube(low: float, high: float) -> Hull:
    return Hull("", 1e-3 * np.array([[x, y, z] for x in (low, high) for y in (low, high) for z in (low, high)]))


@pytest.mark.parametrize(("off", "true"), [(0.0, (0.0, 0.0)), (0.2, (0.2, 0.0)), (-0.3, (0.0, 0.3))])
def test_what_sticks_out_and_what_is_left_out_is_measured(off: float, true: tuple[float, float]) -> None:
    points = surface_points(mesh_of(Manifold.cube((10, 10, 10))))
    found = misfit(points, [cube(-off, 10 + off)])
    # In the middle of a face the cube is off by as much as it grew; at a corner it is that far along each axis.
    assert found == pytest.approx(Misfit(*true), abs=1e-9)


def test_a_slot_that_a_piece_fills_counts_as_deep_as_it_is() -> None:
    slotted = block(20, 10, 10) - block(4, 10, 3, (0, 0, 7))
    hull = Hull("", 1e-3 * np.array([[x, y, z] for x in (-10, 10) for y in (-5, 5) for z in (0, 10)]))
    assert misfit(surface_points(mesh_of(slotted)), [hull]).out == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("body", [SOCKET, BOWL], ids=["socket", "bowl"])
def test_pieces_lie_inside_of_a_hollow_solid(body: Manifold) -> None:
    raw = raw_of("part", body)
    pieces = cut(raw).pieces
    found = misfit(surface_points(raw.mesh), pieces)
    assert found.out < 0.025
    assert found.left < 0.2


def test_what_fits_as_drawn_fits_as_pieces() -> None:
    raws = [raw_of("socket", SOCKET), raw_of("plug", PLUG)]
    near = coming_near(raws)
    bodies = [
        sum((Manifold.hull_points(1e3 * piece.corners) for piece in cut(raw, others).pieces), Manifold())
        for raw, others in zip(raws, near, strict=True)
    ]
    assert (SOCKET ^ PLUG).volume() == 0.0
    assert (bodies[0] ^ bodies[1]).volume() < 0.01


def test_others_are_followed_along_ways_that_are_free() -> None:
    raws = [raw_of("plate", block(60, 40, 20) - rod(5.3, 20)), raw_of("pin", rod(5, 10))]
    of_plate, of_pin = coming_near(raws)
    # The pin leaves its hole upwards and downwards, so all of the wall is passed; sideways it would strike.
    assert of_plate[:, 2].max() > 19.0
    assert np.hypot(*of_plate[:, :2].T).max() < 5.6
    assert len(of_pin)


def test_hulls_are_not_trimmed_where_that_takes_them_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def shrunk(part: CutPart, _: object) -> CutPart:
        middle = np.array(part.body.bounding_box()).reshape(2, 3).mean(axis=0)
        return part._replace(body=part.body.translate(-middle).scale((0.9, 0.9, 0.9)).translate(middle))

    monkeypatch.setattr(refining, "_within", shrunk)
    body = block(40, 40, 4) + block(20, 20, 9)
    pieces = cut(raw_of("a", body)).pieces
    assert sum(ConvexHull(1e3 * piece.corners).volume for piece in pieces) == pytest.approx(body.volume(), rel=1e-4)
