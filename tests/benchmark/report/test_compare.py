"""Two sweeps against each other."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from apo_bench.benchmark.analysis import compute_wilson_interval
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.cli import app as cli
from tests import pages
from tests.benchmark.analysis.test_rates import row, write
from tests.browser import browser, opened, overflow

EVIL = "<script>document.title='broken'</script>"


def first() -> list[dict[str, Any]]:
    made = [row("contact", seed, seed % 4 > 0, worst_gap_mm=0.1 + seed / 100) for seed in range(40)]
    made += [row("paper", seed, True, scenario=f"other {EVIL}", worst_gap_mm=0.2) for seed in range(10)]
    return [*made, row("contact", 90, None)]


def second() -> list[dict[str, Any]]:
    """The same at another fidelity: seed 1 fails, seed 0 is right, seed 2 is a little off, seed 3 was not run."""
    made = [{**r, "fidelity": "near-contact"} for r in first() if r["seed"] != 3]
    for r in made:
        if r["scenario"] == "stick_in_tower" and r["seed"] == 1:
            lost = {"success": False, "as_demonstrated": False, "loose_success": True}
            r |= lost | {"failure_stage": "judge", "failure_code": "gap"}
        if r["scenario"] == "stick_in_tower" and r["seed"] == 0:
            won = {"success": True, "as_demonstrated": True, "loose_success": True}
            r |= won | {"failure_stage": None, "failure_code": None}
        if r["scenario"] == "stick_in_tower" and r["seed"] == 2:
            r["worst_gap_mm"] += 0.5
    return [*made, row("contact", 77, True, fidelity="near-contact")]


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    one = write(tmp_path / "one", first())
    two = write(tmp_path / "two", second())
    (one / "run.json").write_text(json.dumps({"versions": {"mujoco": "3.17.0", "numpy": "2.0"}}), encoding="utf-8")
    (two / "run.json").write_text(json.dumps({"versions": {"mujoco": "3.18.0", "numpy": "2.0"}}), encoding="utf-8")
    return one, two


def test_the_same_trials_are_met_whatever_the_fidelity(folders: tuple[Path, Path]) -> None:
    found = compare(*folders)
    assert (found.shared, found.alone) == (49, (2, 1))
    other, tower, every = found.agreements
    counts = ("scenario", "same_verdict", "trials", "right_in_first_alone", "right_in_second_alone", "excluded_in_one")
    assert [tower[name] for name in counts] == ["stick_in_tower", 37, 39, 1, 1, 0]
    assert (other["same_verdict"], other["trials"]) == (9, 9)
    assert (every["same_verdict_low_95"], every["same_verdict_high_95"]) == compute_wilson_interval(46, 48)
    assert [every[name] for name in ("same_stage_and_code", "same_verdicts_in_all", "seeds")] == [46, 37, 39]
    assert [line["seed"] for line in found.changed] == [0, 1]
    (gap,) = (line for line in found.numbers if line["name"] == "worst_gap_mm")
    assert (gap["both"], gap["differ"], gap["alone"]) == (48, 1, 0)
    assert gap["most"] == pytest.approx(0.5)
    assert found.identical == 46
    assert [tuple(line.values()) for line in found.differences] == [
        ("versions: mujoco", "3.17.0", "3.18.0"),
        ("records: fidelity", ["full"], ["near-contact"]),
    ]


def test_the_command_writes_a_page_and_exits_with_0(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made"
    assert cli.main(["compare", *map(str, folders), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Verdicts agree in 46 of 48 (95.83 %): 1 right in the first alone, 1 in the second alone." in said
    assert "versions: mujoco, records: fidelity" in said
    line, _ = csv.DictReader((out / "changed.csv").open(encoding="utf-8"))
    assert line["command of the first"] == "apo-bench run stick_in_tower --clearance-mm 0.25 --method contact --seed 0"
    assert line["command of the second"].endswith("--method contact --fidelity near-contact --seed 0")
    page = pages.lines(out / "compare.html")
    assert "| stick_in_tower | 39 | 37 (94.87 %) | 83.11 to 98.58 % |" in page
    assert "| versions: mujoco | 3.17.0 | 3.18.0 |" in page
    assert EVIL in pages.words(out / "compare.html")
    with browser() as chromium:
        for width in (390, 1280):
            with opened(chromium, out / "compare.html", width) as (tab, noise, asked):
                assert (noise, len(asked)) == ([], 1)
                assert overflow(tab) <= 0
                assert tab.title() == "one against two"


def test_what_cannot_be_compared_is_refused_in_one_sentence(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = str(folders[0])
    apart = write(tmp_path / "apart", [row("contact", 5000)])
    old = write(tmp_path / "old", [row("contact", schema="apo-bench/row/1")])
    twice = write(tmp_path / "twice", [row("contact"), row("contact")])
    empty = write(tmp_path / "empty", [])
    for other, words in (
        (apart, "have no trial in common"),
        (old, "a record of schema 'apo-bench/row/1' was given"),
        (twice, "holds a trial twice"),
        (empty, "holds no finished trial yet"),
        (tmp_path / "nowhere", "holds no sweep"),
    ):
        assert cli.main(["compare", one, str(other)]) == 2
        said = capsys.readouterr()
        assert (words in said.err, said.err.count("\n"), said.out) == (True, 1, "")
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert cli.main(["compare", one, one, "--out", str(tmp_path / "file")]) == 2
    assert "cannot be written" in capsys.readouterr().err
