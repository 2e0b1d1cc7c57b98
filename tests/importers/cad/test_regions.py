"""Planes, cylinders and cones in exact meshes; bands of balls, rings and fillets are none; few sides stay flat."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from apo_bench.importers.cad.faces.regions import find_regions
from apo_bench.importers.cad.meshes.shells import closed_solids
from apo_bench.importers.cad.solids import Mesh, Region, convert_to_mesh
from tests.importers.cad.made import block, prism, rod


def found(drawn: Any) -> tuple[Region, ...]:
    """The faces of a solid, once corners in flat pieces are left out."""
    is_body = isinstance(drawn, Manifold)
    mesh = convert_to_mesh(drawn) if is_body else Mesh(np.asarray(drawn.vertices, dtype=float), np.asarray(drawn.faces))
    (solid,) = closed_solids(Path("a.stl"), "a", mesh)
    return find_regions(solid.mesh)


def flat_ball() -> Any:
    drawn: Any = trimesh.creation.uv_sphere(10, count=[32, 16])
    return drawn.apply_scale([1.0, 1.0, 0.7])


def ellipsoid() -> Any:
    return Manifold.sphere(1, 12).scale((20, 14, 10)).trim_by_plane((0, 0, 1), -3)


def torus() -> Any:
    a = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    return Manifold.revolve(CrossSection([np.column_stack([14 + 4 * np.cos(a), 4 * np.sin(a)])]), 18)


def ball() -> Any:
    return trimesh.creation.icosphere(3, 10)


def wavy() -> Any:
    """A block with a free surface on top."""
    body = block(40, 30, 10).refine_to_length(8.0)
    return body.warp(lambda p: (p[0], p[1], p[2] + (2 * np.sin(p[0] / 4) * np.cos(p[1] / 5) if p[2] > 9.9 else 0.0)))


@pytest.mark.parametrize("draw", [ball, flat_ball, ellipsoid, torus, wavy])
def test_no_free_surface_is_a_wall(draw: Callable[[], Any]) -> None:
    regions = found(draw())
    assert not any(region.is_round for region in regions)
    assert any(region.kind == "other" for region in regions)


def filleted() -> Any:
    """A disc and a pin, and a fillet of 3 mm between them."""
    arc = np.radians(np.arange(0, 91, 15))
    fillet = [(8 - 3 * np.sin(a), 7 - 3 * np.cos(a)) for a in arc]
    ring = [(0.0, 0.0), (12.0, 0.0), (12.0, 4.0), *fillet, (5.0, 20.0), (0.0, 20.0)]
    return Manifold.revolve(CrossSection([np.array(ring)]), 48)


def test_a_fillet_between_a_plane_and_a_pin_is_no_cone() -> None:
    regions = found(filleted())
    assert sorted(wall.radii[0] for wall in regions if wall.is_round) == pytest.approx([5.0, 12.0])
    assert Counter(region.kind for region in regions) == {"plane": 3, "cylinder": 2, "other": 1}


def test_a_fillet_is_part_of_a_turn_beside_flat_faces() -> None:
    arc = np.radians(np.arange(0, 91, 7.5))
    corners = [(0.0, 0.0), (30.0, 0.0), *((25 + 5 * float(np.cos(a)), 15 + 5 * float(np.sin(a))) for a in arc), (0, 20)]
    regions = found(prism(corners, 25))
    (wall,) = [region for region in regions if region.is_round]
    assert wall.turn == pytest.approx(np.pi / 2, abs=0.2)
    assert wall.radii[0] == pytest.approx(5.0, abs=0.02)
    assert sum(region.kind == "plane" for region in regions) == 6


CONES: dict[str, tuple[Callable[[], Any], list[tuple[float, float]]]] = {
    "countersink": (lambda: block(40, 40, 20) - rod(4, 16) - rod(4, 4.0, (0, 0, 16), 8), [(4, 8)]),
    "chamfer": (lambda: rod(4, 20, n=32) + rod(4, 0.3, (0, 0, 20), 3.7, n=32), [(4, 3.7)]),
    "between cylinders": (
        lambda: rod(6, 10, n=48) + rod(6, 8, (0, 0, 10), 4, n=48) + rod(4, 10, (0, 0, 18), n=48),
        [(6, 4)],
    ),
}


@pytest.mark.parametrize("is_fine", [False, True])
@pytest.mark.parametrize("name", CONES)
def test_a_cone_stays_a_cone_also_if_it_was_subdivided(name: str, is_fine: bool) -> None:
    draw, radii = CONES[name]
    body = draw().refine_to_length(2.5) if is_fine else draw()
    cones = np.array([r.radii for r in found(body) if r.kind == "cone" and r.is_whole])
    assert cones == pytest.approx(np.array(radii), abs=0.02)


def test_sides_that_one_end_has_more_of_are_one_wall() -> None:
    """Corners of both ends at other angles: triangles of uneven width, all of whose corners lie on one circle."""
    low, high = (2.0 * np.pi * np.arange(n) / n for n in (48, 31))
    ends = [np.column_stack([8 * np.cos(a), 8 * np.sin(a), np.full(len(a), z)]) for a, z in ((low, 0.0), (high, 12.0))]
    regions = found(Manifold.hull_points(np.concatenate(ends)))
    (wall,) = [region for region in regions if region.is_round]
    assert wall.is_whole
    assert wall.radii == pytest.approx((8.0, 8.0), abs=1e-4)
    assert len(regions) == 3
