"""Correct many observations of one assembly at once: what they share is worked out once, the rest is one array."""

from collections.abc import Sequence
from math import ceil

import numpy as np

from apo_bench.assembly import Correction, Observation
from apo_bench.correction.checks.observation_checks import check_observations
from apo_bench.correction.contact.contact import ContactCorrector
from apo_bench.correction.robust.robust import RobustCorrector, contact_robust
from apo_bench.errors import InputError, require

BATCH = 150
"""Observations that are solved together, at most."""
LARGEST_JACOBIANS = 96_000
"""Entries of all their Jacobians: more would leave the cache of the processor."""


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
    require(
        not isinstance(observations, Observation) and isinstance(observations, Sequence),
        "correct_many needs a list of observations; ask `correct` for one, or make a list of them.",
    )
    require(
        isinstance(corrector, ContactCorrector | RobustCorrector),
        f"correct_many was given {corrector!r}; give a ContactCorrector, such as ContactCorrector('drop'), or a "
        "RobustCorrector.",
    )
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
