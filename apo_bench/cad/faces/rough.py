"""Faces of a mesh whose corners are a little off, or anywhere on its faces: remeshed, noisy and decimated ones, [mm].

Here a triangle lies on a surface if its corners are near to it, however it is turned by that.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.cad.faces.fitting import Round, axis_of, circle_through, refined
from apo_bench.cad.faces.patch import Patch, Plane, Rough, bend_along, normals_at, owner_of
from apo_bench.cad.solids.raw_solid import connected
from apo_bench.geometry import Array

_WHOLE = 0.995
"""So much of a smooth part of a surface is on one face if all of it is."""
_SPREAD = 0.45
"""Corners of a face are nearer to it than this part of what is allowed, root mean square; those of a band that was
grown on a free surface are not."""
_BENT = 0.4
_MOSTLY = 0.65
"""... nor are those that bend so much of it along the axis, which is so much of all that their corners are off."""
_TURNED_RAD = 0.6
_SEEDS = 3
_BALLS = (12, 48, 192)
"""With how many triangles a face begins."""
_FLAT = 0.995
"""Triangles whose normals have this product may be of one side of a coarse wall."""
_FEWEST_CORNERS = 10
"""Through fewer there is a wall nearly always."""
_MOST_FAILED = 5
_BIT = 0.01
"""Where the largest face is so little of what is left, that is a free surface."""
_LEAST = 2e-4
"""Faces are no smaller than this part of the surface."""
_CRUMB = 0.1
"""A face across an edge is part of what remeshing made of the edge if it is so small beside both."""
_FLATTEST = 5.0
"""No wall has a radius so much larger than the part."""
_LEAST_SLOPE = 0.02


def patches_of(rough: Rough) -> list[Patch]:
    """The surface as faces, and what is none of them."""
    count, of = connected(rough.smooth, len(rough.areas))
    order = np.argsort(of, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(of, minlength=count))[:-1])
    patches = [patch for group in groups for patch in _patches_in(rough, group)]
    return _without_crumbs(rough, together(rough, _at_nearest(rough, patches)))


def _patches_in(rough: Rough, group: Any) -> Iterator[Patch]:
    """Faces in a smooth part of the surface: one that is all of it, or the largest ones that grow from seeds."""
    strong = group[~rough.weak[group]]
    half = rough.areas[group].sum() / 2.0
    strong = strong if rough.areas[strong].sum() > half else group
    for kind in ("plane", "cylinder", "cone"):
        surface = _fitted(rough, kind, strong)
        if surface is not None:
            mine, hole = _on(rough, surface, group)
            if rough.areas[np.intersect1d(mine, strong)].sum() > _WHOLE * rough.areas[strong].sum():
                stray = np.setdiff1d(group, np.concatenate([mine, strong]))  # narrow, and of another face
                whole = np.setdiff1d(group, stray)
                yield Patch(_fitted(rough, kind, mine, surface) or surface, whole, hole)
                if len(stray):
                    yield Patch(None, stray)
                return
    least = _LEAST * rough.areas.sum()
    left = group
    free = [group[:0]]
    failed = 0
    while (area := rough.areas[left].sum()) > least and failed < _MOST_FAILED:
        best = _largest(rough, left)
        fewest = max(least, _BIT * area if area > half else 0.0)
        if best is not None and rough.areas[best.triangles].sum() > fewest:
            yield best
            gone = best.triangles
            failed = 0
        else:
            gone = _balls(rough, left, int(left[rough.areas[left].argmax()]))[0]
            free.append(gone)
            failed += 1
        left = np.setdiff1d(left, gone)
    rest = np.sort(np.concatenate([*free, left]))
    if len(rest):
        yield Patch(None, rest)


def _is_tight(rough: Rough, patch: Patch) -> bool:
    points = rough.points(patch.triangles)
    off = patch.surface.off(points) if patch.surface is not None else np.ones(1)
    bend, share = bend_along(patch.surface, points)
    is_few = len(points) < _FEWEST_CORNERS and isinstance(patch.surface, Round)
    if is_few or (bend > _BENT * rough.near and share > _MOSTLY):
        return False
    return float(np.sqrt((off**2).mean())) < _SPREAD * rough.near


def _largest(rough: Rough, left: Any) -> Patch | None:
    """The face of the largest area that grows from any of some seeds."""
    order = left[np.argsort(-rough.areas[left], kind="stable")]
    best = None
    most = 0.0
    for seed in order[np.linspace(0, len(order) - 1, _SEEDS).astype(int)].tolist():
        for ball in _balls(rough, left, seed):
            grown = next(
                (p for kind in ("plane", "cylinder", "cone") if (p := _grown(rough, kind, ball, left, seed))), None
            )
            area = 0.0 if grown is None else float(rough.areas[grown.triangles].sum())
            if area > most and grown is not None and _is_tight(rough, grown):
                most = area
                best = grown
        if most > 0.5 * rough.areas[left].sum():
            break
    return best


def _balls(rough: Rough, left: Any, seed: int) -> list[Any]:
    """The nearest triangles to one that look the same way, then those that do so about, in growing numbers."""
    alike = left[rough.normals[left] @ rough.normals[seed] > 0.5]
    order = alike[np.argsort(((rough.middles[alike] - rough.middles[seed]) ** 2).sum(axis=1), kind="stable")]
    sizes = [n for n in _BALLS if n < len(order)]
    flat = order[: _BALLS[0]][rough.normals[order[: _BALLS[0]]] @ rough.normals[seed] > _FLAT]
    sides = [flat] if 1 < len(flat) < min(len(order), _BALLS[0]) else []
    return [*sides, *(order[:n] for n in [*sizes, len(order)][: len(_BALLS)])] or [np.array([seed])]


def _grown(rough: Rough, kind: str, ball: Any, left: Any, seed: int) -> Patch | None:
    """The face that begins with some triangles: in turns what is on it, and what is nearest to that."""
    surface = _fitted(rough, kind, ball)
    if surface is None or np.quantile(np.abs(surface.off(rough.points(ball))), 0.9) > rough.near:
        return None
    count = 0
    for _ in range(8):
        mine, hole = _on(rough, surface, left)
        mine = _with_seed(rough, mine, seed)
        if len(mine) < 2:
            return None
        if len(mine) == count:
            break
        count = len(mine)
        better = _fitted(rough, kind, mine, surface)
        if better is None:
            break
        surface = better
    return Patch(surface, mine, hole)


def _with_seed(rough: Rough, members: Any, seed: int) -> Any:
    """Those, ascending, that hang together with a seed."""
    members = np.sort(members)
    at = int(np.searchsorted(members, seed))
    if at == len(members) or members[at] != seed:
        return members[:0]
    mine = np.zeros(len(rough.areas), dtype=np.bool_)
    mine[members] = True
    pairs = rough.smooth[mine[rough.smooth].all(axis=1)]
    _, group = connected(np.searchsorted(members, pairs), len(members))
    return members[group == group[at]]


def _fitted(rough: Rough, kind: str, triangles: Any, before: Plane | Round | None = None) -> Plane | Round | None:
    """The surface nearest to triangles."""
    points = rough.points(triangles)
    if kind == "plane":
        n = rough.mesh.across[triangles].sum(axis=0)
        size = float(np.linalg.norm(n))
        if size < 1e-300:
            return None
        n = n / size
        return Plane(n, float((points @ n).mean()))
    start = before if isinstance(before, Round) else None
    if start is None:
        strong = triangles[~rough.weak[triangles]]
        strong = strong if len(strong) > 8 else triangles
        if len(strong) < 4:
            return None
        start = circle_through(points, axis_of(rough.normals[strong], kind == "cone"))
    wall = (
        refined(start, points, kind == "cone") if start is not None and start.radius < 1e3 * rough.mesh.extent else None
    )
    is_wall = wall is not None and wall.radius < _FLATTEST * rough.mesh.extent
    return wall if wall is not None and is_wall and (kind != "cone" or abs(wall.slope) > _LEAST_SLOPE) else None


def _on(rough: Rough, surface: Plane | Round, among: Any) -> tuple[Any, bool]:
    """Which triangles are on a surface, and whether it is a hole."""
    mine = among[(np.abs(_off(rough, surface, among)) <= rough.near).all(axis=1)]
    facing = _facing(rough, surface, mine)
    hole = bool((np.sign(facing) * rough.areas[mine]).sum() < 0.0) and isinstance(surface, Round)
    good = (-facing if hole else facing) > np.cos(_TURNED_RAD)
    return mine[good | rough.weak[mine]], hole


def _off(rough: Rough, surface: Plane | Round, triangles: Any) -> Array:
    """Of the corners of triangles, (t, 3)."""
    return surface.off(rough.mesh.corners[rough.mesh.triangles[triangles].ravel()]).reshape(-1, 3)


def _facing(rough: Rough, surface: Plane | Round, triangles: Any) -> Array:
    """Cosine of the angle between triangles and the surface under them, (t,)."""
    n = normals_at(surface, rough.middles[triangles])
    return np.asarray((rough.normals[triangles] * n).sum(axis=1))


def _at_nearest(rough: Rough, patches: list[Patch]) -> list[Patch]:
    """With triangles between faces that go over into each other smoothly on the one that they are nearer to."""
    owner = owner_of(rough, patches)
    pairs = rough.mesh.neighbours
    sizes = np.bincount(owner, rough.areas, len(patches)) / rough.areas.sum()
    free = np.array([p.surface is None for p in patches])
    is_weak = np.array([bool(rough.weak[p.triangles].all()) for p in patches])
    stray = free | (sizes < np.where(is_weak, 50.0 * _LEAST, _LEAST))
    key = len(owner)
    is_smooth = np.tile(np.isin(pairs @ [key, 1], rough.smooth @ [key, 1]), 2)
    for _ in range(6):
        # Of pairs across a border each triangle may go over to the face of the other one.
        # ... and what belongs to none, or to next to nothing, also over a sharp edge and however it looks.
        i, k = np.concatenate([pairs, pairs[:, ::-1]]).T
        across = (owner[i] != owner[k]) & (stray[owner[i]] | is_smooth) & ~stray[owner[k]]
        moved = owner.copy()
        for to in np.unique(owner[k[across]]):
            surface = patches[to].surface
            mine = np.unique(i[across & (owner[k] == to)])
            if surface is None:
                continue
            sign = -1.0 if patches[to].hole else 1.0
            new = np.abs(_off(rough, surface, mine)).max(axis=1)
            is_stray = stray[owner[mine]]
            looks = (sign * _facing(rough, surface, mine) > np.cos(_TURNED_RAD)) | rough.weak[mine] | is_stray
            nearer = is_stray | (new < _cost(rough, patches, owner, mine))
            moved[mine[looks & nearer & (new < rough.near * np.where(is_stray, 1.5, 1.0))]] = to
        if (moved == owner).all():
            break
        owner = moved
    return [p._replace(triangles=np.flatnonzero(owner == k)) for k, p in enumerate(patches) if (owner == k).any()]


def together(rough: Rough, patches: list[Patch]) -> list[Patch]:
    """With faces that touch and lie on one surface as one, which narrow triangles had cut in two."""
    owner = owner_of(rough, patches)
    beside = np.unique(np.sort(owner[rough.mesh.neighbours], axis=1), axis=0)
    both = np.concatenate([beside, beside[:, ::-1]]).tolist()
    same = [(i, k) for i, k in both if i != k and _is_same(rough, patches[i], patches[k])]
    _, group = connected(np.array(same, dtype=np.int64).reshape(-1, 2), len(patches))
    sizes = np.bincount(owner, rough.areas, len(patches))
    return [
        patches[int(np.where(group == g, sizes, -1.0).argmax())]._replace(triangles=np.flatnonzero(group[owner] == g))
        for g in np.unique(group)
    ]


def _is_same(rough: Rough, a: Patch, b: Patch) -> bool:
    """Whether the second face lies on the first one, as a flat one within one side of a wall does."""
    alike = type(a.surface) is type(b.surface) and a.hole == b.hole
    if a.surface is None or not (alike or (isinstance(a.surface, Round) and isinstance(b.surface, Plane))):
        return False
    points = np.concatenate([rough.points(b.triangles), *([] if alike else [rough.middles[b.triangles]])])
    is_near = np.abs(a.surface.off(points)).max() < rough.near
    return bool(is_near) and float(_facing(rough, a.surface, b.triangles).mean()) * (-1.0 if a.hole else 1.0) > 0.8


def _without_crumbs(rough: Rough, patches: list[Patch]) -> list[Patch]:
    """Without small faces across a shallow edge, all of whose corners lie on the large faces around them."""
    owner = owner_of(rough, patches)
    sizes = np.bincount(owner, rough.areas, len(patches))
    pairs = owner[rough.mesh.neighbours]
    for k, patch in enumerate(patches):
        around = np.setdiff1d(pairs[(pairs == k).any(axis=1)], [k])
        large = [n for n in around.tolist() if patches[n].surface is not None and sizes[k] < _CRUMB * sizes[n]]
        corners = np.unique(rough.mesh.triangles[patch.triangles])
        inside = np.setdiff1d(corners, rough.mesh.triangles[owner != k])
        if len(large) < 2 or len(inside):
            continue
        surfaces = [(patches[n].surface, -1.0 if patches[n].hole else 1.0) for n in large]
        off = np.array([np.abs(s.off(rough.mesh.corners[corners])) for s, _ in surfaces])
        middle = np.array([np.abs(s.off(rough.middles[patch.triangles])) for s, _ in surfaces])
        looks = np.array([sign * _facing(rough, s, patch.triangles) for s, sign in surfaces]) > np.cos(_TURNED_RAD)
        near = (off.min(axis=0) < rough.near).all() and (middle.min(axis=0) < 2.0 * rough.near).all()
        if near and looks[middle.argmin(axis=0), np.arange(len(patch.triangles))].all():
            owner[patch.triangles] = np.array(large)[middle.argmin(axis=0)]
    return [p._replace(triangles=np.flatnonzero(owner == k)) for k, p in enumerate(patches) if (owner == k).any()]


def _cost(rough: Rough, patches: list[Patch], owner: Any, triangles: Any) -> Array:
    """How far triangles are off their own faces."""
    cost = np.full(len(triangles), np.inf)
    for k in np.unique(owner[triangles]):
        surface = patches[k].surface
        if surface is not None:
            mine = owner[triangles] == k
            cost[mine] = np.abs(_off(rough, surface, triangles[mine])).max(axis=1)
    return cost
