"""Thirty solids drawn by scripts: plates, pins, bushings, brackets, keys, flanges, cones, fillets, chamfers, gears."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


class Drawn(NamedTuple):
    """A solid, and what a person counts on it, [mm]."""

    shape: Any
    flats: int
    holes: tuple[float, ...] = ()
    """Radii of cylinders all the way round, ascending."""
    shafts: tuple[float, ...] = ()
    cones: int = 0


def box(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """About its middle in x and y, upwards from `at`."""
    from build123d import Box, Pos

    return Pos(at[0], at[1], at[2] + z / 2) * Box(x, y, z)


def rod(r: float, z: float, at: tuple[float, float, float] = (0, 0, 0), top: float | None = None) -> Any:
    """A cylinder, or a cone, upwards from `at`."""
    from build123d import Cone, Cylinder, Pos

    return Pos(at[0], at[1], at[2] + z / 2) * (Cylinder(r, z) if top is None else Cone(r, top, z))


def across(r: float, length: float, at: tuple[float, float, float]) -> Any:
    """A cylinder along x, about `at`."""
    from build123d import Cylinder, Pos, Rot

    return Pos(*at) * Rot(0, 90, 0) * Cylinder(r, length)


def prism(corners: Sequence[tuple[float, float]], z: float) -> Any:
    from build123d import Polygon, extrude

    return extrude(Polygon(*corners, align=None), z)


def turned(shape: Any, *deg: float) -> Any:
    from build123d import Rot

    return Rot(*deg) * shape


def edges_up(shape: Any) -> Any:
    from build123d import Axis

    return shape.edges().filter_by(Axis.Z)


def top_edges(shape: Any) -> Any:
    from build123d import Axis

    return shape.faces().sort_by(Axis.Z)[-1].edges()


def slotted(shape: Any, length: float, width: float, depth: float, at: tuple[float, float, float]) -> Any:
    """Less a slot with round ends along x."""
    for x in (-length / 2, length / 2):
        shape = shape - rod(width / 2, depth, (at[0] + x, at[1], at[2]))
    return shape - box(length, width, depth, at)


def key() -> Any:
    """A feather key with round ends."""
    return box(18, 8, 7) + rod(4, 7, (-9, 0, 0)) + rod(4, 7, (9, 0, 0))


def gear(teeth: int, module: float, width: float, bore: float) -> Any:
    """With straight flanks of 20 degrees."""
    pitch = module * teeth / 2
    ring = []
    for k in range(teeth):
        middle = 2 * np.pi * k / teeth
        for r, half in ((pitch - 1.25 * module, 0.36), (pitch + module, 0.14)):
            ring.append((r, middle - half * 2 * np.pi / teeth))
        for r, half in ((pitch + module, 0.14), (pitch - 1.25 * module, 0.36)):
            ring.append((r, middle + half * 2 * np.pi / teeth))
    return prism([(float(r * np.cos(a)), float(r * np.sin(a))) for r, a in ring], width) - rod(bore, width)


def four_holes(x: float, y: float, r: float, z: float, low: float = 0.0) -> list[Any]:
    return [rod(r, z, (i * x, k * y, low)) for i in (-1, 1) for k in (-1, 1)]


def less(shape: Any, parts: Sequence[Any]) -> Any:
    for each in parts:
        shape = shape - each
    return shape


def filleted(shape: Any, edges: Any, radius: float) -> Any:
    from build123d import fillet

    return fillet(edges, radius)


def chamfered(shape: Any, edges: Any, length: float) -> Any:
    from build123d import chamfer

    return chamfer(edges, length)


def filleted_plate() -> Any:
    plate = less(box(70, 50, 12), four_holes(25, 15, 3.2, 12))
    return filleted(plate, edges_up(plate).filter_by(lambda e: abs(e.center().X) > 34), 6)


def filleted_top() -> Any:
    block = box(50, 40, 15) - rod(6, 15)
    return filleted(block, top_edges(block).filter_by(lambda e: abs(e.center().X) + abs(e.center().Y) > 15), 2)


def chamfered_top() -> Any:
    block = box(50, 40, 15) - rod(6, 15)
    return chamfered(block, top_edges(block).filter_by(lambda e: abs(e.center().X) + abs(e.center().Y) > 15), 2)


def ribbed() -> Any:
    """An angle with a fillet in its corner."""
    from build123d import Axis

    angle = box(60, 40, 8) + box(8, 40, 42, (-26, 0, 0))
    inner = angle.edges().filter_by(Axis.Y).filter_by(lambda e: abs(e.center().X + 22) < 0.1 and e.center().Z < 20)
    return less(filleted(angle, inner, 5), [rod(4, 8, (12, 0, 0)), across(3.3, 8, (-26, 0, 28))])


def hexagon() -> Any:
    from build123d import RegularPolygon, extrude

    return extrude(RegularPolygon(10, 6), 9) - rod(5.25, 9)


def standing_round(radius: float, length: float, chamfer: float) -> Any:
    """A pin with a chamfer at its top."""
    return rod(radius, length - chamfer) + rod(radius, chamfer, (0, 0, length - chamfer), radius - chamfer)


DRAWN: Mapping[str, Callable[[], Drawn]] = {
    "block": lambda: Drawn(box(30, 20, 10), 6),
    "turned block": lambda: Drawn(turned(box(40, 25, 15), 20, 30, 40), 6),
    "plate, hole": lambda: Drawn(box(60, 40, 20) - rod(5.1, 20, (5, -3, 0)), 6, (5.1,)),
    "plate, four holes": lambda: Drawn(less(box(60, 60, 8), four_holes(20, 20, 2.6, 8)), 6, (2.6,) * 4),
    "turned plate": lambda: Drawn(turned(box(60, 40, 12) - rod(8.05, 12), 10, 50, 70), 6, (8.05,)),
    "plate, wide hole": lambda: Drawn(box(120, 120, 10) - rod(45, 10), 6, (45.0,)),
    "pin": lambda: Drawn(rod(5, 40), 2, (), (5.0,)),
    "thin pin": lambda: Drawn(turned(rod(1.5, 30), 33, 44, 0), 2, (), (1.5,)),
    "disc": lambda: Drawn(rod(25, 4), 2, (), (25.0,)),
    "stepped shaft": lambda: Drawn(rod(8, 10) + rod(5, 20, (0, 0, 10)) + rod(3, 8, (0, 0, 30)), 4, (), (3.0, 5.0, 8.0)),
    "chamfered pin": lambda: Drawn(standing_round(4, 25, 1), 2, (), (4.0,), 1),
    "bushing": lambda: Drawn(rod(9, 20) - rod(5, 20), 2, (5.0,), (9.0,)),
    "flanged bushing": lambda: Drawn(rod(14, 4) + rod(9, 16, (0, 0, 4)) - rod(6, 20), 3, (6.0,), (9.0, 14.0)),
    "flange, six holes": lambda: Drawn(
        less(
            rod(30, 8) + rod(15, 18, (0, 0, 8)) - rod(10, 26),
            [
                rod(2.75, 8, (22.5 * float(np.cos(a)), 22.5 * float(np.sin(a)), 0))
                for a in np.arange(6) * np.pi / 3 + 0.2
            ],
        ),
        3,
        (*(2.75,) * 6, 10.0),
        (15.0, 30.0),
    ),
    "counterbore": lambda: Drawn(box(40, 40, 20) - rod(4, 14) - rod(7, 6, (0, 0, 14)), 7, (4.0, 7.0)),
    "countersink": lambda: Drawn(box(40, 40, 20) - rod(4, 16) - rod(4, 4, (0, 0, 16), 8), 6, (4.0,), (), 1),
    "blind holes": lambda: Drawn(
        box(80, 30, 20) - rod(4.05, 12, (-20, 0, 8)) - rod(4.05, 12, (20, 0, 8)), 8, (4.05, 4.05)
    ),
    "truncated cone": lambda: Drawn(rod(10, 20, (0, 0, 0), 5), 2, (), (), 1),
    "plug with a taper": lambda: Drawn(
        rod(12, 6) + rod(7, 10, (0, 0, 6), 5) + rod(5, 8, (0, 0, 16)), 3, (), (5.0, 12.0), 1
    ),
    "base with two pins": lambda: Drawn(
        box(60, 40, 10) + rod(4, 15, (15, 0, 10)) + rod(3, 12, (-15, 0, 10)), 8, (), (3.0, 4.0)
    ),
    "bracket": lambda: Drawn(
        less(box(60, 40, 10) + box(10, 40, 50, (-25, 0, 0)), [rod(4, 10, (15, 0, 0)), across(4.2, 10, (-25, 0, 30))]),
        8,
        (4.0, 4.2),
    ),
    "bracket with a fillet": lambda: Drawn(ribbed(), 8, (3.3, 4.0)),
    "key": lambda: Drawn(key(), 4),
    "plate with a slot": lambda: Drawn(slotted(box(60, 30, 10), 20, 9, 10, (0, 0, 0)), 8),
    "plate, round corners": lambda: Drawn(filleted_plate(), 6, (3.2,) * 4),
    "block, top filleted": lambda: Drawn(filleted_top(), 6, (6.0,)),
    "block, top chamfered": lambda: Drawn(chamfered_top(), 10, (6.0,)),
    "hexagon with a hole": lambda: Drawn(hexagon(), 8, (5.25,)),
    "gear of 12 teeth": lambda: Drawn(gear(12, 2.5, 8, 4.05), 50, (4.05,)),
    "gear of 20 teeth": lambda: Drawn(gear(20, 2, 10, 6.0), 82, (6.0,)),
}
