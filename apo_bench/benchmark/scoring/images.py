"""Score the poses of a pose estimator in images of trials: as they are, corrected, and next to the true poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.analysis.rates import Rate
from apo_bench.benchmark.scoring.pose_errors import PoseRecall, measure_recall
from apo_bench.benchmark.sweeps.grid import SweepConfig
from apo_bench.benchmark.sweeps.sweep import run_sweep
from apo_bench.formats.bop_images import ImageDescription
from apo_bench.io import group_by
from apo_bench.perception.observation.models import NoiseLevel, PoseResults
from apo_bench.perception.observation.noise import make_noise
from apo_bench.perception.observation.noise_file import SEPARATOR
from apo_bench.records import ESTIMATES, TrialRecord
from apo_bench.scenario import load_scenario

SCHEMA = "apo-bench/pose-score/1"
_RAW, _TRUE = "uncorrected", "oracle"
_FIDELITY = "near-contact"  # as in the tracks
_ALL = "all"


@final
@dataclass(frozen=True, eq=False)
class PoseScore:
    """Success of a robot with the poses of a pose estimator, and their recall."""

    results: str
    """File of the results."""
    rates: Mapping[str, Mapping[str, Rate]]
    """Scenario, or `all` -> `uncorrected`, the methods, and `oracle` -> successes among trials."""
    recall: Mapping[str, PoseRecall]
    """Scenario -> recall of the poses; empty if the true poses are secret."""

    def list_rows(self) -> list[dict[str, Any]]:
        """One row for each scenario and method, in percent; a recall is repeated for each method."""
        return [
            {
                "scenario": scenario,
                "method": method,
                "trials": rate.trials,
                "success": 100.0 * (rate.rate or 0.0),
                "low": 100.0 * rate.interval.low,
                "high": 100.0 * rate.interval.high,
                **self._list_recall(scenario),
            }
            for scenario, rates in self.rates.items()
            for method, rate in rates.items()
        ]

    def _list_recall(self, scenario: str) -> dict[str, float | None]:
        """Recall in percent; of `all` the mean over all targets."""
        those = [found for name, found in self.recall.items() if scenario in (name, _ALL)]
        targets = sum(found.targets for found in those)
        return {
            name: 100.0 * sum(getattr(found, name) * found.targets for found in those) / targets if targets else None
            for name in ("mssd", "mspd", "add")
        }

    def form(self) -> dict[str, Any]:
        """The score as JSON."""
        return {"schema": SCHEMA, "results": self.results, "rows": self.list_rows()}


@check_arguments
def score_poses(
    methods: Sequence[str],
    results: str | Path,
    records: str | Path,
    *,
    deviation: tuple[float, float] = (1.0, 1.0),
    estimator: str | Path | None = None,
    **how: Any,
) -> PoseScore:
    """Replay the trials of a data set of images with the poses of a pose estimator.

    Every trial runs uncorrected, with each method, and with the true poses.

    Args:
        methods: As for `run_sweep`.
        results: A results file of the BOP format, in the folder of the data set.
        records: The folder of the records; one with records of the same trials is continued.
        deviation: Standard deviation of the poses per axis that observations state, [mm, degrees].
        estimator: A noise file of `noise fit` whose errors are stated instead.
        how: As for `run_sweep`: `workers`, `backend`, `secret_seed_file`.

    Raises:
        InputError: A file is missing, deviates from its format, or is of other images.
    """
    name = f"{ESTIMATES}{Path(results).resolve()}"
    name += "" if estimator is None else f"{SEPARATOR}{Path(estimator).resolve()}"
    poses = make_noise(name, NoiseLevel(*deviation))
    assert isinstance(poses, PoseResults)
    found = measure_recall(poses.folder, poses.description, poses.rows)
    compared = tuple(dict.fromkeys((_RAW, *methods, _TRUE)))
    made = run_sweep(list_grids(poses.description, compared, name, deviation), records, **how)
    return PoseScore(
        results=str(results),
        rates=_count_successes(made, compared),
        recall={load_scenario(source).name: each for source, each in found.items()},
    )


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


def _count_successes(records: Sequence[TrialRecord], methods: Sequence[str]) -> dict[str, dict[str, Rate]]:
    """Scenario -> method -> successes; trials whose demonstration failed do not count."""
    counted = [record for record in records if record["success"] is not None]
    scenarios = list(dict.fromkeys(record["scenario"] for record in counted))
    return {
        scenario: {method: _count(counted, scenario, method) for method in methods}
        for scenario in (*scenarios, *[_ALL] * (len(scenarios) > 1))
    }


def _count(records: Sequence[TrialRecord], scenario: str, method: str) -> Rate:
    those = [r["success"] for r in records if r["method"] == method and scenario in (r["scenario"], _ALL)]
    return Rate(those.count(True), len(those))
