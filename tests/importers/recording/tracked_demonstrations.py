"""Simulated demonstrations as a pose tracker sees them: a stationary camera at an unknown pose, noise, drop-outs.

Every part is seen in the frame of the tracker's own model, 30 times a second, with jitter of the clock, and frames that
are wrong. An error has two parts: one that is drawn for each frame, and one that stays as long as the part rests.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Layout
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import WORKSPACE_MIDDLE_M
from apo_bench.records import TrialConfig
from apo_bench.scenario.layout import draw_layout
from apo_bench.simulation.human.demonstration import demonstrate
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import part_pose
from apo_bench.trial.stages import DEMONSTRATION, LAYOUT, scene_of, stream
from tests.importers.recording.log_forms import RATE_HZ, Tracked

BEGINS_S = 100.0
"""What the tracker's clock says then."""
BEFORE_S = 1.0
"""The log begins so long before the hand takes the first part."""


class Truth(NamedTuple):
    """A demonstration and how its parts moved."""

    scene: Scene
    layout: Layout
    t: Array
    """(n,), [s]."""
    T: Mapping[str, Array]
    """Part -> (n, 4, 4), world, [m]."""


class Errors(NamedTuple):
    """Standard deviations per axis, mm and degrees alike, and how often a frame is missing or wrong."""

    frame: float = 1.0
    stays: float = 0.0
    dropped: float = 0.1
    wrong: float = 0.01
    jitter_s: float = 2e-3


class _Watch:
    def __init__(self, scene: Scene) -> None:
        self.period_s = 1.0 / RATE_HZ
        self._scene = scene
        self.t: list[float] = []
        self.T: list[Mapping[str, Array]] = []

    def __call__(self, data: Any) -> None:
        self.t.append(float(data.time))
        self.T.append({part: part_pose(self._scene.shown, data, part) for part in self._scene.shown.free})


def watched(scenario: str, seed: int, human_error_scale: float = 1.0) -> Truth | None:
    """A simulated demonstration; None if it failed itself."""
    scene = scene_of(TrialConfig(scenario=scenario, seed=seed))
    layout = draw_layout(scene.scenario, stream(seed, LAYOUT), scene.clearance_mm)
    watch = _Watch(scene)
    done = demonstrate(scene, layout, human_error_scale, stream(seed, DEMONSTRATION), watch)
    if done.code != "ok":
        return None
    still = np.arange(-BEFORE_S, -0.5 / RATE_HZ, 1.0 / RATE_HZ)
    parts = {part: np.array([poses[part] for poses in watch.T]) for part in watch.T[0]}
    T = {part: np.concatenate([np.repeat(x[:1], len(still), axis=0), x]) for part, x in parts.items()}
    n = len(still) + len(watch.t)
    T |= {part: np.repeat(layout.start[part][None], n, axis=0) for part in sorted(scene.scenario.follows_site)}
    return Truth(scene, layout, np.concatenate([still, watch.t]) + BEFORE_S, T)


def tracked(truth: Truth, errors: Errors, rng: np.random.Generator) -> tuple[Array, dict[str, Tracked]]:
    """The camera's pose, which nobody knows, and what its tracker reports of every part."""
    X = _camera(rng)
    found = {}
    for i, (part, T) in enumerate(truth.T.items()):
        T_model_part = pose.at(rng.uniform(-0.02, 0.02, 3), rng.uniform(-180.0, 180.0, 3))
        n = len(T)
        xi = errors.frame * rng.standard_normal((n, 6)) + errors.stays * _staying(T, rng)
        xi[rng.random(n) < errors.wrong] *= 30.0
        T_seen = pose.inverse(X) @ T @ pose.exp(xi * np.repeat([1e-3, np.radians(1.0)], 3)) @ pose.inverse(T_model_part)
        kept = rng.random(n) >= errors.dropped
        gap = int(rng.integers(0, n))
        kept[gap : gap + 4] = False
        t = truth.t + np.clip(errors.jitter_s * rng.standard_normal(n), -0.4 / RATE_HZ, 0.4 / RATE_HZ)
        found[part] = Tracked(str(11 + i), T_model_part, BEGINS_S + t[kept], T_seen[kept])
    return X, found


def _camera(rng: np.random.Generator) -> Array:
    """Obliquely from above, from any side, looking at the workspace."""
    turn = rng.uniform(0.0, 2.0 * np.pi)
    up = rng.uniform(0.5, 1.1)
    z = -np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    X[:3, 3] = WORKSPACE_MIDDLE_M - rng.uniform(0.8, 1.2) * z
    return X


def _staying(T: Array, rng: np.random.Generator) -> Array:
    """Errors (n, 6) that change whenever the part has moved: drawn anew at every turn of 30 mm or 10 degrees of way."""
    step = pose.log(pose.inverse(T[:-1]) @ T[1:])
    way = np.linalg.norm(step[:, :3], axis=1) / 0.03 + np.linalg.norm(step[:, 3:], axis=1) / np.radians(10.0)
    walked = np.concatenate([[0.0], np.cumsum(way)])
    at = np.floor(walked).astype(int)
    drawn = rng.standard_normal((at[-1] + 2, 6))
    part = (walked - at)[:, None]
    mixed = (1.0 - part) * drawn[at] + part * drawn[at + 1]
    return np.asarray(mixed / np.sqrt(part**2 + (1.0 - part) ** 2))


def first_places(truth: Truth, found: Mapping[str, Tracked]) -> dict[str, Array | None]:
    """Where every tracked part begins, for a camera file: as the scenario says, or as it was drawn."""
    drawn = truth.scene.scenario.follows_site
    return {part: truth.layout.start[part] if part in drawn else None for part in found}
