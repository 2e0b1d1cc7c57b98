"""Record a demonstration by the range finder whenever the TV camera sees no change."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import RangeImage
from apo_bench.simulation.scene import World
from apo_bench.simulation.sensor.rays import Sight
from apo_bench.simulation.sensor.tv_camera import Change, TvCamera

_STILL = 5e-5
"""Where no coordinate has changed by more, [m] or of a quaternion, the picture is the same."""


@final
@dataclass(frozen=True, eq=False)
class DemonstrationImages:
    """What the range finder saw without any error: before everything, and in every quiet spell."""

    images: tuple[RangeImage, ...]
    times_s: tuple[float, ...]
    """Simulated time of each firing."""
    pictures: tuple[Array, ...]
    """What the TV camera saw then, without noise, (height, width), black 0 to white 1."""


@final
class DemonstrationCamera:
    """Pass it to `demonstrate` as `watch`: it is called with the `MjData` at every picture and changes nothing."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        """A watcher of one demonstration.

        Args:
            rng: The noise of the TV camera.
        """
        self.camera = TvCamera()
        self.period_s = self.camera.period_s
        self._sight = Sight(world)
        self._rgba = np.array(world.model.geom_rgba, dtype=np.float64)
        self._change = Change(self.camera)
        self._rng = rng
        self._spell: list[tuple[float, Array]] = []
        self._images: list[RangeImage] = []
        self._times: list[float] = []
        self._pictures: list[Array] = []
        self._drawn: tuple[Array, Array] | None = None

    def __call__(self, data: Any) -> None:
        now = float(data.time)
        if not self._images:
            self._fire(now, data.qpos)
        if self._change.quiet(self._picture(data.qpos), now):
            self._spell.append((now, np.array(data.qpos)))
        elif self._spell:
            self._keep(now - self.camera.late_s)

    def watched(self) -> DemonstrationImages:
        """What was kept, when the demonstration is over."""
        self._keep(np.inf)
        return DemonstrationImages(tuple(self._images), tuple(self._times), tuple(self._pictures))

    def _picture(self, qpos: Array) -> Array:
        """The next picture of the TV camera; where nothing moved only its noise is new."""
        if self._drawn is None or np.abs(qpos - self._drawn[0]).max() > _STILL:
            self._drawn = np.array(qpos), self._grey(qpos)
        grey = self._drawn[1]
        return np.asarray(grey + self.camera.noise * self._rng.standard_normal(len(grey)))

    def _grey(self, qpos: Array) -> Array:
        self._sight.look(qpos)
        return self.camera.brightness(self._sight.strike(self.camera.view), self._rgba)

    def _keep(self, until_s: float) -> None:
        """Keep the last firing of a quiet spell from before a motion could have begun."""
        before = [firing for firing in self._spell if firing[0] <= until_s + 1e-9]
        if before:
            self._fire(*before[-1])
        self._spell.clear()

    def _fire(self, time_s: float, qpos: Array) -> None:
        self._pictures.append(self._grey(qpos).reshape(self.camera.view.height, self.camera.view.width))
        self._images.append(self._sight.range_image())
        self._times.append(time_s)
