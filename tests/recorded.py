"""Recordings without a simulator: parts that rest, are carried along straight lines, and rest again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from apo_bench import load_scenario
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.scenario.layout import place_layout

RATE_HZ = 30.0
_MOVE_S = 1.0
_REST_S = 0.8
CAMERA = pose.at((0.9, -0.2, 0.8), (-130.0, 20.0, 60.0))
"""T_world_camera."""


@cache
def motion(name: str) -> tuple[Array, Mapping[str, Array]]:
    """Times (n,), and the pose of every moved part at them, (n, 4, 4), world: operation after operation, from above."""
    scenario = load_scenario(name)
    layout = place_layout(scenario, 0.1, 0.0, 0.3, clearance_mm=scenario.clearance_mm)
    now = {part: T for part, T in layout.start.items() if part not in scenario.assembly.fixed}
    frames = [dict(now)] * round(_REST_S * RATE_HZ)
    for operation, goal in zip(scenario.assembly.operations, layout.poses, strict=True):
        before = dict(now)
        for s in np.linspace(0.0, 1.0, round(_MOVE_S * RATE_HZ)):
            T = _between(before[operation.main], goal, s)
            carried = {part: T @ pose.inverse(before[operation.main]) @ before[part] for part in operation.carries}
            now = now | carried | {operation.main: T}
            frames.append(now)
        frames += [now] * round(_REST_S * RATE_HZ)
    t = np.arange(len(frames)) / RATE_HZ
    return t, {part: np.array([frame[part] for frame in frames]) for part in now}


def seen(name: str, noise_level: float, seed: int = 0) -> dict[str, PoseTrack]:
    """The tracks of a camera with this noise of each frame, mm and degrees, camera from part."""
    t, T = motion(name)
    rng = np.random.default_rng(seed)
    size = noise_level * np.repeat([1e-3, np.radians(1.0)], 3)
    return {
        part: PoseTrack(t, pose.inverse(CAMERA) @ x @ pose.exp(size * rng.standard_normal((len(t), 6))))
        for part, x in T.items()
    }


def _between(a: Array, b: Array, s: float) -> Array:
    """On the way from one pose to another, lifted in between."""
    at = 10 * s**3 - 15 * s**4 + 6 * s**5
    T = np.array(a @ pose.exp(at * pose.log(pose.inverse(a) @ b)))
    T[:3, 3] = (1 - at) * a[:3, 3] + at * b[:3, 3] + [0.0, 0.0, 0.64 * at * (1 - at)]
    return T
