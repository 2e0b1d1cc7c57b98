"""To see operations of a demonstration again: what a corrector may ask for."""

from collections.abc import Collection
from typing import Protocol, runtime_checkable

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Observation


@runtime_checkable
class Look(Protocol):
    """What a corrector is handed that may look again: called with operations, counted from 0, it looks once at them.

    Each look has errors of its own, by the noise of the first, so it may be an outlier or a miss as well.
    """

    @property
    def left(self) -> int:
        """Looks that may still be taken."""

    def __call__(self, operations: Collection[int]) -> Observation:
        """What is seen this time; operations that were not asked for are not `seen`.

        Raises:
            InputError: No look is left, or there is no such operation.
        """


@runtime_checkable
class LookingCorrector(Protocol):
    """A corrector that can ask; one without `looking` is never handed a look."""

    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation that cannot be looked at again."""

    def looking(self, observation: Observation, look: Look) -> Correction:
        """Correct an observation, looking again as often as is allowed and needed."""
