"""Compare failure predictions of plans with the outcome in physics."""

import numpy as np

from apo_bench.benchmark.analysis.condition import group_by_method
from apo_bench.benchmark.analysis.rates import Rate, Records, was_executed
from apo_bench.benchmark.analysis.table_line import ALL, Line
from apo_bench.records.run.trials import Trials, make_trials


def tabulate_confusion(records: Records) -> list[Line]:
    """Return one line per scenario and method, sorted as `tally` sorts, and a last line over all.

    A plan predicts a success as demonstrated, which is called fitted here. The columns `stopped` and
    `same_operation` are about trials that were rightly predicted to fail. They count those in which the robot stopped
    at an operation, and at the predicted one. Trials without an executed plan count as not executed.
    """
    trials = make_trials(records)
    return [*(_make_line(*key, own) for key, own in group_by_method(trials).items()), _make_line(ALL, ALL, trials)]


def _make_line(scenario: str, method: str, trials: Trials) -> Line:
    """Return the line of a group of trials: counts of each prediction with each outcome."""
    counted = trials.where(~np.isnan(trials.number("success")))
    executed = counted.where(~np.isnan(counted.number("predicted_fails")) & was_executed(counted))
    fails = executed.number("predicted_fails") == 1
    fitted = executed.number("as_demonstrated") == 1
    caught = executed.where(fails & ~fitted)  # rightly predicted to fail
    stopped = caught.where(~np.isnan(caught.number("failure_operation")))
    right = int((fails != fitted).sum())  # the prediction agrees with the outcome
    return {
        "scenario": scenario,
        "method": method,
        "executed": len(executed),
        "right": right,
        "predicted_fit_fitted": int((~fails & fitted).sum()),
        "predicted_fit_failed": int((~fails & ~fitted).sum()),
        "predicted_fail_fitted": int((fails & fitted).sum()),
        "predicted_fail_failed": len(caught),
        "agreement": Rate(right, len(executed)).rate,
        "same_operation": int((stopped.number("predicted_operation") == stopped.number("failure_operation")).sum()),
        "stopped": len(stopped),
        "not_executed": len(counted) - len(executed),
        "excluded": len(trials) - len(counted),
    }
