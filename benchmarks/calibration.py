"""Are the test and the posterior of `contact` what they say, for every noise model? `python benchmarks/calibration.py`
(ten minutes).

Static draws of the four tasks of the paper at level 1, without play and without a careless human, so that nothing is
wrong but what the noise model draws. Of each model: how often the test fails at a nominal 1 %, whether its p-values are
uniform (Kolmogorov and Smirnov), how often 95 % regions of the goals cover the truth, and the root mean square of
positions as seen, corrected with what operations share left out of the covariance, and corrected. Draws in which an
operation is an outlier or was missed do not count: what is stated is the noise of inliers. Writes
results/calibration.json and the table in docs/how/contact.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import kstest

from apo_bench.assembly import Demonstration, Observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import Array, pose, symmetries
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.fitted import MeasuredNoise, restate
from apo_bench.perception.observation.noise import FAILURES, NOISES, NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import presets, read_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.layout import draw_layout

HERE = Path(__file__).parent
KEPT = HERE / "results" / "calibration.json"
PAGE = HERE.parent / "docs" / "how" / "contact.md"
BEGIN = "<!-- table: python benchmarks/calibration.py -->"
END = "<!-- end of table -->"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
OUTLIER_M = 0.05
"""An operation that is seen farther away is an outlier of models that have them."""


class Draw(NamedTuple):
    """One observation, corrected."""

    seen_mm: float
    alone_mm: float
    joint_mm: float
    p_value: float
    covered: bool | None


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--draws", type=int, default=2000, help="of each model, over all scenarios")
    asked.add_argument("--only", nargs="*", help="these models; nothing is written then")
    asked.add_argument("--stated", help="noise file that is stated in place of what a model states, with --only")
    given = asked.parse_args()
    names = given.only or [*sorted({*NOISES} - {*FAILURES}), *(name for name in presets() if name.endswith("-inliers"))]
    stated = read_noise(given.stated) if given.only and given.stated else None
    found = {name: summary(list(drawn(name, given.draws, stated))) for name in names}
    print(table(found))
    if given.only:
        return
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=HERE, check=True
    )
    kept = {
        "command": f"python benchmarks/calibration.py --draws {given.draws}",
        "commit": commit.stdout.strip(),
        "models": found,
    }
    KEPT.write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    head, rest = page.split(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n\n{table(found)}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def drawn(name: str, draws: int, stated: tuple[MeasuredNoise, Camera] | None = None) -> Iterator[Draw]:
    """Observations of a model in which every operation was seen and none is an outlier."""
    scenarios = [load_scenario(one) for one in SCENARIOS]
    made = 0
    for seed in range(50 * draws):
        if made == draws:
            return
        scenario = scenarios[seed % len(scenarios)]
        rng = np.random.default_rng([seed, 20])
        layout = draw_layout(scenario, rng, 0.0)
        n = len(layout.poses)
        shown = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((n, 6, 6)))
        seen = make_noise(name, NoiseLevel(1.0, 1.0))(scenario.assembly, shown, rng)
        truth = np.array(layout.poses)
        if seen.observed.all() and not any(outliers(name, seen, truth)):
            made += 1
            yield measured(restate(seen, *stated) if stated else seen, truth)


def outliers(name: str, seen: Observation, truth: Array) -> Iterator[bool]:
    """Which operations are worse than the covariance means to say."""
    L = np.linalg.cholesky(seen.covariance)
    xi = pose.log(pose.inverse(truth) @ seen.poses)
    unit = np.linalg.solve(L, xi[..., None])[..., 0]
    yield from np.sqrt((unit**2).mean(axis=1)) > (3.0 if name == "outliers" else np.inf)
    yield from np.linalg.norm(seen.poses[:, :3, 3] - truth[:, :3, 3], axis=1) > OUTLIER_M


def measured(seen: Observation, truth: Array) -> Draw:
    mains = [operation.main for operation in seen.assembly.operations]
    upright = np.array(
        [
            nearest(T, S, symmetries(seen.assembly.solids[main]))
            for T, S, main in zip(truth, seen.poses, mains, strict=True)
        ]
    )
    made = correct(seen, "contact")
    alone = correct(replace(seen, shared=()), "contact")

    def off(goals: Array) -> float:
        return float(1e3 * np.sqrt(np.square(goals[:, :3, 3] - truth[:, :3, 3]).sum(axis=1).mean()))

    p = made.test.p_value if made.test else float("nan")
    return Draw(off(seen.poses), off(alone.poses), off(made.poses), p, contains_truth(seen, made, upright))


def nearest(T: Array, seen: Array, turns: Array) -> Array:
    """Of the poses that fill the same space, the one whose turn is nearest to what was seen."""
    angles = np.linalg.norm(pose.log(pose.inverse(seen) @ T @ turns)[:, 3:], axis=1)
    return np.asarray(T @ turns[int(np.argmin(angles))])


def summary(draws: list[Draw]) -> dict[str, Any]:
    def rms(values: list[float]) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    p = [draw.p_value for draw in draws]
    covered = [draw.covered for draw in draws if draw.covered is not None]
    return {
        "draws": len(draws),
        "seen_mm": rms([draw.seen_mm for draw in draws]),
        "independent_mm": rms([draw.alone_mm for draw in draws]),
        "corrected_mm": rms([draw.joint_mm for draw in draws]),
        "alarms": float(np.mean(np.array(p) < 0.01)),
        "uniform_p": float(kstest(p, "uniform").pvalue),
        "coverage": float(np.mean(covered)),
    }


def table(found: dict[str, dict[str, Any]]) -> str:
    rows = [
        "| noise | draws | seen, mm | independent, mm | corrected, mm | alarms at 1 % | p uniform | regions cover |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, one in found.items():
        rows.append(
            f"| `{name}` | {one['draws']} | {one['seen_mm']:.2f} | {one['independent_mm']:.2f} | "
            f"{one['corrected_mm']:.2f} | {100 * one['alarms']:.1f} % | {one['uniform_p']:.2g} | "
            f"{100 * one['coverage']:.1f} % |"
        )
    return "\n".join(rows)


if __name__ == "__main__":
    main()
