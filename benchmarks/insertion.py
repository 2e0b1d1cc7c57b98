"""Compare scripted policies in `APOInsert-v0` with the robot's own search: `python benchmarks/insertion.py SCENARIO`.

The last operation by a robot with a hand-eye error of 0.5 mm and 0.1 degrees, poses corrected by the default corrector.
`straight` is the approach alone; `spiral` searches for the hole where the approach is stopped, from the observations of
a learner. `contact-robust+spiral` runs the same trials without an environment. With `--probe` `straight` follows the
probing of the robot, and the comparison is with `contact-robust+probe`. Trials that fail before the operation do not
count.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

import apo_bench
from apo_bench import TrialConfig, build_scene, load_scenario, run_trial

ERROR = "hand_eye:0.5/0.1"
PITCH_MM = 0.35  # of the spiral
ACROSS_MM = 0.2  # along the spiral with each action
RADIUS_MM = 2.0
YAWED_RADIUS_MM = 1.0  # where the part is turned about the insertion axis
YAWS_DEG = (0.0, 1.0, -1.0, 2.0, -2.0)
STALLED = 8  # actions without progress after which the approach counts as stopped
PATIENCE = 40  # actions without resistance for which the approach goes on alone
DEEP_MM = 1.0  # progress after a stop that means that the hole is found
SIDE_N = 1.9  # side force above the press at which walls hold the part


class Straight:
    """The approach alone."""

    def __call__(self, observation: dict[str, Any]) -> Any:
        return np.zeros(7, dtype=np.float32)


class Spiral:
    """A spiral across the insertion axis where the approach is stopped, as long as the part meets resistance.

    The rules are those of the method `+spiral`, at 20 Hz.
    """

    def __init__(self) -> None:
        self.best = math.inf
        self.waited = 0
        self.stopped: float | None = None
        self.press = 0.0
        self.angle = 0.0
        self.yaw = 0
        self.at = np.zeros(2)
        self.turned = 0.0

    def __call__(self, observation: dict[str, Any]) -> Any:
        left = float(observation["plan"][3])
        push = -float(observation["wrench"][2])
        action = np.zeros(7, dtype=np.float32)
        action[6] = -1.0 if left > 20 else 0.0
        if self.stopped is None or left < self.stopped - DEEP_MM:
            self.waited = 0 if left < self.best - 0.05 or self.stopped is not None else self.waited + 1
            self.stopped = None
            self.best = min(self.best, left)
            if self.waited >= STALLED and left > 1.0:
                self.stopped, self.press = left, max(push, 0.1)
                self.waited = self.yaw = 0
                self.angle = 0.0
                self.at = np.zeros(2)
            return action
        self.waited = self.waited + 1 if push < self.press / 4 else 0
        if 0 < self.waited < PATIENCE:
            return action
        r = PITCH_MM * self.angle / (2 * math.pi)
        if r > (YAWED_RADIUS_MM if self.yaw else RADIUS_MM) or math.hypot(*observation["wrench"][:2]) > push + SIDE_N:
            self.yaw = (self.yaw + 1) % len(YAWS_DEG)
            self.angle = r = 0.0
        self.angle += ACROSS_MM / max(r, 0.5)
        r = PITCH_MM * self.angle / (2 * math.pi)
        wanted = r * np.array([math.cos(self.angle), math.sin(self.angle)])
        action[:2] = np.clip(wanted - self.at, -1, 1)
        self.at = self.at + action[:2]
        action[5] = np.clip((YAWS_DEG[self.yaw] - self.turned) / 0.5, -1, 1)
        self.turned += 0.5 * float(action[5])
        return action


POLICIES: dict[str, Callable[[], Any]] = {"straight": Straight, "spiral": Spiral}


def run_episodes(env: Any, policy: Callable[[], Any], trials: range) -> dict[int, bool]:
    """Return the success of each trial that reaches the operation."""
    found = {}
    for trial in trials:
        try:
            observation, info = env.reset(options={"trial": trial})
        except apo_bench.InputError:  # this trial fails before the insertion
            continue
        act = policy()
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(act(observation))
            over = terminated or truncated
        found[trial] = bool(info["success"])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="first trial (0)")
    parser.add_argument("--horizon", type=int, default=200, help="actions of an episode (200)")
    parser.add_argument("--policies", nargs="+", choices=POLICIES, default=list(POLICIES))
    parser.add_argument("--probe", action="store_true", help="probe before the insertion")
    given = parser.parse_args()
    more = {"robot_error": ERROR, "horizon": given.horizon, "probe": given.probe}
    env = gymnasium.make("APOInsert-v0", scenario=given.scenario, disable_env_checker=True, **more)
    trials = range(given.first, given.first + given.trials)
    right = {name: run_episodes(env, POLICIES[name], trials) for name in given.policies}
    for name, ends in right.items():
        print(f"{name}: {sum(ends.values())} of {len(ends)}", flush=True)
    scene = build_scene(load_scenario(given.scenario))
    method = "contact-robust+probe" if given.probe else "contact-robust+spiral"
    settings = TrialConfig(given.scenario, method=method, robot_error=ERROR, fidelity="near-contact")
    own = {trial: bool(run_trial(replace(settings, seed=trial), scene)["success"]) for trial in right[name]}
    print(f"{method}: {sum(own.values())} of {len(own)}")
    for name, ends in right.items():
        won, lost = (sum(a[t] > b[t] for t in own) for a, b in ((ends, own), (own, ends)))
        print(f"{name} but not {method}: {won}; the other way: {lost}")


if __name__ == "__main__":
    main()
