"""Correctors as a trial knows them: those of `correction`, and those that need a simulator."""

from typing import Any

from apo_bench.names import resolve
from apo_bench.records.short_names import SIMULATED


def with_simulated(corrector: Any) -> Any:
    """What to pass to `correct`: the function, where a name stands for a corrector that needs a simulator."""
    known = isinstance(corrector, str) and corrector in SIMULATED
    return resolve(corrector, SIMULATED, "corrector") if known else corrector
