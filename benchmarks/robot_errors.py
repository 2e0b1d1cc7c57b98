"""What errors of the robot itself cost: `python benchmarks/robot_errors.py FOLDER [FOLDER ...] [--acts FILE]`.

Takes sweeps of benchmarks/robot_errors.toml, whole or not, and writes docs/results/robot-errors.md: successes of every
robot error, method and scenario, with Wilson's 95 % interval over the scenarios. With the lines of
`python -m benchmarks.feel_acts --out FILE` the page also says what each act of a robot that feels is worth.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import Cell, tally, wilson
from apo_bench.records import TrialConfig, TrialRecord
from apo_bench.records.run.run_folder import read_records
from benchmarks.feel_acts import Line, lines_of, table
from benchmarks.made_with import mujoco_of, states_of_code, with_mujoco

PAGE = Path(__file__).parents[1] / "docs" / "results" / "robot-errors.md"
OVER = """
## Over all scenarios
"""
OLDER = """
The sweeps were made with {} states of the package, so rows of different lines or scenarios may be some commits apart.
"""
SAID = """\
# Errors of the robot

Written by `python benchmarks/robot_errors.py` from sweeps of `benchmarks/robot_errors.toml` and of parts of it.
Success: the finished assembly is right; the same seeds in every cell, a careful human, clearance of 0.25 mm per side,
and for `contact` and `none` a noise of 1 mm and 1 degree. A [robot
error](../guide/arm.md#what-is-wrong-with-the-robot-itself) is drawn anew for every trial; the numbers are standard
deviations in mm and degrees. Percentages are over all scenarios, with a 95 % interval (Wilson).

## Over all scenarios
"""
EACH = """
## Each scenario
"""
COST = """
## What feeling costs

Simulated seconds of a trial, at the median, over all errors.
"""
OTHERS = """
## Other sensors, statements, arms and scenarios

The sensor is that of the wrist (`--ft-sensor`), and stated is how wrong the robot was said to be (`--assumed-robot-error`).
"""
ACTS = """
## Each act left out

Errors of all kinds together, as in the last line of the first table, by `python -m benchmarks.feel_acts`. Without
`touch` nothing fixed is touched, without `search` a motion that is stopped is not tried again elsewhere. Lost, won: how
many trials only the robot with all acts got right, and how many only this one.
"""
SCENARIOS = ("peg_in_hole", "stick_in_tower", "carried_bridge")
USUAL = {"arm": "six_axis", "ft_sensor": TrialConfig.ft_sensor, "assumed_robot_error": TrialConfig.assumed_robot_error}
OTHER_KEYS = ("robot_error", *USUAL)
TAUGHT = """
Contacts repair the eye's error, not the robot's own: with one, `oracle`, which knows the truth, fails. A robot that
[feels](../how/feel.md) makes contacts by itself and corrects itself by them.
"""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folders", nargs="+", type=Path)
    asked.add_argument("--acts", type=Path, metavar="FILE", help="of benchmarks/feel_acts.py")
    given = asked.parse_args()
    folders = given.folders
    rows = [row for folder in folders for row in read_records(folder)]
    acts = [] if given.acts is None else lines_of(given.acts)
    simulated = {*mujoco_of(folders), *(line["mujoco"] for line in acts)}
    states = states_of_code(folders)
    said = page(rows, acts).replace(SAID, SAID.replace(OVER, OLDER.format(states) + OVER) if states > 1 else SAID)
    PAGE.write_text(with_mujoco(said, sorted(simulated)), encoding="utf-8")
    print(f"Wrote {PAGE}")


def page(every: Iterable[TrialRecord], acts: Sequence[Line] = ()) -> str:
    every = list(every)
    rows = [row for row in every if row["scenario"] in SCENARIOS and all(row[k] == v for k, v in USUAL.items())]
    others = [row for row in every if row not in rows]
    cells = [cell for cell in tally(rows) if cell.trials]
    scenarios = sorted({cell.scenario for cell in cells})
    methods = list(dict.fromkeys(cell.method for cell in cells))
    errors = sorted(dict.fromkeys(cell.robot_error for cell in cells), key=_by_size)
    pooled = [[_pooled(c for c in cells if (c.robot_error, c.method) == (e, m)) for m in methods] for e in errors]
    columns = [(method, scenario) for method in methods for scenario in scenarios]
    of = {(c.robot_error, c.method, c.scenario): f"{c.successes} of {c.trials}" for c in cells}
    each = [[of.get((error, *at), "") for at in columns] for error in errors]
    heads = [f"`{method}`, {scenario}" for method, scenario in columns]
    cost = [
        [_median(r["sim_time_s"] for r in rows if (r["method"], r["scenario"]) == (m, s)) for s in scenarios]
        for m in methods
    ]
    return (
        SAID
        + _table("robot error", [f"`{m}`" for m in methods], errors, pooled)
        + EACH
        + _table("robot error", heads, errors, each)
        + COST
        + _table("method", scenarios, methods, cost)
        + (OTHERS + _others(others) if others else "")
        + (ACTS + "\n" + table(acts) if acts else "")
        + TAUGHT
    )


def _others(rows: Sequence[TrialRecord]) -> str:
    """One line for each combination that is not the usual one."""
    cells = Counter((*(row[key] for key in OTHER_KEYS), row["scenario"], row["method"]) for row in rows)
    won = Counter((*(r[key] for key in OTHER_KEYS), r["scenario"], r["method"]) for r in rows if r["success"])
    lines = ["| robot error | arm | sensor | stated | scenario | method | successes |", f"|{'---|' * 7}"]
    lines += [
        f"| {' | '.join(f'`{name}`' for name in cell)} | {won[cell]} of {cells[cell]} |" for cell in sorted(cells)
    ]
    return "\n" + "\n".join(lines) + "\n"


def _table(first: str, heads: Sequence[str], names: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    lines = [f"| {first} | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    lines += [f"| `{name}` | {' | '.join(said)} |" for name, said in zip(names, cells, strict=True)]
    return "\n" + "\n".join(lines) + "\n"


def _pooled(cells: Iterable[Cell]) -> str:
    those = list(cells)
    trials = sum(cell.trials for cell in those)
    if not trials:
        return ""
    won = sum(cell.successes for cell in those)
    low, high = wilson(won, trials)
    return f"{won} of {trials}, {100 * won / trials:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def _median(seconds: Iterable[float | None]) -> str:
    known = [s for s in seconds if s is not None]
    return f"{median(known):.0f}" if known else ""


def _by_size(error: str) -> tuple[bool, bool, str, float]:
    kind, _, size = error.partition("+")[0].partition(":")
    return kind != "none", "+" in error, kind, float(size.split("/")[0] or 0.0) if size else 0.0


if __name__ == "__main__":
    main()
