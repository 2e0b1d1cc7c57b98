"""Assemblies of three to eight parts with random dimensions: part files, poses, and scenarios without manual work.

Plates, pins, bushes, brackets, covers, slots and rings; lengths in mm. `generated_rates.py` measures them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import place_on_table, read_posed
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.scenario.parts.making import (
    Body,
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

DENSITY = 700.0


class Place(NamedTuple):
    """The final pose of a copy of a part."""

    part: str
    name: str
    at_mm: tuple[float, float, float]
    quaternion_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class Assembled(NamedTuple):
    """An assembly as a CAD program exports it."""

    parts: Mapping[str, Body]
    places: tuple[Place, ...]


def generated(seed: int) -> Assembled:
    """Draw the assembly of a seed."""
    rng = np.random.default_rng([seed, 18])
    return FAMILIES[seed % len(FAMILIES)](lambda low, high: round(float(rng.uniform(low, high)), 1), rng)


Between = Callable[[float, float], float]


def pinned(between: Between, rng: np.random.Generator) -> Assembled:
    """A plate, two or three pins through it, a cover over them."""
    width = between(84, 110)
    depth = between(46, 60)
    thick = between(14, 20)
    r = between(3.5, 5.5)
    play = between(0.2, 0.4)
    cover = between(9, 13)
    length = round(thick + cover + between(14, 22), 1)
    xs = [-width / 2 + 16, width / 2 - 16] + ([0.0] if rng.uniform() < 0.5 else [])
    ys = [0.0, 0.0, round(depth / 2 - 14, 1)]
    at = list(zip(xs, ys, strict=False))

    def plate(w: float, d: float, h: float, radius: float) -> Body:
        bores = [bore(xy, radius, 0, h, f"bore_{i}") for i, xy in enumerate(at, start=1)]
        return extrude(make_rectangle(w, d), 0, h, bores=bores, bottom="bottom", top="top")

    pin = make_shaft(r, 0, length, "side", chamfer_low=0.5, chamfer_high=1, bottom="tip", top="head")
    parts = {
        "plate": plate(width, depth, thick, r + play),
        "pin": pin,
        "cover": plate(width - 4, depth - 4, cover, r + play),
    }
    pins = [Place("pin", f"pin_{i}", (x, y, 0)) for i, (x, y) in enumerate(at, start=1)]
    return Assembled(parts, (Place("plate", "plate", (0, 0, 0)), *pins, Place("cover", "cover", (0, 0, thick))))


def bushed(between: Between, rng: np.random.Generator) -> Assembled:
    """A block, two bushes with a collar in it, a pin with a head in each."""
    width = between(90, 110)
    thick = between(24, 32)
    r = between(4, 5.5)
    outer = round(r + between(5, 7), 1)
    play = between(0.2, 0.4)
    flange = between(14, 18)
    bores = [bore((x, 0), outer + play, 0, thick, f"bore_{i}") for i, x in enumerate((-width / 4, width / 4), start=1)]
    block = extrude(make_rectangle(width, between(44, 56)), 0, thick, bores=bores, bottom="bottom", top="top")
    inner = [Frustum(0, thick + flange, r + play, name="bore")]
    walls = [Frustum(0, thick, outer, name="side"), Frustum(thick, thick + flange, outer + 4, name="rim")]
    bush = revolve(walls, inner, flats={0.0: "tip", thick: "ledge", thick + flange: "face"})
    long = thick + flange - 2
    head = between(12, 16)
    pin = revolve(
        [Frustum(0, long, r, name="side"), Frustum(long, long + head, r + 3, name="grip")],
        flats={0.0: "tip", long: "ledge", long + head: "head"},
    )
    places = [Place("block", "block", (0, 0, 0))]
    for i, x in enumerate((-width / 4, width / 4), start=1):
        places += [Place("bush", f"bush_{i}", (x, 0, 0)), Place("pin", f"pin_{i}", (x, 0, 2))]
    return Assembled({"block": block, "bush": bush, "pin": pin}, tuple(places))


def bracketed(between: Between, rng: np.random.Generator) -> Assembled:
    """Two brackets on the pegs of a plate, a shaft through both."""
    thick = between(12, 16)
    play = between(0.2, 0.35)
    far = between(30, 40)
    r = 2.0 * float(rng.integers(3, 5))
    high = between(34, 42)
    peg = between(3, 4)
    width = between(34, 40)
    plate = extrude(make_rectangle(150, width + 20), 0, thick, bottom="bottom", top="top")
    pegs = [
        make_shaft(peg, thick, thick + 12, "peg", chamfer_high=1).moved((x, y, 0)).prefixed(f"p{i}_")
        for i, (x, y) in enumerate([(s * (far + 20), t * 9.0) for s in (-1, 1) for t in (-1, 1)], start=1)
    ]
    holes = [bore((20 - 25, t * 9.0), peg + play, 0, 10, f"hole_{i}") for i, t in enumerate((-1, 1), start=1)]
    foot = extrude(make_rectangle(50, width), 0, 10, bores=holes, bottom="bottom", top="tread")
    wall = extrude(
        make_rectangle(high + r + 12 - 10, width, (-(high + r + 12 + 10) / 2, 0)),
        0,
        12,
        bores=[bore((-high, 0), r + play, 0, 12, "bore")],
        bottom="wx",
        top="wn",
    )
    bracket = join(foot, wall.moved(turn_deg=(0, 90, 0)).moved((-25, 0, 0)))
    length = round(2 * far + 24 + between(10, 20), 1)
    head = extrude(make_rectangle(2 * r, 2 * r), -22, 0, bottom="end")
    rod = join(head, make_shaft(r, 0, length, "side", chamfer_high=1, top="tip")).moved(turn_deg=(0, 90, 0))
    half = (0.0, 0.0, 0.0, 1.0)
    places = (
        Place("plate", "plate", (0, 0, 0)),
        Place("bracket", "bracket_1", (far + 25, 0, thick)),
        Place("bracket", "bracket_2", (-far - 25, 0, thick), half),
        Place("rod", "rod", (-far - 14, 0, thick + high)),
    )
    return Assembled({"plate": join(plate, *pegs), "bracket": bracket, "rod": rod}, places)


def slotted(between: Between, rng: np.random.Generator) -> Assembled:
    """A base with a slot, a key in it, pins in the key, rings over the pins."""
    wide = between(24, 32)
    deep = between(10, 14)
    length = between(70, 90)
    r = between(3.5, 5)
    side = between(14, 20)
    floor = between(10, 14)
    play = between(0.2, 0.35)
    w = wide / 2
    out = wide / 2 + side
    top = floor + deep
    section = make_polygon(
        (-out, 0), (out, 0), (out, top), (w, top), (w, floor), (-w, floor), (-w, top), (-out, top),
        names={0: "bottom", 3: "slot_p", 4: "floor", 5: "slot_n"},
        fit=("slot_p", "floor", "slot_n"),
    )  # fmt: skip
    base = extrude(section, -length / 2, length / 2).moved(turn_deg=(90, 0, 90))
    high = round(deep + between(8, 12), 1)
    xs = (-length / 4, length / 4)
    blind = [bore((x, 0), r + play, 0, high, f"bore_{i}") for i, x in enumerate(xs, start=1)]
    key = extrude(
        make_rectangle(length, wide, names=("ny", "px", "py", "nx")), 0, high, bores=blind, bottom="bottom", top="top"
    )
    pin = make_shaft(
        r, 0, round(high + between(24, 30), 1), "side", chamfer_low=0.5, chamfer_high=1, bottom="tip", top="head"
    )
    thick = between(10, 14)
    ring = revolve(
        [Frustum(0, thick, r + between(6, 8), name="side")],
        [Frustum(0, thick, r + play, name="bore")],
        flats={0.0: "bottom", thick: "top"},
    )
    places = [Place("base", "base", (0, 0, 0)), Place("key", "key", (0, 0, floor))]
    places += [Place("pin", f"pin_{i}", (x, 0, floor)) for i, x in enumerate(xs, start=1)]
    places += [Place("ring", f"ring_{i}", (x, 0, floor + high)) for i, x in enumerate(xs, start=1)]
    return Assembled({"base": base, "key": key, "pin": pin, "ring": ring}, tuple(places[: 4 + int(rng.integers(0, 3))]))


def stacked(between: Between, rng: np.random.Generator) -> Assembled:
    """A foot with a post, rings and plates over it, a cap on top."""
    r = between(7, 9)
    play = between(0.2, 0.4)
    thick = between(12, 16)
    count = int(rng.integers(2, 4))
    heights = [between(12, 18) for _ in range(3)]
    post = thick + sum(heights[:count]) + 8
    foot = join(
        extrude(make_rectangle(between(90, 110), between(70, 90)), 0, thick, bottom="bottom", top="top"),
        make_shaft(r, thick, post, "post", chamfer_high=1.5, top="end"),
    )
    parts: dict[str, Body] = {"foot": foot}
    places = [Place("foot", "foot", (0, 0, 0))]
    z = thick
    for i, h in enumerate(heights[:count], start=1):
        hole = [bore((0, 0), r + play, 0, h, "bore")]
        parts[f"plate_{i}"] = extrude(
            make_rectangle(between(50, 64), between(40, 50)), 0, h, bores=hole, bottom="bottom", top="top"
        )
        places.append(Place(f"plate_{i}", f"plate_{i}", (0, 0, round(z, 1))))
        z += h
    inner = [Frustum(0, 10, r + play, name="bore")]
    parts["cap"] = revolve(
        [Frustum(0, 24, r + 8, name="side")], inner, flats={0.0: "bottom", 10.0: "roof", 24.0: "top"}
    )
    places.append(Place("cap", "cap", (0, 0, round(z, 1))))
    return Assembled(parts, tuple(places))


FAMILIES = (pinned, bushed, bracketed, slotted, stacked)


def write(made: Assembled, folder: Path) -> Path:
    """Write part files and poses, and return the file of poses."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, body in made.parts.items():
        write_part(name, body, folder, density=DENSITY, source="benchmarks/generated.py", licence="CC0-1.0")
    tables = [
        f'[[pose]]\npart = "{p.part}"\nname = "{p.name}"\nat_mm = {list(p.at_mm)}\n'
        f"quaternion_wxyz = {list(p.quaternion_wxyz)}\n"
        for p in made.places
    ]
    path = folder / "poses.toml"
    path.write_text("\n".join(tables), encoding="utf-8")
    return path


def scenario_of(seed: int, folder: Path) -> Path:
    """Write the scenario file of the assembly of a seed."""
    poses = write(generated(seed), folder)
    path = folder / f"generated_{seed}.toml"
    made = new_scenario(place_on_table(read_posed(poses)))
    write_scenario(made, path, f"Generated assembly {seed}", poses.name)
    return path
