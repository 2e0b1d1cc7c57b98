"""Draw the picture at the top, what is believed, and two pictures of films: `python docs/pictures.py` (half a minute,
no display needed)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.goals import Plan
from apo_bench.correction.correctors import correct
from apo_bench.geometry.arrays import Array
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.show.believed_picture import belief_panel, draw_beliefs
from apo_bench.simulation.film.film import frames
from apo_bench.simulation.scene.render import SceneCamera, camera_view, picture_with_arm
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.sweeps.one import Request, run_one
from apo_bench.trial.stages import observe_recording, record_demonstration, replay_and_judge
from apo_bench.trial.story import Story

HERE = Path(__file__).parent / "pictures"
SEED, LEVEL = 7, 2.0
SIZE = (1280, 780)
"""Twice as large as in the file, so that edges are smooth."""
HOLE_M, NEAR_M, HELD_M = 0.04, 0.01, 0.2
"""Height of the hole above the table, how near the stick is to its axis while it goes in, and to the gripper."""


def main() -> None:
    scene = build_scene(load_scenario("stick_in_tower"))
    shown = record_demonstration(scene, 1.0, SEED)
    seen = observe_recording(shown, make_noise("isotropic", Level(LEVEL, LEVEL)), SEED)
    corrected = correct(seen, "contact").goals
    panels = []
    for title, goals in (("As seen: jams", seen.goals), ("Corrected: it fits", corrected)):
        state = deepest(scene, Plan(seen.assembly, seen.start, goals), shown.layout.goals)
        panels.append((title, close_up(scene, state, shown.layout.goals)))
    draw_top(panels, HERE / "top.png")
    beliefs = [belief_panel("as seen", seen, seen.goals, 3), belief_panel("corrected by contact", seen, corrected, 3)]
    draw_beliefs(scene.scenario, 3, beliefs, HERE / "believed.png")
    for method in ("none", "contact"):
        draw_film(method, HERE / f"film_{method}.png")


def deepest(scene: Scene, plan: Plan, reference: Array) -> Array:
    """The state of the replay at which the stick, still in the gripper, is as far in as it comes."""
    model = scene.work.model
    stick, gripper = model.body("stick/").id, model.body("arm/gripper").id
    along, across = reference[0][:3, 0], reference[0][:3, 1]
    hole = reference[0][:3, 3] + [0.0, 0.0, HOLE_M]
    best: list[tuple[float, Array]] = []

    def watch(data: Any) -> None:
        held = np.linalg.norm(data.xpos[stick] - data.xpos[gripper]) < HELD_M
        off = data.xpos[stick] - hole
        before_it = max(abs(off[2]), abs(across @ off)) < NEAR_M
        depth = float(along @ off)
        if held and before_it and (not best or depth > best[-1][0]):
            best.append((depth, np.array(data.qpos)))

    replay_and_judge(plan, scene, reference, watch)
    return best[-1][1]


def close_up(scene: Scene, state: Array, reference: Array) -> NDArray[np.uint8]:
    """Tower, stick and gripper; the rest of the arm is left out, since it would be cut off."""
    model = scene.work.model
    for geom in range(model.ngeom):
        body = model.body(model.geom_bodyid[geom]).name
        if body.startswith("arm/") and not body.endswith(("gripper", "finger")):
            model.geom_rgba[geom, 3] = 0.0
    model.vis.global_.offwidth, model.vis.global_.offheight = SIZE
    start = scene.scenario.start
    return picture_with_arm(scene, start, state, *SIZE, camera(reference))


def camera(reference: Array) -> SceneCamera:
    """Looks at where the stick goes in."""
    turn = float(np.degrees(np.arctan2(reference[0][1, 0], reference[0][0, 0])))
    return camera_view(reference[0][:3, 3] - 0.085 * reference[0][:3, 0] + [0.0, 0.0, 0.065], 0.32, turn + 66.0, -24.0)


def draw_top(panels: list[tuple[str, NDArray[np.uint8]]], path: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(12.8, 4.6), layout="constrained")
    for axis, (title, image) in zip(axes, panels, strict=True):
        axis.imshow(image, interpolation="antialiased")
        axis.set_title(title, fontsize=22, fontweight="bold", pad=10)
        axis.axis("off")
    figure.savefig(path, dpi=100, bbox_inches="tight", pad_inches=0.1)
    plt.close(figure)


def draw_film(method: str, path: Path) -> None:
    """One picture of the film of a replay: how it ended where it failed, else the stick on its way in."""

    def keep(story: Story) -> None:
        replayed = story.chapters[-1]
        inside = [m for m in replayed.moments if m.doing.operation == 2 and m.doing.macro.startswith("insert")]
        shown = replayed.moments if method == "none" else inside[: 3 * len(inside) // 4]
        *_, ended = pictures = [
            picture
            for picture, _ in frames(
                story.scene.scenario.assembly, story.assembled, [replace(replayed, moments=tuple(shown[-6:]))]
            )
        ]
        imageio.imwrite(path, ended if method == "none" else pictures[0])

    run_one(Request("stick_in_tower", {"level": 1.0, "seed": SEED, "method": method}), keep)


if __name__ == "__main__":
    main()
