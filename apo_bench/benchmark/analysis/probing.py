"""Compare the estimates of robots that probe with the standard deviations that their errors were drawn with."""

import math

import numpy as np

from apo_bench.benchmark.analysis.condition import Condition, group_by_condition
from apo_bench.benchmark.analysis.rates import Records, compute_root_mean_square
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.records import parse_assumed_error, parse_robot_error
from apo_bench.records.run.trials import Trials, make_trials


def tabulate_probing(records: Records) -> list[Line]:
    """Return one line per condition of a robot that probed, sorted as `tally` sorts.

    Lengths [mm] and angles [deg] are root mean squares of vectors: the base error as drawn, as assumed (None if
    unknown) and as estimated, and the stated standard deviation of the estimate.
    """
    trials = make_trials(records)
    own = trials.where(~np.isnan(trials.number("probe_contacts")))
    return [_make_line(condition, felt_there) for condition, felt_there in group_by_condition(own).items()]


def _make_line(condition: Condition, trials: Trials) -> Line:
    """Return the line of a condition; only trials of robots that probed are given."""
    assumed = parse_assumed_error(condition.assumed_robot_error, condition.robot_error)
    drawn_mm, drawn_deg = _root_mean_square_error(condition.robot_error)
    assumed_mm, assumed_deg = (None, None) if assumed is None else _root_mean_square_error(assumed)
    return {
        "condition": condition,
        "trials": len(trials),
        "probe_contacts": float(trials.number("probe_contacts").mean()),
        "rejected": int(trials.number("probe_contacts_rejected").sum()),
        "drawn_mm": drawn_mm,
        "assumed_mm": assumed_mm,
        "estimated_mm": compute_root_mean_square(trials.number("base_error_estimate_mm")),
        "std_mm": compute_root_mean_square(trials.number("base_error_estimate_std_mm")),
        "drawn_deg": drawn_deg,
        "assumed_deg": assumed_deg,
        "estimated_deg": compute_root_mean_square(trials.number("base_error_estimate_deg")),
        "std_deg": compute_root_mean_square(trials.number("base_error_estimate_std_deg")),
    }


def _root_mean_square_error(name: str) -> tuple[float, float]:
    """Return the root mean square length [mm] and angle [deg] of the base error of a robot error.

    A vector of three axes has sqrt(3) times the standard deviation per axis.
    """
    mm, deg = parse_robot_error(name).hand_eye
    return math.sqrt(3.0) * mm, math.sqrt(3.0) * deg
