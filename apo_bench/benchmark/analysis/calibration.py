"""Compare the stated uncertainty of corrections, and the contacts that their test suspects, with the truth."""

from typing import Any

import numpy as np

from apo_bench.benchmark.analysis.condition import rank_contact_source, rank_method
from apo_bench.benchmark.analysis.rates import Rate, Records, compute_root_mean_square
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.records import knows_truth
from apo_bench.records.run.trials import Trials, make_trials

_AXES = ("scenario", "noise", "contact_source", "method")


def tabulate_calibration(records: Records) -> list[Line]:
    """Return one line per scenario, noise, contact source and method except the oracle.

    Each line covers every noise level, human error scale and clearance. It states how often the truth lies in the 95 %
    region, and the errors of planned poses along directions that contacts fix and leave free. It also states how often
    the test fails, and how often it then suspects the wrong contact.
    """
    trials = make_trials(records)
    counted = ~np.isnan(trials.number("success")) & ~np.isnan(trials.number("noise_mm"))
    groups = trials.where(counted & ~trials.holds("method", knows_truth)).parts(_AXES)
    return [_make_line(dict(zip(_AXES, key, strict=True)), groups[key]) for key in sorted(groups, key=_sort_key)]


def _sort_key(key: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the sort key of a line: scenario, noise, given contacts first, method."""
    scenario, noise, contact_source, method = key
    return scenario, noise, rank_contact_source(contact_source), rank_method(method), method


def _make_line(axes: Line, trials: Trials) -> Line:
    """Return the line of a group of trials.

    Args:
        axes: Columns that identify the line.
    """
    planned = trials.where(~np.isnan(trials.number("planned_error_fixed_mm")))
    fixed = planned.number("planned_error_fixed_mm")
    clearance = planned.number("clearance_mm")
    loose = clearance > 0
    inside = trials.number("inside_95")
    passes = trials.number("consistent")
    # failed tests of trials with a wrong contact that is known
    known = trials.where((passes == 0) & ~trials.holds("wrong_contact", (None,).__contains__))
    # whether the suspects contain the wrong contact
    named = [
        one in (all_ or ()) for one, all_ in zip(known.values("wrong_contact"), known.values("suspects"), strict=True)
    ]
    return axes | {
        "planned": len(planned),
        "covered": Rate(int(np.nansum(inside)), int((~np.isnan(inside)).sum())),
        "fixed_mm": compute_root_mean_square(fixed),
        "fixed_over_clearance": compute_root_mean_square(fixed[loose] / clearance[loose]),
        "free_mm": compute_root_mean_square(np.nan_to_num(planned.number("planned_error_free_mm"))),
        "failed_tests": Rate(int((passes == 0).sum()), int((~np.isnan(passes)).sum())),
        "culprits": Rate(sum(named), len(named)),
    }
