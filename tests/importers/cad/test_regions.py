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
from apo_bench.importers.cad.meshes.shells import split_into_solids
from apo_bench.importers.cad.solids import Mesh, Region, convert_to_mesh
from tests.importers.cad.made import block, rod


def found(drawn: Any) -> tuple[Region, ...]:
    """The faces of a solid, once corners in flat pieces are left out."""
    is_body = isinstance(drawn, Manifold)
    mesh = convert_to_mesh(drawn) if is_body else Mesh(np.asarray(drawn.vertices, dtype=float), np.asarray(drawn.faces))
    (solid,) = split_into_solids(Path("a.stl"), "a", mesh)
    return find_regions(solid.mesh)


def flat_ball() -> Any:
    drawn: Any = trimesh.creation.uv_sphere(10, count=[32, 16])
    return drawn.apply_scale([1.0, 1.0, 0.7])


def ellipsoid() -> Any:
    return Manifold.sphere(1, 12).scale((20, 14, 10)).trim_by_plane((0, 0, 1), -3)


def torus() -> Any:
    a = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    return Manifold.revolve(CrossSection([np.column_stack([14 + 4 * np.cos(a), 4 * np.sin(a)])]), 18)


@pytest.mark.parametrize("draw", [flat_ball, ellipsoid, torus])
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
