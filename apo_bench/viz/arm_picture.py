"""A PNG picture of a robot arm at the table of a scenario."""

from pathlib import Path

import numpy as np

from apo_bench.io import write_file
from apo_bench.scenario import Scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.scene import aim_camera, build_scene
from apo_bench.simulation.scene.render import picture_with_arm

_SIZE = (960, 720)  # width and height, in pixels
_MIDDLE_M = np.array([-0.15, 0.0, 0.3])  # the point that the camera looks at, world
_DISTANCE_M = 1.9  # from the camera to that point
_AZIMUTH_DEG = 140.0
_ELEVATION_DEG = -18.0


def draw_arm(arm: Arm, scenario: Scenario, out: Path) -> None:
    """Write a PNG picture of the whole arm and the table of a scenario."""
    import imageio.v3 as imageio

    scene = build_scene(scenario, arm=arm, grasp="weld")
    camera = aim_camera(_MIDDLE_M, _DISTANCE_M, _AZIMUTH_DEG, _ELEVATION_DEG)
    image = picture_with_arm(scene, scenario.start, None, *_SIZE, camera)
    write_file(out, imageio.imwrite("<bytes>", image, extension=".png"))
