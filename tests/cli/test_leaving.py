"""Code of a user that calls `sys.exit(0)` is an error in one sentence, not a command that has a result."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench.cli.app import main


@pytest.mark.parametrize(
    "words",
    [
        "detect-contacts block_on_block --noise leaving:Leaves",
        "detect-contacts block_on_block --noise leaving_module:any",
        "arm check leaving:leave block_on_block --layouts 1",
    ],
)
def test_code_that_leaves_is_one_sentence(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "leaving.py").write_text(
        "import sys\ndef leave(*_):\n    sys.exit(0)\nclass Leaves:\n    def __init__(self, *_):\n        sys.exit(0)\n"
    )
    (tmp_path / "leaving_module.py").write_text("raise SystemExit(0)\n")
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "raised SystemExit(0)" in said
