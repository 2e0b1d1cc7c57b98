"""Tracking (Section 4.2): which sets are tried, what is taken apart, and where everything ends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from apo_bench import Correction
from apo_bench.correction.baselines.track import paper_track
from apo_bench.geometry import Array, is_rigid
from apo_bench.records import CODES
from tests import scenes
from tests.correction.baselines.test_paper import contradiction

LAST = {
    "stick_in_tower": ((3,), (3, 2)),
    "subassembly_on_castles": ((5,), (5, 4), (5, 4, 3), (5, 4, 3, 2)),
    "fixture": ((5,), (5, 3), (5, 3, 2)),
    "pockets": ((6,), (6, 5), (6, 5, 3), (6, 5, 3, 2)),
}
"""The sets that are tried at the last step, counted from 1: all but the last of them fail."""
SCHEDULE = {
    "stick_in_tower": "1 2 -2 2 3",
    "subassembly_on_castles": "1 2 3 4 -4 -3 -2 2 3 4 5",
    "fixture": "1 2 3 4 -4 -3 -2 2 3 4 5",
    "pockets": "1 2 3 4 5 -5 -4 -3 -2 2 3 4 5 6",
}
LEFT_PER_MM = {"stick_in_tower": 0.5, "subassembly_on_castles": 0.25, "fixture": 0.22, "pockets": 0.49}
"""What a set that fails leaves at least, mm per mm that a part was put aside."""
SIZES = st.floats(1.5, 4.0).flatmap(lambda size: st.sampled_from([size, -size]))


def counted(found: Correction, step: int) -> tuple[tuple[int, ...], ...]:
    """The sets that were tried at a step, all counted from 1."""
    return tuple(tuple(k + 1 for k in one.free) for one in found.tried if one.step == step - 1)


def spelled(found: Correction) -> str:
    """`1 2 -2 2 3`: done, undone, from 1."""
    return " ".join(f"{'-' if undo else ''}{k + 1}" for k, undo in found.schedule)


@pytest.mark.parametrize("name", LAST)
@given(size=SIZES, low=st.sampled_from([0.0, 0.25]))
@settings(max_examples=8, deadline=None)
def test_the_sets_of_the_paper_whatever_the_size_of_the_error(name: str, size: float, low: float) -> None:
    scene, goals = scenes.human_error(name, size, low)
    found = paper_track(scenes.seen(scene, goals))
    n = len(goals)
    assert counted(found, n) == LAST[name]
    assert found.status == "converged"
    assert {one.step for one in found.tried[: -len(LAST[name])]} <= {3, 4}  # a stick that lies low in its hole
    *failed, last = (one.gap_m for one in found.tried if one.step == n - 1)
    assert min(failed) > LEFT_PER_MM[name] * abs(size) * 1e-3
    assert last < 1e-8
    assert tuple(k + 1 for k in found.freed) == LAST[name][-1]
    assert spelled(found) == SCHEDULE[name]


def walked(found: Correction) -> dict[int, Array]:
    """What is done at the end, with the motion parameters in force; every undo takes back what was done."""
    assert found.step_poses is not None
    done: dict[int, Array] = {}
    for (k, undo), T in zip(found.schedule, found.step_poses, strict=True):
        if undo:
            assert_array_equal(done.pop(k), T)
        else:
            assert k not in done
            done[k] = T
    return done


@pytest.mark.parametrize("name", LAST)
@pytest.mark.parametrize("level", [0.05, 1.0])
def test_the_schedule_ends_at_the_goals(name: str, level: float) -> None:
    scene = scenes.ALL[name]()
    for seed in range(3):
        goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), level, level)
        found = paper_track(scenes.seen(scene, goals))
        assert found.ok
        done = walked(found)
        assert sorted(done) == list(range(len(goals)))
        assert_array_equal(np.array([done[k] for k in sorted(done)]), found.poses)
        assert is_rigid(found.poses).all()


def test_no_set_suffices() -> None:
    found = paper_track(contradiction())
    assert (found.status, found.sentence) == ("inconsistent", CODES["inconsistent"])
    assert [one.free for one in found.tried] == [(0,)]
    assert found.tried[0].gap_m == pytest.approx(0.005)
    assert found.gap_after_m == found.gap_before_m == pytest.approx(0.008)
    assert (found.schedule, found.step_poses, found.freed) == ((), None, ())
    assert_array_equal(found.poses, contradiction().poses)
