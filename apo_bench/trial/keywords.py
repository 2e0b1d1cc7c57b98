"""The configuration of a trial from keywords."""

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
    values: dict[str, Any] = {"scenario": named, "clearance_mm": loaded.clearance_mm}
    if NOISE_LEVEL.name in settings:
        level = parse_noise_level(settings.pop(NOISE_LEVEL.name), settings.get("pose_source", NOISE_MODEL))
        values |= zip(("noise_mm", "noise_deg"), level, strict=True)
    return TrialConfig(**(values | settings)), loaded
