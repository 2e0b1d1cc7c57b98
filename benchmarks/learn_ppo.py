"""Reinforcement learning in `APOInsert-v0`, an example: `python -m benchmarks.learn_ppo --algorithm ppo`.

Needs Stable-Baselines3 and PyTorch. The robot has a hand-eye error of 0.5 mm and 0.1 degrees. Actions move the tip by
little, so that the Gaussian actions of an untrained policy wander within this error. After every `--every` steps the
mean action is tried in evaluation trials, and the judge decides after the release. The settings are those of
Stable-Baselines3; nothing is tuned: the script shows how to begin, and is no baseline.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from apo_bench.envs.evaluation import evaluate_policy

HELD_OUT = 40  # evaluation trials, from 0 on
FIRST = 2_000_000  # the first trial of training
BOUND = 10.0  # of observations, which are logarithms
SIZES: dict[str, Any] = {"shift_mm": 0.1, "turn_deg": 0.02, "reach_mm": 1.5, "reach_deg": 0.2}  # of actions


class Insertion(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Observations as one row of logarithms."""

    def __init__(self, scenario: str, noise_level: float) -> None:
        more: dict[str, Any] = {"noise_level": noise_level, "horizon": 200, "reward": "progress", "layouts": 64}
        more |= {"first_trial": FIRST, "disable_env_checker": True}
        made = gymnasium.make("APOInsert-v0", scenario=scenario, **more, **SIZES)
        super().__init__(gymnasium.wrappers.FlattenObservation(made))
        self.observation_space = gymnasium.spaces.Box(-BOUND, BOUND, self.env.observation_space.shape, np.float32)

    def observation(self, observation: Any) -> Any:
        return squash(observation)


def squash(observation: Any) -> Any:
    """Return logarithms, so that hundreds of mm and tenths are both of the order of one."""
    return np.clip(np.arcsinh(5.0 * observation), -BOUND, BOUND).astype(np.float32)


def count_successes(env: Insertion, act: Callable[[Any], Any]) -> int:
    """Count the successes of a policy in the evaluation trials."""
    return sum(result.success for result in evaluate_policy(env, lambda _: act, range(HELD_OUT)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--algorithm", choices=("ppo", "sac"), default="ppo")
    parser.add_argument("--scenario", default="stick_in_tower")
    parser.add_argument("--noise-level", type=float, default=1.0)
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--every", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()

    from stable_baselines3 import PPO, SAC

    env, held_out = (Insertion(given.scenario, given.noise_level) for _ in range(2))
    model: Any = {"ppo": PPO, "sac": SAC}[given.algorithm]("MlpPolicy", env, seed=given.seed)
    approach = count_successes(held_out, lambda _: np.zeros(6))
    print(f"approach alone: {approach} of {HELD_OUT}", flush=True)
    for steps in range(given.every, given.steps + 1, given.every):
        model.learn(given.every, reset_num_timesteps=False)
        right = count_successes(held_out, lambda observation: model.predict(observation, deterministic=True)[0])
        print(f"{given.algorithm}, {steps} steps: {right} of {HELD_OUT}", flush=True)


if __name__ == "__main__":
    main()
