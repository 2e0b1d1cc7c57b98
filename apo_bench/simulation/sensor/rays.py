"""What rays strike in a simulated scene, without any graphics."""

from typing import NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.depth_camera.range_finder import PinholeView, RangeFinder, RangeImage
from apo_bench.geometry import Array
from apo_bench.simulation.scene.world import World

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
