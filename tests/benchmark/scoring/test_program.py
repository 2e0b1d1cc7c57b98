"""Programs and answers of strangers: bounded output, a small environment, answers that are checked before trials."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError, correct
from apo_bench.benchmark.scoring import answers, program
from apo_bench.benchmark.scoring.answers import read_answers, write_request
from apo_bench.benchmark.scoring.entry import read_entry
from apo_bench.benchmark.scoring.program import LARGEST_ANSWER_BYTES, ask_program
from apo_bench.cli.app import main
from apo_bench.correction.correctors import CorrectorMisbehaved
from tests import round_contacts, scenes
from tests.benchmark.scoring.test_score import SMALL

TOWER = scenes.stick_in_tower()
SEEN = scenes.seen(TOWER, TOWER.goals)
ANSWER = """
request = json.loads(sys.stdin.readline())
print(json.dumps({"poses": [{k: o[k] for k in ("position_mm", "quaternion_wxyz")} for o in request["operations"]]}))
"""
ENDLESS = """
import subprocess, sys
from pathlib import Path
child = subprocess.Popen([sys.executable, "-c", "import sys\\nCHILD"])
Path("pid").write_text(str(child.pid))
child.wait()
"""


def started(folder: Path, source: str) -> Any:
    (folder / "program.py").write_text(source)
    return partial(ask_program, (sys.executable, "program.py"), str(folder))


def test_a_program_finds_a_path_and_a_language_in_its_environment_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SECRET_TOKEN", "x")
    monkeypatch.setenv("LANG", "C.UTF-8")
    write = "import json, os, sys\nopen('found', 'w').write(json.dumps(dict(os.environ)))\n"
    goals = started(tmp_path, write + ANSWER)(SEEN)
    assert np.allclose(goals, SEEN.poses)
    found = json.loads((tmp_path / "found").read_text())
    assert found["PATH"] == os.environ["PATH"]
    assert found["LANG"] == "C.UTF-8"
    assert set(found) <= {"PATH", "LANG", "LC_CTYPE", "__CF_USER_TEXT_ENCODING"}  # two that Python and macOS add


@pytest.mark.skipif(sys.platform != "linux", reason="what a program has started is found in /proc")
@pytest.mark.parametrize(
    ("child", "said"),
    [
        (
            "while True: sys.stdout.write('x' * 65536)",
            "wrote more than 16 MB and was ended; one line of JSON is needed",
        ),
        ("while True: pass", "took longer than 1 s and was ended"),
    ],
)
def test_a_program_without_end_is_ended_with_its_children(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, child: str, said: str
) -> None:
    monkeypatch.setattr(program, "ANSWER_LIMIT_S", 1.0)
    with pytest.raises(InputError, match=said):
        started(tmp_path, ENDLESS.replace("CHILD", child))(SEEN)
    command = Path(f"/proc/{(tmp_path / 'pid').read_text()}/cmdline")
    for _ in range(100):
        if not command.exists() or not command.read_bytes():
            return
        time.sleep(0.1)
    pytest.fail("what the program started runs on")


def test_a_program_may_write_as_much_as_is_allowed_before_it_reads(tmp_path: Path) -> None:
    spaces = f"import json, sys\nsys.stdout.write(' ' * {LARGEST_ANSWER_BYTES - 100_000})\n"
    assert np.allclose(started(tmp_path, spaces + ANSWER)(SEEN), SEEN.poses)
    with pytest.raises(InputError, match="exit code 3"):
        started(tmp_path, "raise SystemExit(3)")(SEEN)
    with pytest.raises(InputError, match="wrote no answer"):
        started(tmp_path, "")(SEEN)


def test_a_program_is_told_of_round_faces_by_their_axes(tmp_path: Path) -> None:
    contact, at, _ = round_contacts.CONTACTS["shaft in hole"]
    observation = round_contacts.seen(*round_contacts.scene(contact, at=at), np.random.default_rng(0))
    with pytest.raises(CorrectorMisbehaved, match="the request was written"):
        correct(observation, partial(write_request, str(tmp_path)))
    faces = json.loads(next(tmp_path.iterdir()).read_text())["faces"]
    assert {face["kind"] for face in faces.values()} == {"plane", "cylinder"}
    assert set(faces) == {"plate.bottom", "table.top", "pin.shaft", "plate.bore"}


@pytest.fixture(scope="module")
def requests(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    folder = tmp_path_factory.mktemp("export")
    (folder / "small.toml").write_text(SMALL)
    out = folder / "requests.jsonl"
    assert main(["score", "--export", str(out), "--track", str(folder / "small.toml"), "--workers", "1"]) == 0
    return [json.loads(line) for line in out.read_text().splitlines()]


def is_uncorrected(request: dict[str, Any]) -> dict[str, Any]:
    keys = ("position_mm", "quaternion_wxyz")
    return {"id": request["id"], "poses": [{key: o[key] for key in keys} for o in request["operations"]]}


def lines(answers: list[Any]) -> str:
    return "".join(json.dumps(answer) + "\n" for answer in answers)


def score(folder: Path, text: str) -> int:
    (folder / "small.toml").write_text(SMALL)
    (folder / "goals.jsonl").write_text(text)
    files = [str(folder / name) for name in ("goals.jsonl", "small.toml", "entry.json")]
    return main(["score", "--answers", files[0], "--track", files[1], "--out", files[2], "--workers", "1"])


def _one_pose_less(answers: list[Any]) -> str:
    return lines([answers[0], {**answers[1], "poses": answers[1]["poses"][1:]}])


@pytest.mark.parametrize(
    ("alter", "said"),
    [
        (lambda answers: lines(answers[:1]), "has no answer for 1 of 2 requests of the tracks, such as"),
        (lambda answers: lines([{**answer, "id": f"{i}"} for i, answer in enumerate(answers)]), "2 of 2 requests"),
        (_one_pose_less, "2 goals are needed, 1 were given"),
        (lambda answers: lines([answers[0], answers[0], answers[1]]), "line 2: a second answer for"),
        (lambda answers: lines([{"id": answers[0]["id"]}, answers[1]]), "the key 'poses' is missing"),
        (lambda answers: "these are no answers\n", "this is not JSON"),
    ],
)
def test_answers_that_are_not_those_of_the_track_are_refused_before_a_trial_runs(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    requests: list[dict[str, Any]],
    alter: Callable[[list[Any]], str],
    said: str,
) -> None:
    assert score(tmp_path, alter([is_uncorrected(request) for request in requests])) == 2
    complaint = capsys.readouterr().err.splitlines()[-1]
    assert complaint.startswith("apo-bench: ")
    assert said in complaint
    assert not list(tmp_path.rglob("trials.jsonl"))
    assert not (tmp_path / "entry.json").exists()


def test_a_file_of_answers_may_be_large_and_answer_more_than_is_asked(
    tmp_path: Path, requests: list[dict[str, Any]]
) -> None:
    answers = [is_uncorrected(request) for request in requests]
    others = [{**answers[0], "id": f"another track {i}", "poses": answers[0]["poses"] * 50} for i in range(400)]
    text = lines([*others, *answers]).rstrip("\n")
    assert len(text) > 2_000_000
    assert score(tmp_path, text) == 0
    assert read_entry(tmp_path / "entry.json").tracks["small"].executed == 2
    rows = next((tmp_path / "entry").rglob("trials.jsonl")).read_bytes()
    assert score(tmp_path, text) == 0  # the same command continues
    assert next((tmp_path / "entry").rglob("trials.jsonl")).read_bytes() == rows


def test_a_file_of_answers_has_a_largest_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "LARGEST_ANSWERS_BYTES", 3)
    (tmp_path / "goals.jsonl").write_text("    ")
    with pytest.raises(InputError, match=r"goals\.jsonl"):
        read_answers(tmp_path / "goals.jsonl")
