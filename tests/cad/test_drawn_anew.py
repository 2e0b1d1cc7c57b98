"""Meshes with corners inside of their faces, or off them, have the faces of the solid, and the pieces fit to these."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from apo_bench.cad import drawn_anew
from apo_bench.cad.drawn_anew import faces_of
from apo_bench.cad.importing import Imported, import_part, raw_solids
from apo_bench.cad.solids.bodies import mesh_of
from tests.cad.held import hold
from tests.cad.made import MADE, block, rod, write_triangles


def imported(triangles: Any, folder: Path) -> Imported:
    _, (raw,) = raw_solids(write_triangles(triangles, folder / "a.stl"), None)
    return import_part(raw, "a", folder, "a.stl", 8000.0)


def triangles_of(body: Any, noise_mm: float = 0.0) -> Any:
    raw = body.to_mesh()
    points = np.asarray(raw.vert_properties)[:, :3]
    points = points + np.random.default_rng(32).normal(0.0, noise_mm, points.shape) if noise_mm else points
    return points[np.asarray(raw.tri_verts)]


def test_a_subdivided_cylinder_of_twenty_sides_is_round(tmp_path: Path) -> None:
    import trimesh

    mesh = trimesh.creation.cylinder(5, 40, sections=20).subdivide()
    done = imported(mesh.triangles, tmp_path)
    (shaft,) = done.solid.rounds.values()
    assert 1e3 * shaft.radii[0] == pytest.approx(5.0, abs=1e-3)
    assert dict(done.refused) == {}
    assert "triangles were merged" in done.raw.mended[0]


@pytest.mark.parametrize("name", ["turned_plate", "bush", "countersink", "l_profile"])
def test_noise_of_a_hundredth_loses_no_face(name: str, tmp_path: Path) -> None:
    made = MADE[name]()
    done = imported(triangles_of(made.mesh, 0.01), tmp_path)
    hold(done, made._replace(volume=1e9 * done.solid.volume), 0.02)
    assert 1e9 * done.solid.volume == pytest.approx(made.volume, rel=3e-3)
    assert "drawn anew" in done.raw.mended[-1]


def test_corners_anywhere_on_a_wall_are_of_one_wall(tmp_path: Path) -> None:
    """Long edges are cut, then corners shifted on the surface, so that no edge is along the axis."""
    made = MADE["plate"]()
    done = imported(triangles_of(made.mesh.refine_to_length(4.0), 0.003), tmp_path)
    hold(done, made._replace(volume=1e9 * done.solid.volume), 0.02)


def test_a_fine_shaft_with_flats_in_a_file_with_three_decimals_has_no_face_for_each_side(tmp_path: Path) -> None:
    """Corners off by a micrometre turn the narrow sides of a bore by half a degree; the flats end on the wall."""
    chamfered = rod(4.986, 19, n=144) + rod(4.986, 0.486, (0, 0, 19), 4.5, n=144)
    cut = block(20, 8, 12, (0, 8, -1)) + block(20, 8, 12, (0, -8, -1))
    made = (chamfered - cut - rod(2.458, 30, (0, 0, -1), n=144)).refine_to_length(2.0)
    _, (raw,) = raw_solids(write_triangles(triangles_of(made).round(3), tmp_path / "a.stl"), None)
    kinds = [region.kind for region in raw.regions]
    assert (kinds.count("plane"), kinds.count("cylinder"), kinds.count("cone"), len(kinds)) == (6, 2, 1, 9)
    assert sorted(region.radii[0] for region in raw.regions if region.kind == "cylinder") == pytest.approx(
        [2.458, 4.986], abs=1e-3
    )


def test_what_is_fine_as_it_is_stays_as_it_is(tmp_path: Path) -> None:
    assert imported(triangles_of(MADE["bracket"]().mesh), tmp_path).raw.mended == ()


def test_a_free_shape_among_faces_without_corners_inside_is_not_drawn_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = mesh_of(block(40, 40, 12) - Manifold.sphere(20, 160).translate((0, 0, 26)))
    assert len(mesh.triangles) > 1500

    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(drawn_anew, "rough_of", never)
    assert faces_of(mesh, 12).mesh is mesh
