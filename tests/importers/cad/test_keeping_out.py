"""Hulls of hollow shapes keep out of what lies in the hollow, line to line as it may be drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from apo_bench.importers.cad.assembled import mates_of
from apo_bench.importers.cad.pieces.cut_part import CutPart
from apo_bench.importers.cad.pieces.keeping_out import keeping_out
from apo_bench.importers.cad.solids.bodies import mesh_of
from apo_bench.importers.cad.solids.raw_solid import RawSolid, SolidPlace
from tests.importers.cad.made import block

CORE = block(20, 20, 30)
CHANNEL = block(40, 40, 20) - CORE
NO_PLANES = np.zeros((0, 4))


def raw_of(name: str, body: Any, *at: tuple[float, float, float]) -> RawSolid:
    places = []
    for k, place in enumerate(at or ((0.0, 0.0, 0.0),)):
        T = np.eye(4)
        T[:3, 3] = place
        places.append(SolidPlace(f"{name}{k}", T))
    return RawSolid(name, mesh_of(body), tuple(places))


def test_a_hull_is_cut_along_the_faces_of_what_it_would_fill() -> None:
    part = CutPart(CHANNEL, NO_PLANES)
    assert (CHANNEL.hull() ^ CORE).volume() == pytest.approx(8000.0)
    pieces = [*keeping_out([part], CHANNEL, CORE, 1e-4)]
    assert len(pieces) >= 4
    hulls = Manifold()
    for piece in pieces:
        hulls += piece.body.hull()
    assert (hulls ^ CORE).volume() == pytest.approx(0.0, abs=0.5)
    assert hulls.volume() == pytest.approx(CHANNEL.volume(), rel=1e-3)


def test_what_reaches_in_a_little_is_trimmed_and_what_is_drawn_inside_stays() -> None:
    solid = block(20, 20, 10) + block(10, 10, 0.004, (0, 0, 10))
    mate = block(60, 60, 10, (0, 0, 10))
    # A hull that bridges the step reaches into what is beside it, as thin as that is.
    mate -= block(10, 10, 0.004, (0, 0, 10))
    (piece,) = keeping_out([CutPart(solid, NO_PLANES)], solid, mate, 1e-5)
    assert (piece.body.hull() ^ mate).volume() < 1e-3
    assert piece.body.hull().volume() > 0.99 * solid.volume()
    deep = block(20, 20, 10, (0, 0, 5))
    whole = block(20, 20, 10)
    (same,) = keeping_out([CutPart(whole, NO_PLANES)], whole, deep, 1e-5)
    assert same.body.volume() == whole.volume()


def test_mates_are_others_and_other_copies_near_a_place() -> None:
    base = raw_of("base", block(40, 40, 10))
    cube = raw_of("cube", block(10, 10, 10), (0, 0, 10), (0, 10, 10), (500, 0, 0))
    of_base, of_cube = mates_of([base, cube])
    # Of what lies beside it only what is around a solid is kept: a margin of 1.5 mm.
    assert of_base.volume() == pytest.approx(10 * 20 * 1.5)
    assert of_cube.volume() == pytest.approx(13 * 1.5 * 13 + 2 * 10 * 1.5 * 10, rel=0.1)
