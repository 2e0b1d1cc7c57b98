"""Ray casting in a scene by MuJoCo's `mj_multiRay`, without rendering: for range images and for matching of models."""

from collections.abc import Mapping
from typing import Any, NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Ints, Solid, collect_corners, pose, shrink_pieces
from apo_bench.perception.depth_camera.range_finder import VIEWS, PinholeView, RangeImage
from apo_bench.simulation.scene import World
from apo_bench.simulation.scene.geoms import add_pieces

_AWAY_M = -5.0
"""Height, below the floor, at which hands are hidden from every image."""
_FARTHEST_M = 100.0  # greatest length of a ray
_NOWHERE_M = 1e4
"""Coordinates of absent models, farther away than any ray reaches."""
_MARGIN_PX = 2
"""Pixels around the projected corners of a part in which it is looked for."""
_NEAREST_M = 1e-3
"""Depth at which a part in front of the image plane begins."""


class Strikes(NamedTuple):
    """The first surface that each of n rays hits."""

    distance: Array
    """Distance, (n,), [m]; infinite for a ray that hits nothing."""
    normal: Array
    """Surface normal, (n, 3), world; zero for a ray that hits nothing."""
    geom: NDArray[np.int32]
    """Geom id, (n,); -1 for a ray that hits nothing."""


class PartPixels(NamedTuple):
    """The n pixels that show a part without the others, also outside of the image."""

    rows: Ints
    columns: Ints
    distance: Array
    """Distance along the ray of each, [m]."""

    def fill_image(self, height: int, width: int) -> Array:
        """The distances of the pixels in the image, (height, width), [m], infinite elsewhere."""
        image = np.full((height, width), np.inf)
        inside = (self.rows >= 0) & (self.rows < height) & (self.columns >= 0) & (self.columns < width)
        image[self.rows[inside], self.columns[inside]] = self.distance[inside]
        return image


def cast_rays(model: Any, data: Any, origin: Array, rays: Array) -> Strikes:
    """Cast rays with unit directions, (n, 3), from one point, (3,), through the present scene.

    The poses of its geoms must be up to date (`mj_kinematics`).
    """
    n = len(rays)
    geom = np.empty(n, np.int32)
    distance = np.empty(n)
    normal = np.zeros(3 * n)
    ways = np.ascontiguousarray(rays).reshape(-1)
    # No geom group and no body is excluded (None, -1); static geoms are included (True).
    mujoco.mj_multiRay(model, data, origin, ways, None, True, -1, geom, distance, normal, n, _FARTHEST_M)
    return Strikes(np.where(geom < 0, np.inf, distance), normal.reshape(-1, 3), geom)


@final
class Sight:
    """A copy of the scene for cameras, with the present poses of the parts and without hands.

    The simulated hands are balls without arms that stay where they released a part. A person would take the hands out
    of the picture; here they are left out of every picture. The copy leaves the state of the simulation as it is.
    """

    def __init__(self, world: World) -> None:
        self._model = world.model
        self._own = mujoco.MjData(world.model)

    def look(self, qpos: Array) -> None:
        """Set the poses of all parts from the `qpos` of a simulation."""
        self._own.qpos[:] = qpos
        self._own.mocap_pos[:, 2] = _AWAY_M
        mujoco.mj_kinematics(self._model, self._own)

    def strike(self, view: PinholeView) -> Strikes:
        """Cast the rays of all pixels of a view."""
        return cast_rays(self._model, self._own, view.origin, view.rays)

    def range_image(self) -> RangeImage:
        """Return the true distances, and the cosines of incidence, in every view of the range finder."""
        shape = (len(VIEWS), VIEWS[0].height, VIEWS[0].width)
        strikes = [self.strike(view) for view in VIEWS]
        cosine = [
            np.abs(np.einsum("ni,ni->n", strike.normal, view.rays)) for strike, view in zip(strikes, VIEWS, strict=True)
        ]
        distance = np.array([strike.distance for strike in strikes])
        return RangeImage(distance.reshape(shape), np.array(cosine).reshape(shape))


@final
class ModelRays:
    """A `RayCaster` for models of parts at any poses, without anything else."""

    def __init__(self, solids: Mapping[str, Solid], play_m: float) -> None:
        """Build one movable body for each part, its fits shrunk by the clearance `play_m`."""
        spec = mujoco.MjSpec()
        pieces = {part: shrink_pieces(solid, play_m) for part, solid in solids.items()}
        for part, each in pieces.items():
            body = spec.worldbody.add_body(name=part, mocap=True)
            add_pieces(spec, body, each, {}, f"{part}/")
        self._corners = {part: collect_corners(each)[0] for part, each in pieces.items()}
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        bodies = [self._model.body(part) for part in solids]
        self._mocap = {part: int(body.mocapid[0]) for part, body in zip(solids, bodies, strict=True)}
        # Geom id -> mocap id; index -1, of a ray that hits nothing, is the last entry.
        self._mocap_of = np.append(self._model.body_mocapid[self._model.geom_bodyid], len(solids))

    def __call__(self, poses: Mapping[str, Array], origin: Array, rays: Array) -> tuple[Array, NDArray[np.int64]]:
        """Cast rays at models of parts.

        Args:
            poses: Poses of the parts that are present, (4, 4) each, world.
            origin: (3,), world, [m].
            rays: Unit directions, (n, 3), world.

        Returns:
            Distances, (n,), [m], infinite without a hit, and indices into `poses` of the parts hit, (n,), -1 without.
        """
        self._data.mocap_pos[:] = _NOWHERE_M
        number = np.full(len(self._mocap) + 1, -1)  # mocap id -> index into `poses`
        for i, (part, T) in enumerate(poses.items()):
            k = self._mocap[part]
            number[k] = i
            self._data.mocap_pos[k] = T[:3, 3]
            mujoco.mju_mat2Quat(self._data.mocap_quat[k], T[:3, :3].ravel())
        mujoco.mj_kinematics(self._model, self._data)
        strikes = cast_rays(self._model, self._data, origin, rays)
        return strikes.distance, number[self._mocap_of[strikes.geom]]

    def find_pixels(self, part: str, T: Array, view: PinholeView) -> PartPixels:
        """The pixels of a view that show a part alone at a pose, (4, 4), world; up to one image beyond the image."""
        (left, top), (right, bottom) = _frame_points(view, pose.apply(T, self._corners[part]))
        v, u = np.mgrid[top:bottom, left:right]
        distance, index = self({part: T}, view.origin, view.cast_through(u, v))
        hit = index == 0
        return PartPixels(v.ravel()[hit], u.ravel()[hit], distance[hit])


def _frame_points(view: PinholeView, points: Array) -> Ints:
    """The left upper and right lower pixel around points (k, 3), world, (2, 2), each column and row.

    It ends one image beyond the image, or there if a point is behind the camera.
    """
    size = np.array([view.width, view.height])
    local = pose.apply(pose.inverse(view.T_world_view), points)
    if local[:, 2].min() < _NEAREST_M:
        return np.array([-size, 2 * size])
    pixels = local[:, :2] / local[:, 2:] * view.focal + size / 2
    ends = np.floor(pixels.min(axis=0)) - _MARGIN_PX, np.ceil(pixels.max(axis=0)) + _MARGIN_PX
    return np.clip(np.array(ends).astype(np.int64), -size, 2 * size)
