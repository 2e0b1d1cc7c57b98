"""Numbers computed from trial records: rates, paired comparisons, curves."""

from apo_bench.benchmark.analysis.calibration import tabulate_calibration
from apo_bench.benchmark.analysis.condition import (
    CONDITION_FIELDS,
    Condition,
    format_noise_label,
    get_condition,
    group_by_condition,
    make_settings_key,
    make_sort_key,
    rank_method,
)
from apo_bench.benchmark.analysis.detection import tabulate_detection
from apo_bench.benchmark.analysis.effort import tabulate_effort
from apo_bench.benchmark.analysis.gaps import tabulate_gaps
from apo_bench.benchmark.analysis.half_level import HalfLevel
from apo_bench.benchmark.analysis.number_text import (
    format_percent,
    format_percent_interval,
    format_points,
    format_signed,
)
from apo_bench.benchmark.analysis.over_seeds import (
    FEWEST_SEEDS,
    Contrast,
    Results,
    compute_mean_surprise,
    compute_threshold,
    contrast,
    pool_rate,
)
from apo_bench.benchmark.analysis.paired import PairedComparison, compute_tango_interval
from apo_bench.benchmark.analysis.prediction import tabulate_confusion
from apo_bench.benchmark.analysis.probing import tabulate_probing
from apo_bench.benchmark.analysis.rates import (
    ConditionResult,
    Interval,
    Rate,
    Records,
    compute_wilson_interval,
    tally,
)
from apo_bench.benchmark.analysis.settings import (
    format_noise,
    get_level,
    get_level_unit,
    group_by_setting,
    list_levels,
    list_settings,
)
from apo_bench.benchmark.analysis.stratified import (
    MeanEstimate,
    measure_mean_difference,
    measure_mean_rate,
    pool_estimates,
)
from apo_bench.benchmark.analysis.summary import Summary, summarise
from apo_bench.benchmark.analysis.table_line import ALL, Line
from apo_bench.benchmark.analysis.timing import read_timing, tabulate_timing

__all__ = (
    "ALL",
    "CONDITION_FIELDS",
    "FEWEST_SEEDS",
    "Condition",
    "ConditionResult",
    "Contrast",
    "HalfLevel",
    "Interval",
    "Line",
    "MeanEstimate",
    "PairedComparison",
    "Rate",
    "Records",
    "Results",
    "Summary",
    "compute_mean_surprise",
    "compute_tango_interval",
    "compute_threshold",
    "compute_wilson_interval",
    "contrast",
    "format_noise",
    "format_noise_label",
    "format_percent",
    "format_percent_interval",
    "format_points",
    "format_signed",
    "get_condition",
    "get_level",
    "get_level_unit",
    "group_by_condition",
    "group_by_setting",
    "list_levels",
    "list_settings",
    "make_settings_key",
    "make_sort_key",
    "measure_mean_difference",
    "measure_mean_rate",
    "pool_estimates",
    "pool_rate",
    "rank_method",
    "read_timing",
    "summarise",
    "tabulate_calibration",
    "tabulate_confusion",
    "tabulate_detection",
    "tabulate_effort",
    "tabulate_gaps",
    "tabulate_probing",
    "tabulate_timing",
    "tally",
)
