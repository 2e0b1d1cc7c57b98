"""Shape of a rigid part: named flat and round faces, and convex pieces whose union it is, in its own frame, [m]."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import final

import numpy as np

from apo_bench.geometry.arrays import Array, copy_frozen, freeze, make_copyable
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.round_face import RoundFace


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Face:
    """A flat polygon, convex or not, with or without holes; its normal points out of the solid."""

    name: str
    outline: Array
    """Corners, shape (n, 3), counter-clockwise seen from outside, [m]."""
    holes: tuple[Array, ...] = ()
    """Corners of each hole, shape (k, 3), clockwise seen from outside, [m]."""
    fit: bool = False
    """Whether the physical part recedes here by the clearance; the nominal face does not."""
    stated_normal: Array | None = None
    """The normal of a sheet (`apo_bench.assembly.round_contacts_as_planes`), whose corners may be points or the ends of
    a line; else None."""
    opposes: bool = True
    """Whether a touching face must have the opposite normal; False for a plane through an axis, whose sides are
    equal."""

    def __post_init__(self) -> None:
        freeze(self, outline=(None, 3))
        object.__setattr__(self, "holes", tuple(copy_frozen(hole, None, 3) for hole in self.holes))

    @cached_property
    def normal(self) -> Array:
        """The outward unit normal, (3,) (Newell's formula: right for concave outlines too)."""
        if self.stated_normal is not None:
            return copy_frozen(self.stated_normal, 3)
        # n ~ sum_i c_i x c_i+1: its components are differences of entries of M = sum_i c_i c_i+1^t.
        corners = self.outline - self.outline[0]
        M = corners.T @ np.concatenate([corners[1:], corners[:1]])
        n = np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])
        return copy_frozen(n / np.sqrt(n @ n), 3)

    @cached_property
    def plane(self) -> Array:
        """The face equation (n_x, n_y, n_z, -d) of Eq. 1, (4,), d in [m]."""
        n = self.normal
        return copy_frozen(np.append(n, -n @ self.outline.mean(axis=0)), 4)


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Box:
    """An axis-aligned box in the frame of its solid, [m]."""

    name: str
    center: Array
    """(3,), [m]."""
    half: Array
    """Half the size along each axis, (3,), [m]."""

    def __post_init__(self) -> None:
        freeze(self, center=(3,), half=(3,))

    @cached_property
    def corners(self) -> Array:
        """The corners, (8, 3), [m]."""
        signs = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T
        return copy_frozen(self.center + signs * self.half, 8, 3)

    @cached_property
    def planes(self) -> Array:
        """The sides, +x, +y, +z, -x, -y, -z, (6, 4): outward unit normal n and d, so that n . x <= d inside, [m]."""
        n = np.concatenate([np.eye(3), -np.eye(3)])
        return copy_frozen(np.column_stack([n, n @ self.center + np.tile(self.half, 2)]), 6, 4)

    @property
    def normals(self) -> Array:
        """Normals of the sides, (3, 3), each direction once, whichever its sign."""
        return np.eye(3)

    @property
    def edges(self) -> Array:
        """Directions of the edges, (3, 3), each once, whichever its sign."""
        return np.eye(3)


Piece = Box | Hull
"""A convex piece of a solid. Both types have `corners`, `planes`, `normals`, `edges`, and `center` and `half` of the
axis-aligned box around the piece."""


@lru_cache(maxsize=4096)
def all_boxes(pieces: tuple[Piece, ...]) -> bool:
    """Whether all pieces are boxes, which allows faster formulas."""
    return all(isinstance(piece, Box) for piece in pieces)


def measure_extent(pieces: Iterable[Piece], along: Array) -> tuple[float, float]:
    """The least and the greatest coordinate of pieces along a direction, (3,), of their own frame, [m]."""
    ends = [_project_piece(piece, along) for piece in pieces]
    return float(min(low for low, _ in ends)), float(max(high for _, high in ends))


def _project_piece(piece: Piece, along: Array) -> tuple[float, float]:
    """The least and the greatest coordinate of one piece along a direction, [m]."""
    if isinstance(piece, Hull):
        heights = piece.corners @ along
        return float(heights.min()), float(heights.max())
    at = along @ piece.center
    reach = np.abs(along) @ piece.half
    return float(at - reach), float(at + reach)


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid part of nominal size: named faces, and the convex pieces whose union it is."""

    name: str
    faces: Mapping[str, Face]
    """Flat faces by name."""
    pieces: tuple[Piece, ...]
    """Convex pieces, whose union is the solid."""
    centroid: Array
    """Centre of volume of the union, (3,), [m]; the centre of mass, since parts are homogeneous."""
    volume: float
    """[m^3]."""
    rounds: Mapping[str, RoundFace] = field(default_factory=dict)
    """Round faces by name; no name is in `faces` as well."""
    inertia: Array | None = None
    """Inertia matrix about the centroid at density 1, (3, 3), [m^5]; None: that of the boxes, which do not overlap."""

    def __post_init__(self) -> None:
        freeze(self, centroid=(3,), inertia=(3, 3), faces=None, rounds=None)

    @property
    def fits(self) -> bool:
        """Whether any face recedes by the clearance."""
        return any(f.fit for f in self.faces.values()) or any(f.fit for f in self.rounds.values())

    def face(self, name: str) -> Face | RoundFace:
        """The face with a name, flat or round.

        Raises:
            KeyError: There is none of this name.
        """
        return self.rounds[name] if name in self.rounds else self.faces[name]

    @cached_property
    def bounds(self) -> Array:
        """Lowest and highest corner of the solid, (2, 3), [m]."""
        low = np.min([piece.center - piece.half for piece in self.pieces], axis=0)
        high = np.max([piece.center + piece.half for piece in self.pieces], axis=0)
        return copy_frozen([low, high])


def measure_world_bounds(posed: Iterable[tuple[Solid, Array]]) -> tuple[Array, Array]:
    """The lowest and the highest corner, (3,) each, of the world-aligned box around posed solids, [m]."""
    ends = np.array([[np.add(measure_extent(solid.pieces, T[i, :3]), T[i, 3]) for i in range(3)] for solid, T in posed])
    return ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)
