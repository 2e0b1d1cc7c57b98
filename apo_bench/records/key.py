"""What tells one trial of a sweep from another."""

from collections.abc import Mapping
from operator import itemgetter
from typing import Any

from apo_bench.records.asked import asked
from apo_bench.records.settings import SETTINGS, TrialSettings

Key = tuple[Any, ...]
"""The columns `KEY` of a row."""
KEY = tuple(info.column for info in SETTINGS.values() if info.key)
_VALUES = itemgetter(*KEY)


def row_key(row: Mapping[str, Any]) -> Key:
    """The key of the trial that a row is of."""
    key: Key = _VALUES(row)
    return key


def trial_key(trial: TrialSettings, scenario: str) -> Key:
    """The key of a trial.

    Args:
        scenario: The name of the scenario.
    """
    return row_key(asked(trial, scenario))
