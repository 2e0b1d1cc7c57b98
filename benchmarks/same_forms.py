"""One mesh in other forms: remeshed, subdivided, decimated by quadrics, noisy."""

from __future__ import annotations

import heapq
from collections import defaultdict
from typing import Any

import numpy as np
from manifold3d import Manifold, Mesh64

SHARP_RAD = np.radians(25.0)


def joined(corners: Any, triangles: Any) -> tuple[Any, Any]:
    """With equal corners as one."""
    corners, index = np.unique(np.round(corners, 9), axis=0, return_inverse=True)
    triangles = index.ravel()[triangles]
    a, b, c = triangles.T
    return corners, triangles[(a != b) & (b != c) & (c != a)]


def subdivided(corners: Any, triangles: Any) -> tuple[Any, Any]:
    """Each triangle as four, by the middles of its edges."""
    from trimesh.remesh import subdivide

    return subdivide(corners, triangles)


def noisy(corners: Any, triangles: Any, sigma: float, rng: np.random.Generator) -> tuple[Any, Any]:
    """Each corner shifted by a normal deviate, [mm], in each coordinate."""
    return corners + rng.normal(0.0, sigma, corners.shape), triangles


def remeshed(corners: Any, triangles: Any, length: float, rng: np.random.Generator) -> tuple[Any, Any]:
    """Edges of about one length: new corners anywhere on the old triangles, edges turned until angles are even.

    Sharp edges stay where they are, and the chords of round walls go: triangles lie across them.
    """
    body = Manifold(Mesh64(np.ascontiguousarray(corners), np.ascontiguousarray(triangles, dtype=np.uint64)))
    raw = body.refine_to_length(length).to_mesh64()
    points = np.array(raw.vert_properties)[:, :3]
    tris = np.array(raw.tri_verts).astype(np.int64)
    normals = _normals(points, tris)
    edges = _edges(tris)
    fixed = np.zeros(len(points), dtype=bool)
    for (a, b), (i, k) in edges.items():
        if normals[i] @ normals[k] < np.cos(SHARP_RAD):
            fixed[[a, b]] = True
    # Each free corner goes somewhere into one of its triangles, so it stays on the surface; less far where that folds.
    own: dict[int, list[int]] = defaultdict(list)
    for t, three in enumerate(tris.tolist()):
        for corner in three:
            own[corner].append(t)
    to = np.array([tris[own[c][int(rng.integers(len(own[c])))]] for c in range(len(points))])
    share = np.where(fixed, 0.0, 0.35)
    for _ in range(8):
        new = points + share[:, None] * (points[to].mean(axis=1) - points)
        folds = (_normals(new, tris) * normals).sum(axis=1) < np.cos(2.0 * SHARP_RAD)
        share[np.unique(tris[folds])] *= 0.3
        if not folds.any():
            break
    return new, _turned_edges(new, tris)


def _normals(points: Any, tris: Any) -> Any:
    n = np.cross(points[tris[:, 1]] - points[tris[:, 0]], points[tris[:, 2]] - points[tris[:, 0]])
    return n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]


def _edges(tris: Any) -> dict[tuple[int, int], list[int]]:
    """The two triangles of each edge."""
    edges: dict[tuple[int, int], list[int]] = defaultdict(list)
    for t, (a, b, c) in enumerate(tris.tolist()):
        for pair in ((a, b), (b, c), (c, a)):
            edges[min(pair), max(pair)].append(t)
    return edges


def _turned_edges(points: Any, tris: Any) -> Any:
    """Two triangles with a common edge as the other two of their four corners, where that makes angles more even."""
    tris = tris.copy()
    for _ in range(3):
        edges = _edges(tris)
        present = set(edges)
        touched: set[int] = set()
        for (a, b), (i, k) in edges.items():
            if i in touched or k in touched:
                continue
            c = int(next(x for x in tris[i] if x not in (a, b)))
            d = int(next(x for x in tris[k] if x not in (a, b)))
            if (min(c, d), max(c, d)) in present:
                continue
            first = [int(x) for x in tris[i]]
            a0, b0 = (a, b) if first[(first.index(a) + 1) % 3] == b else (b, a)
            before = _normals(points, tris[[i, k]])
            new = np.array([[a0, d, c], [d, b0, c]])
            after = _normals(points, new)
            if before[0] @ before[1] < np.cos(SHARP_RAD) or (after @ before.T).min() < np.cos(SHARP_RAD):
                continue
            # Delaunay: the angles opposite of an edge add up to less than half a turn.
            if _angle(points, c, a, b) + _angle(points, d, a, b) > np.pi + 1e-9:
                tris[i], tris[k] = new
                touched |= {i, k}
                present.add((min(c, d), max(c, d)))
    return tris


def _angle(points: Any, at: int, a: int, b: int) -> float:
    u, v = points[a] - points[at], points[b] - points[at]
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def decimated(corners: Any, triangles: Any, most: int) -> tuple[Any, Any]:
    """At most so many triangles: edges collapse where the sum of squared distances to old planes is least.

    Garland and Heckbert 1997, with the corner where the quadric is least.
    """
    points = [*np.asarray(corners, dtype=float)]
    tris = {t: [int(x) for x in three] for t, three in enumerate(triangles)}
    own: dict[int, set[int]] = defaultdict(set)
    quadrics = np.zeros((len(points), 4, 4))
    for t, three in tris.items():
        a, b, c = (points[x] for x in three)
        n = np.cross(b - a, c - a)
        area = np.linalg.norm(n)
        plane = np.append(n, -n @ a) / max(area, 1e-300)
        for x in three:
            own[x].add(t)
            quadrics[x] += area * np.outer(plane, plane)
    stamp: dict[int, int] = defaultdict(int)
    heap: list[tuple[float, int, int, int, int]] = []

    def best(a: int, b: int) -> tuple[float, Any]:
        Q = quadrics[a] + quadrics[b]
        tried = [points[a], points[b], (points[a] + points[b]) / 2.0]
        A = Q[:3, :3]
        values = np.linalg.eigvalsh(A)
        if values[0] > 1e-3 * values[2]:
            tried.append(np.linalg.solve(A, -Q[:3, 3]))
        costs = [float(np.append(p, 1.0) @ Q @ np.append(p, 1.0)) for p in tried]
        k = int(np.argmin(np.round(costs, 12)))
        return costs[k], tried[k]

    def push(a: int, b: int) -> None:
        cost, _ = best(a, b)
        cost += 1e-9 * float(np.linalg.norm(points[a] - points[b]) ** 2)
        heapq.heappush(
            heap, (cost, min(a, b), max(a, b), stamp[a], stamp[b]) if a < b else (cost, b, a, stamp[b], stamp[a])
        )

    for a, b in _edges(triangles):
        push(a, b)
    while len(tris) > most and heap:
        _, a, b, stamp_a, stamp_b = heapq.heappop(heap)
        if stamp[a] != stamp_a or stamp[b] != stamp_b or not own[a] or not own[b]:
            continue
        around = [{x for t in own[v] for x in tris[t]} - {a, b} for v in (a, b)]
        if len(around[0] & around[1]) != 2:
            continue
        _, at = best(a, b)
        if any(_flips(points, tris[t], v, at) for v in (a, b) for t in own[v] if not {a, b} <= set(tris[t])):
            continue
        points[a] = at
        quadrics[a] += quadrics[b]
        for t in list(own[b]):
            if a in tris[t]:
                for x in tris[t]:
                    own[x].discard(t)
                del tris[t]
            else:
                tris[t] = [a if x == b else x for x in tris[t]]
                own[a].add(t)
        own[b].clear()
        stamp[a] += 1
        stamp[b] += 1
        for x in {x for t in own[a] for x in tris[t]} - {a}:
            push(a, x)
    return np.array(points), np.array(list(tris.values()))


def _flips(points: Any, three: list[int], moved: int, at: Any) -> bool:
    """Whether a triangle turns over, or thins out to nothing, when a corner goes elsewhere."""
    a, b, c = (points[x] for x in three)
    before = np.cross(b - a, c - a)
    a, b, c = (at if x == moved else points[x] for x in three)
    after = np.cross(b - a, c - a)
    sides = max(float(u @ u) for u in (b - a, c - b, a - c))
    size = float(np.linalg.norm(after))
    return size < 1e-3 * sides or float(before @ after) < 0.5 * float(np.linalg.norm(before)) * size
