"""The corrector of the paper loses with one thing taken away what the theory says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import Correction, Observation
from apo_bench.assembly import FreeingTrial, build_contact_equations, compute_placements
from apo_bench.correction.baselines.paper import paper
from apo_bench.correction.baselines.track import paper_track
from apo_bench.geometry import Array, pose
from benchmarks.ablations import MOST_SETS, last_only, minimal, no_disappeared, no_history, smallest
from tests import scenes

EXAMPLES = ("stick_in_tower", "subassembly_on_castles", "fixture", "pockets")


def observe(name: str, mm: float = 3.0, noise_level: float = 0.0, low_mm: float = 0.0) -> Observation:
    """An example with human error."""
    scene, poses = scenes.human_error(name, mm, low_mm)
    return scenes.seen(scene, scenes.noisy(poses, np.random.default_rng(0), noise_level, noise_level))


def freed(found: Correction) -> tuple[int, ...]:
    return tuple(k + 1 for k in found.freed)


def changed(given: Observation, found: Correction) -> set[int]:
    """The operations (from 1) whose poses are not the observed ones."""
    return {int(k) + 1 for k in np.flatnonzero((found.poses != given.poses).any(axis=(1, 2)))}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_newest_motion_parameter_alone_does_not_suffice(name: str) -> None:
    given = observe(name)
    found = last_only(given)
    assert (found.status, found.schedule) == ("inconsistent", ())
    assert [one.free for one in found.tried] == [(len(given.poses) - 1,)]
    assert found.tried == paper_track(given).tried[:1]


def test_where_the_newest_suffices_it_is_tracking() -> None:
    scene = scenes.fixture_alignment()
    given = scenes.seen(scene, scenes.noisy(scene.goals, np.random.default_rng(2), 1.0, 1.0))
    mine, whole = last_only(given), paper_track(given)
    assert (mine.tried, mine.schedule, mine.freed) == (whole.tried, whole.schedule, whole.freed)
    assert_array_equal(mine.poses, whole.poses)


@pytest.mark.parametrize(("name", "own"), list(zip(EXAMPLES, [(2,), (2,), (5, 1), (2,)], strict=True)))
def test_the_smallest_set_is_smaller_than_the_nested_one(name: str, own: tuple[int, ...]) -> None:
    given = observe(name)
    found = minimal(given)
    assert (found.status, freed(found)) == ("converged", own)
    assert len(own) < len(paper_track(given).freed)
    assert found.gap_after_m < 1e-8


def test_a_set_without_the_newest_has_to_correct_what_it_opens() -> None:
    """{2} would close every equation of its own and leave the stick one clearance low in castle 1."""
    found = minimal(observe("stick_in_tower", low_mm=0.25))
    assert freed(found) == (3, 2)
    assert FreeingTrial(2, (1,), pytest.approx(2.5e-4)) in found.tried  # type: ignore[arg-type]


def test_sets_come_by_size_then_by_recency_up_to_a_limit() -> None:
    assert list(smallest((5, 3, 1))) == [(5,), (3,), (1,), (5, 3), (5, 1), (3, 1), (5, 3, 1)]
    many = tuple(range(30))
    assert len(list(smallest(many))) == MOST_SETS + 1
    assert list(smallest(many))[-1] == many


@pytest.mark.parametrize(
    ("name", "own"), list(zip(EXAMPLES, [(3, 2, 1), (5, 2, 1), (5, 4, 3, 1), (6, 4)], strict=True))
)
def test_without_history_only_operations_that_moved_a_part_last_are_corrected(name: str, own: tuple[int, ...]) -> None:
    given = observe(name, noise_level=1.0)
    found = no_history(given)
    assert (found.status, freed(found)) == ("converged", own)
    assert changed(given, found) == set(own)


def test_without_history_the_stick_of_example_5_2_keeps_its_observed_pose_in_the_cube() -> None:
    given = observe("subassembly_on_castles", noise_level=1.0)

    def stick_in_cube(poses: Array) -> Array:
        placed = compute_placements(given.assembly, given.start, poses)[-1]
        return pose.inverse(placed["cube"]) @ placed["stick"]

    found = no_history(given)
    assert_allclose(stick_in_cube(found.poses), stick_in_cube(given.poses), atol=1e-12)
    assert found.gap_after_m > 1e-3 > paper(given).gap_after_m


def test_without_lost_contacts_the_fixture_of_example_5_3_stays_wrong() -> None:
    given = observe("fixture")
    found, whole = no_disappeared(given), paper(given)
    system = build_contact_equations(given.assembly, given.start, given.poses)
    against = [str(relation.contact) for relation in given.assembly.relations()].index("castle2.py on cube.ny")
    assert (found.status, freed(found), freed(whole)) == ("converged", (5, 3, 1), (5, 3, 2, 1))
    assert_array_equal(found.poses[1], given.poses[1])
    assert system.gaps(found.poses)[against] == found.gap_after_m > 1e-3
    assert system.gaps(whole.poses)[against] <= whole.gap_after_m < 1e-8


def test_where_no_contact_is_lost_it_is_the_paper() -> None:
    given = observe("stick_in_tower", noise_level=2.0)
    assert_array_equal(no_disappeared(given).poses, paper(given).poses)
