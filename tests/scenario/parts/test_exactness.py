"""Random solids of convex pieces with holes: free radius, volume and parameters of faces against formulas."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shapely
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Solid
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import (
    Body,
    Frustum,
    bore,
    build_solid,
    extrude,
    make_circle,
    make_polygon,
    make_rectangle,
    make_slot,
    revolve,
    round_corners,
    write_part,
)

FREE_MM = 0.005
SHARE = 1e-3
SECTOR = [np.array([[1.0, tan], [-tan, 1.0]]) for tan in (-2.0, 2.0)]
"""To both sides of a direction, somewhat less than a quarter of a turn."""


class Wanted(NamedTuple):
    """What a random solid is by its formulas, [mm], before it is moved."""

    body: Body
    volume: float
    walls: dict[str, tuple[tuple[float, float], float, float, float, bool]]
    """Name -> place of the axis, radius, from where to where, hole or shaft."""
    flats: dict[str, tuple[tuple[float, float, float], float]]
    """Name -> normal, distance from the origin."""
    at: np.ndarray
    turn: np.ndarray


def cone(r: float, c: float) -> float:
    """What a chamfer of 45 degrees takes away around a bore."""
    return np.pi * c * (r * c + c * c / 3.0)


def random_plate(rng: np.random.Generator) -> tuple[Body, float, dict, dict]:
    """A rectangle or an L with round corners, and up to four bores, some with chamfers."""
    w = rng.uniform(60, 90)
    d = rng.uniform(50, 80)
    h = rng.uniform(5, 25)
    corner = rng.uniform(2, 5)
    sides: dict = {}
    if rng.random() < 0.5:
        outline = make_rectangle(w, d, names=("ny", "px", "py", "nx"))
        flats = {"ny": ((0, -1, 0), d / 2), "px": ((1, 0, 0), w / 2), "py": ((0, 1, 0), d / 2)}
        area = w * d - (4 - np.pi) * corner**2
        places = [(x, y) for x in (-w / 4, w / 4) for y in (-d / 4, d / 4)]
    else:
        a = w / 2
        b = d / 2
        outline = make_polygon((0, 0), (w, 0), (w, b), (a, b), (a, d), (0, d), names=("foot", "", "ledge", "step"))
        flats = {"foot": ((0, -1, 0), 0.0), "ledge": ((0, 1, 0), b), "step": ((1, 0, 0), a)}
        area = w * b + a * (d - b) - 4 * (4 - np.pi) / 4 * corner**2
        places = [(a / 2, b / 2), (1.5 * a, b / 2), (a / 2, 1.5 * b)]
    flats |= {"top": ((0, 0, 1), h), "bottom": ((0, 0, -1), 0.0)}
    bores = []
    volume = area * h
    for i, at in enumerate(places[: int(rng.integers(1, len(places) + 1))]):
        r = rng.uniform(1.0, 4.0)
        c = rng.choice([0.0, 0.5, 1.0])
        bores.append(bore(at, r, 0, h, f"bore{i}", chamfer_high=c))
        volume -= np.pi * r**2 * h + cone(r, c)
        sides[f"bore{i}"] = (at, r, 0.0, h - c, True)
    return (
        extrude(round_corners(outline, corner, sides=64), 0, h, bores=bores, bottom="bottom", top="top"),
        volume,
        sides,
        flats,
    )


def random_bush(rng: np.random.Generator) -> tuple[Body, float, dict, dict]:
    """A flanged bush with a bore of two widths."""
    r = rng.uniform(1.5, 4)
    wide = rng.uniform(0.5, 2)
    h = rng.uniform(10, 40)
    low = rng.uniform(2, 8)
    R = r + wide + rng.uniform(1, 3)
    flange = rng.uniform(1, 3)
    outer = [Frustum(0, low, R + flange, name="flange"), Frustum(low, h, R, name="outer")]
    inner = [Frustum(0, h / 2, r, name="bore"), Frustum(h / 2, h, r + wide, name="wide")]
    volume = np.pi * (low * (R + flange) ** 2 + (h - low) * R**2 - h / 2 * (r**2 + (r + wide) ** 2))
    walls = {
        "flange": ((0, 0), R + flange, 0, low, False),
        "outer": ((0, 0), R, low, h, False),
        "bore": ((0, 0), r, 0, h / 2, True),
        "wide": ((0, 0), r + wide, h / 2, h, True),
    }
    flats = {"end": ((0, 0, -1), 0.0), "shoulder": ((0, 0, 1), low), "ledge": ((0, 0, 1), h / 2)}
    return revolve(outer, inner, flats={0: "end", low: "shoulder", h / 2: "ledge"}), volume, walls, flats


def random_slotted(rng: np.random.Generator) -> tuple[Body, float, dict, dict]:
    """A disc with a slot with round ends and a round hole that is no bore."""
    R = rng.uniform(22, 28)
    h = rng.uniform(4, 12)
    width = rng.uniform(4, 8)
    r = rng.uniform(2, 6)
    length = width + rng.uniform(4, 12)
    holes = [
        make_slot(length, width, (0, -12), names=("low", "right", "high", "left")),
        make_circle(r, (0, 12), "hole"),
    ]
    flat = np.pi * R**2 - (length - width) * width - np.pi * width**2 / 4 - np.pi * r**2
    walls = {
        "rim": ((0, 0), R, 0, h, False),
        "right": (((length - width) / 2, -12), width / 2, 0, h, True),
        "hole": ((0, 12), r, 0, h, True),
    }
    flats = {"low": ((0, 1, 0), -12 - width / 2), "top": ((0, 0, 1), h)}
    return extrude(make_circle(R, name="rim"), 0, h, holes=holes, top="top"), flat * h, walls, flats


def random_solid(seed: int) -> Wanted:
    rng = np.random.default_rng(seed)
    body, volume, walls, flats = (random_plate, random_bush, random_slotted)[seed % 3](rng)
    at = rng.uniform(-100, 100, 3)
    turn = rng.uniform(-180, 180, 3)
    return Wanted(body.moved(at, turn), volume, walls, flats, at, turn)


def free_radius(solid: Solid, origin: np.ndarray, R: np.ndarray, length: float, hole: bool, toward) -> float:
    """How near to an axis pieces come along a length, as shadows along it; of a shaft, how far from it they reach."""
    pieces = [(piece.corners - origin) @ R for piece in solid.pieces]
    pieces = [x for x in pieces if x[:, 2].min() < length - 1e-7 and x[:, 2].max() > 1e-7]
    if not hole:
        return max(float(np.linalg.norm(x[:, :2], axis=1).max()) for x in pieces)
    owner = np.repeat(np.arange(len(pieces)), [len(x) for x in pieces])
    shadows = shapely.convex_hull(shapely.multipoints(np.concatenate(pieces)[:, :2], indices=owner))
    if toward is not None:
        way = (toward @ R)[:2]
        shadows = shapely.intersection(shadows, shapely.Polygon([(0, 0), *(way @ turn for turn in SECTOR)]))
        shadows = shadows[~shapely.is_empty(shadows)]
    return float(shapely.distance(shadows, shapely.Point(0, 0)).min())


def check_walls(solid: Solid, wanted: Wanted) -> None:
    R = Rotation.from_euler("xyz", wanted.turn, degrees=True).as_matrix()
    t = 1e-3 * wanted.at
    for name, (place, radius, low, high, hole) in wanted.walls.items():
        wall = solid.rounds[name]
        ends = [R @ (1e-3 * np.array([*place, z])) + t for z in (low, high)]
        assert wall.ends == pytest.approx(np.array(ends), abs=1e-10)
        assert (wall.radius, wall.hole) == (pytest.approx(1e-3 * radius, abs=1e-12), hole)
        found = 1e3 * free_radius(solid, ends[0], R, 1e-3 * (high - low), hole, wall.toward)
        assert found == pytest.approx(radius, abs=FREE_MM)
    for name, (normal, distance) in wanted.flats.items():
        face = solid.faces[name]
        n = R @ normal
        assert face.normal == pytest.approx(n, abs=1e-9)
        assert face.outline @ n == pytest.approx(np.full(len(face.outline), 1e-3 * distance + n @ t), abs=1e-10)


@pytest.mark.parametrize("seed", range(15))
def test_random_solids_are_as_their_formulas_say(seed: int, tmp_path: Path):
    wanted = random_solid(seed)
    solid = build_solid("thing", wanted.body)
    if seed % 15 < 1:
        solid = load_part(write_part("thing", wanted.body, tmp_path, source="a test", licence="Apache-2.0"))
    assert 1e9 * solid.volume == pytest.approx(wanted.volume, rel=1e-9)
    check_walls(solid, wanted)
    pieces = sum(ConvexHull(piece.corners).volume for piece in solid.pieces)
    room = SHARE * solid.volume + 1e-3 * FREE_MM * wall_area(wanted)
    assert pieces == pytest.approx(solid.volume, abs=room)


def wall_area(wanted: Wanted) -> float:
    """Of all round walls, [m^2]."""
    return sum(2 * np.pi * 1e-3 * r * 1e-3 * (b - a) for _, r, a, b, _ in wanted.walls.values())
