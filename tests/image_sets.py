"""Small data sets of images, without graphics, and results files with known errors."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench import TrialConfig, load_scenario
from apo_bench.benchmark.datasets.images.make import make_images
from apo_bench.formats.bop import EstimatedPose, write_results
from apo_bench.formats.bop_images import ImageConfig
from apo_bench.geometry import Array, pose

SMALL = ImageConfig(width=160, height=120, no_rgb=True, depth_noise_mm=0.0)


def make(
    out: Path, name: str = "stick_in_tower", seeds: range = range(1), config: ImageConfig = SMALL, **more: Any
) -> Path:
    """Images of trials of an ideal human."""
    clearance_mm = load_scenario(name).clearance_mm
    trials = [TrialConfig(name, seed=seed, clearance_mm=clearance_mm, human_error_scale=0.0, **more) for seed in seeds]
    make_images(trials, out, config)
    return out


def list_truth(images: Path) -> Iterator[tuple[tuple[int, int, int], Array]]:
    """Scene, image and object of every true pose, and the pose (4, 4), camera from model, [m]."""
    for file in sorted(images.glob("test/*/scene_gt.json")):
        for image, entries in json.loads(file.read_text(encoding="utf-8")).items():
            for entry in entries:
                T = pose.rigid(np.reshape(entry["cam_R_m2c"], (3, 3)), 1e-3 * np.array(entry["cam_t_m2c"]))
                yield (int(file.parent.name), int(image), entry["obj_id"]), T


def write_truth(
    images: Path,
    name: str = "results.csv",
    change: Callable[[tuple[int, int, int], Array], Array | None] = lambda where, T: T,
    score: float = 1.0,
) -> Path:
    """The true poses as a results file, each changed; None leaves one out."""
    changed = [(where, change(where, T)) for where, T in list_truth(images)]
    write_results(images / name, [EstimatedPose(where, score, T, -1.0) for where, T in changed if T is not None])
    return images / name
