"""OBJ files with polygons: triangles cover each polygon once, and volume, faces and sentences are true."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from apo_bench import InputError
from apo_bench.importers.cad.meshes.obj import read_obj
from apo_bench.importers.cad.meshes.shells import split_into_solids
from apo_bench.importers.cad.part_import import read_raw_solids
from tests.importers.cad.made import U_SHAPE, area, prism, write_stl, write_triangles

Ring = Sequence[tuple[float, float]]
PLUS = [(20, 0), (30, 0), (30, 20), (50, 20), (50, 30), (30, 30), (30, 50), (20, 50), (20, 30), (0, 30), (0, 20)]
PLUS = [*PLUS, (20, 20)]


def prism_obj(ring: Ring, height: float, first: int = 0) -> str:
    """A prism whose caps are one polygon each, which begin at a corner of the ring."""
    ring = [*ring[first:], *ring[:first]]
    n = len(ring)
    lines = [f"v {x!r} {y!r} {z!r}" for z in (0.0, height) for x, y in ring]
    faces = [range(n, 0, -1), range(n + 1, 2 * n + 1)]
    sides = [(k + 1, (k + 1) % n + 1, n + (k + 1) % n + 1, n + k + 1) for k in range(n)]
    return "\n".join([*lines, *("f " + " ".join(map(str, face)) for face in (*faces, *sides))]) + "\n"


@st.composite
def simple_polygons(draw: Any) -> list[tuple[float, float]]:
    """Corners at random distances around a point, each angle a little random: no side crosses another one."""
    n = draw(st.integers(4, 24))
    share = st.floats(0.0, 0.6)
    angles = [2.0 * np.pi * (k + draw(share)) / n for k in range(n)]
    radii = draw(st.lists(st.floats(4.0, 40.0), min_size=n, max_size=n))
    return [(float(r * np.cos(a)), float(r * np.sin(a))) for r, a in zip(radii, angles, strict=True)]


@given(simple_polygons(), st.integers(0, 23), st.floats(5.0, 50.0))
def test_any_extruded_polygon_comes_back_with_its_volume(ring: list[tuple[float, float]], at: int, high: float) -> None:
    path = Path("a.obj")
    mesh = read_obj(path, prism_obj(ring, high, at % len(ring)).encode())
    assert len(mesh.triangles) == 4 * len(ring) - 4
    (solid,) = split_into_solids(path, "a", mesh)
    assert solid.mesh.volume == pytest.approx(area(ring) * high, rel=1e-9)
    caps = np.abs(mesh.across[:, 2]).sum() / 2.0
    assert caps == pytest.approx(2.0 * area(ring), rel=1e-9), "triangles of a cap lie side by side"


def test_a_concave_face_that_another_program_cut_into_a_fan_is_refused(tmp_path: Path) -> None:
    """Such a mesh is closed and has the right volume, but its triangles lie on each other."""
    raw = prism(U_SHAPE, 20).to_mesh()
    corners = np.asarray(raw.vert_properties)[:, :3]
    sides = corners[np.asarray(raw.tri_verts)]
    sides = sides[np.ptp(sides[:, :, 2], axis=1) > 0.0]
    ring = np.array(U_SHAPE)
    fans = []
    for z, way in ((0.0, -1), (20.0, 1)):
        cap = np.column_stack([ring, np.full(len(ring), z)])
        fans += [np.array([cap[0], cap[k], cap[k + 1]])[::way] for k in range(1, len(cap) - 1)]
    with pytest.raises(InputError, match="folds back onto itself"):
        read_raw_solids(write_triangles(np.concatenate([sides, fans]), tmp_path / "a.stl"), None)
    assert len(read_raw_solids(write_stl(prism(U_SHAPE, 20), tmp_path / "b.stl"), None)[1]) == 1
