"""Correctors of one's own, named as `module:name`: imported like any module, and whatever they do is one sentence."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError, Scene, TrialConfig, build_scene, correct, load_scenario
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.trial.run import record_trial
from apo_bench.trial.trial_stages import simulate_demonstration
from tests import scenes

TOWER = scenes.stick_in_tower()
SEEN = scenes.seen(TOWER, TOWER.nominal_poses)
CODE = """
import numpy as np
from apo_bench.assembly.correction_record import Correction
from apo_bench.correction.contact.contact import contact

number = 3

def leaves(seen):
    raise SystemExit(0)

def raises(seen):
    raise ZeroDivisionError(object())

def halves(seen):
    raise ValueError("half a letter: \\ud800 and \\x1b[31m red")

def nonsense(seen):
    return "goals"

def wide(seen):
    goals = np.array(seen.poses)
    goals[:, 0, 3] = 1e9
    return Correction(goals, "converged", "far", (), 0.0, 0.0, 0)

def red(seen):
    return Correction(seen.poses, "converged", "\\x1b[31m red", (), 0.0, 0.0, 0)
"""
MISBEHAVED = {
    "raises": r"it raised ZeroDivisionError\(<object object at 0x\.\.\.>\)",
    "halves": r"half a letter: \? and \\x1b\[31m red",
    "nonsense": "returned a str",
    "wide": r"a position of 1e\+09 m",
    "red": r"returned '\\x1b\[31m red' as its sentence",
}


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    made = tmp_path_factory.mktemp("own")
    (made / "users.py").write_text(CODE)
    (made / "leaves_when_imported.py").write_text("raise SystemExit(0)")
    (made / "broken.py").write_text("def")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(made))
        yield made
    sys.modules.pop("users", None)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


def row_of(scene: Scene, method: str, **more: Any) -> dict[str, Any]:
    settings = TrialConfig("block_on_block", human_error_scale=0.0, method=method, seed=1, **more)
    return dict(record_trial(settings, scene, simulate_demonstration(scene, 0.0, 1), "content"))


def test_a_function_named_by_its_module_is_asked_as_one_by_name() -> None:
    assert correct(SEEN, "users:contact").poses.tobytes() == correct(SEEN, "contact").poses.tobytes()


@pytest.mark.parametrize("name", MISBEHAVED)
def test_a_corrector_that_misbehaves_is_a_failure_with_its_sentence(name: str, scene: Scene) -> None:
    row = row_of(scene, f"users:{name}")
    assert (row["success"], row["failure_stage"], row["failure_code"]) == (False, "correct", "raised")
    assert row["sentence"].isprintable()
    assert re.search(MISBEHAVED[name], row["sentence"])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("users:leves", "did you mean 'leaves'"),
        ("users:number", "is an int; give a function"),
        ("users:", "is not of the form"),
        ("leaves_when_imported:any", "SystemExit"),
    ],
)
def test_what_cannot_be_had_is_refused(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as raised:
        correct(SEEN, name)
    assert not isinstance(raised.value, CorrectorMisbehaved)
