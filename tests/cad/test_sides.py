"""Twelve sides with corners on one circle are round, fewer flat unless told otherwise; radii are those of corners."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from apo_bench.cad.import_report import import_lines
from apo_bench.cad.importing import import_part, raw_solids
from apo_bench.cad.solids.raw_solid import RawSolid
from apo_bench.cli.app import app
from tests.cad.made import write_triangles


def prism(sides: int, fine: int = 0, noise_mm: float = 0.0, radius: float = 5.0) -> Any:
    mesh = trimesh.creation.cylinder(radius, 40, sections=sides)
    for _ in range(fine):
        mesh = mesh.subdivide()
    off = np.random.default_rng(32).normal(0.0, noise_mm, mesh.vertices.shape) if noise_mm else 0.0
    return (mesh.vertices + off)[mesh.faces]


def found(triangles: Any, folder: Path, *fewest: int) -> RawSolid:
    _, (raw,) = raw_solids(write_triangles(triangles, folder / "a.stl"), "mm", *fewest)
    return raw


@pytest.mark.parametrize(
    ("sides", "fewest", "round_ones"), [(11, 12, 0), (12, 12, 1), (20, 24, 0), (8, 8, 1), (6, 6, 1), (6, 7, 0)]
)
def test_so_many_sides_are_round_and_fewer_are_flat(sides: int, fewest: int, round_ones: int, tmp_path: Path) -> None:
    raw = found(prism(sides), tmp_path, fewest)
    walls = [region for region in raw.regions if region.is_round]
    assert [(wall.sides, wall.square) for wall in walls] == [(sides, True)] * round_ones
    assert sum(region.kind == "plane" for region in raw.regions) == 2 + sides * (not round_ones)
    done = import_part(raw, "a", tmp_path, "a.stl", 8000.0)
    assert dict(done.refused) == {}
    assert len(done.solid.rounds) == round_ones
    volume = np.pi * 25 * 40 if round_ones else sides / 2 * np.sin(2 * np.pi / sides) * 25 * 40
    assert 1e9 * done.solid.volume == pytest.approx(volume, rel=1e-4)
    said = "\n".join(import_lines(done))
    assert (f"cylinder of {sides} sides, radius 5 mm" in said) == bool(round_ones)


@pytest.mark.parametrize(
    ("sides", "fine", "noise_mm", "radius"), [(12, 0, 0.005, 5.0), (16, 1, 0.005, 5.0), (12, 1, 0.005, 20.0)]
)
def test_the_radius_of_a_rough_wall_is_that_of_its_corners(
    sides: int, fine: int, noise_mm: float, radius: float, tmp_path: Path
) -> None:
    """Others of its corners lie on the sides, up to 0.7 mm inside of the circle."""
    (wall,) = (r for r in found(prism(sides, fine, noise_mm, radius), tmp_path).regions if r.is_round)
    assert wall.radii == pytest.approx((radius, radius), abs=0.005)
    assert wall.sides == sides
    assert wall.square


def test_rough_sides_that_are_too_few_are_flat(tmp_path: Path) -> None:
    raw = found(prism(11, 1, 0.005), tmp_path)
    assert [region.kind for region in raw.regions] == ["plane"] * 13


def test_a_chamfer_stays_flat_where_few_sides_are_round(tmp_path: Path) -> None:
    corners = np.array([(x, y) for x, y in ((-20, -15), (20, -15), (20, 10), (15, 15), (-20, 15))], dtype=float)
    solid = trimesh.creation.extrude_triangulation(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 4]], 10.0)
    assert [region.kind for region in found(solid.triangles, tmp_path, 6).regions] == ["plane"] * 7


def test_the_command_takes_a_number_of_sides(tmp_path: Path) -> None:
    path = write_triangles(prism(8), tmp_path / "a.stl")
    run = CliRunner()
    given = ["part", "import", str(path), "--out", str(tmp_path)]
    assert "cylinder of 8 sides" in run.invoke(app, [*given, "--round", "8"]).output
    assert "--round 4 was given; 5 to 64 sides are allowed" in str(run.invoke(app, [*given, "--round", "4"]).exception)
