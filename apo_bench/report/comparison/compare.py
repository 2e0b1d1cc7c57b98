"""Two sweeps against each other, trial by trial: two versions, two machines, two fidelities.

What is counted stands above how it is counted, in one file, since neither is understood without the other.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.errors import InputError, require
from apo_bench.io import grouped
from apo_bench.records import SETTINGS, Key, Row, one_salt, row_key, with_salt
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.run_folder import NUMBERS, report_rows
from apo_bench.statistics import ALL, Cell, Interval, Place, Rate, cell_place, order, place_of, tally, tango

RUN = "run.json can be read"
_ENDING = ("success", "failure_stage", "failure_code")
_ENDED = itemgetter(*_ENDING)
_RESULT = itemgetter(*_ENDING, "as_demonstrated", "loose_success", "failure_operation", "sentence", "freed", *NUMBERS)


class Side(NamedTuple):
    """One of the two sweeps."""

    folder: Path
    run: Mapping[str, Any]
    rows: Sequence[Row]


class Difference(NamedTuple):
    """A setting that is not the same in both; None where a side does not say."""

    what: str
    first: Any
    second: Any


@dataclass(frozen=True, kw_only=True)
class _Pairs:
    """Trials that both sweeps have and count."""

    shared: int
    only_first: int
    """Of these, those that were right in the first alone."""
    only_second: int

    @property
    def difference(self) -> float | None:
        """Success of the second minus that of the first, over the trials that they share."""
        return (self.only_second - self.only_first) / self.shared if self.shared else None

    @property
    def interval(self) -> Interval:
        """Tango's, of that difference."""
        return tango(self.only_second, self.only_first, self.shared)


@final
@dataclass(frozen=True, kw_only=True)
class Agreement(_Pairs):
    """Verdicts of the trials that both have, of one scenario or of all."""

    scenario: str
    same: Rate
    """Trials whose verdict is the same; those whose demonstration was right in neither are left out."""
    same_ending: Rate
    """Trials whose verdict, stage and code are the same."""
    same_everywhere: Rate
    """Seeds with which every trial has the same verdict in both. All random numbers of a trial are drawn from its seed,
    in every scenario the same, so that seeds, and not trials, are independent."""
    excluded_in_one: int
    """Trials whose demonstration was right in one of the two alone."""


class NumberChange(NamedTuple):
    """A number of a row, over the trials that both have."""

    name: str
    both: int
    """Trials in which both have it."""
    differ: int
    """Of these, trials in which it is not exactly the same."""
    most: float
    """The largest absolute difference."""
    alone: int
    """Trials in which one of the two alone has it."""


@final
@dataclass(frozen=True, kw_only=True)
class CellPair(_Pairs):
    """Cells of both at the same place, whatever the fidelity; None where one has none."""

    place: Place
    first: Cell | None
    second: Cell | None


@final
@dataclass(frozen=True)
class Comparison:
    """All that two sweeps have to say to each other."""

    first: Side
    second: Side
    differences: tuple[Difference, ...]
    shared: int
    """Trials that both have."""
    alone: tuple[int, int]
    """Trials that the first alone, and the second alone, has."""
    agreements: tuple[Agreement, ...]
    """By scenario, and of all at the end."""
    changed: tuple[tuple[Row, Row], ...]
    """The trials whose verdicts differ."""
    numbers: tuple[NumberChange, ...]
    identical: int
    """Trials of which verdict, stage, code, words and every number are exactly the same."""
    cells: tuple[CellPair, ...]


def compare(first: str | Path, second: str | Path) -> Comparison:
    """Compare the sweeps of two folders.

    A trial is the same if all that its key holds is: scenario, clearance, seed, carelessness, level, noise, relations,
    grasp, robot error and method; fidelity, arm and time step are not, so that they can be compared.

    Raises:
        InputError: A folder is no sweep, holds a trial twice, or both have no trial in common (of other salts a seed is
            another trial).
    """
    sides = [Side(Path(folder), read_run(Path(folder)), report_rows(Path(folder))) for folder in (first, second)]
    for side in sides:
        require(side.rows, f"'{side.folder}' holds no finished trial yet; run the sweep before it is compared.")
    salt, other_salt = (one_salt(side.rows) for side in sides)
    require(
        salt == other_salt,
        f"'{first}' was drawn {with_salt(salt)} and '{second}' {with_salt(other_salt)}, so that they have no "
        "trial in common, whatever their seeds; compare sweeps of one salt.",
    )
    ours, theirs = (_by_key(side) for side in sides)
    both = [key for key in ours if key in theirs]
    require(
        both,
        f"'{first}' and '{second}' have no trial in common (scenario, clearance, seed, carelessness, level, noise, "
        "relations, grasp, robot error and method); compare sweeps of the same seeds.",
    )
    pairs = [(ours[key], theirs[key]) for key in both]
    return Comparison(
        first=sides[0],
        second=sides[1],
        differences=differences(*sides),
        shared=len(both),
        alone=(len(ours) - len(both), len(theirs) - len(both)),
        agreements=agreements(pairs),
        changed=tuple(pair for pair in sorted(pairs, key=_place_and_seed) if pair[0]["success"] != pair[1]["success"]),
        numbers=number_changes(pairs),
        identical=sum(bool(_RESULT(a) == _RESULT(b)) for a, b in pairs),
        cells=_cells(sides[0], sides[1], pairs),
    )


def differences(first: Side, second: Side) -> tuple[Difference, ...]:
    """What the two were asked to do and made with that is not the same; of source files those that differ.

    Where one of them has no `run.json` that can be read, nothing that only stands there is compared.
    """
    if not (first.run and second.run):
        first, second = (side._replace(run={RUN: bool(side.run) or None}) for side in (first, second))
    ours, theirs = (_settings_of(side) for side in (first, second))
    return tuple(
        Difference(n, ours.get(n), theirs.get(n))
        for n in dict.fromkeys([*ours, *theirs])
        if ours.get(n) != theirs.get(n)
    )


def agreements(pairs: Sequence[tuple[Row, Row]]) -> tuple[Agreement, ...]:
    """Per scenario, and over all."""
    groups = grouped((pair[0]["scenario"], pair) for pair in pairs)
    return (*(_agreement(name, groups[name]) for name in sorted(groups)), _agreement(ALL, pairs))


def number_changes(pairs: Sequence[tuple[Row, Row]]) -> tuple[NumberChange, ...]:
    """One per number that is in any row."""
    changes = []
    for name in NUMBERS:
        values = [tuple(map(itemgetter(name), pair)) for pair in pairs]
        both = [(x, y) for x, y in values if x is not None and y is not None]
        alone = sum((x is None) != (y is None) for x, y in values)
        if both or alone:
            most = max((abs(x - y) for x, y in both), default=0.0)
            changes.append(NumberChange(name, len(both), sum(x != y for x, y in both), float(most), alone))
    return tuple(changes)


def _by_key(side: Side) -> dict[Key, Row]:
    rows: dict[Key, Row] = {}
    for row in side.rows:
        if row["level"] is None:
            continue
        if row_key(row) in rows:
            raise InputError(
                f"'{side.folder}' holds a trial twice ({row['scenario']}, {row['method']}, level {row['level']:g}, "
                f"seed {row['seed']}); every trial counts once, so leave one of the two out."
            )
        rows[row_key(row)] = row
    return rows


def _agreement(name: str, pairs: Sequence[tuple[Row, Row]]) -> Agreement:
    counted = [(a, b) for a, b in pairs if (a["success"], b["success"]) != (None, None)]
    verdicts = [(a["success"], b["success"]) for a, b in counted]
    seeds = grouped((a["seed"], a["success"] == b["success"]) for a, b in counted)
    return Agreement(
        scenario=name,
        same=Rate(sum(a == b for a, b in verdicts), len(verdicts)),
        same_ending=Rate(sum(_ENDED(a) == _ENDED(b) for a, b in counted), len(counted)),
        same_everywhere=Rate(sum(map(all, seeds.values())), len(seeds)),
        **_pairs(verdicts),
        excluded_in_one=sum(None in both for both in verdicts),
    )


def _place_and_seed(pair: tuple[Row, Row]) -> tuple[Any, ...]:
    return (*order(_anywhere(place_of(pair[0]))), pair[0]["seed"])


def _pairs(verdicts: Sequence[tuple[Any, Any]]) -> dict[str, int]:
    """What `_Pairs` counts."""
    alone = {"only_first": verdicts.count((True, False)), "only_second": verdicts.count((False, True))}
    return {"shared": sum(None not in both for both in verdicts)} | alone


def _cells(first: Side, second: Side, pairs: Iterable[tuple[Row, Row]]) -> tuple[CellPair, ...]:
    """Cells by place, whatever the fidelity; sorted as `tally` sorts."""
    ours, theirs = ({_anywhere(cell_place(cell)): cell for cell in tally(side.rows)} for side in (first, second))
    verdicts = grouped((_anywhere(place_of(a)), (a["success"], b["success"])) for a, b in pairs)
    return tuple(
        CellPair(place=place, first=ours.get(place), second=theirs.get(place), **_pairs(verdicts.get(place, [])))
        for place in sorted({**ours, **theirs}, key=order)
    )


def _anywhere(place: Place | None) -> Place:
    """Whatever the fidelity, of a row that has a place: one with a level."""
    assert place is not None
    return place._replace(fidelity="full")


def _settings_of(side: Side) -> dict[str, Any]:
    """Settings by name: of `run.json` one level deep, and of the rows what cannot be seen there."""
    settings: dict[str, Any] = {}
    for name, value in side.run.items():
        if isinstance(value, dict):
            settings |= {f"{name}: {key}": inner for key, inner in value.items()}
        elif isinstance(value, list) and all(isinstance(x, dict) for x in value):
            for i, inner in enumerate(value, start=1):
                settings |= {f"{name} {i}: {key}": x for key, x in inner.items()}
        else:
            settings[name] = value
    return settings | {
        f"rows: {name}": sorted(set(map(itemgetter(name), side.rows)))
        for name in ("schema", *(info.column for info in SETTINGS.values() if info.shared))
    }
