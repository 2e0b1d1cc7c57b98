"""Render an image of a scenario: its parts at the start or assembled."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import compute_placements
from apo_bench.scenario import Scenario, load_scenario, place_layout
from apo_bench.simulation.scene.render import SceneCamera, draw_picture
from apo_bench.simulation.scene.scene import build_scene


@check_arguments
def show_scenario(
    scenario: str | Path | Scenario, *, finished: bool = True, camera: SceneCamera = "close"
) -> NDArray[np.uint8]:
    """Return an image of a scenario without the arm, (480, 640, 3), uint8.

    Args:
        scenario: A name, the path of a scenario file, or the scenario itself.
        finished: Show the parts assembled at their nominal poses; if false, at their starts.
        camera: As in `draw_picture`.
    """
    loaded = load_scenario(scenario)
    x, y = loaded.site.center_m
    layout = place_layout(loaded, x, y, float(np.mean(loaded.site.yaw_rad)))
    poses = compute_placements(loaded.assembly, layout.start, layout.poses)[-1] if finished else layout.start
    return draw_picture(build_scene(loaded), poses, camera=camera)
