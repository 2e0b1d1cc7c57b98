"""Wall time limits of a sweep."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True)
class Limits:
    """Limits that a lost trial may have met."""

    trial_s: float | None = 600.0
    """Wall time of one trial; None without a process for each trial."""


USUAL_LIMITS = Limits()
