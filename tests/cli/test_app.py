"""The command line: what it prints, where, and how it ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from apo_bench import load_scenario
from apo_bench.cli import app as cli
from apo_bench.cli.method import METHODS as DESCRIBED
from apo_bench.records import METHODS, RECORD_SCHEMA
from apo_bench.records.run.run_folder import read_records
from apo_bench.scenario.file import list_scenario_names

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
        ("track", ("given", "robot", "tight")),
    ):
        code, out, err = run(capsys, group, "list")
        assert (code, err) == (0, "")
        assert set(known) <= set(first_words(out)), group
    assert set(DESCRIBED) == {*METHODS, "spiral-search"}


def test_a_group_alone_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "scenario") == run(capsys, "scenario", "--help")


def test_the_task_sheet_of_a_file_is_that_of_its_scenario(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from apo_bench.resources import folder
    from apo_bench.viz.task_sheet import task_sheet

    sheet = task_sheet(load_scenario("vanished_fixture"))
    assert run(capsys, "scenario", "show", "vanished_fixture") == (0, sheet, "")
    path = tmp_path / "mine.toml"
    path.write_text((folder("scenarios") / "vanished_fixture.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert run(capsys, "scenario", "show", str(path))[1] == sheet.replace("vanished_fixture:", "mine:")


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
    _, out, _ = run(capsys, "inspect", "graph", "pocket_table", "--step", "3")
    assert "lost" not in out
    assert "R5" not in out


def test_a_graph_shows_the_residuals_of_an_observation(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = _castle_aside(tmp_path, 3.0)
    picture = tmp_path / "graph.svg"
    asked = ("inspect", "graph", "stick_in_tower", "--observation", str(path))
    code, out, err = run(capsys, *asked, "--json", "--out", str(picture))
    assert (code, err, out.count("\n")) == (0, "", 1)
    found = json.loads(out)
    assert (found["schema"], found["step"]) == ("apo-bench/graph/1", 3)
    assert [arc["residual_mm"] for arc in found["arcs"]] == pytest.approx([0, 0, 0, 3], abs=1e-6)
    stick = {"part": "stick", "placed": 3, "odl": "T3"}
    assert found["arcs"][3]["manipulated"] == stick
    assert found["nodes"][-1] == {**stick, "stands": True}
    assert picture.read_bytes().startswith(b"<?xml")
    _, out, _ = run(capsys, *asked)
    assert out.splitlines()[-1].endswith("[pz-sfl py-sny ny-spy]  3.000 mm, above 0.1")


def _castle_aside(folder: Path, mm: float) -> Path:
    """An observation of example 5.1 that is right but for the upper castle, which is off along y."""
    from apo_bench import Observation
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.observation_json import observation_form
    from apo_bench.geometry import pose

    scenario = load_scenario("stick_in_tower")
    n = len(scenario.assembly)
    poses = np.array(scenario.goals)
    poses[1] = poses[1] @ pose.at((0.0, mm * 1e-3, 0.0))
    seen = Observation(scenario.assembly, scenario.start, poses, np.tile(np.eye(6) * 1e-6, (n, 1, 1)), np.ones(n, bool))
    write_form(observation_form(seen, "stick_in_tower"), folder / "seen.json")
    return folder / "seen.json"


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


def test_a_scene_is_one_file_that_mujoco_opens(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    import mujoco

    path = tmp_path / "scene.xml"
    code, out, _ = run(capsys, "inspect", "scene", "stick_in_tower", "--out", str(path), "--clearance-mm", "0.4")
    assert code == 0
    assert str(path) in out
    assert mujoco.MjModel.from_xml_path(str(path)).nbody > 5
    (stick,) = (geom for geom in ElementTree.parse(path).iter("geom") if geom.get("name") == "stick/bar")
    assert [float(x) for x in stick.get("size", "").split()] == pytest.approx([0.11, 0.0096, 0.0096])


def test_the_default_method_is_the_same_everywhere() -> None:
    from inspect import signature

    from apo_bench import CorrectPoses, SweepConfig, TrialConfig, correct
    from apo_bench.cli.correct_command import correct_command
    from apo_bench.cli.inspect_poses import poses_command
    from apo_bench.cli.shared import make_trial_options
    from apo_bench.records import CORRECTOR

    commands = [signature(command).parameters["method"].default for command in (correct_command, poses_command)]
    functions = [signature(function).parameters["corrector"].default for function in (CorrectPoses, correct)]
    assert {*commands, *functions, TrialConfig("").method} == {CORRECTOR}
    assert CORRECTOR in SweepConfig(("stick_in_tower",)).method
    assert f"default: {CORRECTOR}." in make_trial_options("method")[0].annotation.__metadata__[0].help


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


def test_a_table_is_replayed_like_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A trial assumes no noise that the file does not state; the graph needs none."""
    measured = ("run", "stick_in_tower", *QUICK, "--observation", str(SEEN), "--method", "contact", "--json")
    code, out, err = run(capsys, *measured)
    assert (code, err, json.loads(out)["success"]) == (0, "", True)
    path = tmp_path / "bare.csv"
    path.write_text("\n".join(",".join(line.split(",")[:9]) for line in SEEN.read_text().splitlines()))
    _refused(run(capsys, *MEASURED, "--observation", str(path)), "standard deviations are missing")
    code, out, err = run(capsys, "inspect", "graph", "stick_in_tower", "--observation", str(path))
    assert (code, err, "mm" in out) == (0, "", True)


def test_without_a_replay_there_is_no_film(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    seen = tmp_path / "seen.json"
    path = tmp_path / "replay.mp4"
    run(capsys, *TRIAL, *HOPELESS, "--save-observation", str(seen))
    document = json.loads(seen.read_text())
    document["operations"][1]["seen"] = False
    seen.write_text(json.dumps(document))
    code, out, err = run(capsys, *MEASURED, "--observation", str(seen), "--video", str(path))
    assert code == 0
    assert "failure at stage observe: not_seen, operation 2" in out
    assert err == "apo-bench: the robot did not replay anything, so there is nothing to see.\n"
    assert not path.exists()


def test_no_result_is_exit_code_one(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from apo_bench.trial import stages

    def fails(*arguments: Any) -> Any:
        simulated = record(*arguments)
        return replace(simulated, demonstration=replace(simulated.demonstration, code="demonstration_failed"))

    record = stages.simulate_demonstration
    monkeypatch.setattr(stages, "simulate_demonstration", fails)
    code, out, _ = run(capsys, *TRIAL, "--json")
    assert code == 1
    assert json.loads(out)["success"] is None


def test_a_sweep_prints_rates_and_its_report_follows(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out_folder = tmp_path / "run"
    options = ("--noise-level", "40", "--human-error-scale", "0", "--method", "uncorrected", "--grasp", "weld")
    some = ("--trials", "2", "--seed", "3", "--workers", "1", "--out", str(out_folder))
    code, out, err = run(capsys, "sweep", "block_on_block", *options, *some)
    assert (code, err) == (0, "")
    assert "0.0 to 65.8 %" in out
    assert [row["seed"] for row in read_records(out_folder)] == [3, 4]
    code, out, err = run(capsys, "report", str(out_folder))
    assert (code, err) == (0, "")
    for name in ("tables/conditions.csv", "report.html"):
        assert str(out_folder / name) in out
        assert (out_folder / name).stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*TRIAL, "--seed", "1.5"), "--seed"),
        ((*TRIAL, "--method", "papr"), "did you mean 'paper'"),
        ((*TRIAL, "--method", "no_such_module:corrector"), "cannot be imported"),
        ((*MEASURED, "--observation", "x.json", "--noise-level", "1"), "--noise-level was given together with"),
        (("run", "stick_in_tower", "--observation", str(SEEN), "--method", "oracle"), "truth is not known"),
        (("run", "stick_in_towr"), "did you mean 'stick_in_tower'"),
        (("run", "stick_in_tower", "--arm", "ur5e"), "did you mean 'ur5e_primitive'"),
        (("run",), "SCENARIO"),
        (("inspect", "scene", "stick_in_tower", "--out", "/no/such/folder/a.xml"), "cannot be written"),
        (("sweep", "stick_in_tower", "--out", "OUT", "--trials", "0"), "trials must be a whole number from 1"),
        (("report", "/no/such/folder"), "holds no sweep"),
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
