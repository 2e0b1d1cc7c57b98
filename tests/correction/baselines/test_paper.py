"""The corrector of the paper: what it leaves when too little is free, what it mends, what it must not touch."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import Correction, InputError, Observation, correct
from apo_bench.assembly import Step, build_contact_equations, measure_largest_gap
from apo_bench.correction.baselines.paper import paper
from apo_bench.correction.solvers.newton import LENGTH_M, solve_newton
from apo_bench.geometry import Array, is_rigid, pose
from apo_bench.records import CODES
from tests import scenes

pytestmark = pytest.mark.numeric

Error = Callable[[Array], Array]
NOTHING_M = 1e-8
"""A gap that is nothing but the last step of a solver that came to rest."""


def sideways(mm: float) -> Error:
    return lambda T: T @ scenes.mm(0, mm, 0)


def along(mm: float) -> Error:
    return lambda T: T @ scenes.mm(mm, 0, 0)


def turned(deg: float) -> Error:
    return lambda T: T @ scenes.mm(0, 0, 0, (0, 0, deg))


def together(deg: float) -> Error:
    """A turn of everything about the place of the fixture in example 5.3."""
    center = scenes.mm(70, 55, 0)
    return lambda T: center @ scenes.mm(0, 0, 0, (0, 0, deg)) @ pose.inverse(center) @ T


def left_mm(scene: scenes.Scene, wrong: Collection[int], error: Error, free: Collection[int]) -> float:
    """What remains, [mm], when operations (from 1) are wrong and others (from 1) may change."""
    goals = scene.nominal_poses.copy()
    for k in wrong:
        goals[k - 1] = error(goals[k - 1])
    freed = {k - 1 for k in free}
    system = build_contact_equations(scene.assembly, scene.start, goals)
    return solve_newton(system.among(system.contacts_with(freed)), goals, freed).gap_m * 1e3


# Freed sets of the paper, most recent first. A set is too small where something remains. Where the size of a remainder
# depends on which corners of two faces of nearly the same size are taken, the value is that of the smaller face.
GOLDEN = [
    ("stick_on_castles", [2], sideways(3), {(3,): 0.777, (3, 2): 0.0}),
    ("stick_on_castles", [2], turned(2), {(3,): 1.160, (3, 2): 0.0}),
    ("stick_in_tower", [2], sideways(3), {(3,): 1.524, (3, 2): 0.0, (2,): 0.0, (3, 1): 0.0}),
    ("stick_in_tower", [2], turned(2), {(3,): 0.525, (3, 2): 0.0, (2,): 0.0, (3, 1): 0.0}),
    (
        "subassembly_on_castles",
        [2],
        sideways(3),
        {(5,): 0.777, (5, 4): 0.777, (5, 4, 3): 0.777, (5, 4, 3, 2): 0.0, (5, 2): 0.0, (5, 1): 0.0},
    ),
    ("subassembly_on_castles", [2], turned(2), {(5,): 1.160, (5, 4): 1.160, (5, 4, 3): 1.160, (5, 4, 3, 2): 0.0}),
    ("fixture", [2, 3], sideways(3), {(5,): 0.777, (5, 3): 0.693, (5, 3, 2): 0.0, (5, 1): 0.0}),
    ("fixture", [2, 3], together(2), {(5,): 1.152, (5, 3): 0.799, (5, 3, 2): 0.0}),
    ("pockets", [2], along(2), {(6,): 1.0, (6, 5): 1.0, (6, 5, 3): 1.10, (6, 5, 3, 2): 0.0, (6, 5, 2): 0.0}),
]


@pytest.mark.parametrize(("name", "wrong", "error", "expected"), GOLDEN)
def test_what_remains_for_each_freed_set(name: str, wrong: list[int], error: Error, expected: dict) -> None:
    scene = scenes.ALL[name]()
    measured = {free: round(left_mm(scene, wrong, error, free), 3) for free in expected}
    assert measured == pytest.approx(expected, abs=6e-4)


@pytest.mark.parametrize(
    ("name", "freed", "rank"),
    [
        ("stick_on_castles", (2, 1, 0), 13),
        ("bridge", (2, 1, 0), 11),
        ("stick_in_tower", (2, 1, 0), 13),
        ("subassembly_on_castles", (4, 3, 2, 1, 0), 21),
        ("fixture", (4, 3, 2, 1, 0), 21),
        ("pockets", (5, 4, 3, 2, 1, 0), 28),
    ],
)
def test_all_at_once_from_noise(name: str, freed: tuple[int, ...], rank: int) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(3)
    for level in (0.5, 1.0, 2.0):
        seen = scenes.seen(scene, scenes.noisy(scene.nominal_poses, rng, level, level))
        found = paper(seen)
        assert (found.status, found.freed, found.rank) == ("converged", freed, rank)
        assert found.ok
        assert found.gap_after_m < NOTHING_M
        assert found.gap_before_m == measure_largest_gap(seen.assembly, seen.start, seen.poses) > 3e-4
        assert measure_largest_gap(seen.assembly, seen.start, found.poses) < NOTHING_M
        assert is_rigid(found.poses).all()


def drift(scene: scenes.Scene, seen: Array) -> float:
    """How far the solver moved what no contact fixes, over 2 mm; rotations as the way of a point 40 mm away."""
    n = len(seen)
    system = build_contact_equations(scene.assembly, scene.start, seen)
    found = solve_newton(system, seen, range(n))
    assert found.gap_m < NOTHING_M
    unit = np.tile([1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M], n)
    _, w, Vt = np.linalg.svd(system.linearise(found.poses)[1] / unit)
    free = Vt[np.count_nonzero(w > 1e-7 * w[0]) :]
    return float(np.linalg.norm(free @ (pose.log(pose.inverse(seen) @ found.poses).ravel() * unit))) / 2e-3


@pytest.mark.parametrize("name", ["stick_on_castles", "pockets"])
def test_free_directions_stay_where_they_were_seen(name: str) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(7)
    drifts = [drift(scene, scenes.noisy(scene.nominal_poses, rng, 2.0, 1.0)) for _ in range(10)]
    assert max(drifts) < 0.2


def contradiction() -> Observation:
    """A block that must lie on the table with its bottom and, 10 mm off, with its top on a ceiling of the table."""
    low = scenes.solid(
        "table",
        [
            scenes.wall("top", "+z", 0, (-300, -300), (300, 300)),
            scenes.wall("roof", "-z", 60, (-300, -300), (300, 300)),
        ],
        ((0, 0, -10), (300, 300, 10)),
    )
    operation = scenes.Operation("block", scenes.touch("block", "table", "nz-top", "pz-roof"))
    scene = scenes.scene([low, scenes.block()], [operation], [scenes.mm(0, 0, 27)])
    return scenes.seen(scene, scene.nominal_poses)


def test_contacts_that_contradict_each_other_are_inconsistent() -> None:
    found = paper(contradiction())
    assert (found.status, found.sentence) == ("inconsistent", CODES["inconsistent"])
    assert not found.ok
    assert found.gap_after_m == pytest.approx(0.005)
    assert paper(replace(contradiction(), gap_m=0.0051)).ok


# What is freed, and what is only settled


@pytest.mark.parametrize(
    ("name", "freed"),
    [
        ("stick_in_tower", (3, 2, 1)),
        ("subassembly_on_castles", (5, 4, 3, 2, 1)),
        ("fixture", (5, 3, 2, 1)),
        ("pockets", (6, 5, 3, 2, 1)),
    ],
)
@given(size=st.floats(1.5, 4.0), sign=st.sampled_from([-1, 1]), low=st.sampled_from([0.0, 0.25]))
@settings(max_examples=6, deadline=None)
def test_a_careless_human_frees_the_candidates_of_the_paper(
    name: str, freed: tuple[int, ...], size: float, sign: int, low: float
) -> None:
    scene, goals = scenes.human_error(name, sign * size, low)
    found = paper(scenes.seen(scene, goals))
    assert (found.status, tuple(k + 1 for k in found.freed)) == ("converged", freed)
    assert found.gap_before_m == pytest.approx(size * 1e-3)
    assert found.gap_after_m < NOTHING_M
    others = [k for k in range(len(goals)) if k not in found.freed]
    assert_array_equal(found.poses[others], goals[others])


def tilted(scene: scenes.Scene, k: int, mm: float, deg: float) -> Array:
    goals = scene.nominal_poses.copy()
    goals[k] = goals[k] @ scenes.mm(0.4, -0.3, mm, (deg, -deg, 3.0))
    return goals


def test_a_goal_that_is_no_candidate_is_settled_for_what_it_makes() -> None:
    """The fixture of example 5.3, put away a little tilted: flat afterwards, its place and turn as seen."""
    scene = scenes.fixture()
    goals = tilted(scene, 3, 0.04, 0.04)
    goals[1:3, 1, 3] += 0.003
    found = paper(scenes.seen(scene, goals))
    assert found.freed == (4, 2, 1, 0)
    assert_allclose(found.poses[3, 2], [0, 0, 1, 0.025], atol=1e-9)
    assert_allclose(found.poses[3, :2, 3], goals[3, :2, 3], atol=1e-4)
    assert np.degrees(np.arctan2(*found.poses[3, [1, 0], 0])) == pytest.approx(3.0, abs=1e-3)


# correct(): any corrector, by name or as an object


def noisy_tower() -> Observation:
    scene = scenes.stick_in_tower()
    return scenes.seen(scene, scenes.noisy(scene.nominal_poses, np.random.default_rng(4), 1.0, 1.0))


def test_correct_by_name_by_path_and_by_object() -> None:
    seen = noisy_tower()
    goals = paper(seen).poses
    for name in ("paper", "apo_bench.correction.baselines.paper:paper", paper):
        assert_array_equal(correct(seen, name).poses, goals)


def test_bare_goals_are_measured_and_wrapped() -> None:
    seen = noisy_tower()
    goals = paper(seen).poses
    found = correct(seen, lambda observation: goals)
    assert (found.status, found.freed, found.rank) == ("converged", (2, 1, 0), 13)
    assert found.gap_before_m == measure_largest_gap(seen.assembly, seen.start, seen.poses)
    assert found.gap_after_m < NOTHING_M
    assert correct(seen, lambda observation: observation.poses).freed == ()


def reflected(seen: Observation) -> Array:
    goals = seen.poses.copy()
    goals[1, :3, 2] *= -1
    return goals


def steps(spelled: str) -> tuple[Step, ...]:
    """`1 2 -2 2 3`."""
    return tuple(Step(abs(int(word)) - 1, word.startswith("-")) for word in spelled.split())


def scheduled(spelled: str, mirrored: bool = False) -> Callable[[Observation], Correction]:
    def scheduling(seen: Observation) -> Correction:
        made = paper(seen)
        targets = made.poses[[min(k, len(made.poses) - 1) for k, _ in steps(spelled)]]
        targets[-1] = np.diag([-1.0, 1.0, 1.0, 1.0]) if mirrored else targets[-1]
        return replace(made, schedule=steps(spelled), step_poses=targets)

    return scheduling


def other_status(seen: Observation) -> Correction:
    return replace(paper(seen), status="fine")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("papr", "unknown corrector 'papr'; did you mean 'paper'"),
        (lambda seen: None, "returned None; return a Correction or poses of shape (3, 4, 4)"),
        (reflected, "the pose of operation 2 that the corrector 'reflected' returned is not a rigid pose"),
        (other_status, "returned the status 'fine'; return one of converged, not_seen"),
        (scheduled("1 2 3 -2"), "returned a schedule that undoes operation 2 before operation 3"),
        (
            scheduled("1 2 3", mirrored=True),
            "the pose of step 3 that the corrector 'scheduling' returned is not a rigid pose",
        ),
    ],
)
def test_what_correct_refuses(given: object, message: str) -> None:
    with pytest.raises(InputError) as refused:
        correct(noisy_tower(), given)
    assert message in str(refused.value)
    assert str(refused.value).count("\n") == 0
