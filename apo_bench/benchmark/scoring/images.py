"""Score the poses of a pose estimator in images of trials: as they are, corrected, and next to the true poses."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.analysis.rates import Rate
from apo_bench.benchmark.scoring.pose_errors import RECALLS, PoseRecall, measure_recall
from apo_bench.benchmark.sweeps.grid import SweepConfig
from apo_bench.benchmark.sweeps.sweep import run_sweep
from apo_bench.formats.bop_images import ImageDescription
from apo_bench.io import group_by
from apo_bench.perception.observation.models import NoiseLevel, PoseResults
from apo_bench.perception.observation.noise import make_noise
from apo_bench.perception.observation.noise_file import SEPARATOR
from apo_bench.records import ESTIMATES
from apo_bench.scenario import load_scenario

_RAW, _TRUE = "uncorrected", "oracle"
_FIDELITY = "near-contact"  # as in the tracks
ALL = "all"
"""Name of the row of all scenarios."""


@check_arguments
def score_poses(
    methods: Sequence[str],
    results: str | Path,
    records: str | Path,
    *,
    deviation: tuple[float, float] = (1.0, 1.0),
    estimator: str | Path | None = None,
    **how: Any,
) -> list[dict[str, Any]]:
    """Replay the trials of a data set of images with the poses of a pose estimator.

    Every trial runs uncorrected, with each method, and with the true poses. Trials whose demonstration failed do not
    count.

    Args:
        methods: As for `run_sweep`.
        results: A results file of the BOP format, in the folder of the data set.
        records: The folder of the records; one with records of the same trials is continued.
        deviation: Standard deviation of the poses per axis that observations state, [mm, degrees].
        estimator: A noise file of `noise fit` whose errors are stated instead.
        how: As for `run_sweep`: `workers`, `backend`, `secret_seed_file`.

    Returns:
        For each scenario, and for all if there are several, and each method: `scenario`, `method`, `trials`,
        `successes`, the rate `success` with its interval `low` to `high`, and recall of the poses, `vsd`, `mssd`,
        `mspd` and `add`, in percent; a recall is None if the true poses are secret.

    Raises:
        InputError: A file is missing, deviates from its format, or is of other images.
    """
    name = f"{ESTIMATES}{results}" + ("" if estimator is None else f"{SEPARATOR}{estimator}")
    poses = make_noise(name, NoiseLevel(*deviation))
    assert isinstance(poses, PoseResults)
    found = measure_recall(poses.folder, poses.description, poses.rows)
    recall = {load_scenario(source).name: each for source, each in found.items()}
    compared = tuple(dict.fromkeys((_RAW, *methods, _TRUE)))
    made = run_sweep(list_grids(poses.description, compared, name, deviation), records, **how)
    successes = group_by(((r["scenario"], r["method"]), r["success"]) for r in made if r["success"] is not None)
    scenarios = list(dict.fromkeys(scenario for scenario, _ in successes))
    rows = []
    for those in (*([scenario] for scenario in scenarios), *[scenarios] * (len(scenarios) > 1)):
        title = those[0] if len(those) == 1 else ALL
        for method in compared:
            several = [success for scenario in those for success in successes[scenario, method]]
            rate = Rate(several.count(True), len(several))
            low, high = rate.interval
            rows.append(
                {
                    "scenario": title,
                    "method": method,
                    "trials": rate.trials,
                    "successes": rate.successes,
                    "success": 100.0 * (rate.rate or 0.0),
                    "low": 100.0 * low,
                    "high": 100.0 * high,
                    **pool_recall([recall[scenario] for scenario in those if scenario in recall]),
                }
            )
    return rows


def list_grids(
    description: ImageDescription, methods: Sequence[str], noise: str, deviation: tuple[float, float]
) -> tuple[SweepConfig, ...]:
    """The grids whose trials are the scenes of a data set."""
    scenes = group_by(((each.scenario, each.clearance_mm), each.seed) for each in description.scenes.values())
    return tuple(
        SweepConfig(
            scenario,
            clearance_mm=(clearance_mm,),
            human_error_scale=description.human_error_scale,
            noise=(noise,),
            noise_level=(deviation,),
            method=methods,
            seed=min(seeds),
            trials=max(seeds) - min(seeds) + 1,
            fidelity=_FIDELITY,
        )
        for (scenario, clearance_mm), seeds in scenes.items()
    )


def pool_recall(several: Iterable[PoseRecall]) -> dict[str, float | None]:
    """Recall over the targets of several scenarios, in percent."""
    found = list(several)
    targets = sum(each.targets for each in found)
    return {
        name: 100.0 * sum(getattr(each, name) * each.targets for each in found) / targets if targets else None
        for name in RECALLS
    }
