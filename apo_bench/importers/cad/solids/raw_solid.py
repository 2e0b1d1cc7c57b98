"""What a CAD file becomes first: closed meshes whose triangles belong to faces with parameters, [mm]."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, final

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array

RegionKind = Literal["plane", "cylinder", "cone", "other"]
Rgb = tuple[float, float, float]
"""0 to 1."""
SAME_CORNER_MM = 2e-4
"""Corners of a piece nearer to each other than this are one."""
_SAME_SHAPE = 2e-6
"""Solids are the same if their corners are, within this part of their size."""


@final
@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed mesh, or what will be one."""

    corners: Array
    """(k, 3)."""
    triangles: Any
    """(t, 3), whole numbers, counter-clockwise seen from outside."""

    @cached_property
    def across(self) -> Array:
        """Twice the area of each triangle as a vector along its normal, (t, 3)."""
        a, b, c = (self.corners[self.triangles[:, i]] for i in range(3))
        return np.asarray(np.cross(b - a, c - a))

    @cached_property
    def volume(self) -> float:
        """Negative if it is inside out, [mm^3]."""
        # Divergence theorem: the sum of the tetrahedra from one point to every triangle, a . (b - a) x (c - a) / 6.
        middle = self.corners.mean(axis=0)
        return float(((self.corners[self.triangles[:, 0]] - middle) * self.across).sum() / 6.0)

    @cached_property
    def extent(self) -> float:
        """The longest side of the aligned box around it."""
        return float(np.ptp(self.corners[self.triangles.ravel()], axis=0).max()) if len(self.triangles) else 0.0

    @cached_property
    def sides(self) -> Any:
        """Directed edges of the triangles, (3 t, 2): those from corner 0 to 1 first, then 1 to 2, then 2 to 0."""
        return np.concatenate([self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])

    @cached_property
    def twins(self) -> Any:
        """Rows of `sides` that are one edge of a closed mesh, (e, 2)."""
        low, high = np.sort(self.sides, axis=1).T
        return np.lexsort((high, low)).reshape(-1, 2)

    @cached_property
    def neighbours(self) -> Any:
        """Pairs of triangles with a common edge, (e, 2), of a closed mesh; the edge is directed as in the first."""
        return self.twins % len(self.triangles)

    @cached_property
    def edges(self) -> Any:
        """The corners of these edges, (e, 2)."""
        return self.sides[self.twins[:, 0]]

    @cached_property
    def is_closed(self) -> bool:
        """Whether each edge is beside two triangles."""
        counts = np.unique(np.sort(self.sides, axis=1), axis=0, return_counts=True)[1]
        return len(self.triangles) > 3 and bool((counts == 2).all())

    def part(self, triangles: Any) -> "Mesh":
        """The mesh of some of the triangles, with the corners that they use, in their order."""
        used, index = np.unique(self.triangles[triangles], return_inverse=True)
        return Mesh(self.corners[used], index.reshape(-1, 3))

    def flipped(self) -> "Mesh":
        """Inside out."""
        return Mesh(self.corners, self.triangles[:, ::-1])


def put_together(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of all triangles, no corner of which is shared between two of them."""
    offsets = np.cumsum([0, *(len(mesh.corners) for mesh in meshes[:-1])])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.corners for mesh in meshes]), np.concatenate(triangles))


def connected(pairs: Any, count: int) -> tuple[int, Any]:
    """How many groups of 0 ... count - 1 hang together by pairs, (p, 2), and the group of each, (count,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    return connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)


def square_to(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors square to a unit vector z: x from the frame's axis that is farthest from z, y = z x x."""
    x = np.eye(3)[int(np.abs(direction).argmin())]
    x = x - (x @ direction) * direction
    x /= np.linalg.norm(x)
    return x, np.cross(direction, x)


@final
@dataclass(frozen=True, eq=False)
class Region:
    """A face: triangles that lie on one plane, cylinder or cone, or on none of them."""

    kind: RegionKind
    triangles: Any
    """Which of the mesh, ascending."""
    residual: float = 0.0
    """How far its corners are from it at most, but for the sagitta of the tessellation, [mm]."""
    name: str = ""
    direction: Array = field(default_factory=lambda: np.zeros(3))
    """The outward normal of a plane, the axis of a round one."""
    point: Array = field(default_factory=lambda: np.zeros(3))
    """Of a plane; of an axis, the foot of the origin."""
    span: tuple[float, float] = (0.0, 0.0)
    """Of a round one, along the axis from `point`."""
    radii: tuple[float, float] = (0.0, 0.0)
    """At both ends of the span."""
    hole: bool = False
    turn: float = WHOLE_TURN
    """How far around the axis it reaches, [rad]."""
    sides: int = 0
    """How many flat ones a whole turn of it had in the file; 0: that is not known, or it is no mesh."""
    square: bool = False
    """Whether both ends are level circles, so that pieces can be rebuilt around it."""

    @property
    def is_round(self) -> bool:
        return self.kind in ("cylinder", "cone")

    @property
    def is_whole(self) -> bool:
        """Whether it goes all the way round."""
        return self.is_round and self.turn >= WHOLE_TURN - 1e-9

    @property
    def slope(self) -> float:
        """By how much the radius grows along the axis."""
        return (self.radii[1] - self.radii[0]) / (self.span[1] - self.span[0])

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """Two directions across the axis."""
        return square_to(self.direction)

    @property
    def ends(self) -> Array:
        """Where the axis of a round one enters and leaves it, (2, 3)."""
        return self.point + np.outer(self.span, self.direction)

    @cached_property
    def box(self) -> Array:
        """The aligned box around a round one: its lowest and highest corner, (2, 3)."""
        # A circle of radius r across a unit axis z reaches r sqrt(1 - z_k^2) along the k-th axis of the frame.
        reach = max(self.radii) * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return np.array([self.ends.min(axis=0) - reach, self.ends.max(axis=0) + reach])

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Height along the axis, distance from it, angle around it, of points (k, 3)."""
        x, y = self.across
        off = points - self.point
        return off @ self.direction, np.hypot(off @ x, off @ y), np.arctan2(off @ y, off @ x)

    def radius_at(self, height: Any) -> Any:
        return self.radii[0] + self.slope * (height - self.span[0])

    def is_on_wall(self, points: Array, near: float) -> Any:
        """Which points, (k, 3), are this near to the wall, between its ends."""
        height, distance, _ = self.polar(points)
        within = (height > self.span[0] - SAME_CORNER_MM) & (height < self.span[1] + SAME_CORNER_MM)
        return within & (np.abs(distance - self.radius_at(height)) < near)

    def around(self, height: float, radius: float, angle: Array) -> Array:
        """Points at angles around the axis, (k, 3)."""
        x, y = self.across
        return self.point + height * self.direction + radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y))


class SolidPlace(NamedTuple):
    """One of the places at which a file has a solid."""

    name: str
    T: Array
    """Of the frame of the solid in that of the file, (4, 4), [mm]."""
    color: Rgb | None = None


@final
@dataclass(frozen=True, eq=False)
class RawSolid:
    """One solid of a file."""

    name: str
    mesh: Mesh
    places: tuple[SolidPlace, ...]
    """Where the file has it."""
    mended: tuple[str, ...] = ()
    """What was mended."""
    regions: tuple[Region, ...] = ()
    """Its faces, once they are found."""

    def named(self) -> Mapping[str, Region]:
        return {region.name: region for region in self.regions if region.name}


def without_copies(solids: Iterable[RawSolid]) -> list[RawSolid]:
    """Solids of different shape, each with the places of all that are the same."""
    different: list[RawSolid] = []
    for new in solids:
        for i, old in enumerate(different):
            T = _moved_onto(old.mesh, new.mesh)
            if T is not None:
                more = (place._replace(T=place.T @ T) for place in new.places)
                different[i] = replace(old, places=(*old.places, *more))
                break
        else:
            different.append(new)
    return different


def _moved_onto(a: Mesh, b: Mesh) -> Array | None:
    """How the first one is moved onto the second, which has the same triangles in the same order; else None."""
    from scipy.spatial.transform import Rotation

    are_many = len(a.corners) == len(b.corners) and len(a.triangles) == len(b.triangles)
    if not are_many or abs(a.volume - b.volume) > 1e-4 * abs(a.volume):
        return None
    p = a.corners[a.triangles].reshape(-1, 3)
    q = b.corners[b.triangles].reshape(-1, 3)
    P = p - p.mean(axis=0)
    Q = q - q.mean(axis=0)
    R = Rotation.align_vectors(Q, P)[0].as_matrix()
    if np.abs(P @ R.T - Q).max() > _SAME_SHAPE * max(a.extent, float(np.abs(q).max())):
        return None
    T = np.eye(4)
    T[:3, :3] = np.where(np.abs(R) < 1e-7, 0.0, R)
    T[:3, 3] = q.mean(axis=0) - T[:3, :3] @ p.mean(axis=0)
    return T
