"""Recall of true poses with Gaussian errors, next to what first-order theory expects of it.

    python -m benchmarks.expected_recall IMAGES RESULTS.csv --mm 2 --deg 2

writes the poses as RESULTS.csv, which `bop_toolkit_check.py` reads as well. The expectation needs no estimates: it
moves the vertices of each visible part by random twists. VSD has none.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from apo_bench.benchmark.scoring.images import pool_recall
from apo_bench.benchmark.scoring.pose_errors import measure_recall
from apo_bench.formats.bop import EstimatedPose, read_results, write_results
from apo_bench.formats.bop_images import LEAST_VISIBLE, read_cameras, read_image_description
from apo_bench.geometry import Array, pose

DRAWS = 200
"""Random errors of each part."""
SHARES = np.arange(1, 11) * 0.05
PIXELS = np.arange(1, 11) * 5.0
WIDTH_PX = 640.0
ADD_SHARE = 0.1

Part = tuple[tuple[int, int, int], Array, Array, float]
"""Scene, image and object; pose (4, 4), camera from model, [mm]; camera matrix (3, 3); visible fraction."""


def list_parts(images: Path) -> Iterator[Part]:
    """Yield all parts in all images."""
    for scene in sorted((images / "test").iterdir()):
        cameras = read_cameras(scene)
        facts = json.loads((scene / "scene_gt_info.json").read_text(encoding="utf-8"))
        for image, entries in json.loads((scene / "scene_gt.json").read_text(encoding="utf-8")).items():
            for entry, fact in zip(entries, facts[image], strict=True):
                T = pose.rigid(np.reshape(entry["cam_R_m2c"], (3, 3)), entry["cam_t_m2c"])
                where = int(scene.name), int(image), entry["obj_id"]
                yield where, T, cameras[int(image)].K, fact["visib_fract"]


def write_noisy(images: Path, out: Path, sigma: Array, rng: np.random.Generator) -> None:
    """Write the true poses with errors as a results file.

    Args:
        sigma: (6,), of the twist in the frame of the model, [mm, rad].
    """
    metres = np.repeat([1e-3, 1.0], 3)
    rows = []
    for where, T, _, _ in list_parts(images):
        error = pose.exp(metres * sigma * rng.standard_normal(6))
        rows.append(EstimatedPose(where, 1.0, pose.rigid(T[:3, :3], 1e-3 * T[:3, 3]) @ error, -1.0))
    write_results(out, rows)


def draw_hits(
    part: Part, vertices: Array, info: dict[str, Any], sigma: Array, width: int, rng: np.random.Generator
) -> Array:
    """The fractions of thresholds that random errors of a part pass, (DRAWS, 3): MSSD, MSPD and ADD."""
    _, T, K, _ = part
    shift, turn = np.split(sigma * rng.standard_normal((DRAWS, 6)), 2, axis=1)
    for axis in info.get("symmetries_continuous", ()):
        turn -= (turn @ axis["axis"])[:, None] * np.array(axis["axis"])
    moved = shift[:, None] + np.cross(turn[:, None], vertices)
    at = pose.apply(T, vertices)
    across = moved @ T[:3, :3].T
    pixels = K[0, 0] / at[:, 2:] * (across[..., :2] - across[..., 2:] * at[:, :2] / at[:, 2:])
    mssd = np.linalg.norm(moved, axis=2).max(axis=1) / info["diameter"]
    mspd = np.linalg.norm(pixels, axis=2).max(axis=1) * WIDTH_PX / width
    add = np.linalg.norm(moved, axis=2).mean(axis=1) / info["diameter"]
    return np.column_stack(
        [(mssd[:, None] < SHARES).mean(axis=1), (mspd[:, None] < PIXELS).mean(axis=1), add < ADD_SHARE]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--mm", type=float, default=2.0, help="standard deviation per axis of the position")
    parser.add_argument("--deg", type=float, default=2.0, help="and of the rotation")
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    sigma = np.repeat([given.mm, np.radians(given.deg)], 3)
    write_noisy(given.images, given.results, sigma, rng)
    description = read_image_description(given.images)
    known = json.loads((given.images / "models" / "models_info.json").read_text(encoding="utf-8"))
    models = {name: trimesh.load(given.images / "models_eval" / f"obj_{int(name):06d}.ply").vertices for name in known}
    hits = []
    for part in list_parts(given.images):
        if part[3] >= LEAST_VISIBLE:
            name = str(part[0][2])
            hits.append(draw_hits(part, np.array(models[name]), known[name], sigma, description.options.width, rng))
    measured = pool_recall(measure_recall(given.images, description, read_results(given.results)).values())
    print(f"{len(hits)} visible parts; VSD measured {measured['vsd']:.1f} %")
    expected, error = np.mean(hits, axis=0), np.sqrt(np.var(hits, axis=1).sum(axis=0)) / len(hits)
    for name, mean, deviation in zip(
        ("mssd", "mspd", "add"), 100.0 * expected.mean(axis=0), 100.0 * error, strict=True
    ):
        print(f"{name}: measured {measured[name]:.1f} %, expected {mean:.1f} +- {deviation:.1f} %")


if __name__ == "__main__":
    main()
