"""Solids made by scripts with known parameters, written as STL with the usual tessellation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from manifold3d import CrossSection, Manifold


class Made(NamedTuple):
    """A solid, and what is true of it, [mm]."""

    mesh: Any
    volume: float
    flats: int
    holes: tuple[float, ...] = ()
    """Radii of round holes, ascending."""
    shafts: tuple[float, ...] = ()
    cones: int = 0
    arcs: int = 0
    """Round walls that do not go all the way round."""


def block(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """A box about its middle in x and y, upwards from `at`."""
    return Manifold.cube((x, y, z), True).translate((at[0], at[1], at[2] + z / 2))


def rod(r: float, z: float, at: tuple[float, float, float] = (0, 0, 0), top: float | None = None, n: int = 64) -> Any:
    """A cylinder, or a cone, upwards from `at`."""
    return Manifold.cylinder(z, r, r if top is None else top, n).translate(at)


def disc(r: float, z: float) -> float:
    return float(np.pi * r * r * z)


def frustum(r: float, R: float, z: float) -> float:
    return float(np.pi * z * (r * r + r * R + R * R) / 3.0)


def prism(corners: list[tuple[float, float]], z: float) -> Any:
    return Manifold.extrude(CrossSection([corners]), z)


def rounded_plate() -> Made:
    """60 x 40 x 10 with corners of 6."""
    corner = np.radians(np.arange(0, 91, 5))
    ring = [
        (x + 6 * np.cos(a + turn), y + 6 * np.sin(a + turn))
        for turn, x, y in ((0, 24, 14), (np.pi / 2, -24, 14), (np.pi, -24, -14), (1.5 * np.pi, 24, -14))
        for a in corner
    ]
    return Made(prism(ring, 10), (2400 - (4 - np.pi) * 36) * 10, 6, arcs=4)


def holed(sizes: tuple[float, float, float], *bores: tuple[float, float, float]) -> Made:
    """A plate with holes of (x, y, radius) through it."""
    mesh = block(*sizes)
    volume = float(np.prod(sizes))
    for x, y, r in bores:
        mesh = mesh - rod(r, sizes[2], (x, y, 0))
        volume = volume - disc(r, sizes[2])
    return Made(mesh, volume, 6, tuple(sorted(r for _, _, r in bores)))


def turned(made: Made, *deg: float) -> Made:
    return made._replace(mesh=made.mesh.rotate(deg))


L_SHAPE = [(0.0, 0.0), (60.0, 0.0), (60.0, 10.0), (12.0, 10.0), (12.0, 40.0), (0.0, 40.0)]
U_SHAPE = [(0.0, 0.0), (50.0, 0.0), (50.0, 30.0), (40.0, 30.0), (40.0, 8.0), (10.0, 8.0), (10.0, 30.0), (0.0, 30.0)]
DOVETAIL = [
    (-20.0, 0.0),
    (20.0, 0.0),
    (20.0, 12.0),
    (8.0, 12.0),
    (12.0, 5.0),
    (-12.0, 5.0),
    (-8.0, 12.0),
    (-20.0, 12.0),
]


def area(corners: list[tuple[float, float]]) -> float:
    x, y = np.array(corners).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


MADE: Mapping[str, Callable[[], Made]] = {
    "cuboid": lambda: Made(block(30, 20, 10), 6000, 6),
    "turned_plate": lambda: turned(holed((60, 40, 20), (5, -3, 5.1)), 10, 50, 70),
    "tiny_hole": lambda: holed((20, 20, 5), (3, 4, 0.5)),
    "turned_pin": lambda: turned(Made(rod(4, 30, n=32), disc(4, 30), 2, shafts=(4,)), 33, 44, 55),
    "chamfered_pin": lambda: Made(
        rod(4, 20) + rod(4, 1, (0, 0, 20), 3), disc(4, 20) + frustum(4, 3, 1), 2, shafts=(4,), cones=1
    ),
    "cone": lambda: Made(rod(10, 20, top=0), frustum(10, 0, 20), 1, cones=1),
    "bush": lambda: Made(rod(9, 20) - rod(5, 20), disc(9, 20) - disc(5, 20), 2, (5,), (9,)),
    "flanged_bush": lambda: Made(
        rod(14, 4) + rod(9, 16, (0, 0, 4)) - rod(6, 20), disc(14, 4) + disc(9, 16) - disc(6, 20), 3, (6,), (9, 14)
    ),
    "counterbore": lambda: Made(
        block(40, 40, 20) - rod(4, 14) - rod(7, 6, (0, 0, 14)), 32000 - disc(4, 14) - disc(7, 6), 7, (4, 7)
    ),
    "countersink": lambda: Made(
        block(40, 40, 20) - rod(4, 16) - rod(4, 4, (0, 0, 16), 8),
        32000 - disc(4, 16) - frustum(4, 8, 4),
        6,
        (4,),
        cones=1,
    ),
    "bracket": lambda: Made(
        block(60, 40, 10)
        + block(10, 40, 40, (-25, 0, 10))
        - rod(4, 10, (15, 0, 0))
        - rod(4.2, 10).rotate((0, 90, 0)).translate((-30, 0, 30)),
        40000 - disc(4, 10) - disc(4.2, 10),
        8,
        (4, 4.2),
    ),
    "dovetail": lambda: Made(prism(DOVETAIL, 30), area(DOVETAIL) * 30, 10),
    "pocket": lambda: Made(block(50, 40, 20) - block(20, 16, 12, (0, 0, 8)), 40000 - 20 * 16 * 12, 11),
    "hexagon": lambda: Made(rod(10, 8, n=6) - rod(5, 8), 1.5 * 3**0.5 * 100 * 8 - disc(5, 8), 8, (5,)),
    "rounded_plate": rounded_plate,
}


def write_stl(mesh: Any, path: Path, scale: float = 1.0) -> Path:
    """A binary STL file."""
    raw = mesh.to_mesh()
    write_triangles(np.asarray(raw.vert_properties)[:, :3][np.asarray(raw.tri_verts)] * scale, path)
    return path


def write_triangles(triangles: Any, path: Path) -> Path:
    """A binary STL file of triangles (t, 3, 3)."""
    row = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("x", "<u2")])
    row["c"] = triangles
    path.write_bytes(bytes(80) + len(triangles).to_bytes(4, "little") + row.tobytes())
    return path
