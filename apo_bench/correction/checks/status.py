"""How a correction ends: a status with its sentence."""

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Correction, Observation, find_faces_away, measure_largest_gap
from apo_bench.correction.solvers import Solution
from apo_bench.records import outcomes


def solver_status(solution: Solution, left_m: float, gap_m: float) -> str:
    """How the solver of the paper ended, of `paper` and its kin: `converged` if what is left, [m], is within `gap_m`.

    Otherwise `inconsistent` where it came to rest with a gap open, and `not_converged` where it still moved. `contact`
    has a rule of its own (`contact._status`).
    """
    if not solution.finite:
        return "not_finite"
    if left_m <= gap_m:
        return "converged"
    return "inconsistent" if solution.at_rest else "not_converged"


def status_sentence(status: str, gap_m: float, of: str = "every contact") -> str:
    """What a status means; `of` says which contacts were looked at."""
    return f"{of} holds within {gap_m * 1e3:g} mm" if status == "converged" else outcomes.describe_outcome(status)


def check_facing(observation: Observation, correction: Correction) -> Correction:
    """A correction as it is; `inconsistent` in place of `converged` where faces that should touch look the same way."""
    if not correction.ok:
        return correction
    assembly = observation.assembly
    away = find_faces_away(assembly, observation.start, correction.poses)
    if correction.dropped:
        away &= assembly.without(correction.dropped)
    if not away.any():
        return correction
    contact = assembly.given(assembly.relations()[int(np.argmax(away))].contact)
    sentence = (
        f"the faces of {contact} look the same way at the poses that were found; a part was probably seen turned over"
    )
    return replace(correction, status="inconsistent", sentence=sentence, covariance=None)


def refuse_correction(observation: Observation) -> Correction:
    """What was observed, unchanged: an operation without a pose has no motion parameter to start from."""
    missing = int(np.argmin(observation.observed))
    now = measure_largest_gap(observation.assembly, observation.start, observation.poses)
    return Correction(
        observation.poses, "not_seen", outcomes.describe_outcome("not_seen", operation=missing), (), now, now, 0
    )
