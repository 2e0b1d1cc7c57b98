"""A TV camera of low resolution: what it sees, in grey, and whether that has changed."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import VIEWED_POINT_M, PinholeView, look_at
from apo_bench.simulation.sensor.rays import Strikes

_LIGHT = np.array([0.25, -0.35, 1.0]) / np.linalg.norm([0.25, -0.35, 1.0])
"""Where the light comes from: that of the room."""
_AMBIENT = 0.4
_LUMA = np.array([0.299, 0.587, 0.114])
_BACKGROUND = 0.9


@lru_cache(maxsize=1)
def _front_view() -> PinholeView:
    """Obliquely from the front, 160 x 120: a pixel is 6 mm wide, and a motion of some millimetres changes few."""
    return PinholeView(look_at((0.85, -0.35, 0.75), VIEWED_POINT_M), 160, 120, 45.0)


@final
@dataclass(frozen=True, eq=False)
class TvCamera:
    """How it sees, and when it calls something a change."""

    view: PinholeView = field(default_factory=_front_view)
    noise: float = 2.0 / 255.0
    """Standard deviation of the brightness of a pixel, where white is 1."""
    changed: float = 12.0 / 255.0
    """A pixel differs if its brightness does by more: four standard deviations of a difference."""
    share: float = 0.0004
    """A picture differs if more than this share of its pixels does: seven, where noise alone makes less than one."""
    quiet_s: float = 0.15
    """The scene is quiet if pictures have not differed for so long."""
    late_s: float = 0.1
    """A motion that begins slowly is seen so much later at most."""
    period_s: float = 0.05
    """Between two pictures."""

    def brightness(self, strikes: Strikes, rgba: Array) -> Array:
        """The picture without noise, (n,): Lambert's law, one light, the colours of the geoms.

        Args:
            rgba: (geoms, 4).
        """
        lit = _AMBIENT + (1.0 - _AMBIENT) * np.maximum(strikes.normal @ _LIGHT, 0.0)
        grey = np.append(rgba[:, :3] @ _LUMA, _BACKGROUND)[strikes.geom]
        return np.where(strikes.geom < 0, _BACKGROUND, grey * lit)


@final
class Change:
    """Compares pictures one after the other: is the scene quiet?"""

    def __init__(self, camera: TvCamera) -> None:
        self._camera = camera
        self._reference: Array | None = None
        self._since = 0.0

    def quiet(self, picture: Array, time_s: float) -> bool:
        """Take one more picture; whether nothing has changed for `quiet_s`.

        Pictures are compared with the one at the last change, so that slow motions add up until they are seen.
        """
        if self._reference is None or self._differs(picture, self._reference):
            self._reference = picture
            self._since = time_s
        return time_s - self._since >= self._camera.quiet_s - 1e-9

    def _differs(self, picture: Array, reference: Array) -> bool:
        return bool(np.mean(np.abs(picture - reference) > self._camera.changed) > self._camera.share)
