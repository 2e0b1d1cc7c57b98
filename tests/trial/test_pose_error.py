"""Pose errors, split into directions that contacts fix and directions that they leave free."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.assembly import Poses, ReachedState, Snapshot, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.trial.pose_error import measure_pose_errors
from tests import scenes

pytestmark = pytest.mark.numeric


def state(poses: Poses) -> Snapshot:
    return Snapshot(poses, penetration_m=0.0, speed_m_s=0.0, spin_rad_s=0.0, released=True)


def reached(scene: scenes.Scene, goals: Array) -> ReachedState:
    after = tuple(state(poses) for poses in compute_placements(scene.assembly, scene.start, goals))
    return ReachedState(after, after[-1])


def errors(scene: scenes.Scene, wrong: Mapping[int, Array]) -> tuple[float | None, float | None]:
    """The errors if operations (from 1) end displaced, in the frames of their parts."""
    goals = scene.nominal_poses.copy()
    for k, T in wrong.items():
        goals[k - 1] = goals[k - 1] @ T
    return measure_pose_errors(scene.assembly, scene.start, scene.nominal_poses, reached(scene, goals))


FIXED_AND_FREE = [
    ({3: scenes.mm(4, 0, 0)}, (0.0, 4.0)),  # the stick along the slot
    ({1: scenes.mm(0, 0, 3)}, (3.0, 0.0)),  # a castle off the table
    ({1: scenes.mm(0, 0, 0, (0.5, 0, 0))}, (np.radians(0.5) * 40, 0.0)),  # tilted
    ({k: scenes.mm(5, 0, 0) for k in (1, 2, 3)}, (0.0, 5.0 * np.sqrt(3))),  # everything together
    ({2: scenes.mm(6, 0, 0), 3: scenes.mm(0, 0, 1)}, (1.0, 6.0)),
]


@pytest.mark.parametrize(("wrong", "expected"), FIXED_AND_FREE)
def test_pure_errors(wrong: Mapping[int, Array], expected: tuple[float, float]) -> None:
    """Root mean square over the three operations, [mm]."""
    measured = errors(scenes.stick_on_castles(), wrong)
    assert measured == pytest.approx(tuple(np.array(expected) / np.sqrt(3)), abs=1e-6)


@given(st.integers(0, 10**6))
@settings(max_examples=8, deadline=None)
def test_the_two_parts_add_up_and_no_frame_matters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = scenes.stick_in_tower()
    xi = rng.standard_normal((3, 6)) * np.repeat([2e-3, 0.02], 3)
    goals = scene.nominal_poses @ pose.exp(xi)
    fixed, free = measure_pose_errors(scene.assembly, scene.start, scene.nominal_poses, reached(scene, goals))
    assert fixed is not None
    assert free is not None
    scaled = xi * [1, 1, 1, 0.04, 0.04, 0.04] * 1e3
    assert fixed**2 + free**2 == pytest.approx((scaled**2).sum() / 3)
    moved = scenes.turned(scene, pose.exp(rng.standard_normal(6)))
    there = reached(moved, moved.nominal_poses @ pose.exp(xi))
    assert measure_pose_errors(moved.assembly, moved.start, moved.nominal_poses, there) == pytest.approx(
        (fixed, free), abs=1e-6
    )
