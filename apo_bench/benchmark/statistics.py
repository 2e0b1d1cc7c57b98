"""Success rates with intervals: one cell per scenario, clearance, noise, relations, carelessness, level and method."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, final

CONFIDENCE = 0.95


class Place(NamedTuple):
    """What the trials of a cell have in common: all but the seed."""

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    level: float
    level_deg: float
    method: str


class Interval(NamedTuple):
    """A two-sided confidence interval of a rate."""

    low: float
    high: float


@final
@dataclass(frozen=True)
class Cell:
    """What came out where only seeds differ."""

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    level: float
    level_deg: float
    method: str
    trials: int
    """Trials that count: those whose demonstration was right."""
    successes: int
    """Strict."""
    loose_successes: int
    excluded: int
    """Trials left out of every method alike, since the demonstration itself was not right."""
    failures: Mapping[str, int]
    """`stage: code` -> how many, most frequent first."""

    @property
    def rate(self) -> float | None:
        """Strict success rate; None without a trial that counts."""
        return self.successes / self.trials if self.trials else None

    @property
    def tightness(self) -> float | None:
        """Clearance per side over level, mm per mm: small is tight; None where poses are seen exactly."""
        return self.clearance_mm / self.level if self.level > 0 else None

    @property
    def loose_rate(self) -> float | None:
        return self.loose_successes / self.trials if self.trials else None

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval of the strict rate."""
        return wilson(self.successes, self.trials)


def wilson(successes: int, trials: int) -> Interval:
    """Wilson's score interval at 95 %; nothing is known without trials: 0 to 1."""
    from scipy.stats import binomtest

    if trials == 0:
        return Interval(0.0, 1.0)
    found = binomtest(successes, trials).proportion_ci(confidence_level=CONFIDENCE, method="wilson")
    return Interval(float(found.low), float(found.high))


def rank(method: str) -> int:
    """The ceiling first, then what has no correction, then `contact`, the paper's two ways, and all others."""
    first = ("oracle", "none", "contact", "paper", "paper-track")
    return first.index(method) if method in first else len(first)


def rank_relations(relations: str) -> tuple[int, str]:
    """Right relations first."""
    return int(relations != "given"), relations


def tally(rows: Iterable[Mapping[str, Any]]) -> tuple[Cell, ...]:
    """Count rows into cells, sorted by scenario, clearance, noise, relations, carelessness, method, level.

    Rows of a measured demonstration have no level and belong to no cell.
    """
    groups: dict[Place, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["level"] is not None:
            groups.setdefault(Place(*(row[name] for name in Place._fields)), []).append(row)
    return tuple(_cell(key, groups[key]) for key in sorted(groups, key=order))


def _cell(key: Place, rows: list[Mapping[str, Any]]) -> Cell:
    counted = [row for row in rows if row["success"] is not None]
    why = Counter(f"{row['failure_stage']}: {row['failure_code']}" for row in counted if not row["success"])
    return Cell(
        **key._asdict(),
        trials=len(counted),
        successes=sum(row["success"] for row in counted),
        loose_successes=sum(row["loose_success"] for row in counted),
        excluded=len(rows) - len(counted),
        failures=MappingProxyType(dict(why.most_common())),
    )


def order(k: Place) -> tuple[Any, ...]:
    """How cells are sorted: by what is asked, then by method (`oracle` first), then by level."""
    where = (k.scenario, k.clearance_mm, k.noise, rank_relations(k.relations), k.careless)
    return (*where, rank(k.method), k.method, k.level, k.level_deg)
