"""What robots that feel found out about themselves, beside what their errors were drawn with."""

import math

import numpy as np

from apo_bench.benchmark.analysis.line import Line
from apo_bench.benchmark.analysis.place import Place, by_place
from apo_bench.benchmark.analysis.rates import Records, root_mean_square
from apo_bench.records import assumed_error, robot_sigmas
from apo_bench.records.run.trials import Trials, trials_of


def felt(records: Records) -> list[Line]:
    """One line per cell of a robot that felt, sorted as `tally` sorts.

    Lengths [mm] and angles [deg] are root mean squares of vectors: what the error of the base was drawn with, what the
    robot was told of it (None if nothing), as it felt it in the end, and how far that may be wrong by its own account.
    """
    trials = trials_of(records)
    own = trials.where(~np.isnan(trials.number("probe_contacts")))
    return [_line(place, felt_there) for place, felt_there in by_place(own).items()]


def _line(place: Place, trials: Trials) -> Line:
    told = assumed_error(place.assumed_robot_error, place.robot_error)
    drawn_mm, drawn_deg = _as_vector(place.robot_error)
    stated_mm, stated_deg = (None, None) if told is None else _as_vector(told)
    return {
        "place": place,
        "trials": len(trials),
        "probe_contacts": float(trials.number("probe_contacts").mean()),
        "refused": int(trials.number("probe_contacts_rejected").sum()),
        "drawn_mm": drawn_mm,
        "stated_mm": stated_mm,
        "estimated_mm": root_mean_square(trials.number("base_error_estimate_mm")),
        "sure_mm": root_mean_square(trials.number("base_error_std_mm")),
        "drawn_deg": drawn_deg,
        "stated_deg": stated_deg,
        "estimated_deg": root_mean_square(trials.number("base_error_estimate_deg")),
        "sure_deg": root_mean_square(trials.number("base_error_std_deg")),
    }


def _as_vector(name: str) -> tuple[float, float]:
    """Root mean squares of vectors of three axes, of where hand and eye believe each other."""
    mm, deg = robot_sigmas(name).hand_eye
    return math.sqrt(3.0) * mm, math.sqrt(3.0) * deg
