"""A mesh drawn anew on the faces that were found in it: corners on them, walls as strips from end to end, [mm]."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.cad.faces.fitting import Round, plane_region, round_region, turn_of
from apo_bench.cad.faces.patch import Patch, Plane, Rough, normals_at
from apo_bench.cad.solids.raw_solid import Mesh, Region, square_to
from apo_bench.geometry import Array

_SIDES = 64
"""Of a whole turn."""
_LEVEL = 2e-7
"""Corners of an end are level, and those of an edge straight, within this part of the size."""
_STEPS = 12
_RANK = 0.03
"""Surfaces that meet at a smaller angle, [rad], are followed as one."""
_SHALLOW_RAD = 0.15
_FARTHEST = 0.03
_NEAR = 0.01
"""Corners move by no more than this part of the size, beside the sagitta of sides of a round face, nor by more than the
second one where faces meet at so small an angle that noise shifts their edge far."""


class Redrawn(NamedTuple):
    """A new mesh and its faces."""

    mesh: Mesh
    regions: tuple[Region, ...]
    moved: float
    """How far a corner moved at most, [mm]."""


@final
@dataclass(eq=False)
class _Edge:
    """A border between two faces, from one corner at which more of them meet to the next, or a ring."""

    corners: list[int]
    of: tuple[int, int]
    """The face on its left, as it is directed, and on its right."""
    is_ring: bool
    drawn: list[int] = field(default_factory=list)
    """The corners that stand for it."""


def redrawn(rough: Rough, patches: Sequence[Patch]) -> Redrawn | None:
    """The mesh with corners on its faces, and no more of them than these need; None if that makes no solid."""
    mesh = rough.mesh
    owner = np.zeros(len(mesh.triangles), dtype=np.int64)
    for k, patch in enumerate(patches):
        owner[patch.triangles] = k
    surfaces = [patch.surface for patch in patches]
    points, shallow = _settled(mesh, owner, surfaces)
    far = np.linalg.norm(points - mesh.corners, axis=1)
    sagittas = (
        s.radius * (1.0 - np.cos(np.pi / p.sides)) for p in patches if isinstance(s := p.surface, Round) and p.sides
    )
    if (far > np.where(shallow, _NEAR, _FARTHEST) * mesh.extent + max(sagittas, default=0.0)).any():
        return None
    drawing = _Drawing(Mesh(points, mesh.triangles), owner, surfaces)
    drawing.draw()
    new = Mesh(np.array(drawing.points), np.concatenate(drawing.triangles))
    whole = np.concatenate([np.full(len(t), k) for k, t in enumerate(drawing.triangles)])
    new = new.part(np.arange(len(new.triangles)))
    if not new.is_closed:
        return None
    regions = [_region(new, np.flatnonzero(whole == k), patch) for k, patch in enumerate(patches) if (whole == k).any()]
    return Redrawn(new, tuple(sorted(regions, key=lambda region: int(region.triangles[0]))), float(far.max()))


def _region(mesh: Mesh, triangles: Any, patch: Patch) -> Region:
    if isinstance(patch.surface, Plane):
        return plane_region(mesh, triangles, patch.surface.normal, patch.surface.offset * patch.surface.normal)
    if patch.surface is None:
        return Region("other", triangles)
    return round_region(
        mesh, triangles, patch.surface, patch.hole, turn_of(mesh, triangles, patch.surface), patch.sides
    )


def _settled(mesh: Mesh, owner: Any, surfaces: Sequence[Plane | Round | None]) -> tuple[Array, Any]:
    """Corners on all of the faces around them, by the shortest ways, and at which of them two meet at a small angle."""
    points = mesh.corners.copy()
    pairs = np.unique(np.column_stack([mesh.triangles.ravel(), np.repeat(owner, 3)]), axis=0)
    pairs = pairs[np.array([surface is not None for surface in surfaces])[pairs[:, 1]]]
    many = np.bincount(pairs[:, 0], minlength=len(points))
    rows = [np.flatnonzero(pairs[:, 1] == k) for k in range(len(surfaces))]
    lists = np.split(np.arange(len(pairs)), np.cumsum(many)[:-1])
    shared = np.flatnonzero(many > 1)
    shallow = np.zeros(len(points), dtype=bool)
    is_flat = np.array([isinstance(surface, Plane) for surface in surfaces])
    for _ in range(_STEPS):
        off = np.zeros(len(pairs))
        normals = np.zeros((len(pairs), 3))
        for k, surface in enumerate(surfaces):
            at = points[pairs[rows[k], 0]]
            if surface is not None and len(at):
                off[rows[k]] = surface.off(at)
                normals[rows[k]] = normals_at(surface, at)
        alone = many[pairs[:, 0]] == 1
        points[pairs[alone, 0]] -= off[alone, None] * normals[alone]
        for corner in shared.tolist():
            mine = lists[corner]
            alike = np.abs(normals[mine] @ normals[mine].T) > np.cos(_SHALLOW_RAD)
            shallow[corner] = alike.sum() > len(mine)
            # Where a wall goes over into a plane smoothly, their edge is kept in the plane.
            flat = is_flat[pairs[mine, 1]]
            mine = mine[flat | ~alike[:, flat].any(axis=1)]
            points[corner] -= np.linalg.pinv(normals[mine], rcond=_RANK) @ off[mine]
        if np.abs(off).max(initial=0.0) < 1e-10 * mesh.extent:
            break
    return points, shallow


@final
class _Drawing:
    """Borders between faces, then triangles in each face."""

    def __init__(self, mesh: Mesh, owner: Any, surfaces: Sequence[Plane | Round | None]) -> None:
        self.mesh = mesh
        self.owner = owner
        self.surfaces = surfaces
        self.points = [*mesh.corners]
        self.triangles: list[Any] = []
        self.near = _LEVEL * mesh.extent
        self.edges = _edges(mesh, owner)

    def draw(self) -> None:
        """New triangles, face by face."""
        around: dict[int, list[_Edge]] = defaultdict(list)
        for edge in self.edges:
            for k in edge.of:
                around[k].append(edge)
        faces = range(len(self.surfaces))
        anew = {k for k in faces if self._is_plain(k, around[k])}
        while True:
            for edge in self.edges:
                edge.drawn = self._drawn(edge) if anew.issuperset(edge.of) else edge.corners
            drawn = ((k, self._within(k, around[k])) for k in sorted(anew))
            new = {k: triangles for k, triangles in drawn if triangles is not None}
            if len(new) == len(anew):
                break
            anew = set(new)  # what cannot be drawn between new borders keeps its own ones
        self.triangles = [new.get(k, self.mesh.triangles[self.owner == k]) for k in faces]

    def _within(self, k: int, edges: list[_Edge]) -> Any:
        """Triangles of a face between its borders as they are drawn; None if they make none."""
        directed = [edge.drawn if edge.of[0] == k else edge.drawn[::-1] for edge in edges]
        return (self._flat if isinstance(self.surfaces[k], Plane) else self._strips)(k, directed)

    def _is_plain(self, k: int, edges: list[_Edge]) -> bool:
        """Whether a face can be drawn from its borders: a flat one, or a wall between two level ends."""
        surface = self.surfaces[k]
        if not isinstance(surface, Round):
            return surface is not None
        levels = [e for e in edges if self._is_level(e, surface)]
        others = [e for e in edges if e not in levels]
        heights = [float(surface.polar(self.mesh.corners[e.corners[:1]])[0][0]) for e in levels]
        if len(levels) != 2 or abs(heights[0] - heights[1]) < 10.0 * self.near:
            return False
        return all(self._is_straight(e) for e in others) and len(others) in (0, 2)

    def _is_level(self, edge: _Edge, wall: Round) -> bool:
        height, distance, _ = wall.polar(self.mesh.corners[edge.corners])
        return bool(np.ptp(height) < self.near and np.ptp(distance) < self.near and len(edge.corners) > 2)

    def _is_straight(self, edge: _Edge) -> bool:
        points = self.mesh.corners[edge.corners] - self.mesh.corners[edge.corners[0]]
        length = float(np.linalg.norm(points[-1]))
        if edge.is_ring or length < self.near:
            return False
        along = points[-1] / length
        return bool(np.linalg.norm(points - np.outer(points @ along, along), axis=1).max() < self.near)

    def _drawn(self, edge: _Edge) -> list[int]:
        """The corners that stand for a border: its ends where it is straight, even steps on a level circle."""
        if self._is_straight(edge):
            return [edge.corners[0], edge.corners[-1]]
        walls = [s for k in edge.of if isinstance(s := self.surfaces[k], Round) and self._is_level(edge, s)]
        if not walls:
            return edge.corners
        wall = walls[0]
        axis = wall.axis * np.sign(wall.axis[int(np.abs(wall.axis).argmax())])
        x, y = square_to(axis)
        points = self.mesh.corners[edge.corners]
        height, distance, _ = wall.polar(points)
        middle = wall.point + float(height.mean()) * wall.axis
        angle = np.unwrap(np.arctan2((points - middle) @ y, (points - middle) @ x))
        if edge.is_ring:
            way = np.sign(angle[-1] - angle[0])
            new = way * 2.0 * np.pi * (np.arange(_SIDES) + 0.5) / _SIDES
        else:
            many = max(int(np.ceil(abs(angle[-1] - angle[0]) / (2.0 * np.pi / _SIDES) - 1e-6)), 1)
            new = np.linspace(angle[0], angle[-1], many + 1)[1:-1]
        first = len(self.points)
        ring = middle + float(distance.mean()) * (np.outer(np.cos(new), x) + np.outer(np.sin(new), y))
        self.points.extend(ring)
        every = list(range(first, len(self.points)))
        return [*every, first] if edge.is_ring else [edge.corners[0], *every, edge.corners[-1]]

    def _flat(self, k: int, directed: list[list[int]]) -> Any:
        """Triangles between the borders of a flat face; None if they make none."""
        import manifold3d

        plane = self.surfaces[k]
        loops = _joined(directed)
        if loops is None or not isinstance(plane, Plane):
            return None
        flat = np.array(square_to(plane.normal)).T
        rings = [np.array([self.points[c] for c in loop]) @ flat for loop in loops]
        every = np.concatenate([np.array(loop) for loop in loops])
        return every[np.asarray(manifold3d.triangulate(rings)).reshape(-1, 3)]

    def _strips(self, k: int, directed: list[list[int]]) -> Any:
        """Triangles from one end of a wall to the other one."""
        wall = self.surfaces[k]
        assert isinstance(wall, Round)
        ends = [chain for chain in directed if len(chain) > 2 or self._is_across(chain, wall)]
        ends.sort(key=lambda chain: float(wall.polar(np.array([self.points[chain[0]]]))[0][0]))
        if len(ends) != 2 or len(ends[0]) != len(ends[1]):
            return None
        low, high = ends
        high = high[::-1]
        if low[0] == low[-1]:
            out = [wall.polar(np.array([self.points[c] for c in chain[:-1]]))[2] for chain in (low, high)]
            shift = int((out[1] @ out[0][0]).argmax())
            high = [*np.roll(high[:-1], -shift).tolist(), high[shift]]
        a, b, c, d = (np.array(each) for each in (low[:-1], low[1:], high[1:], high[:-1]))
        return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])

    def _is_across(self, chain: list[int], wall: Round) -> bool:
        height = wall.polar(np.array([self.points[chain[0]], self.points[chain[-1]]]))[0]
        return bool(np.ptp(height) < self.near)


def _edges(mesh: Mesh, owner: Any) -> list[_Edge]:
    """Borders between faces."""
    rows = np.concatenate([mesh.twins, mesh.twins[:, ::-1]])
    faces = owner[rows % len(mesh.triangles)]
    sides = mesh.sides[rows[:, 0]]
    border = faces[:, 0] < faces[:, 1]
    # From each corner onwards, with the lower face on the left.
    after: dict[tuple[int, int, int], list[int]] = defaultdict(list)
    meets: dict[int, set[tuple[int, int]]] = defaultdict(set)
    degree: dict[int, int] = defaultdict(int)
    for (a, b), (left, right) in zip(sides[border].tolist(), faces[border].tolist(), strict=True):
        after[left, right, a].append(b)
        for corner in (a, b):
            meets[corner].add((left, right))
            degree[corner] += 1
    ends = {corner for corner, pairs in meets.items() if len(pairs) > 1 or degree[corner] != 2}
    edges = []
    for starts in (ends, meets):
        for left, right, a in sorted(key for key in after if key[2] in starts):
            while after[left, right, a]:
                chain = [a, after[left, right, a].pop()]
                while chain[-1] not in ends and chain[-1] != a:
                    chain.append(after[left, right, chain[-1]].pop())
                edges.append(_Edge(chain, (left, right), chain[-1] == a and a not in ends))
    return edges


def _joined(chains: list[list[int]]) -> list[list[int]] | None:
    """Chains end to end as closed loops; None if they are not closed."""
    after: dict[int, list[list[int]]] = defaultdict(list)
    for chain in chains:
        after[chain[0]].append(chain)
    loops = []
    while any(after.values()):
        chain = next(iter(waiting for waiting in after.values() if waiting))[-1]
        loop: list[int] = []
        while True:
            after[chain[0]].remove(chain)
            loop += chain[:-1]
            onwards = after[chain[-1]]
            if chain[-1] == loop[0]:
                break
            if not onwards:
                return None
            chain = onwards[-1]
        loops.append(loop)
    return loops
