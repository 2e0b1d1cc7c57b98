"""An entrant who draws the trials of public seeds again knows the truth; of a salted run it knows nothing."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from apo_bench.benchmark.scoring.entry import read_entry
from apo_bench.cli.app import main

BRACKET = """
scenario = ["l_bracket_on_plate"]
noise_level = [2]
human_error_scale = [0]
trials = 2
fidelity = "near-contact"

[track]
schema = "apo-bench/track/1"
title = "A bracket"
"""


@pytest.mark.slow
def test_a_cheat_scores_no_more_than_who_knows_the_scenario_by_heart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bracket.toml").write_text(BRACKET)
    shutil.copy(Path(__file__).with_name("cheat.py"), tmp_path / "cheat.py")

    def score(name: str, method: str, *more: str) -> float:
        command = ["score", method, "--track", "bracket.toml", "--out", f"{name}.json", "--workers", "1", *more]
        assert main(command) == 0
        return read_entry(tmp_path / f"{name}.json").tracks["bracket"].score

    secret = tmp_path / "secret_seed"
    secret.write_text(f"{bytes(range(32)).hex()}\n")  # of a random one, a guess may be right by luck
    secret.chmod(0o600)
    salted = ("--secret-seed-file", "secret_seed")
    assert score("public", "cheat:cheat") == 100.0
    by_heart = score("by_heart", "nominal", *salted)
    assert by_heart < 100.0
    assert score("verified", "cheat:cheat", *salted) <= by_heart
    assert read_entry(tmp_path / "verified.json").tracks["bracket"].secret_seed is not None
