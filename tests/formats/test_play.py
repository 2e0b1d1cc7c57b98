"""Observation files may state the play of parts that fit; where they do not, it is the scenario's clearance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apo_bench import load_scenario, read_observation
from apo_bench.formats import json_forms as files
from apo_bench.formats import json_reading
from apo_bench.formats.csv_form import read_table, table
from apo_bench.formats.observation import as_planned

SCENARIO = replace(load_scenario("stick_in_tower"), clearance_mm=0.4)


def csv(tmp_path: Path, column: str, *cells: str) -> Path:
    """The planned goals with one more column; none if that is empty."""
    lines = table(SCENARIO.assembly, SCENARIO.goals).splitlines()
    more = ["", *cells] if not column else [column, *cells]
    path = tmp_path / "seen.csv"
    path.write_text("\n".join(f"{line},{cell}" if column else line for line, cell in zip(lines, more, strict=True)))
    return path


@pytest.mark.parametrize(
    ("column", "cells", "play_mm"),
    [
        ("", ("", "", ""), 0.4),
        ("play_mm", ("0.3", "0.3", "0.3"), 0.3),
        ("play_mm", ("", "0.3", ""), 0.3),
        ("play_mm", ("0", "0", "0"), 0.0),
        ("play_m", ("0.0003", "", ""), 0.3),
    ],
)
def test_play_in_a_table(column: str, cells: tuple[str, ...], play_mm: float, tmp_path: Path) -> None:
    seen, _ = read_table(csv(tmp_path, column, *cells), SCENARIO)
    assert seen.play_m == pytest.approx(1e-3 * play_mm)
    np.testing.assert_allclose(seen.poses, SCENARIO.goals, rtol=0, atol=1e-15)


def test_play_in_json_and_without(tmp_path: Path) -> None:
    seen = replace(as_planned(SCENARIO, 1.0, 1.0), play_m=0.3e-3)
    path = tmp_path / "seen.json"
    form = files.observation_form(seen, "stick_in_tower")
    assert form["play_mm"] == pytest.approx(0.3)
    files.write_form(form, path)
    for read in (json_reading.read_json_observation, read_observation):
        assert read(path, SCENARIO).play_m == pytest.approx(0.3e-3)
    del form["play_mm"]
    files.write_form(form, path)
    for read in (json_reading.read_json_observation, read_observation):
        assert read(path, SCENARIO).play_m == pytest.approx(0.4e-3)
