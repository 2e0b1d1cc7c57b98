"""Where pads can hold a part: both of them touch it there, open fingers come by, and air is no place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from apo_bench.geometry import PAD_M, Box, Solid, is_held, measure_held_span, measure_intrusion_depths
from apo_bench.geometry.pads import find_holds
from apo_bench.scenario.parts.making import Frustum, build_solid, extrude, make_polygon, make_shaft, revolve

OPENING_M = 0.046
L = extrude(make_polygon((0, 0), (60, 0), (60, 10), (10, 10), (10, 40), (0, 40)), 0, 20)
U = extrude(make_polygon((0, 0), (80, 0), (80, 40), (68, 40), (68, 10), (12, 10), (12, 40), (0, 40)), 0, 30)
BUSH = revolve(
    [Frustum(0, 3, 9, name="flange"), Frustum(3, 20, 7, name="outer")], [Frustum(0, 20, 5, name="inner", fit=True)]
)
PARTS = {
    "peg": (make_shaft(5, -25, 25, "wall"), (0, 0, 1)),
    "lying peg": (make_shaft(5, -25, 25, "wall"), (1, 0, 0)),
    "bush": (BUSH, (0, 0, 1)),
    "standing L": (L, (0, 1, 0)),
    "standing U": (U, (0, 1, 0)),
}


def made(name: str) -> tuple[Solid, np.ndarray]:
    body, up = PARTS[name]
    return build_solid("part", body), np.array(up, dtype=np.float64)


def fingers(
    hold_up: np.ndarray, across: np.ndarray, point: np.ndarray, opening: float
) -> tuple[Sequence[Box], np.ndarray]:
    """Both pads with what is above them, and the pose of their frame: x across, z up."""
    T = np.eye(4)
    T[:3, :3] = np.column_stack([across, np.cross(hold_up, across), hold_up])
    T[:3, 3] = point
    side, down, _ = PAD_M
    half = np.array([0.006, side, 0.05])
    high = 0.05 - down
    return [Box(f"f{s}", np.array([s * (opening + 0.006), 0.0, high]), half) for s in (-1, 1)], T


@pytest.mark.parametrize("name", PARTS)
def test_pads_touch_both_sides_and_open_fingers_strike_nothing(name: str):
    solid, up = made(name)
    found = find_holds(solid, up, OPENING_M)
    assert found
    for hold in found[:: max(1, len(found) // 20)]:
        span = measure_held_span(solid.pieces, hold.point, hold.across, up)
        assert span is not None
        assert span == pytest.approx((-hold.half_width, hold.half_width), abs=1e-4)  # rays pass beside a round crest
        assert abs(hold.across @ up) < 1e-9
        boxes, T = fingers(up, hold.across, hold.point, min(hold.half_width + 0.012, OPENING_M))
        own = np.linalg.inv(T)
        depth = measure_intrusion_depths(solid.pieces, own[:3, :3], own[None, :3, 3], tuple(boxes), np.eye(4))
        assert depth[0] <= 1e-6


@pytest.mark.parametrize("name", PARTS)
def test_what_is_offered_is_held_and_the_air_beside_it_is_not(name: str):
    solid, up = made(name)
    for over in (0.0, 0.0085):
        found = find_holds(solid, up, OPENING_M, over)
        for hold in found[:: 1 + len(found) // 20]:
            assert is_held(solid, hold.point, hold.across, up, OPENING_M)
    hold = find_holds(solid, up, OPENING_M)[0]
    assert not is_held(solid, hold.point + 0.2 * hold.across, hold.across, up, OPENING_M)
