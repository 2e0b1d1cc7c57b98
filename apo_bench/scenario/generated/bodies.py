"""Bodies of generated parts: blocks, pins, axles, rings, walls and rods; lengths in mm.

Holes and slots are marked fit and get wider by the clearance. Parts that go into them keep their size.
"""

from collections.abc import Sequence
from typing import NamedTuple

from apo_bench.scenario.parts.making import (
    Body,
    Bore,
    Edge,
    Frustum,
    bore,
    extrude,
    join,
    make_polygon,
    make_rectangle,
    make_shaft,
    revolve,
)

_SIDES = ("ny", "px", "py", "nx")
"""Names of the sides of a block, in the order of `make_rectangle`: -y, +x, +y, -x."""
_CHAMFER = 1.0
"""Length of a chamfer."""
COLLAR = 5.0
"""Thickness of the collar of an axle."""
TOP = 20.0
"""Thickness of a board."""


class Pin(NamedTuple):
    """A round pin on top of a block, or the hole for one."""

    x: float
    y: float
    radius: float
    name: str
    length: float = 14.0


PIN = Pin(0.0, 0.0, 4.5, "pin")
"""The pin on top of a block, for the part that is placed on it."""


def make_box(
    at: tuple[float, float, float], size: tuple[float, float, float], fit: Sequence[str] = (), **names: str
) -> Body:
    """A box of a given size.

    Args:
        at: Centre of its bottom.
        fit: Names of the sides that recede by the clearance.
        names: Side -> name, as `nx="wall"`.
    """
    outline = make_rectangle(*size[:2], at[:2], names=[names.get(side, "") for side in _SIDES], fit=fit)
    return extrude(outline, at[2], at[2] + size[2])


def make_pin_hole(pin: Pin, high: float) -> Bore:
    """The hole for a pin, from height 0 to `high`."""
    return bore((pin.x, pin.y), pin.radius, 0.0, high, pin.name, fit=True)


def make_block(width: float, depth: float, height: float, pins: Sequence[Pin] = (), holes: Sequence[Pin] = ()) -> Body:
    """A block on z = 0, centred about the z axis.

    Its faces are `ny`, `px`, `py`, `nx`, `bottom`, `top`, and those of its pins and through holes.
    """
    bores = [make_pin_hole(each, height) for each in holes]
    base = extrude(make_rectangle(width, depth, names=_SIDES), 0, height, bores=bores, bottom="bottom", top="top")
    return join(base, *(make_upright_pin(pin, height) for pin in pins)) if pins else base


def make_upright_pin(pin: Pin, low: float) -> Body:
    """A pin with a chamfered tip whose lower end is at height `low`."""
    return make_shaft(pin.radius, low, low + pin.length, pin.name, chamfer_high=1.5).moved((pin.x, pin.y, 0.0))


def make_axle(radius: float, deep: float, collar: float, neck: float) -> Body:
    """A shaft with a collar: `side` below its `shoulder`, `neck` above its `ledge`.

    Args:
        deep: Length below the collar.
        collar: Radius of the collar.
        neck: Length above the collar.
    """
    ledge = deep + COLLAR
    end = ledge + neck
    steps = [
        Frustum(0, _CHAMFER, radius - _CHAMFER, radius, "side_chamfer"),
        Frustum(_CHAMFER, deep, radius, name="side"),
        Frustum(deep, ledge, collar, name="collar"),
        Frustum(ledge, end - _CHAMFER, radius, name="neck"),
        Frustum(end - _CHAMFER, end, radius, radius - _CHAMFER, "neck_chamfer"),
    ]
    return revolve(steps, flats={0: "tip", deep: "shoulder", ledge: "ledge", end: "head"})


def make_ring(outer: float, inner: float, height: float) -> Body:
    """A disc with a bore: faces `bore`, `low`, `high`."""
    return revolve(
        [Frustum(0, height, outer)],
        [Frustum(0, height, inner, name="bore", fit=True)],
        flats={0: "low", height: "high"},
    )


def make_slotted_block(length: float, depth: float, height: float, slot: float, floor: float) -> Body:
    """A block with a slot along x, open above: faces `floor`, `slot_n`, `slot_p`."""
    out = depth / 2
    s = slot / 2
    section = make_polygon(
        (-out, 0), (out, 0), (out, height), (s, height), (s, floor), (-s, floor), (-s, height), (-out, height),
        names={0: "bottom", 3: "slot_p", 4: "floor", 5: "slot_n"},
        fit=("slot_p", "slot_n"),
    )  # fmt: skip
    return extrude_along_x(section, length)


def make_saddle(length: float, depth: float, height: float, slot: float, roof: float) -> Body:
    """A block with a slot along x, open below: faces `roof`, `slot_n`, `slot_p`, `top`."""
    out = depth / 2
    s = slot / 2
    section = make_polygon(
        (-out, 0), (-s, 0), (-s, roof), (s, roof), (s, 0), (out, 0), (out, height), (-out, height),
        names={1: "slot_n", 2: "roof", 3: "slot_p", 6: "top"},
        fit=("slot_p", "slot_n"),
    )  # fmt: skip
    return extrude_along_x(section, length)


def make_upright_wall(thick: float, depth: float, low: float, high: float, hole: Pin) -> Body:
    """A wall across x, about x = 0, between two heights, with a hole along x.

    Args:
        thick: Thickness along x.
        depth: Width along y.
        hole: Its x is the height of the hole, its y the position along y.
    """
    # Made lying, then turned up about y: -x becomes z, and z becomes x.
    bored = bore((-hole.x, hole.y), hole.radius, -thick / 2, thick / 2, hole.name, fit=True)
    lying = extrude(make_rectangle(high - low, depth, (-(high + low) / 2, 0)), -thick / 2, thick / 2, bores=[bored])
    return lying.moved(turn_deg=(0, 90, 0))


def make_rod(radius: float, length: float, grip: float) -> Body:
    """A shaft along x from x = 0, lying on z = 0, with a square head of length `grip` that keeps it from rolling."""
    square = extrude(make_rectangle(2 * radius, 2 * radius), -grip, 0, bottom="end")
    # A groove behind the head, since a shaft as wide as the square would leave slivers of its face.
    steps = [
        Frustum(0, 2, radius - _CHAMFER),
        Frustum(2, length - _CHAMFER, radius, name="side"),
        Frustum(length - _CHAMFER, length, radius, radius - _CHAMFER),
    ]
    return join(square, revolve(steps, flats={length: "tip"})).moved((0, 0, radius), (0, 90, 0))


def extrude_along_x(section: Sequence[Edge], length: float) -> Body:
    """A prism along x, centred at x = 0, with an outline in (y, z)."""
    return extrude(section, -length / 2, length / 2).moved(turn_deg=(90, 0, 90))
