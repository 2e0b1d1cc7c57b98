"""Two sweeps against each other, trial by trial: two versions, two machines, two fidelities."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.benchmark.analysis import ALL, Line, Place, Rate, order, place_of, tally, tango
from apo_bench.benchmark.report.trials import NUMBERS, verdict, why
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import grouped
from apo_bench.records import KEY, SETTINGS, Key, describe_secret_seed, record_key
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_file import limits_of, read_run, scenario_files
from apo_bench.records.run.trials import Mask, Trials, read_trials

_ENDING = ("success", "failure_stage", "failure_code")
_RESULT = (
    *_ENDING,
    "as_demonstrated",
    "loose_success",
    "failure_operation",
    "sentence",
    "corrected_operations",
    *NUMBERS,
)


class Side(NamedTuple):
    """One of the two sweeps."""

    folder: Path
    run: Mapping[str, Any]
    trials: Trials


@final
@dataclass(frozen=True)
class Comparison:
    """All that two sweeps have to say to each other."""

    first: Side
    second: Side
    differences: Sequence[Line]
    """What is not the same, and what it is in the first and in the second; None where a side does not say."""
    shared: int
    """Trials that both have."""
    alone: tuple[int, int]
    """Trials that the first alone, and the second alone, has."""
    agreements: Sequence[Line]
    """By scenario, and of all at the end. Trials whose demonstration was right in neither are left out. All random
    numbers of a trial are drawn from its seed, in every scenario the same, so that seeds, and not trials, are
    independent: `same_verdicts_in_all` counts those with which every trial has the same verdict in both."""
    changed: Sequence[Line]
    """The trials whose verdicts differ, with what both say of them."""
    numbers: Sequence[Line]
    """In how many trials both have a number, in how many it differs and by how much at most, and in how many one alone
    has it."""
    identical: int
    """Trials of which verdict, stage, code, words and every number are exactly the same."""
    cells: Sequence[Line]
    """Cells of both at the same place, whatever the fidelity; None where one has none."""


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
    secret_seed, other_seed = (side.trials.find_secret_seed() for side in sides)
    require(
        secret_seed == other_seed,
        f"'{first}' was drawn {describe_secret_seed(secret_seed)} and '{second}' {describe_secret_seed(other_seed)}, so that they have no "
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
        differences=_differences(*sides),
        shared=len(both),
        alone=(len(ours) - len(both), len(theirs) - len(both)),
        agreements=_agreements(a, b),
        changed=_changed(sides[0]._replace(trials=a), sides[1]._replace(trials=b)),
        numbers=_number_changes(a, b),
        identical=int(_same(a, b, _RESULT).sum()),
        cells=_cells(sides[0].trials, sides[1].trials, a, b),
    )


def _differences(first: Side, second: Side) -> list[Line]:
    """What the two were asked to do and made with that is not the same; of source files those that differ.

    Where one of them has no `run.json`, nothing that only stands there is compared.
    """
    if not (first.run and second.run):
        first, second = (s._replace(run={"run.json can be read": bool(s.run) or None}) for s in (first, second))
    ours, theirs = (_settings_of(side) for side in (first, second))
    every = [{"what": name, "first": ours.get(name), "second": theirs.get(name)} for name in {**ours, **theirs}]
    return [line for line in every if line["first"] != line["second"]]


def _settings_of(side: Side) -> dict[str, Any]:
    """Settings by name: of `run.json` one level deep, and of the trials what cannot be seen there."""
    settings: dict[str, Any] = {}
    for name, value in side.run.items():
        several = isinstance(value, list) and all(isinstance(x, dict) for x in value)
        parts = {f"{name} {i}": x for i, x in enumerate(value, start=1)} if several else {name: value}
        for part, inner in parts.items():
            settings |= {f"{part}: {key}": x for key, x in inner.items()} if isinstance(inner, dict) else {part: inner}
    shared = ("schema", *(info.name for info in SETTINGS.values() if info.shared))
    return settings | {f"rows: {name}": sorted(side.trials.distinct(name)) for name in shared}


def _by_key(side: Side) -> dict[Key, int]:
    """Key -> number of the trial."""
    index: dict[Key, int] = {}
    keys = zip(*(side.trials.values(name) for name in KEY), strict=True)
    for i, (key, level) in enumerate(zip(keys, side.trials.values("noise_mm"), strict=True)):
        require(
            key not in index,
            f"'{side.folder}' holds a trial twice ({', '.join(map(str, key))}); every trial counts once, so leave one "
            "of the two out.",
        )
        if level is not None:
            index[key] = i
    return index


def _same(a: Trials, b: Trials, names: Sequence[str]) -> Mask:
    """(n,) whether all these columns are exactly the same."""
    ours, theirs = (zip(*(trials.values(name) for name in names), strict=True) for trials in (a, b))
    return np.array([x == y for x, y in zip(ours, theirs, strict=True)], dtype=bool)


def _agreements(a: Trials, b: Trials) -> list[Line]:
    """Per scenario, and over all."""
    counts = ~(np.isnan(a.number("success")) & np.isnan(b.number("success")))
    a = a.where(counts)
    b = b.where(counts)
    masks = {name: a.holds("scenario", (name,).__contains__) for name in sorted(a.distinct("scenario"))}
    masks[ALL] = np.ones(len(a), dtype=bool)
    return [_agreement(name, a.where(own), b.where(own)) for name, own in masks.items()]


def _agreement(scenario: str, a: Trials, b: Trials) -> Line:
    same = _same(a, b, ("success",))
    seeds, of = np.unique(a.number("seed"), return_inverse=True)
    alike = np.bincount(of, ~same, minlength=len(seeds)) == 0
    verdicts = _verdicts(a.number("success"), b.number("success"))
    del verdicts["shared"]
    return {
        "scenario": scenario,
        "trials": len(same),
        **_share("same_verdict", int(same.sum()), len(same)),
        "seeds": len(seeds),
        **_share("same_verdicts_in_all", int(alike.sum()), len(seeds)),
        "same_stage_and_code": int(_same(a, b, _ENDING).sum()),
        **verdicts,
        "excluded_in_one": int((np.isnan(a.number("success")) != np.isnan(b.number("success"))).sum()),
    }


def _share(name: str, successes: int, trials: int) -> Line:
    """A count with its rate and Wilson's interval."""
    low, high = Rate(successes, trials).interval
    rate = Rate(successes, trials).rate
    return {name: successes, f"{name}_rate": rate, f"{name}_low_95": low, f"{name}_high_95": high}


def _verdicts(x: Array, y: Array) -> Line:
    """Of the trials that both have and count, the difference of success, second minus first, with Tango's interval."""
    shared = int((~np.isnan(x) & ~np.isnan(y)).sum())
    first = int(((x == 1) & (y == 0)).sum())
    second = int(((x == 0) & (y == 1)).sum())
    low, high = tango(second, first, shared)
    return {
        "shared": shared,
        "right_in_first_alone": first,
        "right_in_second_alone": second,
        "difference": (second - first) / shared if shared else None,
        "difference_low_95": low,
        "difference_high_95": high,
    }


def _changed(first: Side, second: Side) -> list[Line]:
    """Sorted as cells are, then by seed."""
    unlike = ~_same(first.trials, second.trials, ("success",))
    pairs = zip(first.trials.where(unlike).rows(), second.trials.where(unlike).rows(), strict=True)
    lines = [
        dict(zip(KEY, record_key(x), strict=True))
        | {"place": _anywhere(place_of(x)), "first": _ended(x, first), "second": _ended(y, second)}
        for x, y in pairs
    ]
    return sorted(lines, key=lambda line: (*order(line["place"]), line["seed"]))


def _ended(row: Mapping[str, Any], side: Side) -> Line:
    """How a trial ended on a side, and how to run it again."""
    return {
        "verdict": verdict(row),
        "why": why(row),
        "stage": row["failure_stage"],
        "code": row["failure_code"],
        "sentence": row["sentence"],
        "command": replay_command(row, scenario_files(side.run), limits_of(side.run)),
    }


def _number_changes(a: Trials, b: Trials) -> list[Line]:
    """One per number that is in any record."""
    lines = []
    for name in NUMBERS:
        x = a.number(name)
        y = b.number(name)
        apart = np.abs(x - y)[~np.isnan(x - y)]
        alone = int((np.isnan(x) != np.isnan(y)).sum())
        differ = int((apart > 0).sum())
        most = float(apart.max(initial=0.0))
        lines.append({"name": name, "both": len(apart), "differ": differ, "most": most, "alone": alone})
    return [line for line in lines if line["both"] or line["alone"]]


def _cells(first: Trials, second: Trials, a: Trials, b: Trials) -> list[Line]:
    """Cells by place, whatever the fidelity; sorted as `tally` sorts."""
    ours, theirs = ({_anywhere(cell.place): cell for cell in tally(trials)} for trials in (first, second))
    trials = grouped((_anywhere(place_of(row)), i) for i, row in enumerate(a.rows()))
    x = a.number("success")
    y = b.number("success")
    places = sorted({**ours, **theirs}, key=order)
    of = {place: trials.get(place, []) for place in places}
    return [
        {"place": place, "first": ours.get(place), "second": theirs.get(place), **_verdicts(x[of[place]], y[of[place]])}
        for place in places
    ]


def _anywhere(place: Place | None) -> Place:
    """Whatever the fidelity, of a trial that has a place: one with a level."""
    if place is None:
        raise InputError("a measured demonstration has no level, so it belongs to no cell.")
    return place._replace(fidelity="full")
