"""Parts with round and tilted faces, written out by hand: tests compare with these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from apo_bench.geometry import Box, Cylinder, Face, Hull, RoundFace, Solid, make_cylinder_hull

Z = np.array([0.0, 0.0, 1.0])
SIDES = 72
"""Of a round wall up to a radius of 5.2 mm: a multiple of 8, so that the corners of a square are corners of wedges."""


def ring(radius: float, z: float, n: int = SIDES) -> np.ndarray:
    """A circle [mm] as corners, (n, 3), [m], counter-clockwise seen from above."""
    turn = 2.0 * np.pi * np.arange(n) / n
    return 1e-3 * np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(n, z)])


def square(half: float, z: float) -> np.ndarray:
    return 1e-3 * np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])


def up(name: str, outline: np.ndarray, *holes: np.ndarray) -> Face:
    """A level face that looks up, of outlines that are counter-clockwise seen from above."""
    return Face(name, outline, tuple(hole[::-1] for hole in holes))


def down(name: str, outline: np.ndarray, *holes: np.ndarray) -> Face:
    return Face(name, outline[::-1], holes)


def cylinder(name: str, radius: float, z: Sequence[float], *, hole: bool = False, fit: bool = False) -> RoundFace:
    """Around the z axis, [mm]."""
    low, high = (1e-3 * float(end) for end in z)
    return RoundFace(name, np.zeros(3), Z, (low, high), (1e-3 * radius, 1e-3 * radius), hole, fit)


def cone(name: str, radii: Sequence[float], z: Sequence[float], *, hole: bool = False) -> RoundFace:
    low, high = (1e-3 * float(end) for end in z)
    return RoundFace(name, np.zeros(3), Z, (low, high), (1e-3 * radii[0], 1e-3 * radii[1]), hole)


def rim(name: str, radius: float, z: float, *, hole: bool = True, upwards: bool = True) -> RoundFace:
    axis = Z if upwards else -Z
    return RoundFace(name, 1e-3 * z * Z, axis, (0.0, 0.0), (1e-3 * radius, 1e-3 * radius), hole)


def solid(
    name: str, faces: Sequence[Face | RoundFace], pieces: Sequence[Box | Hull], centroid: float, volume: float
) -> Solid:
    """Its centroid on the z axis [mm], its volume in mm^3."""
    flat = {face.name: face for face in faces if isinstance(face, Face)}
    rounds = {face.name: face for face in faces if isinstance(face, RoundFace)}
    return Solid(name, flat, tuple(pieces), np.array([0.0, 0.0, 1e-3 * centroid]), 1e-9 * volume, rounds)


def peg(name: str = "peg", radius: float = 5.0, length: float = 50.0) -> Solid:
    """A shaft that stands on its `end`; frame: centre of that."""
    faces = [
        cylinder("wall", radius, (0, length)),
        down("end", ring(radius, 0)),
        up("head", ring(radius, length)),
        rim("edge", radius, 0, hole=False, upwards=False),
    ]
    shape = Cylinder(5e-4 * length * Z, Z, 1e-3 * radius, 5e-4 * length)
    return solid(name, faces, [make_cylinder_hull("shaft", shape)], length / 2, np.pi * radius**2 * length)


def bored(radius: float, outer: float, height: float, *, wide: bool = False) -> list[Hull]:
    """Wedges about a hole of a radius, to a circle or a square around it, [mm]."""
    k = radius / np.cos(np.pi / SIDES)
    found = []
    for i in range(SIDES):
        turn = 2.0 * np.pi * np.array([i, i + 1]) / SIDES
        way = np.column_stack([np.cos(turn), np.sin(turn)])
        far = outer * (way if not wide else way / np.abs(way).max(axis=1)[:, None])
        flat = 1e-3 * np.concatenate([k * way, far])
        found.append(
            Hull(f"w{i}", np.concatenate([np.column_stack([flat, np.full(4, 1e-3 * z)]) for z in (0, height)]))
        )
    return found


def plate(
    name: str = "plate", radius: float = 5.0, half: float = 30.0, height: float = 20.0, *, fit: bool = True
) -> Solid:
    """A square plate with a hole through its middle; frame: centre of its bottom."""
    faces = [
        cylinder("bore", radius, (0, height), hole=True, fit=fit),
        rim("rim", radius, height),
        down("bottom", square(half, 0), ring(radius, 0)),
        up("top", square(half, height), ring(radius, height)),
        *sides(half, height),
    ]
    volume = ((2 * half) ** 2 - np.pi * radius**2) * height
    return solid(name, faces, bored(radius, half, height, wide=True), height / 2, volume)


def sides(half: float, height: float) -> list[Face]:
    """px, nx, py and ny of a square column."""
    bottom = square(half, 0)
    found = []
    for i, name in enumerate(("ny", "px", "py", "nx")):
        a = bottom[i]
        b = bottom[(i + 1) % 4]
        lift = np.array([0.0, 0.0, 1e-3 * height])
        found.append(Face(name, np.array([a, b, b + lift, a + lift])))
    return found


def bush(
    name: str = "bush", radius: float = 5.0, outer: float = 12.0, height: float = 20.0, *, fit: bool = True
) -> Solid:
    """A ring: a shaft outside, a hole inside; frame: centre of its bottom."""
    faces = [
        cylinder("bore", radius, (0, height), hole=True, fit=fit),
        cylinder("wall", outer, (0, height)),
        down("bottom", ring(outer, 0), ring(radius, 0)),
        up("top", ring(outer, height), ring(radius, height)),
    ]
    volume = np.pi * (outer**2 - radius**2) * height
    return solid(name, faces, bored(radius, outer, height), height / 2, volume)


def plug(name: str = "plug") -> Solid:
    """A cone of 45 degrees to its axis, of 3 to 9 mm, on which a head of 9 mm stands; frame: its tip."""
    faces = [
        cone("cone", (3, 9), (0, 6)),
        cylinder("head", 9, (6, 16)),
        down("end", ring(3, 0)),
        up("top", ring(9, 16)),
    ]
    lower = Hull("cone", np.concatenate([ring(3, 0), ring(9, 6)]))
    upper = make_cylinder_hull("head", Cylinder(0.011 * Z, Z, 0.009, 0.005))
    return solid(name, faces, [lower, upper], 9.4, np.pi * (81 * 10 + 234))


def countersunk(name: str = "plate") -> Solid:
    """A square plate whose hole of 3 mm opens to 9 mm at the top, at 45 degrees; frame: centre of its bottom."""
    faces = [
        cylinder("bore", 3, (0, 14), hole=True),
        cone("sink", (3, 9), (14, 20), hole=True),
        down("bottom", square(30, 0), ring(3, 0)),
        up("top", square(30, 20), ring(9, 20)),
    ]
    pieces = []
    for i in range(SIDES):
        turn = 2.0 * np.pi * np.array([i, i + 1]) / SIDES
        way = np.column_stack([np.cos(turn), np.sin(turn)])
        far = 30 * way / np.abs(way).max(axis=1)[:, None]
        k = 1.0 / np.cos(np.pi / SIDES)
        levels = [(3 * k * way, 0), (far, 0), (3 * k * way, 14), (far, 14)]
        above = [(3 * k * way, 14), (far, 14), (9 * k * way, 20), (far, 20)]
        for tail, rows in (("low", levels), ("high", above)):
            corners = [np.column_stack([flat, np.full(2, float(z))]) for flat, z in rows]
            pieces.append(Hull(f"w{i}{tail}", 1e-3 * np.concatenate(corners)))
    return solid(name, faces, pieces, 10.0, 70000.0)


def prism(name: str, profile: Sequence[tuple[float, float]], length: float) -> tuple[Hull, list[Face]]:
    """A convex profile (y, z) [mm], counter-clockwise seen from +x, along x; faces `s0`, `s1`, .. and `px`, `nx`."""
    flat = np.array(profile, dtype=np.float64)
    x = length / 2
    near, far = (1e-3 * np.column_stack([np.full(len(flat), end), flat]) for end in (-x, x))
    faces = [Face("px", far), Face("nx", near[::-1])]
    for i in range(len(flat)):
        j = (i + 1) % len(flat)
        faces.append(Face(f"s{i}", np.array([near[i], near[j], far[j], far[i]])))
    return Hull(name, np.concatenate([near, far])), faces


def wedge(name: str = "wedge", angle_deg: float = 30.0) -> Solid:
    """60 mm wide and long, 10 mm thick at its thin side (-y), with a top tilted about x; frame: centre of its bottom.

    Faces: bottom, py (the thick side), slope, ny (the thin side).
    """
    rise = 60.0 * np.tan(np.radians(angle_deg))
    piece, faces = prism("wedge", [(-30, 0), (30, 0), (30, 10 + rise), (-30, 10)], 60)
    names = {"s0": "bottom", "s1": "py", "s2": "slope", "s3": "ny"}
    area = 60 * (10 + rise / 2)
    moment = 60 * 10 * 5 + 30 * rise * (10 + rise / 3)
    named = [Face(names.get(face.name, face.name), face.outline) for face in faces]
    built = solid(name, named, [piece], moment / area, 60 * area)
    center = np.array([0.0, 1e-3 * (30 * rise * 10) / area, 1e-3 * moment / area])
    return Solid(name, built.faces, built.pieces, center, built.volume)


def v_block(name: str = "v") -> Solid:
    """80 x 60 x 40 mm with a groove of 90 degrees along x, 20 deep; faces: bottom, left, right; frame: its bottom."""
    left, faces_left = prism("left", [(-30, 0), (0, 0), (0, 20), (-20, 40), (-30, 40)], 80)
    right, faces_right = prism("right", [(0, 0), (30, 0), (30, 40), (20, 40), (0, 20)], 80)
    bottom = 1e-3 * np.array([[-40, -30, 0], [40, -30, 0], [40, 30, 0], [-40, 30, 0]])
    faces = [
        down("bottom", bottom),
        Face("left", faces_left[4].outline),
        Face("right", faces_right[5].outline),
        Face("top_left", faces_left[5].outline),
        Face("top_right", faces_right[4].outline),
    ]
    return solid(name, faces, [left, right], 17.0, 60 * 40 * 80 - 20 * 20 * 80)


def rail(name: str = "rail") -> Solid:
    """A dovetail: 20 mm wide below, 20 mm high, sides at 60 degrees that lean outwards; on a base of 80 x 10."""
    wide = 20 + 2 * 20 / np.tan(np.radians(60.0))
    low, base = prism("base", [(-40, 0), (40, 0), (40, 10), (-40, 10)], 100)
    high, tail = prism("tail", [(-10, 10), (10, 10), (wide / 2, 30), (-wide / 2, 30)], 100)
    faces = [
        Face("bottom", base[2].outline),
        Face("left", tail[5].outline),
        Face("right", tail[3].outline),
        Face("top", tail[4].outline),
    ]
    return solid(name, faces, [low, high], 16.0, 100 * (800 + 20 * (20 + wide) / 2))


def slider(name: str = "slider", angle_deg: float = 60.0) -> Solid:
    """What goes over the rail: two cheeks that lean inwards and a roof; its bottom is 5 mm above the base."""
    lean = 1.0 / np.tan(np.radians(angle_deg))
    low = 10 + 5 * lean
    high = 10 + 20 * lean
    cheek_r, right = prism("cheek_r", [(low, 15), (40, 15), (40, 30), (high, 30)], 60)
    cheek_l, left = prism("cheek_l", [(-40, 15), (-low, 15), (-high, 30), (-40, 30)], 60)
    roof, cover = prism("roof", [(-40, 30), (40, 30), (40, 40), (-40, 40)], 60)
    inside = 1e-3 * np.array([[-30, -high, 30], [30, -high, 30], [30, high, 30], [-30, high, 30]])
    faces = [
        Face("right", right[5].outline, fit=True),
        Face("left", left[3].outline, fit=True),
        down("ceiling", inside),
        Face("top", cover[4].outline),
    ]
    return solid(name, faces, [cheek_r, cheek_l, roof], 29.0, 60 * (2 * 15 * (40 - (low + high) / 2) + 800))
