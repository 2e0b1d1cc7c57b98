"""The tables of two versions of MuJoCo are those of the kept file, and a trial that ends otherwise is counted."""

from __future__ import annotations

import json
from typing import Any

from benchmarks.mujoco_versions import FIRST, KEPT, LAST, PAGE, compared, tables


def made(version: str, success: bool, code: str | None, x: float) -> dict[str, Any]:
    told = [success, success, None, code, None]
    rows = [{"group": "all", "key": ["tower", "none", 2.0, 0], "told": told, "reached": {"stick": [x]}}]
    return {"mujoco": version, "seeds": 1, "rows": rows, "probes": {"creep [mm]": 10 * x}}


def test_the_page_shows_what_is_kept() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    shown = PAGE.read_text(encoding="utf-8").split(FIRST)[1].split(LAST)[0]
    assert shown.strip() == tables(kept)


def test_what_differs_is_counted_as_what_it_is() -> None:
    older = made("3.17.0", True, None, 0.01)
    (same,) = compared(older, made("4.0.0", True, None, 0.01))["groups"]
    assert (same["verdicts that differ"], same["otherwise failed"], same["same bits"]) == ([], [], 1)
    found = compared(older, made("4.0.0", False, "collision", 0.02))
    (other,) = found["groups"]
    assert (other["successes"], other["same bits"]) == ([1, 0], 0)
    assert other["verdicts that differ"] == other["otherwise failed"] == [["tower", "none", 2.0, 0]]
    assert "| all | 1 | 1 | 0 | 1 | 0 | 0 |" in tables(found)
    assert "| creep [mm] | 0.1 | 0.2 |" in tables(found)
