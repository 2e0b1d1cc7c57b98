"""Why parts do not go together: the pair that blocks, and its direction; and which side of them goes up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench.geometry import pose
from apo_bench.importers.assembly.choices import AssemblyChoices
from apo_bench.importers.assembly.new_scenario import NoAssemblyOrder
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.importers.assembly.scenario_writer import format_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import Body, extrude, join, make_rectangle, write_part


def made(folder: Path, **bodies: tuple[Body, tuple[float, float, float]]) -> tuple[PosedPart, ...]:
    for name, (body, _) in bodies.items():
        write_part(name, body, folder, density=700, source="a test", licence="CC0-1.0")
    files = {name: folder / f"{name}.xml" for name in bodies}
    return tuple(
        PosedPart(name, files[name], load_part(files[name]), pose.at(1e-3 * np.array(at)))
        for name, (_, at) in bodies.items()
    )


def turned(parts: tuple[PosedPart, ...], *turn: float) -> tuple[PosedPart, ...]:
    T = pose.at(np.zeros(3), turn)
    return tuple(PosedPart(part.name, part.file, part.solid, T @ part.T) for part in parts)


def box(low: float, high: float) -> Body:
    """Walls of 10 mm around a room of 30 x 30 mm."""
    sides = [make_rectangle(50, 10, (0, 20 * s)) for s in (-1, 1)] + [
        make_rectangle(10, 30, (20 * s, 0)) for s in (-1, 1)
    ]
    return join(*(extrude(side, low, high) for side in sides))


Z_UP = AssemblyChoices("z")
FLOOR = extrude(make_rectangle(50, 50), 0, 10, bottom="bottom", top="top")
CORE = extrude(make_rectangle(20, 20), 0, 15, bottom="foot", top="head")


def test_what_is_shut_in_is_said_with_what_is_in_its_way(tmp_path: Path) -> None:
    shut = join(FLOOR, box(10, 40), extrude(make_rectangle(50, 50), 40, 48))
    with pytest.raises(NoAssemblyOrder, match=r"'core' cannot leave shut"):
        new_upright_scenario(made(tmp_path, shut=(shut, (0, 0, 0)), core=(CORE, (0, 0, 10))), Z_UP)


def test_another_side_goes_up_where_there_is_no_order_with_z(tmp_path: Path) -> None:
    cup = join(FLOOR, box(10, 14))
    parts = made(tmp_path, cup=(cup, (0, 0, 0)), core=(CORE, (0, 0, 10)))
    assert new_upright_scenario(parts).up == "z"
    over = turned(parts, 180, 0, 0)
    with pytest.raises(NoAssemblyOrder, match="'core' cannot leave cup"):
        new_upright_scenario(over, AssemblyChoices("z", ("cup",)))
    found = new_upright_scenario(over, AssemblyChoices(fixed=("cup",)))
    assert found.up.startswith("-z, as with z up there is no order")
    assert new_upright_scenario(over, AssemblyChoices("-z", ("cup",))).up == "-z, as asked"
    assert "# Up: -z, as with z up" in format_scenario(found, "own", "a test", tmp_path / "own.toml")
    assert [placing.moves for placing in found.order] == [("core",)]


def test_a_smaller_part_that_lies_lowest_is_fixed_where_there_is_no_order_with_the_largest(tmp_path: Path) -> None:
    cup = join(FLOOR, box(10, 25))
    over = turned(made(tmp_path, cup=(cup, (0, 0, 0)), core=(CORE, (0, 0, 10))), 180, 0, 0)
    with pytest.raises(NoAssemblyOrder):
        new_upright_scenario(over, AssemblyChoices("z", ("cup",)))
    found = new_upright_scenario(over, Z_UP)
    assert found.fixed == ("core",)
    assert found.why_fixed.startswith("one of the lowest")
    assert [placing.moves for placing in found.order] == [("cup",)]


def test_the_side_goes_up_from_which_parts_come_from_above(tmp_path: Path) -> None:
    """With z up the core would have to be put into the side of the cup."""
    cup = join(FLOOR, box(10, 50))
    core = extrude(make_rectangle(30, 30), 0, 70, bottom="foot", top="head")
    aside = turned(made(tmp_path, cup=(cup, (0, 0, 0)), core=(core, (0, 0, 10))), 90, 0, 0)
    assert new_upright_scenario(aside, Z_UP).up == "z, as asked"
    found = new_upright_scenario(aside, AssemblyChoices(fixed=("cup",)))
    assert found.up.startswith("-y, as with z up 'core' comes along")
    assert all("from above" in placing.why for placing in found.order)
