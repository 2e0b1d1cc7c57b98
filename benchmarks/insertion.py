"""Scripted policies in `APOInsert-v0` beside the search of the bench: `python benchmarks/insertion.py SCENARIO`.

The last operation, by a robot whose hand and eye are off by 0.5 mm and 0.1 degrees, poses corrected by the default
corrector; trials from `--first` on, of which those count that come to the operation. `straight` does nothing, so it is
the approach alone; `spiral` looks for the hole where the approach is stopped, from what every learner sees; `search` is
what `contact-robust+spiral` does in the bench in the same trials. With `--feels`, `straight` after all that a robot
that feels does before it, beside `contact-robust+probe`. Prints successes, and control steps a second of a core.
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
from apo_bench import TrialConfig, build_scene, load_scenario, run_trial

ERROR = "hand_eye:0.5/0.1"
PITCH_MM = 0.35
ACROSS_MM = 0.2
"""Of the spiral, and how far it goes with each action."""
RADIUS_MM = 2.0
YAWED_RADIUS_MM = 1.0
"""How far off a hole is looked for, straight and turned about the way in."""
YAWS_DEG = (0.0, 1.0, -1.0, 2.0, -2.0)
STALLED = 8
"""The approach is stopped when nothing more is left behind for so many actions."""
PATIENCE = 40
"""Where nothing pushes back, the approach is left alone for so many actions."""
DEEP_MM = 1.0
"""So much deeper than where it was stopped, it has found the hole."""
SIDE_N = 1.9
"""Pushed harder than this and the press from the side, it is held by walls."""


class Straight:
    """The approach alone."""

    def __call__(self, seen: dict[str, Any]) -> Any:
        return np.zeros(7, dtype=np.float32)


class Spiral:
    """Across in a spiral where the approach is stopped, as long as something pushes back; what drops in is left alone.

    The laws are those of the search in the bench, at 20 Hz: moving on across while the part drops in, or against walls
    that hold it, pushes neighbours away that stand loose.
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

    def __call__(self, seen: dict[str, Any]) -> Any:
        left = float(seen["plan"][3])
        push = -float(seen["ft_sensor"][2])
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
        if r > (YAWED_RADIUS_MM if self.yaw else RADIUS_MM) or math.hypot(*seen["ft_sensor"][:2]) > push + SIDE_N:
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
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--horizon", type=int, default=200, help="actions of an episode")
    asked.add_argument("--policies", nargs="+", choices=POLICIES, help="default: both; straight with --feels")
    asked.add_argument("--feels", action="store_true", help="after what `+probe` does, beside `contact-robust+probe`")
    given = asked.parse_args()
    more = {"robot_error": ERROR, "horizon": given.horizon, "probing": given.probing}
    env = gymnasium.make("APOInsert-v0", scenario=given.scenario, disable_env_checker=True, **more)
    trials = range(given.first, given.first + given.trials)
    right: dict[str, dict[int, bool]] = {}
    for name in given.policies or [*POLICIES][: 1 if given.probing else 2]:
        found = episodes(env, POLICIES[name], trials)
        right[name] = {trial: each[0] for trial, each in found.items()}
        speed = np.mean([each[2] for each in found.values()])
        print(f"{name}: {sum(right[name].values())} of {len(found)}, {speed:.0f} steps/s", flush=True)
    scene = build_scene(load_scenario(given.scenario))
    method = "contact-robust+probe" if given.probing else "contact-robust+spiral"
    settings = TrialConfig(given.scenario, method=method, robot_error=ERROR, fidelity="near-contact")
    bench = {trial: bool(run_trial(replace(settings, seed=trial), scene)["success"]) for trial in right[name]}
    alone = [sum(right[name][t] > bench[t] for t in bench), sum(bench[t] > right[name][t] for t in bench)]
    print(f"{method}: {sum(bench.values())} of {len(bench)}; {name} and not it: {alone[0]}, the other way {alone[1]}")


if __name__ == "__main__":
    main()
