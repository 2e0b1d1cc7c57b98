"""Write the package's parts with round and tilted faces: `python assets/make_parts.py [FOLDER]`.

Lengths in mm. Holes and slots are marked fit and become wider by the clearance; shafts and keys never are.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from apo_bench.scenario.parts.making import (
    Body,
    Bore,
    Frustum,
    bore,
    extrude,
    join,
    make_polygon,
    make_rectangle,
    make_shaft,
    revolve,
    write_part,
)

SOURCE, LICENCE, DENSITY = "assets/make_parts.py of apo_bench", "Apache-2.0", 700.0
SIDES = ("ny", "px", "py", "nx")
TAN_60, TAN_30 = float(np.tan(np.radians(60.0))), float(np.tan(np.radians(30.0)))
_UNDER = 15.0 + 65.0 * TAN_30
"""Height of the roof of lean_to at its open end."""
_GEARS = ((-48, "a_bore"), (0, "b_bore"), (48, "c_bore"))


def bored_plate() -> Body:
    """60 x 60 x 20 mm with a bore of 10 mm."""
    hole = bore((0, 0), 5, 0, 20, "bore", fit=True)
    return extrude(make_rectangle(60, 60, names=SIDES), 0, 20, bores=[hole], bottom="bottom", top="top")


def peg() -> Body:
    """10 mm thick, 70 mm long; stands on its tip."""
    return make_shaft(5, 0, 70, "side", bottom="tip", top="head")


def bracket() -> Body:
    """An L of 50 x 40 x 64 mm; a bore of 16 mm along x through its wall, 40 mm above its bottom."""
    foot = extrude(make_rectangle(50, 40), 0, 10, bottom="bottom", top="tread")
    wall = extrude(
        make_rectangle(54, 40, (-27 - 10, 0)),
        0,
        14,
        bores=[bore((-40, 0), 8, 0, 14, "bore", fit=True)],
        bottom="wx",
        top="wn",
    )
    # lying along z it is turned up: what was -x becomes z, what was z becomes x
    return join(foot, wall.moved(turn_deg=(0, 90, 0)).moved((-25, 0, 0)))


def rod() -> Body:
    """16 mm thick, 150 mm long, along x; a square head of 16 mm at -x keeps it from rolling."""
    length = make_shaft(8, 0, 130, "side", chamfer_high=1, top="tip")
    head = extrude(make_rectangle(16, 16), -24, 0, bottom="end")
    return join(head, length).moved(turn_deg=(0, 90, 0))


def housing() -> Body:
    """60 x 60 x 45 mm with a blind bore of 32 mm, 35 mm deep."""
    hole = Bore((0, 0), (Frustum(10, 45, 16, name="bore", fit=True),), {10: "floor"})
    return extrude(make_rectangle(60, 60, names=SIDES), 0, 45, bores=[hole], bottom="bottom", top="top")


def bush() -> Body:
    """32 mm thick, 60 mm long, with a bore of 16 mm."""
    return revolve(
        [Frustum(0, 60, 16, name="outer")], [Frustum(0, 60, 8, name="bore", fit=True)], flats={0: "low", 60: "high"}
    )


def spindle() -> Body:
    """16 mm thick, 80 mm long."""
    return make_shaft(8, 0, 80, "side", bottom="tip", top="head")


def dovetail_base() -> Body:
    """80 x 60 x 20 mm with a slot along x whose sides lean by 60 degrees: 20 mm wide at the top, 10 mm deep."""
    wide = 10 + 10 / TAN_60
    section = make_polygon(
        (-30, 0), (30, 0), (30, 20), (10, 20), (wide, 10), (-wide, 10), (-10, 20), (-30, 20),
        names={0: "bottom", 3: "slot_n", 4: "floor", 5: "slot_p"},
        fit=("slot_n", "floor", "slot_p"),
    )  # fmt: skip
    return _along_x(extrude(section, -40, 40))


def dovetail_slide() -> Body:
    """Fits into the slot of dovetail_base, 70 mm long, with a handle 16 mm wide on top."""
    wide = 10 + 10 / TAN_60
    section = make_polygon(
        (-wide, 0), (wide, 0), (10, 10), (8, 10), (8, 40), (-8, 40), (-8, 10), (-10, 10),
        names={0: "bottom", 1: "lean_n", 7: "lean_p"},
    )  # fmt: skip
    return _along_x(extrude(section, -35, 35))


def lean_to() -> Body:
    """A roof that leans by 30 degrees over a floor of 70 x 65 mm; at +y a wall carries it, the other sides are open."""
    floor = extrude(make_rectangle(70, 80, (0, 0)), 0, 10, bottom="bottom", top="floor")
    low = _UNDER - 70 * TAN_30
    section = make_polygon(
        (-35, _UNDER), (35, low), (35, _UNDER + 12), (-35, _UNDER + 12),
        names={0: "under"},
        fit=("under",),
    )  # fmt: skip
    wall = extrude(
        make_polygon((-35, 10), (35, 10), (35, low), (-35, _UNDER)), 0, 15, bottom="outside", top="wall", fit=("wall",)
    )
    roof = extrude(section, 0, 80)
    post = _across_y(wall).moved((0, 40, 0))
    return join(floor, post, _across_y(roof).moved((0, 40, 0)))


def wedge() -> Body:
    """A wedge of 30 degrees, 60 mm long and 40 mm wide, with a handle of 60 mm at its thick end."""
    section = make_polygon(
        (-30, 0), (30, 0), (30, 5), (-30, 5 + 60 * TAN_30), names={0: "bottom", 2: "slope", 3: "back"}
    )
    body = _across_y(extrude(section, -20, 20, bottom="side_p", top="side_n"))
    handle = extrude(make_rectangle(60, 20, (-60, 0)), 0, 20)
    return join(body, handle)


def pin_plate() -> Body:
    """100 x 70 x 12 mm with two pins of 8 mm, 60 mm apart, 20 mm high with chamfers."""
    plate = extrude(make_rectangle(100, 70), 0, 12, bottom="bottom", top="top")
    pin = make_shaft(4, 12, 32, "pin", chamfer_high=1.5)
    return join(plate, pin.moved((-30, 0, 0)).prefixed("a_"), pin.moved((30, 0, 0)).prefixed("b_"))


def l_plate() -> Body:
    """An L of 90 x 50 x 16 mm with two bores of 8 mm, 60 mm apart, in its long leg."""
    outline = make_polygon((-45, -12), (45, -12), (45, 38), (21, 38), (21, 12), (-45, 12))
    holes = [bore((x, 0), 4, 0, 16, name, fit=True) for x, name in ((-30, "a_bore"), (30, "b_bore"))]
    return extrude(outline, 0, 16, bores=holes, bottom="bottom", top="top")


def gear_base() -> Body:
    """174 x 70 x 24 mm with three blind bores of 10 mm, 48 mm apart, 21 mm deep, and two walls, 26 mm high."""
    holes = [
        Bore(
            (x, 0),
            (Frustum(3, 20, 5, name=name, fit=True), Frustum(20, 24, 7)),
            {3: f"{name}_floor", 20: f"{name}_rim"},
        )
        for x, name in _GEARS
    ]
    plate = extrude(make_rectangle(174, 70), 0, 24, bores=holes, bottom="bottom", top="top")
    ends = [extrude(make_rectangle(14, 70, (x, 0)), 24, 50, top=name) for x, name in ((-80, "wall_n"), (80, "wall_p"))]
    return join(plate, *ends)


def axle() -> Body:
    """10 mm thick, 60 mm long, with a collar of 22 mm, 5 mm thick, 15 mm above its tip."""
    steps = [
        Frustum(0, 1, 4, 5, "side_chamfer"),
        Frustum(1, 15, 5, name="side"),
        Frustum(15, 20, 11, name="collar"),
        Frustum(20, 59, 5, name="neck"),
        Frustum(59, 60, 5, 4, name="neck_chamfer"),
    ]
    return revolve(steps, flats={0: "tip", 15: "shoulder", 20: "ledge", 60: "head"})


def stand() -> Body:
    """40 x 40 x 24 mm with a bore of 10 mm, 21 mm deep: holds an axle upright."""
    hole = Bore((0, 0), (Frustum(3, 20, 5, name="bore", fit=True), Frustum(20, 24, 7)), {3: "floor", 20: "rim"})
    return extrude(make_rectangle(40, 40), 0, 24, bores=[hole], bottom="bottom", top="top")


def disc() -> Body:
    """A gear without teeth: 40 mm across, 14 mm thick, with a bore of 10 mm."""
    return revolve([Frustum(0, 14, 20)], [Frustum(0, 14, 5, name="bore", fit=True)], flats={0: "low", 14: "high"})


def gear_cover() -> Body:
    """174 x 70 x 16 mm with three bores of 10 mm, 48 mm apart."""
    holes = [
        Bore((x, 0), (Frustum(0, 1, 8), Frustum(1, 16, 5, name=name, fit=True)), {1: f"{name}_rim"})
        for x, name in _GEARS
    ]
    return extrude(make_rectangle(174, 70), 0, 16, bores=holes, bottom="bottom", top="top")


def _along_x(body: Body) -> Body:
    """A prism over an outline (y, z), drawn along z, as one along x."""
    return body.moved(turn_deg=(90, 0, 90))


def _across_y(body: Body) -> Body:
    """A prism over an outline (x, z), drawn from low to high, as one along -y."""
    return body.moved(turn_deg=(90, 0, 0))


PARTS: Mapping[str, Body] = {
    "bored_plate": bored_plate(),
    "peg": peg(),
    "bracket": bracket(),
    "rod": rod(),
    "housing": housing(),
    "bush": bush(),
    "spindle": spindle(),
    "dovetail_base": dovetail_base(),
    "dovetail_slide": dovetail_slide(),
    "lean_to": lean_to(),
    "wedge": wedge(),
    "pin_plate": pin_plate(),
    "l_plate": l_plate(),
    "gear_base": gear_base(),
    "axle": axle(),
    "stand": stand(),
    "disc": disc(),
    "gear_cover": gear_cover(),
}


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "parts"
    for name, body in PARTS.items():
        write_part(name, body, folder, density=DENSITY, source=SOURCE, licence=LICENCE)


if __name__ == "__main__":
    main()
