"""APOAssemble-v0: one operation after the other under the control of APOInsert-v0."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

from apo_bench.envs.apo_assemble import APOAssemble

STILL = np.zeros(7, dtype=np.float32)  # with the number of the gripper
OPEN = np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32)


def whole_episode(env: Any, trial: int, copied: bool = False) -> tuple[list[int], float, dict[str, Any]]:
    """Which operation each action was seen in, the sum of rewards, and what was said at the end, of the approach."""
    seen, _ = env.reset(options={"trial": trial})
    done, won, over, info = [], 0.0, False, {}
    while not over:
        done.append(int(np.argmax(seen["operation"])) + 1)
        if copied and len(done) % 20 == 0:
            env = pickle.loads(pickle.dumps(env))
        seen, reward, over, _, info = env.step(STILL)
        assert env.observation_space.contains(seen)
        won += reward
    return done, won, info


def test_it_passes_the_check_of_gymnasium() -> None:
    env = gymnasium.make("APOAssemble-v0", scenario="block_on_block", grasp="weld", layouts=1).unwrapped
    assert isinstance(env, APOAssemble)
    check_env(env, skip_render_check=True)


def test_where_nothing_is_wrong_the_approach_alone_assembles_all_and_so_does_a_copy() -> None:
    env = APOAssemble(corrector="oracle", robot_error="none", reward="progress", gripper=True)
    done, won, info = whole_episode(env, 3)
    assert (np.diff(done) >= 0).all()
    assert set(done) == {1, 2, 3}
    assert info["success"]
    assert 1.5 < won <= 2.0 + 1e-6
    assert env.truth.shape == (3, 4, 4)
    assert whole_episode(env, 3, copied=True) == (done, won, info)


def test_the_last_part_dropped_before_its_mouth_makes_the_whole_wrong() -> None:
    env = APOAssemble(corrector="oracle", robot_error="none", gripper=True)
    seen, _ = env.reset(options={"trial": 3})
    over = False
    while not over:
        last = seen["operation"][2] == 1.0
        seen, reward, over, _, info = env.step(OPEN if last else STILL)
    assert last
    assert (reward, info["success"], info["code"]) == (0.0, False, "overlap")
