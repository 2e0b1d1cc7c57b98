"""Code of the user's that raises: one sentence that says whose it was and what it raised, never a traceback."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError, observe
from apo_bench.cli.app import main
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.wrong_contacts import replace_contacts
from tests import scenes

TOWER = scenes.stick_in_tower()
NOISE_LEVEL = NoiseLevel(1.0, 1.0)
CODE = """
from __future__ import annotations

import math
import numpy as np
from pathlib import Path
from apo_bench.errors import InputError
from apo_bench.perception.observation.models.isotropic import IsotropicNoise

def imports(assembly, shown, rng):
    import no_such_module

def plain(goals, rng):
    raise TypeError("of my own")

plain.deviation_mm = plain.deviation_deg = 1.0

class Slow:
    def __init__(self, level):
        pass

    def __call__(self, goals, rng):
        return goals

    @property
    def deviation_mm(self):
        raise KeyError("no deviation")

"""
RAISED = {
    "imports": "the noise model 'imports' failed: it raised ModuleNotFoundError(",
    "plain": "the noise model 'plain' failed: it raised TypeError('of my own'); correct it, or use another.",
    "Slow": "the noise model 'users_code:Slow' failed: it raised KeyError('no deviation'); correct it, or use another.",
}


@pytest.fixture(autouse=True)
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "users_code.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("users_code", None)


def refused(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert (said.out, said.err.count("\n"), said.err[:11]) == ("", 1, "apo-bench: ")


@pytest.mark.parametrize("name", RAISED)
def test_a_card_and_a_replay_of_noise_that_raises(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["noise", "show", f"users_code:{name}"], RAISED[name], capsys)
    trial = ["run", "stick_in_tower", "--human-error-scale", "0", "--grasp", "weld"]
    refused([*trial, "--noise", f"users_code:{name}"], RAISED[name], capsys)


def _raising(error: Exception) -> Any:
    def users(*given: Any) -> Any:
        raise error

    return users


class Unspeakable(Exception):
    def __repr__(self) -> str:
        raise RuntimeError("not even that")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (KeyError("k"), "failed: it raised KeyError('k'); correct it, or use another."),
        (ValueError("two\nlines."), "failed: two lines; correct it, or use another."),
        (ValueError(np.eye(2)), "failed: [[1. 0.] [0. 1.]]; correct it, or use another."),
        (Unspeakable(), "failed: it raised Unspeakable; correct it, or use another."),
        (InputError("say this."), "say this."),
    ],
)
def test_whatever_is_raised_is_one_line(error: Exception, words: str) -> None:
    seen = scenes.seen(TOWER, TOWER.nominal_poses)
    rng = np.random.default_rng(0)
    with pytest.raises(InputError) as by_noise:
        observe(scenes.shown(TOWER), make_noise(_raising(error), NOISE_LEVEL), rng)
    with pytest.raises(InputError) as by_relations:
        replace_contacts(seen, _raising(error), TOWER.nominal_poses, rng)
    for raised in (by_noise, by_relations):
        assert words in str(raised.value)
        assert "\n" not in str(raised.value)
        assert isinstance(error, InputError) or raised.value.__cause__ is error
