"""Chi-square of the stated deviations of `APOInsert-v0`: `python -m benchmarks.stated_error SCENARIO ...`.

For each scenario, over the trials that reach the operation: the mean square of true error over stated deviation, in all
six directions and in each, which is 1 where the statement is right.
"""

from __future__ import annotations

import argparse

import numpy as np

from apo_bench import InputError
from apo_bench.envs.apo_insert import ROBOT_ERROR, APOInsert
from apo_bench.envs.insert_spaces import MM_DEG
from apo_bench.scenario.scenario_file import list_scenario_names

FIRST = 8000


def measure_ratios(scenario: str, robot_error: str, trials: range) -> np.ndarray:
    """Return true errors over stated deviations, (n, 6)."""
    env = APOInsert(scenario, robot_error=robot_error)
    ratios = []
    for trial in trials:
        try:
            seen, _ = env.reset(options={"trial": trial})
        except InputError:  # this trial and its replacements fail before the operation
            continue
        true = env.off * MM_DEG
        true[2] += 1e3 * env.control.left
        ratios.append((true - seen["agent_pos"][:6]) / seen["plan"][6:12])
    return np.array(ratios)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="scenarios (all)")
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--robot-error", default=ROBOT_ERROR)
    given = parser.parse_args()
    print("| scenario | starts | chi-square over freedom | of each direction |", "|---|--:|--:|---|", sep="\n")
    for scenario in given.scenarios or list_scenario_names():
        squares = np.square(measure_ratios(scenario, given.robot_error, range(FIRST, FIRST + given.trials)))
        each = ", ".join(f"{mean:.2f}" for mean in squares.mean(axis=0))
        print(f"| {scenario} | {len(squares)} | {squares.mean():.2f} | {each} |", flush=True)


if __name__ == "__main__":
    main()
