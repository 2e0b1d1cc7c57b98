"""Percentiles of the largest contact gap at observed and at planned poses."""

import numpy as np

from apo_bench.benchmark.analysis.condition import group_by_condition
from apo_bench.benchmark.analysis.rates import Records
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.records import uses_contacts
from apo_bench.records.run.trials import make_trials

_PERCENTILES = {"5": 5.0, "median_mm": 50.0, "95": 95.0}  # end of a column's name -> percentile
_COLUMNS = {"observed": "gap_before_mm", "planned": "gap_after_mm"}  # kind of poses -> column of records


def tabulate_gaps(records: Records) -> list[Line]:
    """Return one line, [mm], per condition of a method that uses contacts, over its trials with a plan."""
    trials = make_trials(records)
    known = ~np.isnan(trials.number("gap_before_mm")) & ~np.isnan(trials.number("gap_after_mm"))
    lines = []
    for condition, own in group_by_condition(trials.where(known & trials.holds("method", uses_contacts))).items():
        line: Line = {"condition": condition, "trials": len(own)}
        for kind, column in _COLUMNS.items():
            values = np.percentile(own.number(column), list(_PERCENTILES.values())).tolist()
            line |= {f"{kind}_{name}": value for name, value in zip(_PERCENTILES, values, strict=True)}
        lines.append(line)
    return lines
