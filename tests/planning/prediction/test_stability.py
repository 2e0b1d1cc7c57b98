"""Which planned goals would not hold a part."""

from __future__ import annotations

import pytest

from apo_bench.assembly import Operation
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.stability import find_first_unstable
from tests import rounds, scenes

pytestmark = pytest.mark.numeric


def falls(scene: scenes.Scene, operation: int, T: Array) -> int | None:
    """The verdict if that operation (from 1) had another goal, displaced in the frame of its part; counted from 1."""
    goals = scene.nominal_poses.copy()
    goals[operation - 1] = goals[operation - 1] @ T
    found = find_first_unstable(scene.assembly, scene.start, goals)
    return None if found is None else found + 1


@pytest.mark.parametrize("build", [*scenes.ALL.values(), *rounds.ALL.values()])
def test_the_examples_of_the_paper_and_round_parts_stand(build) -> None:
    scene = scenes.turned(build(), pose.at((0.1, 0.05, 0.0), (0.0, 0.0, 37.0)))
    assert find_first_unstable(scene.assembly, scene.start, scene.nominal_poses) is None


@pytest.mark.parametrize(("beyond_mm", "expected"), [(-1.0, None), (1.0, 1)])
def test_castle_over_the_edge_of_the_table(beyond_mm: float, expected: int | None) -> None:
    """The table ends at x = 700; the centre of the castle decides."""
    put = Operation("castle", scenes.touch("castle", "table", "bottom-top"))
    alone = scenes.scene([scenes.table(), scenes.castle()], [put], [scenes.mm(700, 0, 0)])
    assert falls(alone, 1, scenes.mm(beyond_mm, 0, 0)) == expected


@pytest.mark.parametrize(("along_mm", "expected"), [(95.0, None), (-105.0, 3)])
def test_stick_whose_centre_lies_beside_its_supports(along_mm: float, expected: int | None) -> None:
    """The slots carry it from x = -100 to 100."""
    assert falls(scenes.stick_on_castles(), 3, scenes.mm(along_mm, 0, 0)) == expected


def test_stick_in_a_closed_hole_is_held_like_a_cantilever() -> None:
    """Its centre hangs 60 mm out; the floor pushes up at the mouth, the ceiling down at the far end."""
    assert falls(scenes.stick_in_tower(), 3, scenes.mm(60, 0, 0)) is None


@pytest.mark.parametrize(
    ("build", "operation", "T", "expected"),
    [
        (rounds.through, 3, scenes.mm(0, 0, 90), None),
        (rounds.through, 3, scenes.mm(0, 0, 110), 3),
        (rounds.in_groove, 2, scenes.mm(0, 0, 38), None),
        (rounds.in_groove, 2, scenes.mm(0, 0, 42), 2),
        (rounds.peg_in_plate, 2, scenes.mm(0, 0, 0, (0, 0, 40)), None),
        (rounds.wedges_meet, 2, scenes.mm(0, 45, 0), 2),
        (rounds.dovetail, 2, scenes.mm(50, 0, 0), None),
        (rounds.dovetail, 2, scenes.mm(81, 0, 0), 2),
    ],
)
def test_what_carries_round_and_tilted_parts(build, operation: int, T: Array, expected: int | None) -> None:
    """A bore holds a shaft like a cantilever; the groove and the slope carry what has its centre over them."""
    assert falls(build(), operation, T) == expected
