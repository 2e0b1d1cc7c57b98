"""Random changes of the code: what is changed, and that a test that would notice one does."""

import ast
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks.mutant_draw import drawn, mutants_of
from benchmarks.mutants import outcomes

SOURCE = b'''"""Words."""
MOST: int = 3

def up(x: "int | None", words: list[str]) -> bool:
    """Words, and 4."""
    if x is None or x < MOST:
        raise ValueError(f"{x + 1} is too small")
    words.append("a")
    return not x - 2 == 0.5
'''


def test_each_mutant_is_another_program_at_one_place() -> None:
    mutants = list(mutants_of(SOURCE, "room/a.py"))
    changed = {(mutant.line, mutant.before, mutant.after) for mutant in mutants}
    assert (2, "3", "4") in changed
    assert (6, "x < MOST", "(x <= MOST)") in changed
    assert (6, "x is None or x < MOST", "(x is None and x < MOST)") in changed
    assert (8, 'words.append("a")', "pass") in changed
    assert (9, "x - 2", "(x + 2)") in changed
    assert (9, "0.5", "1.0") in changed
    assert not [after for _, before, after in changed if "int | None" in before], "annotations say nothing"
    assert not [line for line, before, _ in changed if before == "x + 1"], "nor do the words of a message"
    for mutant in mutants:
        end = mutant.begin + len(mutant.before)
        assert SOURCE[mutant.begin : end].decode() == mutant.before
        whole = SOURCE[: mutant.begin] + mutant.after.encode() + SOURCE[end:]
        assert ast.dump(ast.parse(whole)) != ast.dump(ast.parse(SOURCE))


CODE = """from functools import cache

MOST = 4


@cache
def once():
    return 1 + 1


def up(x):
    return x - -1


def unused(x):
    return x * 2
"""
TESTS = """from apo_bench.room.a import MOST, once, up


def test_up():
    assert up(1) == 2


def test_most():
    assert MOST == 4


def test_once_without_a_look():
    once()


def test_once():
    assert once() == 2
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "apo_bench" / "room").mkdir(parents=True)
    (tmp_path / "tests" / "room").mkdir(parents=True)
    (tmp_path / "apo_bench" / "__init__.py").touch()
    (tmp_path / "apo_bench" / "room" / "a.py").write_text(CODE)
    (tmp_path / "tests" / "room" / "test_a.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\npythonpath = .\nmarkers =\n    extras\n")
    for command in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    return tmp_path


def test_a_seed_draws_the_same_mutants(checkout: Path) -> None:
    first, again = (drawn(checkout, 2, np.random.default_rng(3)) for _ in range(2))
    assert first == again
    assert len(set(drawn(checkout, 100, np.random.default_rng(0)))) == 9
    assert drawn(checkout, 100, np.random.default_rng(0), ["other"]) == []


def test_what_a_test_sees_is_noticed(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    mutants = drawn(checkout, 9, np.random.default_rng(0))
    work = tmp_path_factory.mktemp("work")
    ran = outcomes(checkout, mutants, ["room"], work)
    by = {(mutant.line, mutant.before): how for mutant, how in zip(mutants, ran, strict=True)}
    assert by[12, "x - -1"].by.endswith("::test_up")
    assert by[3, "4"].by.endswith("::test_most"), "it is there while the tests are imported"
    assert by[8, "1 + 1"].by.endswith("::test_once"), "although the cache was filled for the test before"
    assert {place for place, how in by.items() if how.passed} == {(16, "x * 2"), (16, "2")}
    assert by[16, "2"].by == "no test reaches it"
    early = {
        json.loads(line)["number"] for line in (work / "copy" / "outcomes.jsonl").open() if '"early": true' in line
    }
    assert [mutants[number - 1].before for number in early] == ["4"], "no other needs a process of its own"
    assert (checkout / "apo_bench" / "room" / "a.py").read_text() == CODE
