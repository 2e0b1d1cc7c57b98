"""How far meshes overlap: known depths, laws of measures, and the mesh that is kept beside a part file."""

from __future__ import annotations

import os
import tracemalloc
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.cad.solids.drawn import drawn_mesh, keep_drawn, overlap
from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.geometry import Array, pose
from tests.cad.made import block, rod


def mesh_of(solid: Any) -> Mesh:
    made = solid.to_mesh64()
    return Mesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(int))


def at(x: float, y: float, z: float, *turn: float) -> Array:
    return pose.at(1e-3 * np.array([x, y, z]), turn or (0, 0, 0))


CUBE = mesh_of(block(20, 20, 20))
NOWHERE = at(0, 0, 0)


@pytest.mark.parametrize(("gap", "depth"), [(0.3, 0.0), (0.0, 0.0), (-0.5, 0.5), (-3.0, 3.0)])
def test_boxes_are_as_deep_in_each_other_as_they_were_pushed(gap: float, depth: float) -> None:
    found = overlap(CUBE, NOWHERE, CUBE, at(2, -1, 20 + gap))
    assert found is not None
    assert 1e3 * found.depth_m == pytest.approx(depth, abs=1e-6)
    assert not depth or 0.020 + 1e-3 * gap - 1e-9 <= found.at[2] <= 0.020 + 1e-9


def test_a_rod_that_is_too_thick_is_as_deep_as_its_wall_is_behind_that_of_the_hole() -> None:
    ring = mesh_of(block(30, 30, 10) - rod(4.9, 10))
    found = overlap(ring, NOWHERE, mesh_of(rod(5.0, 30, (0, 0, -10))), NOWHERE)
    assert found is not None
    assert 1e3 * found.depth_m == pytest.approx(0.1, abs=5e-3)  # less at the middle of a facet


def test_a_rod_through_a_block_is_deep_though_no_corner_of_either_is_in_the_other() -> None:
    found = overlap(CUBE, NOWHERE, mesh_of(rod(5.0, 60, (0, 0, -20))), NOWHERE)
    assert found is not None
    assert 1e3 * found.depth_m > 5.0


def test_order_and_place_do_not_matter() -> None:
    a, b = CUBE, mesh_of(rod(5.0, 30, (0, 0, -29)))
    moved = at(300, -40, 25, 20, -35, 70)
    first = overlap(a, NOWHERE, b, NOWHERE)
    for again in (overlap(b, NOWHERE, a, NOWHERE), overlap(a, moved, b, moved)):
        assert first is not None
        assert again is not None
        assert again.depth_m == pytest.approx(first.depth_m, rel=0.05)


def test_what_makes_no_solid_is_not_measured() -> None:
    assert overlap(Mesh(CUBE.corners, CUBE.triangles[1:]), NOWHERE, CUBE, NOWHERE) is None


def test_a_mesh_is_kept_beside_its_part_file(tmp_path: Path) -> None:
    part = tmp_path / "cube.xml"
    assert drawn_mesh(part) is None
    keep_drawn(CUBE, part)
    kept = drawn_mesh(part)
    assert kept is not None
    assert (kept.corners == CUBE.corners).all()
    assert (kept.triangles == CUBE.triangles).all()


def packed(corners: Any, triangles: Any) -> bytes:
    out = BytesIO()
    np.savez_compressed(out, corners=corners, triangles=triangles)
    return out.getvalue()


def claims(shape: str) -> bytes:
    """An archive whose triangles state another shape than they have."""
    raw = packed(CUBE.corners, CUBE.triangles.astype(np.int32))
    out = BytesIO()
    with ZipFile(BytesIO(raw)) as old, ZipFile(out, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"(12, 3)", shape.encode()))
    return out.getvalue()


INDEX = CUBE.triangles.astype(np.int32)
WRONG: dict[str, Callable[[], bytes]] = {
    "no archive": lambda: b"no archive",
    "nothing": lambda: b"",
    "text": lambda: packed(np.array([["a", "b", "c"]]), INDEX),
    "objects": lambda: packed(np.array([[1, "b", None]], dtype=object), INDEX),
    "no triangles": lambda: packed(CUBE.corners, INDEX[:0]),
    "no corners": lambda: packed(CUBE.corners[:0], INDEX),
    "a corner that is not there": lambda: packed(CUBE.corners, INDEX + 1),
    "a corner before the first": lambda: packed(CUBE.corners, INDEX - 1),
    "no number": lambda: packed(np.full_like(CUBE.corners, np.nan), INDEX),
    "fractions": lambda: packed(CUBE.corners, CUBE.triangles.astype(float)),
    "pairs": lambda: packed(CUBE.corners[:, :2], INDEX),
    "one number": lambda: packed(np.float64(1.0), INDEX),
    "other names": lambda: packed(CUBE.corners, INDEX).replace(b"triangles.npy", b"triangle1.npy"),
    "a shape of a terabyte": lambda: claims("(99999999999, 3)"),
    "a negative shape": lambda: claims("(-1, 3)"),
    "a shape that is no shape": lambda: claims("(12, x)"),
    "60 MB in a small archive": lambda: packed(np.zeros((60_000_000 // 24, 3)), INDEX),
    "larger than any": lambda: bytes(20_000_001),
    "cut short": lambda: packed(CUBE.corners, INDEX)[:-30],
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_mesh_is_refused_in_one_sentence_and_little_memory(case: str, tmp_path: Path) -> None:
    part = tmp_path / "cube.xml"
    (tmp_path / "cube.drawn.npz").write_bytes(WRONG[case]())
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"no mesh that an import kept|larger than 20 MB") as raised:
            drawn_mesh(part)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "\n" not in str(raised.value)
    assert peak < 45e6


def test_a_pipe_or_a_link_to_nothing_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.drawn.npz")
    with pytest.raises(InputError, match="a pipe was given"):
        drawn_mesh(tmp_path / "a.xml")
    (tmp_path / "b.drawn.npz").symlink_to(tmp_path / "nothing")
    with pytest.raises(InputError, match="cannot be read"):
        drawn_mesh(tmp_path / "b.xml")
