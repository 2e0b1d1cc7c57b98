"""Watch a demonstration while it runs: the TV camera says when it is quiet, and then the range finder fires.

The TV camera takes grey pictures of low resolution.

What rays strike in a simulated scene, without any graphics.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.depth_camera.range_finder import VIEWED_POINT_M, PinholeView, RangeFinder, RangeImage, look_at
from apo_bench.geometry import Array
from apo_bench.simulation.scene import World

_AWAY_M = -5.0
"""Hands are put this deep below the floor before anything is looked at."""


class Strike(NamedTuple):
    """The ends of the rays of a view, one number per ray."""

    distance: Array
    """[m], infinite where nothing is."""
    cosine: Array
    """Between ray and normal, 0 to 1."""
    normal: Array
    """(n, 3), world; zero where nothing is."""
    geom: NDArray[np.int32]
    """-1 where nothing is."""


@final
class Sight:
    """A scene as a camera meets it: the poses of the moment, and no hands.

    The simulated hands are balls without arms that stay where they let go. A person takes the hands out of the picture;
    here they are left out of every picture. It has data of its own, so what is looked at stays as it is.
    """

    def __init__(self, world: World) -> None:
        self._model = world.model
        self._own = mujoco.MjData(world.model)
        self._fixed: dict[int, tuple[PinholeView, Strike]] = {}

    def look(self, qpos: Array) -> None:
        """Put all parts where a simulation has them."""
        self._own.qpos[:] = qpos
        self._own.mocap_pos[:, 2] = _AWAY_M
        mujoco.mj_kinematics(self._model, self._own)

    def strike(self, view: PinholeView) -> Strike:
        """Send out all rays of a view; what does not move is met only once."""
        if id(view) not in self._fixed:
            self._fixed[id(view)] = view, self._fixed_parts(view)
        fixed = self._fixed[id(view)][1]
        geom, distance, normal = self._cast(view, fixed=False)
        nearer = (geom >= 0) & (distance < fixed.distance)
        cosine = np.abs(np.einsum("ni,ni->n", normal, view.rays))
        return Strike(
            np.where(nearer, distance, fixed.distance),
            np.where(nearer, cosine, fixed.cosine),
            np.where(nearer[:, None], normal, fixed.normal),
            np.where(nearer, geom, fixed.geom),
        )

    def _fixed_parts(self, view: PinholeView) -> Strike:
        moving = self._model.body_weldid[self._model.geom_bodyid] != 0
        places = np.array(self._own.geom_xpos)
        self._own.geom_xpos[moving, 2] = _AWAY_M
        geom, distance, normal = self._cast(view, fixed=True)
        self._own.geom_xpos[:] = places
        cosine = np.abs(np.einsum("ni,ni->n", normal, view.rays))
        return Strike(np.where(geom < 0, np.inf, distance), np.where(geom < 0, 0.0, cosine), normal, geom)

    def _cast(self, view: PinholeView, fixed: bool) -> tuple[NDArray[np.int32], Array, Array]:
        """Numbers of geoms, distances and normals, of everything, or of what can move."""
        n = len(view.rays)
        geom = np.empty(n, np.int32)
        distance = np.empty(n)
        normal = np.zeros(3 * n)
        ways = view.rays.reshape(-1)
        mujoco.mj_multiRay(self._model, self._own, view.origin, ways, None, fixed, -1, geom, distance, normal, n, 1e10)
        return geom, distance, normal.reshape(-1, 3)

    def range_image(self, finder: RangeFinder) -> RangeImage:
        """True distances in every view of the range finder."""
        strikes = [self.strike(view) for view in finder.views]
        shapes = [(view.height, view.width) for view in finder.views]
        return RangeImage(
            np.array([strike.distance.reshape(shape) for strike, shape in zip(strikes, shapes, strict=True)]),
            np.array([strike.cosine.reshape(shape) for strike, shape in zip(strikes, shapes, strict=True)]),
        )


_LIGHT = np.array([0.25, -0.35, 1.0]) / np.linalg.norm([0.25, -0.35, 1.0])
"""Where the light comes from: that of the room."""
_AMBIENT = 0.4
_LUMA = np.array([0.299, 0.587, 0.114])
_BACKGROUND = 0.9
_STILL = 5e-5
"""Where no coordinate has changed by more, [m] or of a quaternion, the picture is the same."""


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

    def brightness(self, strike: Strike, rgba: Array) -> Array:
        """The picture without noise, (n,): Lambert's law, one light, the colours of the geoms.

        Args:
            rgba: (geoms, 4).
        """
        lit = _AMBIENT + (1.0 - _AMBIENT) * np.maximum(strike.normal @ _LIGHT, 0.0)
        grey = np.append(rgba[:, :3] @ _LUMA, _BACKGROUND)[strike.geom]
        return np.where(strike.geom < 0, _BACKGROUND, grey * lit)


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


@final
@dataclass(frozen=True, eq=False)
class DemonstrationImages:
    """What the range finder saw without any error: before everything, and in every quiet spell."""

    finder: RangeFinder
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
        self.finder = RangeFinder()
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
        return DemonstrationImages(self.finder, tuple(self._images), tuple(self._times), tuple(self._pictures))

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
        self._images.append(self._sight.range_image(self.finder))
        self._times.append(time_s)
