"""Compare two sweeps trial by trial: verdicts, numbers, settings and rates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.benchmark.analysis import (
    ALL,
    CONDITION_FIELDS,
    Condition,
    Line,
    Rate,
    compute_tango_interval,
    get_condition,
    make_sort_key,
    tally,
)
from apo_bench.benchmark.report.trial_text import NUMBERS, describe_failure, describe_verdict
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.records import KEY, SETTINGS, describe_secret_seed, get_record_key
from apo_bench.records.run.replay_command import format_replay_command
from apo_bench.records.run.run_file import list_scenario_files, read_limits, read_run
from apo_bench.records.run.trial_reader import read_trials
from apo_bench.records.run.trials import Index, Mask, Trials, pair_groups

_ENDING = ("success", "failure_stage", "failure_code")  # columns that must agree for the same ending
_RESULT = (  # columns that must agree for identical trials
    *(*_ENDING, "as_demonstrated", "loose_success", "failure_operation", "sentence", "corrected_operations"),
    *NUMBERS,
)


class Side(NamedTuple):
    """One of the two sweeps."""

    folder: Path
    run: Mapping[str, Any]  # content of `run.json`; empty if unreadable
    trials: Trials


@final
@dataclass(frozen=True)
class Comparison:
    """Agreement and differences of two sweeps."""

    first: Side
    second: Side
    differences: Sequence[Line]
    """Settings and versions that differ between the runs, with both values; None where a run has none."""
    shared: int
    """Number of trials in both sweeps."""
    alone: tuple[int, int]
    """Number of trials in the first sweep only, and in the second only."""
    agreements: Sequence[Line]
    """Lines by scenario, and one over all at the end, without trials whose demonstration failed in both sweeps.

    All trials of a seed share their random numbers, so only seeds are independent. `same_verdicts_in_all` counts the
    seeds whose trials all have the same verdict in both sweeps.
    """
    changed: Sequence[Line]
    """The trials whose verdicts differ, with both endings."""
    numbers: Sequence[Line]
    """For each number of a record: trials with it in both, how many differ, the largest difference, trials with it in
    one sweep only."""
    identical: int
    """Trials with exactly the same verdict, stage, code, sentence and numbers."""
    conditions: Sequence[Line]
    """Rates of both sweeps in each condition, whatever the fidelity; None where a sweep has no trial."""


def compare(first: str | Path, second: str | Path) -> Comparison:
    """Compare the sweeps of two folders.

    Trials are paired if all settings of their key agree: scenario, noise, method, seed and others. Fidelity, arm and
    time step are no part of the key, so sweeps that differ in these can be compared.

    Raises:
        InputError: A folder is no sweep or holds a trial twice, or the sweeps share no trial. With different secret
        seeds,
            equal seeds are different trials.
    """
    a, b = (Side(Path(folder), read_run(Path(folder)), read_trials(folder)) for folder in (first, second))
    for side in (a, b):
        require(len(side.trials), f"'{side.folder}' holds no finished trial yet; run the sweep before it is compared.")
    drawn = [describe_secret_seed(side.trials.find_secret_seed()) for side in (a, b)]
    require(
        drawn[0] == drawn[1],
        f"'{first}' was drawn {drawn[0]} and '{second}' {drawn[1]}, so that they have no trial in common; compare "
        "sweeps of one secret seed.",
    )
    ours, theirs = pair_groups(a.trials, b.trials, KEY)
    for side, keys in ((a, ours), (b, theirs)):
        _check_once(side, keys)
    # without observations from files
    first_at, second_at = (np.flatnonzero(~np.isnan(side.trials.number("noise_mm"))) for side in (a, b))
    _, i, j = np.intersect1d(ours[first_at], theirs[second_at], assume_unique=True, return_indices=True)
    order = np.argsort(i)  # as in the first sweep
    require(len(i), f"'{first}' and '{second}' have no trial in common; compare sweeps of the same settings and seeds.")
    x = a.trials.where(first_at[i[order]])  # the shared trials of both, in the same order
    y = b.trials.where(second_at[j[order]])
    return Comparison(
        first=a,
        second=b,
        differences=_list_differences(a, b),
        shared=len(x),
        alone=(len(first_at) - len(x), len(second_at) - len(x)),
        agreements=_list_agreements(x, y),
        changed=_list_changed_trials(a._replace(trials=x), b._replace(trials=y)),
        numbers=_list_number_changes(x, y),
        identical=int(_are_equal(x, y, _RESULT).sum()),
        conditions=_compare_conditions(a.trials, b.trials, x, y),
    )


def _list_differences(first: Side, second: Side) -> list[Line]:
    """Return settings and versions that differ; if a `run.json` is missing, only those of the records."""
    if not (first.run and second.run):
        first, second = (s._replace(run={"run.json can be read": bool(s.run) or None}) for s in (first, second))
    ours = _list_settings(first)
    theirs = _list_settings(second)
    every = [{"what": name, "first": ours.get(name), "second": theirs.get(name)} for name in {**ours, **theirs}]
    return [line for line in every if line["first"] != line["second"]]


def _list_settings(side: Side) -> dict[str, Any]:
    """Return settings by name: from `run.json`, with its tables flattened by one level, and from the records."""
    tables = {f"grid {i}": grid for i, grid in enumerate(side.run.get("grids", ()), start=1)}
    tables |= {name: value for name, value in side.run.items() if isinstance(value, dict)}
    settings = {f"{name}: {key}": value for name, table in tables.items() for key, value in table.items()}
    plain = {name: value for name, value in side.run.items() if not isinstance(value, dict | list)}
    shared = ("schema", *(info.name for info in SETTINGS.values() if info.shared))
    return plain | settings | {f"records: {name}": sorted(side.trials.distinct(name)) for name in shared}


def _check_once(side: Side, keys: Index) -> None:
    """Raise an `InputError` if a trial occurs twice."""
    _, first = np.unique(keys, return_index=True)
    if len(first) < len(keys):
        twice = np.setdiff1d(np.arange(len(keys)), first)[:1]
        (record,) = side.trials.where(twice).rows(KEY)
        raise InputError(
            f"'{side.folder}' holds a trial twice ({', '.join(map(str, record.values()))}); every trial counts once, "
            "so leave one of the two out."
        )


def _are_equal(a: Trials, b: Trials, names: Sequence[str]) -> Mask:
    """Return a mask, (n,), of the trials whose values agree exactly in all these columns."""
    same = np.ones(len(a), dtype=bool)
    for name in names:
        same &= a.equals(b, name)
    return same


def _list_agreements(a: Trials, b: Trials) -> list[Line]:
    """Return lines on the agreement per scenario, and one over all scenarios at the end."""
    # the demonstration succeeded in at least one sweep
    counts = ~(np.isnan(a.number("success")) & np.isnan(b.number("success")))
    masks = {name: counts & a.holds("scenario", (name,).__contains__) for name in sorted(a.distinct("scenario"))}
    masks[ALL] = counts
    return [
        _measure_agreement(name, a.where(own), b.where(own)) for name, own in masks.items() if own.any() or name == ALL
    ]


def _measure_agreement(scenario: str, a: Trials, b: Trials) -> Line:
    """Return the line on how often two sweeps agree, from their shared trials in the same order."""
    same = _are_equal(a, b, ("success",))
    seeds, of = np.unique(a.number("seed"), return_inverse=True)
    alike = np.bincount(of, ~same, minlength=len(seeds)) == 0  # seeds without any differing verdict
    return {
        "scenario": scenario,
        "trials": len(same),
        **_make_share("same_verdict", int(same.sum()), len(same)),
        "seeds": len(seeds),
        **_make_share("same_verdicts_in_all", int(alike.sum()), len(seeds)),
        "same_stage_and_code": int(_are_equal(a, b, _ENDING).sum()),
        **_count_verdicts(a.number("success"), b.number("success")),
        "excluded_in_one": int((np.isnan(a.number("success")) != np.isnan(b.number("success"))).sum()),
    }


def _make_share(name: str, successes: int, trials: int) -> Line:
    """Return columns with a count, its rate, and Wilson's interval."""
    rate = Rate(successes, trials)
    low, high = rate.interval
    return {name: successes, f"{name}_rate": rate.rate, f"{name}_low_95": low, f"{name}_high_95": high}


def _count_verdicts(x: Array, y: Array) -> Line:
    """Return counts of trials that succeed in one sweep only, and the difference of success, second minus first.

    Args:
        x, y: Success in the first and second sweep, (n,): 1, 0, or NaN if the demonstration failed.
    """
    shared = int((~np.isnan(x) & ~np.isnan(y)).sum())
    first = int(((x == 1) & (y == 0)).sum())
    second = int(((x == 0) & (y == 1)).sum())
    low, high = compute_tango_interval(second, first, shared)
    return {
        "shared": shared,
        "right_in_first_alone": first,
        "right_in_second_alone": second,
        "difference": (second - first) / shared if shared else None,
        "difference_low_95": low,
        "difference_high_95": high,
    }


def _list_changed_trials(first: Side, second: Side) -> list[Line]:
    """Return the trials whose verdicts differ, sorted by condition, then by seed."""
    unlike = ~_are_equal(first.trials, second.trials, ("success",))
    pairs = zip(first.trials.where(unlike).rows(), second.trials.where(unlike).rows(), strict=True)
    lines = [
        dict(zip(KEY, get_record_key(x), strict=True))
        | {"condition": get_condition(x), "first": _describe_ending(x, first), "second": _describe_ending(y, second)}
        for x, y in pairs
    ]
    return sorted(lines, key=lambda line: (*make_sort_key(line["condition"]), line["seed"]))


def _describe_ending(record: Mapping[str, Any], side: Side) -> Line:
    """Return how a trial ended in one sweep, and the command to run it again."""
    return {
        "verdict": describe_verdict(record),
        "why": describe_failure(record),
        "stage": record["failure_stage"],
        "code": record["failure_code"],
        "sentence": record["sentence"],
        "command": format_replay_command(record, list_scenario_files(side.run), read_limits(side.run)),
    }


def _list_number_changes(a: Trials, b: Trials) -> list[Line]:
    """Return a line for each number that occurs in a record: in how many trials it differs, and by how much at most."""
    lines = []
    for name in NUMBERS:
        x = a.number(name)
        y = b.number(name)
        apart = np.abs(x - y)[~np.isnan(x - y)]  # NaN where only one has the number
        alone = int((np.isnan(x) != np.isnan(y)).sum())
        differ = int((apart > 0).sum())
        most = float(apart.max(initial=0.0))
        lines.append({"name": name, "both": len(apart), "differ": differ, "most": most, "alone": alone})
    return [line for line in lines if line["both"] or line["alone"]]


def _compare_conditions(first: Trials, second: Trials, a: Trials, b: Trials) -> list[Line]:
    """Return the rates in each condition, sorted as `tally` sorts, whatever the fidelity.

    Args:
        first, second: All trials of each sweep.
        a, b: The shared trials, in the same order.
    """
    ours, theirs = ({_ignore_fidelity(c.condition): c for c in tally(trials)} for trials in (first, second))
    # condition -> indices of its shared trials
    groups = a.groups(name for name in CONDITION_FIELDS if name != "fidelity")
    fields = [dict(zip((n for n in CONDITION_FIELDS if n != "fidelity"), key, strict=True)) for key in groups.keys]
    shared = {Condition(**own): np.flatnonzero(groups.of == k) for k, own in enumerate(fields)}
    none = np.zeros(0, dtype=int)
    of = {condition: shared.get(condition, none) for condition in sorted({**ours, **theirs}, key=make_sort_key)}
    x = a.number("success")
    y = b.number("success")
    return [
        {"condition": c, "first": ours.get(c), "second": theirs.get(c), **_count_verdicts(x[own], y[own])}
        for c, own in of.items()
    ]


def _ignore_fidelity(condition: Condition) -> Condition:
    return condition.with_default("fidelity")
