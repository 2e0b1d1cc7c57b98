"""The scene of a trial, compiled for those of its settings that shape it."""

from typing import Any

from apo_bench.records.settings import SETTINGS, TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario
from apo_bench.simulation.scene.scene import Scene, build_scene

_SHAPING = tuple(name for name, info in SETTINGS.items() if info.scene)


def scene_of(settings: TrialSettings, scenario: Scenario | None = None) -> Scene:
    """Compile the scene of a trial.

    Args:
        scenario: That of the settings, if it is loaded already.

    Raises:
        InputError: There is no such scenario or arm, or a part cannot have the clearance.
    """
    found = load_scenario(settings.scenario) if scenario is None else scenario
    return build_scene(found, **{name: getattr(settings, name) for name in _SHAPING})


def scene_key(settings: TrialSettings) -> tuple[Any, ...]:
    """Equal where the same scene serves."""
    return (settings.scenario, *(getattr(settings, name) for name in _SHAPING))
