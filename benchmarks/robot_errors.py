"""What errors of the robot itself cost: `python benchmarks/robot_errors.py FOLDER [FOLDER ...]`.

Takes sweeps of benchmarks/robot_errors.toml, whole or not, and writes docs/results/robot-errors.md: successes of every
robot error, method and scenario, with Wilson's 95 % interval over the scenarios.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.records import Row
from apo_bench.records.run.run_folder import read_rows
from apo_bench.statistics import Cell, tally, wilson
from benchmarks.made_with import mujoco_of, with_mujoco

PAGE = Path(__file__).parents[1] / "docs" / "results" / "robot-errors.md"
SAID = """\
# Errors of the robot

Written by `python benchmarks/robot_errors.py` from a sweep of `benchmarks/robot_errors.toml`. Success: the finished
assembly is right; the same seeds in every cell, a careful human, clearance of 0.25 mm per side, and for `contact` a
noise of 1 mm and 1 degree. A [robot error](../guide/arm.md#what-is-wrong-with-the-robot-itself) is drawn anew for every
trial; the numbers are standard deviations in mm and degrees. The last column has a 95 % interval (Wilson).
"""
TAUGHT = """
Contacts repair the eye's error: without a robot error `contact` does at 1 mm and 1 degree what `oracle` does with the
truth. They do not repair the robot's own: with one, `oracle`, which knows the truth, fails as often as `contact`.
"""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folders", nargs="+", type=Path)
    folders = asked.parse_args().folders
    rows = [row for folder in folders for row in read_rows(folder)]
    PAGE.write_text(with_mujoco(page(rows), mujoco_of(folders)), encoding="utf-8")
    print(f"Wrote {PAGE}")


def page(rows: Iterable[Row]) -> str:
    cells = [cell for cell in tally(rows) if cell.trials]
    scenarios = sorted({cell.scenario for cell in cells})
    methods = list(dict.fromkeys(cell.method for cell in cells))
    errors = list(dict.fromkeys(cell.robot_error for cell in cells))
    errors.sort(key=_by_size)
    columns = [(method, scenario) for method in methods for scenario in scenarios]
    heads = [f"`{method}`, {scenario}" for method, scenario in columns]
    lines = [f"| robot error | {' | '.join(heads)} | both, `{methods[0]}` |", f"|---|{'---|' * (len(heads) + 1)}"]
    lines += [_line(error, columns, methods[0], [c for c in cells if c.robot_error == error]) for error in errors]
    return SAID + "\n" + "\n".join(lines) + "\n" + TAUGHT


def _by_size(error: str) -> tuple[bool, str, float]:
    kind, _, size = error.partition(":")
    return kind != "none", kind, float(size.split("/")[0] or 0.0) if size else 0.0


def _line(error: str, columns: Sequence[tuple[str, str]], first: str, cells: Sequence[Cell]) -> str:
    of = {(cell.method, cell.scenario): cell for cell in cells}
    said = [f"{of[at].successes} of {of[at].trials}" if at in of else "" for at in columns]
    own = [cell for cell in cells if cell.method == first]
    trials = sum(cell.trials for cell in own)
    won = sum(cell.successes for cell in own)
    low, high = wilson(won, trials)
    return f"| `{error}` | {' | '.join(said)} | {100 * won / trials:.0f} % ({100 * low:.0f} to {100 * high:.0f}) |"


if __name__ == "__main__":
    main()
