"""How a correction ends: a status with its sentence.

Goals that come without a word, measured: how wide they leave the contacts, and what is said of that.

Is a relation wrong? The chi-square test of a correction.

If every relation is right and the stated noise is too, the squared length of the correction is chi-square distributed
with as many degrees of freedom as the contacts fix. A redundant contact that is wrong contradicts the others; one that
is not redundant only asks for a correction that is too long.
"""

from collections.abc import Callable, Collection
from dataclasses import replace
from math import isfinite, sqrt

import numpy as np
from scipy.special import chdtrc

from apo_bench.assembly import (
    Assembly,
    Correction,
    Observation,
    faces_away,
    largest,
    largest_gap,
    project_observation,
)
from apo_bench.assembly.equations import equations
from apo_bench.assembly.pattern import pattern
from apo_bench.correction.solvers import (
    LENGTH_M,
    SINGULAR_CUT_OFF,
    SMALLEST,
    Solution,
    demanded,
    least_step,
    plays,
    violations,
)
from apo_bench.geometry import Array, frozen, remembered
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
    return f"{of} holds within {gap_m * 1e3:g} mm" if status == "converged" else outcomes.sentence(status)


def opposing(observation: Observation, correction: Correction) -> Correction:
    """A correction as it is; `inconsistent` in place of `converged` where faces that should touch look the same way."""
    if not correction.ok:
        return correction
    assembly = observation.assembly
    away = faces_away(assembly, observation.start, correction.poses)
    if correction.dropped:
        away &= assembly.without(correction.dropped)
    if not away.any():
        return correction
    contact = assembly.given(assembly.relations()[int(np.argmax(away))].contact)
    sentence = (
        f"the faces of {contact} look the same way at the goals that were found; a part was probably seen turned over"
    )
    return replace(correction, status="inconsistent", sentence=sentence, covariance=None)


def refused_correction(observation: Observation) -> Correction:
    """What was seen, unchanged: an operation without a pose has no motion parameter to start from."""
    missing = int(np.argmin(observation.observed))
    now = largest_gap(observation.assembly, observation.start, observation.poses)
    return Correction(observation.poses, "not_seen", outcomes.sentence("not_seen", operation=missing), (), now, now, 0)


TWIST_UNITS = (1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M)


def goals_as_given(observation: Observation, goals: Array, sentence: str) -> Correction:
    """A correction of these goals, (n, 4, 4), to be executed as it is, whatever gap it leaves.

    Args:
        sentence: The sentence, if a contact does not hold within `observation.gap_m`.

    Returns:
        `converged`; `not_finite`, and what was seen, if a number is not finite.
    """
    before = largest_gap(observation.assembly, observation.start, observation.poses)
    if not np.isfinite(goals).all():
        return Correction(observation.poses, "not_finite", outcomes.sentence("not_finite"), (), before, before, 0)
    e, J = equations(observation.assembly, observation.start, goals).linearised(goals)
    _, rank = least_step(J / np.tile(TWIST_UNITS, len(goals)), e, SINGULAR_CUT_OFF)
    freed = tuple(int(k) for k in np.flatnonzero((goals != observation.poses).any(axis=(1, 2)))[::-1])
    after = largest(e)
    sentence = status_sentence("converged", observation.gap_m) if after <= observation.gap_m else sentence
    return Correction(goals, "converged", sentence, freed, before, after, rank)


def gap_of(observation: Observation, goals: Array, dropped: Collection[str] = ()) -> float:
    """The largest |e| at goals (n, 4, 4) of what is asked of the contacts, [m]; or how far an inequality is violated.

    Args:
        dropped: Relations, or single contacts, that do not count.
    """
    observation = project_observation(observation)
    plain = equations(observation.assembly, observation.start, observation.poses)
    system, exact, inequalities = demanded(plain, observation.assembly, observation.play_m)
    return largest(violations(system, exact, inequalities, goals)[observation.assembly.without(dropped)])


def as_it_ends(observation: Observation, mended: Callable[[Observation], Array], done: str) -> Correction:
    """What a method that promises nothing makes of an observation, with the gap that it leaves in the sentence.

    Args:
        mended: Goals (n, 4, 4) out of an observation of which every operation was seen.
        done: What the method did, the beginning of the sentence.

    Returns:
        As `goals_as_given`, or `not_seen`; what was seen where there is no contact.
    """
    if not observation.observed.all():
        return refused_correction(observation)
    goals = mended(observation) if observation.assembly.relations() else observation.poses
    left_m = largest_gap(observation.assembly, observation.start, goals)
    return goals_as_given(observation, goals, f"{done}; the largest gap left is {left_m * 1e3:.2g} mm")


TEST_LEVEL = 0.01
"""False alarms that are accepted."""
ROUNDING = 1e-13
"""Part of the largest diagonal entry that is added to all: redundant contacts without play have no other."""
CONTRADICTION_M = 0.05e-3
"""Standard deviation that contradictory contacts are given, [m], so that their contradiction can be measured. They hold
if no compact equation, which counts sqrt(v) times at the centre of v vertices, is off by more."""


@remembered
def fit_deviation(assembly: Assembly, play_m: float) -> Array:
    """The standard deviation of each compact equation, (3 c,), [m]: a contact that fits is uniform within its play.

    A row stands for all vertices of its contact, so it is off by as much as they are together.
    """
    count, unit_m = plays(assembly, play_m)
    each = unit_m / sqrt(3.0) * np.sqrt(count * np.diff(pattern(assembly).begin))
    return frozen(np.repeat(each, 3))


def p_value(chi_square: float, degrees: int) -> float:
    """The chance of a chi-square at least as large, of so many degrees of freedom; 1 where nothing is tested."""
    if not isfinite(chi_square):
        return 0.0
    return float(chdtrc(degrees, chi_square)) if degrees else 1.0


def softened_chi_square(z: Array, Jt: Array, S: Array) -> Array:
    """The squared length, (b,), of corrections z, (b, 6 n), if equations may be off by covariance S, (3 c, 3 c), [m^2].

    Near z equations are linear in the little that play leaves, so the shortest sum of what is left of z and of what
    equations are off by is r^t (J J^t + S)^-1 r, with r = J z what the observation was off by.
    """
    # r is what the observation was off by, Gaussian with covariance J J^t of noise and S of play.
    J = np.swapaxes(Jt, 1, 2)
    A = J @ Jt + S
    r = J @ z[..., None]
    diagonal = A.reshape(len(A), -1)[:, :: A.shape[1] + 1]
    diagonal += ROUNDING * diagonal.max(axis=1, initial=SMALLEST)[:, None]
    return np.asarray((r * np.linalg.solve(A, r)).sum(axis=(1, 2)))
