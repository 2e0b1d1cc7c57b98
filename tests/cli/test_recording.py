"""`apo-bench recording import` from its files to an observation that other commands take."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apo_bench import load_scenario, read_observation
from apo_bench.cli.app import main
from apo_bench.geometry import pose
from apo_bench.scenario.layout import place_layout
from tests.importers.recording.log_forms import FORMS, Tracked
from tests.recorded import CAMERA, seen

NAME = "block_on_block"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    parts = seen(NAME, 0.3)
    tracked = {p: Tracked(p, np.eye(4), track.t, track.T) for p, track in parts.items()}
    FORMS["csv-wxyz"].write(tracked, tmp_path / "log.csv")
    at = pose.pack(CAMERA)[:3] * 1e3
    q = pose.pack(CAMERA)[3:]
    stands = f"at_mm = {at.tolist()}\nquaternion_wxyz = {q.tolist()}"
    (tmp_path / "c.toml").write_text(f'schema = "apo-bench/camera/1"\n[pose]\n{stands}\n', encoding="utf-8")
    ids = "\n".join(f'{part} = {{ id = "{part}" }}' for part in parts)
    (tmp_path / "o.toml").write_text(f'schema = "apo-bench/objects/1"\n[objects]\n{ids}\n', encoding="utf-8")
    return tmp_path


def run(folder: Path, *more: str) -> int:
    files = ("--camera", str(folder / "c.toml"), "--objects", str(folder / "o.toml"))
    return main(["recording", "import", str(folder / "log.csv"), *files, *more])


def test_a_log_becomes_files_that_are_read_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = place_layout(load_scenario(NAME), 0.1, 0.0, 0.3).poses
    extra = ("--picture", str(folder / "p.png"), "--paths-out", str(folder / "p.csv"))
    for out, more in (("a.json", ("--scenario", NAME, *extra)), ("a.csv", ("--scenario", NAME)), ("b.csv", ())):
        assert run(folder, "--out", str(folder / out), *more) == 0
        found = read_observation(folder / out, NAME)
        assert np.abs(pose.log(pose.inverse(wanted) @ found.poses)[:, :3]).max() < 1e-3
    said = capsys.readouterr().out
    assert [line.split(" ")[0] for line in said.splitlines()[:5]] == ["read", "frames", "camera", "placed", "rests"]
    assert "quaternions as wxyz" in said.splitlines()[0]
    assert (folder / "p.png").stat().st_size > 10_000
    assert (folder / "p.csv").read_text(encoding="utf-8").startswith("operation,part,t_s,x_mm")
    assert json.loads((folder / "a.json").read_text(encoding="utf-8"))["scenario"] == NAME


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (("--out", "a.json"), "need --scenario"),
        (("--out", "log.csv", "--scenario", NAME), "is a file that the command reads"),
    ],
)
def test_a_request_that_contradicts_itself_is_one_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], sentence: str
) -> None:
    named = [str(folder / word) if word.endswith((".json", ".csv")) else word for word in more]
    assert run(folder, *named) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1
