"""What rays strike in a simulated scene, by `mj_multiRay` and without any graphics."""

from collections.abc import Mapping
from typing import Any, NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Solid, shrink_pieces
from apo_bench.perception.depth_camera.range_finder import VIEWS, PinholeView, RangeImage
from apo_bench.simulation.scene import World
from apo_bench.simulation.scene.geoms import add_pieces

_AWAY_M = -5.0
"""Hands are put this deep below the floor before a picture is taken."""
_FARTHEST_M = 100.0
_NOWHERE_M = 1e4
"""Models that are not there are farther away than any ray goes."""


class Strikes(NamedTuple):
    """The ends of n rays."""

    distance: Array
    """(n,), [m], infinite where nothing is."""
    normal: Array
    """(n, 3), world; zero where nothing is."""
    geom: NDArray[np.int32]
    """(n,), -1 where nothing is."""


def cast_rays(model: Any, data: Any, origin: Array, rays: Array) -> Strikes:
    """Send rays (n, 3) from one point (3,) through a scene as it stands."""
    n = len(rays)
    geom = np.empty(n, np.int32)
    distance = np.empty(n)
    normal = np.zeros(3 * n)
    ways = np.ascontiguousarray(rays).reshape(-1)
    mujoco.mj_multiRay(model, data, origin, ways, None, True, -1, geom, distance, normal, n, _FARTHEST_M)
    return Strikes(np.where(geom < 0, np.inf, distance), normal.reshape(-1, 3), geom)


@final
class Sight:
    """A scene as a camera meets it: the poses of the moment, and no hands.

    The simulated hands are balls without arms that stay where they let go. A person takes the hands out of the picture;
    here they are left out of every picture. It has data of its own, so the state of the simulation stays as it is.
    """

    def __init__(self, world: World) -> None:
        self._model = world.model
        self._own = mujoco.MjData(world.model)

    def look(self, qpos: Array) -> None:
        """Put all parts where a simulation has them."""
        self._own.qpos[:] = qpos
        self._own.mocap_pos[:, 2] = _AWAY_M
        mujoco.mj_kinematics(self._model, self._own)

    def strike(self, view: PinholeView) -> Strikes:
        """Send out all rays of a view."""
        return cast_rays(self._model, self._own, view.origin, view.rays)

    def range_image(self) -> RangeImage:
        """True distances in every view of the range finder."""
        shape = (len(VIEWS), VIEWS[0].height, VIEWS[0].width)
        strikes = [self.strike(view) for view in VIEWS]
        cosine = [
            np.abs(np.einsum("ni,ni->n", strike.normal, view.rays)) for strike, view in zip(strikes, VIEWS, strict=True)
        ]
        distance = np.array([strike.distance for strike in strikes])
        return RangeImage(distance.reshape(shape), np.array(cosine).reshape(shape))


@final
class ModelRays:
    """A `RayCaster`: models of parts and nothing else, wherever they are put."""

    def __init__(self, solids: Mapping[str, Solid], play_m: float) -> None:
        spec = mujoco.MjSpec()
        for part, solid in solids.items():
            body = spec.worldbody.add_body(name=part, mocap=True)
            add_pieces(spec, body, shrink_pieces(solid, play_m), {}, f"{part}/")
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        bodies = [self._model.body(part) for part in solids]
        self._mocap = {part: int(body.mocapid[0]) for part, body in zip(solids, bodies, strict=True)}
        self._mocap_of = np.append(self._model.body_mocapid[self._model.geom_bodyid], len(solids))

    def __call__(self, poses: Mapping[str, Array], origin: Array, rays: Array) -> tuple[Array, NDArray[np.int64]]:
        self._data.mocap_pos[:] = _NOWHERE_M
        number = np.full(len(self._mocap) + 1, -1)
        for i, (part, T) in enumerate(poses.items()):
            k = self._mocap[part]
            number[k] = i
            self._data.mocap_pos[k] = T[:3, 3]
            mujoco.mju_mat2Quat(self._data.mocap_quat[k], T[:3, :3].ravel())
        mujoco.mj_kinematics(self._model, self._data)
        strikes = cast_rays(self._model, self._data, origin, rays)
        return strikes.distance, number[self._mocap_of[strikes.geom]]
