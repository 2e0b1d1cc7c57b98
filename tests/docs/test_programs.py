"""The programs of the page "Three programs" that need more than the plain package."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "programs.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"^```python(?: title=\"([^\"]+)\")?\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def program(title: str, **replaced: str) -> str:
    (text,) = [text for name, text in PROGRAMS if name == title]
    for before, after in replaced.items():
        assert before in text
        text = text.replace(before, after)
    return str(text)


def test_ppo_learns_and_is_evaluated() -> None:
    pytest.importorskip("stable_baselines3")
    text = (
        program("ppo.py", dovetail="block_on_block")
        .replace("100_000", "16")
        .replace("env)", "env, n_steps=16, batch_size=16)", 1)
    )
    exec(text.replace("n_eval_episodes=50", "n_eval_episodes=1"), {})


@pytest.mark.extras
def test_step_files_give_a_success_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    build123d = pytest.importorskip("build123d")
    monkeypatch.chdir(tmp_path)
    base = build123d.Pos(0, 0, 10) * build123d.Box(60, 50, 20)
    block = build123d.Pos(0, 0, 40) * build123d.Box(30, 30, 40)
    build123d.export_step(base, "base.step")
    build123d.export_step(block, "block.step")
    exec(
        program("step_to_success.py").replace("seeds=20", "seeds=1").replace("(scenario))", "(scenario, seeds=0))"), {}
    )
    said = capsys.readouterr().out
    assert said.startswith("()\n")
    assert {"uncorrected", "contact"} <= set(said.split())
