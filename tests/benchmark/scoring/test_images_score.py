"""Scores of pose estimators in images: the true poses succeed as those of the oracle, and wrong ones do not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from apo_bench import InputError, TrialConfig, run_trial
from apo_bench.benchmark.scoring.images import score_poses
from apo_bench.benchmark.scoring.pose_errors import RECALLS
from apo_bench.cli.app import main
from apo_bench.formats.bop import EstimatedPose, write_results
from apo_bench.formats.bop_images import read_cameras, read_image_description
from apo_bench.geometry import Array, pose
from apo_bench.trial.run import noise_of
from apo_bench.trial.trial_stages import demonstration_of, observe_demonstration, scene_of
from tests.image_sets import make, write_truth


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("scored") / "set", "fixture_alignment", range(2))


def test_the_true_poses_succeed_as_the_oracle_does(images: Path, tmp_path: Path) -> None:
    exact = score_poses(("contact",), write_truth(images), tmp_path / "exact")
    assert [row["method"] for row in exact] == ["uncorrected", "contact", "oracle"]
    for row in exact:
        assert (row["scenario"], row["successes"], row["trials"]) == ("fixture_alignment", 2, 2)
        assert [row[name] for name in ("success", *RECALLS)] == pytest.approx([100.0] * 5)


def test_wrong_poses_fail_and_are_corrected(tmp_path: Path) -> None:
    """The stick is estimated 5 mm beside its hole, which the contacts with the castles tell."""

    def shift(where: tuple[int, int, int], T: Array) -> Array:
        return pose.at((0.0, 0.005, 0.0)) @ T if where[1] == 3 else T

    path = write_truth(make(tmp_path / "set"), "shifted.csv", shift)
    shifted = score_poses(("contact",), path, tmp_path / "shifted", deviation=(3, 1))
    counts = {row["method"]: row["successes"] for row in shifted}
    assert counts == {"uncorrected": 0, "contact": 1, "oracle": 1}


def test_noise_written_as_results_gives_the_trial_of_that_noise(images: Path) -> None:
    """Poses of the noise model of a seed, written to a file and read again, give the same record."""
    settings = {"noise_mm": 1.0, "noise_deg": 1.0, "human_error_scale": 0.0, "method": "contact"}
    config = TrialConfig("fixture_alignment", seed=1, fidelity="near-contact", **settings)
    scene = scene_of(config)
    simulated = demonstration_of(config, scene)
    seen = observe_demonstration(simulated, noise_of(config, scene, simulated), config.seed)
    description = read_image_description(images)
    entry = description.scenes["2"]
    cameras = read_cameras(images / "test" / "000002")
    rows = []
    for k, operation in enumerate(seen.assembly.operations):
        number = entry.parts[operation.main]
        T = pose.inverse(cameras[k + 1].T_world_camera) @ seen.poses[k] @ description.offset(number)
        rows.append(EstimatedPose((2, k + 1, number), 1.0, T, -1.0))
    write_results(images / "noisy.csv", rows)
    drawn = run_trial(config, scene)
    read = run_trial(replace(config, noise=f"poses:{images / 'noisy.csv'}"), scene)
    assert {**read, "noise": "", "config_hash": ""}.keys() == {**drawn, "noise": "", "config_hash": ""}.keys()
    assert read["success"] == drawn["success"]
    # poses survive the round trip up to rounding
    assert read["planned_error_fixed_mm"] == pytest.approx(drawn["planned_error_fixed_mm"], abs=1e-6)
    assert read["config_hash"] != drawn["config_hash"]


def test_the_command_prints_a_table_and_writes_the_score(
    images: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "score.json"
    path = write_truth(images)
    assert main(["score", "contact", "--poses", str(path), "--out", str(out), "--workers", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(out.read_text(encoding="utf-8"))
    assert [row["method"] for row in printed["rows"]] == ["uncorrected", "contact", "oracle"]
    assert {row["success"] for row in printed["rows"]} == {100.0}
    assert main(["score", "contact", "--poses", str(path), "--track", "given", "--out", str(out)]) == 2
    assert "--track and --poses exclude each other" in capsys.readouterr().err


def test_a_secret_set_is_scored_with_its_secret_only(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    options = ["--format", "bop", "--episodes", "1", "--no-rgb", "--width", "160", "--height", "120"]
    images = tmp_path / "images"
    command = ["dataset", "make", "block_on_block", *options, "--human-error-scale", "0", "--out", str(images)]
    assert main([*command, "--secret-seed-file", str(secret)]) == 0
    rows = [EstimatedPose((1, 1, 1), 1.0, pose.at((0.0, 0.0, 0.9)), -1.0)]
    write_results(images / "results.csv", rows)
    with pytest.raises(InputError, match="the same secret seed"):
        score_poses(("contact",), images / "results.csv", tmp_path / "open")
    scored = score_poses(("contact",), images / "results.csv", tmp_path / "closed", secret_seed_file=secret)
    assert {row["method"]: row["successes"] for row in scored} == {"uncorrected": 0, "contact": 0, "oracle": 1}
    assert all(row[name] is None for row in scored for name in RECALLS)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--format", "bop", "--method", "contact"], "--method has no effect on images"),
        (["--cameras", "2"], "--cameras needs --format bop"),
        (["--format", "bop", "--seed", "1000000"], "seeds of test images are below 1000000"),
        (["--format", "bop", "--split", "val", "--seed", "3"], "seeds of test images are below 1000000"),
        (["--format", "bop", "--split", "train"], "unknown split 'train'"),
    ],
)
def test_options_that_contradict_each_other(
    more: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dataset", "make", "block_on_block", *more, "--out", str(tmp_path / "out")]) == 2
    assert sentence in capsys.readouterr().err
