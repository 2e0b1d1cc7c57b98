"""Recognised relations where trials, sweeps, reports and the command line meet them."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.benchmark.analysis import tabulate_detection
from apo_bench.cli import app as cli
from apo_bench.records import DETECTED
from apo_bench.trial.trial_stages import SimulatedDemonstration, simulate_demonstration
from tests.benchmark.analysis.test_rates import UNCOUNTED

SEEN = str(Path(__file__).parents[2] / "docs" / "seen.csv")
SPEC = TrialConfig("block_on_block", noise_mm=0.5, noise_deg=0.5, human_error_scale=0.0, method="contact", seed=4)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


@pytest.fixture(scope="module")
def shown(scene: Scene) -> SimulatedDemonstration:
    return simulate_demonstration(scene, 0.0, 4)


def row(contact_source: str, method: str = "contact", seed: int = 0, **changes: Any) -> dict[str, Any]:
    """What a table needs of a row."""
    base = {
        "scenario": "one",
        "noise": "isotropic",
        "pose_source": "noise-model",
        "contact_source": contact_source,
        "human_error_scale": 0.0,
    }
    counts = {"contacts_true_positive": 3, "contacts_false_negative": 0, "contacts_false_positive": 0}
    noise_level = {"noise_mm": 1.0, "noise_deg": 1.0, "seed": seed, "clearance_mm": 0.25, "method": method}
    return base | noise_level | counts | changes


@pytest.mark.parametrize("contact_source", DETECTED)
def test_a_trial_says_how_many_contacts_were_recognised(
    scene: Scene, shown: SimulatedDemonstration, contact_source: str
) -> None:
    made = run_trial(TrialConfig(**(asdict(SPEC) | {"contact_source": contact_source})), scene, simulated=shown)
    assert made["success"] is True
    assert (made["contacts_true_positive"], made["contacts_false_negative"], made["contacts_false_positive"]) == (
        2,
        0,
        0,
    )
    assert (made["contact_source"], made["wrong_contact"]) == (contact_source, None)


def test_an_observation_counts_once_however_many_methods_were_told_it() -> None:
    rows = [row("detected", "paper"), row("detected", "contact"), row("detected", seed=1, contacts_false_negative=1)]
    (found,) = tabulate_detection(
        [*rows, row("given"), row("false-negative"), row("detected", "uncorrected", **UNCOUNTED)]
    )
    assert [found[name] for name in ("demonstrations", "complete", "right", "missed", "false")] == [2, (1, 2), 6, 1, 0]
    assert found["precision"] == 1.0
    assert found["recall"] == pytest.approx(6 / 7)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["detect-contacts", "stick_in_tower", "--contact-source", "given"], "unknown contact source 'given'"),
        (
            ["detect-contacts", "stick_in_tower", "--observation", SEEN, "--noise-level", "1"],
            "--noise-level, which draws a trial",
        ),
    ],
)
def test_wrong_requests_get_one_sentence(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
