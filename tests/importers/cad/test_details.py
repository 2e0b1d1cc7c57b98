"""What an import rests on: corners, outlines and walls to the last digit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench.importers.cad.faces.surface_fitting import RoundSurface
from apo_bench.importers.cad.part_import import read_raw_solids
from apo_bench.importers.cad.step.from_brep import raw_of
from apo_bench.importers.cad.step.surfaces import BrepFace, BrepSolid, Plane
from tests.importers.cad.made import block, rod, write_triangles


def triangles(mesh: Any) -> Any:
    raw = mesh.to_mesh()
    return np.asarray(raw.vert_properties)[:, :3][np.asarray(raw.tri_verts)]


def test_corners_that_nearly_meet_are_joined(tmp_path: Path) -> None:
    near = triangles(block(20, 20, 20)).astype(np.float32)
    near[0, 0, 0] = np.nextafter(near[0, 0, 0], np.float32(100.0))
    _, (raw,) = read_raw_solids(write_triangles(near, tmp_path / "a.stl"), None)
    assert raw.mesh.volume == pytest.approx(8000.0)


def as_brep(body: Any) -> BrepSolid:
    """A body with one round wall of radius 5 about the z axis, as the reader of STEP files may give it.

    Normals of flat faces look into the part, as the planes of a file may.
    """
    corners = triangles(body).astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = across / np.linalg.norm(across, axis=1)[:, None]
    reach = np.hypot(*corners.mean(axis=1)[:, :2].T)
    wall = (np.abs(reach - 5.0) < 0.01) & (np.abs(normals[:, 2]) < 0.1)
    index = np.arange(3 * len(corners)).reshape(-1, 3)
    z = np.array([0.0, 0.0, 1.0])
    round_face = BrepFace(
        RoundSurface(np.zeros(3), z, 5.0, 0.0), 0.0, corners[wall].reshape(-1, 3), index[: wall.sum()]
    )
    flat = [BrepFace(Plane(p[0], -n), 0.0, p, index[:1]) for p, n in zip(corners[~wall], normals[~wall], strict=True)]
    return BrepSolid("a", (round_face, *flat), ())


@pytest.mark.parametrize("hole", [False, True])
def test_a_wall_of_a_step_file_becomes_strips_that_look_out_of_the_part(hole: bool, tmp_path: Path) -> None:
    """Its wall has corners at half height, which strips from end to end leave out."""
    two = rod(5.0, 10.0) + rod(5.0, 10.0, (0, 0, 10))
    body = block(30, 20, 20) - two if hole else two
    raw = raw_of(tmp_path / "a.step", as_brep(body))
    assert raw.mesh.volume == pytest.approx(body.volume(), rel=1e-7)
    (wall,) = (region for region in raw.regions if region.is_round)
    assert (wall.hole, wall.is_whole, wall.square) == (hole, True, True)
    assert wall.radii == (5.0, 5.0)
    heights = np.unique(np.round(raw.mesh.corners[np.unique(raw.mesh.triangles[wall.triangles])][:, 2], 6))
    assert heights.tolist() == [0.0, 20.0]
    outward = raw.mesh.across[wall.triangles] * raw.mesh.corners[raw.mesh.triangles[wall.triangles]].mean(axis=1)
    assert (np.sign(outward[:, :2].sum(axis=1)) == (-1.0 if hole else 1.0)).all()
    top = raw.named()["pz"]
    assert top.direction.tolist() == [0.0, 0.0, 1.0]
    assert top.point[2] == pytest.approx(20.0)
