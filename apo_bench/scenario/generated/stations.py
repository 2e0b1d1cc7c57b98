"""Stations whose parts are each placed on a fixed part or on the part before; lengths in mm.

Sizes are such that fingers, 12 mm thick and 10 mm below their tips, pass next to other parts. The station functions
take the generator, the number of the station as text for names, and the number of parts.
"""

from collections.abc import Sequence

import numpy as np

from apo_bench.scenario.generated.assembly import BOARD, DrawnOperation, Point, Station, draw_length
from apo_bench.scenario.generated.bodies import (
    COLLAR,
    PIN,
    TOP,
    Pin,
    make_axle,
    make_block,
    make_box,
    make_ring,
    make_upright_pin,
)
from apo_bench.scenario.parts.making import Body, bore

LETTERS = "abcdefghijkl"
"""Suffixes of the names of parts."""
LOW = 4.0
"""Height of the lower end of a shaft in a board above the table."""
WALL = 6.0
"""Thickness of a wall."""
_LOOSE = 0.5
"""Probability that the top block lies loose on the one below, without a pin."""


def block_grasp_point(height: float) -> Point:
    """The grasp point of a block of this height, so that the fingers stay above its bottom."""
    return (0.0, 0.0, height - 2.0 if height < 22.0 else height - 10.0)


def axle_grasp_point(deep: float, neck: float) -> Point:
    """The grasp point of an axle, at the end of its neck; arguments as in `make_axle`."""
    return (0.0, 0.0, deep + COLLAR + neck - 10.0)


def make_corner(rng: np.random.Generator, i: str, size: int) -> Station:
    """A block in the corner of two walls, and a pile of blocks on top of it."""
    width = draw_length(rng, 32, 40)
    depth = draw_length(rng, 28, 34)
    height = draw_length(rng, 38, 44)
    low = draw_length(rng, 10, 14)
    walls = (
        make_box((-(width + WALL) / 2, 0, TOP), (WALL, depth, low), px=f"wall{i}x"),
        make_box((0, (depth + WALL) / 2, TOP), (width, WALL, low), ny=f"wall{i}y"),
    )
    name = f"block{i}"
    contacts = (("bottom", f"{BOARD}.top"), ("nx", f"{BOARD}.wall{i}x"), ("py", f"{BOARD}.wall{i}y"))
    acts = (DrawnOperation(name, (0, 0, TOP), contacts, block_grasp_point(height)),)
    is_loose = size > 1 and bool(rng.random() < _LOOSE)
    parts = {name: make_block(width, depth, height, [PIN] if size - is_loose > 1 else [])}
    more, piled = make_pile(rng, name, (0, 0, TOP + height), size - 1, is_loose)
    return Station(width + 2 * WALL, parts | more, (*acts, *piled), bodies=walls)


def make_pile(
    rng: np.random.Generator, below: str, at: Point, count: int, loose: bool = False
) -> tuple[dict[str, Body], list[DrawnOperation]]:
    """A pile of blocks, each on the pin of the one below; returns its parts and operations.

    Args:
        below: Name of the part under the pile, which has a pin if the first block needs one.
        at: Centre of the top of that part.
        count: Number of blocks.
        loose: The last block has no pin below it and lies at any place.
    """
    parts = dict[str, Body]()
    acts = list[DrawnOperation]()
    x, y, z = at
    stem = below
    for k in range(count):
        name = f"{stem}_{LETTERS[k]}"
        height = draw_length(rng, 28, 36)
        is_loose = loose and (k == count - 1)
        pins = [PIN] if k < count - 1 - loose else []
        holes = [] if is_loose else [PIN._replace(name="bore")]
        parts[name] = make_block(draw_length(rng, 30, 36), draw_length(rng, 28, 32), height, pins, holes)
        on = (("bottom", f"{below}.top"), *(() if is_loose else (("bore", f"{below}.pin"),)))
        acts.append(
            DrawnOperation(
                name, (x, y, z), on, block_grasp_point(height), vary_mm=(("x", 3.0), ("y", 2.0)) if is_loose else ()
            )
        )
        below = name
        z += height
    return parts, acts


def make_peg(rng: np.random.Generator, i: str, size: int) -> Station:
    """An axle in a bore of the board, and, if there are two parts, a ring over it."""
    radius = draw_length(rng, 5, 7)
    parts, acts = make_ringed_axle(rng, i, radius)
    bores = (bore((0, 0), radius, 0, TOP, f"bore{i}", fit=True),)
    return Station(50.0, dict([*parts.items()][:size]), acts[:size], bores=bores)


def make_ringed_axle(
    rng: np.random.Generator, i: str, radius: float
) -> tuple[dict[str, Body], tuple[DrawnOperation, ...]]:
    """An axle whose collar rests on the board, and a ring on its neck; returns parts and operations.

    Args:
        radius: Radius of the axle.
    """
    collar = radius + draw_length(rng, 4, 6)
    deep = TOP - LOW
    height = draw_length(rng, 14, 18)
    neck = height + draw_length(rng, 24, 28)
    name = f"axle{i}"
    parts = {
        name: make_axle(radius, deep, collar, neck),
        f"ring{i}": make_ring(draw_length(rng, collar + 4, 20), radius, height),
    }
    contacts = (("side", f"{BOARD}.bore{i}"), ("shoulder", f"{BOARD}.top"))
    return parts, (
        DrawnOperation(name, (0, 0, LOW), contacts, axle_grasp_point(deep, neck)),
        DrawnOperation(
            f"ring{i}",
            (0, 0, TOP + COLLAR),
            (("bore", f"{name}.neck"), ("low", f"{name}.ledge")),
            block_grasp_point(height),
        ),
    )


def make_post(rng: np.random.Generator, i: str, size: int) -> Station:
    """Plates over one post of the board, or over two."""
    two = bool(rng.random() < 0.5)
    radius = draw_length(rng, 5, 7)
    width = draw_length(rng, 54, 60) if two else draw_length(rng, 36, 46)
    heights = [draw_length(rng, 14, 16) for _ in range(size)]
    high = sum(heights) + draw_length(rng, 4, 8)
    apart = draw_length(rng, 15, 17)
    at = ((-apart, "a"), (apart, "b")) if two else ((0.0, "a"),)
    posts = [Pin(x, 0, radius, f"post{i}{letter}", high) for x, letter in at]
    parts, acts = make_plates(rng, i, width, (30, 40), heights, posts)
    on = tuple((f"bore{pin.name[-1]}", f"{BOARD}.{pin.name}") for pin in posts)
    threaded = (act._replace(contacts=(*act.contacts, *on)) for act in acts)
    return Station(width, parts, tuple(threaded), bodies=tuple(make_upright_pin(each, TOP) for each in posts))


def make_plates(
    rng: np.random.Generator,
    i: str,
    width: float,
    depth: tuple[float, float],
    heights: Sequence[float],
    through: Sequence[Pin],
) -> tuple[dict[str, Body], list[DrawnOperation]]:
    """Plates on each other, with bores for the pins that go through them; returns parts and operations.

    Args:
        width: Length of a plate along x.
        depth: Least and largest width of a plate along y.
        heights: Thickness of each plate.
        through: The pins; the last letter of a name is that of the bore.
    """
    holes = [pin._replace(name=f"bore{pin.name[-1]}") for pin in through]
    parts = dict[str, Body]()
    acts = list[DrawnOperation]()
    z = TOP
    below = f"{BOARD}.top"
    for k, height in enumerate(heights):
        name = f"plate{i}{LETTERS[k]}"
        parts[name] = make_block(width, draw_length(rng, *depth), height, holes=holes)
        acts.append(DrawnOperation(name, (0, 0, z), (("bottom", below),), block_grasp_point(height)))
        below = f"{name}.top"
        z += height
    return parts, acts


def make_covered(rng: np.random.Generator, i: str, size: int) -> Station:
    """Two to four axles in bores of the board, a cover over all of them, and rings on the cover."""
    count = int(rng.integers(max(2, -(-(size - 1) // 2)), min(4, size - 1) + 1))
    ringed = {int(k) for k in rng.permutation(count)[: size - 1 - count]}
    radius = draw_length(rng, 5, 6)
    collar = radius + draw_length(rng, 4, 6)
    pitch = draw_length(rng, 46, 50)
    xs = [pitch * (k - (count - 1) / 2) for k in range(count)]
    thick = draw_length(rng, 14, 16)
    high = draw_length(rng, 14, 16)
    deep = TOP - LOW
    neck = thick + high + draw_length(rng, 24, 28)
    body = make_axle(radius, deep, collar, neck)
    names = [f"axle{i}{LETTERS[k]}" for k in range(count)]
    parts: dict[str, Body] = dict.fromkeys(names, body)
    acts = [
        DrawnOperation(
            name,
            (x, 0, LOW),
            (("side", f"{BOARD}.bore_{name}"), ("shoulder", f"{BOARD}.top")),
            axle_grasp_point(deep, neck),
        )
        for name, x in zip(names, xs, strict=True)
    ]
    cover = f"cover{i}"
    holes = [Pin(x, 0, radius, f"bore_{name}") for name, x in zip(names, xs, strict=True)]
    parts[cover] = make_block(pitch * (count - 1) + 40, draw_length(rng, 32, 40), thick, holes=holes)
    on = [pair for name in names for pair in (("bottom", f"{name}.ledge"), (f"bore_{name}", f"{name}.neck"))]
    acts.append(DrawnOperation(cover, (0, 0, TOP + COLLAR), tuple(on), block_grasp_point(thick)))
    disc = make_ring(draw_length(rng, radius + 8, 20), radius, high)
    for k in sorted(ringed):
        meets = (("bore", f"{names[k]}.neck"), ("low", f"{cover}.top"))
        parts[f"ring{i}{LETTERS[k]}"] = disc
        acts.append(
            DrawnOperation(f"ring{i}{LETTERS[k]}", (xs[k], 0, TOP + COLLAR + thick), meets, block_grasp_point(high))
        )
    bores = tuple(bore((x, 0), radius, 0, TOP, f"bore_{name}", fit=True) for name, x in zip(names, xs, strict=True))
    return Station(pitch * (count - 1) + 46, parts, tuple(acts), bores=bores)


def make_carried(rng: np.random.Generator, i: str, size: int) -> Station:
    """An axle that gets its ring in a stand next to the board and then carries it to its bore; three parts."""
    radius = draw_length(rng, 5, 7)
    parts, (first, second) = make_ringed_axle(rng, i, radius)
    stand = f"stand{i}"
    aside = 80.0
    standing = (("side", f"{stand}.bore"), ("shoulder", f"{stand}.top"))
    acts = (
        first._replace(at=(0, aside, first.at[2]), contacts=standing),
        second._replace(at=(0, aside, second.at[2])),
        first._replace(carries=(second.part,)),
    )
    parts[stand] = make_block(40, 40, TOP, holes=[Pin(0, 0, radius, "bore")])
    bores = (bore((0, 0), radius, 0, TOP, f"bore{i}", fit=True),)
    return Station(50.0, parts, acts, bores=bores, fixed={stand: (0.0, aside, 0.0)})
