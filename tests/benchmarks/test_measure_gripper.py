"""The script that measures grippers finds what their files state."""

import tomllib

import pytest

from apo_bench.resources import folder
from apo_bench.simulation.arms.gripper_file import read_gripper
from benchmarks.measure_gripper import gripper_file

ARMS = folder("assets") / "arms"


def test_the_measured_gripper_is_what_its_file_states() -> None:
    stated = read_gripper(folder("assets") / "grippers" / "parallel_gripper.toml")
    text = gripper_file(ARMS / "panda_primitive.xml", "flange", ARMS / "parallel_gripper.xml")
    made = tomllib.loads(text)
    assert made["opening_mm"] == pytest.approx(stated.opening_mm, abs=1e-3)
    assert made["force_n"] == pytest.approx(stated.force_n, rel=1e-3)
