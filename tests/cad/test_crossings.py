"""A surface that crosses itself by a hair is moved apart, and it is said how far; by more it is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from apo_bench.cad.importing import import_part, raw_solids
from apo_bench.errors import InputError
from tests.cad.made import write_triangles


def slotted(overlap: float, folder: Path) -> Path:
    """A block with a slot whose lips go through each other at its mouth by so much, [mm]."""
    left, right = 10.0 + overlap / 2.0, 10.0 - overlap / 2.0
    outline = [(0, 0), (20, 0), (20, 10), (right, 10), (10.5, 3), (9.5, 3), (left, 10), (0, 10)]
    sides = [[0, 1, 4], [0, 4, 5], [1, 2, 4], [2, 3, 4], [0, 5, 7], [5, 6, 7]]
    solid = trimesh.creation.extrude_triangulation(np.array(outline), np.array(sides), 12.0)
    return write_triangles(np.asarray(solid.triangles), folder / "a.stl")


def test_a_hair_is_mended(tmp_path: Path) -> None:
    _, (raw,) = raw_solids(slotted(0.002, tmp_path), "mm")
    (said,) = raw.mended
    assert said == "corners were moved by up to 0.0022 mm where the surface crossed itself"
    assert sum(region.kind == "plane" for region in raw.regions) == 10
    done = import_part(raw, "a", tmp_path, "a.stl", 8000.0)
    assert 1e9 * done.solid.volume == pytest.approx(12.0 * (200.0 - 7.0 * 0.5), rel=1e-3)


def test_more_than_a_hair_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the surface crosses itself at"):
        raw_solids(slotted(0.5, tmp_path), "mm")
