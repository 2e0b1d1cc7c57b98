"""Effort of replays: extra steps, simulated time, and displacement of placed parts."""

import numpy as np

from apo_bench.benchmark.analysis.condition import group_by_method
from apo_bench.benchmark.analysis.rates import Records
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.records.run.trials import make_trials


def tabulate_effort(records: Records) -> list[Line]:
    """Return one line per scenario and method: means, medians and maxima over its successes in all conditions."""
    trials = make_trials(records)
    right = trials.where(trials.number("success") == 1)
    return [
        {
            "scenario": scenario,
            "method": method,
            "trials": len(own),
            "extra_steps": float(own.number("extra_steps").mean()),
            "sim_time_s": float(np.median(own.number("sim_time_s"))),
            "placed_part_shift_mm": float(np.nan_to_num(own.number("placed_part_shift_mm")).max()),
        }
        for (scenario, method), own in group_by_method(right).items()
    ]
