"""How far parts would fall: until the lowest corner touches, and past what is beside or below."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.geometry import TOUCH_M, Box, Solid, pose
from apo_bench.geometry.penetration import measure_drop


def cuboid(*half: float) -> Solid:
    return Solid("cuboid", {}, (Box("cuboid", np.zeros(3), np.array(half)),), np.zeros(3), 8 * float(np.prod(half)))


SLAB = cuboid(0.4, 0.4, 0.001)
CUBE = cuboid(0.02, 0.02, 0.02)


@pytest.mark.parametrize("height", [0.0, 0.0123])
@pytest.mark.parametrize("turn", [(0, 0, 0), (20, 30, 40)])
def test_a_cube_falls_until_its_lowest_corner_touches(height: float, turn: tuple[float, float, float]) -> None:
    T = pose.at((0.05, 0.03, 0.0), turn)
    T[2, 3] = 0.001 + height + 0.02 * np.abs(T[2, :3]).sum()
    assert measure_drop(CUBE, T, SLAB, np.eye(4)) == pytest.approx(height, abs=3 * TOUCH_M)
