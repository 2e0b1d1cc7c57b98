"""Precision and recall of recognised contacts over the noise: counted, as a table, as a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.io.csv_file import write_csv
from apo_bench.records.relations import RECOGNISED
from apo_bench.report.page.markup import Table
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import wilson

ALL = "all"
"""Stands for every scenario."""
COLUMNS = (
    *("scenario", "noise", "eye", "relations", "careless", "level_mm", "level_deg", "demonstrations", "complete"),
    *("rate", "low_95", "high_95", "right", "missed", "false", "precision", "recall"),
)
HEADER = (
    *("scenario", "noise", "relations", "careless", "level", "all right", "95 % interval", "precision", "recall"),
    *("missed", "false"),
)
WORDS = (
    "Contacts that were recognised, against those of the scenario: how many demonstrations had all right and none too "
    "many; how many of the recognised contacts are right (precision), and of the right ones were recognised (recall)."
)
NONE = "No method was told relations that were recognised."


class Place(NamedTuple):
    """What the observations that are counted together have in common."""

    scenario: str
    noise: str
    eye: str
    relations: str
    careless: float
    level: float
    level_deg: float


@final
@dataclass(frozen=True)
class Recognition:
    """Contacts of the observations that differ in nothing but the seed."""

    place: Place
    demonstrations: int
    complete: int
    """Demonstrations of which every contact was recognised, and no other."""
    right: int
    missed: int
    false: int

    @property
    def precision(self) -> float | None:
        """Share of the recognised contacts that are right; None if there are none."""
        return self.right / (self.right + self.false) if self.right + self.false else None

    @property
    def recall(self) -> float | None:
        """Share of the right contacts that were recognised."""
        return self.right / (self.right + self.missed) if self.right + self.missed else None


def recognitions(rows: Iterable[Mapping[str, Any]]) -> tuple[Recognition, ...]:
    """One per scenario, noise, eye, way of recognising, carelessness and level; and over all scenarios, where several.

    Methods of one seed were told the same, so each observation counts once.
    """
    seen: dict[tuple[Any, ...], tuple[Place, Mapping[str, Any]]] = {}
    for row in rows:
        if row["relations"] in RECOGNISED and row["contacts_right"] is not None and row["level"] is not None:
            place = Place(*(row[name] for name in Place._fields))
            seen.setdefault((place, row["seed"], row["clearance_mm"]), (place, row))
    several = len({place.scenario for place, _ in seen.values()}) > 1
    groups: dict[Place, list[Mapping[str, Any]]] = {}
    for place, row in seen.values():
        for where in (place, place._replace(scenario=ALL)) if several else (place,):
            groups.setdefault(where, []).append(row)
    return tuple(_counted(place, groups[place]) for place in sorted(groups, key=_order))


def recognition_table(found: Sequence[Recognition]) -> Table:
    """For people."""
    return Table(HEADER, [_line(r) for r in found], words=4)


def recognition_lines(found: Sequence[Recognition]) -> list[str]:
    """The same in Markdown, or a sentence where nothing was recognised."""
    return recognition_table(found).markdown(NONE)


def write_recognitions(found: Sequence[Recognition], path: Path) -> None:
    """One line per place."""
    lines = []
    for r in found:
        rates = (r.complete / r.demonstrations, *wilson(r.complete, r.demonstrations))
        counts = (r.right, r.missed, r.false, r.precision, r.recall)
        lines.append((*r.place, r.demonstrations, r.complete, *rates, *counts))
    write_csv(path, COLUMNS, lines)


def _counted(place: Place, rows: Sequence[Mapping[str, Any]]) -> Recognition:
    right, missed, false = (sum(row[f"contacts_{of}"] for row in rows) for of in ("right", "missed", "false"))
    complete = sum(row["contacts_missed"] == row["contacts_false"] == 0 for row in rows)
    return Recognition(place, len(rows), complete, right, missed, false)


def _order(place: Place) -> tuple[Any, ...]:
    """All scenarios last; the ways of recognising in their own order."""
    kind = RECOGNISED.index(place.relations)
    return (place.scenario == ALL, place.scenario, place.noise, place.eye, kind, place.careless, *place[-2:])


def _line(r: Recognition) -> tuple[object, ...]:
    p, interval = r.place, wilson(r.complete, r.demonstrations)
    noise = p.noise if p.eye == "noise" else p.eye
    level = level_label(p.level, p.level_deg, p.noise)
    complete = f"{r.complete} of {r.demonstrations}"
    between = f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %"
    where = (p.scenario, noise, p.relations, f"{p.careless:g}", level)
    return (*where, complete, between, _share(r.precision), _share(r.recall), r.missed, r.false)


def _share(x: float | None) -> str:
    return "–" if x is None else f"{100 * x:.2f} %"
