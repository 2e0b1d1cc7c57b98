"""The command line: what it prints, where, and how it ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench.cli import app as cli
from apo_bench.cli.method import METHODS as DESCRIBED
from apo_bench.records import METHODS, RECORD_SCHEMA
from apo_bench.scenario.scenario_file import list_scenario_names

SEEN = Path(__file__).parents[2] / "docs" / "seen.csv"
TRIAL = ("run", "stick_in_tower", "--seed", "5", "--grasp", "weld", "--method", "uncorrected")
MEASURED = ("run", "stick_in_tower", "--grasp", "weld", "--method", "uncorrected")
HOPELESS = ("--noise-level", "40")
"""The planner rejects plans at this noise level before the arm moves, so that a trial costs little."""
QUICK = ("--fidelity", "near-contact")


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout, stderr."""
    capsys.readouterr()
    code = cli.main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def first_words(text: str) -> list[str]:
    return [line.split()[0] for line in text.splitlines() if line.strip()]


def test_everything_can_be_listed(capsys: pytest.CaptureFixture[str]) -> None:
    for group, known in (
        ("scenario", list_scenario_names()),
        ("method", (*METHODS, "spiral-search")),
        ("noise", ("isotropic", "outliers", "megapose-lmo")),
        ("arm", ("six_axis", "ur5e_primitive")),
        ("track", ("given", "robot", "(tight)")),
    ):
        code, out, err = run(capsys, group, "list")
        assert (code, err) == (0, "")
        assert set(known) <= set(first_words(out)), group
    assert set(DESCRIBED) == {*METHODS, "spiral-search"}


def test_a_group_alone_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "scenario") == run(capsys, "scenario", "--help")


def test_a_graph_is_printed_as_in_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "inspect", "graph", "pocket_table")
    assert (code, err) == (0, "")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert lines[0] == "pocket_table after operation 6"
    for line in (
        "cube2 (6): T6 T5^-1 T2",
        "cube1 (1): T1 moved on",
        "R4 cube3 -> cube1 made 3, lost at 4 [px-nx]",
        "R8 cube2 -> table made 6 [nz-A_fl px-A_px nx-A_nx py-A_py ny-A_ny]",
    ):
        assert line in lines
    _, out, _ = run(capsys, "inspect", "graph", "pocket_table", "--operation", "3")
    assert "lost" not in out
    assert "R5" not in out


def test_the_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    from importlib.metadata import version

    assert run(capsys, "--version") == (0, f"apo-bench {version('apo_bench')}\n", "")


def test_the_doctor_names_packages_and_missing_extras(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from apo_bench.cli import doctor

    find_version = doctor._find_version
    monkeypatch.setattr(doctor, "_find_version", lambda package: "" if package == "viser" else find_version(package))
    code, out, _ = run(capsys, "doctor")
    lines = {line.split("  ")[0]: " ".join(line.split()) for line in out.splitlines()}
    assert code == 0
    assert f"numpy {np.__version__}" in lines["packages"]
    assert lines["extra view"] == 'extra view missing: viser; install with: pip install "apo_bench[view]"'
    assert lines["rendering"] == "rendering works"


def test_json_is_exactly_one_record(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "run", "block_on_block", "--seed", "5", *QUICK, "--method", "paper", "--json")
    assert (code, err) == (0, "")
    assert out.count("\n") == 1
    record = json.loads(out)
    assert (record["schema"], record["seed"], record["method"]) == (RECORD_SCHEMA, 5, "paper")
    assert record["success"] is True


def test_a_trial_that_fails_is_a_result_in_six_lines(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, *TRIAL, *HOPELESS)
    assert (code, err) == (0, "")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert lines[0] == "trial stick_in_tower, noise level 40, human error scale 1, seed 5"
    assert lines[1].startswith("correction uncorrected, contact gap ")
    assert lines[2].startswith("result failure at stage ")
    assert [line.split()[0] for line in lines[3:]] == ["worst", "predicted", "look"]
    again = lines[5].removeprefix("look at it apo-bench ").removesuffix(" --view").split()
    assert run(capsys, *again, "--json") == run(capsys, *TRIAL, *HOPELESS, "--json")
    verbose = run(capsys, *TRIAL, *HOPELESS, "-v")[1]
    assert [" ".join(line.split()) for line in verbose.splitlines()][:6] == lines
    assert len(verbose.splitlines()) > 8


def test_an_observation_travels_through_a_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "seen.json"
    _, drawn, _ = run(capsys, *TRIAL, *HOPELESS, "--json", "--save-observation", str(path))
    code, measured, err = run(capsys, *MEASURED, "--observation", str(path), "--json")
    assert (code, err) == (0, "")
    before = json.loads(drawn)
    after = json.loads(measured)
    for key in ("success", "failure_stage", "failure_code", "failure_operation"):
        assert after[key] == before[key]
    assert after["gap_before_mm"] == pytest.approx(before["gap_before_mm"], rel=1e-9)
    assert (after["noise_mm"], after["noise"]) == (None, "measured")
    assert after["config_hash"] != before["config_hash"]
    _, out, _ = run(capsys, *MEASURED, "--observation", str(path))
    assert "measured observation" in out


def test_no_result_is_exit_code_one(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from apo_bench.trial import trial_stages

    def fails(*arguments: Any) -> Any:
        simulated = record(*arguments)
        return replace(simulated, demonstration=replace(simulated.demonstration, code="demonstration_failed"))

    record = trial_stages.simulate_demonstration
    monkeypatch.setattr(trial_stages, "simulate_demonstration", fails)
    code, out, _ = run(capsys, *TRIAL, "--json")
    assert code == 1
    assert json.loads(out)["success"] is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*TRIAL, "--method", "papr"), "did you mean 'paper'"),
        ((*MEASURED, "--observation", "x.json", "--noise-level", "1"), "--noise-level was given together with"),
        (("run", "stick_in_tower", "--observation", str(SEEN), "--method", "oracle"), "truth is not known"),
        (("run", "stick_in_towr"), "did you mean 'stick_in_tower'"),
        (("run",), "SCENARIO"),
        (("inspect", "scene", "stick_in_tower", "--out", "/no/such/folder/a.xml"), "cannot be written"),
        (("inspect", "graph", "pocket_table", "--out", "graph.pdf"), "ends in .svg or .png or .mmd"),
    ],
)
def test_a_wrong_request_is_one_sentence(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "run"
    _refused(run(capsys, *(str(out) if a == "OUT" else a for a in arguments)), words)
    assert not out.exists()


def _refused(ended: tuple[int, str, str], words: str) -> None:
    code, out, err = ended
    assert code == 2
    assert out == ""
    assert words in err
    assert err.startswith("apo-bench: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
