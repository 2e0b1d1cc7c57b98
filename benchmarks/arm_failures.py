"""Which failures of arms are foretold: `python benchmarks/arm_failures.py [--trials 2]`.

Two arms that come with the benchmark are made worse: parts with less play, a base out of reach, weak servos, fingers
that give way. Each tries scenarios as an oracle; a failure is caught where the trial's prediction or `arm check` said
so before. Rewrites its section of docs/results/public-arms.md, which benchmarks/public_arms.py leaves out: run it last.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.errors import InputError
from apo_bench.records import TrialSettings
from apo_bench.resources import folder
from apo_bench.scenario import load_scenario
from apo_bench.simulation.arm_checks.arm_check import check_arm
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.building import read_arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.trial import run_trial
from benchmarks.public_arms import PAGE, QUIET, share, warned

ARMS = {"ur5e_primitive": "linkage_gripper.xml", "panda_primitive": "parallel_gripper.xml"}
BEGINS = "\n## Failures that were made\n"
SAID = """
Written by `python benchmarks/arm_failures.py --trials N`: `ur5e_primitive` and `panda_primitive`, made worse. A trial
is warned of where its prediction or `arm check` (with one layout) said so before it; payload, speeds and torques do not
count. `none` is the arms as they are.
"""


class Case(NamedTuple):
    """What is made worse."""

    name: str
    scenarios: tuple[str, ...]
    play_mm: float | None = None
    worse: Callable[[str], Arm] = find_arm


class Trial(NamedTuple):
    kind: str
    right: bool
    warning: str


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--trials", type=int, default=2)
    trials = asked.parse_args().trials
    found: list[Trial] = []
    for case in CASES:
        for arm in ARMS:
            found += tries(case, arm, trials)
            text = PAGE.read_text(encoding="utf-8").partition(BEGINS)[0]
            PAGE.write_text(text + BEGINS + section(found, trials), encoding="utf-8")


def tries(case: Case, name: str, trials: int) -> Iterator[Trial]:
    try:
        arm = case.worse(name)
    except InputError as error:
        print(case.name, name, "refused:", error, flush=True)
        return
    for scenario in case.scenarios:
        loaded = load_scenario(scenario)
        loaded = replace(loaded, clearance_mm=case.play_mm or loaded.clearance_mm)
        missing = [each for each in check_arm(arm, loaded, 1).missing if not each.startswith(QUIET)]
        scene = build_scene(loaded, arm=arm)
        for seed in range(trials):
            asked = TrialSettings(
                scenario, arm=name, level_mm=0.0, level_deg=0.0, careless=0.0, method="oracle", fidelity="contact"
            )
            row = run_trial(replace(asked, seed=seed), scene)
            trial = Trial(case.name, bool(row["success"]), warned(row) or (missing[0] if missing else ""))
            print(name, scenario, *trial, row["failure_code"], flush=True)
            yield trial


def away(x: float) -> Callable[[str], Arm]:
    """The base so far behind the middle of the table, [m]."""
    return lambda name: replace(find_arm(name), base=(x, 0.0, 0.0))


def weak(times: float) -> Callable[[str], Arm]:
    """Every servo so much less stiff, damped as critically."""

    def worse(name: str) -> Arm:
        arm = find_arm(name)

        def softer(line: re.Match[str]) -> str:
            k, b = times * float(line[2]), times**0.5 * float(line[3])
            return f'{line[1]}gainprm="{k:g}" biasprm="0 {-k:g} {-b:g}"'

        pattern = r'(<general name="(?:joint\d+)"[^>]*?)gainprm="([\d.e+]+)" biasprm="0 -[\d.e+]+ -([\d.e+]+)"'
        model, n = re.subn(pattern, softer, str(arm.model))
        assert n == len(arm.joints)
        return replace(arm, model=model)

    return worse


def giving(seconds: float) -> Callable[[str], Arm]:
    """Fingers that are coupled as softly as by a spring and damper of this time constant, [s]; measured anew."""

    def worse(name: str) -> Arm:
        arms = folder("assets") / "arms"
        with tempfile.TemporaryDirectory() as there:
            for each in arms.iterdir():
                text = each.read_text(encoding="utf-8")
                if each.name == ARMS[name]:
                    text = text.replace(
                        'solref="0.004 1" solimp="0.98 0.999', f'solref="{seconds:g} 1" solimp="0.5 0.9'
                    )
                (Path(there) / each.name).write_text(text, encoding="utf-8")
            return replace(read_arm(Path(there) / f"{name}.toml"), files=find_arm(name).files)

    return worse


USUAL = ("peg_in_hole", "stick_in_tower", "shaft_through_brackets")
CASES = (
    Case("play of 0.05 mm", USUAL, 0.05),
    Case("play of 0.03 mm", USUAL, 0.03),
    Case("base at -900 mm", USUAL[:2], None, away(-0.9)),
    Case("base at -1100 mm", USUAL[:2], None, away(-1.1)),
    Case("servos of 5 % stiffness", USUAL, None, weak(0.05)),
    Case("servos of 1 % stiffness", USUAL, None, weak(0.01)),
    Case("fingers coupled at 0.1 s", USUAL[:2], None, giving(0.1)),
    Case("fingers coupled at 0.5 s", USUAL[:2], None, giving(0.5)),
    Case("none", USUAL),
)


def section(found: list[Trial], trials: int) -> str:
    def counts(of: list[Trial]) -> str:
        failed, right = ([bool(t.warning) for t in of if t.right is won] for won in (False, True))
        return f"{len(of)} | {len(failed)} | {sum(failed)} | {sum(right)} of {len(right)}"

    kinds = dict.fromkeys(t.kind for t in found)
    failed, right = ([bool(t.warning) for t in found if t.right is won] for won in (False, True))
    return "\n".join(
        [
            SAID,
            f"Trials of each arm and scenario: {trials}. Failures warned of: {share(failed)}; right trials taken for "
            f"failures: {share(right)}.",
            "",
            "| made worse | trials | failed | of these warned of | right, and warned of |",
            "|---|---|---|---|---|",
            *(f"| {kind} | {counts([t for t in found if t.kind == kind])} |" for kind in kinds),
            "",
        ]
    )


if __name__ == "__main__":
    main()
