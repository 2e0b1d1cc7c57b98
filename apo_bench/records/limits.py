"""Wall time that things may take [s], where nothing else is said."""

from dataclasses import dataclass
from typing import final

CORRECTOR_LIMIT_S = 120.0
"""What one correction in a process of its own may take."""


@final
@dataclass(frozen=True)
class Limits:
    """Of a sweep; said of a trial whose process, or that of its corrector, died or was ended."""

    trial_s: float | None = 600.0
    """What one trial may take; None where trials had no process of their own."""
    corrector_s: float = CORRECTOR_LIMIT_S


USUAL_LIMITS = Limits()
