"""Compare a data set of images with what bop_toolkit computes from it, in an environment that has its packages.

    git clone https://github.com/thodan/bop_toolkit
    python -m venv bop; bop/bin/pip install numpy scipy imageio pypng pytz opencv-python-headless vispy pyopengl
    EGL_PLATFORM=surfaceless PYTHONPATH=bop_toolkit bop/bin/python benchmarks/bop_toolkit_check.py IMAGES RESULTS.csv

Make IMAGES with `apo-bench dataset make SCENARIO --format bop --depth-noise-mm 0`. The renderer of the toolkit puts the
middle of the first pixel at (0.5, 0.5), and its principal point is moved accordingly.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from bop_toolkit_lib import inout, misc, pose_error, visibility
from bop_toolkit_lib.rendering import renderer
from scipy.ndimage import binary_erosion

HALF_PX = 0.5
TOLERANCE_MM = 0.5
"""Of the visibility test. With the 15 mm of the toolkit, parts show through those that they touch."""
INNER_PX = 2  # pixels nearer to the outline are left out of the comparison of depth
STEP = 0.01  # of continuous symmetries, as in the toolkit
LEAST_VISIBLE = 0.1
SHARES = np.arange(0.05, 0.51, 0.05)
VISIBLE_MM = 15.0  # tolerance of the visibility test of VSD, that of BOP
THRESHOLDS = {"vsd": SHARES, "mssd": SHARES, "mspd": np.arange(5.0, 50.1, 5.0), "add": np.array([0.1])}


class ImageRenderer:
    """The renderer of the toolkit for images with the middle of the first pixel at (0, 0)."""

    def __init__(self, images: Path) -> None:
        self.width, self.height = inout.load_cam_params(str(images / "camera.json"))["im_size"]
        self.large = renderer.create_renderer(3 * self.width, 3 * self.height, "vispy", mode="depth")
        for number in inout.load_json(str(images / "models" / "models_info.json"), keys_to_int=True):
            self.large.add_object(number, str(images / "models" / f"obj_{number:06d}.ply"))

    def render_large(self, number: int, R: Any, t: Any, fx: float, fy: float, cx: float, cy: float) -> Any:
        """The depth of an object in nine times the image, with the image in the middle, [mm]."""
        middle = cx + self.width + HALF_PX, cy + self.height + HALF_PX
        return self.large.render_object(number, R, t, fx, fy, *middle)["depth"]

    def crop(self, large: Any) -> Any:
        """The part of a large depth image that is in the image."""
        return large[self.height : 2 * self.height, self.width : 2 * self.width]

    def render_object(self, *pose_and_camera: Any) -> dict[str, Any]:
        """The depth of an object in the image, as the toolkit calls it."""
        return {"depth": self.crop(self.render_large(*pose_and_camera))}


def compare_renderings(images: Path, draws: ImageRenderer) -> None:
    """Print how much silhouettes, visible fractions and depth differ from those that the toolkit renders."""
    visible, silhouettes, depths = [], [], []
    for scene in sorted((images / "test").glob("0*")):
        cameras = inout.load_scene_camera(str(scene / "scene_camera.json"))
        facts = inout.load_json(str(scene / "scene_gt_info.json"), keys_to_int=True)
        for image, entries in inout.load_scene_gt(str(scene / "scene_gt.json")).items():
            K = cameras[image]["cam_K"]
            depth = inout.load_depth(str(scene / "depth" / f"{image:06d}.png")) * cameras[image]["depth_scale"]
            camera = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
            for k, entry in enumerate(entries):
                large = draws.render_large(entry["obj_id"], entry["cam_R_m2c"], entry["cam_t_m2c"], *camera)
                own = draws.crop(large)
                seen = visibility.estimate_visib_mask_gt(
                    *(misc.depth_im_to_dist_im_fast(each, K) for each in (depth, own)), TOLERANCE_MM
                )
                visible.append(seen.sum() / max(1, (large > 0).sum()) - facts[image][k]["visib_fract"])
                masks = (scene / name / f"{image:06d}_{k:06d}.png" for name in ("mask", "mask_visib"))
                whole, shown = (inout.load_im(str(mask)) > 0 for mask in masks)
                silhouettes.append(((own > 0) != whole).sum() / max(1, whole.sum()))
                inner = binary_erosion(shown & (own > 0), iterations=INNER_PX)
                depths.append(np.abs(own - depth)[inner])
    for name, values in (("visible fraction", visible), ("silhouette", silhouettes)):
        sizes = 100.0 * np.abs(values)
        print(f"{name}: differs by {sizes.mean():.3f} %, at most {sizes.max():.3f} %, in {len(sizes)} parts")
    every = np.concatenate(depths)
    print(f"depth: differs by {every.mean():.3f} mm, at most {every.max():.3f} mm, in {len(every)} pixels")


def measure_recall(images: Path, results: Path, draws: ImageRenderer) -> None:
    """Print recall of a results file by the errors of the toolkit."""
    folder = images / "models_eval"
    known = inout.load_json(str(folder / "models_info.json"), keys_to_int=True)
    models = {number: inout.load_ply(str(folder / f"obj_{number:06d}.ply"))["pts"] for number in known}
    symmetries = {number: misc.get_symmetry_transformations(info, STEP) for number, info in known.items()}
    estimates = defaultdict(list)
    for each in inout.load_bop_results(str(results)):
        estimates[each["scene_id"], each["im_id"], each["obj_id"]].append(each)
    hits: dict[str, float] = dict.fromkeys(THRESHOLDS, 0.0)
    total = 0
    for target in inout.load_json(str(images / "test_targets_bop19.json")):
        scene, image, number = target["scene_id"], target["im_id"], target["obj_id"]
        folder = images / "test" / f"{scene:06d}"
        facts = inout.load_json(str(folder / "scene_gt_info.json"), keys_to_int=True)[image]
        entries = inout.load_scene_gt(str(folder / "scene_gt.json"))[image]
        those = zip(entries, facts, strict=True)
        truth = [e for e, f in those if e["obj_id"] == number and f["visib_fract"] >= LEAST_VISIBLE]
        best = sorted(estimates[scene, image, number], key=lambda each: -each["score"])[: len(truth)]
        camera = inout.load_scene_camera(str(folder / "scene_camera.json"))[image]
        K = camera["cam_K"]
        depth = inout.load_depth(str(folder / "depth" / f"{image:06d}.png")) * camera["depth_scale"]
        diameter = known[number]["diameter"]
        units = {"mssd": diameter, "mspd": draws.width / 640.0, "add": diameter, "vsd": 1.0}
        total += len(truth)
        if not best:
            continue
        for name, limits in THRESHOLDS.items():
            if name == "vsd":
                how = depth, K, VISIBLE_MM, SHARES, True, diameter, draws, number
                errors = [[pose_error.vsd(*list_poses(g, e), *how) for e in best] for g in truth]
            else:
                errors = [[[measure(name, g, e, models[number], symmetries[number], K)] for e in best] for g in truth]
            each = np.array(errors).reshape(len(truth), len(best), -1) / units[name]
            counts = [count_matches(each[:, :, i], limit) for i in range(each.shape[2]) for limit in limits]
            hits[name] += np.mean(counts)
    percent = {name: round(float(100.0 * count / total), 3) for name, count in hits.items()}
    print(results, percent, f"of {total} targets")


def measure(name: str, truth: Any, estimate: Any, points: Any, symmetries: Any, K: Any) -> float:
    """One error of an estimate, by the toolkit."""
    poses = list_poses(truth, estimate)
    if name == "mssd":
        return float(pose_error.mssd(*poses, points, symmetries))
    if name == "mspd":
        return float(pose_error.mspd(*poses, K, points, symmetries))
    return float((pose_error.adi if len(symmetries) > 1 else pose_error.add)(*poses, points))


def list_poses(truth: Any, estimate: Any) -> tuple[Any, ...]:
    """Estimated and true rotation and translation."""
    return estimate["R"], estimate["t"], truth["cam_R_m2c"], truth["cam_t_m2c"]


def count_matches(errors: Any, limit: float) -> int:
    """The number of true poses that an estimate is matched to, each estimate in turn."""
    free = set(range(len(errors)))
    for column in errors.T if errors.size else ():
        near = [(column[k], k) for k in free if column[k] < limit]
        free -= {min(near)[1]} if near else set()
    return len(errors) - len(free)


if __name__ == "__main__":
    draws = ImageRenderer(Path(sys.argv[1]))
    compare_renderings(Path(sys.argv[1]), draws)
    for path in sys.argv[2:]:
        measure_recall(Path(sys.argv[1]), Path(path), draws)
