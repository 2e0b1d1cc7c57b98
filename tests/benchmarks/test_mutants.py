"""Random changes of the code: what is changed, and that a test that would notice one does."""

import ast
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks.mutants import Mutant, drawn, mutants_of, run

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


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "apo_bench" / "room").mkdir(parents=True)
    (tmp_path / "tests" / "room").mkdir(parents=True)
    (tmp_path / "apo_bench" / "__init__.py").touch()
    (tmp_path / "apo_bench" / "room" / "a.py").write_text("def up(x):\n    return x + 1\n\n\nunused = 5\n")
    (tmp_path / "tests" / "room" / "test_a.py").write_text(
        "from apo_bench.room.a import up\n\n\ndef test():\n    assert up(1) == 2\n"
    )
    (tmp_path / "pytest.ini").write_text("[pytest]\npythonpath = .\nmarkers =\n    extras\n")
    for command in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    return tmp_path


def test_a_seed_draws_the_same_mutants(checkout: Path) -> None:
    first, again = (drawn(checkout, 2, np.random.default_rng(3)) for _ in range(2))
    assert first == again
    assert len(set(drawn(checkout, 100, np.random.default_rng(0)))) == 3
    assert drawn(checkout, 100, np.random.default_rng(0), ["other"]) == []


def test_what_a_test_sees_is_noticed(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    work = tmp_path_factory.mktemp("work")
    mutants = {mutant.before: mutant for mutant in drawn(checkout, 3, np.random.default_rng(0))}
    assert not run(checkout, mutants["x + 1"], work).passed
    assert run(checkout, mutants["5"], work).passed
    assert (checkout / "apo_bench" / "room" / "a.py").read_text().endswith("unused = 5\n")


def test_code_that_cannot_be_imported_is_noticed(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    broken = Mutant("room/a.py", 1, "def up(x):", "def up(x:", 0)
    assert not run(checkout, broken, tmp_path_factory.mktemp("work")).passed
