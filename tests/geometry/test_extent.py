"""How far boxes reach along a direction: no corner reaches farther, and one reaches as far."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from apo_bench.geometry import measure_extent
from tests import scenes

pytestmark = pytest.mark.numeric


@pytest.mark.parametrize("seed", range(2))
def test_the_farthest_corners_are_the_extent(seed: int) -> None:
    along = np.random.default_rng(seed).standard_normal(3)
    for solid in (scenes.castle(), scenes.cube(), scenes.stick()):
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))
        reach = np.concatenate([(box.center + signs * box.half) @ along for box in solid.pieces])
        assert measure_extent(solid.pieces, along) == pytest.approx((reach.min(), reach.max()), abs=1e-15)
