"""Record a demonstration: take a range image in every pause, which the TV camera detects."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import RangeImage
from apo_bench.simulation.scene import World
from apo_bench.simulation.sensor.rays import Sight
from apo_bench.simulation.sensor.tv_camera import Change, TvCamera

_STILL = 5e-5
"""Change of every coordinate of `qpos`, [m] or of a quaternion, up to which the picture is not computed again."""


@final
@dataclass(frozen=True, eq=False)
class DemonstrationImages:
    """The range images of a demonstration without sensor errors: one at its begin, and one for every pause."""

    images: tuple[RangeImage, ...]
    times_s: tuple[float, ...]
    """Simulated time of each image, [s]."""
    pictures: tuple[Array, ...]
    """Pictures of the TV camera at these times, without noise, (height, width), black 0 to white 1."""


@final
class DemonstrationCamera:
    """The `watch` argument of `demonstrate`: called with the `MjData` at every picture, which it leaves unchanged."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        """Start to record one demonstration.

        Args:
            rng: Source of the noise of the TV camera.
        """
        self.camera = TvCamera()
        self.period_s = self.camera.period_s
        self._sight = Sight(world)
        self._rgba = np.array(world.model.geom_rgba, dtype=np.float64)
        self._change = Change(self.camera)
        self._rng = rng
        # Time and `qpos` at each picture of the present pause.
        self._spell: list[tuple[float, Array]] = []
        self._images: list[RangeImage] = []
        self._times: list[float] = []
        self._pictures: list[Array] = []
        # `qpos` and the picture without noise that was computed last.
        self._drawn: tuple[Array, Array] | None = None

    def __call__(self, data: Any) -> None:
        """Take a picture; at the end of a pause, keep its range image."""
        now = float(data.time)
        if not self._images:
            self._fire(now, data.qpos)
        if self._change.quiet(self._picture(data.qpos), now):
            self._spell.append((now, np.array(data.qpos)))
        elif self._spell:
            self._keep(now - self.camera.late_s)

    def watched(self) -> DemonstrationImages:
        """Return the images after the demonstration is over, with that of the last pause."""
        self._keep(np.inf)
        return DemonstrationImages(tuple(self._images), tuple(self._times), tuple(self._pictures))

    def _picture(self, qpos: Array) -> Array:
        """Return the next picture of the TV camera, (pixels,), with new noise; computed again only after a motion."""
        if self._drawn is None or np.abs(qpos - self._drawn[0]).max() > _STILL:
            self._drawn = np.array(qpos), self._grey(qpos)
        grey = self._drawn[1]
        return np.asarray(grey + self.camera.noise * self._rng.standard_normal(len(grey)))

    def _grey(self, qpos: Array) -> Array:
        """Return the picture of the TV camera without noise, (pixels,)."""
        self._sight.look(qpos)
        return self.camera.brightness(self._sight.strike(self.camera.view), self._rgba)

    def _keep(self, until_s: float) -> None:
        """Take the range image of the present pause, at its last picture up to a time, and end the pause.

        Args:
            until_s: Latest time at which no motion can have begun yet.
        """
        before = [firing for firing in self._spell if firing[0] <= until_s + 1e-9]
        if before:
            self._fire(*before[-1])
        self._spell.clear()

    def _fire(self, time_s: float, qpos: Array) -> None:
        """Record range image and picture at a state."""
        self._pictures.append(self._grey(qpos).reshape(self.camera.view.height, self.camera.view.width))
        self._images.append(self._sight.range_image())
        self._times.append(time_s)
