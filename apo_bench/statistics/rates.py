"""Success rates with intervals: one cell per scenario, clearance, noise, relations, carelessness, level, method, grasp,
fidelity, number of looks, robot error, and what a robot that feels is given."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar, final

from apo_bench.errors import InputError
from apo_bench.io import grouped
from apo_bench.records import Row, TrialSettings, one_salt, parsed

CONFIDENCE = 0.95
Line = TypeVar("Line", bound=Mapping[str, Any])
"""A row, or a line of timings."""
NOT_EXECUTED = ("observe", "correct", "promise", "plan", "worker")
"""Stages of failures at which no plan was carried out to its end: there was none, it promised too little, it was
refused before anything moved, or its process died."""


@dataclass(frozen=True)
class Place:
    """What the trials of a cell have in common: all but the seed."""

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    level: float
    level_deg: float
    method: str
    grasp: str = TrialSettings.grasp
    fidelity: str = TrialSettings.fidelity
    looks: int = TrialSettings.looks
    robot_error: str = TrialSettings.robot_error
    wrench: str = TrialSettings.wrench
    stated_error: str = TrialSettings.stated_error
    abstain: float = TrialSettings.abstain
    _replace = replace
    """The place with other values of some fields, as of a named tuple."""


class Interval(NamedTuple):
    """A two-sided confidence interval."""

    low: float
    high: float


class Rate(NamedTuple):
    """So many successes among so many trials."""

    successes: int
    trials: int

    @property
    def rate(self) -> float | None:
        """None without a trial."""
        return self.successes / self.trials if self.trials else None

    @property
    def interval(self) -> Interval:
        """Wilson's at 95 %."""
        return wilson(self.successes, self.trials)


@final
@dataclass(frozen=True, kw_only=True)
class Cell(Place):
    """What came out where only seeds differ."""

    trials: int
    """Trials that count: those whose demonstration was right."""
    successes: int
    """The finished assembly is right."""
    demonstrated: int
    """Successes of which every contact was also made when and where it was shown."""
    loose_successes: int
    not_executed: int
    """Failures of which no plan was carried out: nothing was corrected, too little was promised, the plan was refused
    before anything moved, or the worker died. They count as failures."""
    abstained: int
    """Those of them whose plan promised too little."""
    promised: float | None
    """Mean of what plans promised; None where no plan did."""
    brier: float | None
    """Mean squared difference of promise and success over the trials whose plan promised anything and was executed."""
    excluded: int
    """Trials left out of every method alike, since the demonstration itself was not right."""
    failures: Mapping[str, int]
    """`stage: code` -> how many, most frequent first."""

    @property
    def rate(self) -> float | None:
        """Success rate; None without a trial that counts."""
        return self.successes / self.trials if self.trials else None

    @property
    def tightness(self) -> float | None:
        """Clearance per side over level, mm per mm: small is tight; None where poses are seen exactly."""
        return self.clearance_mm / self.level if self.level > 0 else None

    @property
    def demonstrated_rate(self) -> float | None:
        return self.demonstrated / self.trials if self.trials else None

    @property
    def loose_rate(self) -> float | None:
        return self.loose_successes / self.trials if self.trials else None

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval of the success rate."""
        return wilson(self.successes, self.trials)

    @property
    def executed(self) -> Rate:
        """Success among the trials whose plan was carried out."""
        return Rate(self.successes, self.trials - self.not_executed)

    @property
    def wrong_when_executed(self) -> float | None:
        """Share of failures among the trials whose plan was carried out; None without one."""
        done = self.executed.rate
        return None if done is None else 1.0 - done


@lru_cache(maxsize=65536)
def wilson(successes: int, trials: int) -> Interval:
    """Wilson's score interval at 95 %; nothing is known without trials: 0 to 1."""
    from scipy.stats import binomtest

    if trials == 0:
        return Interval(0.0, 1.0)
    interval = binomtest(successes, trials).proportion_ci(confidence_level=CONFIDENCE, method="wilson")
    return Interval(float(interval.low), float(interval.high))


def rank(method: str) -> int:
    """The ceiling first, then what has no correction, then `contact`, the paper's two ways, and all others.

    A method with `+search` or `+feel` ranks like the method.
    """
    first = ("oracle", "none", "search", "by-heart", "contact", "paper", "paper-track")
    plain = method if method in first else parsed(method).plan
    return first.index(plain) if plain in first else len(first)


def rank_relations(relations: str) -> tuple[int, str]:
    """Right relations first."""
    return int(relations != "given"), relations


def place_of(row: Row) -> Place | None:
    """The cell of a row; None for a measured demonstration, which has no level."""
    return None if row["level"] is None else Place(*_PLACE({**_USUAL, **row}))


PLACE_FIELDS = Place.__match_args__
_PLACE = itemgetter(*PLACE_FIELDS)
_LATER = ("fidelity", "looks", "robot_error", "wrench", "stated_error", "abstain")
_USUAL = {name: getattr(TrialSettings, name) for name in _LATER}


def by_place(rows: Iterable[Row]) -> dict[Place, dict[int, Row]]:
    """Cell -> seed -> row.

    Raises:
        InputError: A trial is there twice; counted twice it would make intervals narrower than they are. Or the rows
            were drawn with several salts: their trials differ, whatever their seeds.
    """
    cells: dict[Place, dict[int, Row]] = {}
    rows = list(rows)
    one_salt(rows)
    for row in rows:
        if place := place_of(row):
            seeds = cells.setdefault(place, {})
            if row["seed"] in seeds:
                raise InputError(
                    f"the rows hold a trial twice ({place.scenario}, {place.method}, level {place.level:g}, seed "
                    f"{row['seed']}); every trial counts once, so leave one of the two out."
                )
            seeds[row["seed"]] = row
    return cells


def by_method(rows: Iterable[Line]) -> dict[tuple[str, str], list[Line]]:
    """Scenario and method -> rows, sorted as `tally` sorts."""
    groups = grouped(((str(row["scenario"]), str(row["method"])), row) for row in rows)
    return {key: groups[key] for key in sorted(groups, key=lambda key: (key[0], rank(key[1]), key[1]))}


def tally(rows: Iterable[Row]) -> tuple[Cell, ...]:
    """Count rows into cells, sorted by scenario, clearance, noise, relations, carelessness, grasp, method, level.

    Rows of a measured demonstration have no level and belong to no cell.

    Raises:
        InputError: A trial is there twice.
    """
    groups = by_place(rows)
    return tuple(_cell(key, list(groups[key].values())) for key in sorted(groups, key=order))


def _cell(key: Place, rows: list[Row]) -> Cell:
    counted = [row for row in rows if row["success"] is not None]
    failed = [row for row in counted if not row["success"]]
    why = Counter(f"{row['failure_stage']}: {row['failure_code']}" for row in failed)
    return Cell(
        **vars(key),
        trials=len(counted),
        successes=len(counted) - len(failed),
        demonstrated=sum(bool(row["as_demonstrated"]) for row in counted),
        loose_successes=sum(bool(row["loose_success"]) for row in counted),
        not_executed=sum(row["failure_stage"] in NOT_EXECUTED for row in failed),
        abstained=sum(row["failure_code"] == "abstained" for row in failed),
        promised=_mean([promise for row in counted if (promise := row.get("promised")) is not None]),
        brier=_mean([(promise - bool(row["success"])) ** 2 for row, promise in _carried_out(counted)]),
        excluded=len(rows) - len(counted),
        failures=MappingProxyType(dict(sorted(why.items(), key=lambda item: (-item[1], item[0])))),
    )


def _carried_out(rows: Iterable[Row]) -> Iterator[tuple[Row, float]]:
    """Rows of plans that were executed, with what they had promised."""
    for row in rows:
        promise = row.get("promised")
        if promise is not None and row["failure_stage"] not in NOT_EXECUTED:
            yield row, promise


def _mean(numbers: Sequence[float]) -> float | None:
    return sum(numbers) / len(numbers) if numbers else None


def order(k: Place) -> tuple[Any, ...]:
    """How cells are sorted: by what is asked, then by method (`oracle` first), then by level."""
    return (
        *(k.scenario, k.clearance_mm, k.noise, rank_relations(k.relations), k.careless),
        *(k.grasp, k.robot_error != TrialSettings.robot_error, k.robot_error, k.fidelity != "full"),
        *(k.looks, k.wrench != TrialSettings.wrench, k.wrench, k.stated_error != TrialSettings.stated_error),
        *(k.stated_error, k.abstain, rank(k.method), k.method, k.level, k.level_deg),
    )
