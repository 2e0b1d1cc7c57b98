"""Record where all parts are during a demonstration, for images between its operations."""

from collections import Counter
from typing import Any

from apo_bench.assembly import Poses
from apo_bench.records import TrialConfig
from apo_bench.simulation.hooks import Hooks, Phase
from apo_bench.simulation.scene import Scene, get_part_pose
from apo_bench.trial.trial_stages import SimulatedDemonstration, watch_again

FIRST_FRAME = 10_000
"""Frame n of operation k is image k * 10000 + n, both from 1."""


def record_frames(
    scene: Scene, trial: TrialConfig, simulated: SimulatedDemonstration, video_hz: float
) -> dict[int, Poses]:
    """Simulate the demonstration of a trial once more: number of an image -> poses of the movable parts, in order.

    Args:
        video_hz: Images for each second of simulated time.
    """
    frames: dict[int, Poses] = {}
    counts: Counter[int] = Counter()

    def record(data: Any, phase: Phase) -> None:
        operation = 1 + (phase.operation or 0)
        counts[operation] += 1
        poses = {part: get_part_pose(scene.shown, data, part) for part in scene.shown.free}
        frames[FIRST_FRAME * operation + counts[operation]] = poses

    hooks = Hooks(after_tick=record, tick_s=1.0 / video_hz)
    watch_again(scene, simulated, trial.human_error_scale, trial.seed, trial.secret_seed, hooks)
    return frames
