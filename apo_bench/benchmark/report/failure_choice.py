"""Choose the failures that a report draws."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from apo_bench.benchmark.analysis import Condition, Records, get_condition, make_sort_key
from apo_bench.benchmark.analysis.condition import group_by_method
from apo_bench.benchmark.analysis.rates import was_executed
from apo_bench.records import TrialRecord
from apo_bench.records.run.replay_command import Files
from apo_bench.records.run.trials import Trials, make_trials


class FailurePicture(NamedTuple):
    """A picture of one failed trial."""

    row: TrialRecord
    jpeg: bytes
    words: str
    """Caption: the moment that the picture shows."""


Draw = Callable[[Sequence[TrialRecord], Path, Files], tuple[list[FailurePicture], list[str]]]
"""Draws failed trials, as `draw_failures` of `apo_bench.viz`; returns pictures, and why others are missing."""


def choose_failures(records: Records, most: int) -> list[TrialRecord]:
    """Choose failures to draw: one per stage and code, the most frequent first, with varied methods and scenarios.

    The order of the trials does not matter. Trials without an executed plan have nothing to show.
    """
    trials = make_trials(records)
    failed = (trials.number("success") == 0) & (trials.number("sim_time_s") > 0) & was_executed(trials)
    failed &= ~np.isnan(trials.number("noise_mm"))  # without observations from files
    ways = trials.where(failed).parts(("failure_stage", "failure_code"))
    chosen: list[TrialRecord] = []
    for way in sorted(ways, key=lambda way: (-len(ways[way]), way))[:most]:
        shown = Counter(x for row in chosen for x in (row["method"], row["scenario"]))  # how often each was chosen
        chosen.append(min(_choose_first(ways[way]), key=partial(_sort_key, shown)))
    return chosen


def _choose_first(trials: Trials) -> Sequence[TrialRecord]:
    """Return the trials of the first seed of each method and scenario."""
    firsts = (own.where(own.number("seed") == own.number("seed")[0]) for own in group_by_method(trials).values())
    return cast(list[TrialRecord], [record for own in firsts for record in own.rows()])


def _sort_key(shown: Mapping[str, int], record: TrialRecord) -> tuple[Any, ...]:
    """Return a sort key that prefers methods and scenarios that were chosen least, then small seeds."""
    often = shown[record["method"]] + shown[record["scenario"]]
    is_uncorrected = record["method"] == "uncorrected"
    return (often, record["seed"], is_uncorrected, make_sort_key(cast(Condition, get_condition(record))))
