"""Simulated demonstrations as a tracker observes them: a stationary camera, 30 frames a second, noise of each frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.records import TrialConfig
from apo_bench.scenario.layout import draw_layout
from apo_bench.simulation.human.demonstration import demonstrate
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import get_part_pose
from apo_bench.trial.stages import DEMONSTRATION, LAYOUT, scene_of, stream
from tests.recorded import CAMERA, RATE_HZ

BEFORE_S = 1.0
"""The log begins at this time before the hand takes the first part."""


class Watch:
    """Poses of all parts at the rate of the camera."""

    def __init__(self, scene: Scene) -> None:
        self.period_s = 1.0 / RATE_HZ
        self.scene = scene
        self.t: list[float] = []
        self.T: list[dict[str, Array]] = []

    def __call__(self, data: Any) -> None:
        self.t.append(float(data.time))
        self.T.append({part: get_part_pose(self.scene.shown, data, part) for part in self.scene.shown.free})


def watch_demonstration(scenario: str, seed: int, noise_level: float) -> tuple[Scene, dict[str, PoseTrack]]:
    """The scene, and the tracks of parts, camera from part, with noise of each frame, mm and degrees."""
    scene = scene_of(TrialConfig(scenario=scenario, seed=seed))
    layout = draw_layout(scene.scenario, stream(seed, LAYOUT), scene.clearance_mm)
    watch = Watch(scene)
    done = demonstrate(scene, layout, 1.0, stream(seed, DEMONSTRATION), watch)
    assert done.code == "ok"
    still = np.arange(-BEFORE_S, -0.5 / RATE_HZ, 1.0 / RATE_HZ)
    t = np.concatenate([still, watch.t]) + BEFORE_S
    rng = np.random.default_rng(seed)
    size = noise_level * np.repeat([1e-3, np.radians(1.0)], 3)
    tracks = {}
    at_site = {part: layout.start[part] for part in sorted(scene.scenario.follows_site)}
    for part in {**watch.T[0], **at_site}:
        x = np.array([{**poses, **at_site}[part] for poses in watch.T])
        x = np.concatenate([np.repeat(x[:1], len(still), axis=0), x])
        tracks[part] = PoseTrack(t, pose.inverse(CAMERA) @ x @ pose.exp(size * rng.standard_normal((len(t), 6))))
    return scene, tracks
