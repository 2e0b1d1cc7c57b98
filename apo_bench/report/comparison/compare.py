"""Two sweeps against each other, trial by trial: two versions, two machines, two fidelities."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import grouped
from apo_bench.records import KEY, SETTINGS, Key, with_salt
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.trials import Trials, read_trials
from apo_bench.report.trials import NUMBERS
from apo_bench.statistics import ALL, Cell, Interval, Place, Rate, order, place_of, tally, tango

_ENDING = ("success", "failure_stage", "failure_code")
_RESULT = (*_ENDING, "as_demonstrated", "loose_success", "failure_operation", "sentence", "freed", *NUMBERS)


class Side(NamedTuple):
    """One of the two sweeps."""

    folder: Path
    run: Mapping[str, Any]
    trials: Trials


class Difference(NamedTuple):
    """A setting that is not the same in both; None where a side does not say."""

    what: str
    first: Any
    second: Any


class Verdicts(NamedTuple):
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


class Agreement(NamedTuple):
    """Verdicts of the trials that both have, of one scenario or of all."""

    scenario: str
    same: Rate
    """Trials whose verdict is the same; those whose demonstration was right in neither are left out."""
    same_ending: Rate
    """Trials whose verdict, stage and code are the same."""
    same_everywhere: Rate
    """Seeds with which every trial has the same verdict in both. All random numbers of a trial are drawn from its seed,
    in every scenario the same, so that seeds, and not trials, are independent."""
    verdicts: Verdicts
    excluded_in_one: int
    """Trials whose demonstration was right in one of the two alone."""


class NumberChange(NamedTuple):
    """A number of a record, over the trials that both have."""

    name: str
    both: int
    """Trials in which both have it."""
    differ: int
    """Of these, trials in which it is not exactly the same."""
    most: float
    """The largest absolute difference."""
    alone: int
    """Trials in which one of the two alone has it."""


class CellPair(NamedTuple):
    """Cells of both at the same place, whatever the fidelity; None where one has none."""

    place: Place
    first: Cell | None
    second: Cell | None
    verdicts: Verdicts


class Changed(NamedTuple):
    """A trial whose verdicts differ, as both sweeps recorded it."""

    place: Place
    first: dict[str, Any]
    second: dict[str, Any]


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
    changed: tuple[Changed, ...]
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
    sides = [Side(Path(folder), read_run(Path(folder)), read_trials(folder)) for folder in (first, second)]
    for side in sides:
        require(len(side.trials), f"'{side.folder}' holds no finished trial yet; run the sweep before it is compared.")
    salt, other_salt = (side.trials.find_salt() for side in sides)
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
    a = sides[0].trials.where(np.array([ours[key] for key in both]))
    b = sides[1].trials.where(np.array([theirs[key] for key in both]))
    return Comparison(
        first=sides[0],
        second=sides[1],
        differences=differences(*sides),
        shared=len(both),
        alone=(len(ours) - len(both), len(theirs) - len(both)),
        agreements=_agreements(a, b),
        changed=_changed(a, b),
        numbers=_number_changes(a, b),
        identical=int(np.logical_and.reduce([_same(a, b, name) for name in _RESULT]).sum()),
        cells=_cells(sides[0].trials, sides[1].trials, a, b),
    )


def differences(first: Side, second: Side) -> tuple[Difference, ...]:
    """What the two were asked to do and made with that is not the same; of source files those that differ.

    Where one of them has no `run.json`, nothing that only stands there is compared.
    """
    if not (first.run and second.run):
        first, second = (
            side._replace(run={"run.json can be read": bool(side.run) or None}) for side in (first, second)
        )
    ours, theirs = (_settings_of(side) for side in (first, second))
    every = dict.fromkeys([*ours, *theirs])
    return tuple(Difference(n, ours.get(n), theirs.get(n)) for n in every if ours.get(n) != theirs.get(n))


def _by_key(side: Side) -> dict[Key, int]:
    """Key -> number of the trial."""
    index: dict[Key, int] = {}
    keys = zip(*(side.trials.values(name) for name in KEY), strict=True)
    for i, (key, level) in enumerate(zip(keys, side.trials.values("level"), strict=True)):
        if key in index:
            raise InputError(
                f"'{side.folder}' holds a trial twice ({', '.join(map(str, key))}); every trial counts once, so leave "
                "one of the two out."
            )
        if level is not None:
            index[key] = i
    return index


def _same(a: Trials, b: Trials, name: str) -> Array:
    """(n,) whether a column is exactly the same."""
    return np.array([x == y for x, y in zip(a.values(name), b.values(name), strict=True)], dtype=bool)


def _agreements(a: Trials, b: Trials) -> tuple[Agreement, ...]:
    """Per scenario, and over all."""
    counts = ~(np.isnan(a.number("success")) & np.isnan(b.number("success")))
    a = a.where(counts)
    b = b.where(counts)
    same = _same(a, b, "success")
    ending = np.logical_and.reduce([_same(a, b, name) for name in _ENDING])
    masks = {name: a.holds("scenario", (name,).__contains__) for name in sorted(a.distinct("scenario"))}
    masks[ALL] = np.ones(len(a), dtype=bool)
    return tuple(_agreement(name, a.where(own), b.where(own), same[own], ending[own]) for name, own in masks.items())


def _agreement(scenario: str, a: Trials, b: Trials, same: Array, ending: Array) -> Agreement:
    x = a.number("success")
    y = b.number("success")
    seeds, of = np.unique(a.number("seed"), return_inverse=True)
    unlike = np.bincount(of, ~same, minlength=len(seeds)) > 0
    return Agreement(
        scenario=scenario,
        same=Rate(int(same.sum()), len(same)),
        same_ending=Rate(int(ending.sum()), len(same)),
        same_everywhere=Rate(int((~unlike).sum()), len(seeds)),
        verdicts=_verdicts(x, y),
        excluded_in_one=int((np.isnan(x) != np.isnan(y)).sum()),
    )


def _verdicts(x: Array, y: Array) -> Verdicts:
    shared = ~(np.isnan(x) | np.isnan(y))
    return Verdicts(int(shared.sum()), int(((x == 1) & (y == 0)).sum()), int(((x == 0) & (y == 1)).sum()))


def _changed(a: Trials, b: Trials) -> tuple[Changed, ...]:
    """Sorted as cells are, then by seed."""
    unlike = ~_same(a, b, "success")
    pairs = zip(a.where(unlike).rows(), b.where(unlike).rows(), strict=True)
    found = [Changed(_anywhere(place_of(x)), x, y) for x, y in pairs]  # type: ignore[arg-type]
    return tuple(sorted(found, key=lambda each: (*order(each.place), each.first["seed"])))


def _number_changes(a: Trials, b: Trials) -> tuple[NumberChange, ...]:
    """One per number that is in any record."""
    changes = []
    for name in NUMBERS:
        x = a.number(name)
        y = b.number(name)
        apart = np.abs(x - y)
        apart = apart[~np.isnan(apart)]
        alone = int((np.isnan(x) != np.isnan(y)).sum())
        if len(apart) or alone:
            most = float(apart.max(initial=0.0))
            changes.append(NumberChange(name, len(apart), int((apart > 0).sum()), most, alone))
    return tuple(changes)


def _cells(first: Trials, second: Trials, a: Trials, b: Trials) -> tuple[CellPair, ...]:
    """Cells by place, whatever the fidelity; sorted as `tally` sorts."""
    ours, theirs = ({_anywhere(cell.place): cell for cell in tally(trials)} for trials in (first, second))
    places = grouped((_anywhere(place_of(row)), i) for i, row in enumerate(a.rows()))  # type: ignore[arg-type]
    x = a.number("success")
    y = b.number("success")
    return tuple(
        CellPair(
            place, ours.get(place), theirs.get(place), _verdicts(x[places.get(place, [])], y[places.get(place, [])])
        )
        for place in sorted({**ours, **theirs}, key=order)
    )


def _anywhere(place: Place | None) -> Place:
    """Whatever the fidelity, of a trial that has a place: one with a level."""
    assert place is not None
    return place._replace(fidelity="full")


def _settings_of(side: Side) -> dict[str, Any]:
    """Settings by name: of `run.json` one level deep, and of the trials what cannot be seen there."""
    settings: dict[str, Any] = {}
    for name, value in side.run.items():
        several = isinstance(value, list) and all(isinstance(x, dict) for x in value)
        parts = {f"{name} {i}": x for i, x in enumerate(value, start=1)} if several else {name: value}
        for part, inner in parts.items():
            settings |= {f"{part}: {key}": x for key, x in inner.items()} if isinstance(inner, dict) else {part: inner}
    shared = ("schema", *(info.column for info in SETTINGS.values() if info.shared))
    return settings | {f"rows: {name}": sorted(side.trials.distinct(name)) for name in shared}
