"""Assemblies of two to four blocks of random sizes, by which predicted success is calibrated.

They resemble the block scenarios of the benchmark: slots, rails, piles and steps. Lengths are in mm.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import place_on_table, read_posed
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.scenario.parts.making import Body, extrude, join, make_polygon, make_rectangle
from benchmarks.generated import Assembled, Between, Place, write


def block(w: float, d: float, h: float) -> Body:
    return extrude(make_rectangle(w, d, names=("ny", "px", "py", "nx")), 0, h, bottom="bottom", top="top")


def slot(width: float, wide: float, floor: float, deep: float, length: float) -> Body:
    """A prism along x with a slot along it, open above: its middle at the origin."""
    w = wide / 2
    out = width / 2
    top = floor + deep
    section = make_polygon(
        (-out, 0), (out, 0), (out, top), (w, top), (w, floor), (-w, floor), (-w, top), (-out, top),
        names={0: "bottom", 2: "top_p", 3: "slot_p", 4: "floor", 5: "slot_n", 6: "top_n"},
        fit=("slot_p", "floor", "slot_n"),
    )  # fmt: skip
    return extrude(section, -length / 2, length / 2).moved(turn_deg=(90, 0, 90))


def keyed(between: Between, rng: np.random.Generator) -> Assembled:
    """A base with a slot, one or two keys in it, and perhaps a block on top."""
    wide = between(22, 32)
    floor = between(10, 14)
    deep = between(10, 14)
    length = between(70, 100)
    width = round(wide + 2 * between(12, 18), 1)
    high = round(deep + between(14, 22), 1)
    two = rng.uniform() < 0.5
    long = round((length / 2 - between(4, 8)) if two else between(40, 60), 1)
    parts = {"base": slot(width, wide, floor, deep, length), "key": block(long, wide, high)}
    xs = (round(-length / 4, 1), round(length / 4, 1)) if two else (0.0,)
    places = [Place("base", "base", (0, 0, 0)), *(Place("key", f"key_{i}", (x, 0, floor)) for i, x in enumerate(xs, 1))]
    if two or rng.uniform() < 0.5:
        parts["beam"] = block(round(length - 4, 1) if two else long, between(20, 28), between(20, 30))
        places.append(Place("beam", "beam", (0, 0, floor + high)))
    return Assembled(parts, tuple(places))


def capped(between: Between, rng: np.random.Generator) -> Assembled:
    """A base with a rail, a cap whose slot goes over it, a block on the cap."""
    wide = between(18, 26)
    high = between(12, 18)
    length = between(60, 90)
    width = between(60, 80)
    thick = between(10, 14)
    rail = extrude(make_rectangle(length, wide), thick, thick + high, top="ridge").prefixed("rail_")
    base = join(block(width + 30, width + 10, thick), rail)
    outer = between(40, 46)
    top = between(16, 24)
    w = wide / 2
    out = outer / 2
    section = make_polygon(
        (-out, 0), (-w, 0), (-w, high), (w, high), (w, 0), (out, 0), (out, high + top), (-out, high + top),
        names={0: "foot_n", 1: "slot_n", 2: "roof", 3: "slot_p", 4: "foot_p", 6: "top"},
        fit=("slot_p", "slot_n"),
    )  # fmt: skip
    cap = extrude(section, -between(18, 26), between(18, 26)).moved(turn_deg=(90, 0, 90))
    places = [Place("base", "base", (0, 0, 0)), Place("cap", "cap", (0, 0, thick))]
    parts = {"base": base, "cap": cap}
    if rng.uniform() < 0.6:
        parts["load"] = block(between(28, 36), between(26, 34), between(20, 30))
        places.append(Place("load", "load", (0, 0, thick + high + top)))
    return Assembled(parts, tuple(places))


def piled(between: Between, rng: np.random.Generator) -> Assembled:
    """Three or four blocks on each other and side by side on a plate."""
    thick = between(10, 14)
    h = between(22, 30)
    d = between(26, 34)
    w = between(26, 36)
    gap = between(0, 16)
    parts = {"plate": block(between(110, 130), between(60, 80), thick), "post": block(w, d, h)}
    x = round((w + gap) / 2 + 10, 1)
    places = [
        Place("plate", "plate", (0, 0, 0)),
        Place("post", "post_1", (-x, 0, thick)),
        Place("post", "post_2", (x, 0, thick)),
    ]
    parts["beam"] = block(round(2 * x + w - between(0, 10), 1), between(22, 30), between(20, 26))
    places.append(Place("beam", "beam", (0, 0, thick + h)))
    return Assembled(parts, tuple(places))


def stepped(between: Between, rng: np.random.Generator) -> Assembled:
    """A plate with a wall, a block against it, a second one on it, against the wall too."""
    thick = between(10, 14)
    low = between(20, 26)
    high = between(20, 28)
    w = between(30, 40)
    d = between(26, 34)
    wall = round(low + high - between(4, 10), 1)
    upright = extrude(make_rectangle(14, 70, (-47, 0)), thick, thick + wall).prefixed("wall_")
    parts = {
        "plate": join(block(120, 80, thick), upright),
        "low": block(w, d, low),
        "high": block(round(w - between(0, 6), 1), d, high),
    }
    x = round(-40 + w / 2, 2)
    places = [Place("plate", "plate", (0, 0, 0)), Place("low", "low", (x, 0, thick))]
    places.append(Place("high", "high", (x, 0, thick + low)))
    return Assembled(parts, tuple(places))


def tunnelled(between: Between, rng: np.random.Generator) -> Assembled:
    """A block with a tunnel, perhaps a second one behind it, and a stick that is pushed through them, level."""
    w = between(20, 30) / 2
    h = between(24, 32)
    floor = between(10, 16)
    out = w + between(12, 16)
    length = between(40, 56)
    top = floor + h + between(12, 18)
    outside = make_polygon(
        (-out, 0), (out, 0), (out, top), (-out, top), names={0: "bottom", 1: "side_p", 2: "top", 3: "side_n"}
    )
    walls = ("floor", "wall_p", "roof", "wall_n")
    hole = make_polygon(
        (-w, floor), (w, floor), (w, floor + h), (-w, floor + h), names=dict(enumerate(walls)), fit=walls
    )
    tower = extrude(outside, 0, length, holes=[hole]).moved(turn_deg=(90, 0, 90))
    xs = (0.0, round(length + between(10, 20), 1)) if rng.uniform() < 0.5 else (0.0,)
    end = xs[-1] + length
    long = round(end + between(90, 130), 1)
    parts = {"tower": tower, "stick": block(long, round(2 * w, 1), h)}
    places = [Place("tower", f"tower_{i}", (x, 0, 0)) for i, x in enumerate(xs, 1)]
    return Assembled(parts, (*places, Place("stick", "stick", (round(end / 2, 1), 0, floor))))


FAMILIES = (keyed, capped, piled, stepped, tunnelled)


def blocks(seed: int) -> Assembled:
    """Draw the assembly of a seed."""
    rng = np.random.default_rng([seed, 30])
    return FAMILIES[seed % len(FAMILIES)](lambda low, high: round(float(rng.uniform(low, high)), 1), rng)


def scenario_of_blocks(seed: int, folder: Path) -> Path:
    """Write the scenario file of the assembly of a seed."""
    poses = write(blocks(seed), folder)
    path = folder / f"blocks_{seed}.toml"
    made = new_scenario(place_on_table(read_posed(poses)))
    write_scenario(made, path, f"Blocks {seed}", poses.name)
    return path
