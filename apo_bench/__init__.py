"""Does a robot's replay of an observed assembly fit, with and without correction by face contacts?

Importing the package registers its environments with Gymnasium and does nothing else: what is exported is imported when
it is first asked for. `demonstrate`, `replay`, `run_trial`, `run_sweep` and pictures need MuJoCo; the rest does not.
Static types are those of `__init__.pyi`.
"""

import sys
from os.path import dirname

if sys.argv[:1] == ["-m"] and not sys.flags.safe_path and sys.path[0] != dirname(dirname(__file__)):
    del sys.path[0]  # the current folder, where `python -m apo_bench` would find any file that is called like a package

from importlib import import_module
from types import MappingProxyType
from typing import Any

import gymnasium

__version__ = "0.1.0"

gymnasium.register(id="APOReplay-v0", entry_point="apo_bench.envs.apo_replay:APOReplay")
gymnasium.register(id="APOTrack-v0", entry_point="apo_bench.envs.apo_track:APOTrack")
gymnasium.register(id="APOInsert-v0", entry_point="apo_bench.envs.limited:make_insert")
gymnasium.register(id="APOAssemble-v0", entry_point="apo_bench.envs.limited:make_assemble")

_EXPORTS = MappingProxyType(
    {
        "Arm": "apo_bench.simulation.arms.arm",
        "Assembly": "apo_bench.assembly.topology",
        "ContactCorrector": "apo_bench.correction.contact.contact",
        "CorrectPoses": "apo_bench.envs.corrected",
        "Correction": "apo_bench.assembly.correction_record",
        "Criteria": "apo_bench.records.thresholds",
        "Demonstration": "apo_bench.assembly.demonstration",
        "ExecutionConfig": "apo_bench.simulation.execution.config",
        "Film": "apo_bench.simulation.scene.render",
        "Flatten": "apo_bench.envs.flatten",
        "InputError": "apo_bench.errors",
        "Layout": "apo_bench.assembly.demonstration",
        "Observation": "apo_bench.assembly.observation",
        "Plan": "apo_bench.assembly.plan",
        "RateTable": "apo_bench.benchmark.rate_table",
        "ReplayResult": "apo_bench.assembly.replay_result",
        "Scenario": "apo_bench.scenario.scenario",
        "Scene": "apo_bench.simulation.scene.scene",
        "SweepConfig": "apo_bench.benchmark.sweeps.grid",
        "TrialConfig": "apo_bench.records.settings",
        "Verdict": "apo_bench.judging.verdict",
        "build_scene": "apo_bench.simulation.scene.scene",
        "aim_camera": "apo_bench.simulation.scene.render",
        "check_scenario": "apo_bench.importers.from_python",
        "correct": "apo_bench.correction.correctors",
        "correct_many": "apo_bench.correction.batches",
        "demonstrate": "apo_bench.simulation.human.demonstration",
        "detect_contacts": "apo_bench.perception.detection.greedy_detection",
        "draw_layout": "apo_bench.scenario.layout",
        "evaluate": "apo_bench.benchmark.evaluation",
        "evaluate_policy": "apo_bench.envs.evaluation",
        "explain": "apo_bench.correction.explanation",
        "fit_plan": "apo_bench.trial.plan_fitting",
        "import_assembly": "apo_bench.importers.from_python",
        "import_part": "apo_bench.importers.from_python",
        "judge": "apo_bench.judging.verdict",
        "load_scenario": "apo_bench.scenario.scenario_file",
        "observe": "apo_bench.perception.observation.observe",
        "draw_picture": "apo_bench.simulation.scene.render",
        "read_arm": "apo_bench.simulation.arms.building",
        "read_observation": "apo_bench.formats.observation",
        "replay": "apo_bench.simulation.execution.controller",
        "run_sweep": "apo_bench.benchmark.sweeps.sweep",
        "run_trial": "apo_bench.trial.run",
        "save_scenario": "apo_bench.scenario.saving",
        "show_scenario": "apo_bench.simulation.scene.show",
    }
)
"""Name -> the module that it is imported from when it is first asked for."""

__all__ = ("__version__", *_EXPORTS)


def __getattr__(name: str) -> Any:
    """What is exported, imported when it is first asked for."""
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module 'apo_bench' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})
