"""Parts that were drawn line to line, or a little too thick, get play that the scenario states; deeper ones do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench.geometry import Solid, shrink_pieces
from apo_bench.importers.assembly.added_clearance import add_clearance
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario
from apo_bench.scenario.parts.making import extrude, join, make_rectangle
from apo_bench.scenario.scenario_file import load_scenario
from tests.importers.assembly.test_blocked import FLOOR, made

SLOTTED = join(FLOOR, *(extrude(make_rectangle(15, 50, (17.5 * s, 0)), 10, 30) for s in (-1, 1)))


def slotted(folder: Path, thick: float) -> tuple[PosedPart, ...]:
    """A tongue on the floor of a slot that is 20 mm wide."""
    tongue = extrude(make_rectangle(thick, 30), 0, 35, bottom="foot", top="head")
    return made(folder, base=(SLOTTED, (0, 0, 0)), tongue=(tongue, (0, 0, 10)))


def width(solid: Solid, clearance_mm: float = 0.0) -> float:
    pieces = shrink_pieces(solid, 1e-3 * clearance_mm)
    return 1e3 * float(np.ptp(np.concatenate([piece.corners for piece in pieces])[:, 0]))


@pytest.mark.parametrize("over", [0.0, 0.02, 0.1])
def test_a_tongue_as_wide_as_its_slot_or_wider_gets_play_that_the_file_states(tmp_path: Path, over: float) -> None:
    parts = slotted(tmp_path, 20.0 + 2.0 * over)
    (_, tongue), (pair,), _ = add_clearance(parts, 0.25, 1.0)
    note = pair.describe(0.25)
    assert (pair.part, pair.other, pair.depth_mm) == ("tongue", "base", pytest.approx(over, abs=1e-5))
    assert sorted(tongue.fit.values()) == pytest.approx([over, over], abs=1e-5)
    assert width(tongue.solid) == pytest.approx(20.0, abs=1e-4)
    assert width(tongue.solid, 0.25) == pytest.approx(19.5, abs=1e-4)
    assert "as stated under [parts.tongue.fit]" in note
    path = tmp_path / "own.toml"
    found = new_upright_scenario(parts)
    write_scenario(found, path, "own", "a test")
    assert note in found.notes
    assert f"# NOTE: {note}." in path.read_text(encoding="utf-8")
    read = load_scenario(path).assembly.solids["tongue"]
    assert width(read, 0.25) == pytest.approx(19.5, abs=1e-4)
    assert len(load_scenario(path).assembly.operations[0].contacts) == 3


@pytest.mark.parametrize(
    ("over", "clearance", "most"), [(0.3, 0.25, 0.2), (0.1, 0.25, 0.05), (0.0, 0.25, 0.0), (0, 0, 1)]
)
def test_what_is_deeper_or_not_asked_for_stays_as_it_was_drawn(
    tmp_path: Path, over: float, clearance: float, most: float
) -> None:
    parts = slotted(tmp_path, 20.0 + 2.0 * over)
    assert add_clearance(parts, clearance, most) == (parts, (), ())
