"""Contact states, macros and ways of round and tilted faces."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from apo_bench import Assembly
from apo_bench.assembly import Operation, placements
from apo_bench.geometry import Array, Box, RoundFace, Solid
from apo_bench.planning.insertion.arrival import Arrival, OperationMacros, Preference, arrive, turning_state, understand
from apo_bench.planning.insertion.macros import Way, chain
from apo_bench.planning.insertion.surroundings import later_walls, mouths, slide_directions, slow_before
from tests import rounds
from tests.brackets import on_pins, under_roof
from tests.scenes import Scene, cuboid, mm, touch

X, Y, Z = np.eye(3)


@lru_cache
def built(name: str) -> Scene:
    return rounds.ALL[name]()


@lru_cache
def last_of(made: Scene) -> OperationMacros:
    return understand(made.assembly, made.start, made.goals)[-1]


def poses_of(made: Scene) -> dict[str, Array]:
    return dict(placements(made.assembly, made.start, made.goals)[-1])


def told(found: Arrival) -> list[tuple[str, list[float]]]:
    return [(macro.name, np.round(macro.direction, 6).tolist()) for macro in found.macros]


DOWN = [0.0, 0.0, -1.0]
INTO = "insert-into"


@pytest.mark.parametrize(
    ("name", "letter", "macros", "length_mm"),
    [
        ("peg_in_plate", "H", [(INTO, DOWN), ("move-to-bottom", DOWN)], 20),
        ("through", "E", [(INTO, [0.0, -1.0, 0.0])], 100),
        ("in_groove", "C", [("move-to-contact", DOWN)], None),
        ("on_table", "A", [("move-to-contact", DOWN)], None),
        ("countersink", "H", [(INTO, DOWN), ("move-to-bottom", DOWN)], 6),
        ("on_rim", "H", [(INTO, DOWN), ("move-to-bottom", DOWN)], 2),
        ("wedges_meet", "A", [("move-to-contact", DOWN)], None),
        ("dovetail", "E", [(INTO, [1.0, 0.0, 0.0])], 80),
    ],
)
def test_states_and_macros(name: str, letter: str, macros: list, length_mm: float | None) -> None:
    found = last_of(built(name)).after
    assert (found.state.letter, told(found), found.free) == (letter, macros, True)
    far = found.macros[0].length_m
    assert far == (None if length_mm is None else pytest.approx(1e-3 * length_mm, abs=1e-6))
    made = [found.contacts(macro) for macro in found.macros]
    assert all(len(of) == len(set(of)) for of in made)
    assert {contact for of in made for contact in of} == {each.contact for each in found.touched}


@pytest.mark.parametrize(
    ("name", "screw"),
    [
        ("through", (2, 0, 4)),
        ("peg_in_plate", (1, 1, 4)),
        ("in_groove", (2, 4, 0)),
        ("on_rim", (3, 1, 2)),
        ("dovetail", (1, 0, 5)),
    ],
)
def test_what_turns_freely(name: str, screw: tuple[int, int, int]) -> None:
    """A shaft turns in its hole, a cone on a rim about all axes: as many directions are kept as no row fixes."""
    made = built(name)
    assert turning_state(made.assembly, last_of(made).after, poses_of(made)).all == screw


def test_axes_are_along_the_shaft_and_across() -> None:
    position, felt, across = last_of(built("through")).after.axes
    assert (abs(position @ Y).item(), len(felt)) == (pytest.approx(1.0), 0)
    assert across @ Y == pytest.approx(np.zeros(2), abs=1e-12)
    position, felt, across = last_of(built("peg_in_plate")).after.axes
    assert (len(position), felt.tolist(), across.tolist()) == (0, [DOWN], [[1, 0, 0], [0, 1, 0]])
    position, felt, _ = last_of(built("wedges_meet")).after.axes
    assert (np.linalg.matrix_rank(position), felt.tolist()) == (2, [DOWN])
    slope = [0.0, -np.sin(np.radians(30)), np.cos(np.radians(30))]
    assert position @ slope == pytest.approx(np.zeros(2), abs=1e-9)


def test_a_state_does_not_depend_on_where_the_assembly_lies() -> None:
    """Ways do: a part comes from above where it can."""
    turned = mm(0, 0, 300, (20, 50, 80))
    for name in ("peg_in_plate", "through", "countersink", "dovetail"):
        made = built(name)
        poses = {part: turned @ T for part, T in poses_of(made).items()}
        operation = made.assembly.operations[-1]
        found = arrive(made.assembly, operation.moves, operation.contacts, poses)
        before = last_of(made).after
        assert (found.state, [m.name for m in found.macros]) == (before.state, [m.name for m in before.macros])
        axis = turned[:3, :3] @ before.macros[0].direction
        assert abs(found.macros[0].direction @ axis) == pytest.approx(1.0, abs=1e-6)


def test_a_shaft_comes_by_the_end_of_its_bore_that_is_free() -> None:
    made = built("through")
    stop = {"stop": cuboid("stop", (20, 20, 20))}
    for y, way in ((180.0, 1.0), (-180.0, -1.0)):
        of = replace(made.assembly, solids={**made.assembly.solids, **stop}, fixed=frozenset({"table", "stop"}))
        operation = of.operations[-1]
        found = arrive(of, operation.moves, operation.contacts, poses_of(made) | {"stop": mm(0, y, 30)})
        assert found.free
        assert told(found) == [(INTO, [0.0, way, 0.0])]
    across = arrive(of, operation.moves, operation.contacts, poses_of(made) | {"stop": mm(0, 500, 30)}, Preference(X))
    assert abs(across.macros[0].direction[1]) == pytest.approx(1.0), "a line through a wall is not followed"


def trough(extent_deg: float) -> RoundFace:
    """A piece of the wall of a hole of 5 mm along x, open upwards."""
    radii = (0.005, 0.005)
    far = np.radians(extent_deg)
    return RoundFace("bed", np.zeros(3), X, (-0.02, 0.02), radii, True, extent_rad=far, toward=-Z)


@pytest.mark.parametrize(
    ("extent_deg", "letter", "macros"),
    [
        (120, "C", ["move-to-contact"]),
        (180, "D", ["insert-into-slot", "move-to-contact"]),
        (360, "E", ["insert-into"]),
    ],
)
def test_a_part_of_a_wall_holds_as_far_as_it_reaches(extent_deg: float, letter: str, macros: list[str]) -> None:
    bed = Solid(
        "bed", {}, (Box("b", -0.02 * Z, np.array([0.02, 0.02, 0.014])),), -0.02 * Z, 1e-6, {"bed": trough(extent_deg)}
    )
    contact = touch("peg", "bed", "wall-bed")
    of = Assembly({"bed": bed, "peg": rounds.peg()}, (Operation("peg", contact),), frozenset({"bed"}))
    poses = {"bed": np.eye(4), "peg": mm(-25, 0, 0, (0, 90, 0))}
    found = arrive(of, ("peg",), contact, poses)
    assert (found.state.letter, [m.name for m in found.macros]) == (letter, macros)
    assert all(found.contacts(macro) == contact for macro in found.macros)
    other = arrive(of, ("bed",), contact, poses)
    assert other.state == found.state, "whichever of the two moves"


def test_a_bracket_goes_down_over_two_pins() -> None:
    """Its wall reaches higher than the pins; their chamfers are no contact, and in the way of nothing."""
    made = on_pins()
    found = last_of(made).after
    assert (found.state.letter, told(found), found.free) == ("H", [(INTO, DOWN), ("move-to-bottom", DOWN)], True)
    assert found.macros[0].length_m == pytest.approx(0.029, abs=1e-4), "beyond which the chamfers are loose"
    assert [len(found.contacts(macro)) for macro in found.macros] == [2, 1]
    assert turning_state(made.assembly, found, poses_of(made)).all == (0, 1, 5), "two pins let nothing turn"


@pytest.mark.parametrize("turned", [False, True])
def test_a_wedge_is_slid_under_its_roof(turned: bool) -> None:
    """Up leads into the roof, so it comes level; the order of the contacts does not matter."""
    made = under_roof(30.0)
    (operation,) = made.assembly.operations
    contacts = operation.contacts[::-1] if turned else operation.contacts
    found = arrive(made.assembly, ("wedge",), contacts, made.start | {"wedge": made.goals[0]})
    assert (found.state.letter, found.free) == ("C", True)
    in_ = [0.0, -1.0, 0.0] if found.macros[1].direction[1] < 0 else [0.0, 1.0, 0.0]
    assert told(found) == [("move-to-contact", DOWN), ("slide-to-contact", in_)]
    assert found.line.direction.tolist() == pytest.approx(in_, abs=1e-9)
    (side,) = slide_directions(made.assembly, found, made.start | {"wedge": made.goals[0]})
    assert side == pytest.approx(in_, abs=1e-9)
    roof = made.start["roof"][:3, :3] @ made.assembly.solids["roof"].faces["slope"].normal
    assert roof @ in_ < 0.0, "towards the roof"


def test_what_closes_together_is_made_together() -> None:
    """A pyramid pushed sideways into its seat: no order closes its four walls one by one."""
    walls = [X + side for side in (Y, -Y, 0.5 * Z, -0.5 * Z)]
    found = chain(np.array([n / np.linalg.norm(n) for n in walls]), lambda along, walls: Way(along[0], 0.1, True))
    (macro,) = found.macros
    assert (macro.name, macro.makes, found.state.letter) == ("move-to-contact", (0, 1, 2, 3), "F")
    assert all(n @ macro.direction < -1e-3 for n in walls)


def test_how_deep_and_where_a_motion_turns_slow() -> None:
    made = built("through")
    found = last_of(made).after
    poses = poses_of(made)
    way = -Y
    assert slow_before(made.assembly, found, poses, way) == pytest.approx(0.022)
    assert mouths(made.assembly, found, poses, way) == pytest.approx([0.1, 0.04])
    made = built("countersink")
    assert slow_before(made.assembly, last_of(made).after, poses_of(made), -Z) == pytest.approx(0.008)
    assert mouths(made.assembly, last_of(made).after, poses_of(made), -Z) == pytest.approx([0.006])


def test_what_is_fitted_later_wants_its_place_across_the_axis() -> None:
    made = built("nested")
    walls = later_walls(made.assembly, 0, "plate")
    assert len(walls) == 2
    assert np.array(walls) @ Z == pytest.approx(np.zeros(2))
