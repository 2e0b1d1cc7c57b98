"""Status and sentence with which a correction ends."""

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Correction, Observation, find_faces_away, measure_largest_gap
from apo_bench.correction.solvers import Solution
from apo_bench.records import outcomes


def solver_status(solution: Solution, left_m: float, gap_m: float) -> str:
    """The status of the paper's solver, for `paper` and related methods: `converged` if the gap, [m], is within
    `gap_m`.

    Otherwise `inconsistent` if the solver converged with an open gap, and `not_converged` if it still moved. `contact`
    has another rule (`contact._status`).
    """
    if not solution.finite:
        return "not_finite"
    if left_m <= gap_m:
        return "converged"
    return "inconsistent" if solution.at_rest else "not_converged"


def status_sentence(status: str, gap_m: float, of: str = "every contact") -> str:
    """A status in words; `of` names the contacts that were checked."""
    return f"{of} holds within {gap_m * 1e3:g} mm" if status == "converged" else outcomes.describe_outcome(status)


def check_facing(observation: Observation, correction: Correction) -> Correction:
    """Change `converged` to `inconsistent` where faces in contact look the same way; other corrections stay
    unchanged.
    """
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
    """The correction `not_seen`, with the observed poses: an operation was not observed."""
    missing = int(np.argmin(observation.observed))
    now = measure_largest_gap(observation.assembly, observation.start, observation.poses)
    return Correction(
        observation.poses, "not_seen", outcomes.describe_outcome("not_seen", operation=missing), (), now, now, 0
    )
