"""Rows from before there were two verdicts: read as what they said, shown with a word on it, never paired with new."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from apo_bench.cli import app as cli
from apo_bench.errors import InputError
from apo_bench.records.row import ROW_FIELDS
from apo_bench.records.run.run_folder import read_rows
from apo_bench.records.run.verdicts import AS_DEMONSTRATED, MEANING, SUCCESS, by_verdict, verdict_of
from apo_bench.records.settings import ROW, SETTINGS
from apo_bench.report.compare import compare
from apo_bench.report.report import report
from tests import pages
from tests.statistics.test_rates import row, write

KEPT = Path(__file__).parents[1] / "kept" / "row5"
"""As the last version with one verdict wrote it: 2 scenarios, 2 levels, 3 methods, 2 seeds."""
OLD = "apo-bench/row/5"


def old(seed: int, success: bool | None, **more: Any) -> dict[str, Any]:
    made = row("contact", seed, success, schema=OLD, **more)
    del made["as_demonstrated"]
    return made


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    return Path(shutil.copytree(KEPT, tmp_path / "kept"))


def test_every_schema_before_has_a_meaning() -> None:
    assert list(MEANING) == [*(f"apo-bench/row/{version}" for version in (2, 3, 4, 5, 6)), ROW]


def test_an_old_success_is_read_as_as_demonstrated(kept: Path) -> None:
    raw = [json.loads(line) for line in (kept / "trials.jsonl").read_text(encoding="utf-8").splitlines()]
    rows = read_rows(kept)
    assert [r["as_demonstrated"] for r in rows] == [r["success"] for r in raw]
    assert {r["as_demonstrated"] for r in rows} == {True, False}
    assert {r["success"] for r in rows} == {None}
    said = {name: value for name, value in raw[0].items() if name != "success"}
    today = {"success": None, "as_demonstrated": raw[0]["success"]}
    usual = {info.column: info.default for info in SETTINGS.values()}
    assert rows[0] == dict.fromkeys(ROW_FIELDS) | usual | said | today
    assert [r["success"] for r in by_verdict(rows, verdict_of(rows, kept))] == [r["success"] for r in raw]


def test_a_report_of_old_rows_is_of_as_demonstrated_and_says_so(kept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(kept), "--pictures", "0"]) == 0
    assert "it is as_demonstrated" in capsys.readouterr().out
    assert "written before the verdict success was given" in pages.words(kept / "report.html")
    cells = pd.read_csv(kept / "tables" / "cells.csv")
    assert (cells["trials"] == 2).all()
    assert (cells["successes"] == cells["as_demonstrated"]).all()
    assert set(cells["successes"]) == {0, 2}
    rows = pd.read_parquet(kept / "tables" / "rows.parquet")
    assert rows["success"].isna().all()
    assert set(rows["as_demonstrated"]) == {True, False}


def test_a_demonstration_that_failed_is_still_left_out(tmp_path: Path) -> None:
    made = report(write(tmp_path / "run", [old(0, True), old(1, False), old(2, None)]))
    (cell,) = made.cells
    assert (made.verdict, cell.trials, cell.successes, cell.excluded) == (AS_DEMONSTRATED, 2, 1, 1)
    new = report(write(tmp_path / "new", [row("contact", 0), row("contact", 1, None)]))
    assert (new.verdict, new.cells[0].trials, new.cells[0].excluded) == (SUCCESS, 1, 1)
    assert "written before the verdict" not in pages.words(new.page)


def test_two_old_folders_are_compared(kept: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(KEPT, tmp_path / "other"))
    lines = (other / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    first = json.loads(lines[0])
    assert first["success"]
    lost = {"success": False, "loose_success": False, "failure_stage": "judge", "failure_code": "gap"}
    (other / "trials.jsonl").write_text("\n".join([json.dumps(first | lost), *lines[1:]]) + "\n", encoding="utf-8")
    found = compare(kept, other)
    assert (found.shared, len(found.changed), found.identical) == (24, 1, 23)
    assert found.agreements[-1].only_first == 1
    assert cli.main(["compare", str(kept), str(other), "--out", str(tmp_path / "made")]) == 0
    assert "it is as_demonstrated" in pages.words(tmp_path / "made" / "compare.html")


@pytest.mark.parametrize("turned", [False, True])
def test_old_and_new_are_not_paired(turned: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = [str(write(tmp_path / "old", [old(0, True)])), str(write(tmp_path / "new", [row("contact", 0)]))]
    assert cli.main(["compare", *(folders[::-1] if turned else folders)]) == 2
    said = capsys.readouterr().err
    assert f"the rows in '{tmp_path / 'old'}' are older" in said
    assert "run the older sweep again" in said


def test_a_folder_has_one_verdict(tmp_path: Path) -> None:
    mixed = write(tmp_path / "mixed", [old(0, True), row("contact", 1)])
    for act in (report, lambda folder: compare(folder, folder)):
        with pytest.raises(InputError, match="whose verdicts are not the same; keep them in folders of their own"):
            act(mixed)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"as_demonstrated": None}, "success and as_demonstrated are null together"),
        ({"success": False, "failure_stage": "judge", "failure_code": "gap"}, "it is true, so success is needed"),
    ],
)
def test_the_two_verdicts_go_together(changed: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"line 1, field as_demonstrated: {said}"):
        read_rows(write(tmp_path / "run", [row("contact") | changed]))
