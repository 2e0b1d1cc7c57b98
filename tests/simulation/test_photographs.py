"""Photographs of parts: masks, depth and colours show the same thing, at the pixels that a pinhole camera predicts."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from apo_bench import InputError, Scene
from apo_bench.geometry import collect_corners, pose
from apo_bench.perception.depth_camera.range_finder import PinholeView, look_at
from apo_bench.simulation.sensor.photographs import Photograph, Photographer, find_box

VIEW = PinholeView(look_at((0.7, -0.4, 0.6), (0.12, 0.0, 0.03)), 160, 120, 40.0)


def place(scene: Scene, x: float = 0.12, y: float = 0.0) -> dict[str, np.ndarray]:
    """Castle 1 stands at a place, castle 2 upside down on it, the stick lies apart."""
    return {
        "castle1": pose.at((x, y, 0.0)),
        "castle2": pose.at((x, y, 0.08), (180.0, 0.0, 0.0)),
        "stick": pose.at((x, y + 0.15, 0.01)),
    }


def take(scene: Scene, poses: dict[str, np.ndarray], view: PinholeView = VIEW) -> Photograph:
    return Photographer(scene, view, colours=False).take(view, poses)


def test_silhouettes_are_those_of_projected_corners(tower: Scene) -> None:
    """The box around a silhouette is that around the corners of the part, up to two pixels."""
    poses = place(tower)
    photograph = take(tower, poses)
    for part, silhouette in photograph.whole.items():
        corners = pose.apply(poses[part], collect_corners(tower.pieces[part])[0])
        local = pose.apply(pose.inverse(VIEW.T_world_view), corners)
        pixels = (local @ VIEW.K.T)[:, :2] / local[:, 2:]
        left, top, width, height = silhouette.box
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        # pixels whose middles are inside; a sharp corner may end up to two pixels beyond the last of them
        assert (((left, top) - low >= 0.0) & ((left, top) - low < 2.0)).all()
        last = np.array([left + width - 1, top + height - 1])
        assert ((high - last >= 0.0) & (high - last < 2.0)).all()
        assert silhouette.pixels == silhouette.mask.sum() > 0


def test_parts_hide_each_other_and_nothing_else(tower: Scene) -> None:
    photograph = take(tower, place(tower))
    every = np.array([*photograph.visible.values()])
    whole = np.array([each.mask for each in photograph.whole.values()])
    assert every.sum(axis=0).max() == 1  # a pixel shows one part
    assert not (every & ~whole).any()
    assert np.array_equal(every.any(axis=0), whole.any(axis=0))  # where a part is hidden, another one is
    assert every[0].sum() < whole[0].sum()  # castle 2 hides some of castle 1
    assert np.array_equal(every[2], whole[2])  # the stick lies apart


def test_depth_is_that_of_the_table_and_of_the_parts(tower: Scene) -> None:
    photograph = take(tower, place(tower))
    ways = VIEW.rays / (VIEW.rays @ VIEW.T_world_view[:3, 2])[:, None]  # of depth 1
    points = VIEW.origin + photograph.depth.reshape(-1, 1) * ways
    free = ~np.any([*photograph.visible.values()], axis=0).ravel() & np.isfinite(photograph.depth).ravel()
    assert np.abs(points[free, 2]).max() < 1e-6  # the table is at z = 0
    top = points[photograph.visible["castle2"].ravel()]
    assert top[:, 2].max() == pytest.approx(0.08, abs=1e-6)


def test_a_part_that_leaves_the_image_counts_whole(tower: Scene) -> None:
    """As many pixels as in an image three times as wide and high, whose middle is this one."""
    fov_deg = np.degrees(2.0 * np.arctan(3.0 * np.tan(np.radians(VIEW.fov_deg) / 2.0)))
    wide = PinholeView(VIEW.T_world_view, 3 * VIEW.width, 3 * VIEW.height, float(fov_deg))
    poses = {**place(tower), "stick": pose.at((0.25, -0.35, 0.01))}
    part, whole = (take(tower, poses, view).whole["stick"] for view in (VIEW, wide))
    assert 0 < part.mask.sum() < part.pixels == whole.pixels == whole.mask.sum()
    assert part.box == (whole.box[0] - VIEW.width, whole.box[1] - VIEW.height, *whole.box[2:])


def test_colours_show_the_parts_where_the_masks_are(tower: Scene) -> None:
    """Inside its mask the yellow stick is redder than blue by far; the table around it is not."""
    try:
        photographer = Photographer(tower, VIEW)
    except InputError as error:
        pytest.skip(str(error))
    rolled = PinholeView(
        VIEW.T_world_view @ pose.exp([0.0, 0.0, 0.0, 0.02, -0.03, 0.3]), VIEW.width, VIEW.height, VIEW.fov_deg
    )
    with closing(photographer):
        for view in (VIEW, rolled):
            photograph = photographer.take(view, place(tower))
            assert photograph.rgb is not None
            rgb = photograph.rgb.astype(float)
            yellow = rgb[..., 0] > 1.6 * rgb[..., 2]
            red = rgb[..., 1] < 0.6 * rgb[..., 0]
            stick = yellow & ~red
            mask = photograph.visible["stick"]
            # edges are blended by the renderer, so some pixels of the outline differ
            assert (stick & mask).sum() > 0.85 * mask.sum()
            assert (stick & ~mask).sum() < 0.15 * mask.sum()


def test_the_box_of_no_pixel() -> None:
    nothing = np.zeros(0, dtype=int)
    assert find_box(nothing, nothing) == (-1, -1, -1, -1)
    assert find_box(np.array([3, 5]), np.array([7, 7])) == (7, 3, 1, 3)


def test_lights_and_table_vary_and_the_scene_does_not(tower: Scene) -> None:
    try:
        photographer = Photographer(tower, VIEW)
    except InputError as error:
        pytest.skip(str(error))
    before = tower.shown.model.geom_rgba.copy(), tower.shown.model.light_dir.copy()
    with closing(photographer):
        pictures = []
        for seed in (0, 1, 0):
            photographer.vary(np.random.default_rng(seed))
            pictures.append(photographer.take(VIEW, place(tower)).rgb)
    assert np.array_equal(pictures[0], pictures[2])
    assert np.abs(pictures[0].astype(float) - pictures[1]).mean() > 5.0
    assert np.array_equal(before[0], tower.shown.model.geom_rgba)
    assert np.array_equal(before[1], tower.shown.model.light_dir)
