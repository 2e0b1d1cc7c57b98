"""How the images of a data set are taken: the cameras, their errors, and the split."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.range_finder import PinholeView, look_at
from apo_bench.records import FIRST_TRAINING_TRIAL

SPLITS = MappingProxyType({"test": 0, "val": FIRST_TRAINING_TRIAL})
"""Split -> its first seed, by default; the seeds of the two do not overlap."""
_COUNTS = (1, 2, 4)  # numbers of cameras
_FOCAL = 1.25
"""Default focal length, relative to the width of the image."""
_SPREAD_DEG = np.array([15.0, 8.0])
"""Randomised cameras: largest change of azimuth and elevation."""
_SPREAD = 0.1
"""Randomised cameras: largest change of the distance, as a fraction."""
_LARGEST_PX = 1280, 960
_LARGEST_MM = 5000.0
_CAMERA_NUMBER = 1000
"""Number of the first image of the second camera; images of the first are numbered as their operations."""


class ViewPair(NamedTuple):
    """A camera as the estimator knows it, and as it is."""

    published: PinholeView
    true: PinholeView


@final
@dataclass(frozen=True)
class ImageConfig:
    """How images are taken.

    Raises:
        InputError: A value is not allowed.
    """

    cameras: int = field(default=1, metadata={"help": "Number of cameras around the table: 1, 2 or 4."})
    width: int = field(default=640, metadata={"help": "Width of an image, in pixels."})
    height: int = field(default=480, metadata={"help": "Height of an image, in pixels."})
    focal_px: float = field(default=0.0, metadata={"help": "Focal length in pixels; 0: 1.25 times the width."})
    distance_mm: float = field(default=900.0, metadata={"help": "Distance of the cameras from the assembly, in mm."})
    camera_error_mm: float = field(
        default=0.0, metadata={"help": "Error of the published camera positions, in mm (1 sigma per axis)."}
    )
    camera_error_deg: float = field(
        default=0.0, metadata={"help": "Error of the published camera orientations, in degrees (1 sigma per axis)."}
    )
    depth_noise_mm: float = field(
        default=1.0,
        metadata={"help": "Noise of a depth pixel at 1 m, in mm (1 sigma); grows with the squared depth."},
    )
    no_rgb: bool = field(default=False, metadata={"help": "Write depth and masks only, which needs no graphics."})
    randomise: bool = field(default=False, metadata={"help": "Vary camera poses, lights and background by trial."})

    def __post_init__(self) -> None:
        require(self.cameras in _COUNTS, f"--cameras must be 1, 2 or 4, got {self.cameras}.")
        for name, size, most in zip(("width", "height"), (self.width, self.height), _LARGEST_PX, strict=True):
            require(32 <= size <= most, f"--{name} must be from 32 to {most} pixels, got {size}.")
        for each in fields(self)[3:8]:
            value = getattr(self, each.name)
            require(
                np.isfinite(value) and 0.0 <= value <= _LARGEST_MM,
                f"--{each.name.replace('_', '-')} must be from 0 to {_LARGEST_MM:g}, got {value:g}.",
            )
        require(self.distance_mm >= 100.0, f"--distance-mm must be at least 100, got {self.distance_mm:g}.")

    @property
    def fov_deg(self) -> float:
        """Vertical opening angle."""
        return float(2.0 * np.degrees(np.arctan(self.height / 2 / (self.focal_px or _FOCAL * self.width))))

    def plain(self) -> dict[str, float]:
        """The options as numbers, for the description of the data set."""
        return {name: float(value) for name, value in asdict(self).items()}

    def view(self, T_world_view: Array) -> PinholeView:
        """A camera of this size at a pose, (4, 4), world, [m]."""
        return PinholeView(T_world_view, self.width, self.height, self.fov_deg)

    def draw_views(self, rng: np.random.Generator) -> tuple[ViewPair, ...]:
        """Draw the cameras of a trial: published and true ones."""
        drawn = [(rng.uniform(-1.0, 1.0, 3), rng.standard_normal(6)) for _ in range(self.cameras)]
        return tuple(self._draw_pair(camera, *chance) for camera, chance in enumerate(drawn))

    def _draw_pair(self, camera: int, change: Array, error: Array) -> ViewPair:
        """One camera of a trial.

        Args:
            change: (3,), from -1 to 1, of azimuth, elevation and distance.
            error: (6,), standard normal, of the calibration.
        """
        from apo_bench.perception.observation.models import camera as usual

        change = change * self.randomise
        usual_deg = usual.CAMERA_AZIMUTH_DEG + 360.0 / self.cameras * camera, usual.CAMERA_ELEVATION_DEG
        azimuth, elevation = np.radians(usual_deg + _SPREAD_DEG * change[:2])
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        reach = 1e-3 * self.distance_mm * (1.0 + _SPREAD * change[2])
        T = look_at(usual.WORKSPACE_MIDDLE_M + reach * away, usual.WORKSPACE_MIDDLE_M)
        sigma = np.repeat([1e-3 * self.camera_error_mm, np.radians(self.camera_error_deg)], 3)
        return ViewPair(self.view(T), self.view(T @ pose.exp(sigma * error)))


def number_images(operations: int, cameras: int) -> Iterator[tuple[int, int, int]]:
    """Yield number of an image, its operation from 1, and its camera from 0."""
    for camera in range(cameras):
        for operation in range(1, operations + 1):
            yield _CAMERA_NUMBER * camera + operation, operation, camera
