"""Read depth images of a data set as distances along rays, which ray casts of the models give as well."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from apo_bench.formats.bop_images import PublishedCamera, SceneEntry
from apo_bench.geometry import Array, Solid
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.scenario import load_scenario
from apo_bench.simulation.sensor.rays import ModelRays


def read_distances(path: Path, camera: PublishedCamera) -> tuple[Array, PinholeView]:
    """Read a depth image as distances along the rays, (height, width), [m], NaN without a reading, and its view."""
    import imageio.v3 as imageio

    depth = 1e-3 * camera.depth_scale * np.asarray(imageio.imread(path), dtype=np.float64)
    height, width = depth.shape
    fov_deg = float(2.0 * np.degrees(np.arctan(height / 2 / camera.K[1, 1])))
    view = PinholeView(camera.T_world_camera, width, height, fov_deg)
    slope = (view.rays @ view.T_world_view[:3, 2]).reshape(depth.shape)
    return np.where(depth > 0.0, depth, np.nan) / slope, view


def load_solids(scene: SceneEntry) -> Mapping[int, Solid]:
    """The shapes of the objects of a scene, without its clearance: number of the object -> shape."""
    solids = load_scenario(scene.scenario).assembly.solids
    return {number: solids[part] for part, number in scene.parts.items()}


def make_model_rays(scene: SceneEntry) -> ModelRays:
    """Ray casts of the models of the objects of a scene, by the text of their number, in the frames of the parts."""
    return ModelRays({str(number): solid for number, solid in load_solids(scene).items()}, 1e-3 * scene.clearance_mm)
