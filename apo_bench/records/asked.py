"""Settings of a trial as rows, files and options have them, and back."""

from collections.abc import Mapping
from typing import Any

from apo_bench.records.settings import SETTINGS, TrialSettings


def asked(settings: TrialSettings, scenario: str) -> dict[str, Any]:
    """The settings as they stand in a row.

    Args:
        scenario: The name of the scenario.
    """
    said = {info.column: getattr(settings, name) for name, info in SETTINGS.items()}
    return said | {"scenario": scenario, "salt": None if settings.salt is None else settings.salt.hash}


def settings_of(row: Mapping[str, Any], scenario: str) -> TrialSettings:
    """The settings of the trial that a row is of, without its salt, which no row tells.

    Args:
        scenario: A name, or the path of a scenario file.
    """
    said = {name: row.get(info.column, info.default) for name, info in SETTINGS.items()}
    return TrialSettings(**(said | {"scenario": scenario, "salt": None}))


def in_python(said: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by their names, in the units of Python, out of those by their options; other names stay."""
    values = dict(said)
    for name, info in SETTINGS.items():
        if info.keyword != name and info.keyword in values:
            value = values.pop(info.keyword)
            values[name] = value if info.scale == 1.0 else value * info.scale
    return values
