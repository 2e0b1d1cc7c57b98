"""Old verdicts against new ones: what decides is told apart."""

from __future__ import annotations

from typing import Any

from benchmarks import verdicts

OLD = {"scenario": "s", "method": "paper", "level": 1.0, "careless": 0.0, "success": True, "failure_stage": None}


def old(seed: int, **said: Any) -> dict[str, Any]:
    return {**OLD, "seed": seed, "failure_code": None, **said}


def new(seed: int, code: str = "ok", *faults: str, **said: Any) -> dict[str, Any]:
    """A row whose rule of every state found `code`, and whose finished assembly has these faults."""
    right = {"success": not faults, "as_demonstrated": not faults and code == "ok", "as_demonstrated_code": code}
    ended = {"failure_stage": "judge" if faults else None, "failure_code": faults[0] if faults else None}
    conditions = {fault: fault in faults for fault in ("gap", "pushed")}
    return {**OLD, **right, **ended, "seed": seed, "conditions": conditions, "pushed_mm": 1.16, **said}


ROWS = [
    new(0),
    new(1, "ok", "pushed"),
    new(2, "gap"),
    new(3, "gap", "gap"),
    new(4, "pushed", "pushed"),
    new(5, "overlap", "pushed"),
    new(6, "ok", "gap", "pushed"),
    new(7, method="search"),
]
BEFORE = {
    verdicts.key(row): row
    for row in [
        *(old(seed) for seed in (0, 1, 3, 6)),
        *(old(seed, success=False, failure_stage="judge", failure_code="gap") for seed in (2, 4, 5)),
    ]
}


def test_what_decides_is_told_apart() -> None:
    told = {new["seed"]: verdicts.why(new, old) for new, old in verdicts.differing(ROWS, BEFORE)}
    assert told == {
        1: "corners: 1.16 mm",
        3: "the replay ended otherwise: right before, judge, gap now (gap)",
        6: "only the finished assembly is wrong: gap",
    }


def test_a_success_is_lost_at_corners_if_nothing_else_is_wrong() -> None:
    assert [row["seed"] for row in verdicts.lost(ROWS)] == [1, 5]


def test_cells_are_counted_and_new_ones_have_no_before() -> None:
    counts = {method: n for (_, method, _, _), n in verdicts.cells(ROWS, BEFORE).items()}
    assert counts == {
        "paper": verdicts.Counts(trials=7, before=4, as_demonstrated=1, success=2, differ=3, lost_at_corners=2),
        "search": verdicts.Counts(trials=1, before=None, as_demonstrated=1, success=1, differ=0, lost_at_corners=0),
    }


def test_the_old_verdicts_are_those_of_the_whole_headline() -> None:
    before = verdicts.old_verdicts()
    assert len(before) == 24400
    assert sum(row["success"] for row in before.values()) == 17343


def test_the_page_lists_seeds() -> None:
    page = "\n".join(verdicts.page(ROWS, BEFORE))
    assert "| s | 0 | 1 | `paper` | 7 | 4 | 1 | 2 | -2 |" in page
    assert "| s | 0 | 1 | `paper` | 1 | corners: 1.16 mm |" in page
