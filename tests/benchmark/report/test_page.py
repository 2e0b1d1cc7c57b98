"""The page of a sweep as a browser shows it."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from apo_bench.benchmark.report.report import Report, write_report
from tests import pages
from tests.benchmark.analysis.test_rates import row, write
from tests.browser import browser, opened

EVIL = '<script>document.title="broken"</script>"><img src=x onerror="document.title=1">'
METHODS = ("uncorrected", "contact", "paper", "mine:<b>correct</b>")
SEEDS = 120


def rows() -> list[dict[str, Any]]:
    """Two levels, four methods, a name and a sentence that are markup, a demonstration that failed."""
    made = [row("oracle", seed) for seed in range(SEEDS)]
    for level in (1.0, 2.0):
        for method in METHODS:
            for seed in range(SEEDS):
                success = None if seed == 7 else (seed * 31 + len(method) * int(level)) % 5 > METHODS.index(method) % 3
                made.append(row(method, seed, success, noise_mm=level, noise_deg=level, **numbers(seed, method)))
    made += [row("contact", seed, False, scenario=f"evil {EVIL}", sentence=f"why {EVIL}") for seed in range(3)]
    return made


def numbers(seed: int, method: str) -> dict[str, Any]:
    corrected = {} if method == "uncorrected" else {"gap_after_mm": 1e-9 * (seed + 1)}
    return {"sentence": "said so", "gap_before_mm": 2.0 + seed / 100, "worst_gap_mm": 0.1 + seed * 1e-3, **corrected}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder = write(tmp_path_factory.mktemp("page") / "run", rows())
    keys = ("scenario", "method", "seed", "noise_mm")
    lines = [{**{k: r[k] for k in keys}, "trial_s": 1.0 + r["seed"] / 100, "host": "here", "worker": 0} for r in rows()]
    text = "".join(json.dumps(line) + "\n" for line in lines) + '{"torn'
    (folder / "timing.jsonl").write_text(text, encoding="utf-8")
    run = {"schema": "apo-bench/run/4", "command": "apo-bench sweep x", "versions": {"mujoco": "3.17.0"}, "grids": [{}]}
    (folder / "run.json").write_text(json.dumps(run), encoding="utf-8")
    return write_report(folder)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


def test_the_page_asks_for_nothing_and_says_every_number(made: Report, chromium: Any) -> None:
    with opened(chromium, made.page) as (page, said, asked):
        assert said == []
        assert asked == [made.page.resolve().as_uri()]
        assert page.title() == "Sweep run"
        page.evaluate("document.querySelectorAll('details').forEach(folded => { folded.open = true; })")
        text = page.inner_text("body")
        for line in csv.DictReader(made.tables["conditions"].open(encoding="utf-8")):
            low, high = (f"{100 * float(line[name]):.1f}" for name in ("low_95", "high_95"))
            assert f"{low} to {high} %" in text
            assert f"n {line['trials']}" in text
        for line in csv.DictReader(made.tables["pairs"].open(encoding="utf-8")):
            d, low, high = (100 * float(line[name]) for name in ("difference", "low_95", "high_95"))
            assert f"{d:+.1f} ({low:+.1f} to {high:+.1f})" in text
        assert "3.17.0" in text
        assert "apo-bench sweep x" in text
        assert not re.search(r"https?://(?!www\.w3\.org)", made.page.read_text(encoding="utf-8"))


def test_markup_in_names_and_sentences_is_text(made: Report, chromium: Any) -> None:
    with opened(chromium, made.page) as (page, said, _):
        page.locator("h3", has_text="evil").wait_for()
        page.locator("tr:has(th:text-is('contact')) button.cell[data-title^='evil']").click()
        page.locator(".trials tbody tr").first.wait_for()
        assert f"why {EVIL}" in page.locator(".trials tbody").inner_text()
        assert page.title() == "Sweep run"
        assert page.locator("img[src='x'], body b script").count() == 0
        assert "mine:<b>correct</b>" in page.inner_text("body")
        assert said == []


def test_a_cell_opens_its_trials_with_their_commands(made: Report, chromium: Any) -> None:
    with opened(chromium, made.page) as (page, said, asked):
        button = page.locator("button.cell[data-title*='paper, level 2']")
        button.focus()
        page.keyboard.press("Enter")
        lines = page.locator(".trials tbody tr")
        lines.first.wait_for()
        assert button.get_attribute("aria-expanded") == "true"
        assert lines.count() == 100
        page.locator(".trials .more").click()
        assert lines.count() == SEEDS
        first = lines.nth(3).inner_text()
        assert first.startswith("3")
        assert "2.03" in first
        want = "apo-bench run stick_in_tower --noise-level 2 --clearance-mm 0.25 --method paper --seed 3"
        assert lines.nth(3).locator("code").inner_text() == want
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        lines.nth(3).locator("button.copy").click()
        page.locator("button.copy", has_text="copied").first.wait_for()
        assert page.evaluate("navigator.clipboard.readText()") == want
        page.locator(".trials input").check()
        failed = [r for r in rows() if (r["method"], r["noise_mm"], r["success"]) == ("paper", 2.0, False)]
        assert lines.count() == len(failed)
        page.keyboard.press("Escape")
        assert button.get_attribute("aria-expanded") == "false"
        assert page.locator(".trials").is_hidden()
        assert (said, len(asked)) == ([], 1)


def test_what_is_packed_is_what_the_rows_say(made: Report) -> None:
    kept = pages.trials(made.page)
    assert kept["ends"][-1] == len(rows())
    cells = list(csv.DictReader(made.tables["conditions"].open(encoding="utf-8")))
    first = 0
    for cell, end in zip(cells, kept["ends"], strict=True):
        verdicts = [kept["words"]["verdict"][v] for v in kept["columns"]["verdict"][first:end]]
        assert verdicts.count("right") == int(cell["successes"])
        assert verdicts.count("excluded") == int(cell["excluded"])
        assert kept["columns"]["seed"][first:end] == sorted(kept["columns"]["seed"][first:end])
        first = end


def test_tables_are_the_same_as_parquet(made: Report) -> None:
    from pyarrow import parquet

    for path in made.tables.values():
        lines = list(csv.DictReader(path.open(encoding="utf-8")))
        table = parquet.read_table(path.with_suffix(".parquet"))
        assert table.column_names == list(lines[0])
        assert table.num_rows == len(lines)
    cells = parquet.read_table(made.tables["conditions"].with_suffix(".parquet")).to_pylist()
    assert [cell["rate"] for cell in cells] == [
        float(r["rate"]) for r in csv.DictReader(made.tables["conditions"].open(encoding="utf-8"))
    ]
    kept = parquet.read_table(made.tables["conditions"].with_name("records.parquet"))
    assert kept.num_rows == len(rows())
    assert sum(x is True for x in kept["success"].to_pylist()) == sum(r["success"] is True for r in rows())


@pytest.mark.parametrize(
    "trials",
    [
        [row("contact", i, None) for i in range(3)],
        [row("oracle", i) for i in range(3)],
        [
            row("uncorrected", 0),
            row("contact", 0, contact_source="false-negative"),
            row("contact", 0, grasp="weld", fidelity="near-contact"),
        ],
    ],
    ids=["excluded", "oracle", "conditions"],
)
def test_odd_sweeps_have_a_page(trials: list[dict[str, Any]], tmp_path: Path) -> None:
    made = write_report(write(tmp_path / "run", trials))
    assert len(pages.trials(made.page)["columns"]["seed"]) == sum(r["noise_mm"] is not None for r in trials)
