"""The turns after which a part looks the same: golden orders, the laws of a group, and voxels that are turned."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench.geometry import Array, Box, Solid, count_folds, find_symmetries, list_quarter_turns, pose
from apo_bench.geometry.symmetry_search import is_symmetry
from tests import scenes

pytestmark = pytest.mark.numeric

UNIT_M = 0.01
"""Side of a voxel."""
CORNERS = st.tuples(*[st.integers(0, 3)] * 3)
SIZES = st.tuples(*[st.integers(1, 2)] * 3)


def voxels(boxes: list[tuple[tuple[int, ...], tuple[int, ...]]]) -> set[tuple[int, ...]]:
    """The unit cells of a union of boxes, each a lowest corner and a size."""
    return {
        tuple(np.add(corner, cell).tolist()) for corner, size in boxes for cell in product(*(range(s) for s in size))
    }


def solid_of(boxes: list[tuple[tuple[int, ...], tuple[int, ...]]]) -> Solid:
    middles = (np.array(sorted(voxels(boxes))) + 0.5) * UNIT_M
    made = tuple(
        Box(f"box{i}", (np.array(c) + np.array(s) / 2) * UNIT_M, np.array(s) / 2 * UNIT_M)
        for i, (c, s) in enumerate(boxes)
    )
    return Solid("random", {}, made, middles.mean(axis=0), len(middles) * UNIT_M**3)


def in_the_corner(cells: Array) -> set[tuple[int, ...]]:
    """Doubled middles of cells, shifted so that the lowest of each axis is zero."""
    return {tuple(cell) for cell in np.rint(cells - cells.min(axis=0)).astype(int).tolist()}


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(CORNERS, SIZES), min_size=1, max_size=4))
def test_a_turn_is_a_symmetry_exactly_if_it_maps_the_voxels_onto_themselves(boxes) -> None:
    """The oracle turns whole cells and shifts them back; it knows neither centroids nor grids of cuts."""
    cells = 2.0 * np.array(sorted(voxels(boxes))) + 1.0
    expected = [R for R in list_quarter_turns() if in_the_corner(cells @ R.T) == in_the_corner(cells)]
    found = find_symmetries(solid_of(boxes))
    assert_allclose(found[:, :3, :3], expected)
    middles = cells / 2 * UNIT_M
    for g in found:
        turned = in_the_corner(pose.apply(g, middles) / UNIT_M * 2)
        assert turned == in_the_corner(cells)
        assert_allclose(pose.apply(g, middles).min(axis=0), middles.min(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("part", "order", "fold"),
    [
        (scenes.stick(), 8, (4, 2, 2)),
        (scenes.block(), 24, (4, 4, 4)),
        (scenes.cuboid("brick", (50, 25, 10)), 4, (2, 2, 2)),
        (scenes.solid("corner", [], ((0, 0, 0), (20, 10, 5)), ((15, 25, 0), (5, 15, 5))), 1, (1, 1, 1)),
    ],
)
def test_known_parts(part: Solid, order: int, fold: tuple[int, ...]) -> None:
    found = find_symmetries(part)
    assert len(found) == order
    assert tuple(count_folds(found)) == fold
    assert_allclose(found[0], np.eye(4))


def test_a_symmetry_keeps_the_centre_the_faces_and_the_volume() -> None:
    """Each of them alone is not enough."""
    turn = pose.at((0, 0, 0), (180, 0, 0))
    bar = scenes.stick()
    assert is_symmetry(bar, turn)
    assert not is_symmetry(bar, pose.at((0.001, 0, 0)) @ turn)
    one_end = {name: face for name, face in bar.faces.items() if name != "pz"}
    assert not is_symmetry(replace(bar, faces=one_end), turn)
    (box,) = bar.pieces
    thick_end = replace(box, name="thick", center=box.center + box.half, half=box.half / 2)
    assert not is_symmetry(replace(bar, pieces=(box, thick_end)), turn)
