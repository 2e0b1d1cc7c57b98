"""A CAD file of several solids: those that touch, one with a cavity, copies; frames at the parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from apo_bench.geometry import pose
from apo_bench.importers.assembly.from_cad import import_parts
from apo_bench.importers.assembly.posed_parts import read_posed
from tests.importers.cad.made import block, rod


def stl(folder: Path, *solids: object) -> Path:
    """All solids in one file, whether they touch or not."""
    meshes = [solid.to_mesh() for solid in solids]  # type: ignore[attr-defined]
    path = folder / "pile.stl"
    trimesh.util.concatenate([trimesh.Trimesh(m.vert_properties, m.tri_verts) for m in meshes]).export(path)
    return path


def test_solids_that_touch_are_parts_with_frames_of_their_own(tmp_path: Path) -> None:
    base = block(60, 40, 10, (100, 0, 0)) - rod(6, 10, (100, 0, 0))
    lid = block(40, 30, 8, (100, 0, 10))
    poses, said, _ = import_parts([stl(tmp_path, base, lid)], tmp_path / "parts")
    assert len(said) == 2
    parts = {each.name: each for each in read_posed(poses)}
    places = {each.solid.volume: 1e3 * each.T[:3, 3] for each in parts.values()}
    small, large = sorted(places)
    assert small == pytest.approx(40 * 30 * 8e-9, rel=1e-6)
    np.testing.assert_allclose(places[small], (100, 0, 10), atol=1e-3)
    np.testing.assert_allclose(places[large], (100, 0, 0), atol=1e-3)
    for each in parts.values():
        middle = pose.apply(each.T, each.solid.centroid[None])[0]
        np.testing.assert_allclose(1e3 * middle[:2], (100, 0), atol=1e-3)
    wall = next(w for each in parts.values() for w in each.solid.rounds.values())
    np.testing.assert_allclose(wall.ends[:, :2], 0.0, atol=1e-5)
    np.testing.assert_allclose(sorted(wall.ends[:, 2]), (0, 0.01), atol=1e-6)


def test_the_frame_of_a_turned_part_lies_on_its_axis(tmp_path: Path) -> None:
    """With 41 facets the middle of the box is off the axis by a part of their sagitta."""
    pin = Manifold.cylinder(30, 8, 8, 41).translate((20, 5, 10))
    poses, _, _ = import_parts([stl(tmp_path, block(90, 60, 10, (0, 0, 0)), pin)], tmp_path / "parts")
    found = next(each for each in read_posed(poses) if each.solid.rounds)
    np.testing.assert_allclose(1e3 * found.T[:3, 3], (20, 5, 10), atol=1.1e-3)
