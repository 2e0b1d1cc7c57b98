"""The committed headline holds what it says; `tests/trial/test_success_rate.py` repeats a part of it."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from apo_bench import SweepConfig
from apo_bench.benchmark.analysis import tally
from apo_bench.benchmark.sweeps.grid import list_work_units, load_all
from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from benchmarks import headline
from benchmarks.headline import BEGIN, BLOCKS, END, KEPT, PAGE
from benchmarks.headline_page import GRID, METHODS
from benchmarks.headline_summary import block, sentence, summarise

SEEDS = 40
MOST_TRIALS = 16_000  # an hour on two cores


@cache
def kept_rows() -> list[dict[str, Any]]:
    return headline.kept_rows()


@cache
def run_file() -> dict[str, Any]:
    ran: dict[str, Any] = json.loads((KEPT / "run.json").read_text())
    return ran


def key(row: dict[str, Any]) -> tuple[Any, ...]:
    where = (row["noise"], row["robot_error"])
    return row["scenario"], row["seed"], row["method"], row["noise_mm"], row["human_error_scale"], *where


def grid_of(described: dict[str, Any]) -> SweepConfig:
    """A grid of `run.json`; clearances are those of the scenarios."""
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in described.items()}
    return SweepConfig(**{**values, "clearance_mm": ()})


def test_the_headline_holds_every_trial_of_its_grids_once() -> None:
    grids = [grid_of(described) for described in run_file()["grids"]]
    asked = [trial for unit in list_work_units(grids, load_all(grids)) for trial in unit]
    expected = [(t.scenario, t.seed, t.method, t.noise_mm, t.human_error_scale, t.noise, t.robot_error) for t in asked]
    assert sorted(map(key, kept_rows())) == sorted(expected)
    assert run_file()["rows"] == len(expected)


def test_the_sweep_of_the_headline_is_small_and_has_the_limits() -> None:
    grids = read_sweep(GRID, {"trials": 1})
    trials = [trial for unit in list_work_units(grids, load_all(grids)) for trial in unit]
    assert SEEDS * len(trials) <= MOST_TRIALS
    by_method = {
        method: {t.noise_mm for t in trials if t.method == method and t.human_error_scale == 0} for method in METHODS
    }
    assert all(by_method[method] >= {0.1, 0.25, 0.5, 1.0, 2.0, 4.0} for method in METHODS)
    assert {"isotropic", "outliers", "megapose-tless"} <= {t.noise for t in trials}
    assert {"oracle", "contact-robust", "contact-robust+spiral"} == {
        t.method for t in trials if t.robot_error != "none"
    }


def test_the_table_is_that_of_the_rows() -> None:
    lines = (KEPT / "table.csv").read_text().splitlines()
    names = lines[0].split(",")
    counts = {
        (
            t["scenario"],
            t["noise"],
            t["method"],
            float(t["noise_mm"]),
            float(t["human_error_scale"]),
            t["robot_error"],
        ): t
        for t in (dict(zip(names, line.split(","), strict=False)) for line in lines[1:])
    }
    assert len(counts) == len(lines) - 1
    for cell in tally(kept_rows()):
        line = counts[cell.scenario, cell.noise, cell.method, cell.noise_mm, cell.human_error_scale, cell.robot_error]
        assert (int(line["trials"]), int(line["successes"])) == (cell.trials, cell.successes)


@pytest.mark.parametrize("page", [*BLOCKS, PAGE], ids=lambda path: path.name)
def test_the_summary_is_the_same_on_every_page_and_that_of_the_rows(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    summary = summarise(tally(kept_rows()))
    if page in BLOCKS:
        written = text.split(BEGIN)[1].split(END)[0].strip()
        assert written == "\n".join(block(summary, *BLOCKS[page]))
    assert text.count(sentence(summary)) == 1
    picture = re.search(r"!\[[^\]]*\]\(([^)]*headline\.svg)\)", text)
    assert picture is not None
    assert (page.parent / picture.group(1)).exists()
