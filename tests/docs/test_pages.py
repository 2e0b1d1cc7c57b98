"""Commands and Python of README and documentation work: all commands are parsed, quick ones and all Python run.

Each page is a session in an empty folder, from top to bottom. A block with a title is a file of that name. A `text`
block right behind a Python block is what that one prints. What stands on several pages runs on the first of them.
"""

from __future__ import annotations

import json
import math
import re
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import typer

from apo_bench import read_observation
from apo_bench.cli.app import app, main
from apo_bench.scenario.parts.load import load_part

ROOT = Path(__file__).parents[2]
SWEEP = ROOT / "tests" / "kept" / "sweep"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(
    r"^```(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^```$"
    r"(?:\n\n^```text\n(?P<output>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
PARSED_ONLY: Mapping[str, str] = {
    r"sweep ": "minutes: many trials; tests/benchmark/sweeps runs small ones",
    r"report runs/mine$": "draws pictures of failures, which replays them; the one with --max-pictures 0 runs",
    r"report runs/housing$": "needs the sweep",
    r"noise fit ": "needs the results of a pose estimator; tests/perception/observation/test_fit.py runs it",
    r"dataset (make .*--format bop|estimate )": "many images; tests/benchmark/datasets makes small ones",
    r"run .*--noise (empirical:)?mine\.": "needs the files that `noise fit` writes",
    r"run .*--noise megapose-lmo ": "a replay of seconds; test_measured_noise.py runs it",
    r"run .*--video": "half a minute of pictures; tests/cli/test_app.py makes a short film",
    r"run .*--observation seen\.json$": "a replay of seconds; that of docs/seen.csv runs",
    r"run .*--pose-source depth-camera": "many depth images; tests/perception/depth_camera runs them",
    r"inspect depth ": "many depth images; tests/perception/depth_camera runs them",
    r"(view |run .*--view)": "opens a window or serves a page until somebody ends it; tests/viz steps through",
    r"part import ": "needs a CAD file; tests/importers/cad runs it",
    r"assembly import ": "seconds of cutting; notebooks/bracket_from_cad.ipynb runs it in Python",
    r"(scenario show|inspect (graph|poses)) jig\.toml": "needs what `assembly import` writes",
    r"run generated:17 ": "a replay of seconds; the one with a family runs",
    r"recording import tracker|(correct|inspect plan|run) clamp": "needs STEP files; tests/importers reads such files",
    r"scenario check ": "trials of seconds each; tests/importers/assembly runs it without",
    r"(score|leaderboard) ": "minutes: many trials; tests/benchmark/scoring runs small ones",
    r"noise show ": "1000 observations; tests/perception/observation/test_plain.py prints cards",
    r"run stick_in_tower --noise-level 1 --seed 7 --method (uncorrected|contact)$": "seconds each; other pages replay",
}
"""Commands that are not run, by how they begin, and why."""


class Block(NamedTuple):
    """What stands between two fences."""

    language: str
    title: str | None
    text: str
    output: str | None
    """What it prints, where the page shows it."""


class Line(NamedTuple):
    """A command, as a shell would split it."""

    page: Path
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}: {' '.join(self.words)}"


def blocks(page: Path) -> list[Block]:
    return [Block(**found.groupdict()) for found in BLOCK.finditer(page.read_text(encoding="utf-8"))]


def commands(page: Path, block: Block) -> Iterator[Line]:
    """The lines of a shell block that call the program."""
    for line in block.text.replace("\\\n", " ").splitlines() if block.language == "sh" else ():
        words = shlex.split(line, comments=True)
        if words[:1] == ["apo-bench"]:
            yield Line(page, tuple(words[1:]))


LINES = [line for page in PAGES for block in blocks(page) for line in commands(page, block)]


def why_not(line: Line) -> str | None:
    """Why a command is only parsed."""
    return next((why for how, why in PARSED_ONLY.items() if re.match(how, " ".join(line.words))), None)


@pytest.mark.parametrize("line", LINES, ids=str)
def test_the_command_line_takes_every_command_of_the_pages(line: Line) -> None:
    command = typer.main.get_command(app)
    words = list(line.words)
    while hasattr(command, "commands"):
        command = command.commands[words.pop(0)]
    command.make_context("apo-bench", words)


def test_each_reason_not_to_run_a_command_is_of_a_command() -> None:
    assert [how for how in PARSED_ONLY if not any(re.match(how, " ".join(line.words)) for line in LINES)] == []


def test_targets_of_make_and_scripts_that_pages_name_are_there() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in (*PAGES, ROOT / "CONTRIBUTING.md"))
    targets = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert targets is not None
    assert set(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE)) <= set(targets.group(1).split())
    scripts = set(re.findall(r"python ((?:benchmarks|docs)/\w+\.py)", text))
    assert len(scripts) > 5
    assert [script for script in scripts if not (ROOT / script).exists()] == []


def sessions() -> Iterator[tuple[Path, list[Block | Line]]]:
    """What is run of each page, in its order."""
    before: set[object] = set()
    for page in PAGES:
        todo: list[Block | Line] = []
        for block in blocks(page):
            todo += [block] if block.title or (block.language == "python" and block not in before) else []
            todo += [c for c in commands(page, block) if why_not(c) is None and c.words not in before]
            before |= {block, *(line.words for line in commands(page, block))}
        if todo:
            yield page, todo


SESSIONS = dict(sessions())


def same_output(printed: str, shown: str, within: float = 0.02) -> bool:
    """Whether the words are the same, and the numbers to rounding; spaces do not count.

    Args:
        within: Relative and absolute; other processors may round the last digit otherwise.
    """
    words = ["".join(NUMBER.sub("0", text).split()) for text in (printed, shown)]
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=words[0] == words[1])
    return words[0] == words[1] and all(
        math.isclose(float(a), float(b), rel_tol=within, abs_tol=within) for a, b in pairs
    )


def test_pages_and_notebooks_use_what_the_package_exports() -> None:
    """But for contact equations, quantiles of two estimators' noise, tools of parts, dm_env, touches, pairs, learners,
    tracking, tests."""
    code = {page: [block.text for block in blocks(page) if block.language == "python"] for page in PAGES}
    for path in (ROOT / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        code[path] = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    inner = {
        found for texts in code.values() for text in texts for found in re.findall(r"apo_bench\.\w+\.[\w.]+", text)
    }
    inner |= {
        found for texts in code.values() for text in texts for found in re.findall(r"from (apo_bench\.\S+)", text)
    }
    assert sum(map(len, code.values())) > 10
    assert inner == {
        "apo_bench.assembly",
        "apo_bench.correction.calibration",
        "apo_bench.benchmark.datasets",
        "apo_bench.envs",
        "apo_bench.envs.apo_track",
        "apo_bench.envs.policies",
        "apo_bench.envs.searcher",
        "apo_bench.envs.tracking",
        "apo_bench.perception.observation.fitting.quantiles",
        "apo_bench.scenario.parts",
        "apo_bench.scenario.parts.making",
        "apo_bench.testing",
    }


@pytest.mark.parametrize("page", SESSIONS, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_says_works_from_top_to_bottom(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    (tmp_path / "docs").mkdir()
    for name in ("seen.csv", "recording.csv"):
        shutil.copy(ROOT / "docs" / name, tmp_path / "docs")
    if page.name == "report.md":
        for sweep in ("mine", "other"):
            shutil.copytree(SWEEP, tmp_path / "runs" / sweep)
    known = set(sys.modules)
    names = {"__name__": "__main__"}
    for each in SESSIONS[page]:
        if isinstance(each, Line):
            assert main(list(each.words)) == 0, f"{each}: {capsys.readouterr().err}"
        elif each.title is None:
            capsys.readouterr()
            exec(compile(each.text, str(page), "exec"), names)
            printed = capsys.readouterr().out
            assert each.output is None or same_output(printed, each.output), f"{each.text}\nprints\n{printed}"
        else:
            Path(each.title).parent.mkdir(parents=True, exist_ok=True)
            Path(each.title).write_text(each.text, encoding="utf-8")
            assert not each.title.endswith(".xml") or load_part(Path(each.title)).pieces
    for name in set(sys.modules) - known:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


def test_the_example_of_an_observation_file_is_read_as_the_table_that_it_repeats(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "guide" / "measured.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```json\n(.*?)```", text, re.DOTALL)
    path = tmp_path / "seen.json"
    path.write_text(example, encoding="utf-8")
    seen, table = (read_observation(one, "stick_in_tower") for one in (path, ROOT / "docs" / "seen.csv"))
    assert seen.poses.tolist() == table.poses.tolist()
    assert np.allclose(seen.covariance, table.covariance, rtol=1e-12)
