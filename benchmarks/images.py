"""The baseline pose estimator on images of four scenarios: pose recall next to success, and its error histogram.

`python benchmarks/images.py FOLDER [--trials N]` makes images, estimates and scores in FOLDER, which it continues, and
writes `docs/results/images.md`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from apo_bench import TrialConfig, load_scenario
from apo_bench.benchmark.datasets.images.estimate import estimate_images
from apo_bench.benchmark.datasets.images.make import make_images
from apo_bench.benchmark.scoring.images import score_poses
from apo_bench.benchmark.scoring.pose_errors import RECALLS
from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_images import ImageConfig
from apo_bench.formats.bop_models import read_symmetries
from apo_bench.formats.bop_truth import read_truth
from apo_bench.perception.observation.fitting.fit import fit_noise
from apo_bench.perception.observation.models.residuals import Residuals, match_residuals
from apo_bench.perception.observation.noise_file import format_noise_file, list_presets, read_noise
from apo_bench.records import FIRST_TRAINING_TRIAL
from benchmarks.provenance import with_mujoco
from benchmarks.rates_by_condition import table

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "results" / "images.md"
SCENARIOS = ("stick_in_tower", "carried_bridge", "dovetail", "peg_in_hole")
SPLITS = {"test": 0, "val": FIRST_TRAINING_TRIAL}  # split -> its first seed
METHODS = ("contact", "contact-robust")
HUMAN_ERROR_SCALES = (0.0, 1.0)
CONFIG = ImageConfig(no_rgb=True)  # the baseline reads depth alone
PERCENTILES = (25, 50, 75, 90, 95)
ERRORS = {"across the ray, mm": "across_mm", "along the ray, mm": "along_mm", "rotation, deg": "angle_deg"}
"""Row of the table of errors -> attribute of `Residuals`."""
DRAWS = 100_000


def make_split(folder: Path, split: str, trials: int, human_error_scale: float) -> Path:
    """Images and estimates of one split; returns the results file."""
    images = folder / split
    own = {name: load_scenario(name).clearance_mm for name in SCENARIOS}
    configs = [
        TrialConfig(name, seed=seed, clearance_mm=clearance_mm, human_error_scale=human_error_scale)
        for name, clearance_mm in own.items()
        for seed in range(SPLITS[split], SPLITS[split] + trials)
    ]
    start = time.process_time()
    count = make_images(configs, images, CONFIG, split=split, command="python benchmarks/images.py")
    print(f"{images}: {count} scenes in {time.process_time() - start:.0f} s of processor time", flush=True)
    results = images / "icp.csv"
    if not results.exists():
        start = time.process_time()
        made = estimate_images(images, results)
        print(f"{made} estimates in {time.process_time() - start:.0f} s of processor time", flush=True)
    return results


def find_residuals(results: Path) -> Residuals:
    """The errors of the estimates of a split."""
    images = results.parent
    rows = read_results(results)
    symmetries = read_symmetries(images / "models" / "models_info.json")
    return match_residuals(rows, read_truth(images / images.name, rows), symmetries)


def list_errors(residuals: Residuals) -> list[list[str]]:
    """Percentiles of the errors of inliers, and next to them those of MegaPose on T-LESS."""
    measured, _ = read_noise(list_presets()["megapose-tless"])
    rng = np.random.default_rng(0)
    shift, turn = measured.shift_mm.draw(DRAWS, rng), measured.turn_deg.draw(DRAWS, rng)
    others = (np.linalg.norm(shift[:, :2], axis=1), np.abs(shift[:, 2]), np.linalg.norm(turn, axis=1))
    lines = []
    for (name, attribute), other in zip(ERRORS.items(), others, strict=True):
        own = getattr(residuals, attribute)[residuals.has_rotation_error]
        ends = [np.percentile(each, PERCENTILES) for each in (own, other)]
        lines.append([name, *(f"{a:.2f} / {b:.2f}" for a, b in zip(*ends, strict=True))])
    return lines


def list_rates(rows: Sequence[dict[str, float | str]]) -> list[list[str]]:
    """Recall and success of each scenario, in percent."""
    rates = {
        (str(row["scenario"]), str(row["method"])): f"{row['success']:.0f} ({row['low']:.0f} to {row['high']:.0f})"
        for row in rows
    }
    recall = {str(row["scenario"]): [f"{row[name]:.1f}" for name in RECALLS] for row in rows}
    methods = ("uncorrected", *METHODS, "oracle")
    return [[name, *numbers, *(rates[name, method] for method in methods)] for name, numbers in recall.items()]


def describe_misses(residuals: Residuals) -> str:
    """A sentence about missing estimates and outliers."""
    found = residuals.is_estimated
    outliers = 1.0 - residuals.is_inlier.sum() / found.sum()
    return (
        f"Of {len(found)} parts, {100.0 * (1.0 - found.mean()):.1f} % have no estimate, those outside of the image "
        f"included; {100.0 * outliers:.1f} % of the estimates are more than 50 mm off."
    )


def write_page(rows: dict[float, list[dict[str, float | str]]], residuals: dict[float, Residuals], trials: int) -> None:
    """Write the page of results.

    Args:
        rows: Human error scale -> rows of the scores.
        residuals: Human error scale -> errors of the estimates.
    """
    methods = (f"`{method}`" for method in ("uncorrected", *METHODS, "oracle"))
    heads = ("`icp`", "VSD", "MSSD", "MSPD", "ADD(-S)", *methods)
    text = [
        "# Pose estimators on images",
        "",
        f"Written by `python benchmarks/images.py` with {trials} trials of each scenario, one camera of 640 x 480",
        "pixels at 0.9 m, and depth noise of 1 mm at 1 m. [The guide](../guide/images.md) runs the same for another",
        "estimator. **These are renderings: a rate here is no forecast for real images.**",
        "",
        "`icp` fits models to the depth of true masks (`apo-bench dataset estimate`); it has no weights. Recall by the",
        "definitions of the BOP benchmark, in percent of all visible parts. Success in percent of the trials, with",
        "Wilson's 95 % interval. The stated covariance is fitted to images with other seeds.",
    ]
    for scale, own in rows.items():
        title = "Ideal human" if scale == 0.0 else "Human error of the scenarios"
        text += ["", f"## {title}", "", *table(heads, list_rates(own)), "", describe_misses(residuals[scale])]
    text += [
        "",
        "## Errors",
        "",
        "Percentiles of the errors of upright estimates within 50 mm, next to those of MegaPose on photographs of",
        "T-LESS (`megapose-tless`, fitted to 4980 published estimates in the test data of the BOP toolkit):",
        "",
        *table(
            ("`icp` / MegaPose on T-LESS", *(f"{p} %" for p in PERCENTILES)), list_errors(residuals[max(residuals)])
        ),
        "",
    ]
    PAGE.write_text(with_mujoco("\n".join(text), [mujoco.__version__]), encoding="utf-8")
    print(f"Wrote {PAGE}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--trials", type=int, default=20)
    given = parser.parse_args()
    rows: dict[float, list[dict[str, float | str]]] = {}
    residuals = {}
    for scale in HUMAN_ERROR_SCALES:
        folder = given.folder / f"human_{scale:g}"
        folder.mkdir(parents=True, exist_ok=True)
        fitted = folder / "icp.toml"
        others = find_residuals(make_split(folder, "val", given.trials // 2, scale))
        fitted.write_text(format_noise_file(fit_noise(others, "icp")), encoding="utf-8")
        results = make_split(folder, "test", given.trials, scale)
        rows[scale] = score_poses(METHODS, results, folder / "records", estimator=fitted)
        residuals[scale] = find_residuals(results)
        print(json.dumps(rows[scale]), flush=True)
    write_page(rows, residuals, given.trials)


if __name__ == "__main__":
    main()
