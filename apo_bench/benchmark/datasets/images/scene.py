"""Take and write the images of one trial: a scene of a data set in BOP format."""

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Demonstration, Poses, compute_placements
from apo_bench.benchmark.datasets.images.printed_marks import ObjectMarks
from apo_bench.benchmark.datasets.images.views import draw_views, number_images
from apo_bench.formats.bop_images import CAMERAS, LEAST_VISIBLE, TRUTH, VISIBILITY, ImageDescription
from apo_bench.formats.coco import encode_mask, make_coco
from apo_bench.geometry import Array, pose
from apo_bench.io import write_file
from apo_bench.perception.depth_camera.range_finder import BIAS, PinholeView
from apo_bench.simulation.sensor.photographs import Mask, Photograph, Photographer, Silhouette, find_box

DETECTIONS = "scene_detections.json"
"""The detections of one scene, written last, so that a scene with this file is complete."""
DEPTH_SCALE = 0.1
"""[mm] of one step in a depth image."""
_FARTHEST_MM = 6500.0  # depth that 16 bits hold
_DROPOUTS = 0.01  # fraction of pixels without a reading, if there is noise


def write_scene(
    photographer: Photographer,
    demonstration: Demonstration,
    number: int,
    description: ImageDescription,
    rng: np.random.Generator,
    marks: ObjectMarks,
    frames: Mapping[int, Poses],
    out: Path,
) -> None:
    """Write the images of a demonstration; the true poses are left out if the trial is secret.

    Args:
        number: Of the scene.
        rng: Source of the cameras, their errors, and the noise of the depth images.
        frames: Number of each further image of the first camera -> poses of the parts; without detections.
        out: Folder of the scene, made here.
    """
    parts = description.scenes[str(number)].parts
    config = description.options
    is_secret = description.secret_seed is not None
    for folder in ("depth", *["rgb"] * (not config.no_rgb), *["mask", "mask_visib"] * (not is_secret)):
        (out / folder).mkdir(parents=True, exist_ok=True)
    moments = compute_placements(demonstration.assembly, demonstration.start, demonstration.poses)
    views = draw_views(config, rng)
    of_parts = {part: marks.get(k, ()) for part, k in parts.items()}
    if config.randomise:
        photographer.vary(rng)
    files: dict[str, dict[int, Any]] = {CAMERAS: {}, TRUTH: {}, VISIBILITY: {}}
    detections: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    shots = [
        *((image, moments[k - 1], views[camera]) for image, k, camera in number_images(len(moments), config.cameras)),
        *((image, poses, views[0]) for image, poses in frames.items()),
    ]
    for image, poses, view in shots:
        photograph = photographer.take(view.true, poses, of_parts)
        depth = add_depth_noise(photograph.depth, config.depth_noise_mm, rng)
        _write_pictures(photograph, depth, image, out, is_secret)
        models = [(k, poses[part] @ description.offset(k)) for part, k in parts.items()]
        facts = [_measure_visibility(photograph.visible[part], photograph.whole[part], depth) for part in parts]
        files[CAMERAS][image] = _describe_camera(view.published)
        files[TRUTH][image] = [_describe_pose(k, pose.inverse(view.true.T_world_view) @ T) for k, T in models]
        files[VISIBILITY][image] = facts
        if image in frames:
            continue
        seen = [
            (k, photograph.visible[part])
            for (part, k), fact in zip(parts.items(), facts, strict=True)
            if fact["visib_fract"] >= LEAST_VISIBLE
        ]
        seen.sort(key=lambda each: find_box(*np.nonzero(each[1])))  # an order that does not tell equal parts apart
        annotations += [_make_detection((number, image, k), mask) for k, mask in seen]
        detected = [(k, disturb_mask(mask, config.detection_error_px, rng)) for k, mask in seen]
        detections += [_make_detection((number, image, k), mask) for k, mask in detected]
    written: dict[str, Any] = {CAMERAS: files[CAMERAS]} if is_secret else dict(files)
    if not is_secret:
        written["scene_gt_coco.json"] = make_coco(annotations, (config.width, config.height))
    for name, content in (*written.items(), (DETECTIONS, detections)):
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


def disturb_mask(mask: Mask, error_px: float, rng: np.random.Generator) -> Mask:
    """Move and scale a mask, (height, width), as an inexact detection; one that would leave the image is kept.

    Args:
        error_px: Standard deviation of its middle per axis, and of half its size, [pixels].
    """
    if not error_px:
        return mask
    from scipy.ndimage import affine_transform

    where = np.argwhere(mask)
    middle, half = (where.max(axis=0) + where.min(axis=0)) / 2, (np.ptp(where, axis=0) + 1) / 2
    shift, growth = error_px * rng.standard_normal(2), error_px * rng.standard_normal()
    scale = half / np.maximum(half + growth, 1.0)
    found = affine_transform(mask, scale, middle - scale * (middle + shift), order=0)
    return found if found.any() else mask


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


def _describe_camera(view: PinholeView) -> dict[str, Any]:
    """The entry of `scene_camera.json` of a camera."""
    T = pose.inverse(view.T_world_view)
    return {
        "cam_K": view.K.ravel().tolist(),
        "cam_R_w2c": T[:3, :3].ravel().tolist(),
        "cam_t_w2c": (1e3 * T[:3, 3]).tolist(),
        "depth_scale": DEPTH_SCALE,
    }


def _describe_pose(number: int, T: Array) -> dict[str, Any]:
    """The entry of `scene_gt.json` of an object at a pose, (4, 4), camera from model, [m]."""
    return {"obj_id": number, "cam_R_m2c": T[:3, :3].ravel().tolist(), "cam_t_m2c": (1e3 * T[:3, 3]).tolist()}


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


def _make_detection(where: tuple[int, int, int], visible: Mask) -> dict[str, Any]:
    """A detection as pose estimators of the BOP benchmark read it.

    Args:
        where: Scene, image and object.
    """
    return {
        **dict(zip(("scene_id", "image_id", "category_id"), where, strict=True)),
        "bbox": find_box(*np.nonzero(visible)),
        "score": 1.0,
        "time": 0.0,
        "segmentation": encode_mask(visible),
    }
