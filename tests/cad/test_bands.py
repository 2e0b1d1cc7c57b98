"""Bands of balls, rings and fillets are no cones, however fine they are; true cones stay, coarse, fine and noisy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from apo_bench.cad.drawn_anew import faces_of
from apo_bench.cad.faces.bands import without_bands
from apo_bench.cad.faces.patch import rough_of
from apo_bench.cad.faces.regions import regions_of
from apo_bench.cad.faces.rough import patches_of
from apo_bench.cad.solids.bodies import mesh_of
from apo_bench.cad.solids.raw_solid import Mesh
from tests.cad.made import block, rod


def ball() -> Any:
    return trimesh.creation.icosphere(3, 10)


def uv_ball() -> Any:
    return trimesh.creation.uv_sphere(10, count=[16, 16])


def ellipsoid() -> Any:
    drawn: Any = trimesh.creation.icosphere(3, 10)
    return drawn.apply_scale([1.5, 1.0, 0.7])


def flat_ball() -> Any:
    drawn: Any = trimesh.creation.uv_sphere(10, count=[32, 16])
    return drawn.apply_scale([1.0, 1.0, 0.7])


def torus() -> Any:
    return trimesh.creation.torus(14, 4)


def mesh_like(drawn: Any) -> Mesh:
    return Mesh(np.asarray(drawn.vertices, dtype=float), np.asarray(drawn.faces))


@pytest.mark.parametrize("draw", [ball, uv_ball, ellipsoid, flat_ball, torus])
def test_a_ball_is_no_cone(draw: Callable[[], Any]) -> None:
    rough = rough_of(mesh_like(draw()), 0.045, 12)
    assert [patch.surface for patch in without_bands(rough, patches_of(rough), 12)] == [None]


@pytest.mark.parametrize("draw", [ball, uv_ball])
def test_a_ball_does_not_take_long(draw: Callable[[], Any]) -> None:
    found = faces_of(mesh_like(draw()), 12)
    assert [region.kind for region in found.regions] == ["other"]
    assert found.said == ()  # not even that it took too long to draw it anew


def filleted() -> Any:
    """A disc and a pin, and a fillet of 3 mm between them."""
    arc = np.radians(np.arange(0, 91, 15))
    fillet = [(8 - 3 * np.sin(a), 7 - 3 * np.cos(a)) for a in arc]
    ring = [(0.0, 0.0), (12.0, 0.0), (12.0, 4.0), *fillet, (5.0, 20.0), (0.0, 20.0)]
    return Manifold.revolve(CrossSection([np.array(ring)]), 48)


def test_a_fillet_between_a_plane_and_a_pin_is_no_cone() -> None:
    regions, _ = regions_of(mesh_of(filleted()))
    walls = [region for region in regions if region.is_round]
    assert sorted(wall.radii[0] for wall in walls) == pytest.approx([5.0, 12.0])
    assert Counter(region.kind for region in regions) == {"plane": 3, "cylinder": 2, "other": 1}


def frustum() -> Any:
    return rod(10, 12, top=6, n=12)


def sunk() -> Any:
    """A hole with a countersink."""
    return block(40, 40, 20) - rod(4, 16) - rod(4, 4.0, (0, 0, 16), 8)


def chamfered() -> Any:
    return rod(4, 20, n=32) + rod(4, 0.3, (0, 0, 20), 3.7, n=32)


def tapered() -> Any:
    """From one cylinder to the next one, at an angle of 14 degrees."""
    return rod(6, 10, n=48) + rod(6, 8, (0, 0, 10), 4, n=48) + rod(4, 10, (0, 0, 18), n=48)


def twice_tapered() -> Any:
    """Walls of the same length that bend more and more."""
    return rod(6, 12, n=48) + rod(6, 12, (0, 0, 12), 4.5, n=48) + rod(4.5, 12, (0, 0, 24), 2, n=48)


CONES = [(frustum, [(10, 6)]), (sunk, [(4, 8)]), (chamfered, [(4, 3.7)]), (tapered, [(6, 4)])]


@pytest.mark.parametrize(("draw", "radii"), CONES)
@pytest.mark.parametrize("noise_mm", [0.0, 0.01])
def test_a_cone_stays_a_cone(draw: Callable[[], Any], radii: list[tuple[float, float]], noise_mm: float) -> None:
    assert cones(draw(), noise_mm) == pytest.approx(np.array(radii), abs=0.02)


@pytest.mark.parametrize(("draw", "radii"), [*CONES[1:], (twice_tapered, [(6, 4.5), (4.5, 2)])])
@pytest.mark.parametrize("noise_mm", [0.0, 0.005])
def test_a_fine_cone_stays_a_cone(draw: Callable[[], Any], radii: list[tuple[float, float]], noise_mm: float) -> None:
    assert cones(draw().refine_to_length(2.5), noise_mm) == pytest.approx(np.array(radii), abs=0.02)


def cones(body: Any, noise_mm: float) -> Any:
    """Radii of cones that go all the way round, (k, 2)."""
    mesh = mesh_of(body)
    noise = np.random.default_rng(3).normal(0.0, noise_mm, mesh.corners.shape)
    found = faces_of(Mesh(mesh.corners + noise, mesh.triangles), 12)
    return np.array([r.radii for r in found.regions if r.kind == "cone" and r.is_whole])
