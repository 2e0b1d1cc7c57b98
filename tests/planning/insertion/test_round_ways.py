"""Contact states, macros and ways of round and tilted faces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from apo_bench.assembly import compute_placements
from apo_bench.geometry import Array
from apo_bench.planning.insertion.arrival import Arrival, compute_screw_state, plan_arrival
from apo_bench.planning.insertion.insertion_geometry import list_slide_directions
from apo_bench.planning.insertion.operation_macros import OperationMacros, describe_operation_macros
from tests import rounds
from tests.brackets import under_roof
from tests.scenes import Scene

X, Y, Z = np.eye(3)


@lru_cache
def built(name: str) -> Scene:
    return rounds.ALL[name]()


@lru_cache
def last_of(made: Scene) -> OperationMacros:
    return describe_operation_macros(made.assembly, made.start, made.nominal_poses)[-1]


def poses_of(made: Scene) -> dict[str, Array]:
    return dict(compute_placements(made.assembly, made.start, made.nominal_poses)[-1])


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
    assert compute_screw_state(made.assembly, last_of(made).after, poses_of(made)).all == screw


@pytest.mark.parametrize("turned", [False, True])
def test_a_wedge_is_slid_under_its_roof(turned: bool) -> None:
    """Up leads into the roof, so it comes level; the order of the contacts does not matter."""
    made = under_roof(30.0)
    (operation,) = made.assembly.operations
    contacts = operation.contacts[::-1] if turned else operation.contacts
    found = plan_arrival(made.assembly, ("wedge",), contacts, made.start | {"wedge": made.nominal_poses[0]})
    assert (found.state.letter, found.free) == ("C", True)
    in_ = [0.0, -1.0, 0.0] if found.macros[1].direction[1] < 0 else [0.0, 1.0, 0.0]
    assert told(found) == [("move-to-contact", DOWN), ("slide-to-contact", in_)]
    assert found.line.direction.tolist() == pytest.approx(in_, abs=1e-9)
    (side,) = list_slide_directions(made.assembly, found, made.start | {"wedge": made.nominal_poses[0]})
    assert side == pytest.approx(in_, abs=1e-9)
    roof = made.start["roof"][:3, :3] @ made.assembly.solids["roof"].faces["slope"].normal
    assert roof @ in_ < 0.0, "towards the roof"
