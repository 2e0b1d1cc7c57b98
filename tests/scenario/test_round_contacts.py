"""Contacts of round faces in scenario files: which pairs make one, and whether they are closed at the goals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.assembly import Contact, Gap, PartFace
from apo_bench.io import convert_typed
from apo_bench.scenario.contacts import ContactGaps, read_contacts
from apo_bench.scenario.layout_checks import check_layouts
from apo_bench.scenario.play import check_clearance
from apo_bench.scenario.scenario import Shift, Site
from apo_bench.scenario.tables import OperationTable
from tests import rounds, scenes
from tests.rounds import as_scenario
from tests.scenes import Scene, mm

SOLIDS = {
    "table": scenes.table(),
    "plate": rounds.plate(),
    "loose": rounds.plate(radius=5.1, fit=False),
    "sunk": rounds.countersunk(),
    "peg": rounds.peg(),
    "plug": rounds.plug(),
}


def read(value: Any, main: str = "peg") -> ContactGaps:
    table = convert_typed(
        {"move": main, "goal": {"at_mm": [0, 0, 0]}, "contacts": [value]}, OperationTable, "mine.toml"
    )
    return read_contacts(table.contacts, "mine.toml, operation 1", (main,), SOLIDS, {"table", "plate", "loose", "sunk"})


@pytest.mark.parametrize(
    ("main", "pair"),
    [
        ("peg", ("wall", "plate.bore")),
        ("peg", ("wall", "table.top")),
        ("plug", ("cone", "sunk.sink")),
        ("plug", ("cone", "plate.rim")),
        ("peg", ("edge", "sunk.sink")),
        ("peg", ("end", "table.top")),
    ],
)
def test_pairs_that_make_a_contact(main: str, pair: tuple[str, str]) -> None:
    part, face = pair[1].split(".")
    assert read(list(pair), main) == {Contact(PartFace(main, pair[0]), PartFace(part, face)): Gap()}


@pytest.mark.parametrize(
    ("main", "pair", "words"),
    [
        ("peg", ("wall", "sunk.sink"), "a shaft of 10 mm and a countersink of 90 degrees make no contact"),
        ("peg", ("end", "plate.bore"), "a flat face and a hole of 10 mm make no contact"),
        ("peg", ("edge", "plate.rim"), "the rim of a shaft of 10 mm and the rim of a hole of 10 mm make no contact"),
    ],
)
def test_pairs_that_make_none(main: str, pair: tuple[str, str], words: str) -> None:
    with pytest.raises(InputError) as refused:
        read(list(pair), main)
    assert words in str(refused.value)
    assert str(refused.value).count("\n") == 0


def test_play_by_the_sizes_is_play() -> None:
    """A contact that is asked to be anywhere in its play needs some."""
    asked = read({"faces": ["wall", "loose.bore"], "kind": "clearance"})
    assert list(asked.values()) == [Gap("clearance")]
    with pytest.raises(InputError, match="faces without play"):
        read({"faces": ["wall", "table.top"], "kind": "clearance"})


@pytest.mark.parametrize("name", rounds.ALL)
def test_scenes_of_round_and_tilted_parts_are_closed(name: str) -> None:
    check_layouts(as_scenario(rounds.ALL[name](), site=Site((0.05, 0.0), (0.02, 0.02), (0.0, 0.4))), "mine.toml")


def changed(of: Scene, operation: int, T: np.ndarray) -> Scene:
    """The goal of an operation (from 1) moved in its own frame."""
    goals = of.nominal_poses.copy()
    goals[operation - 1] = goals[operation - 1] @ T
    return replace(of, nominal_poses=goals)


def with_part(of: Scene, part: Any) -> Scene:
    return replace(of, assembly=replace(of.assembly, solids={**of.assembly.solids, part.name: part}))


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (changed(rounds.peg_in_plate(), 2, mm(0.1, 0, 0)), "the faces are 0.1 mm off each other"),
        (changed(rounds.through(), 3, mm(0, 0, 70)), "the faces do not overlap"),
        (changed(rounds.on_table(), 1, mm(0, 0, 0, (0, 1, 0))), "the axes are turned by 1 degrees"),
        (
            with_part(rounds.peg_in_plate(), rounds.plate(fit=False)),
            "the shaft has no play in the hole, 0 mm per side by their sizes, and neither is fit",
        ),
    ],
)
def test_what_is_not_closed_is_named(of: Scene, words: str) -> None:
    with pytest.raises(InputError) as refused:
        check_layouts(as_scenario(of), "mine.toml")
    assert words in str(refused.value)


def test_a_shaft_varied_out_of_its_bores_is_named() -> None:
    along = Shift(2, np.array([0.0, 0.0, 1.0]), -0.01, 0.09)
    with pytest.raises(InputError, match=r"vary: .* do not overlap when it is varied by 90 mm"):
        check_layouts(as_scenario(rounds.through(), shifts=(along,)), "mine.toml")


def test_a_clearance_that_leaves_a_shaft_no_play_is_named() -> None:
    scenario = as_scenario(rounds.peg_in_plate())
    check_clearance(scenario, 0.01)
    with pytest.raises(InputError, match=r"^a clearance of 0 mm was given, with which 'peg.wall .*; give more"):
        check_clearance(scenario, 0.0)
    check_clearance(as_scenario(rounds.loose_peg()), 0.0)
