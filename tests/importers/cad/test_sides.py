"""Twelve sides with corners on one circle are round, fewer flat unless told otherwise; radii are those of corners."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from apo_bench.importers.cad.part_report import format_part_report, report_part
from apo_bench.importers.cad.solids import RawSolid
from tests.importers.cad.made import write_triangles


def prism(sides: int) -> Any:
    return trimesh.creation.cylinder(5.0, 40, sections=sides)


def found(drawn: Any, folder: Path, *fewest: int) -> RawSolid:
    _, (raw,) = read_raw_solids(write_triangles(drawn.triangles, folder / "a.stl"), "mm", *fewest)
    return raw


@pytest.mark.parametrize(("sides", "fewest", "round_ones"), [(11, 12, 0), (12, 12, 1), (6, 6, 1)])
def test_so_many_sides_are_round_and_fewer_are_flat(sides: int, fewest: int, round_ones: int, tmp_path: Path) -> None:
    raw = found(prism(sides), tmp_path, fewest)
    walls = [region for region in raw.regions if region.is_round]
    assert [(wall.sides, wall.square) for wall in walls] == [(sides, True)] * round_ones
    assert sum(region.kind == "plane" for region in raw.regions) == 2 + sides * (not round_ones)
    done = import_solid(raw, "a", tmp_path, "a.stl", 8000.0)
    assert dict(done.refused) == {}
    assert len(done.solid.rounds) == round_ones
    volume = np.pi * 25 * 40 if round_ones else sides / 2 * np.sin(2 * np.pi / sides) * 25 * 40
    assert 1e9 * done.solid.volume == pytest.approx(volume, rel=1e-4)
    said = "\n".join(format_part_report(report_part(done)))
    assert (f"cylinder of {sides} sides, radius 5 mm" in said) == bool(round_ones)
