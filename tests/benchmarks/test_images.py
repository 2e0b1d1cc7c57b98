"""The page of pose estimators on images: what its tables and sentences count."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench.perception.observation.models.residuals import Residuals
from benchmarks import images


def residuals(far_mm: list[float]) -> Residuals:
    """Estimates with these errors along the ray; NaN for a part without one."""
    n = len(far_mm)
    shift = np.column_stack([np.zeros((n, 2)), far_mm])
    shift[np.isnan(far_mm)] = np.nan
    turn = np.where(np.isfinite(shift), [[0.0, 0.0, 1.0]], np.nan)
    where = np.column_stack([np.ones(n), np.arange(n), np.ones(n)]).astype(np.int64)
    return Residuals(where, shift, turn, turn[:, 2], np.ones(n))


def rows(rate: float) -> list[dict[str, float | str]]:
    numbers = {"success": rate, "low": rate / 2, "high": 100.0, "vsd": 95.0, "mssd": 90.0, "mspd": 80.0, "add": 70.0}
    return [{"scenario": "dovetail", "method": m, **numbers} for m in ("uncorrected", *images.METHODS, "oracle")]


def test_missing_estimates_and_outliers_are_counted() -> None:
    said = images.describe_misses(residuals([1.0, 2.0, np.nan, 60.0, 3.0]))
    assert "Of 5 parts, 20.0 % have no estimate" in said
    assert "25.0 % of the estimates are more than 50 mm off" in said


def test_errors_stand_next_to_those_of_megapose() -> None:
    lines = images.list_errors(residuals([2.0] * 50))
    along = next(line for line in lines if line[0].startswith("along"))
    assert all(cell.startswith("2.00 / ") for cell in along[1:])
    assert next(line for line in lines if line[0].startswith("rotation"))[1].startswith("1.00 / ")


def test_the_page_says_that_these_are_renderings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "PAGE", tmp_path / "page.md")
    both = {0.0: rows(50.0), 1.0: rows(10.0)}
    images.write_page(both, dict.fromkeys(both, residuals([2.0] * 50)), 20)
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "a rate here is no forecast for real images" in text
    assert "| dovetail | 95.0 | 90.0 | 80.0 | 70.0 | 50 (25 to 100) |" in text
    assert "## Ideal human" in text


def test_the_kept_page_is_of_this_form() -> None:
    text = images.PAGE.read_text(encoding="utf-8")
    assert all(f"| {name} |" in text for name in images.SCENARIOS)
    assert "no forecast for real images" in text
