"""A solid that cannot be cut exactly becomes a part with coarser pieces, or its hull, and the report says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.importers.cad import part_import
from apo_bench.importers.cad.fallback import import_solid_anyway, measure_deviation
from apo_bench.importers.cad.meshes.cracks import close_cracks
from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from apo_bench.importers.cad.pieces.convex_cutting import cut_solid
from apo_bench.importers.cad.solids import Mesh
from tests.importers.cad.made import block, rod, write_stl, write_triangles
from tests.importers.cad.test_refused import triangles

TRAY = block(60, 40, 20) - block(40, 30, 15, (0, 0, 5)) - rod(3, 20, (25, 0, 0))


def test_a_solid_whose_surface_crosses_itself_becomes_a_part_and_the_report_says_how_far_it_is_off(
    tmp_path: Path,
) -> None:
    given = triangles(block(20, 20, 20))
    given[(given == (10, 10, 20)).all(axis=2)] = (0, 0, -10)
    _, (raw,) = read_raw_solids(write_triangles(given, tmp_path / "a.stl"), None)
    part = import_solid_anyway(raw, "a", tmp_path, "a.stl")
    assert part.solid.faces
    (repair,) = part.raw.repairs
    assert "stands for the solid in collisions" in repair
    assert "mm off at most" in repair


def test_coarse_pieces_are_exact_at_faces_that_others_come_near(tmp_path: Path) -> None:
    """A lid comes near the rim and the floor of a tray, whose outer ribs are hulls."""
    ribbed = TRAY
    for x in range(-25, 26, 10):
        ribbed = ribbed + block(4, 10, 20, (x, 24, 0))
    _, (raw,) = read_raw_solids(write_stl(ribbed, tmp_path / "a.stl"), None)
    x, y = np.meshgrid(np.linspace(-18, 18, 19), np.linspace(-13, 13, 14))
    others = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    exact = cut_solid(raw, others)
    coarse = cut_solid(raw, others, coarse=True)
    assert coarse.coarse
    assert len(coarse.pieces) < len(exact.pieces)
    part = import_solid(raw, "a", tmp_path, "a.stl", others=others, pieces=coarse)
    floor = next(face for face in part.solid.faces.values() if abs(face.outline[:, 2] - 0.005).max() < 1e-9)
    assert np.ptp(floor.outline[:, 0]) == pytest.approx(0.040, abs=1e-6)
    above = np.column_stack([others[:, :2], np.full(len(others), 6.0)]) * 1e-3
    inside = max(float((p.planes[:, 3] - above @ p.planes[:, :3].T).min(axis=1).max()) for p in part.solid.pieces)
    assert inside < 0.0, "nothing fills the tray"


def test_the_deviation_is_the_depth_of_the_surface_in_the_pieces(tmp_path: Path) -> None:
    _, (raw,) = read_raw_solids(write_stl(TRAY, tmp_path / "a.stl"), None)
    assert measure_deviation(raw, import_solid(raw, "a", tmp_path, "a.stl").solid) < 0.01


def test_a_part_below_the_least_mass_is_simulated_with_it(tmp_path: Path) -> None:
    _, (raw,) = read_raw_solids(write_stl(block(5, 5, 3.2), tmp_path / "a.stl"), "mm")
    part = import_solid(raw, "a", tmp_path, "a.stl")
    assert part.raw.repairs == ("it weighs 0.08 g, and is simulated with 0.1 g",)
    assert 'density="1250"' in (tmp_path / "a.xml").read_text(encoding="utf-8")
    _, (tiny,) = read_raw_solids(write_stl(block(1, 1, 1), tmp_path / "b.stl"), "mm")
    with pytest.raises(InputError, match=r"the part weighs 0\.001 g"):
        import_solid_anyway(tiny, "b", tmp_path, "b.stl")


def test_of_too_many_faces_the_largest_remain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part_import, "MOST_FACES", 6)
    bored = block(40, 30, 10) + block(8, 8, 4, (0, 0, 10)) - rod(3, 10, (12, 0, 0))
    _, (raw,) = read_raw_solids(write_stl(bored, tmp_path / "a.stl"), None)
    part = import_solid(raw, "a", tmp_path, "a.stl")
    assert len(part.solid.faces) == 5
    assert len(part.solid.rounds) == 1
    assert sum("smaller than 6 other faces" in why for why in part.refused.values()) == len(raw.regions) - 6


def test_an_open_solid_among_others_becomes_its_hull(tmp_path: Path) -> None:
    path = write_triangles(triangles(block(20, 20, 20))[:-2], tmp_path / "a.stl")
    with pytest.raises(InputError, match="the shell is open"):
        read_raw_solids(path, "mm")
    _, (raw,) = read_raw_solids(path, "mm", lenient=True)
    assert raw.mesh.volume == pytest.approx(8000)
    assert "its convex hull stands for it" in raw.repairs[0]
    assert len(import_solid_anyway(raw, "a", tmp_path, "a.stl").solid.faces) == 6


def test_a_corner_on_an_edge_divides_the_triangle_beside_it_and_a_hole_stays_open() -> None:
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0]], dtype=float)
    cracked = Mesh(square, np.array([[0, 1, 2], [0, 4, 3], [4, 2, 3]]))
    closed = close_cracks(cracked)
    assert len(closed.triangles) == 4
    assert closed.across.sum(axis=0) == pytest.approx([0, 0, 8])
    counts = np.unique(np.sort(closed.sides, axis=1), axis=0, return_counts=True)[1]
    assert (counts == 1).sum() == 4, "only the outline is open"
    assert close_cracks(replace(closed, triangles=closed.triangles[:3])).triangles.shape == (3, 3)
