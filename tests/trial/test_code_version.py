"""The code in the hash of a row: every file counts, but those that no trial runs through."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from apo_bench import TrialConfig, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial import fingerprint, inputs
from apo_bench.trial.fingerprint import (
    PACKAGES_WITHOUT_TRIALS,
    code_files,
    config_hash,
    content_hash,
    counts,
    sources,
)
from apo_bench.trial.inputs import own_content

PACKAGE = Path(fingerprint.__file__).parents[1]


def imported(file: Path, *, tables: bool = True) -> set[str]:
    """What a file imports, anywhere in it, and what its tables of names point to."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif (
            tables
            and isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value.startswith("apo_bench.")
        ):
            found.add(node.value.partition(":")[0])
    return {name for name in found if name.startswith("apo_bench")}


def reached(start: Path, *, tables: bool = True) -> set[str]:
    """Every file of the package that a file can come to import, relative to it; the front door leads everywhere."""
    todo = [start]
    seen = {PACKAGE / "__init__.py"}
    while todo:
        file = todo.pop()
        if file in seen:
            continue
        seen.add(file)
        for name in imported(file, tables=tables):
            parts = name.split(".")[1:]
            for i in range(len(parts) + 1):
                place = PACKAGE.joinpath(*parts[:i])
                todo += [p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()]
    return {file.relative_to(PACKAGE).as_posix() for file in seen}


def test_all_that_a_trial_can_reach_counts() -> None:
    run_through = reached(PACKAGE / "trial" / "trial.py")
    assert {
        *("simulation/execution/controller.py", "judging/verdict.py", "perception/detection/contacts.py"),
        "correction/baselines/track.py",
    } <= run_through
    assert [file for file in sorted(run_through) if not counts(file)] == []
    assert run_through <= set(code_files())


def test_a_new_file_counts_unless_it_is_named(tmp_path: Path) -> None:
    for name in ("new.py", "simulation/new.py", "trial/new.py", "envs/new.py", "cli/new.py", "notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "old.py").write_text("")
    found = dict(sources(tmp_path))
    assert sorted(found) == [
        *("cli/new.py", "envs/new.py", "new.py", "simulation/new.py", "trial/new.py"),
    ]
    assert [name for name in sorted(found) if counts(name)] == ["new.py", "simulation/new.py", "trial/new.py"]


def test_what_is_left_out_is_after_the_fact() -> None:
    for name in ("cli/app.py", "benchmark/report/report.py", "benchmark/analysis/rates.py", "benchmark/sweeps/pool.py"):
        assert not counts(name)
    assert {"simulation", "correction", "judging", "trial"}.isdisjoint(PACKAGES_WITHOUT_TRIALS)


@pytest.fixture
def changed_code(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {**code_files(), "judging/verdict.py": "0" * 16}
    monkeypatch.setattr(fingerprint, "code_files", lambda: files)


def hashed() -> str:
    return content_hash(load_scenario("block_on_block"), "block_on_block", find_arm("six_axis").files)


def test_changed_code_changes_the_hash_of_every_row(request: pytest.FixtureRequest) -> None:
    before = hashed()
    assert hashed() == before
    request.getfixturevalue("changed_code")
    assert hashed() != before


def test_line_ends_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_bytes(b"a\r\nb\r\n")
    assert list(sources(tmp_path)) == [("a.py", b"a\nb\n")]


def test_ones_own_code_counts_where_it_makes_noise_relations_or_arms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "own_noise_1.py").write_text("def blur(goals, rng): return goals\n")
    (tmp_path / "own_noise_2.py").write_text("def blur(goals, rng): return goals + 0\n")
    one, two = (own_content("noise", f"own_noise_{k}:blur") for k in (1, 2))
    assert list(one) == ["noise own_noise_1:blur"]
    assert list(one.values()) != list(two.values())
    assert own_content("contact_source", "shifted:3", "given") == own_content("noise", "empirical:x.csv") == {}
    assert own_content("arm", "no_such_module:arm") == own_content("noise", "builtins:print") == {}
    first = config_hash(TrialConfig("block_on_block", noise="own_noise_1:blur"), "ab")
    monkeypatch.setattr(inputs, "_module_digest", lambda module: "other")
    assert config_hash(TrialConfig("block_on_block", noise="own_noise_1:blur"), "ab") != first
