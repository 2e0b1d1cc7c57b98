"""Stations whose parts lie loose until a later part links them; lengths in mm.

Each function takes the generator, the number of the station as text for names, and the number of parts.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from apo_bench.scenario.generated.assembly import BOARD, DrawnOperation, Station, draw_length
from apo_bench.scenario.generated.bodies import (
    PIN,
    TOP,
    Pin,
    extrude_along_x,
    make_axle,
    make_block,
    make_box,
    make_rod,
    make_saddle,
    make_slotted_block,
    make_upright_pin,
    make_upright_wall,
)
from apo_bench.scenario.generated.stations import (
    LETTERS,
    LOW,
    WALL,
    axle_grasp_point,
    block_grasp_point,
    make_pile,
    make_plates,
)
from apo_bench.scenario.parts.making import Body, bore, extrude, join, make_polygon, make_rectangle

_FOOT = 32.0
"""Length of the foot of a bracket from its wall."""


def make_pinned(rng: np.random.Generator, i: str, size: int) -> Station:
    """Loose plates on each other, then two axles through all of them."""
    radius = draw_length(rng, 5, 6)
    apart = draw_length(rng, 17, 20)
    width = 2 * apart + 2 * radius + 16
    pins = [Pin(x, 0, radius, letter) for x, letter in ((-apart, "a"), (apart, "b"))]
    heights = [draw_length(rng, 14, 16) for _ in range(size - 2)]
    parts, acts = make_plates(rng, i, width, (34, 42), heights, pins)
    plates = list(parts)
    deep = TOP + sum(heights) - LOW
    neck = draw_length(rng, 24, 28)
    body = make_axle(radius, deep, radius + draw_length(rng, 4, 5), neck)
    for pin in pins:
        name = f"axle{i}{pin.name}"
        parts[name] = body
        through = [("side", f"{plate}.bore{pin.name}") for plate in plates]
        contacts = (("side", f"{BOARD}.bore{i}{pin.name}"), *through, ("shoulder", f"{plates[-1]}.top"))
        acts.append(DrawnOperation(name, (pin.x, 0, LOW), contacts, axle_grasp_point(deep, neck)))
    bores = [bore((pin.x, 0), radius, 0, TOP, f"bore{i}{pin.name}", fit=True) for pin in pins]
    return Station(width, parts, tuple(acts), bores=tuple(bores))


def make_bridged(rng: np.random.Generator, i: str, size: int) -> Station:
    """Two or three loose towers, plates that join the pins of neighbouring towers, and blocks on these plates."""
    count = 3 if size >= 5 and (size > 6 or rng.random() < 0.7) else 2
    pitch = draw_length(rng, 66, 72)
    width = draw_length(rng, 40, 44)
    height = draw_length(rng, 36, 42)
    depth = draw_length(rng, 32, 36)
    thick = draw_length(rng, 14, 16)
    aside = 11.0
    xs = [pitch * (k - (count - 1) / 2) for k in range(count)]
    parts = dict[str, Body]()
    acts = list[DrawnOperation]()
    for k, x in enumerate(xs):
        name = f"tower{i}{LETTERS[k]}"
        sides = [(-aside, "left")] * (k > 0) + [(aside, "right")] * (k < count - 1)
        parts[name] = make_block(width, depth, height, [PIN._replace(x=at, name=side) for at, side in sides])
        acts.append(DrawnOperation(name, (x, 0, TOP), (("bottom", f"{BOARD}.top"),), block_grasp_point(height)))
    left = size - 2 * count + 1
    for k in range(count - 1):
        name = f"bridge{i}{LETTERS[k]}"
        caps = left // (count - 1) + (k < left % (count - 1))
        ends = [(f"tower{i}{LETTERS[k]}", "right", -1.0), (f"tower{i}{LETTERS[k + 1]}", "left", 1.0)]
        far = pitch / 2 - aside
        holes = [PIN._replace(x=sign * far, name=side) for _, side, sign in ends]
        parts[name] = make_block(2 * far + 18, draw_length(rng, 28, 32), thick, [PIN] if caps else [], holes)
        on = [pair for tower, side, _ in ends for pair in (("bottom", f"{tower}.top"), (side, f"{tower}.{side}"))]
        middle = ((xs[k] + xs[k + 1]) / 2, 0.0, TOP + height)
        acts.append(DrawnOperation(name, middle, tuple(on), block_grasp_point(thick)))
        more, piled = make_pile(rng, name, (*middle[:2], middle[2] + thick), caps)
        parts |= more
        acts += piled
    return Station(pitch * (count - 1) + width, parts, tuple(acts))


class SlidingPair(NamedTuple):
    """A sliding joint along x: the rails on a board, and a key that slides between them."""

    rails: tuple[Body, ...]
    """Bodies on the board."""
    key: Body
    height: float
    """Height of the key."""
    meets: tuple[tuple[str, str], ...]
    """Pairs of a face of the key and the face of a rail that it touches."""


def make_keyed(rng: np.random.Generator, i: str, size: int) -> Station:
    """Two keys at any place along a slot, a bar over the pins of both, and blocks on the bar."""
    return _make_barred_keys(rng, i, size, _draw_slot)


def make_grooved(rng: np.random.Generator, i: str, size: int) -> Station:
    """As `make_keyed`, with keys whose tilted faces lie in a groove."""
    return _make_barred_keys(rng, i, size, _draw_groove)


def _draw_slot(rng: np.random.Generator, length: float, key_length: float) -> SlidingPair:
    """Two upright rails of a given length, and a block as key."""
    width = draw_length(rng, 18, 24)
    height = draw_length(rng, 34, 40)
    low = draw_length(rng, 10, 12)
    rails = (
        make_box((0, -(width + WALL) / 2, TOP), (length, WALL, low), fit=("n",), py="n"),
        make_box((0, (width + WALL) / 2, TOP), (length, WALL, low), fit=("p",), ny="p"),
    )
    return SlidingPair(rails, make_block(key_length, width, height, [PIN]), height, (("ny", "n"), ("py", "p")))


def _draw_groove(rng: np.random.Generator, length: float, key_length: float) -> SlidingPair:
    """Two rails with faces that lean outwards by a drawn angle, and a key with the same flanks."""
    slope = float(np.tan(np.radians(rng.integers(45, 66))))
    low = draw_length(rng, 11, 13)
    floor = draw_length(rng, 7, 9)
    height = draw_length(rng, 38, 44)
    key_low = low - 1.0
    outer = floor + key_low / slope
    far = floor + low / slope
    corners = ((floor, TOP), (far + 3.0, TOP), (far + 3.0, TOP + low), (far, TOP + low))
    mirrored = [(-y, z) for y, z in corners[::-1]]
    rails = (
        extrude_along_x(make_polygon(*corners, names={3: "p"}, fit=("p",)), length),
        extrude_along_x(make_polygon(*mirrored, names={3: "n"}, fit=("n",)), length),
    )
    section = make_polygon(
        (-floor, 0), (floor, 0), (outer, key_low), (outer, height), (-outer, height), (-outer, key_low),
        names={0: "bottom", 1: "lean_p", 3: "top", 5: "lean_n"},
    )  # fmt: skip
    key = join(extrude_along_x(section, key_length), make_upright_pin(PIN, height))
    return SlidingPair(rails, key, height, (("lean_n", "n"), ("lean_p", "p")))


def _make_barred_keys(
    rng: np.random.Generator, i: str, size: int, way_of: Callable[[np.random.Generator, float, float], SlidingPair]
) -> Station:
    """Two keys between the same rails, a bar over both, and blocks on the bar.

    Args:
        way_of: (rng, length of the rails, length of a key) -> rails and key.
    """
    apart = draw_length(rng, 25, 28)
    length = draw_length(rng, 28, 34)
    way = way_of(rng, 2 * apart + length + 6, length)
    ends = ((-apart, "a"), (apart, "b"))
    parts = {f"key{i}{end}": way.key for _, end in ends}
    on = (("bottom", f"{BOARD}.top"), *((own, f"{BOARD}.way{i}_{face}") for own, face in way.meets))
    acts = [DrawnOperation(f"key{i}{end}", (x, 0, TOP), on, block_grasp_point(way.height)) for x, end in ends]
    thick = draw_length(rng, 14, 16)
    z = TOP + way.height
    bar = f"bar{i}"
    holes = [PIN._replace(x=x, name=f"bore{end}") for x, end in ends]
    parts[bar] = make_block(2 * apart + 20, draw_length(rng, 24, 30), thick, [PIN] if size > 3 else [], holes)
    pairs = [pair for _, e in ends for pair in (("bottom", f"key{i}{e}.top"), (f"bore{e}", f"key{i}{e}.pin"))]
    acts.append(DrawnOperation(bar, (0, 0, z), tuple(pairs), block_grasp_point(thick)))
    more, piled = make_pile(rng, bar, (0, 0, z + thick), size - 3)
    rails = tuple(rail.prefixed(f"way{i}_") for rail in way.rails)
    return Station(2 * apart + length + 6, parts | more, (*acts, *piled), bodies=rails)


def make_castled(rng: np.random.Generator, i: str, size: int) -> Station:
    """Two or three loose blocks with slots, a stick laid into all slots, and saddles over the stick."""
    count = int(rng.integers(max(2, -(-(size - 1) // 2)), min(3, size - 1) + 1))
    pitch = draw_length(rng, 70, 74)
    length = draw_length(rng, 34, 38)
    slot = draw_length(rng, 20, 24)
    height = draw_length(rng, 46, 52)
    floor = draw_length(rng, 20, 24)
    over = draw_length(rng, 20, 25)
    body = make_slotted_block(length, draw_length(rng, 40, 44), height, slot, floor)
    xs = [pitch * (k - (count - 1) / 2) for k in range(count)]
    names = [f"castle{i}{LETTERS[k]}" for k in range(count)]
    parts = dict.fromkeys(names, body)
    grasp = (0.0, 0.0, 20.0)
    acts = [
        DrawnOperation(name, (x, 0, TOP), (("bottom", f"{BOARD}.top"),), grasp)
        for name, x in zip(names, xs, strict=True)
    ]
    stick = f"stick{i}"
    high = height - floor + over
    parts[stick] = make_block(pitch * (count - 1) + length + draw_length(rng, 4, 16), slot, high)
    on = [
        pair
        for name in names
        for pair in (("bottom", f"{name}.floor"), ("ny", f"{name}.slot_n"), ("py", f"{name}.slot_p"))
    ]
    acts.append(DrawnOperation(stick, (0, 0, TOP + floor), tuple(on), (0, 0, high - 8)))
    roof = over - 2.0
    for k in range(size - count - 1):
        name = f"saddle{i}{LETTERS[k]}"
        parts[name] = make_saddle(draw_length(rng, 28, 34), slot + 20, roof + 16, slot, roof)
        meets = (("roof", f"{stick}.top"), ("slot_n", f"{stick}.ny"), ("slot_p", f"{stick}.py"))
        acts.append(
            DrawnOperation(name, (xs[k], 0, TOP + floor + high - roof), meets, (0, 0, roof + 6), vary_mm=(("x", 3.0),))
        )
    return Station(pitch * (count - 1) + length, parts, tuple(acts))


def make_threaded(rng: np.random.Generator, i: str, size: int) -> Station:
    """Loose brackets, and a horizontal rod that is pushed through the wall of the board and all brackets."""
    count = size - 1
    radius = draw_length(rng, 7, 8)
    high = draw_length(rng, 38, 42)
    depth = draw_length(rng, 38, 42)
    thick = draw_length(rng, 12, 14)
    pitch = draw_length(rng, 60, 64)
    top = high + radius + 14
    first = -pitch * count / 2
    wall = join(
        make_box((0, 0, 0), (thick, depth, 10.0)),
        make_upright_wall(thick, depth, 10, top, Pin(high, 0, radius, f"bore{i}")),
    )
    bracket = join(
        extrude(make_rectangle(_FOOT + thick, depth, (_FOOT / 2, 0)), 0, 10, bottom="bottom", top="tread"),
        make_upright_wall(thick, depth, 10, top, Pin(high, 0, radius, "bore")),
    )
    names = [f"bracket{i}{LETTERS[k]}" for k in range(count)]
    parts = dict.fromkeys(names, bracket)
    acts = [
        DrawnOperation(
            name,
            (first + pitch * (k + 1), 0, TOP),
            (("bottom", f"{BOARD}.top"),),
            (0, 0, high - 6),
            vary_mm=(("x", 3.0),),
        )
        for k, name in enumerate(names)
    ]
    stick = f"rod{i}"
    parts[stick] = make_rod(radius, pitch * count + thick + 20, 24)
    through = [("side", f"{BOARD}.bore{i}"), *(("side", f"{name}.bore") for name in names)]
    at = (first - thick / 2 - 8, 0.0, TOP + high - radius)
    acts.append(DrawnOperation(stick, at, tuple(through), (-12, 0, radius + 4), vary_mm=(("x", 2.0),)))
    return Station(pitch * count + 2 * _FOOT + thick, parts, tuple(acts), bodies=(wall.moved((first, 0, TOP)),))
