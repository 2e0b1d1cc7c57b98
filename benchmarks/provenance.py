"""Sentences of a page of results that say what its numbers were made with."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from apo_bench.benchmark.sweeps.grid import list_work_units, load_all
from apo_bench.benchmark.sweeps.sweep_file import read_sweep


def mujoco_of(folders: Iterable[Path]) -> list[str]:
    """Return the versions of MuJoCo that these sweeps ran with."""
    return sorted({run["versions"]["mujoco"] for run in _runs(folders)})


def with_mujoco(page: str, versions: Iterable[str]) -> str:
    """Return the page with the versions of MuJoCo in its last line."""
    return f"{page.rstrip()}\n\n*Simulated with MuJoCo {' and '.join(versions)}.*\n"


def share_of_sweep(trials: int, *sweeps: Path) -> str:
    """Say how many of the trials of sweep files a page holds; a trial that stands in them twice counts once."""
    files = " and ".join(f"`benchmarks/{path.name}`" for path in sweeps)
    return f"The page holds {trials} of the {len(trials_of(*sweeps))} trials of {files}."


def trials_of(*sweeps: Path) -> set[Any]:
    """Return the trials that sweep files ask for."""
    trials = set[Any]()
    for path in sweeps:
        grids = read_sweep(path)
        for unit in list_work_units(grids, load_all(grids)):
            trials.update(unit)
    return trials


def _runs(folders: Iterable[Path]) -> list[dict[str, Any]]:
    return [json.loads((folder / "run.json").read_text(encoding="utf-8")) for folder in folders]
