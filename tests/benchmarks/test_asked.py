"""Pages say how much of their sweep files they hold, and the sweep files contain what they should."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from benchmarks.asked import ROBUST, ROUND, Kept, asked_trials, block, found_trials, said

ROOT = Path(__file__).parents[2]
PLAIN = ("uncorrected", "snap", "snap+spiral", "nominal")


@pytest.mark.parametrize("kept", [ROBUST, ROUND], ids=["robust", "round"])
def test_the_page_says_how_many_seeds_of_the_sweep_file_it_holds(kept: Kept) -> None:
    assert block(kept) in kept.page.read_text(encoding="utf-8"), "run: python benchmarks/asked.py"


def test_a_part_is_counted_cell_by_cell() -> None:
    asked = {("a",): 20, ("b",): 20, ("c",): 100}
    assert said({("a",): 14, ("b",): 20}, asked) == (
        "It is a part of what the sweep file asks for: 0 of 100 seeds in 1 cell, 14 of 20 seeds in 1 cell, "
        "20 of 20 seeds in 1 cell."
    )
    assert said(asked, asked) == "It holds every seed of every cell of the sweep file."
    assert said({**asked, ("d",): 3, ("a",): 30}, asked) == said(asked, asked), "more than was asked is no part"


def test_a_trial_that_a_file_names_twice_is_asked_for_once(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text(
        'scenarios = ["block_on_block"]\nlevels = [1]\ncareless = [0]\nmethods = ["uncorrected", "oracle"]\ntrials = 3\n'
        '[[also]]\nmethods = ["uncorrected"]\ntrials = 5\n'
    )
    asked = asked_trials([path, path], ("scenario", "method", "noise_level"))
    assert asked == {("block_on_block", "uncorrected", 1.0): 5, ("block_on_block", "oracle", 0.0): 3}


@pytest.mark.parametrize("name", ["headline", "robust", "round", "gearbox", "arms", "robot_error", "baselines"])
def test_every_sweep_has_snap_and_what_memory_is_worth(name: str) -> None:
    methods = {method for grid in read_sweep(ROOT / "benchmarks" / f"{name}.toml") for method in grid.method}
    assert methods >= set(PLAIN[1:])


def test_counts_of_a_page_name_cells_of_its_sweep_file() -> None:
    """None that is kept was asked for otherwise: the columns are spelled alike on both sides."""
    for kept in (ROBUST, ROUND):
        assert found_trials(kept).keys() <= asked_trials(kept.sweeps, kept.place).keys()
