"""Rows that are made up for the benchmark of scale are rows that a report can read."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

from apo_bench.records.run.run_folder import report_rows
from benchmarks.scale import AXES, made_up


def test_what_is_made_up_is_read_as_rows(tmp_path: Path) -> None:
    (tmp_path / "trials.jsonl").write_text("".join(json.dumps(row) + "\n" for row in islice(made_up(), 1001)))
    rows = report_rows(tmp_path)
    assert len({tuple(row[axis] for axis in AXES) for row in rows}) == 1000
    assert [row["seed"] for row in rows] == [0] * 1000 + [1]
    assert 0.1 < sum(bool(row["success"]) for row in rows) / 1001 < 0.9
