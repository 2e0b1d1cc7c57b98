"""The cameras of a trial, as published and as they are, and the numbers of their images."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.formats.bop_images import ImageConfig
from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.range_finder import PinholeView, look_at
from apo_bench.perception.observation.models.camera import (
    CAMERA_AZIMUTH_DEG,
    CAMERA_ELEVATION_DEG,
    WORKSPACE_MIDDLE_M,
)

_FOCAL = 1.25
"""Default focal length, relative to the width of the image."""
_SPREAD_DEG = np.array([15.0, 8.0])
"""Randomised cameras: largest change of azimuth and elevation."""
_SPREAD = 0.1
"""Randomised cameras: largest change of the distance, as a fraction."""
_CAMERA_NUMBER = 1000
"""Number of the first image of the second camera; images of the first are numbered as their operations."""


class ViewPair(NamedTuple):
    """A camera as the estimator knows it, and as it is."""

    published: PinholeView
    true: PinholeView


def make_view(config: ImageConfig, T_world_view: Array) -> PinholeView:
    """A camera of the size of the images at a pose, (4, 4), world, [m]."""
    focal = config.focal_px or _FOCAL * config.width
    fov_deg = float(2.0 * np.degrees(np.arctan(config.height / 2 / focal)))
    return PinholeView(T_world_view, config.width, config.height, fov_deg)


def draw_views(config: ImageConfig, rng: np.random.Generator) -> tuple[ViewPair, ...]:
    """Draw the cameras of a trial."""
    sigma = np.repeat([1e-3 * config.camera_error_mm, np.radians(config.camera_error_deg)], 3)
    views = []
    for camera in range(config.cameras):
        change = config.randomise * rng.uniform(-1.0, 1.0, 3)
        usual_deg = CAMERA_AZIMUTH_DEG + 360.0 / config.cameras * camera, CAMERA_ELEVATION_DEG
        azimuth, elevation = np.radians(usual_deg + _SPREAD_DEG * change[:2])
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        reach = 1e-3 * config.distance_mm * (1.0 + _SPREAD * change[2])
        T = look_at(WORKSPACE_MIDDLE_M + reach * away, WORKSPACE_MIDDLE_M)
        error = pose.exp(sigma * rng.standard_normal(6))
        views.append(ViewPair(make_view(config, T), make_view(config, T @ error)))
    return tuple(views)


def number_images(operations: int, cameras: int) -> Iterator[tuple[int, int, int]]:
    """Yield number of an image, its operation from 1, and its camera from 0."""
    for camera in range(cameras):
        for operation in range(1, operations + 1):
            yield _CAMERA_NUMBER * camera + operation, operation, camera
