"""Parts as they are made: fit faces recede by the clearance, nothing else moves."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import Face, Hull, Solid, shrink_pieces
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.box_union import SIDES, unite
from apo_bench.scenario.parts.fit_faces import mark_fit_faces
from apo_bench.scenario.parts.making import bore, build_solid, extrude, make_rectangle, make_shaft
from tests.round_parts import countersunk


@pytest.mark.parametrize("clearance_mm", [0.25])
def test_a_pocket_is_wider_and_has_no_crack(clearance_mm: float):
    """The union of the physical boxes is again one solid with two plain pockets, as deep as before."""
    c = 1e-3 * clearance_mm
    solid = load_part("table_pockets")
    boxes = shrink_pieces(solid, c)
    assert [box.name for box in boxes] == [box.name for box in solid.pieces]
    union = unite(boxes)
    wide = 0.05 + 2 * c
    assert union.volume == pytest.approx(1.4 * 1.2 * 0.02 - 2 * wide**2 * 0.006, rel=1e-9)
    assert union.pieces == 1
    floors = [s.shape for s in union.surfaces if SIDES[s.side] == "pz" and abs(s.height + 0.006) < 1e-9]
    assert sorted(f.bounds for f in floors) == [
        pytest.approx((x - wide / 2, 0.15 - wide / 2, x + wide / 2, 0.15 + wide / 2)) for x in (-0.06, 0.06)
    ]


def test_a_side_with_a_fit_face_and_another_cannot_recede():
    bar = load_part("stick").pieces[0]
    halves = {
        name: Face(
            name,
            np.array([(x, -0.01, 0.01), (x + 0.11, -0.01, 0.01), (x + 0.11, 0.01, 0.01), (x, 0.01, 0.01)]),
            fit=fit,
        )
        for name, x, fit in (("left", -0.11, True), ("right", 0.0, False))
    }
    with pytest.raises(InputError, match="'left' and the face 'right'"):
        shrink_pieces(Solid("odd", halves, (bar,), np.zeros(3), bar.half.prod() * 8), 1e-4)


def layered(thin_m: float) -> Solid:
    """A cube of 20 mm of two pieces, of which the upper one is thin and has the fit face."""

    def slab(name: str, low: float, high: float) -> Hull:
        return Hull(name, np.array(list(product((-0.01, 0.01), (-0.01, 0.01), (low, high)))))

    top = Face(
        "top", np.array([[-0.01, -0.01, 0.02], [0.01, -0.01, 0.02], [0.01, 0.01, 0.02], [-0.01, 0.01, 0.02]]), ()
    )
    pieces = (slab("thick", 0.0, 0.02 - thin_m), slab("thin", 0.02 - thin_m, 0.02))
    return Solid("cube", {"top": replace(top, fit=True)}, pieces, np.array([0.0, 0.0, 0.01]), 8e-6)


def test_a_piece_that_is_hardly_any_of_a_part_recedes_to_nothing():
    (left,) = shrink_pieces(layered(1.5e-4), 2.5e-4)
    assert left.name == "thick"
    assert [piece.name for piece in shrink_pieces(layered(1.5e-4), 2e-5)] == ["thick", "thin"]
    with pytest.raises(InputError, match=r"leaves less than 0\.1 mm of piece 'thin' of part 'cube'"):
        shrink_pieces(layered(2.5e-4), 2.5e-4)


@pytest.mark.parametrize("clearance_mm", [0.1, 0.25, 1.2])
def test_chamfers_of_a_fit_shaft_stay_out_of_its_play(clearance_mm: float):
    """Also a chamfer that is smaller than the clearance."""
    chamfered = build_solid("pin", make_shaft(4, 0, 30, "side", chamfer_low=1, chamfer_high=1))
    pin = mark_fit_faces(chamfered, {"side": 0.0})
    thinner = 4.0 - clearance_mm
    for nominal, piece in zip(pin.pieces, shrink_pieces(pin, 1e-3 * clearance_mm), strict=True):
        distance = 1e3 * np.hypot(*piece.corners[:, :2].T)
        assert distance.max() < thinner + 1e-6
        assert np.ptp(piece.corners[:, 2]) == pytest.approx(np.ptp(nominal.corners[:, 2]), abs=1e-9)
        # The cone itself does not recede: the tip is as wide as before where it is thinner than the shaft.
        if distance.max() > 3.0 and np.ptp(nominal.corners[:, 2]) < 2e-3:
            assert distance.min() == pytest.approx(min(3.0, thinner), rel=0.02)


def test_a_countersink_of_a_fit_hole_widens_with_it():
    step = bore((0, 0), 4, 0, 20, "bore", chamfer_high=1, fit=True)
    plate = build_solid("plate", extrude(make_rectangle(40, 40), 0, 20, bores=[step]))
    pieces = shrink_pieces(plate, 2.5e-4)
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    for height, free in ((0.01, 4.25), (0.0191, 4.25), (0.0199, 4.9)):
        for radius, inside in ((free - 0.01, False), (free + 0.2, True)):
            at = np.column_stack([1e-3 * radius * np.cos(angle), 1e-3 * radius * np.sin(angle), np.full(90, height)])
            depth = [(piece.planes[:, 3] - at @ piece.planes[:, :3].T).min(axis=1) for piece in pieces]
            assert (np.max(depth, axis=0) > 0.0).all() == inside, (height, radius)


def test_a_conical_seat_that_is_fit_recedes_and_its_bore_stays():
    """A cone of 45 degrees from 3 mm at 14 mm to 9 mm at 20 mm; 0.25 mm across it are 0.35 mm more radius."""
    pieces = shrink_pieces(mark_fit_faces(countersunk(), {"sink": 0.0}), 2.5e-4)
    for height_mm, free_mm in ((7.0, 3.0), (16.0, 5.0 + 0.25 * np.sqrt(2.0)), (18.0, 7.0 + 0.25 * np.sqrt(2.0))):
        for radius_mm, inside in ((free_mm - 0.02, False), (free_mm + 0.02, True)):
            turn = np.radians(2.5)  # the middle of a side
            at = 1e-3 * np.array([radius_mm * np.cos(turn), radius_mm * np.sin(turn), height_mm])
            depth = max((piece.planes[:, 3] - piece.planes[:, :3] @ at).min() for piece in pieces)
            assert (depth > 0.0) == inside, (height_mm, radius_mm)
