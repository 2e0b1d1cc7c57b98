"""The corrector of the paper: every contact equation, every motion parameter, all at once (Sections 2.3 and 3.3)."""

from __future__ import annotations

import numpy as np

from apo_bench import outcomes
from apo_bench.correction.equations import equations, gap, largest
from apo_bench.correction.newton import Solution, solve
from apo_bench.program import Correction, Observation


def paper(seen: Observation) -> Correction:
    """Change what was seen by as little as makes all contacts hold, lost ones too.

    Returns:
        `converged` if every |e| is within `seen.gap_m`; otherwise `not_seen` (nothing was changed), `inconsistent`,
        `not_converged` or `not_finite` (nothing was changed), with its sentence.
    """
    if not seen.seen.all():
        return _refused(seen)
    system = equations(seen.assembly, seen.start, seen.goals)
    freed = system.variables(len(seen.goals))
    before = largest(system.residual(seen.goals))
    found = solve(system, seen.goals, freed)
    status = _status(found, seen.gap_m)
    return Correction(
        goals=found.goals,
        status=status,
        sentence=sentence(status, seen.gap_m),
        freed=freed,
        gap_before_m=before,
        gap_after_m=found.gap_m,
        rank=found.rank,
        trace=found.trace,
    )


def sentence(status: str, gap_m: float) -> str:
    """What a status means."""
    if status == "converged":
        return f"every contact holds within {gap_m * 1e3:g} mm"
    return outcomes.sentence(status)


def _status(found: Solution, gap_m: float) -> str:
    if not found.finite:
        return "not_finite"
    if found.gap_m <= gap_m:
        return "converged"
    return "inconsistent" if found.at_rest else "not_converged"


def _refused(seen: Observation) -> Correction:
    """What was seen, unchanged: an operation without a pose has no motion parameter to start from."""
    missing = int(np.argmin(seen.seen))
    now = gap(seen.assembly, seen.start, seen.goals)
    return Correction(seen.goals, "not_seen", outcomes.sentence("not_seen", operation=missing), (), now, now, 0)
