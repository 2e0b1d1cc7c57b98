"""A grey TV camera of low resolution that detects whether the scene changes, to find when a demonstration pauses."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import VIEWED_POINT_M, PinholeView, look_at
from apo_bench.simulation.sensor.rays import Strikes

_LIGHT = np.array([0.25, -0.35, 1.0]) / np.linalg.norm([0.25, -0.35, 1.0])
"""Unit vector towards the light, world."""
_AMBIENT = 0.4  # share of ambient light
_LUMA = np.array([0.299, 0.587, 0.114])  # weights of red, green and blue in the brightness
_BACKGROUND = 0.9  # brightness where a ray hits nothing


@lru_cache(maxsize=1)
def _front_view() -> PinholeView:
    """Return an oblique view from the front of 160 x 120 pixels, each 6 mm wide."""
    return PinholeView(look_at((0.85, -0.35, 0.75), VIEWED_POINT_M), 160, 120, 45.0)


@final
@dataclass(frozen=True, eq=False)
class TvCamera:
    """View, noise and thresholds of the TV camera."""

    view: PinholeView = field(default_factory=_front_view)
    noise: float = 2.0 / 255.0
    """Standard deviation of the brightness of a pixel, where white is 1."""
    changed: float = 12.0 / 255.0
    """Difference of brightness from which a pixel has changed: four standard deviations of a difference."""
    share: float = 0.0004
    """Fraction of changed pixels from which a picture has changed: seven pixels; noise alone changes less than one."""
    quiet_s: float = 0.15
    """Time without a change after which the scene is quiet."""
    late_s: float = 0.1
    """Greatest delay until a motion that begins slowly is detected."""
    period_s: float = 0.05
    """Time between two pictures."""

    def brightness(self, strikes: Strikes, rgba: Array) -> Array:
        """Return the brightness of n pixels without noise, (n,): Lambert's law with one light.

        Args:
            strikes: The hits of the pixels' rays.
            rgba: Colours of the geoms, (geoms, 4).
        """
        lit = _AMBIENT + (1.0 - _AMBIENT) * np.maximum(strikes.normal @ _LIGHT, 0.0)
        # The appended entry is that of geom -1, nothing.
        grey = np.append(rgba[:, :3] @ _LUMA, _BACKGROUND)[strikes.geom]
        return np.where(strikes.geom < 0, _BACKGROUND, grey * lit)


@final
class Change:
    """A change detector that is given one picture after the other."""

    def __init__(self, camera: TvCamera) -> None:
        self._camera = camera
        self._reference: Array | None = None
        self._since = 0.0

    def quiet(self, picture: Array, time_s: float) -> bool:
        """Process the next picture; return whether the scene has not changed for `quiet_s`.

        Pictures are compared with that of the last change, so that slow motions add up until they are detected.

        Args:
            picture: Brightness of the pixels, (n,), with noise.
        """
        if self._reference is None or self._differs(picture, self._reference):
            self._reference = picture
            self._since = time_s
        return time_s - self._since >= self._camera.quiet_s - 1e-9

    def _differs(self, picture: Array, reference: Array) -> bool:
        """Whether the fraction of changed pixels between two pictures exceeds `share`."""
        return bool(np.mean(np.abs(picture - reference) > self._camera.changed) > self._camera.share)
