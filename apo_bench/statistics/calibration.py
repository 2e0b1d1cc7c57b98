"""Calibration: whether corrections are as uncertain as they say, and whether their test catches wrong relations."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

from apo_bench.records.method import knows_truth
from apo_bench.records.row import Row
from apo_bench.statistics.rates import rank, rank_relations


class Share(NamedTuple):
    """So many of so many."""

    of: int
    all: int

    def __str__(self) -> str:
        return f"{100 * self.of / self.all:.1f} % of {self.all}" if self.all else "–"


@final
@dataclass(frozen=True)
class Calibration:
    """Counts and errors over every level, carelessness and clearance of a sweep."""

    scenario: str
    noise: str
    relations: str
    method: str
    planned: int
    """Trials that had a plan whose error is known."""
    covered: Share
    fixed_mm: float | None
    """Root mean square error of planned goals in directions that contacts fix; None if nothing was planned."""
    fixed_over_clearance: float | None
    free_mm: float | None
    failed_tests: Share
    culprits: Share


def calibrations(rows: Iterable[Row]) -> tuple[Calibration, ...]:
    """One per scenario, noise, relations and method; the oracle has nothing to be calibrated."""
    groups: dict[tuple[str, str, str, str], list[Row]] = {}
    for row in rows:
        if row["level"] is not None and row["success"] is not None and not knows_truth(row["method"]):
            groups.setdefault((row["scenario"], row["noise"], row["relations"], row["method"]), []).append(row)
    order = sorted(groups, key=lambda k: (k[0], k[1], rank_relations(k[2]), rank(k[3]), k[3]))
    return tuple(_calibration(*key, groups[key]) for key in order)


def _calibration(scenario: str, noise: str, relations: str, method: str, rows: Sequence[Row]) -> Calibration:
    planned = [(row, error_mm) for row in rows if (error_mm := row["planned_error_fixed_mm"]) is not None]
    tight = [error_mm / row["clearance_mm"] for row, error_mm in planned if row["clearance_mm"] > 0]
    covered = [row["inside_95"] for row in rows if row["inside_95"] is not None]
    tested = [row for row in rows if row["test_passes"] is not None]
    failed = [row for row in tested if not row["test_passes"]]
    known = [row for row in failed if row["wrong_relation"] is not None]
    return Calibration(
        scenario=scenario,
        noise=noise,
        relations=relations,
        method=method,
        planned=len(planned),
        covered=Share(sum(covered), len(covered)),
        fixed_mm=_rms([error_mm for _, error_mm in planned]),
        fixed_over_clearance=_rms(tight),
        free_mm=_rms([row["planned_error_free_mm"] or 0.0 for row, _ in planned]),
        failed_tests=Share(len(failed), len(tested)),
        culprits=Share(sum(row["wrong_relation"] in (row["suspects"] or ()) for row in known), len(known)),
    )


def _rms(numbers: Sequence[float]) -> float | None:
    return math.sqrt(sum(x * x for x in numbers) / len(numbers)) if numbers else None
