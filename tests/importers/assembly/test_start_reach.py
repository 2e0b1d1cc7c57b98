"""Parts start where the arm can lift them over the highest pile."""

from __future__ import annotations

from pathlib import Path

from apo_bench.importers.assembly.choices import AssemblyChoices
from apo_bench.importers.assembly.scenario_check import check_file
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario
from apo_bench.scenario.parts.making import extrude, make_rectangle
from tests.importers.assembly.test_blocked import made


def test_parts_of_a_high_pile_start_where_the_arm_can_lift_them_over_it(tmp_path: Path) -> None:
    tower = extrude(make_rectangle(60, 60), 0, 205, bottom="foot", top="head")
    base = extrude(make_rectangle(100, 80), 0, 15, bottom="bottom", top="top")
    pile = {f"t{i}": (tower, (0.0, 0.0, 15.0 + 205 * i)) for i in range(3)}
    parts = made(tmp_path, base=(base, (0, 0, 0)), **pile)
    write_scenario(new_upright_scenario(parts, AssemblyChoices("z")), tmp_path / "own.toml", "own", "a test")
    far = [each.sentence for each in check_file(tmp_path / "own.toml", seeds=0) if not each.ok]
    assert not [sentence for sentence in far if "start" in sentence]
