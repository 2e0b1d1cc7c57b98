"""Success rates do not drift: fixed seeds, the same for every method.

Where the physics runs to the same bits as where the verdicts were recorded, every verdict must be the same. Elsewhere
the counts must be plausible for the rates that the README states.

Record anew, after a change that is meant to change results: `python tests/test_success_rate.py`.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from scipy.stats import binom

from apo_bench.benchmark.spec import TrialSpec
from apo_bench.benchmark.stages import show
from apo_bench.benchmark.trial import run_trial
from apo_bench.scenario_file import load_scenario
from apo_bench.simulation.scene import Scene, build_scene

RECORD = Path(__file__).with_name("success_rate.json")
SCENES = ("stick_in_tower", "stick_on_castles")
SEEDS = range(8)
RATES = {"oracle": (0.99, 1.0), "paper": (0.97, 1.0), "none": (0.0, 0.05)}
"""The rates that the README claims, at least and at most."""
SURPRISE = 1e-4
"""A count less likely than this under the claimed rate is a regression."""


def spec(scenario: str, method: str, seed: int) -> TrialSpec:
    level, careless = (0.0, 0.0) if method == "oracle" else (1.0, 1.0)
    return TrialSpec(scenario=scenario, method=method, seed=seed, level_mm=level, level_deg=level, careless=careless)


def verdicts(scene: Scene) -> dict[str, list[bool]]:
    """Strict success of each method for each seed."""
    name = scene.scenario.name
    return {method: [bool(run_trial(spec(name, method, seed), scene)["success"]) for seed in SEEDS] for method in RATES}


def bits(scene: Scene) -> str:
    """A hash of where one demonstration ends: equal where the physics runs to the same bits."""
    final = show(scene, 1.0, 0).demonstration.final
    return hashlib.sha256(b"".join(final[part].tobytes() for part in sorted(final))).hexdigest()[:16]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_success_rates_are_what_they_were(name: str) -> None:
    scene = build_scene(load_scenario(name))
    recorded = json.loads(RECORD.read_text())[name]
    found = verdicts(scene)
    if bits(scene) == recorded["bits"]:
        assert found == recorded["verdicts"]
    for method, (least, most) in RATES.items():
        won = sum(found[method])
        assert binom.cdf(won, len(SEEDS), least) > SURPRISE, f"{method} succeeded only {won} times"
        assert binom.sf(won - 1, len(SEEDS), most) > SURPRISE, f"{method} succeeded {won} times"


if __name__ == "__main__":
    compiled = {name: build_scene(load_scenario(name)) for name in SCENES}
    record = {name: {"bits": bits(scene), "verdicts": verdicts(scene)} for name, scene in compiled.items()}
    RECORD.write_text(json.dumps(record, indent=1) + "\n")
