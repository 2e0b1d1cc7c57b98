"""Reinforcement learning in `APOInsert-v0`, an example: `python -m benchmarks.learn_ppo --algorithm ppo`.

Needs Stable-Baselines3 (2.9.2) and PyTorch. The last operation of a scenario by a robot that is off by 0.5 mm and 0.1
degrees, from layouts that no trial has; the learner leads the tip and never opens the hand, as the approach does where
it arrives. After every --every steps its mean action is tried in held-out layouts, trials from 0 on, and judged after
release; at the end in more of them, beside the approach alone. Adds a line for each try to results/learn_ppo.jsonl, and
writes docs/results/reinforcement.md of all lines; that alone without an algorithm.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from apo_bench import InputError
from benchmarks.learn_insert import FIRST, made
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "learn_ppo.jsonl"
PAGE = ROOT / "docs" / "results" / "reinforcement.md"
NOISE_LEVEL = 0.5
HORIZON = 120
TRIED = 10
"""Held-out layouts after every so many steps."""
IN_THE_END = 40
BOUND = 10.0
"""What is seen is squashed, so that a network is not told hundreds of mm."""


class Led(gymnasium.Wrapper[Any, Any, Any, Any]):
    """What is seen as one row of logarithms, and no gripper."""

    def __init__(self, env: Any) -> None:
        super().__init__(gymnasium.wrappers.FlattenObservation(env))
        size = self.env.observation_space.shape
        self.observation_space = gymnasium.spaces.Box(-BOUND, BOUND, size, np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (6,), np.float32)

    def reset(self, **more: Any) -> tuple[Any, dict[str, Any]]:
        seen, info = self.env.reset(**more)
        return _told(seen), info

    def step(self, action: Any) -> Any:
        seen, *rest = self.env.step(np.append(action, 0.0).astype(np.float32))
        return (_told(seen), *rest)


def _told(seen: Any) -> Any:
    return np.clip(np.arcsinh(5.0 * seen), -BOUND, BOUND).astype(np.float32)


def env_of(scenario: str) -> Led:
    return Led(made(scenario, NOISE_LEVEL, horizon=HORIZON, reward="progress", layouts=64, first_trial=2 * FIRST))


def right(env: Led, act: Callable[[Any], Any], most: int) -> list[bool]:
    """Of so many held-out layouts that come to the operation, by the judge after release."""
    found: list[bool] = []
    trial = 0
    while len(found) < most:
        try:
            seen, _ = env.reset(seed=trial, options={"trial": trial})
        except InputError:
            trial += 1
            continue
        over = False
        while not over:
            seen, _, over, _, info = env.step(act(seen))
        found.append(bool(info["success"]))
        trial += 1
    return found


def train(algorithm: str, scenario: str, steps: int, every: int, seed: int) -> Iterator[dict[str, Any]]:
    """A line for each try."""
    from stable_baselines3 import PPO, SAC

    env, tried = env_of(scenario), env_of(scenario)
    usual: dict[str, Any] = {"seed": seed, "device": "cpu", "policy_kwargs": {"net_arch": [128, 128]}}
    model: Any
    if algorithm == "ppo":
        usual["policy_kwargs"] |= {"log_std_init": -1.5}
        model = PPO("MlpPolicy", env, n_steps=1000, batch_size=200, **usual)
    else:
        model = SAC("MlpPolicy", env, learning_starts=1000, **usual)
    about = {"algorithm": algorithm, "scenario": scenario, "seed": seed, "mujoco": mujoco.__version__}
    still = np.zeros(6)
    found = right(tried, lambda _: still, IN_THE_END)
    yield {**about, "policy": "straight", "steps": 0, "right": sum(found), "of": IN_THE_END, "minutes": 0.0}
    begun = time.process_time()
    for count in range(every, steps + 1, every):
        model.learn(every, reset_num_timesteps=False)
        minutes = (time.process_time() - begun) / 60.0
        most = IN_THE_END if count + every > steps else TRIED
        found = right(tried, lambda seen: model.predict(seen, deterministic=True)[0], most)
        yield {**about, "policy": algorithm, "steps": count, "right": sum(found), "of": most, "minutes": minutes}


def _page(lines: list[dict[str, Any]]) -> Iterator[str]:
    yield from ("# Reinforcement learning, an example", "")
    yield "Written by `python -m benchmarks.learn_ppo --algorithm ALGORITHM`: PPO and SAC of Stable-Baselines3 in"
    yield f'[`APOInsert-v0`](../guide/insertion.md), `reward="progress"`, hand and eye off by {NOISE_LEVEL:g} mm and'
    yield f"{NOISE_LEVEL / 5:g} degrees. One seed each, minutes of one core; the mean action in held-out layouts, right by"
    yield "the judge after release. `straight` is the approach alone in the same layouts."
    yield from ("", "| algorithm | scenario | steps | minutes | right |", "|---|---|--:|--:|--:|")
    for line in lines:
        yield (
            f"| {line['policy']} | `{line['scenario']}` | {line['steps']} | {line['minutes']:.0f} | "
            f"{line['right']} of {line['of']} |"
        )
    yield ""
    yield "Nothing was tuned, and so few steps make it worse than doing nothing: this is how to begin, and no baseline."
    yield "[`dagger-insert`](dagger-insert.md) learned from a teacher instead."


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--algorithm", choices=("ppo", "sac"))
    asked.add_argument("--scenario", default="stick_in_tower")
    asked.add_argument("--steps", type=int, default=50_000)
    asked.add_argument("--every", type=int, default=10_000)
    asked.add_argument("--seed", type=int, default=0)
    given = asked.parse_args()
    if given.algorithm:
        for line in train(given.algorithm, given.scenario, given.steps, given.every, given.seed):
            print(line, flush=True)
            with RESULT.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
    lines = [json.loads(line) for line in RESULT.read_text(encoding="utf-8").splitlines()]
    PAGE.write_text(with_mujoco("\n".join(_page(lines)) + "\n", [lines[0]["mujoco"]]), encoding="utf-8")


if __name__ == "__main__":
    main()
