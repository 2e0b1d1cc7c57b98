"""Draw the examples of the paper as strips: `python docs/examples.py [NAME...]` (two minutes, no display needed).

Of each the failure that the paper predicts, with observed poses, then the correction by the robot, picture by picture
as in Fig. 11, 14 and 17; of Fig. 6 the six steps. The only error is that of the human: noise level 0.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from apo_bench.assembly import Plan, ReplayResult
from apo_bench.geometry import Array
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.scene.render import SceneCamera, aim_camera, picture_with_arm
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.trial_stages import observe_demonstration, replay_and_judge, simulate_demonstration

HERE = Path(__file__).parent / "pictures"
SEED = 5
SIZE = (840, 720)  # rendered at twice the size in the strip
COLUMNS = 4


class Moment(NamedTuple):
    """A picture of a strip."""

    caption: str
    move: int
    """Which of the robot's moves, counted from 0; undoing and doing again at once is one."""
    share: float
    """How much of it is over."""


class Strip(NamedTuple):
    """One example."""

    title: str
    method: str
    failure: str
    moments: tuple[Moment, ...]


EXAMPLES = {
    "stick_in_tower": Strip(
        "Example 5.1: correcting operation 3 fails, 3 and 2 succeeds",
        "paper-track",
        "Fig. 10: observed",
        (
            Moment("(a) castle 2 comes off", 2, 0.42),
            Moment("(b) and down by T2'", 2, 0.86),
            Moment("(c) the stick goes in by T3'", 3, 0.8),
        ),
    ),
    "carried_bridge": Strip(
        "Example 5.2: correcting operations 5 to 3 fails, 5 to 2 succeeds",
        "paper-track",
        "Fig. 13: observed",
        (
            Moment("(a) step 4 undone", 4, 0.3),
            Moment("(b) step 3 undone", 5, 0.45),
            Moment("(c) castle 2 is taken", 6, 0.38),
            Moment("(d) and placed by T2'", 6, 0.86),
            Moment("(e) step 3 by T3'", 7, 0.86),
            Moment("(f) step 4 by T4'", 8, 0.82),
            Moment("(g) step 5 by T5'", 9, 0.86),
        ),
    ),
    "vanished_fixture": Strip(
        "Example 5.3: correcting operations 5 and 3 fails, 5, 3 and 2 succeeds",
        "paper-track",
        "Fig. 16: observed",
        (
            Moment("(a) step 4 undone", 4, 0.86),
            Moment("(b) step 3 undone", 5, 0.45),
            Moment("(c) the cube is taken", 6, 0.38),
            Moment("(d) and placed by T2'", 6, 0.86),
            Moment("(e) castle 2 against it, T3'", 7, 0.82),
            Moment("(f) the cube goes, T4'", 8, 0.45),
            Moment("(g) step 5 by T5'", 9, 0.86),
        ),
    ),
    "pocket_table": Strip(
        "Fig. 6: the example task, all poses corrected at once",
        "paper",
        "observed",
        (
            Moment("step 1", 0, 0.86),
            Moment("step 2", 1, 0.55),
            Moment("step 3", 2, 0.82),
            Moment("step 4", 3, 0.8),
            Moment("step 5", 4, 0.9),
            Moment("step 6: in the air", 5, 0.5),
            Moment("step 6", 5, 0.88),
        ),
    ),
}


def main(names: list[str]) -> None:
    for name in names or list(EXAMPLES):
        _draw(name, EXAMPLES[name])


def _draw(name: str, strip: Strip) -> None:
    scene = build_scene(load_scenario(name))
    shown = simulate_demonstration(scene, 1.0, SEED)
    seen = observe_demonstration(shown, make_noise("isotropic", NoiseLevel(0.0, 0.0)), SEED)
    raw = apply_method("uncorrected", seen, None).plan
    corrected = apply_method(strip.method, seen, None).plan
    assert raw is not None, "every operation is observed"
    assert corrected is not None, f"{strip.method} corrects {name}"
    failed, right = (_watched(scene, each, shown.layout.poses) for each in (raw, corrected))
    pictures = [(strip.failure, failed[1][-1][1]), *((m.caption, _state(right, m)) for m in strip.moments)]
    rows = -(-len(pictures) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.0 * COLUMNS, 2.9 * rows + 0.4), layout="constrained")
    camera = _camera(shown.layout.poses)
    for axis, (caption, state) in zip(axes.flat, pictures, strict=True):
        axis.imshow(picture_with_arm(scene, shown.layout.start, state, *SIZE, camera), interpolation="antialiased")
        axis.set_title(caption, fontsize=12)
        axis.axis("off")
    figure.suptitle(strip.title, fontsize=14)
    figure.savefig(HERE / f"example_{name}.png", dpi=80, pil_kwargs={"optimize": True})
    plt.close(figure)


def _watched(scene: Scene, plan: Plan, reference: Array) -> tuple[ReplayResult, list[tuple[float, Array]]]:
    """Replay a plan; return the result, and time [s] and joint positions every 20 ms."""
    states: list[tuple[float, Array]] = []

    def watch(data: Any) -> None:
        states.append((float(data.time), np.array(data.qpos)))

    return replay_and_judge(plan, scene, reference, watch).result, states


def _state(watched: tuple[ReplayResult, list[tuple[float, Array]]], moment: Moment) -> Array:
    result, states = watched
    ends = [0.0, *(end for _, end in result.timeline)]
    at = ends[moment.move] + moment.share * (ends[moment.move + 1] - ends[moment.move])
    return next(qpos for time, qpos in states if time >= at)


def _camera(goals: Array) -> SceneCamera:
    """Return a camera at the middle of all target poses, across the assembly, from the side off the arm."""
    low = goals[:, :3, 3].min(axis=0)
    high = goals[:, :3, 3].max(axis=0)
    turn = float(np.degrees(np.arctan2(goals[0][1, 0], goals[0][0, 0])))
    far = 0.34 + 0.55 * float(np.linalg.norm(high - low))
    return aim_camera(np.array([*(low + high)[:2] / 2, 0.05]), far, turn + 225.0, -24.0)


if __name__ == "__main__":
    main(sys.argv[1:])
