"""Parts that are built: written, read again, and held against exact formulas and against MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
import shapely

from apo_bench import InputError
from apo_bench.geometry import Box
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import (
    Body,
    Frustum,
    bore,
    build_solid,
    extrude,
    join,
    make_polygon,
    make_rectangle,
    make_shaft,
    make_slot,
    revolve,
    round_corners,
    write_part,
)


def plate() -> Body:
    hole = bore((5, -3), 5.1, 0, 20, "bore", fit=True, chamfer_high=0.5)
    sides = make_rectangle(60, 40, names=("ny", "px", "py", "nx"))
    return extrude(sides, 0, 20, bores=[hole], bottom="bottom", top="top")


def base() -> Body:
    blind = [bore((x, y), 4.05, 5, 15, f"b{i}") for i, (x, y) in enumerate([(-30, 0), (0, 10), (30, 0)])]
    return extrude(
        make_rectangle(120, 80),
        0,
        15,
        bores=[*blind, bore((50, 30), 2, 0, 15)],
        holes=[make_slot(30, 8, (0, -25), names=("s1", "s2", "s3", "s4"))],
        top="top",
    )


def bush() -> Body:
    outer = [Frustum(0, 3, 9, name="flange"), Frustum(3, 20, 7, name="outer")]
    return revolve(outer, [Frustum(0, 20, 5, name="inner", fit=True)], flats={0: "low", 3: "shoulder", 20: "high"})


def pins() -> Body:
    pin = make_shaft(4, 10, 20, "pin", chamfer_high=1, top="top")
    plate = extrude(make_rectangle(60, 40), 0, 10, top="top")
    return join(plate, *(pin.moved((x, 0, 0)).prefixed(side) for x, side in ((15, "right_"), (-15, "left_"))))


BODIES: Mapping[str, Body] = {
    "plate": plate(),
    "tilted": plate().moved((10, 20, 30), (30, 40, 50)),
    "base": base(),
    "bush": bush(),
    "pins": pins(),
    "peg": make_shaft(5, 0, 50, "peg", chamfer_low=0.5, bottom="tip", top="head"),
    "bracket": extrude(round_corners(make_polygon((0, 0), (60, 0), (60, 10), (10, 10), (10, 40), (0, 40)), 3), 0, 20),
    "dovetail": extrude(
        make_polygon((-10, 0), (10, 0), (16, 10), (-16, 10), names=("b", "r", "t", "l"), fit=("r",)), 0, 40
    ),
    "taper": revolve([Frustum(0, 20, 10, 5, name="cone")], flats={0: "low", 20: "high"}),
    "stairs": join(
        extrude(make_rectangle(60, 40), 0, 10, top="tread"), extrude(make_rectangle(20, 40, (-20, 0)), 10, 30)
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_a_part_that_is_written_is_read_as_the_same_solid(name: str, tmp_path: Path):
    wanted = build_solid(name, BODIES[name])
    path = write_part(name, BODIES[name], tmp_path, density=2700.0, source="a test", licence="Apache-2.0")
    found = load_part(path)
    assert found.volume == pytest.approx(wanted.volume, rel=1e-9)
    assert found.centroid == pytest.approx(wanted.centroid, abs=1e-10)
    assert [type(p) for p in found.pieces] == [type(p) for p in wanted.pieces]
    for piece, same in zip(found.pieces, wanted.pieces, strict=True):
        assert piece.corners == pytest.approx(same.corners, abs=1e-11)
    assert set(found.faces) == set(wanted.faces)
    for name, face in wanted.faces.items():
        assert found.faces[name].normal == pytest.approx(face.normal, abs=1e-7)
        assert found.faces[name].plane == pytest.approx(face.plane, abs=1e-7)
        assert found.faces[name].fit == face.fit
    assert set(found.rounds) == set(wanted.rounds)
    for name, wall in wanted.rounds.items():
        same = found.rounds[name]
        assert (same.kind, same.hole, same.fit) == (wall.kind, wall.hole, wall.fit)
        assert same.ends == pytest.approx(wall.ends, abs=1e-10)
        assert same.radii == pytest.approx(wall.radii, abs=1e-10)
        assert same.extent_rad == pytest.approx(wall.extent_rad, abs=1e-9)
    if not all(isinstance(piece, Box) for piece in found.pieces):
        assert found.inertia == pytest.approx(wanted.inertia, rel=1e-9, abs=1e-20)


def test_a_rim_is_a_face_of_its_own(tmp_path: Path):
    body = plate().with_rim("rim", (5, -3, 0), (0, 0, -1), 5.1)
    solid = load_part(write_part("rimmed", body, tmp_path, source="a test", licence="Apache-2.0"))
    assert solid.rounds["rim"].kind == "rim"
    wrong = plate().with_rim("rim", (5, -3, 0), (0, 0, -1), 5.0)
    with pytest.raises(InputError, match="faces, rim: pieces lie along 0%"):
        load_part(write_part("wrong", wrong, tmp_path, source="a test", licence="Apache-2.0"))


def test_a_bore_without_room_for_wedges_is_a_hole_like_others(tmp_path: Path):
    outline = make_polygon((0, 0), (30, 0), (30, 30), (15, 15.08), (0, 30))
    body = extrude(outline, 0, 8, bores=[bore((15, 8), 7.0, 0, 8, "bore")])
    solid = load_part(write_part("tight", body, tmp_path, source="a test", licence="Apache-2.0"))
    assert list(solid.rounds) == ["bore"]
    axis = shapely.Point(0.015, 0.008)
    gaps = [shapely.MultiPoint(piece.corners[:, :2]).convex_hull.distance(axis) for piece in solid.pieces]
    assert min(gaps) == pytest.approx(0.007, abs=1e-9)
    with pytest.raises(ValueError, match="no convex area around the bore"):
        extrude(outline, 0, 8, bores=[bore((15, 8), 7.0, 2, 8, sides=96)])
