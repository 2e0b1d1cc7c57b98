"""Rates, paired comparisons, curves: numbers out of trial records."""

from apo_bench.benchmark.analysis.calibration import calibrations
from apo_bench.benchmark.analysis.condition import (
    CONDITION_FIELDS,
    Condition,
    by_condition,
    condition_of,
    noise_label,
    order,
    rank,
)
from apo_bench.benchmark.analysis.detection import detections
from apo_bench.benchmark.analysis.effort import efforts
from apo_bench.benchmark.analysis.gaps import gaps
from apo_bench.benchmark.analysis.half_level import HalfLevel
from apo_bench.benchmark.analysis.line import ALL, Line
from apo_bench.benchmark.analysis.over_seeds import (
    FEWEST_SEEDS,
    Contrast,
    Results,
    contrast,
    mean_surprise,
    pooled_rate,
    threshold,
)
from apo_bench.benchmark.analysis.paired import Paired, tango
from apo_bench.benchmark.analysis.prediction import confusions
from apo_bench.benchmark.analysis.probing import probing_results
from apo_bench.benchmark.analysis.rates import NOT_EXECUTED, ConditionResult, Interval, Rate, Records, tally, wilson
from apo_bench.benchmark.analysis.settings import level_of, level_unit, levels_of, members, noise_words, settings
from apo_bench.benchmark.analysis.summary import Summary, summary
from apo_bench.benchmark.analysis.timing import read_timing, trial_times, work
from apo_bench.benchmark.analysis.words import percent, percents, points, signed

__all__ = (
    "ALL",
    "CONDITION_FIELDS",
    "FEWEST_SEEDS",
    "NOT_EXECUTED",
    "Condition",
    "ConditionResult",
    "Contrast",
    "HalfLevel",
    "Interval",
    "Line",
    "Paired",
    "Rate",
    "Records",
    "Results",
    "Summary",
    "by_condition",
    "calibrations",
    "condition_of",
    "confusions",
    "contrast",
    "detections",
    "efforts",
    "gaps",
    "level_of",
    "level_unit",
    "levels_of",
    "mean_surprise",
    "members",
    "noise_label",
    "noise_words",
    "order",
    "percent",
    "percents",
    "points",
    "pooled_rate",
    "probing_results",
    "rank",
    "read_timing",
    "settings",
    "signed",
    "summary",
    "tally",
    "tango",
    "threshold",
    "trial_times",
    "wilson",
    "work",
)
