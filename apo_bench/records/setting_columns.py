"""The settings of a trial as columns of its row: which of them tell trials apart, and settings out of rows and options.

Trials of one sweep differ in the columns `KEY`.
"""

from collections.abc import Mapping
from operator import itemgetter
from typing import Any

from apo_bench.records.settings import SETTINGS, TrialSettings

Key = tuple[Any, ...]
"""The columns `KEY` of a row."""
KEY = tuple(info.column for info in SETTINGS.values() if info.key)
_KEY_VALUES = itemgetter(*KEY)


def row_key(row: Mapping[str, Any]) -> Key:
    """The key of the trial that a row is of."""
    key: Key = _KEY_VALUES(row)
    return key


def trial_key(trial: TrialSettings, scenario: str) -> Key:
    """The key of a trial.

    Args:
        scenario: The name of the scenario.
    """
    return row_key(setting_columns(trial, scenario))


def setting_columns(settings: TrialSettings, scenario: str) -> dict[str, Any]:
    """The settings as they stand in a row.

    Args:
        scenario: The name of the scenario.
    """
    columns = {info.column: getattr(settings, name) for name, info in SETTINGS.items()}
    return columns | {"scenario": scenario, "salt": None if settings.salt is None else settings.salt.hash}


def settings_of(row: Mapping[str, Any], scenario: str) -> TrialSettings:
    """The settings of the trial that a row is of, without its salt, which no row tells.

    Args:
        scenario: A name, or the path of a scenario file.
    """
    values = {name: row.get(info.column, info.default) for name, info in SETTINGS.items()}
    return TrialSettings(**(values | {"scenario": scenario, "salt": None}))


def in_python(options: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by their names, in the units of Python, out of those by their options; other names stay."""
    values = dict(options)
    for name, info in SETTINGS.items():
        if info.keyword != name and info.keyword in values:
            value = values.pop(info.keyword)
            values[name] = value if info.scale == 1.0 else value * info.scale
    return values
