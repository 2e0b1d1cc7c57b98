"""Reinforcement learning in `APOInsert-v0`, an example: `python -m benchmarks.learn_ppo`.

Needs Stable-Baselines3 and PyTorch. The policy searches for the hole: it decides at 5 Hz where the part does not
advance; elsewhere the approach goes on with its last action. In training an episode ends with a reward of 1 where the
part is 5 mm inside. In evaluation trials the judge decides after the release: on the approach alone, on the untrained
policy, and on the trained one by its mean and by its random actions. The settings are those of Stable-Baselines3, with
normalised observations; nothing is tuned.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from typing import Any

import gymnasium
import numpy as np

from apo_bench.envs.evaluation import evaluate_policy

HELD_OUT = 40  # evaluation trials, from 0 on
FIRST = 2_000_000  # the first trial of training
LAYOUTS = 64  # training starts
SIZES: dict[str, Any] = {"shift_mm": 0.1, "turn_deg": 0.02, "reach_mm": 1.5, "reach_deg": 0.2}  # of actions
REPEATS = 4  # periods of an action: 5 Hz
ADVANCE_MM = 0.2  # progress of a period from which an action is held
MOST_PERIODS = 120  # of an episode of training
ENTERED_MM = 5.0  # depth at which it ends


class Search(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An action lasts for `REPEATS` periods, and as long as the part advances; the first one is no displacement."""

    def reset(self, **given: Any) -> tuple[Any, dict[str, Any]]:
        seen, info = self.env.reset(**given)
        self._left = float(seen["plan"][3])
        self._held = np.zeros(6, np.float32)
        self._advances = True
        return seen, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        total, waited = 0.0, 0
        while True:
            if not self._advances:
                self._held = action
                waited += 1
            seen, reward, terminated, truncated, info = self.env.step(self._held)
            total += float(reward)
            self._advances = self._left - float(seen["plan"][3]) > ADVANCE_MM
            self._left = float(seen["plan"][3])
            if terminated or truncated or waited >= REPEATS:
                return seen, total, terminated, truncated, info


class Entrance(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The reward is 1 where the part is `ENTERED_MM` deep in the hole, which ends the episode."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        seen, _, terminated, truncated, info = self.env.step(action)
        entered = bool(info["depth_mm"] > ENTERED_MM)
        return seen, float(entered), terminated or entered, truncated, info


def make(scenario: str, noise_level: float, trains: bool) -> Any:
    """Make the environment for training, or for evaluation by the judge."""
    more: dict[str, Any] = {"scenario": scenario, "noise_level": noise_level, "layouts": LAYOUTS, "first_trial": FIRST}
    env = gymnasium.make("APOInsert-v0", disable_env_checker=True, **more, **SIZES)
    if trains:
        env = Entrance(gymnasium.wrappers.TimeLimit(env, MOST_PERIODS))
    return gymnasium.wrappers.FlattenObservation(Search(env))


def count_successes(env: Any, act: Any) -> int:
    """Count the successes of a policy in the evaluation trials."""
    return sum(result.success for result in evaluate_policy(env, lambda _: act, range(HELD_OUT)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="stick_in_tower")
    parser.add_argument("--noise-level", type=float, default=0.25)
    parser.add_argument("--steps", type=int, default=18_432, help="decisions of the policy in training (18432)")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()

    from stable_baselines3 import PPO
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    held_out = make(given.scenario, given.noise_level, trains=False)
    env = VecNormalize(
        DummyVecEnv([lambda: Monitor(make(given.scenario, given.noise_level, trains=True))]), norm_reward=False
    )
    model = PPO("MlpPolicy", env, seed=given.seed, verbose=1)

    def report(name: str, deterministic: bool) -> None:
        def act(seen: Any) -> Any:
            return model.predict(env.normalize_obs(seen), deterministic=deterministic)[0]

        print(f"{name}: {count_successes(held_out, act)} of {HELD_OUT}", flush=True)

    print(f"approach alone: {count_successes(held_out, lambda _: np.zeros(6))} of {HELD_OUT}", flush=True)
    report("untrained, random actions", deterministic=False)
    model.learn(given.steps)
    report("trained, mean action", deterministic=True)
    report("trained, random actions", deterministic=False)


if __name__ == "__main__":
    main()
