"""Grasps that the file leaves out: what the gripper can hold is found, what it cannot is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, load_scenario
from apo_bench.scenario.parts.making import Body, bore, extrude, join, make_rectangle, write_part
from apo_bench.scenario.scenario import Grasp

FILE = """schema = 1
title = "A plate is put down"

[parts.table]
file = "table"
fixed = true

[parts.plate]
file = "plate.xml"
start = { at_mm = [0, -290, 0] }

[[operations]]
move = "plate"
goal = { at_mm = [0, 0, 0] }
contacts = [["bottom", "table.top"]]
"""
PLATE = extrude(make_rectangle(120, 120), 0, 12, bottom="bottom")


def grasp(folder: Path, body: Body) -> Grasp:
    write_part("plate", body, folder, density=700.0, source="a test", licence="CC0-1.0")
    path = folder / "put_down.toml"
    path.write_text(FILE, encoding="utf-8")
    return load_scenario(path).grasps[0]


def test_a_wide_tray_of_boxes_is_held_by_its_rim(tmp_path: Path):
    rims = [extrude(make_rectangle(120, 8, (0, y)), 12, 30).prefixed(name) for name, y in (("a_", 56), ("b_", -56))]
    found = grasp(tmp_path, join(PLATE, *rims))
    np.testing.assert_allclose(np.abs(found.point[:2]), (0.0, 0.056), atol=1e-9)
    np.testing.assert_allclose(found.across, (0.0, 1.0, 0.0))
    assert 0.012 + 0.010 < found.point[2] < 0.030, "the pads end over the plate"


BAR = extrude(make_rectangle(60, 20), 0, 20, bottom="bottom")
LEANS = "[-0.5, 0, -0.8660254038]"


def stated(folder: Path, keys: str) -> Grasp:
    write_part("plate", BAR, folder, density=700.0, source="a test", licence="CC0-1.0")
    path = folder / "put_down.toml"
    path.write_text(f"{FILE}grasp = {{ {keys} }}\n", encoding="utf-8")
    return load_scenario(path).grasps[0]


def test_a_tilted_grasp_is_read(tmp_path: Path):
    found = stated(tmp_path, f'at_mm = [20, 0, 14], across = "y", ahead = {LEANS}')
    assert found.ahead is not None
    np.testing.assert_allclose(found.ahead, (-0.5, 0.0, -np.sqrt(0.75)), atol=1e-9)
    np.testing.assert_allclose(found.point, (0.02, 0.0, 0.014))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (f"at_mm = [20, 0, 14], ahead = {LEANS}", "'across'"),
        ('at_mm = [20, 0, 14], across = "y", ahead = [1, 0, -0.9]', "within 45 degrees of straight down"),
        (f'at_mm = [90, 0, 14], across = "y", ahead = {LEANS}', "a point of the part"),
    ],
)
def test_a_tilted_grasp_that_cannot_be_one_is_named(tmp_path: Path, keys: str, words: str):
    with pytest.raises(InputError, match=words):
        stated(tmp_path, keys)


def test_a_plate_that_is_too_wide_both_ways_is_named_with_its_size_and_the_opening(tmp_path: Path):
    plate = extrude(make_rectangle(120, 120), 0, 12, bores=[bore((0, 0), 5, 0, 12, "bore")], bottom="bottom")
    words = r"operation 1, grasp: 'plate', 120 x 120 x 12 mm, has no opposite faces.* within 80 mm"
    with pytest.raises(InputError, match=words):
        grasp(tmp_path, plate)
