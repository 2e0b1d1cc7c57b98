"""Build the configuration of a trial from keyword arguments."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from apo_bench.errors import require_known
from apo_bench.records import NOISE_LEVEL, NOISE_MODEL, SETTINGS, TrialConfig, parse_noise_level
from apo_bench.scenario import Scenario, load_scenario


def configure_trial(scenario: str | Path | Scenario, **settings: Any) -> tuple[TrialConfig, Scenario]:
    """The configuration and the scenario of a trial.

    Args:
        scenario: A name, the path of a scenario file, or the scenario itself.
        settings: Settings of `TrialConfig`, and `noise_level` in place of `noise_mm` and `noise_deg`. The default
            clearance is that of the scenario.

    Raises:
        InputError: An unknown setting, or a value that is not allowed.
    """
    for name in settings:
        require_known("setting", name, (*SETTINGS, NOISE_LEVEL.name))
    loaded = load_scenario(scenario)
    named = scenario.name if isinstance(scenario, Scenario) else str(scenario)
    usual: dict[str, Any] = {"scenario": named, "clearance_mm": loaded.clearance_mm}
    return TrialConfig(**(usual | expand_noise_level(settings))), loaded


def expand_noise_level(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with `noise_mm` and `noise_deg` in place of a `noise_level`, unless one of the two is stated.

    Raises:
        InputError: The level is not allowed.
    """
    rest = dict(settings)
    if NOISE_LEVEL.name not in rest:
        return rest
    level = parse_noise_level(rest.pop(NOISE_LEVEL.name), rest.get("pose_source", NOISE_MODEL))
    return dict(zip(("noise_mm", "noise_deg"), level, strict=True)) | rest
