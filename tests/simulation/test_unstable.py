"""A simulation that fails is a result with a code, whatever MuJoCo raises, and nothing of it is left in the scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, TrialConfig
from apo_bench.assembly import Observation
from apo_bench.simulation.human.hands import Hands
from apo_bench.simulation.scene import settling
from apo_bench.simulation.scene.settling import settle
from apo_bench.trial.run import noise_of, run_trial
from apo_bench.trial.trial_stages import (
    SimulatedDemonstration,
    demonstration_failure,
    observe_demonstration,
    scene_of,
    simulate_demonstration,
)

SETTINGS = TrialConfig("block_on_block", method="uncorrected", noise_mm=0.5, noise_deg=0.5, seed=1)
TICKS = 40
"""After so many ticks the state is changed."""


@cache
def scene() -> Scene:
    return scene_of(SETTINGS)


@cache
def simulated() -> SimulatedDemonstration:
    return simulate_demonstration(scene(), SETTINGS.human_error_scale, SETTINGS.seed)


@pytest.fixture(autouse=True)
def folder_of_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes its warnings into the current folder."""
    monkeypatch.chdir(tmp_path)


def disturb(change: Callable[[Any], None]) -> Callable[[Any], None]:
    """Change the state of a simulation once."""
    ticks = 0

    def watch(data: Any) -> None:
        nonlocal ticks
        ticks += 1
        if ticks == TICKS:
            change(data)

    return watch


def hurl(data: Any) -> None:
    data.qvel[-6:] = 1e7


def lose(data: Any) -> None:
    data.qpos[-7:-4] = np.nan


def fail(*_: Any) -> None:
    raise mujoco.FatalError("mj_sleep: found sleeping tree 0 in island 0")


@pytest.mark.parametrize("change", [hurl, lose])
def test_a_replay_that_becomes_unstable_is_a_failure_with_its_code(change: Callable[[Any], None]) -> None:
    before = run_trial(SETTINGS, scene(), simulated=simulated())
    row = run_trial(SETTINGS, scene(), simulated=simulated(), watch=disturb(change))
    assert (row["success"], row["failure_code"], row["failure_operation"]) == (False, "unstable_simulation", 1)
    assert row["failure_stage"] in ("pick", "lift", "carry", "attach", "release", "depart")
    assert row["sentence"] == "the simulation became unstable in operation 1"
    assert row["final_poses"] is None
    assert run_trial(SETTINGS, scene(), simulated=simulated()) == before


@pytest.mark.parametrize("change", [hurl, lose, fail])
def test_a_demonstration_that_becomes_unstable_has_failed(
    change: Callable[[Any], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    step = Hands._step
    steps = 0

    def disturbed(hands: Hands, n: int) -> None:
        nonlocal steps
        steps += 1
        if steps == TICKS:
            change(hands.data)
        step(hands, n)

    monkeypatch.setattr(Hands, "_step", disturbed)
    demonstration = simulate_demonstration(scene(), SETTINGS.human_error_scale, SETTINGS.seed).demonstration
    assert demonstration.code == "demonstration_failed"
    assert demonstration_failure(demonstration).sentence.endswith(": the simulation became unstable")
    assert np.isfinite(demonstration.poses).all()


def test_where_settling_fails_poses_stay_as_observed(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: Observation = observe_demonstration(simulated(), noise_of(SETTINGS, scene(), simulated()), SETTINGS.seed)
    assert not np.array_equal(np.asarray(settle(seen)), seen.poses)
    monkeypatch.setattr(settling.mujoco, "mj_step", fail)
    np.testing.assert_array_equal(np.asarray(settle(seen)), seen.poses)
