"""Take and write the images of one trial: a scene of a data set in BOP format."""

import json
import zlib
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Demonstration, Poses
from apo_bench.benchmark.datasets.images.views import ViewPair, draw_views, number_images
from apo_bench.formats.bop_images import CAMERAS, ImageConfig, ImageDescription, SceneEntry
from apo_bench.geometry import Array, pose
from apo_bench.io import write_file
from apo_bench.perception.depth_camera.range_finder import BIAS
from apo_bench.simulation.sensor.photographs import Mask, Photograph, Photographer, Silhouette, find_box

DETECTIONS = "scene_detections.json"
"""The detections of one scene, written last, so that a scene with this file is complete."""
DEPTH_SCALE = 0.1
"""[mm] of one step in a depth image."""
_FARTHEST_MM = 6500.0  # depth that 16 bits hold
_DROPOUTS = 0.01  # fraction of pixels without a reading, if there is noise
_LEAST_VISIBLE = 0.1
"""A part of which a smaller fraction is visible is no target, as in the BOP benchmark."""


class SceneFiles(NamedTuple):
    """The JSON files of a scene while its images are taken, by the number of the image."""

    camera: dict[str, Any]
    gt: dict[str, Any]
    gt_info: dict[str, Any]
    detections: list[dict[str, Any]]


def list_moments(demonstration: Demonstration) -> Iterator[Poses]:
    """Yield the poses of all parts after each operation; carried parts move with the main one."""
    now = dict(demonstration.start)
    for operation, T in zip(demonstration.assembly.operations, demonstration.poses, strict=True):
        step = T @ pose.inverse(now[operation.main])
        now = now | {part: step @ now[part] for part in operation.carries} | {operation.main: T}
        yield now


def write_scene(
    photographer: Photographer,
    demonstration: Demonstration,
    number: int,
    description: ImageDescription,
    rng: np.random.Generator,
    out: Path,
) -> None:
    """Write the images of a demonstration; the true poses are left out if the trial is secret.

    Args:
        number: Of the scene.
        rng: Source of the cameras, their errors, and the noise of the depth images.
        out: Folder of the scene, made here.
    """
    scene = description.scenes[str(number)]
    config = description.options
    is_secret = description.secret_seed is not None
    for folder in ("depth", *["rgb"] * (not config.no_rgb), *["mask", "mask_visib"] * (not is_secret)):
        (out / folder).mkdir(parents=True, exist_ok=True)
    moments = list(list_moments(demonstration))
    views = draw_views(config, rng)
    if config.randomise:
        photographer.vary(rng)
    files = SceneFiles({}, {}, {}, [])
    for image, operation, camera in number_images(len(moments), config.cameras):
        poses = moments[operation - 1]
        photograph = photographer.take(views[camera].true, poses)
        depth = add_depth_noise(photograph.depth, config.depth_noise_mm, rng)
        _write_pictures(photograph, depth, image, out, is_secret)
        _describe_image(photograph, depth, views[camera], poses, (number, image), description, files)
    written: dict[str, Any] = {CAMERAS: files.camera}
    if not is_secret:
        written |= {
            "scene_gt.json": files.gt,
            "scene_gt_info.json": files.gt_info,
            "scene_gt_coco.json": make_coco(scene, config, files),
        }
    for name, content in (*written.items(), (DETECTIONS, files.detections)):
        write_file(out / name, json.dumps(content))


def add_depth_noise(depth: Array, noise_mm: float, rng: np.random.Generator) -> Array:
    """Add errors like those of a stereo camera to a depth image, (height, width), [m]; 0 where there is no reading.

    The standard deviation of a pixel grows with the squared depth. A tenth of it is common to all pixels of an image,
    and some pixels have no reading.

    Args:
        noise_mm: Standard deviation of a pixel at 1 m.
    """
    sigma = 1e-3 * noise_mm * np.where(np.isfinite(depth), depth, 0.0) ** 2
    unit = rng.standard_normal(depth.shape) + BIAS * rng.standard_normal()
    lost = (rng.random(depth.shape) < _DROPOUTS) & (noise_mm > 0.0)
    return np.where(lost | ~np.isfinite(depth), 0.0, depth + sigma * unit)


def _write_pictures(photograph: Photograph, depth: Array, image: int, out: Path, is_secret: bool) -> None:
    """Write colours, depth and masks as PNG files; entries of masks are the movable parts in order."""
    steps = np.clip(1e3 * depth, 0.0, _FARTHEST_MM) / DEPTH_SCALE
    _write_png(out / "depth" / f"{image:06d}.png", np.round(steps).astype(np.uint16))
    if photograph.rgb is not None:
        _write_png(out / "rgb" / f"{image:06d}.png", photograph.rgb)
    whole = [each.mask for each in photograph.whole.values()]
    for folder, masks in (("mask_visib", photograph.visible.values()), ("mask", whole)):
        for entry, mask in enumerate(() if is_secret else masks):
            _write_png(out / folder / f"{image:06d}_{entry:06d}.png", np.uint8(255) * mask.astype(np.uint8))


def _write_png(path: Path, pixels: NDArray[Any]) -> None:
    import imageio.v3 as imageio

    how: dict[str, Any] = {
        "compress_level": 1,
        "compress_type": zlib.Z_RLE,
    }  # fast, and small for masks and flat colours
    write_file(path, imageio.imwrite("<bytes>", pixels, extension=".png", **how))


def _describe_image(
    photograph: Photograph,
    depth: Array,
    view: ViewPair,
    poses: Poses,
    where: tuple[int, int],
    description: ImageDescription,
    files: SceneFiles,
) -> None:
    """Add camera, true poses, visible fractions and detections of an image to the files of its scene.

    Detections are in the order of their boxes, which does not tell identical parts apart.

    Args:
        depth: As measured, (height, width), [m].
        where: Scene and image.
    """
    scene, image = where
    T_view = pose.inverse(view.published.T_world_view)
    files.camera[str(image)] = {
        "cam_K": view.published.K.ravel().tolist(),
        "cam_R_w2c": T_view[:3, :3].ravel().tolist(),
        "cam_t_w2c": (1e3 * T_view[:3, 3]).tolist(),
        "depth_scale": DEPTH_SCALE,
    }
    entries, facts, detections = [], [], []
    for part, number in description.scenes[str(scene)].parts.items():
        T = pose.inverse(view.true.T_world_view) @ poses[part] @ description.offset(number)
        entries.append(
            {"obj_id": number, "cam_R_m2c": T[:3, :3].ravel().tolist(), "cam_t_m2c": (1e3 * T[:3, 3]).tolist()}
        )
        visible = photograph.visible[part]
        fact = _measure_visibility(visible, photograph.whole[part], depth)
        facts.append(fact)
        if fact["visib_fract"] >= _LEAST_VISIBLE:
            detections.append(_make_detection(scene, image, number, visible))
    files.detections.extend(sorted(detections, key=lambda each: each["bbox"]))
    files.gt[str(image)] = entries
    files.gt_info[str(image)] = facts


def _measure_visibility(visible: Mask, whole: Silhouette, depth: Array) -> dict[str, Any]:
    """The entry of `scene_gt_info.json` of a part.

    Args:
        depth: As measured, 0 without a reading.
    """
    return {
        "bbox_obj": whole.box,
        "bbox_visib": find_box(*np.nonzero(visible)),
        "px_count_all": whole.pixels,
        "px_count_valid": int((whole.mask & (depth > 0.0)).sum()),
        "px_count_visib": int(visible.sum()),
        "visib_fract": float(visible.sum() / max(1, whole.pixels)),
    }


def _make_detection(scene: int, image: int, number: int, visible: Mask) -> dict[str, Any]:
    """A detection as pose estimators of the BOP benchmark read it."""
    return {
        "scene_id": scene,
        "image_id": image,
        "category_id": number,
        "bbox": find_box(*np.nonzero(visible)),
        "score": 1.0,
        "time": 0.0,
        "segmentation": encode_mask(visible),
    }


def encode_mask(mask: Mask) -> dict[str, Any]:
    """A mask as COCO's uncompressed run lengths, column by column; the first run is of pixels that are not set."""
    flat = mask.ravel(order="F").tolist()
    runs = [len(list(group)) for _, group in groupby(flat)]
    return {"counts": [0] * bool(flat[0]) + runs, "size": list(mask.shape)}


def decode_mask(encoded: Mapping[str, Any]) -> Mask:
    """The mask of COCO's uncompressed run lengths, the inverse of `encode_mask`."""
    counts = np.array(encoded["counts"])
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(encoded["size"], order="F")


def make_coco(scene: SceneEntry, config: ImageConfig, files: SceneFiles) -> dict[str, Any]:
    """The visible parts of all images of a scene in COCO format."""
    images = [
        {"id": int(image), "file_name": f"rgb/{int(image):06d}.png", "width": config.width, "height": config.height}
        for image in files.camera
    ]
    annotations = [
        {
            "id": k,
            "image_id": each["image_id"],
            "category_id": each["category_id"],
            "bbox": each["bbox"],
            "area": sum(each["segmentation"]["counts"][1::2]),
            "segmentation": each["segmentation"],
            "iscrowd": 0,
            "ignore": False,
        }
        for k, each in enumerate(files.detections, start=1)
    ]
    categories = [{"id": k, "name": str(k), "supercategory": "part"} for k in sorted({*scene.parts.values()})]
    return {"images": images, "annotations": annotations, "categories": categories}
