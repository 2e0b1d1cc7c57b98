"""What a plan says about itself before anything moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from apo_bench import Assembly, Plan
from apo_bench.assembly import ContactMeasurements, Step, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.planning.prediction.arm_move import ArmMove
from apo_bench.planning.prediction.first_failure import Prediction, predict_failure
from apo_bench.planning.prediction.rest_poses import is_support, list_residuals, predict_rest_poses
from apo_bench.records import Thresholds
from tests import rounds, scenes

pytestmark = pytest.mark.numeric

CLEARANCE_MM = 0.25
DOWN = (0.0, 0.0, -1.0)
AWAY = (0.0, 0.0, 1.0)
ALONG = (1.0, 0.0, 0.0)


def ways(scene: scenes.Scene) -> list[Attach]:
    """From above in the world; a stick that goes through holes, along its own x axis."""
    made = []
    for operation, goal in zip(scene.assembly.operations, scene.nominal_poses, strict=True):
        holes = [c for c in operation.contacts if c.manipulated.part == "stick" and c.manipulated.face == "pz"]
        upright = goal[2, 2] > 0
        made.append(Attach(np.array(ALONG), 0.2) if holes else Attach(np.array(DOWN if upright else AWAY), 0.05))
    return made


def said(scene: scenes.Scene, goals: Array, attach: Sequence[Attach] | None = None, **plan: object) -> Prediction:
    asked = Plan(scene.assembly, scene.start, goals, **plan)
    return predict_failure(asked, CLEARANCE_MM, Thresholds(), ways(scene) if attach is None else attach)


def off(scene: scenes.Scene, operation: int, T: Array) -> Array:
    """The true goals, that of one operation (from 1) wrong by a body displacement."""
    goals = scene.nominal_poses.copy()
    goals[operation - 1] = goals[operation - 1] @ T
    return goals


@pytest.mark.parametrize("name", scenes.ALL)
def test_the_examples_of_the_paper_fit(name: str) -> None:
    found = said(scenes.ALL[name](), scenes.ALL[name]().nominal_poses)
    assert (found.fails, found.operation, found.code) == (False, None, "ok")
    assert found.size_mm == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "wrong", "shift", "fails"),
    [
        ("stick_on_castles", (2,), (0, 2, 0), 3),
        ("stick_in_tower", (2,), (0, -2, 0), 3),
        ("subassembly_on_castles", (2,), (0, 2, 0), 5),
        ("fixture", (2, 3), (0, -2, 0), 5),
        ("pockets", (2,), (2, 0, 0), 6),
    ],
)
def test_careless_placing_fails_where_the_paper_says(
    name: str, wrong: tuple[int, ...], shift: tuple[float, float, float], fails: int
) -> None:
    """Fig. 3 and 6, examples 5.1 to 5.3: one part 2 mm aside, seen exactly; everything before still fits."""
    scene = scenes.ALL[name]()
    goals = scene.nominal_poses.copy()
    goals[[k - 1 for k in wrong]] = goals[[k - 1 for k in wrong]] @ scenes.mm(*shift)
    found = said(scene, goals)
    assert (found.fails, found.operation, found.code) == (True, fails - 1, "residual")
    assert found.size_mm == pytest.approx(2.0, abs=1e-9)
    assert found.sentence.startswith(f"operation {fails} ({scene.assembly.operations[fails - 1].main}) will fail: ")


@pytest.mark.parametrize("mm", [-4.0, 3.0])
def test_what_is_found_by_touch_tells_nothing(mm: float) -> None:
    """Too deep or too high: a support is no fit contact, and the floor of a slot lies along the way in."""
    scene = scenes.stick_on_castles()
    assert said(scene, scene.nominal_poses @ scenes.mm(0, 0, mm)).code == "ok"
    laid = off(scene, 3, scenes.mm(0, 0, mm))
    assert said(scene, laid).code == "ok"
    assert (said(scene, laid, []).code, said(scene, laid, []).operation) == ("residual", 2)


@pytest.mark.parametrize("name", ["stick_in_tower", "fixture", "pockets"])
def test_what_is_found_by_touch_ends_in_touch(name: str) -> None:
    """Supports close, of sides one corner, and settling again changes nothing."""
    scene = scenes.ALL[name]()
    poses = dict(scene.start)
    goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(4), 1.0, 1.0)
    for operation, goal in zip(scene.assembly.operations, goals, strict=True):
        alone = Assembly(scene.assembly.solids, (operation,), scene.assembly.fixed)
        (brought,) = compute_placements(alone, poses, goal[None])
        rests = predict_rest_poses(alone, operation, brought)
        touched = [c for c in operation.contacts if not alone.is_fit(c)]
        sides = [c for c in touched if not is_support(alone, c, rests)]
        for contact in touched:
            e, _ = list_residuals(ContactMeasurements(alone), [contact], rests)[0][0]
            assert (e.min() if contact in sides else np.abs(e).max()) == pytest.approx(0.0, abs=2e-5)
        for part, T in rests.items():
            assert part in operation.moves or T is brought[part]
            relative = pose.inverse(rests[operation.main]) @ T
            if part in operation.moves:
                np.testing.assert_allclose(relative, pose.inverse(brought[operation.main]) @ brought[part], atol=1e-12)
        again = predict_rest_poses(alone, operation, rests)
        np.testing.assert_allclose(again[operation.main], rests[operation.main], rtol=0, atol=2e-5)
        poses = dict(rests)


def test_work_that_is_taken_apart_is_looked_at_as_it_is_redone() -> None:
    """Example 5.1: castle 2 is put down wrongly, taken off, put down rightly; only then comes the stick."""
    scene = scenes.stick_in_tower()
    wrong = off(scene, 2, scenes.mm(0, 3, 0))
    schedule = (Step(0), Step(1), Step(1, undo=True), Step(1), Step(2))
    targets = np.array([scene.nominal_poses[0], wrong[1], wrong[1], scene.nominal_poses[1], scene.nominal_poses[2]])
    assert said(scene, scene.nominal_poses, schedule=schedule, step_poses=targets).code == "ok"
    targets[3] = wrong[1]
    found = said(scene, wrong, schedule=schedule, step_poses=targets)
    assert (found.operation, found.code) == (2, "residual")


ROUND_WAYS = {
    "peg_in_plate": [(0, 0, -1)] * 2,
    "loose_peg": [(0, 0, -1)] * 2,
    "nested": [(0, 0, -1)] * 3,
    "through": [(0, -1, 0), (0, -1, 0), (0, 0, 1)],
    "in_groove": [(0, 0, -1), (1, 0, 0)],
    "on_table": [(1, 0, 0)],
    "countersink": [(0, 0, -1)] * 2,
    "on_rim": [(0, 0, -1)] * 2,
    "wedges_meet": [(0, 0, -1), (0, 0, 1)],
    "dovetail": [(0, 0, -1), (1, 0, 0)],
}
"""Of each scene the ways in, in the frame of the part."""


def round_ways(name: str) -> list[Attach]:
    """Long enough to begin beside everything."""
    return [Attach(np.array(way, dtype=np.float64), 0.15) for way in ROUND_WAYS[name]]


@pytest.mark.parametrize("name", rounds.ALL)
def test_round_and_tilted_parts_fit(name: str) -> None:
    scene = rounds.ALL[name]()
    found = said(scene, scene.nominal_poses, round_ways(name))
    assert (found.fails, found.code) == (False, "ok")
    assert found.size_mm == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "operation", "T", "code", "size_mm"),
    [
        ("peg_in_plate", 2, scenes.mm(0.34, 0, 0), "ok", 0.34),
        ("peg_in_plate", 2, scenes.mm(0.3, 0.4, 0), "residual", 0.5),
        ("peg_in_plate", 2, scenes.mm(0, 0, 8), "ok", 0.0),
        ("peg_in_plate", 2, scenes.mm(0, 0, 0, (2, 0, 0)), "residual", 20 * np.tan(np.radians(2))),
        ("loose_peg", 2, scenes.mm(0.25, 0, 0), "residual", 0.25),
        ("through", 3, scenes.mm(0, 0, 12), "ok", 0.0),
        ("countersink", 2, scenes.mm(0.2, 0, 0), "residual", 0.2),
        ("on_rim", 2, scenes.mm(0, 0, 0, (2, 0, 0)), "ok", 2 * np.sin(np.radians(2))),
        ("in_groove", 2, scenes.mm(-0.7, 0.6, 0, (0, 1, 0)), "ok", 0.0),
        ("dovetail", 2, scenes.mm(0, 0.7, 0), "residual", 0.7 * np.sin(np.radians(60))),
    ],
)
def test_round_and_tilted_parts_that_are_planned_wrongly(
    name: str, operation: int, T: Array, code: str, size_mm: float
) -> None:
    scene = rounds.ALL[name]()
    found = said(scene, off(scene, operation, T), round_ways(name))
    assert found.code == code
    assert found.size_mm == pytest.approx(size_mm, abs=1e-3)


def by_arm(k: int, **made: object) -> Prediction:
    """The true goals of the stick in the tower, one operation of which an arm does like this."""
    scene = scenes.ALL["stick_in_tower"]()
    plan = Plan(scene.assembly, scene.start, scene.nominal_poses)
    moves = [ArmMove(i, **(made if i == k else {})) for i in range(len(scene.nominal_poses))]
    return predict_failure(plan, CLEARANCE_MM, Thresholds(), ways(scene), moves)


def test_what_an_arm_cannot_do_is_foretold() -> None:
    last = len(scenes.ALL["stick_in_tower"]().nominal_poses) - 1
    assert by_arm(last).code == "ok"
    short = by_arm(last, refused="unreachable", at_limit="j4")
    assert (short.operation, short.code, short.size_mm) == (last, "unreachable", None)
    assert short.sentence.endswith("the arm does not reach the goal, or the way to it: its joint 'j4' is at its limit")
    assert by_arm(1, collides_with="foot", collision_mm=0.9).code == "ok"
    narrow = by_arm(1, collides_with="foot", collision_mm=1.1)
    assert (narrow.operation, narrow.code, narrow.size_mm) == (1, "gripper_room", 1.1)
    assert "in 'foot'" in narrow.sentence
