"""What arms of public collections do: `python benchmarks/public_arms.py MENAGERIE [ARM.toml ...] [--trials 10]`.

MENAGERIE is a clone of MuJoCo Menagerie; ARM.toml describes an arm of anybody else. Each is checked at the table of two
scenarios, and tries both as an oracle; refusals are written with their sentences. Writes docs/results/public-arms.md
after each arm. It ships no foreign file.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import mujoco

from apo_bench.errors import InputError
from apo_bench.records import Row, TrialSettings
from apo_bench.scenario import load_scenario
from apo_bench.simulation.arm_checks.arm_check import check_arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.trial import run_trial
from benchmarks.arms import Count

PAGE = Path(__file__).parents[1] / "docs" / "results" / "public-arms.md"
SCENARIOS = ("peg_in_hole", "stick_in_tower")
NARROW = ("shaft_through_brackets",)
"""For grippers that open less than the usual scenarios need."""
MENAGERIE = (
    "agilex_piper",
    "arx_l5",
    "ufactory_lite6",
    "trossen_vx300s",
    "i2rt_yam",
    "franka_fr3",
    "franka_fr3_v2",
    "kuka_iiwa_14",
    "rethink_robotics_sawyer",
    "flexiv_rizon4",
    "universal_robots_ur5e",
    "universal_robots_ur10e",
    "ufactory_xarm7",
    "kinova_gen3",
    "franka_emika_panda",
    "trossen_wx250s",
    "unitree_z1",
    "robotstudio_so101",
    "trs_so_arm100",
)
LAYOUTS = 3
SAID = """\
# Arms of public collections

*Simulated with MuJoCo {mujoco}.*

Written by `python benchmarks/public_arms.py MENAGERIE --trials N`: every arm with what its files say and nothing else,
and the 2F-85 of Menagerie where it has no gripper. The check is `arm check` and what is foretold of trials: `yes` where
nothing but payload, speeds and torques is missing. `oracle` at zero noise with a careful human, `--fidelity contact`.
`reactorx200`, an arm of five joints, is not of Menagerie: its file names the model of the repository
[uncore-team/reactorx200](https://github.com/uncore-team/reactorx200), and nothing else.
"""
QUIET = ("no payload", "no speed", "the torque of a joint")


class Tried(NamedTuple):
    """An arm at a scenario."""

    arm: str
    scenario: str
    at: str
    says: str
    rows: tuple[Row, ...] = ()

    @property
    def yes(self) -> bool:
        return bool(self.rows) and self.says == "yes"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("menagerie", type=Path)
    asked.add_argument("arms", nargs="*", help="Arm files, or names of Menagerie in place of the usual ones.")
    asked.add_argument("--trials", type=int, default=10)
    asked.add_argument("--page", type=Path, default=PAGE)
    given = asked.parse_args()
    os.environ["APO_BENCH_MENAGERIE"] = str(given.menagerie)
    files = [each for each in given.arms if each.endswith(".toml")]
    named = [each for each in given.arms if not each.endswith(".toml")] or MENAGERIE
    tried = []
    for arm in [*(f"menagerie:{name}" for name in named), *files]:
        for each in tries(arm, given.trials):
            print(line(each), flush=True)
            tried.append(each)
            given.page.write_text(page(tried, given.trials), encoding="utf-8")
    print(f"Wrote {given.page}")


def tries(arm: str, trials: int) -> Iterator[Tried]:
    """Every scenario with an arm; the narrow one where a gripper does not open enough."""
    done = 0
    for scenario in (*SCENARIOS, *NARROW):
        if scenario in NARROW and done:
            return
        found = tried(arm, scenario, trials)
        done += not found.says.startswith("refused: operation")
        yield found


def tried(arm: str, scenario: str, trials: int) -> Tried:
    try:
        robot = find_arm(arm)
        at = f"({', '.join(f'{1e3 * x:g}' for x in robot.base)})"
        loaded = load_scenario(scenario)
        scene = build_scene(loaded, arm=robot)
    except InputError as error:
        return Tried(arm, scenario, "", "refused: " + re.sub(r"\S*/", "", str(error)))
    missing = [each for each in check_arm(robot, loaded, LAYOUTS).missing if not each.startswith(QUIET)]
    ideal = TrialSettings(
        scenario, arm=arm, level_mm=0.0, level_deg=0.0, careless=0.0, method="oracle", fidelity="contact"
    )
    rows = tuple(run_trial(replace(ideal, seed=seed), scene) for seed in range(trials))
    foretold = next(filter(None, map(warned, rows)), "")
    says = missing[0] if missing else f"foretold: {foretold}" if foretold else "yes"
    return Tried(arm, scenario, at, says, rows)


def warned(row: Row) -> str:
    """Which failure was foretold; empty where none was."""
    predicted = row["predicted"]
    return predicted["code"] if predicted is not None and predicted["fails"] else ""


def line(each: Tried) -> str:
    won = sum(bool(row["success"]) for row in each.rows)
    ends = Counter(f"{row['failure_stage']}: {row['failure_code']}" for row in each.rows if not row["success"])
    ended = ", ".join(f"{end} {n}" for end, n in ends.most_common()) or "-"
    counts = f"{won} of {len(each.rows)}" if each.rows else "-"
    name = Path(each.arm).stem if each.arm.endswith(".toml") else each.arm.partition(":")[2]
    return f"| `{name}` | {each.scenario} | {each.at} | {each.says} | {counts} | {ended} |"


def page(tried: Sequence[Tried], trials: int) -> str:
    rows = [row for each in tried for row in each.rows]
    sure = [row for each in tried if each.yes for row in each.rows]
    failed = [row for row in rows if not row["success"]]
    right = [row for row in rows if row["success"]]
    yes = share([bool(row["success"]) for row in sure])
    caught, wrongly = (share([bool(warned(row)) for row in of]) for of in (failed, right))
    return "\n".join(
        [
            SAID.format(mujoco=mujoco.__version__),
            f"{trials} trials of each; `oracle` where the check says yes: {yes}. Failures foretold: {caught}; right "
            f"trials taken for failures: {wrongly}.",
            "",
            "| arm | scenario | base, mm | the check says | `oracle` | the others ended |",
            "|---|---|---|---|---|---|",
            *map(line, tried),
            "",
        ]
    )


def share(found: Sequence[bool]) -> str:
    """How many, and 95 % of which rates say so (Wilson)."""
    count = Count(sum(found), len(found))
    return f"{count.text()}, {count.rate()}" if found else "none"


if __name__ == "__main__":
    main()
