"""Draw the finished assembly of every scenario on one sheet: `python docs/gallery.py` (half a minute)."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from apo_bench.scenario.file import list_scenario_names, load_scenario
from apo_bench.simulation.scene.render import aim_camera, draw_picture
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.stages import simulate_demonstration

SHEET = Path(__file__).parent / "pictures" / "scenarios.png"
SIZE = (600, 500)
COLUMNS = 5
SEED = 0
AZIMUTH_DEG = {"wedge_under_roof": -35.0}  # of the camera, if not the usual side


def main() -> None:
    names = list_scenario_names()
    figure, axes = plt.subplots(-(-len(names) // COLUMNS), COLUMNS, figsize=(13.0, 7.4), layout="constrained")
    for axis in axes.flat:
        axis.axis("off")
    for axis, name in zip(axes.flat, names, strict=False):
        axis.imshow(finished(name), interpolation="antialiased")
        axis.set_title(name, fontsize=13, fontweight="bold", pad=5)
    figure.savefig(SHEET, dpi=110)
    plt.close(figure)


def finished(name: str) -> NDArray[np.uint8]:
    """Return a picture of the finished assembly, as large as it fits."""
    scene = build_scene(load_scenario(name))
    scene.shown.model.vis.headlight.ambient[:] = 0.4
    simulated = simulate_demonstration(scene, 0.0, SEED)
    poses = simulated.demonstration.final
    standing = {**{part: scene.scenario.start[part] for part in scene.shown.fixed if part != "table"}, **poses}
    at = np.array([pose[:3, 3] for part, pose in standing.items() if part != "table"])
    middle = (at.min(axis=0) + at.max(axis=0)) / 2
    extent = float(np.linalg.norm(at.max(axis=0) - at.min(axis=0)))
    azimuth = AZIMUTH_DEG.get(name, 128.0)
    return draw_picture(scene, poses, *SIZE, aim_camera(middle, 0.22 + 1.15 * extent, azimuth, -26.0))


if __name__ == "__main__":
    main()
