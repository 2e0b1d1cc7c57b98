"""Scripted policies in `APOInsert-v0` beside the search of the bench: `python benchmarks/insertion.py SCENARIO`.

The last operation, by a robot whose hand and eye are off by 0.5 mm and 0.1 degrees, poses corrected by the default
corrector; trials 0, 1, .., of which those count that come to the operation. `straight` does nothing: the approach
alone; `spiral` looks for the hole where the approach is stopped, from what every learner sees; `search` is what
`contact-robust+search` does in the bench in the same trials. Prints successes, and control steps a second of one core.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

import apo_bench
from apo_bench import TrialSettings, build_scene, load_scenario, run_trial

ERROR = "hand_eye:0.5/0.1"
PITCH_MM = 0.4
ACROSS_MM = 0.5
"""Of the spiral, and how far it goes with each action."""
RADIUS_MM = 2.5
STALLED = 8
"""The approach is stopped when nothing more is left behind for so many actions."""
DEEP_MM = 1.0
SIDE_N = 0.5
"""Held by walls harder than this, the spiral waits until the arm has given way."""
YAWS_DEG = (0.0, 1.0, -1.0, 2.0, -2.0)


class Straight:
    """The approach alone."""

    def __call__(self, seen: dict[str, Any]) -> Any:
        return np.zeros(7, dtype=np.float32)


class Spiral:
    """Across in a spiral where the approach is stopped, at several turns about the way in; then on from there."""

    def __init__(self) -> None:
        self.best = math.inf
        self.stalled = 0
        self.angle: float | None = None
        self.yaw = 0
        self.waited = 0
        self.at = np.zeros(2)
        self.turned = 0.0

    def __call__(self, seen: dict[str, Any]) -> Any:
        left = float(seen["plan"][3])
        if left < self.best - (0.05 if self.angle is None else DEEP_MM):
            self.best, self.stalled, self.angle, self.at = left, 0, None, np.zeros(2)
        self.stalled += 1
        action = np.zeros(7, dtype=np.float32)
        if self.stalled < STALLED:
            return action
        side = math.hypot(*seen["wrench"][:2])
        if side > SIDE_N and self.waited < 20:
            self.waited += 1
            return action
        self.waited = 0
        if self.angle is None:
            self.angle = 0.0
        r = PITCH_MM * self.angle / (2 * math.pi)
        if r > RADIUS_MM:
            self.yaw = (self.yaw + 1) % len(YAWS_DEG)
            self.angle = r = 0.0
        self.angle += ACROSS_MM / max(r, 0.5)
        r = PITCH_MM * self.angle / (2 * math.pi)
        wanted = r * np.array([math.cos(self.angle), math.sin(self.angle)])
        action[:2] = np.clip(wanted - self.at, -1, 1)
        self.at = self.at + action[:2]
        turn = float(np.clip((YAWS_DEG[self.yaw] - self.turned) / 0.5, -1, 1))
        action[5] = turn
        self.turned += 0.5 * turn
        action[6] = -1.0 if left > 20 else 0.0
        return action


def episodes(env: Any, policy: Callable[[], Any], trials: range) -> dict[int, tuple[bool, int, float]]:
    """Trial -> success, actions, actions a second; of trials that come to the operation."""
    found = {}
    for trial in trials:
        try:
            seen, _ = env.reset(options={"trial": trial})
        except apo_bench.InputError:
            continue
        act = policy()
        actions = 0
        over = False
        begun = time.process_time()
        while not over:
            before = time.process_time()
            seen, _, over, _, info = env.step(act(seen))
            actions += 1
        found[trial] = info["success"], actions, (actions - 1) / (before - begun)
    return found


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("scenario")
    asked.add_argument("--trials", type=int, default=10)
    asked.add_argument("--horizon", type=int, default=200, help="actions of an episode")
    given = asked.parse_args()
    env = gymnasium.make(
        "APOInsert-v0", scenario=given.scenario, horizon=given.horizon, robot_error=ERROR, disable_env_checker=True
    )
    trials: list[int] = []
    for name, policy in {"straight": Straight, "spiral": Spiral}.items():
        found = episodes(env, policy, range(given.trials))
        trials = list(found)
        speed = np.mean([each[2] for each in found.values()])
        print(f"{name}: {sum(each[0] for each in found.values())} of {len(trials)}, {speed:.0f} steps/s", flush=True)
    scene = build_scene(load_scenario(given.scenario))
    settings = TrialSettings(given.scenario, method="contact-robust+search", robot_error=ERROR, fidelity="contact")
    searched = [run_trial(replace(settings, seed=trial), scene)["success"] for trial in trials]
    print(f"search: {sum(map(bool, searched))} of {len(trials)}")


if __name__ == "__main__":
    main()
