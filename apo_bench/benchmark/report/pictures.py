"""Which failures a report shows as pictures; others can draw them."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from operator import or_
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from apo_bench.benchmark.analysis import Condition, Records, get_condition, make_sort_key
from apo_bench.benchmark.analysis.condition import by_method
from apo_bench.benchmark.analysis.rates import was_executed
from apo_bench.records import SecretSeed, TrialRecord
from apo_bench.records.own_code import DATA_PREFIXES, describe_own_code, is_own_code
from apo_bench.records.run.replay_command import Files
from apo_bench.records.run.trials import Mask, Trials, trials_of


class FailurePicture(NamedTuple):
    """Of one trial."""

    row: TrialRecord
    jpeg: bytes
    words: str
    """How it was made."""


Draw = Callable[..., tuple[list[FailurePicture], list[str]]]
"""Runs failed trials again and draws them, as `failure_pictures` of `apo_bench.viz` does; the sentences say what could
not be drawn."""


class Pictures(NamedTuple):
    """How a report gets pictures of failures."""

    most: int = 0
    draw: Draw | None = None
    secret_seed: SecretSeed | None = None
    trust_code: bool = False
    """Run also trials that name code that does not come with the package."""


def draw_failures(trials: Trials, folder: Path, files: Files, how: Pictures) -> tuple[list[FailurePicture], list[str]]:
    """So many pictures at most, and sentences on those that are missing."""
    if not how.most or how.draw is None:
        return [], []
    chosen = sample(trials, how.most, trust_code=how.trust_code)
    pictures, missing = how.draw(chosen, folder, files, how.secret_seed, trust_code=how.trust_code)
    without = "" if how.trust_code else describe_own_code(trials.where(_names_code(trials)).rows())
    return pictures, [*missing, *([without] if without else [])]


def sample(records: Records, most: int, *, trust_code: bool = False) -> list[TrialRecord]:
    """Failures to be drawn: one for each way of failing, the most frequent first, methods and scenarios varied.

    The same trials, in any order, give the same sample. Those that were not carried out have nothing to be seen.

    Args:
        trust_code: Also trials that name code of somebody's own.
    """
    trials = trials_of(records)
    failed = (trials.number("success") == 0) & (trials.number("sim_time_s") > 0) & was_executed(trials)
    failed &= ~np.isnan(trials.number("noise_mm"))
    if not trust_code:
        failed &= ~_names_code(trials)
    ways = trials.where(failed).parts(("failure_stage", "failure_code"))
    chosen: list[TrialRecord] = []
    for way in sorted(ways, key=lambda way: (-len(ways[way]), way))[:most]:
        shown = Counter(x for row in chosen for x in (row["method"], row["scenario"]))
        chosen.append(min(_first(ways[way]), key=partial(_order, shown)))
    return chosen


def _names_code(trials: Trials) -> Mask:
    """(n,) whether a trial names code of somebody's own."""
    named = (trials.holds(column, partial(is_own_code, column)) for column in DATA_PREFIXES)
    return reduce(or_, named)


def _first(trials: Trials) -> Sequence[TrialRecord]:
    """The trials of the first seed of each method and scenario."""
    firsts = (own.where(own.number("seed") == own.number("seed")[0]) for own in by_method(trials).values())
    return cast(list[TrialRecord], [record for own in firsts for record in own.rows()])


def _order(shown: Mapping[str, int], record: TrialRecord) -> tuple[Any, ...]:
    often = shown[record["method"]] + shown[record["scenario"]]
    is_uncorrected = record["method"] == "uncorrected"
    return (often, record["seed"], is_uncorrected, make_sort_key(cast(Condition, get_condition(record))))
