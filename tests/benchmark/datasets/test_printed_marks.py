"""Printed marks: flat on the parts, and at the same places in the models and in the images."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from apo_bench import load_scenario
from apo_bench.benchmark.datasets.images.printed_marks import draw_marks
from apo_bench.formats.bop_images import read_cameras
from apo_bench.geometry import measure_depth_inside, pose
from tests.image_sets import SMALL, list_truth, make


@pytest.mark.parametrize("name", ["castle1", "stick"])
def test_marks_lie_on_the_surface_and_differ_by_object(name: str) -> None:
    pieces = load_scenario("stick_in_tower").assembly.solids[name].pieces
    marks, others = (draw_marks(pieces, np.random.default_rng(k)) for k in range(2))
    assert len(marks) > 10
    for mark in marks:
        corners = pose.apply(mark.T, mark.half * [(a, b, 0.0) for a in (-1, 1) for b in (-1, 1)])
        depth = np.max([measure_depth_inside(piece, corners) for piece in pieces], axis=0)
        # rounding; a mark that reached beyond an edge would be deeper or farther off
        assert np.abs(depth).max() < 1e-9
    assert not any(np.allclose(a.T, b.T) for a, b in zip(marks, others, strict=False))


def test_images_show_the_marks_of_the_models(tmp_path: Path) -> None:
    """Where the middle of a mark of the model is visible by its depth, the image has its hue, but for covered ones."""
    config = replace(SMALL, width=640, height=480, no_rgb=False, marks=True, distance_mm=450.0)
    images = make(tmp_path / "set", "block_on_block", config=config)
    camera = read_cameras(images / "test" / "000001")[1]
    rgb, depth = (imageio.imread(images / "test" / "000001" / kind / "000001.png") for kind in ("rgb", "depth"))
    likeness = []
    for (_, _, number), T in list_truth(images):
        model = trimesh.load(images / "models" / f"obj_{number:06d}.ply")
        colors = np.asarray(model.visual.vertex_colors)[:, :3].astype(float)
        hues, members = np.unique(colors, axis=0, return_inverse=True)
        for k, hue in enumerate(hues):
            middle = pose.apply(T, 1e-3 * model.vertices[members == k].mean(axis=0)[None])[0]
            u, v = np.round((camera.K @ middle)[:2] / middle[2]).astype(int)
            # a step of the depth image is 0.1 mm
            if 0 <= u < 640 and 0 <= v < 480 and abs(1e-4 * depth[v, u] - middle[2]) < 5e-4:
                shown = rgb[v, u].astype(float)
                likeness.append(shown @ hue / np.linalg.norm(shown) / np.linalg.norm(hue))
    assert len(likeness) > 20
    assert np.mean(np.array(likeness) > 0.99) > 0.7
