"""The corrector of the paper loses with one thing taken away what the theory says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from apo_bench import Correction, Observation
from apo_bench.assembly import build_contact_equations
from apo_bench.correction.baselines.paper import paper
from apo_bench.correction.baselines.track import paper_track
from benchmarks.ablations import last_only, minimal, no_disappeared, no_history
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


@pytest.mark.parametrize(("name", "own"), list(zip(EXAMPLES, [(2,), (2,), (5, 1), (2,)], strict=True)))
def test_the_smallest_set_is_smaller_than_the_nested_one(name: str, own: tuple[int, ...]) -> None:
    given = observe(name)
    found = minimal(given)
    assert (found.status, freed(found)) == ("converged", own)
    assert len(own) < len(paper_track(given).freed)
    assert found.gap_after_m < 1e-8


@pytest.mark.parametrize(
    ("name", "own"), list(zip(EXAMPLES, [(3, 2, 1), (5, 2, 1), (5, 4, 3, 1), (6, 4)], strict=True))
)
def test_without_history_only_operations_that_moved_a_part_last_are_corrected(name: str, own: tuple[int, ...]) -> None:
    given = observe(name, noise_level=1.0)
    found = no_history(given)
    assert (found.status, freed(found)) == ("converged", own)
    assert changed(given, found) == set(own)


def test_without_lost_contacts_the_fixture_of_example_5_3_stays_wrong() -> None:
    given = observe("fixture")
    found, whole = no_disappeared(given), paper(given)
    system = build_contact_equations(given.assembly, given.start, given.poses)
    against = [str(relation.contact) for relation in given.assembly.relations()].index("castle2.py on cube.ny")
    assert (found.status, freed(found), freed(whole)) == ("converged", (5, 3, 1), (5, 3, 2, 1))
    assert_array_equal(found.poses[1], given.poses[1])
    assert system.gaps(found.poses)[against] == found.gap_after_m > 1e-3
    assert system.gaps(whole.poses)[against] <= whole.gap_after_m < 1e-8
