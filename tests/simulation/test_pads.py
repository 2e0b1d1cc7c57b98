"""Grooves of fingertips are filled, and a weak hand comes slowly to the first of several entrances."""

import mujoco
import numpy as np
import pytest

from apo_bench.simulation.arms.grooves import fill_grooves

BOX = '<geom type="box" pos="{} 0.002 {}" size="0.003 0.002 0.003"/>'
FINGER = '<mujoco><worldbody><body><joint name="{}" type="slide"/>{}</body></worldbody></mujoco>'


def boxes(joint: str, *places: tuple[float, float]) -> list[tuple[list[float], list[float]]]:
    """Position and size of each box of a finger after its grooves were filled, [mm]."""
    spec = mujoco.MjSpec.from_string(FINGER.format(joint, "".join(BOX.format(*at) for at in places)))
    fill_grooves(spec, ["arm"])
    spec.compile()
    return [(np.round(1e3 * g.pos, 6).tolist(), np.round(1e3 * g.size, 6).tolist()) for g in spec.geoms]


def test_four_boxes_with_grooves_between_them_become_one() -> None:
    places = [(x, z) for x in (-0.0055, 0.0055) for z in (0.04, 0.05)]
    assert boxes("finger", *places) == [([0.0, 2.0, 45.0], [8.5, 2.0, 8.0])]


@pytest.mark.parametrize("apart", [0.006, 0.0145])
def test_boxes_that_touch_or_stand_far_apart_stay_two(apart: float) -> None:
    assert len(boxes("finger", (0.0, 0.0), (apart, 0.0))) == 2
