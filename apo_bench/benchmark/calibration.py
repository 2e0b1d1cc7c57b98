"""Calibration: whether corrections are as uncertain as they say, and whether their test catches wrong relations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, final

from apo_bench.benchmark.method import knows_relations, knows_truth
from apo_bench.benchmark.page.markup import Table
from apo_bench.benchmark.statistics import rank, rank_relations

WORDS = (
    "Over every level, carelessness and clearance. *Covered* is how often the truth lies in the 95 % region that a "
    "correction states. Errors are root mean squares of the planned goals, in directions that the contacts fix, also "
    "over the clearance, and in those that they leave free. A test *fails* where the stated noise does not explain the "
    "correction: a false alarm where the relations are as given, a catch where they are wrong. The *culprit* is how "
    "often the wrong relation, if it is one of those that were told, is in the ambiguity set of a failed test."
)
HEADER = (
    *("scenario", "noise", "relations", "method", "n", "covered", "fixed error", "over clearance", "free error"),
    *("test fails", "culprit"),
)


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


def calibrations(rows: Iterable[Mapping[str, Any]]) -> tuple[Calibration, ...]:
    """One per scenario, noise, relations and method; the oracle has nothing to be calibrated."""
    groups: dict[tuple[str, str, str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["level"] is not None and row["success"] is not None and not knows_truth(row["method"]):
            groups.setdefault((row["scenario"], row["noise"], row["relations"], row["method"]), []).append(row)
    order = sorted(groups, key=lambda k: (k[0], k[1], rank_relations(k[2]), rank(k[3]), k[3]))
    return tuple(_calibration(*key, groups[key]) for key in order)


def calibration_table(found: Sequence[Calibration]) -> Table:
    """For people."""
    return Table(HEADER, [_line(c) for c in found], words=4)


def calibration_lines(found: Sequence[Calibration]) -> list[str]:
    """The same in Markdown, or a sentence where there is nothing to say."""
    return calibration_table(found).markdown("No method was tried.")


def _calibration(
    scenario: str, noise: str, relations: str, method: str, rows: Sequence[Mapping[str, Any]]
) -> Calibration:
    planned = [row for row in rows if row["planned_error_fixed_mm"] is not None]
    fixed = [row["planned_error_fixed_mm"] for row in planned]
    tight = [row["planned_error_fixed_mm"] / row["clearance_mm"] for row in planned if row["clearance_mm"] > 0]
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
        fixed_mm=_rms(fixed),
        fixed_over_clearance=_rms(tight),
        free_mm=_rms([row["planned_error_free_mm"] for row in planned]),
        failed_tests=Share(len(failed), len(tested)),
        culprits=Share(sum(row["wrong_relation"] in row["suspects"] for row in known), len(known)),
    )


def _line(c: Calibration) -> tuple[object, ...]:
    errors = (_number(c.fixed_mm, " mm"), _number(c.fixed_over_clearance, ""), _number(c.free_mm, " mm"))
    told = c.relations if knows_relations(c.method) else "any"
    return (c.scenario, c.noise, told, c.method, c.planned, c.covered, *errors, c.failed_tests, c.culprits)


def _rms(numbers: Sequence[float]) -> float | None:
    return math.sqrt(sum(x * x for x in numbers) / len(numbers)) if numbers else None


def _number(x: float | None, unit: str) -> str:
    return "–" if x is None else f"{x:.3g}{unit}"
