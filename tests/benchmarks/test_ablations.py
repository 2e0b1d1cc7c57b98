"""What the corrector loses with one thing taken away, as the theory says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import Correction, Observation, correct
from apo_bench.assembly import Try, placements
from apo_bench.assembly.equations import equations
from apo_bench.correction.baselines.paper import paper
from apo_bench.correction.baselines.track import paper_track
from apo_bench.geometry import Array, pose
from apo_bench.records import CORRECTORS
from benchmarks.ablations import MOST_SETS, last_only, minimal, no_disappeared, no_history, smallest
from tests import scenes

CARELESS = ("stick_in_tower", "subassembly_on_castles", "fixture", "pockets")


def seen(name: str, mm: float = 3.0, noise_level: float = 0.0, low_mm: float = 0.0) -> Observation:
    scene, goals = scenes.human_error(name, mm, low_mm)
    return scenes.seen(scene, scenes.noisy(goals, np.random.default_rng(0), noise_level, noise_level))


def counted(found: Correction) -> tuple[int, ...]:
    return tuple(k + 1 for k in found.freed)


def changed(given: Observation, found: Correction) -> set[int]:
    """The operations (from 1) whose goals are not as they were seen."""
    return {k + 1 for k in np.flatnonzero((found.poses != given.poses).any(axis=(1, 2)))}


@pytest.mark.parametrize("name", CORRECTORS)
def test_every_corrector_has_a_name_and_refuses_what_was_not_seen(name: str) -> None:
    given = seen("stick_in_tower")
    assert isinstance(correct(given, name), Correction)
    blind = replace(given, observed=np.array([True, True, False]))
    if name == "contact-robust":
        assert "; not seen: operation 3" in correct(blind, name).sentence
    else:
        assert correct(blind, name).sentence == "operation 3 was not seen"


# last-only


@pytest.mark.parametrize("name", CARELESS)
def test_the_newest_motion_parameter_alone_does_not_suffice(name: str) -> None:
    given = seen(name)
    found = last_only(given)
    n = len(given.poses)
    assert (found.status, found.schedule) == ("inconsistent", ())
    assert [one.free for one in found.tried] == [(n - 1,)]
    assert found.tried == paper_track(given).tried[:1]


def test_where_the_newest_suffices_it_is_as_tracking() -> None:
    scene = scenes.fixture_alignment()
    given = scenes.seen(scene, scenes.noisy(scene.goals, np.random.default_rng(2), 1.0, 1.0))
    mine = last_only(given)
    whole = paper_track(given)
    assert (mine.tried, mine.schedule, mine.freed) == (whole.tried, whole.schedule, whole.freed)
    assert len(mine.tried) == 3
    assert_array_equal(mine.poses, whole.poses)


# minimal


@pytest.mark.parametrize(
    ("name", "freed"),
    [("stick_in_tower", (2,)), ("subassembly_on_castles", (2,)), ("fixture", (5, 1)), ("pockets", (2,))],
)
def test_the_smallest_set_is_smaller_than_the_nested_one(name: str, freed: tuple[int, ...]) -> None:
    given = seen(name)
    found = minimal(given)
    assert (found.status, counted(found)) == ("converged", freed)
    assert len(freed) < len(paper_track(given).freed)
    assert found.gap_after_m < 1e-8
    assert [len(one.free) for one in found.tried] == sorted(len(one.free) for one in found.tried)


def test_a_set_without_the_newest_has_to_mend_what_it_makes() -> None:
    """{2} would close every equation of its own and leave the stick one clearance low in castle 1."""
    found = minimal(seen("stick_in_tower", low_mm=0.25))
    assert counted(found) == (3, 2)
    assert Try(2, (1,), pytest.approx(2.5e-4)) in found.tried


def test_sets_by_size_then_by_recency_and_no_more_than_that() -> None:
    assert list(smallest((5, 3, 1))) == [(5,), (3,), (1,), (5, 3), (5, 1), (3, 1), (5, 3, 1)]
    few = tuple(range(8))
    many = tuple(range(30))
    assert len(list(smallest(few))) == len(set(smallest(few))) == MOST_SETS
    assert len(list(smallest(many))) == MOST_SETS + 1
    assert list(smallest(many))[-1] == many


# no-history


@pytest.mark.parametrize(
    ("name", "freed"),
    [
        ("stick_in_tower", (3, 2, 1)),
        ("subassembly_on_castles", (5, 2, 1)),
        ("fixture", (5, 4, 3, 1)),
        ("pockets", (6, 4)),
    ],
)
def test_without_history_only_those_that_moved_a_part_last_are_corrected(name: str, freed: tuple[int, ...]) -> None:
    given = seen(name, noise_level=1.0)
    found = no_history(given)
    assert (found.status, counted(found)) == ("converged", freed)
    assert changed(given, found) == set(freed)


def relative(poses: dict[str, Array], a: str, b: str) -> Array:
    return pose.inverse(poses[a]) @ poses[b]


def test_without_history_the_stick_of_example_5_2_stays_as_crooked_in_the_cube_as_it_was_seen() -> None:
    given = seen("subassembly_on_castles", noise_level=1.0)
    after = [dict(placements(given.assembly, given.start, g)[-1]) for g in (given.poses, no_history(given).poses)]
    assert_allclose(relative(after[1], "cube", "stick"), relative(after[0], "cube", "stick"), atol=1e-12)
    assert no_history(given).gap_after_m > 1e-3 > paper(given).gap_after_m


@pytest.mark.parametrize("noise_level", [0.0, 1.0])
def test_without_history_the_cubes_of_fig_6_stay_where_they_were_seen_on_the_stick(noise_level: float) -> None:
    given = seen("pockets", noise_level=noise_level)
    found = no_history(given)
    assert_array_equal(found.poses[[1, 2, 4]], given.poses[[1, 2, 4]])
    assert found.gap_after_m > 1e-3


def test_without_history_the_end_of_the_simple_case_is_the_same() -> None:
    given = seen("stick_in_tower", noise_level=1.0)
    assert_allclose(no_history(given).poses, paper(given).poses, atol=1e-12)


# no-disappeared


def test_without_what_disappeared_the_fixture_of_example_5_3_stays_wrong() -> None:
    given = seen("fixture")
    found = no_disappeared(given)
    whole = paper(given)
    system = equations(given.assembly, given.start, given.poses)
    against = [str(relation.contact) for relation in given.assembly.relations()].index("castle2.py on cube.ny")
    assert (found.status, counted(found), counted(whole)) == ("converged", (5, 3, 1), (5, 3, 2, 1))
    assert_array_equal(found.poses[1], given.poses[1])
    assert system.gaps(found.poses)[against] == found.gap_after_m > 1e-3
    assert system.gaps(whole.poses)[against] <= whole.gap_after_m < 1e-8
    assert not np.array_equal(whole.poses[1], given.poses[1])


def test_without_what_disappeared_the_first_cube_of_fig_6_is_no_candidate_but_settled() -> None:
    given = seen("pockets", noise_level=1.0)
    found = no_disappeared(given)
    assert counted(found) == (6, 5, 4, 3, 2)
    assert changed(given, found) == {1, 2, 3, 4, 5, 6}
    assert_allclose(found.poses[0, 2], [0, 0, 1, 0.025], atol=1e-9)


def test_where_nothing_disappeared_it_is_the_paper() -> None:
    given = seen("stick_in_tower", noise_level=2.0)
    assert_array_equal(no_disappeared(given).poses, paper(given).poses)
    assert no_disappeared(given).sentence == paper(given).sentence == "every contact holds within 0.1 mm"
