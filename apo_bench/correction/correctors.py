"""Correct an observation by any corrector: by name, as `module:name`, or the object itself.

Correct many observations of one assembly at once: what they share is worked out once, the rest is one array.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import ceil
from typing import Any

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation, Reobserver, ReobservingCorrector, project_observation
from apo_bench.correction.checks.correction_checks import RIGID, check_correction, check_near, check_observations
from apo_bench.correction.checks.status import gap_of, goals_as_given, opposing
from apo_bench.correction.contact.contact import ContactCorrector
from apo_bench.correction.robust.robust import RobustCorrector, contact_robust
from apo_bench.errors import RAISED, ArgumentError, InputError, failed, kind, require
from apo_bench.geometry import Array, NotReal, is_rigid, real
from apo_bench.names import resolve
from apo_bench.records import CORRECTOR, CORRECTORS

_STATUSES = ("converged", "not_seen", "inconsistent", "doubtful", "not_converged", "not_finite")


class CorrectorMisbehaved(InputError):
    """A corrector raised an error, or returned what it must not: its own failure, not that of the request."""


@check_arguments
def correct(observation: Observation, corrector: Any = CORRECTOR, reobserve: Reobserver | None = None) -> Correction:
    """What the corrector makes of an observation.

    Args:
        corrector: A name out of `CORRECTORS`, `"package.module:name"`, or a callable `Observation -> Correction`;
            bare goals (n, 4, 4) in place of a `Correction` are measured and wrapped.
        reobserve: Observes operations again. A corrector with a method `correct_and_reobserve` (`ReobservingCorrector`)
            gets it, and that method is called in place of the corrector; any other gets nothing.

    Raises:
        InputError: There is no such corrector, or the observation makes no sense.
        CorrectorMisbehaved: It raised an error, or returned something else, or a schedule that makes no sense.
    """
    check_observations((observation,))
    chosen = checked_corrector(corrector)
    name = corrector if isinstance(corrector, str) else getattr(chosen, "__name__", type(chosen).__name__)
    ours = _ours(chosen)
    # The equations know planes alone, so correctors of the package get round faces lowered to planes; `contact` lowers
    # by itself what others hand it, and leaves this as it is.
    flat = project_observation(observation)
    given = flat if ours else observation
    try:
        reobserves = reobserve is not None and isinstance(chosen, ReobservingCorrector)
        returned = chosen.correct_and_reobserve(given, reobserve) if reobserves else chosen(given)
        correction = _admitted(returned, flat, chosen, name)
        if flat is observation or correction.believed is None:
            return correction
        return replace(correction, believed=replace(correction.believed, assembly=observation.assembly))
    except InputError as error:
        if ours or isinstance(error, CorrectorMisbehaved):
            raise
        if isinstance(error, ArgumentError):
            raise CorrectorMisbehaved(str(failed(f"the corrector '{name}'", error))) from error
        raise CorrectorMisbehaved(str(error)) from error
    except RAISED as error:
        raise CorrectorMisbehaved(str(failed(f"the corrector '{name}'", error))) from error


def checked_corrector(corrector: Any) -> Any:
    """The corrector that is named, or was given.

    Raises:
        InputError: There is no such corrector, or it is no function.
    """
    chosen = resolve(corrector, CORRECTORS, "corrector")
    if not callable(chosen) or isinstance(chosen, type):
        name = corrector if isinstance(corrector, str) else getattr(chosen, "__name__", type(chosen).__name__)
        raise InputError(
            f"the corrector '{name}' is {kind(chosen)}; give a function that takes an Observation "
            "and returns a Correction, or an object with such a __call__."
        )
    return chosen


def _admitted(returned: Any, observation: Observation, chosen: Any, name: str) -> Correction:
    """What a corrector returned, as a `Correction` that makes sense."""
    if isinstance(returned, Correction) and _ours(chosen):
        # `ContactCorrector` has asked already which faces look the same way (`Solved.away`, `_in_doubt`).
        return returned if isinstance(chosen, ContactCorrector) else opposing(observation, returned)
    if not isinstance(returned, Correction):
        return goals_as_given(
            observation, _bare(returned, len(observation.poses), name), "the corrector returned goals and no status"
        )
    require(
        returned.status in _STATUSES,
        f"the corrector '{name}' returned the status {returned.status!r}; return one of {', '.join(_STATUSES)}.",
    )
    goals = _bare(returned.poses, len(observation.poses), name)
    returned = check_correction(returned, observation.assembly, name)
    if returned.ok and not _ours(chosen):
        before = gap_of(observation, observation.poses)
        returned = replace(returned, gap_before_m=before, gap_after_m=gap_of(observation, goals))
    return returned


def _ours(corrector: Any) -> bool:
    """Whether a corrector comes with the package; what others say of the gaps that they leave is measured instead.

    Programs and files of answers, which `apo_bench.benchmark.scoring` stands for, are others.
    """
    while isinstance(corrector, partial):
        corrector = corrector.func
    return str(getattr(corrector, "__module__", "")).startswith(("apo_bench.correction.", "apo_bench.simulation."))


def _bare(returned: Any, n: int, name: str) -> Array:
    """Goals as an array (n, 4, 4), numbers that are not finite let through."""
    try:
        goals = real(returned)
    except NotReal as error:
        raise InputError(f"the corrector '{name}' returned complex numbers as goals; return real ones.") from error
    except (TypeError, ValueError):
        goals = np.zeros(0)
    if goals.shape != (n, 4, 4):
        description = f"an array of shape {returned.shape}" if isinstance(returned, np.ndarray) else kind(returned)
        raise InputError(
            f"the corrector '{name}' returned {description}; return a Correction or goals of shape ({n}, 4, 4)."
        )
    for k in np.flatnonzero(np.isfinite(goals).all(axis=(1, 2)) & ~is_rigid(goals)):
        raise InputError(
            f"the corrector '{name}' returned a goal for operation {k + 1} that is not a rigid pose; {RIGID}."
        )
    check_near(goals, name, "a goal for operation")
    return goals


BATCH = 150
"""Observations that are solved together, at most."""
LARGEST_JACOBIANS = 96_000
"""Entries of all their Jacobians: more would leave the cache of the processor."""


@check_arguments
def correct_many(
    observations: Sequence[Observation], corrector: ContactCorrector | RobustCorrector = contact_robust
) -> tuple[Correction, ...]:
    """Correct many observations of one assembly at once: as one after the other up to rounding, and faster.

    Args:
        observations: Observations of one and the same assembly with the same start poses and play.
        corrector: As `correct` has it by default; those whose test fails are then corrected one after the other.

    Raises:
        InputError: They are not, one makes no sense, or a covariance is not positive definite.
    """
    if not observations:
        return ()
    check_observations(observations)
    if (odd := _odd_one(observations)) is not None:
        raise InputError(
            f"observation {odd + 1} is of another assembly, start or play than observation 1; "
            "correct those together that share them."
        )
    one = observations[0].assembly
    entries = 3 * len(one.relations()) * 6 * len(one)
    most = min(BATCH, max(1, LARGEST_JACOBIANS // max(1, entries)))
    # Batches of equal size, since a small last one takes nearly as long as others.
    size = ceil(len(observations) / ceil(len(observations) / most))
    batches = (observations[i : i + size] for i in range(0, len(observations), size))
    return tuple(correction for some in batches for correction in corrector.together(some))


def _odd_one(observations: Sequence[Observation]) -> int | None:
    """The first that is not of the same assembly, start and play as the one at the head; None if all are."""
    first = observations[0]
    for i, observation in enumerate(observations):
        if (
            observation.assembly is not first.assembly
            or observation.play_m != first.play_m
            or observation.start.keys() != first.start.keys()
        ):
            return i
    poses = [observation.start[part] for observation in observations for part in first.start]
    starts = np.concatenate([np.zeros((0, 4)), *poses]).reshape(len(observations), -1)
    odd = np.flatnonzero((starts != starts[0]).any(axis=1))
    return int(odd[0]) if len(odd) else None
