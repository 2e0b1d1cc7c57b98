"""Reinforcement learning in `APOInsert-v0`, an example: `python -m benchmarks.learn_ppo --algorithm ppo`.

Needs Stable-Baselines3 and PyTorch. The robot has a hand-eye error of 0.5 mm and 0.1 degrees; the learner moves the tip
and never opens the hand. After every `--every` steps the mean action is tried in held-out layouts, and the judge
decides after the release. Nothing is tuned: the script shows how to begin, and is no baseline.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Callable
from itertools import count
from typing import Any

import gymnasium
import numpy as np

from apo_bench import InputError

HELD_OUT = 40  # layouts, trials from 0 on
FIRST = 2_000_000  # the first trial of training
BOUND = 10.0  # of observations, which are logarithms


class Insertion(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Observations as one row of logarithms, and no action of the gripper."""

    def __init__(self, scenario: str) -> None:
        more: dict[str, Any] = {"robot_error": "hand_eye:0.5/0.1", "horizon": 120, "reward": "progress", "layouts": 64}
        made = gymnasium.make("APOInsert-v0", scenario=scenario, first_trial=FIRST, disable_env_checker=True, **more)
        super().__init__(gymnasium.wrappers.FlattenObservation(made))
        shape = self.env.observation_space.shape
        self.observation_space = gymnasium.spaces.Box(-BOUND, BOUND, shape, np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (6,), np.float32)

    def reset(self, **more: Any) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(**more)
        return squash(observation), info

    def step(self, action: Any) -> Any:
        observation, *rest = self.env.step(np.append(action, 0.0).astype(np.float32))
        return (squash(observation), *rest)


def squash(observation: Any) -> Any:
    """Return logarithms, so that hundreds of mm and tenths are both of the order of one."""
    return np.clip(np.arcsinh(5.0 * observation), -BOUND, BOUND).astype(np.float32)


def count_successes(env: Insertion, act: Callable[[Any], Any]) -> int:
    """Count the successes of a policy in the held-out layouts."""
    ends: list[bool] = []
    for trial in count():
        if len(ends) == HELD_OUT:
            break
        try:
            observation, info = env.reset(seed=trial, options={"trial": trial})
        except InputError:  # this trial fails before the insertion
            continue
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(act(observation))
            over = terminated or truncated
        ends.append(bool(info["success"]))
    return sum(ends)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--algorithm", choices=("ppo", "sac"), default="ppo")
    parser.add_argument("--scenario", default="stick_in_tower")
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--every", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()

    from stable_baselines3 import PPO, SAC

    env, held_out = Insertion(given.scenario), Insertion(given.scenario)
    network: dict[str, Any] = {"net_arch": [128, 128]}
    model: Any
    if given.algorithm == "ppo":
        network["log_std_init"] = -1.5
        model = PPO("MlpPolicy", env, n_steps=1000, batch_size=200, seed=given.seed, policy_kwargs=network)
    else:
        model = SAC("MlpPolicy", env, learning_starts=1000, seed=given.seed, policy_kwargs=network)
    approach = count_successes(held_out, lambda _: np.zeros(6))
    print(f"approach alone: {approach} of {HELD_OUT}", flush=True)
    for steps in range(given.every, given.steps + 1, given.every):
        model.learn(given.every, reset_num_timesteps=False)
        right = count_successes(held_out, lambda observation: model.predict(observation, deterministic=True)[0])
        print(f"{given.algorithm}, {steps} steps: {right} of {HELD_OUT}", flush=True)


if __name__ == "__main__":
    main()
