"""Wall time limits of the trials of a sweep."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True)
class Limits:
    """Limits in force when a trial was lost, that is, ended without a result."""

    trial_s: float | None = 600.0
    """Wall time of one trial; None if trials do not run in processes of their own."""


USUAL_LIMITS = Limits()
