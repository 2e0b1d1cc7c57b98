"""Correction of many observations of one assembly in batches, which are faster than one observation at a time."""

from collections.abc import Sequence
from math import ceil
from typing import Any

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation
from apo_bench.correction.checks.correction_checks import check_observations
from apo_bench.correction.contact.contact import ContactCorrector
from apo_bench.correction.correctors import correct, resolve_corrector
from apo_bench.correction.robust.robust import RobustCorrector
from apo_bench.errors import require
from apo_bench.records import CORRECTOR

BATCH = 150
"""Most observations that are solved together."""
_LARGEST_JACOBIANS = 96_000
"""Most entries of the Jacobians of a batch: more would not fit the cache of the processor."""


@check_arguments
def correct_many(observations: Sequence[Observation], corrector: Any = CORRECTOR) -> tuple[Correction, ...]:
    """Correct many observations of one assembly.

    `contact` and `contact-robust` correct them in batches: faster than `correct`, the same up to rounding.
    `contact-robust` then corrects observations whose test fails one by one, as other correctors do with all.

    Args:
        observations: Observations of the same assembly with the same start poses and play.
        corrector: As for `correct`.

    Returns:
        The corrections, in the order of the observations.

    Raises:
        InputError: The observations differ in assembly, start or play, or a covariance is not positive definite.
    """
    if not observations:
        return ()
    first = observations[0]
    check_observations(observations, [f"observation {i + 1}" for i in range(len(observations))])
    for i, observation in enumerate(observations, start=1):
        require(
            _is_comparable(first, observation),
            f"observation {i} is of another assembly, start or play than observation 1; "
            "correct those together that share them.",
        )
    chosen = resolve_corrector(corrector)
    if not isinstance(chosen, ContactCorrector | RobustCorrector):
        return tuple(correct(observation, corrector) for observation in observations)
    # Entries of the Jacobian of one observation: three equations per contact, six unknowns per operation.
    entries = 3 * len(first.assembly.relations()) * 6 * len(first.assembly)
    most = min(BATCH, max(1, _LARGEST_JACOBIANS // max(1, entries)))
    # Batches of equal size, since a small last one takes nearly as long as others.
    size = ceil(len(observations) / ceil(len(observations) / most))
    batches = (observations[i : i + size] for i in range(0, len(observations), size))
    return tuple(correction for some in batches for correction in chosen.together(some))


def _is_comparable(first: Observation, other: Observation) -> bool:
    """Whether two observations have the same assembly, start poses and play."""
    same = other.assembly is first.assembly and other.play_m == first.play_m
    return same and {part: T.tobytes() for part, T in other.start.items()} == {
        part: T.tobytes() for part, T in first.start.items()
    }
