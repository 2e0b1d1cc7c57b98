"""Programs of strangers: bounded output, a small environment, checked answers."""

from __future__ import annotations

import json
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.benchmark.scoring import program
from apo_bench.benchmark.scoring.program import LARGEST_ANSWER_BYTES, ask_program, request_line
from tests import round_contacts, scenes

TOWER = scenes.stick_in_tower()
SEEN = scenes.seen(TOWER, TOWER.nominal_poses)
ANSWER = """
request = json.loads(sys.stdin.readline())
print(json.dumps({"poses": [{k: o[k] for k in ("position_mm", "quaternion_wxyz")} for o in request["operations"]]}))
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


def test_a_program_without_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "ANSWER_LIMIT_S", 1.0)
    with pytest.raises(InputError, match="took longer than 1 s and was ended"):
        started(tmp_path, "while True: pass")(SEEN)


def test_a_program_may_write_as_much_as_is_allowed_before_it_reads(tmp_path: Path) -> None:
    spaces = f"import json, sys\nsys.stdout.write(' ' * {LARGEST_ANSWER_BYTES - 100_000})\n"
    assert np.allclose(started(tmp_path, spaces + ANSWER)(SEEN), SEEN.poses)
    with pytest.raises(InputError, match="exit code 3"):
        started(tmp_path, "raise SystemExit(3)")(SEEN)
    with pytest.raises(InputError, match="wrote no answer"):
        started(tmp_path, "")(SEEN)


def test_answers_that_are_not_of_the_observation_are_refused(tmp_path: Path) -> None:
    for answer, said in (
        ("{}", "the key 'poses' is missing"),
        ('{"poses": []}', "3 entries are needed"),
        ("x", "not JSON"),
    ):
        with pytest.raises(InputError, match=said):
            started(tmp_path, f"print({answer!r})")(SEEN)
    spaces = f"print(' ' * {LARGEST_ANSWER_BYTES + 1})"
    with pytest.raises(InputError, match="wrote more than 16 MB"):
        started(tmp_path, spaces)(SEEN)


def test_a_request_states_round_faces_by_their_axes() -> None:
    contact, at, _ = round_contacts.CONTACTS["shaft in hole"]
    observation = round_contacts.seen(*round_contacts.scene(contact, at=at), np.random.default_rng(0))
    faces = json.loads(request_line(observation))["faces"]
    assert {face["kind"] for face in faces.values()} == {"plane", "cylinder"}
    assert set(faces) == {"plate.bottom", "table.top", "pin.shaft", "plate.bore"}
