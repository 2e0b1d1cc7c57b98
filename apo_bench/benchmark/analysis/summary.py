"""Compute rates, paired differences and half levels of a report in one call."""

from collections.abc import Sequence
from typing import NamedTuple

from apo_bench.benchmark.analysis.half_level import HalfLevel, estimate_half_levels
from apo_bench.benchmark.analysis.paired import REFERENCES, PairedComparison, compare_pairs
from apo_bench.benchmark.analysis.rates import ConditionResult, Records, tally
from apo_bench.records.run.trials import make_trials


class Summary(NamedTuple):
    """Rates, pairs and half levels, each sorted as `tally` sorts."""

    results: tuple[ConditionResult, ...]
    pairs: tuple[PairedComparison, ...]
    half_levels: tuple[HalfLevel, ...]


def summarise(records: Records, references: Sequence[str] = REFERENCES) -> Summary:
    """Compute the numbers of a report.

    Args:
        references: The methods that every other method is compared with.

    Raises:
        InputError: A trial occurs twice.
    """
    trials = make_trials(records)
    results = tally(trials)
    return Summary(results, compare_pairs(trials, references), estimate_half_levels(results))
