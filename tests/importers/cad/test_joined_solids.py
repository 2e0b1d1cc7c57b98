"""Solids of one component, such as the balls and rings of a bearing, are one part; those farther apart are several."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from tests.importers.cad.made import block, rod, write_triangles

RING = rod(15, 8) - rod(12, 10, (0, 0, -1))
BEARING = (RING, RING.scale((0.5, 0.5, 1.0)), rod(1.4, 6, (9.75, 0, 1)), rod(1.4, 6, (-9.75, 0, 1)))
"""Two rings and two rollers, each 0.85 mm away from both rings."""
APART = block(6, 6, 6, (40, 0, 0))


def write_bodies(path: Path, *bodies: Manifold) -> Path:
    meshes = [body.to_mesh() for body in bodies]
    whole = trimesh.util.concatenate([trimesh.Trimesh(m.vert_properties, m.tri_verts) for m in meshes])
    return write_triangles(whole.triangles, path)


def test_near_solids_of_a_component_are_one_part_which_can_be_used(tmp_path: Path) -> None:
    path = write_bodies(tmp_path / "bearing.stl", *BEARING)
    assert len(read_raw_solids(path, "mm")[1]) == 3, "two rings, and rollers of one shape"
    (raw,) = read_raw_solids(path, "mm", is_component=True)[1]
    assert raw.mesh.volume == pytest.approx(sum(body.volume() for body in BEARING), rel=1e-6)
    part = import_solid(raw, "bearing", tmp_path, "bearing.stl")
    np.testing.assert_allclose(np.ptp(part.solid.bounds, axis=0), (0.030, 0.030, 0.008), atol=1e-5)


def test_a_solid_that_is_farther_away_is_a_part_of_its_own_shape(tmp_path: Path) -> None:
    path = write_bodies(tmp_path / "set.stl", *BEARING, APART)
    raws = read_raw_solids(path, "mm", is_component=True)[1]
    assert [raw.name for raw in raws] == ["set_1", "set_2"]
    assert min(raw.mesh.volume for raw in raws) == pytest.approx(APART.volume(), rel=1e-6)


def test_a_step_component_of_two_solids_is_one_part(tmp_path: Path) -> None:
    build123d = pytest.importorskip("build123d")
    box, pos = build123d.Box, build123d.Pos
    servo = build123d.Compound(label="servo", obj=[box(20, 20, 20), pos(0, 0, 15) * box(5, 5, 10)])
    plate = pos(0, 0, -15) * box(40, 40, 10)
    plate.label = "plate"
    path = tmp_path / "a.step"
    build123d.export_step(build123d.Compound(label="all", children=[plate, servo]), path)
    raws = {raw.name: raw for raw in read_raw_solids(path, None)[1]}
    assert set(raws) == {"plate", "servo"}
    assert raws["servo"].mesh.volume == pytest.approx(20**3 + 5 * 5 * 10, rel=1e-6)
    assert "py" in raws["servo"].named()
