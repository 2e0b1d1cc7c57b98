"""Does a robot's replay of an observed assembly fit, with and without correction by face contacts?

Importing the package registers `APOReplay-v0` with Gymnasium and does nothing else; what needs MuJoCo is imported
by `gymnasium.make`. Without a simulator: `read_observation`, `recognise`, `correct`, `correct_many` and `explain`.
"""

from __future__ import annotations

from importlib import import_module
from types import MappingProxyType
from typing import Any

import gymnasium

__version__ = "0.1.0"
__all__ = [
    "ContactCorrector",
    "Corrected",
    "__version__",
    "correct",
    "correct_many",
    "explain",
    "load_scenario",
    "read_observation",
    "recognise",
]

gymnasium.register(id="APOReplay-v0", entry_point="apo_bench.envs.apo_replay:APOReplay")

_LATER = MappingProxyType(
    {
        "ContactCorrector": "apo_bench.correction.contact",
        "Corrected": "apo_bench.envs.corrected",
        "correct": "apo_bench.correction.correctors",
        "correct_many": "apo_bench.correction.many",
        "explain": "apo_bench.correction.explanation",
        "load_scenario": "apo_bench.scenario.file",
        "read_observation": "apo_bench.files.observation",
        "recognise": "apo_bench.recognition.contacts",
    }
)


def __getattr__(name: str) -> Any:
    """What is exported, imported when it is first asked for."""
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module 'apo_bench' has no attribute '{name}'")
