"""What is neither flat nor round is taken for neither, drawn, coarse or noisy; what has few sides stays flat."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from apo_bench.cad.drawn_anew import Faces, faces_of
from apo_bench.cad.faces.regions import regions_of
from apo_bench.cad.solids.bodies import mesh_of
from apo_bench.cad.solids.raw_solid import Mesh
from tests.cad.made import block, prism, rod


def ball() -> Any:
    return Manifold.sphere(12, 16).trim_by_plane((0, 0, 1), -6)


def ellipsoid() -> Any:
    return Manifold.sphere(1, 12).scale((20, 14, 10)).trim_by_plane((0, 0, 1), -3)


def torus() -> Any:
    a = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    return Manifold.revolve(CrossSection([np.column_stack([14 + 4 * np.cos(a), 4 * np.sin(a)])]), 18)


def wavy() -> Any:
    """A block with a free surface on top."""
    body = block(40, 30, 10).refine_to_length(8.0)
    return body.warp(lambda p: (p[0], p[1], p[2] + (2 * np.sin(p[0] / 4) * np.cos(p[1] / 5) if p[2] > 9.9 else 0.0)))


def with_fillet() -> Any:
    """A block with a fillet of 5 along one edge."""
    arc = np.radians(np.arange(0, 91, 7.5))
    corners = [(0.0, 0.0), (30.0, 0.0), *((25 + 5 * float(np.cos(a)), 15 + 5 * float(np.sin(a))) for a in arc), (0, 20)]
    return prism(corners, 25)


def faces(body: Any, noise_mm: float) -> Faces:
    mesh = mesh_of(body)
    noise = np.random.default_rng(32).normal(0.0, noise_mm, mesh.corners.shape)
    return faces_of(Mesh(mesh.corners + noise, mesh.triangles), 12)


def walls(found: Faces) -> int:
    """Round faces that go all the way round: those that can touch."""
    return sum(region.is_whole for region in found.regions)


@pytest.mark.parametrize(
    ("draw", "noise_mm"), [(ball, 0.0), (ball, 0.01), (ellipsoid, 0.0), (ellipsoid, 0.01), (wavy, 0.0)]
)
def test_no_free_surface_is_a_wall(draw: Callable[[], Any], noise_mm: float) -> None:
    assert walls(faces(draw(), noise_mm)) == 0


def test_bands_of_a_ring_are_no_walls() -> None:
    regions, _ = regions_of(mesh_of(torus()))
    assert [region.kind for region in regions] == ["other"]


@pytest.mark.parametrize("noise_mm", [0.0, 0.01])
def test_ten_sides_are_flat_faces(noise_mm: float) -> None:
    for body, flats in ((rod(10, 20, n=10), 12), (block(40, 40, 12) - rod(10, 12, n=10), 16)):
        found = faces(body, noise_mm)
        assert walls(found) == 0
        assert sum(region.kind == "plane" for region in found.regions) == flats


@pytest.mark.parametrize("noise_mm", [0.0, 0.01])
def test_a_fillet_is_part_of_a_turn_beside_flat_faces(noise_mm: float) -> None:
    found = faces(with_fillet(), noise_mm)
    (arc,) = [region for region in found.regions if region.is_round]
    assert arc.turn == pytest.approx(np.pi / 2, abs=0.2)
    assert arc.radii[0] == pytest.approx(5.0, abs=0.02 + noise_mm)
    assert sum(region.kind == "plane" for region in found.regions) == 6


def test_sides_that_one_end_has_more_of_are_one_wall() -> None:
    """Corners of both ends at other angles: triangles of uneven width, all of whose corners lie on one circle."""
    low, high = (2.0 * np.pi * np.arange(n) / n for n in (48, 31))
    ends = [np.column_stack([8 * np.cos(a), 8 * np.sin(a), np.full(len(a), z)]) for a, z in ((low, 0.0), (high, 12.0))]
    found = faces(Manifold.hull_points(np.concatenate(ends)), 0.0)
    (wall,) = [region for region in found.regions if region.is_round]
    assert wall.is_whole
    assert wall.radii == pytest.approx((8.0, 8.0), abs=1e-4)
    assert len(found.regions) == 3
