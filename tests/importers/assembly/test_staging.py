"""Where parts wait: apart from each other and from what must stay free, in reach; else there is no room."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import Box, Solid, pose
from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import place_on_table, read_posed
from apo_bench.importers.assembly.scenario_writer import format_scenario
from apo_bench.importers.assembly.staging import find_stance, stage_parts
from apo_bench.scenario.parts.making import extrude, make_rectangle, make_shaft
from tests.importers.assembly.test_new_scenario import at, made


def brick(x: float, y: float, z: float, centroid: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """Half sizes, [m]."""
    return Solid("brick", {}, (Box("p1", np.zeros(3), np.array([x, y, z])),), np.array(centroid), 8 * x * y * z)


def test_parts_wait_in_reach_with_room_for_fingers_and_clear_of_the_site() -> None:
    half = np.array([0.02, 0.03])
    solids = {name: brick(*half, 0.01) for name in "abcdef"}
    places = stage_parts(solids, dict.fromkeys(solids, np.eye(3)), [(np.array([0.1, 0.0]), 0.12)])
    for a, b in combinations(places.values(), 2):
        assert (np.abs(a - b) - 2 * half).max() > 0.03 - 1e-9, "fingers have room between any two"
    for at_m in places.values():
        assert 0.27 < np.hypot(at_m[0] + 0.42, at_m[1]) < 0.66
        corner = np.maximum(np.abs(at_m - [0.1, 0.0]) - half, 0.0)
        assert np.hypot(*corner) > 0.12 + 0.03 - 1e-9


def test_what_is_heavy_beside_its_foot_does_not_stand() -> None:
    assert find_stance(brick(0.02, 0.02, 0.05), np.eye(3)) == (0.05, True, False)
    assert not find_stance(brick(0.02, 0.02, 0.05, (0.021, 0.0, 0.0)), np.eye(3)).stands
    assert not find_stance(brick(0.02, 0.02, 0.05, (0.017, 0.0, 0.05)), np.eye(3)).stands, "within 4 % of its height"
    assert find_stance(brick(0.02, 0.02, 0.05, (0.0155, 0.0, 0.05)), np.eye(3)).stands


def test_a_part_that_rolls_or_is_too_wide_is_said_and_written(tmp_path: Path) -> None:
    slab = extrude(make_rectangle(120, 120), 0, 30, bottom="bottom", top="top")
    lid = extrude(make_rectangle(110, 110), 0, 30, bottom="bottom", top="top")
    rod = make_shaft(6, 0, 50, "side", bottom="tip", top="head")
    places = {"slab": ("slab", at(0, 0, 0)), "lid": ("lid", at(0, 0, 30)), "rod": ("rod", at(0, 25, 66, 90, 0, 0))}
    result = new_scenario(place_on_table(made(tmp_path, {"slab": slab, "lid": lid, "rod": rod}, places)))
    assert "'rod' lies on a round wall at its start and may roll" in result.notes
    assert any(
        note.startswith("'lid', 110 x 110 x 30 mm as it stands, offers no place to a gripper") for note in result.notes
    )
    text = format_scenario(result, 'a "title"', "a test", tmp_path / "own.toml")
    assert 'title = "a \\"title\\""' in text
    assert "# NOTE: 'rod' lies on a round wall at its start and may roll." in text
    assert "# NO PLACE for the gripper" in text


def test_the_assembly_stands_on_the_table_whichever_axis_looks_up(tmp_path: Path) -> None:
    block = extrude(make_rectangle(20, 30), 0, 40, bottom="bottom", top="top")
    parts = made(tmp_path, {"block": block}, {"one": ("block", at(5, 6, 7)), "other": ("block", at(5, 6, 47))})
    for up, axis in {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}.items():
        for sign in (1.0, -1.0):
            upright = place_on_table(parts, up if sign > 0 else f"-{up}")
            np.testing.assert_allclose(upright[0].T[:3, :3] @ np.array(axis) * sign, (0, 0, 1), atol=1e-12)
            corners = np.concatenate([pose.apply(each.T, each.solid.bounds) for each in upright])
            assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
            np.testing.assert_allclose(corners[:, :2].min(axis=0), -corners[:, :2].max(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (2 * '[[pose]]\npart = "block"\nname = "2 b"\nat_mm = [0, 0, 0]\n', "pose 1, name"),
        (2 * '[[pose]]\npart = "block"\nat_mm = [0, 0]\n', "at_mm"),
    ],
)
def test_a_file_of_poses_that_makes_no_assembly_is_refused(text: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "poses.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_posed(path, ["block"] if '"block"' in text else [])
