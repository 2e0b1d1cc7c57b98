"""A pose estimator without weights: the models of parts are fitted to the depth pixels of each detection.

It reads depth images, published cameras, models and default detections, never the true poses. The fit is that of the
depth camera of this package: point-to-plane ICP from the 24 orientations of a box; the pose that explains most of the
depth image is kept.
"""

import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.benchmark.datasets.images.make import JOINED_DETECTIONS
from apo_bench.errors import require
from apo_bench.formats.bop import EstimatedPose, write_results
from apo_bench.formats.bop_images import SceneEntry, read_cameras, read_image_description
from apo_bench.formats.coco import decode_mask
from apo_bench.geometry import Array, find_symmetries, pose, shrink_pieces
from apo_bench.io import group_by, read_plain
from apo_bench.perception.depth_camera.model_localisation import Appearance, Model, locate_model
from apo_bench.perception.depth_camera.range_finder import BIAS, PinholeView
from apo_bench.perception.depth_camera.surface import load_small_gicp, sample_surface
from apo_bench.simulation.sensor.depth_images import load_solids, make_model_rays, read_distances
from apo_bench.simulation.sensor.rays import ModelRays

_LARGEST_BYTES = 1_000_000_000


class _SceneModels(NamedTuple):
    """The models of the parts of a scenario."""

    models: Mapping[int, Model]
    """By the number of the object; its frame is that of the part."""
    cast: ModelRays


def estimate_images(images: Path, out: Path) -> int:
    """Estimate the pose of each detection in a data set of images, and write a results file of the BOP format.

    Args:
        images: Folder of the data set.
        out: The results file.

    Returns:
        The number of estimates.

    Raises:
        InputError: The folder is no such data set, or small_gicp is not installed.
    """
    load_small_gicp()
    description = read_image_description(images)
    detections = read_plain(images / JOINED_DETECTIONS, "detections", syntax="json", limit=_LARGEST_BYTES)
    require(detections, f"{images / JOINED_DETECTIONS}: there is no detection; make images of more trials.")
    models: dict[tuple[str, float], _SceneModels] = {}
    found: list[EstimatedPose] = []
    for scene, ours in group_by((each["scene_id"], each) for each in detections).items():
        entry = description.scenes[str(scene)]
        key = entry.scenario, entry.clearance_mm
        if key not in models:
            models[key] = _load_models(entry)
        folder = images / description.split / f"{scene:06d}"
        cameras = read_cameras(folder)
        for image, those in group_by((each["image_id"], each) for each in ours).items():
            start = time.perf_counter()
            distance, view = read_distances(folder / "depth" / f"{image:06d}.png", cameras[image])
            noise_m = 1e-3 * description.options.depth_noise_mm * float(np.nanmedian(distance)) ** 2
            located = list(_locate(those, distance, view, models[key], noise_m))
            spent = time.perf_counter() - start
            for number, T, score in located:
                T_camera = pose.inverse(view.T_world_view) @ T @ description.offset(number)
                found.append(EstimatedPose((scene, image, number), score, T_camera, spent))
    write_results(out, found)
    return len(found)


def _load_models(scene: SceneEntry) -> _SceneModels:
    """Load the models of the parts of a scenario, as they are made, smaller by the clearance."""
    clearance_m = 1e-3 * scene.clearance_mm
    models = {
        number: Model(
            {str(number): np.eye(4)}, sample_surface(shrink_pieces(solid, clearance_m)), find_symmetries(solid)
        )
        for number, solid in load_solids(scene).items()
    }
    return _SceneModels(models, make_model_rays(scene))


def _locate(
    detections: Iterable[Mapping[str, Any]], distance: Array, view: PinholeView, known: _SceneModels, noise_m: float
) -> Iterable[tuple[int, Array, float]]:
    """Yield object, pose of its part (4, 4), world, [m], and score of each detection that can be explained."""
    for each in detections:
        number = each["category_id"]
        mask = decode_mask(each["segmentation"])
        appearance = Appearance([view], distance[None], [mask], noise_m, BIAS * noise_m, known.cast)
        located = locate_model(known.models[number], appearance, appearance.points())
        if located is not None:
            yield number, located.T, located.explained
