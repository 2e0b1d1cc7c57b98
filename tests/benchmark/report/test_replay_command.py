"""Commands in a report run the same trial again."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from apo_bench import TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.benchmark.report.failure_choice import choose_failures
from apo_bench.benchmark.report.report import write_report
from apo_bench.cli import app as cli
from apo_bench.records.run.replay_command import format_number, format_replay_command, round_up_to_ms
from apo_bench.viz.failure_pictures import draw_failures
from tests import pages
from tests.benchmark.analysis.test_rates import row, write

SPEC = TrialConfig("block_on_block", noise_mm=3.0, noise_deg=2.0, human_error_scale=0.0, method="uncorrected", seed=5)
SPECS = (SPEC, replace(SPEC, method="contact"), replace(SPEC, seed=1, noise_mm=10.0, noise_deg=1.0))


@pytest.fixture(scope="module")
def trials() -> list[dict[str, Any]]:
    scene = build_scene(load_scenario("block_on_block"))
    return [run_trial(spec, scene) for spec in SPECS]


def test_commands_of_a_page_give_identical_rows(
    trials: list[dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = write_report(write(tmp_path / "run", trials))
    kept = pages.trials(made.page)
    words = kept["words"]
    columns = kept["columns"]
    for i, seed in enumerate(columns["seed"]):
        command = shlex.split(f"{words['command'][columns['command'][i]]} --seed {seed}")
        assert cli.main([*command[1:], "--json"]) == 0
        again = json.loads(capsys.readouterr().out)
        assert again in json.loads(json.dumps(trials))
        assert words["verdict"][columns["verdict"][i]] in ("right", "loosely right", "failed")
        assert columns["worst_gap_mm"][i] == pytest.approx(again["worst_gap_mm"], abs=5e-4)
        assert words["sentence"][columns["sentence"][i]] == again["sentence"]


def test_a_failure_is_drawn_as_it_ended(trials: list[dict[str, Any]], tmp_path: Path) -> None:
    """From its record, and in the page, linked from its cell."""
    folder = write(tmp_path / "run", trials)
    made, missed = draw_failures(choose_failures(trials, 1), folder, {})
    if missed and "no picture can be drawn here" in missed[0]:
        pytest.skip(missed[0])
    assert made[0].jpeg.startswith(b"\xff\xd8")
    moved = [
        {**r, "final_poses": {part: [x + 30.0, *rest] for part, (x, *rest) in r["final_poses"].items()}} for r in trials
    ]
    elsewhere, _ = draw_failures(choose_failures(moved, 1), write(tmp_path / "moved", moved), {})
    assert elsewhere[0].jpeg != made[0].jpeg
    page = write_report(folder, 1, draw_failures)
    assert page.pictures == 1
    assert 'src="data:image/jpeg;base64,' in page.page.read_text(encoding="utf-8")
    assert list(pages.trials(page.page)["pictures"].values()) == [0]


def test_only_the_method_and_what_is_not_a_default_is_said() -> None:
    usual = {"pose_source": "noise-model", "arm": "six_axis", "timestep_s": 0.001, "fidelity": "full"}
    said = "apo-bench run stick_in_tower --clearance-mm 0.25 --method uncorrected --seed 3"
    assert format_replay_command(row("uncorrected", 3, **usual)) == format_replay_command(row("uncorrected", 3)) == said
    other = row(
        "my mod:it's", 9, noise_mm=0.1, noise_deg=0.3, human_error_scale=0.5, noise="a b.toml",
        contact_source="face-offset:3mm", grasp="weld",
        clearance_mm=0.3, **(usual | {"timestep_s": 0.0005, "fidelity": "near-contact", "arm": "mine:arm"}),
    )  # fmt: skip
    assert shlex.split(format_replay_command(other, {"stick_in_tower": "my dir/tower.toml"})) == shlex.split(
        "apo-bench run 'my dir/tower.toml' --noise-mm 0.1 --noise-deg 0.3 --human-error-scale 0.5 --clearance-mm 0.3 "
        "--noise 'a b.toml' --grasp weld --arm mine:arm --contact-source face-offset:3mm --method \"my mod:it's\" "
        "--timestep-ms 0.5 --fidelity near-contact --seed 9"
    )
    seen = row("contact", 1, noise_mm=0.5, noise_deg=0.0, noise="depth-camera", pose_source="depth-camera")
    given = "--noise-level 0.5 --clearance-mm 0.25 --pose-source depth-camera --method contact --seed 1"
    assert format_replay_command(seen) == f"apo-bench run stick_in_tower {given}"


@pytest.mark.parametrize("x", [0.1, 0.25, 1.0, 3.0, 1e-7, 0.30000000000000004, 12345.678])
def test_numbers_are_read_as_they_were(x: float) -> None:
    assert float(format_number(x)) == x
    assert round_up_to_ms(x * 1e-3) * 1e-3 == x * 1e-3
